#!/usr/bin/env python3
"""Fly the shards of a sweep on Dask distributed.

    pip install distributed
    noctograph sweep plan team tuned --words NOOR:100000 -o sweep.json
    python examples/dask_sweep.py sweep.json --shards 200 -o parts --scheduler tcp://host:8786
    noctograph sweep merge sweep.json parts

Workers need noctograph and a folder that all of them and you can see. Without --scheduler, worker
processes are started on this machine. A shard is a function of the plan and its number, and appears
whole or not at all: a worker that dies costs its shard, which Dask gives to another one.
"""

import argparse
import os
import subprocess
import sys

from distributed import Client, LocalCluster, as_completed


def fly(noctograph, plan, shard, shards, parts):
    """One shard, by one command; what lies there already is not flown again."""
    command = [noctograph, "sweep", "run", plan, "--shard", f"{shard}/{shards}"]
    done = subprocess.run(
        [*command, "--threads", "1", "-o", parts], capture_output=True, text=True
    )
    if done.returncode:
        raise RuntimeError(f"shard {shard}: {done.stderr.strip()}")
    return shard


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("plan", help="as `noctograph sweep plan` writes it")
    parser.add_argument("--shards", type=int, default=100, help="seconds to minutes of work each")
    parser.add_argument("-o", "--output", default="parts", help="folder for the shards")
    parser.add_argument("--scheduler", help="address of a Dask scheduler")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="where there is none")
    parser.add_argument("--noctograph", default="noctograph", help="the program on the workers")
    args = parser.parse_args()
    plan, parts = os.path.abspath(args.plan), os.path.abspath(args.output)

    cluster = args.scheduler or LocalCluster(
        n_workers=args.workers, threads_per_worker=1, processes=True, dashboard_address=None
    )
    with Client(cluster) as client:
        shards = range(1, args.shards + 1)
        tasks = client.map(
            lambda shard: fly(args.noctograph, plan, shard, args.shards, parts),
            shards,
            key=[f"shard-{shard}" for shard in shards],
            retries=3,
        )
        for n, task in enumerate(as_completed(tasks), 1):
            if task.status == "error":
                sys.exit(str(task.exception()))
            print(f"\r{n}/{args.shards} shards", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


if __name__ == "__main__":
    main()
