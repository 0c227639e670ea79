"""Prints src/score/pairs.txt: how often one letter follows another in English words and names.

    python3 pairs.py /usr/share/dict/american-english > ../../src/score/pairs.txt

The list is Debian's wamerican (SCOWL, copyright 2000-2011 Kevin Atkinson; its license allows any use). A row
for each letter, the first for the begin of a word; in it -100 ln p of the end of the word and of each next
letter. Marks are left out, and each word of 2 to 9 letters counts once.
"""

import collections
import math
import sys
import unicodedata

LETTERS = " abcdefghijklmnopqrstuvwxyz"  # the blank: begin or end of a word
MORE = 3  # of each pair, as if it had been seen so often: rare ones are not impossible


def plain(word):
    return "".join(c for c in unicodedata.normalize("NFD", word) if not unicodedata.combining(c)).lower()


def main():
    words = {plain(line.strip()) for line in open(sys.argv[1])}
    pairs = collections.Counter()
    for word in words:
        if 2 <= len(word) <= 9 and set(word) <= set(LETTERS[1:]):
            pairs.update(zip(" " + word, word + " "))
    for first in LETTERS:
        n = sum(pairs[first, second] + MORE for second in LETTERS)
        print(*(round(-100 * math.log((pairs[first, second] + MORE) / n)) for second in LETTERS))


if __name__ == "__main__":
    main()
