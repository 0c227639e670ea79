"""Fits the calibration to readings, and prints the tables of docs/calibration.md.

    python3 fit.py readings.tsv VERDICTS.tsv [OLD.tsv]        (needs numpy)

readings.tsv has a line for each photo: name, half (choose or test), kind, word shown, word expected, and of each
reader what was read and how surely (sure, guess, no). VERDICTS.tsv is what `readings verdicts` prints. To add
readers, add columns; to refit, run this and copy the three constants into src/score/calibration.rs.
"""

import csv
import sys

import numpy as np

ALIKE = {"0": "O", "I": "1", "i": "1", "l": "1"}


def folded(word):
    return "".join(ALIKE.get(c, c.upper()) for c in word)


def same(a, b):
    return a.casefold() == b.casefold() or folded(a) == folded(b)


def character_accuracy(a, b):
    """1 less the edit distance by the length."""
    a, b = folded(a), folded(b)
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        row, last = [i] + row[1:], row
        for j, y in enumerate(b, 1):
            row[j] = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (x != y))
    return max(0.0, 1 - row[-1] / max(len(b), 1))


def auc(score, truth):
    order = np.argsort(score, kind="stable")
    ranks = np.empty(len(score))
    ranks[order] = np.arange(len(score))
    for value in np.unique(score):
        ranks[score == value] = ranks[score == value].mean()
    n, m = truth.sum(), (~truth).sum()
    return (ranks[truth].mean() - (n - 1) / 2) / m if n and m else float("nan")


def spearman(a, b):
    rank = lambda x: np.array([(x < v).sum() + 0.5 * (x == v).sum() for v in x])
    return np.corrcoef(rank(a), rank(b))[0, 1]


def logistic(x, y, weight):
    """Weights of a logistic regression with a slight pull to zero, by Newton's method."""
    x = np.column_stack([np.ones(len(x)), x])
    w = np.zeros(x.shape[1])
    for _ in range(50):
        p = 1 / (1 + np.exp(-np.clip(x @ w, -30, 30)))
        slope = x.T @ (weight * (y - p)) - 1e-3 * w
        bend = (x * (weight * p * (1 - p))[:, None]).T @ x + 1e-3 * np.eye(len(w))
        w = w + np.linalg.solve(bend, slope)
    return w


def read_verdicts(path):
    found = {}
    for line in open(path):
        name, word, readability, ln_p, read, rival, p, faithfulness, cap, blind = line.rstrip("\n").split("\t")
        ln = np.array([float(x) for x in ln_p.split(",")])
        found[name] = {"word": word, "p": float(readability), "worst": ln.min(), "mean": ln.mean(), "ln": ln,
                       "read": read, "rival": rival, "rival_p": float(p), "faithfulness": float(faithfulness),
                       "blind": blind}
    return found


def table(name, rows):
    p = np.array([row["p"] for row in rows])
    sure, both = (np.array([row[key] for row in rows]) for key in ("sure", "both"))
    right = np.mean([same(row["read"], row["expected"]) for row in rows])
    bins = [f"{p[m].mean():.2f} → {sure[m].mean():.2f} ({m.sum()})"
            for low in np.arange(0, 1, 0.2) for m in [(p >= low) & (p < low + 0.2 + 1e-9 * (low > 0.7))] if m.any()]
    surely = p[sure] < 0.3
    print(f"{name}: {len(rows)} photos, both read {both.mean():.2f}, both sure {sure.mean():.2f}\n"
          f"  words right {right:.3f}   AUC both {auc(p, both):.3f}, sure {auc(p, sure):.3f}\n"
          f"  Brier sure {np.mean((p - sure) ** 2):.3f} (constant {sure.mean() * (1 - sure.mean()):.3f})   "
          f"rank correlation {spearman(p, np.array([row['accuracy'] for row in rows])):.2f}\n"
          f"  surely read below 0.3: {surely.sum()} of {sure.sum()}\n  readability → both sure: {';  '.join(bins)}")


def main():
    readings = list(csv.DictReader(open(sys.argv[1]), delimiter="\t"))
    verdicts = read_verdicts(sys.argv[2])
    rows = []
    for r in readings:
        v = verdicts.get(r["photo"])
        if v is None:
            continue
        a, b = same(r["a"], r["expected"]), same(r["b"], r["expected"])
        accuracy = np.mean([character_accuracy(r[reader], r["expected"]) for reader in "ab"])
        rows.append({**r, **v, "both": a and b, "accuracy": accuracy,
                     "sure": a and b and r["a_sure"] == "sure" and r["b_sure"] == "sure"})
    choose = [row for row in rows if row["half"] == "choose"]
    features = lambda rows: np.array([[row["worst"], row["mean"]] for row in rows])
    y = np.array([float(row["sure"]) for row in choose])
    w = logistic(features(choose), y, np.ones(len(choose)))
    print("constant, worst, mean:", np.round(w, 3))
    for half in ("choose", "test"):
        part = [row for row in rows if row["half"] == half]
        table(f"{half}, as shipped", part)
        x = np.column_stack([np.ones(len(part)), features(part)])
        table(f"{half}, refitted", [{**row, "p": p} for row, p in zip(part, 1 / (1 + np.exp(-x @ w)))])
        if len(sys.argv) > 3:
            old = {line.split("\t")[0]: line.rstrip("\n").split("\t") for line in open(sys.argv[3])}
            table(f"{half}, before", [{**row, "p": float(old[row["photo"]][2]), "read": old[row["photo"]][4]}
                                      for row in part if row["photo"] in old])


if __name__ == "__main__":
    main()
