"""Draws the reliability plot of docs/calibration.md.

    python3 reliability.py readings.tsv VERDICTS.tsv OLD.tsv ../../docs/reliability.svg

VERDICTS.tsv and OLD.tsv are what `readings verdicts` prints of the present and of an earlier program (name,
expected word, readability, ...). Each point is a fifth of the photographs of the test half: mean readability
across, and up the share that both readers read, with its 95 % Wilson interval.
"""

import csv
import math
import sys

ALIKE = {"0": "O", "I": "1", "i": "1", "l": "1"}
SIDE, LEFT, TOP, FIFTHS = 300, 60, 20, 5


def same(a, b):
    folded = lambda word: "".join(ALIKE.get(c, c.upper()) for c in word)
    return a.casefold() == b.casefold() or folded(a) == folded(b)


def wilson(n_read, n):
    share, z2 = n_read / n, 1.96**2
    half = 1.96 * math.sqrt(share * (1 - share) / n + z2 / (4 * n * n))
    return [(share + z2 / (2 * n) + sign * half) / (1 + z2 / n) for sign in (-1, 1)]


def fifths(readings, path):
    p = {cells[0]: float(cells[2]) for cells in (line.rstrip("\n").split("\t") for line in open(path))}
    rows = sorted((p[name], right) for name, right in readings.items() if name in p)
    for part in range(FIFTHS):
        rows_here = rows[part * len(rows) // FIFTHS:(part + 1) * len(rows) // FIFTHS]
        n_read = sum(right for _, right in rows_here)
        yield sum(p for p, _ in rows_here) / len(rows_here), n_read, len(rows_here)


def at(x, y):
    return f"{LEFT + SIDE * x:.1f}", f"{TOP + SIDE * (1 - y):.1f}"


def line(a, b, color, width=1):
    (x1, y1), (x2, y2) = at(*a), at(*b)
    return f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{color}" stroke-width="{width}"/>'


def text(x, y, words, anchor="middle", turn=""):
    return f'<text x="{x}" y="{y}" text-anchor="{anchor}"{turn}>{words}</text>'


def main():
    table, new, old, out = sys.argv[1:]
    readings = {}
    for r in csv.DictReader(open(table), delimiter="\t"):
        if r["half"] == "test":
            right = same(r["a"], r["expected"]) and same(r["b"], r["expected"])
            readings[r["photo"]] = right
    parts = [line((0, 0), (1, 1), "#999")]
    for tick in range(6):
        at_x, at_y = at(tick / 5, 0), at(0, tick / 5)
        parts += [line((0, tick / 5), (1, tick / 5), "#ddd"), line((tick / 5, 0), (tick / 5, 1), "#ddd"),
                  text(at_x[0], TOP + SIDE + 18, f"{tick / 5:.1f}"),
                  text(LEFT - 8, float(at_y[1]) + 4, f"{tick / 5:.1f}", "end")]
    # Colors of Okabe and Ito (2008).
    for path, color, name, row in ((old, "#d55e00", "before", 0), (new, "#0072b2", "now", 1)):
        parts.append(text(LEFT + 12, TOP + 18 + 18 * row, name, "start").replace("<text", f'<text fill="{color}"'))
        for p, n_read, n in fifths(readings, path):
            low, high = wilson(n_read, n)
            x, y = at(p, n_read / n)
            parts += [line((p, low), (p, high), color, 2), f'<circle cx="{x}" cy="{y}" r="4" fill="{color}"/>']
    middle = TOP + SIDE / 2
    parts += [text(LEFT + SIDE / 2, TOP + SIDE + 40, "readability"),
              text(16, middle, "both read it", turn=f' transform="rotate(-90 16 {middle})"')]
    width, height = LEFT + SIDE + 20, TOP + SIDE + 50
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" '
            f'font-size="13">\n<rect width="{width}" height="{height}" fill="white"/>\n')
    open(out, "w").write(head + "\n".join(parts) + "\n</svg>\n")


if __name__ == "__main__":
    main()
