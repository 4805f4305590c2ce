# The everyday commands; each is one plain cargo command, so that `just` is not needed.

# Format, lint, test, and compare with the committed results.
check: lint test verify

lint:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets -- -D warnings

test:
    cargo test --workspace

# Compare with the committed results; the larger experiments in their quick form.
verify:
    cargo run -p harness -- --check experiments/table3.toml experiments/table4.toml experiments/figure1.toml
    cargo run -p harness -- --check --quick experiments/table2.toml experiments/figure2.toml experiments/figure3.toml \
        experiments/figure4.toml experiments/subsets.toml experiments/random_orders.toml experiments/rays.toml \
        experiments/correlation.toml experiments/local_search.toml experiments/anytime.toml experiments/traversal.toml

# The paper's Table 4.
table4:
    cargo run -p harness -- experiments/table4.toml

# Times of builders against other libraries.
bench:
    cargo bench -p harness --bench build --features peers

docs:
    cargo doc --workspace --no-deps --open
