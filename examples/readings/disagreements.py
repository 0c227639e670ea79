"""Draws the sheet of docs/calibration.md: the photographs of the test half where verdict and readers disagree most.

    python3 disagreements.py readings.tsv VERDICTS.tsv PHOTOS ../../docs/disagreements.jpg      (needs Pillow, numpy)

VERDICTS.tsv is what `readings verdicts` prints. Above each photograph: the word, the readings of both readers
(? for a guess), what the program reads, and its readability. The first half of the sheet was read by both and has the
least readability; the second was not, and has the most.
"""

import csv
import sys

from PIL import Image

import fit
import sheets

EACH = 6


def main():
    readings, verdicts, photos, out = sys.argv[1:5]
    rows = fit.rows_of(list(csv.DictReader(open(readings), delimiter="\t")), fit.read_verdicts(open(verdicts).read()))
    rows = sorted((row for row in rows if row["half"] == "test"), key=lambda row: row["p"])
    read = [row for row in rows if row["both"]][:EACH]
    unread = [row for row in rows if not row["both"]][:-EACH - 1:-1]
    mark = lambda row, reader: row[reader] + ("" if row[reader + "_sure"] == "sure" else "?")
    captions = [f"{row['word']}: readers {mark(row, 'a')}, {mark(row, 'b')}; program {row['read']} {row['p']:.2f}"
                for row in read + unread]
    page = sheets.sheet([row["photo"] for row in read + unread], photos, captions)
    page.resize((page.width * 2 // 3, page.height * 2 // 3), Image.LANCZOS).save(out, optimize=True, quality=88)


if __name__ == "__main__":
    main()
