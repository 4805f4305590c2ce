# The everyday commands; each is one plain cargo command, so that `just` is not needed.

# What must hold on every commit: format, lint, test, examples, and the committed results.
check:
    .ci/run

lint:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets -- -D warnings

test:
    cargo test --workspace

# Compare Table 4 with the committed results; `check` compares all.
verify:
    cargo run -p harness -- --check experiments/table4.toml

# The paper's Table 4.
table4:
    cargo run -p harness -- experiments/table4.toml

docs:
    cargo doc --workspace --no-deps --open
