"""Fits the calibration to readings, and prints the tables of docs/calibration.md.

    python3 fit.py READINGS.tsv FOLDER [--clean CLEAN] [--old OLD.tsv]        (in the repository; needs numpy)

READINGS.tsv has a line for each photo: name, half (choose or test), kind, word shown, word expected, and of each
reader what was read and how surely (sure, guess, no). FOLDER holds the photographs: their verdicts are taken with the
example `readings`, of the expected words, of words that differ from them in one letter and of words of one letter
more or less. OLD.tsv holds verdicts of another program, with the columns of `readings verdicts`. To add readers, add
columns to READINGS.tsv and their names to READERS; to refit, run this and copy the constants into
src/score/calibration.rs.
"""

import argparse
import csv
import json
import os
import random
import re
import subprocess
import tempfile

import numpy as np

from spelling import LETTERS, plain, table

READERS = ["a", "b"]

# Weight in the fit of a word with one wrong, extra or missing letter. The data contain twice as many such words as
# correct ones, whereas visitors see few of them.
WEIGHT_OF_WRONG = 0.15


SPELLING = table(os.path.join(os.path.dirname(__file__), "../../src/score/spelling.bin"))

# Log-probabilities of a character beside a digit, and of a single character, as in src/score/spelling.rs.
WITH_DIGIT, AVERAGE = -3.58, -2.2

KINDS = ["ABCDEFGHIJKLMNOPQRSTUVWXYZ", "abcdefghijklmnopqrstuvwxyz", "0123456789"]

ALIKE = {"0": "O", "I": "1", "i": "1", "l": "1"}


def folded(word):
    return "".join(ALIKE.get(c, c.upper()) for c in word)


def same(a, b):
    return a.casefold() == b.casefold() or folded(a) == folded(b)


def character_accuracy(a, b):
    """Returns 1 minus the edit distance divided by the length."""
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
    """Fits a logistic regression with slight regularization by Newton's method. Returns its weights."""
    x = np.column_stack([np.ones(len(x)), x])
    w = np.zeros(x.shape[1])
    for _ in range(50):
        p = 1 / (1 + np.exp(-np.clip(x @ w, -30, 30)))
        slope = x.T @ (weight * (y - p)) - 1e-3 * w
        bend = (x * (weight * p * (1 - p))[:, None]).T @ x + 1e-3 * np.eye(len(w))
        w = w + np.linalg.solve(bend, slope)
    return w


def wrong_word(name, word):
    """Returns a word that differs in one letter, by a letter of the same kind but not of the same shape."""
    rng = random.Random("wrong " + name)
    at = rng.randrange(len(word))
    kind = next((kind for kind in KINDS if word[at] in kind), None)
    if kind is None:
        return None
    letter = rng.choice([c for c in kind if c != word[at] and not {c, word[at]} <= set("IlO01")])
    return word[:at] + letter + word[at + 1:]


def other_length(name, word):
    """Returns a word with one letter more or less, at the beginning, in the middle or at the end."""
    rng = random.Random("length " + name)
    at = rng.choice([0, len(word) // 2, len(word)])
    if len(word) > 2 and rng.random() < 0.5:
        at = min(at, len(word) - 1)
        return word[:at] + word[at + 1:]
    kind = next((kind for kind in KINDS if word[min(at, len(word) - 1)] in kind), KINDS[0])
    return word[:at] + rng.choice(kind) + word[at:]


def scene_of_score(scene):
    """Returns the parts of an older program's scene that a verdict needs: word, letters and camera."""
    head, *tables = re.split(r"(?m)^(?=\[)", scene)
    text = head + "".join(table for table in tables if re.match(r"\[(letters|camera)", table))
    return re.sub(r"(?m)^(picture|smoothing_m|tolerance_m) = .*\n", "", text)


def verdicts(folder, expected):
    """Returns verdicts on the photos of a folder for the given expected words."""
    with tempfile.TemporaryDirectory() as other:
        os.symlink(os.path.abspath(os.path.join(folder, "photos")), os.path.join(other, "photos"))
        os.mkdir(os.path.join(other, "scenes"))
        for name in expected:
            scene = os.path.join("scenes", name + ".toml")
            with open(os.path.join(folder, scene)) as old, open(os.path.join(other, scene), "w") as new:
                new.write(scene_of_score(old.read()))
        with open(os.path.join(other, "truth.json"), "w") as file:
            json.dump({name: {"expected": word} for name, word in expected.items()}, file)
        return read_verdicts(subprocess.run(
            ["cargo", "run", "--release", "--quiet", "--example", "readings", "--", "verdicts", other],
            check=True, capture_output=True, text=True).stdout)


def read_verdicts(text):
    found = {}
    for line in text.splitlines():
        name, word, readability, ln_p, read, rival, p, blind = line.split("\t")
        found[name] = {"word": word, "p": float(readability), "ln_p": np.array([float(x) for x in ln_p.split(",")]),
                       "read": read, "rival": rival, "rival_p": float(p), "blind": blind}
    return found


def mean_ln_p_of_spelling(word):
    word = plain(word)
    if not set(word) <= set(LETTERS) or len(word) == 1:
        return WITH_DIGIT if len(word) > 1 else AVERAGE
    text = "    " + word + " "
    return np.mean([SPELLING(text[at - 4:at + 1]) for at in range(4, len(text))])


def features(row):
    """Returns the features of src/score/calibration.rs: the letters' mean log-odds, the log-odds against the rival,
    the spelling."""
    p = np.exp(row["ln_p"])
    letters = np.clip(np.log(p / np.maximum(1 - p, 5e-4)), -9, 8).mean()
    rival = np.log(max(1 - row["rival_p"], 1e-9) / max(row["rival_p"], 1e-9))
    usual = max(mean_ln_p_of_spelling(row["word"]), -4.0) - AVERAGE
    return [letters, np.clip(rival, -9, 9), usual * (1 - np.clip(letters, 0, 8) / 8)]


def rows_of(readings, verdicts):
    rows = []
    for reading in readings:
        verdict = verdicts.get(reading["photo"])
        if verdict is None:
            continue
        right = [same(reading[reader], verdict["word"]) for reader in READERS]
        sure = [reading[reader + "_sure"] == "sure" for reader in READERS]
        accuracy = np.mean([character_accuracy(reading[reader], verdict["word"]) for reader in READERS])
        rows.append({**reading, **verdict, "both": all(right), "sure": all(right) and all(sure), "accuracy": accuracy})
    return rows


def ceiling(rows):
    """Returns the areas with which one reader's reading and sureness, and the readability, predict that the other is
    right."""
    found = []
    for one, other in (READERS, READERS[::-1]):
        truth = np.array([same(row[other], row["word"]) for row in rows])
        sure = [same(row[one], row["word"]) * ["", "no", "guess", "sure"].index(row[one + "_sure"]) for row in rows]
        found.append([auc(np.array(sure, float), truth), auc(np.array([row["p"] for row in rows]), truth)])
    return np.mean(found, axis=0)


def table(name, rows, wrong):
    photos = [row for row in rows if row["kind"] == "photo"]
    p = np.array([row["p"] for row in photos])
    sure, both = (np.array([row[key] for row in photos]) for key in ("sure", "both"))
    is_right = lambda key: np.array([same(row[key], row["word"]) for row in photos])
    right, blind = is_right("read"), is_right("blind")
    legible = (p >= 0.7) & np.array([row["rival_p"] <= 0.5 for row in photos])
    all_p, all_both = (np.array([row[key] for row in rows]) for key in ("p", "both"))
    bins = [f"{all_p[m].mean():.2f} → {all_both[m].mean():.2f} ({m.sum()})" for low in np.arange(0, 1, 0.2)
            for m in [(all_p >= low) & (all_p < low + 0.2 + 1e-9 * (low > 0.7))] if m.any()]
    # A verdict is legible if it reaches 0.7 and no rival is likelier.
    passed = [row["p"] >= 0.7 and row["rival_p"] <= 0.5 for row in wrong if not row["both"]]
    reader, program = ceiling(photos)
    print(f"{name}: {len(photos)} photos, both read {both.mean():.2f}, both sure {sure.mean():.2f}\n"
          f"  words right, of those that both read {right[both].mean():.2f}, of all {right.mean():.2f}; "
          f"blindly {blind[both].mean():.2f}\n"
          f"  AUC both {auc(p, both):.3f}, sure {auc(p, sure):.3f}; of one reader {program:.3f}, by the other {reader:.3f}\n"
          f"  Brier both {np.mean((p - both) ** 2):.3f} (constant {both.mean() * (1 - both.mean()):.3f})   "
          f"rank correlation {spearman(p, np.array([row['accuracy'] for row in photos])):.2f}\n"
          f"  below 0.3: {len(p[p < 0.3])}, both read {both[p < 0.3].sum()}, surely {sure[p < 0.3].sum()};  0.7 or more, "
          f"not read by both: {(p[~both] >= 0.7).sum()} ({legible[~both].sum()} legible of {legible.sum()});  "
          f"wrong words legible: {sum(passed)} of {len(passed)}\n"
          f"  readability, negatives too → both read: {';  '.join(bins)}")


def clean_rows(folder):
    """Returns clean photographs as rows that both readers read."""
    words = {name: truth["expected"] for name, truth in json.load(open(os.path.join(folder, "truth.json"))).items()}
    found = verdicts(folder, words)
    return [{**found[name], "word": word, "both": True} for name, word in words.items()]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("readings")
    parser.add_argument("folder")
    parser.add_argument("--clean", help="clean photos (`readings clean`), which count as read by both")
    parser.add_argument("--old")
    args = parser.parse_args()
    readings = list(csv.DictReader(open(args.readings), delimiter="\t"))
    expected = {row["photo"]: row["expected"] for row in readings if row["expected"]}
    others = [{row["photo"]: other(row["photo"], row["expected"]) for row in readings if row["kind"] == "photo"}
              for other in (wrong_word, other_length)]
    rows = rows_of(readings, verdicts(args.folder, expected))
    wrong = [row for words in others
             for row in rows_of(readings, verdicts(args.folder, {name: word for name, word in words.items() if word}))]
    of_half = lambda rows, half: [row for row in rows if row["half"] == half]
    fit = of_half(rows, "choose"), of_half(wrong, "choose")
    clean = clean_rows(args.clean) if args.clean else []
    fitted = fit[0] + fit[1] + clean
    weights = logistic(np.array([features(row) for row in fitted]), np.array([float(row["both"]) for row in fitted]),
                       np.array([1.0] * len(fit[0]) + [WEIGHT_OF_WRONG] * len(fit[1])
                                + [1.0] * len(clean)))
    print("constant, mean log-odds, rival, spelling:", np.round(weights, 3))
    for half in ("choose", "test"):
        part = of_half(rows, half)
        table(f"{half}, as shipped", part, of_half(wrong, half))
        fitted = [[{**row, "p": 1 / (1 + np.exp(-weights[0] - weights[1:] @ features(row)))}
                   for row in of_half(all_rows, half)] for all_rows in (rows, wrong)]
        table(f"{half}, refitted", *fitted)
        if args.old:
            old = read_verdicts(open(args.old).read())
            table(f"{half}, before", of_half(rows_of(readings, old), half), [])


if __name__ == "__main__":
    main()
