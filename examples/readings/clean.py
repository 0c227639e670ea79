"""Takes clean photos for the training: random letters in the default scene, of several fonts, sizes and seeds.

    python3 clean.py PROGRAM OUT FACES... [--first 0 --count 500]
    python3 clean.py PROGRAM OUT --words      (the 40 words of words.py, each in two sizes: for docs/calibration.md)

`readings strips OUT OUT.strips` cuts their strips, as of the photos of photos.py. PROGRAM is the present one.
Needs torch and numpy.
"""

import argparse
import json
import os
import random
import shutil
import subprocess
import tempfile

import numpy as np

import strips
import words

# Letters with accents, which are read as the letter before the colon.
ACCENTS = {accented: base for group in """A:ÀÁÂÃÄÅĀĄ C:ÇĆČ D:Ď E:ÈÉÊËĒĘĚ I:ÌÍÎÏ L:ŁĹ N:ÑŃŇ O:ÒÓÔÕÖØŐ R:ŘŔ S:ŚŞŠ T:Ť
U:ÙÚÛÜŮŰ Y:ÝŸ Z:ŹŻŽ a:àáâãäåą c:çćč e:èéêëęě g:ğ i:ìíîï l:ł n:ñńň o:òóôõöøő r:ř s:śşš u:ùúûüůű y:ýÿ z:źżž""".split()
           for base, accented_letters in [group.split(":")] for accented in accented_letters}
SIZES = [(480, 270), (640, 360), (640, 360), (800, 600), (960, 540), (1280, 720), (1920, 1080)]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("out")
    parser.add_argument("faces", nargs="*")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--accents", type=float, default=0.1, help="share of words with accents")
    parser.add_argument("--words", action="store_true", help="the words of words.py")
    args = parser.parse_args()
    for folder in ("photos", "scenes"):
        os.makedirs(os.path.join(args.out, folder), exist_ok=True)
    truths = {}

    def take(name, word, seed, options):
        with tempfile.TemporaryDirectory() as folder:
            command = [args.program, "preview", word, "--seed", str(seed), "-o", folder, *options]
            run = subprocess.run(command, capture_output=True, text=True)
            if not os.path.exists(os.path.join(folder, "photo.png")):
                print(word, run.stderr.strip(), flush=True)
                return
            for file, place in (("photo.png", f"photos/{name}.png"), ("scene.toml", f"scenes/{name}.toml")):
                shutil.copy(os.path.join(folder, file), os.path.join(args.out, place))
        base = "".join(ACCENTS.get(c, c) for c in word)
        truths[name] = {"shown": base, "expected": base}

    if args.words:
        for number, word in enumerate(words.word_list(words.CLEAN), 1):
            for size in ("640x360", "1920x1080"):
                take(f"{number:02}-{size}", word, number, ["--size", size])
    for index in range(args.first, args.first + (0 if args.words else args.count)):
        rng = random.Random(f"clean {index}")
        word, (width, height) = strips.random_text(np.random.default_rng(index), 7), rng.choice(SIZES)
        if rng.random() < args.accents:
            word = "".join(rng.choice([c] + [a for a, base in ACCENTS.items() if base == c]) for c in word)
        options = ["--font", rng.choice(["simplex"] * 6 + args.faces), "--size", f"{width}x{height}"]
        if rng.random() < 0.3:
            options += ["--set", f"letters.cap_height_m={rng.choice([0.25, 0.3, 0.4, 0.6])}"]
        take(f"c{index:05}", word, index, options)
    with open(os.path.join(args.out, "truth.json"), "w") as file:
        json.dump(truths, file, indent=0)
    print(len(truths), "photos")


if __name__ == "__main__":
    main()
