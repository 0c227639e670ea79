#!/usr/bin/env python3
"""What other readers make of photographs, and how well the score's probability foretells it.

    python3 -m venv venv
    venv/bin/pip install rapidocr-onnxruntime==1.4.4 ddddocr==1.6.1   # their models are in the wheels
    apt-get install tesseract-ocr                                      # 5.3.0 here
    cargo run --release --example faults -- shoot main 320 photos/main
    cargo run --release --example faults -- score photos/main
    venv/bin/python examples/outside_readers.py read photos/main       # writes readings.csv there
    venv/bin/python examples/outside_readers.py fit photos/main photos/blind

Each reader sees the word's box with 0.4 cap heights around it, in six versions: as it is, smaller,
softer, cut in black and white, only what is white, and in color. It reads a word if it reads it in
two of them; what no reader tells apart (0 and O, 1, I and l) counts as one character. Readers: Tesseract (as one word, capitals
and digits, no dictionary), PP-OCR (the recogniser alone) and ddddocr (made for captchas). The judge
reads what two of the three read. A folder may have viewer.csv besides, with what a person read
before looking at the answers: file,read.
"""

import csv
import math
import os
import subprocess
import sys
import tempfile

READERS = ["tesseract", "pp-ocr", "ddddocr"]
VERSIONS = ["plain", "small", "soft", "cut", "white", "color"]

# A reader reads a word if it does so in as many versions: once may be luck.
ENOUGH = 2

# The shipped offset: src/score/calibration.rs.
OFFSET = 2.86


def fold(text, word=None):
    """Capitals and digits, what looks alike made alike; an l is the I or L that suits the word."""
    if word is not None and "l" in text:
        return max((fold(text.replace("l", letter)) for letter in "IL"), key=lambda t: accuracy(word, t))
    text = text.replace("|", "I").replace("!", "I").upper()
    return "".join(c for c in text.replace("0", "O").replace("1", "I") if c.isascii() and c.isalnum())


def accuracy(word, read):
    """Share of characters read: 1 less the edit distance by the word's length."""
    row = list(range(len(read) + 1))
    for i, a in enumerate(word, 1):
        before, row[0] = row[0], i
        for j, b in enumerate(read, 1):
            before, row[j] = row[j], min(row[j] + 1, row[j - 1] + 1, before + (a != b))
    return max(0.0, 1.0 - row[-1] / len(word))


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


# ---- reading --------------------------------------------------------------------------------------


def versions(folder, photo):
    import cv2
    import numpy as np

    image = cv2.imread(os.path.join(folder, photo["file"])).astype(np.float32)
    xs, ys = ([float(photo[f"{axis}{k}"]) for k in range(4)] for axis in "xy")
    height = float(photo["cap_height_px"])
    margin = 0.4 * height
    left, right = max(0, int(min(xs) - margin)), min(image.shape[1], int(max(xs) + margin))
    top, bottom = max(0, int(min(ys) - margin)), min(image.shape[0], int(max(ys) + margin))
    crop = image[top:bottom, left:right]
    dark, light = np.percentile(crop.max(axis=2), [20, 99.5])
    crop = np.clip((crop - dark) / max(light - dark, 1.0), 0, 1)

    def at(cap_px, crop=crop.max(axis=2)):
        scale = cap_px / height
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        size = [max(8, round(side * scale)) for side in crop.shape[1::-1]]
        return np.clip(cv2.resize(crop, size, interpolation=way), 0, 1)

    plain = at(48)
    cut = cv2.threshold((255 * plain).astype(np.uint8), 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[1]
    made = [plain, at(28), cv2.GaussianBlur(plain, (0, 0), 2.0), cut, at(48, crop.min(axis=2))]
    # Dark ink on white, as print; a little white around it. Colors are left as they are.
    pages = [(255 * (1 - picture)).astype(np.uint8) for picture in made]
    pages = [cv2.copyMakeBorder(p, 10, 10, 10, 10, cv2.BORDER_CONSTANT, value=255) for p in pages]
    return [*pages, (255 * at(48, crop)).astype(np.uint8)]


def by_tesseract(pages):
    import cv2

    with tempfile.TemporaryDirectory() as folder:
        names = []
        for index, page in enumerate(pages):
            names.append(os.path.join(folder, f"{index}.png"))
            cv2.imwrite(names[-1], page)
        listing = os.path.join(folder, "list.txt")
        with open(listing, "w") as file:
            file.write("\n".join(names))
        characters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
        options = ["load_system_dawg=0", "load_freq_dawg=0", f"tessedit_char_whitelist={characters}"]
        command = ["tesseract", listing, "stdout", "--psm", "8", "--dpi", "150"]
        command += [part for option in options for part in ("-c", option)]
        run = subprocess.run(command, capture_output=True, text=True, check=True,
                             env={**os.environ, "OMP_THREAD_LIMIT": "1"})
    read = run.stdout.split("\f")
    return [read[index].strip() for index in range(len(pages))]


def read_folder(folder):
    import cv2
    import ddddocr
    from rapidocr_onnxruntime import RapidOCR

    paddle = RapidOCR(intra_op_num_threads=1, inter_op_num_threads=1)
    captcha = ddddocr.DdddOcr(show_ad=False)

    def by_paddle(page):
        color = page if page.ndim == 3 else cv2.cvtColor(page, cv2.COLOR_GRAY2BGR)
        found, _ = paddle(color, use_det=False, use_cls=False, use_rec=True)
        return found[0][0] if found else ""

    def by_captcha(page):
        return captcha.classification(cv2.imencode(".png", page)[1].tobytes())

    photos, n = rows(os.path.join(folder, "photos.csv")), len(VERSIONS)
    pages = [page for photo in photos for page in versions(folder, photo)]
    read = {
        "tesseract": [text for k in range(0, len(pages), 40) for text in by_tesseract(pages[k:k + 40])],
        "pp-ocr": [by_paddle(page) for page in pages],
        "ddddocr": [by_captcha(page) for page in pages],
    }
    with open(os.path.join(folder, "readings.csv"), "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["file", "reader", *VERSIONS])
        for index, photo in enumerate(photos):
            for reader in READERS:
                table.writerow([photo["file"], reader, *read[reader][n * index:n * (index + 1)]])


# ---- comparing ------------------------------------------------------------------------------------


def load(folder):
    """One dictionary a photo: what it shows, what the score says, who reads it."""
    photos = {photo["file"]: photo for photo in rows(os.path.join(folder, "photos.csv"))}
    for score in rows(os.path.join(folder, "scores.csv")):
        photo = photos[score["file"]]
        photo["p"], photo["loss"] = float(score["p"]), float(score["loss"])
        photo["scored"] = score["read"]
        photo["reason"], photo["who"], photo["texts"] = score["reason"], {}, {}
    for reading in rows(os.path.join(folder, "readings.csv")):
        photo = photos[reading["file"]]
        word = fold(photo["word"])
        texts = [fold(reading[version], word) for version in VERSIONS]
        photo["texts"][reading["reader"]] = texts
        exact = float(sum(text == word for text in texts) >= ENOUGH)
        right = sum(sorted(accuracy(word, text) for text in texts)[-ENOUGH:]) / ENOUGH
        photo["who"][reading["reader"]] = (exact, right)
    viewer = os.path.join(folder, "viewer.csv")
    if os.path.exists(viewer):
        for reading in rows(viewer):
            photo = photos[reading["file"]]
            word, text = fold(photo["word"]), fold(reading["read"])
            photo["who"]["viewer"] = (float(text == word), accuracy(word, text))
    for photo in photos.values():
        shares = [photo["who"][reader] for reader in READERS]
        exact = sum(yes for yes, _ in shares) >= 2
        photo["who"]["judge"] = (float(exact), sum(right for _, right in shares) / len(shares))
        photo["who"]["any"] = (max(yes for yes, _ in shares), max(right for _, right in shares))
    return list(photos.values())


def ranks(values):
    order = sorted(range(len(values)), key=values.__getitem__)
    rank, at = [0.0] * len(values), 0
    while at < len(order):
        end = at
        while end < len(order) and values[order[end]] == values[order[at]]:
            end += 1
        for index in order[at:end]:
            rank[index] = 0.5 * (at + end - 1)
        at = end
    return rank


def spearman(a, b):
    a, b = ranks(a), ranks(b)
    mean_a, mean_b = sum(a) / len(a), sum(b) / len(b)
    over = sum((x - mean_a) * (y - mean_b) for x, y in zip(a, b))
    return over / math.sqrt(sum((x - mean_a) ** 2 for x in a) * sum((y - mean_b) ** 2 for y in b))


def area(p, read):
    """Area under the ROC curve."""
    rank, n_read = ranks(p), sum(read)
    if n_read in (0, len(read)):
        return math.nan
    lower = sum(r for r, yes in zip(rank, read) if yes) - n_read * (n_read - 1) / 2
    return lower / (n_read * (len(read) - n_read))


def sigmoid(x):
    return 1 / (1 + math.exp(-max(-700.0, min(700.0, x))))


def platt(photos, who, held=None):
    """Offset and slope of P = 1 / (1 + exp(-(offset - slope loss))), by Newton's method on the
    likelihood, or the slope alone where the offset is held; photos that are refused whatever their
    loss say nothing."""
    seen = [(min(photo["loss"], 20.0), photo["who"][who][0] >= 0.5) for photo in photos
            if who in photo["who"] and photo["p"] > 0.0]
    offset, slope = (0.0, 0.0) if held is None else (held, 1.0)
    for _ in range(100):
        g, h = [0.0, 0.0], [1e-9, 0.0, 1e-9]
        for loss, yes in seen:
            p = sigmoid(offset - slope * loss)
            g[0] += yes - p
            g[1] -= (yes - p) * loss
            w = p * (1 - p)
            h[0] += w
            h[1] -= w * loss
            h[2] += w * loss * loss
        if held is not None:
            slope += g[1] / h[2]
            continue
        det = h[0] * h[2] - h[1] * h[1]
        offset += (h[2] * g[0] - h[1] * g[1]) / det
        slope += (h[0] * g[1] - h[1] * g[0]) / det
    return offset, slope


def calibrated(photo, constants):
    if constants is None or photo["p"] == 0.0:
        return photo["p"]
    return sigmoid(constants[0] - constants[1] * photo["loss"])


def measures(photos, who, constants=None):
    seen = [photo for photo in photos if who in photo["who"]]
    p = [calibrated(photo, constants) for photo in seen]
    read = [photo["who"][who][0] >= 0.5 for photo in seen]
    right = [photo["who"][who][1] for photo in seen]
    brier = sum((x - y) ** 2 for x, y in zip(p, read)) / len(p)
    return len(p), sum(read) / len(p), area(p, read), spearman(p, right), brier


def bins(photos, who, constants):
    edges = [0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.01]
    for low, high in zip(edges, edges[1:]):
        inside = [(calibrated(photo, constants), photo["who"][who][0] >= 0.5) for photo in photos
                  if who in photo["who"] and low <= calibrated(photo, constants) < high]
        if inside:
            mean, share = (sum(pair[k] for pair in inside) / len(inside) for k in (0, 1))
            print(f"| {low:.1f}–{min(high, 1):.1f} | {len(inside)} | {mean:.2f} | {share:.2f} |")


def fit(folders):
    sets = [load(folder) for folder in folders]
    names = ["judge", *READERS, "any"]
    for photos, folder in zip(sets, folders):
        print(f"\n{folder}: as the score is\n| reader | photos | read | AUC | Spearman | Brier |")
        for who in [*names, "viewer"]:
            if any(who in photo["who"] for photo in photos):
                n, share, auc, rho, brier = measures(photos, who)
                print(f"| {who} | {n} | {share:.3f} | {auc:.3f} | {rho:.3f} | {brier:.3f} |")
    everything = [photo for photos in sets for photo in photos]
    for who in names:
        # With the offset held a clean word keeps its P of 0.94, whatever else keeps a reader from it.
        for held in (None, OFFSET):
            constants = platt(sets[0], who, held)
            told = ", ".join(f"AUC {auc:.3f} Spearman {rho:.3f} Brier {brier:.3f}" for photos in sets
                             for _, _, auc, rho, brier in [measures(photos, who, constants)])
            print(f"\nfitted to {who} on {folders[0]}: {constants[0]:.3f}, {constants[1]:.3f}: {told}")
            print("| P | photos | mean P | read |")
            bins(everything, who, constants)
    print("\nread by fault (photos, judge, mean P)")
    for fault in sorted({photo["fault"] for photo in everything}):
        of = [photo for photo in everything if photo["fault"] == fault]
        judge = sum(photo["who"]["judge"][0] for photo in of) / len(of)
        print(f"| {fault} | {len(of)} | {judge:.2f} | {sum(photo['p'] for photo in of) / len(of):.2f} |")
    print("\nfarthest from the judge")
    for photos, folder in zip(sets, folders):
        for photo in sorted(photos, key=lambda photo: -abs(photo["p"] - photo["who"]["judge"][0]))[:30]:
            texts = " ".join(photo["texts"][reader][0] or "-" for reader in READERS)
            print(f"{folder}/{photo['file']} {photo['word']} {photo['fault']} {photo['level']} "
                  f"{photo['font']} P {photo['p']:.2f} {photo['scored']} {photo['reason']} | {texts}")


def main():
    match sys.argv[1:]:
        case ["read", folder]:
            read_folder(folder)
        case ["fit", *folders] if folders:
            fit(folders)
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
