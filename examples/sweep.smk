# Shares the runs of a spec among the workers that Snakemake has, on this machine or on any cluster
# that one of its plug-ins reaches, and joins them:
#
#     snakemake --snakefile examples/sweep.smk --cores 8 --keep-going --rerun-incomplete \
#         --config spec=experiments/table4.toml out=mine
#
# The same command again performs only what is missing.
import subprocess

HARNESS = config.get("harness", "harness")
SPEC = config["spec"]
OUT = config["out"]
PARTS = f"{OUT}.parts"

listed = subprocess.run([HARNESS, "jobs", SPEC], check=True, capture_output=True, text=True).stdout
# The runs on the largest scenes come first.
IDS = [line.split(" ")[0] for line in listed.splitlines()]


rule join:
    input:
        expand(f"{PARTS}/{{id}}.done", id=IDS),
    params:
        folders=expand(f"{PARTS}/{{id}}", id=IDS),
    shell:
        "{HARNESS} merge {params.folders} --out {OUT}"


rule run:
    output:
        touch(f"{PARTS}/{{id}}.done"),
    shell:
        "{HARNESS} {SPEC} --run {wildcards.id} --resume --jobs 1 --out {PARTS}/{wildcards.id}"
