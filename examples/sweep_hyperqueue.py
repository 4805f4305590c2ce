"""Shares the runs of a spec among the workers of a HyperQueue server, and joins them:

    python3 examples/sweep_hyperqueue.py SPEC.toml OUT [SERVER_FOLDER]

Needs the package `hyperqueue`. Without the folder of a running server, starts one with a worker for
every processor of this machine. HARNESS names the program, by default `harness`. A run whose
process was killed is submitted again, at most twice; the same command again performs only what is
missing.
"""

import os
import subprocess
import sys

from hyperqueue import Client, Job, LocalCluster
from hyperqueue.cluster import WorkerConfig

HARNESS = os.environ.get("HARNESS", "harness")
ROUNDS = 3


def command(spec, out, run):
    part = f"{out}.parts/{run}"
    return [HARNESS, spec, "--run", run, "--resume", "--jobs", "1", "--out", part]


def perform(client, spec, out, runs):
    """Submits the runs and returns those that failed."""
    job = Job(default_workdir=os.getcwd(), max_fails=None)
    for run in runs:
        job.program(command(spec, out, run), name=run, stdout=None, stderr=None)
    submitted = client.submit(job)
    client.wait_for_jobs([submitted], raise_on_error=False)
    failed = client.connection.get_failed_tasks([submitted.id])
    return [runs[task] for task in failed.get(submitted.id, {})]


def main(spec, out, server=None):
    cluster = None if server else LocalCluster()
    if cluster:
        cluster.start_worker(WorkerConfig())
    client = Client(server) if server else cluster.client()
    listed = subprocess.run([HARNESS, "jobs", spec], check=True, capture_output=True, text=True)
    # The runs on the largest scenes come first.
    runs = [line.split(" ")[0] for line in listed.stdout.splitlines()]
    left = runs
    for _ in range(ROUNDS):
        left = perform(client, spec, out, left)
        if not left:
            break
        print(f"failed: {' '.join(left)}", file=sys.stderr)
    if cluster:
        cluster.stop()
    parts = [f"{out}.parts/{run}" for run in runs]
    return subprocess.run([HARNESS, "merge", *parts, "--out", out]).returncode


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
