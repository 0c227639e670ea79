#!/usr/bin/env python3
"""Flies the shards of a ranking on Dask distributed. All other arguments are passed to noctograph rank.

    pip install distributed
    python examples/dask_rank.py --shards 200 --scheduler tcp://host:8786 team tuned --words NOOR:9999
    noctograph rank team tuned --words NOOR:9999 --parts parts

Workers need noctograph and this folder, which all of them and you can see. Without --scheduler, worker
processes are started on this machine. A shard is a function of the study and its number, and appears
whole or not at all: a worker that dies costs its shard, which Dask gives to another one.
"""

import argparse
import os
import subprocess
import sys
import time

from distributed import Client, LocalCluster, as_completed


def fly(command, shard, folder):
    """Flies one shard by a command. Flights that are already stored are not repeated."""
    done = subprocess.run([*command, "--shard", shard], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"shard {shard}: {done.stderr.strip()}")
    return shard


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--shards", type=int, default=100, help="seconds to minutes of work each")
    parser.add_argument("--parts", default="parts", help="folder for the shards")
    parser.add_argument("--scheduler", help="address of a Dask scheduler")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="where there is none")
    parser.add_argument("--noctograph", default="noctograph", help="the program on the workers")
    args, study = parser.parse_known_args()
    command = [args.noctograph, "rank", *study, "--threads", "1", "--parts", args.parts]
    folder = os.getcwd()

    cluster = args.scheduler or LocalCluster(
        n_workers=args.workers, threads_per_worker=1, processes=True, dashboard_address=None
    )
    with Client(cluster) as client:
        shards = range(1, args.shards + 1)
        tasks = client.map(
            lambda shard: fly(command, f"{shard}/{args.shards}", folder),
            shards,
            key=[f"shard-{shard}" for shard in shards],
            retries=3,
        )
        begun = time.monotonic()
        for n, task in enumerate(as_completed(tasks), 1):
            if task.status == "error":
                sys.exit(str(task.exception()))
            left_min = (time.monotonic() - begun) / n * (args.shards - n) / 60
            print(f"\r{n}/{args.shards} shards, {left_min:.0f} min left ", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)


if __name__ == "__main__":
    main()
