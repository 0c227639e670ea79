"""Writes src/score/spelling.bin, the probability of each letter after the preceding ones in words and names.

    python3 spelling.py ../../src/score/spelling.bin SCOWL NAMES

SCOWL is a folder of its lists (Debian's package scowl: SCOWL, copyright 2000-2020 Kevin Atkinson, whose license
allows any use), of which those of common words weigh more; NAMES is a folder with the census's lists of
1990, in the public domain: dist.male.first, dist.female.first and dist.all.last, as in the pip package `names`. The
names and words of other languages in the Latin alphabet are those of the pip package `faker` (MIT license).
Marks are left out; words of 2 to 10 letters count.

The file has -20 ln p of each letter after each two, a byte each, in the order of the alphabet after the blank, which
is the begin and the end of a word; then the runs of four and five letters whose own probability says most, their
number first (u32): their letters as a number of base 27, in order, each as the distance from the one before (LEB128),
and then their -20 ln p, a byte each. A run that is not there has the probability of the shorter one times BACKOFF. The
probabilities are interpolated with those of shorter runs (Witten and Bell 1991).
"""

import collections
import functools
import importlib.util
import math
import os
import struct
import sys
import unicodedata

LETTERS = " abcdefghijklmnopqrstuvwxyz"
N_RUNS = [24000, 44000]  # of four and of five letters
BACKOFF = 0.4  # as of Brants and others 2007
# Weight of a word by the smallest list of SCOWL that contains it. List 10 contains the most common words.
SIZES = {"10": 12, "20": 8, "35": 4, "40": 2, "50": 2, "55": 1, "60": 1, "70": 1}


LANGUAGES = ("cs_CZ da_DK de_AT de_DE en_GB en_US es_ES es_MX et_EE fi_FI fr_FR ga_IE hr_HR hu_HU it_IT lt_LT lv_LV nl_BE "
             "nl_NL no_NO pl_PL pt_BR pt_PT ro_RO sk_SK sl_SI sv_SE tr_TR").split()
# Weight of a name or word of theirs, by the lists that hold it: on the choosing halves, more of it reads fewer of the
# readings' own, which are English.
FAKER = {"person": {"first_name": 2, "last_name": 0.5}, "lorem": {"word_list": 1}}


def plain(word):
    return "".join(c for c in unicodedata.normalize("NFD", word) if not unicodedata.combining(c)).lower()


def weights(scowl, names):
    """Returns the weight of each word."""
    found = collections.Counter()
    for size, weight in SIZES.items():
        for kind in ("english-words", "american-words", "english-upper", "american-upper"):
            path = os.path.join(scowl, f"{kind}.{size}")
            for line in open(path, encoding="latin-1") if os.path.exists(path) else []:
                found[plain(line.strip())] = max(weight, found[plain(line.strip())])
    for name in ("dist.male.first", "dist.female.first", "dist.all.last"):
        for rank, line in enumerate(open(os.path.join(names, name))):
            weight = 8 if rank < 300 else 4 if rank < 1000 else 1 if rank < 8000 else 0
            word = line.split()[0].lower()
            found[word] = max(weight, found[word])
    for text, weight in of_languages():
        for word in plain(text).replace("-", " ").split():
            found[word] = max(weight, found[word])
    return {word: n for word, n in found.items() if n and 2 <= len(word) <= 10 and set(word) <= set(LETTERS[1:])}


def of_languages():
    """Returns names and words of other languages with their weights."""
    for language in LANGUAGES:
        for kind, lists in FAKER.items():
            module = f"faker.providers.{kind}.{language}"
            if not importlib.util.find_spec(module):
                continue
            provider = importlib.import_module(module).Provider
            for attribute in dir(provider):
                texts = getattr(provider, attribute)
                weight = next((weight for name, weight in lists.items() if name in attribute), None)
                if weight and isinstance(texts, (list, tuple, dict, set)):
                    yield from ((text, weight) for text in texts if isinstance(text, str))


def number(run):
    """Returns a sequence of letters as a number in base 27."""
    return functools.reduce(lambda sum, letter: 27 * sum + LETTERS.index(letter), run, 0)


def distances(numbers):
    """Encodes sorted numbers as bytes: the difference of each from the previous one, with seven bits per byte (LEB128)."""
    out = bytearray()
    for before, number in zip([0, *numbers], numbers):
        distance = number - before
        while distance > 127:
            out.append(128 | distance & 127)
            distance >>= 7
        out.append(distance)
    return bytes(out)


def table(path):
    """Returns the table of a file as a function, which gives ln p of the last of five letters after the others."""
    data, runs, at = open(path, "rb").read(), [], 27 ** 3
    for _ in N_RUNS:
        (n,) = struct.unpack_from("<I", data, at)
        at, keys = at + 4, []
        while len(keys) < n:
            distance, shift = data[at] & 127, 7
            while data[at] & 128:
                at += 1
                distance |= (data[at] & 127) << shift
                shift += 7
            at += 1
            keys.append(distance + (keys[-1] if keys else 0))
        runs.append(dict(zip(keys, data[at:at + n])))
        at += n

    def ln_p(five):
        backoffs, found = next(((k, runs[1 - k][number(five[k:])]) for k in range(2)
                                if number(five[k:]) in runs[1 - k]), (2, data[number(five[2:])]))
        return -0.05 * found + backoffs * math.log(BACKOFF)

    return ln_p


def main():
    out, scowl, names = sys.argv[1:]
    words = weights(scowl, names)
    counts = collections.defaultdict(collections.Counter)  # of a letter after the up to four before it
    for word, n in words.items():
        text = "    " + word + " "
        for at in range(4, len(text)):
            for length in range(5):
                counts[text[at - length:at]][text[at]] += n
    interpolated = {}

    def p(before, letter):
        if (before, letter) not in interpolated:
            shorter = p(before[1:], letter) if before else 1 / len(LETTERS)
            seen = counts.get(before, {})
            kinds, total = max(len(seen), 1), sum(seen.values())
            interpolated[before, letter] = (seen.get(letter, 0) + kinds * shorter) / (total + kinds)
        return interpolated[before, letter]

    cost = lambda p: min(255, round(-20 * math.log(p)))
    data = bytes(cost(p(a + b, c)) for a in LETTERS for b in LETTERS for c in LETTERS)
    kept = {}
    for length, most in zip((4, 5), N_RUNS):
        runs = {}
        for before, seen in counts.items():
            if len(before) != length - 1:
                continue
            for letter, n in seen.items():
                shorter = kept.get(before[1:] + letter) or (
                    p(before[1:], letter) if length == 4 else BACKOFF * p(before[2:], letter))
                runs[before + letter] = n * abs(math.log(p(before, letter) / (BACKOFF * shorter)))
        best = sorted(runs, key=lambda run: (-runs[run], run))[:most]
        kept.update({run: p(run[:-1], run[-1]) for run in best})
        best.sort(key=number)
        data += struct.pack("<I", len(best)) + distances([number(run) for run in best])
        data += bytes(cost(kept[run]) for run in best)
    open(out, "wb").write(data)
    print(len(words), "words,", len(data), "bytes")


if __name__ == "__main__":
    main()
