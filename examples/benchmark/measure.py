"""Measures benchmark 1: P(read) of its baselines, and of scenes beside them, as a table.

usage: python examples/benchmark/measure.py [SCENE.toml ...]

Flights are stored in ./noctograph-benchmark, so that an interrupted call continues where it stopped.
"""

import csv
import io
import pathlib
import sys
import tomllib

import noctograph as nc
from mpc import Mpc
from policy import Policy

HERE = pathlib.Path(__file__).parent
TITLES = ("place", "contender", "P(read)", "95 %", "legible", "lost", "contour", "time")


def main(files):
    """Prints the table."""
    task = nc.Scene(HERE / "task.toml")
    files = [*sorted((HERE / "baselines").glob("*.toml")), *map(pathlib.Path, files)]
    contenders = {file.stem: nc.Scene(task, set=tomllib.loads(file.read_text("utf-8"))) for file in files}
    contenders |= {"mpc": (task, Mpc), "policy": (task, Policy)}
    lines = (HERE / "words.txt").read_text("utf-8").splitlines()
    words = {word: int(n) for word, n in (line.split(":") for line in lines if line and line[0] != "#")}
    report = nc.rank(contenders, words, seed=1, vectorized=True, folder="noctograph-benchmark", progress=False)
    print("| " + " | ".join(TITLES) + " |\n" + "|---" * len(TITLES) + "|")
    for row in csv.DictReader(io.StringIO(report.files["ranking.csv"].decode())):

        def figure(name, scale, digits, row=row):
            return f"{scale * float(row[name]):.{digits}f}" if row[name] else ""

        interval = f"{figure('legibility_low', 1, 3)} to {figure('legibility_high', 1, 3)}"
        print(f"| {row['place']} | `{row['contender']}` | {figure('legibility', 1, 3)} | {interval} | {figure('legible', 100, 0)} % | "
              f"{row['lost']} of {row['flights']} | {figure('contour_m', 1000, 1)} mm | {figure('duration_s', 1, 1)} s |")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
