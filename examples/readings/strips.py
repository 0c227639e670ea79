"""Draws strips as `score` cuts them out of photos, of words that nobody flew: what the reader's net is trained on first.

A strip is 40 pixels high, 22 to a cap height, the capitals' heads at row 8 and their feet at row 30. It has two
channels: how bright the light looks, and how much of it has the color of the brightest; both are square roots.
"""

import csv
import io
import math
import os
import random
import subprocess
import tempfile

import numpy as np
from PIL import Image, ImageDraw
from scipy import ndimage, signal

CAP_PX, HEIGHT, HEAD_ROW = 22, 40, 8
MARGIN_PX = 13
CHARACTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"
NO_LETTER = len(CHARACTERS) + 1  # class 0 is the blank
N_CLASSES = len(CHARACTERS) + 2
STEP = 0.05


def face_strokes(program, font, trace):
    """A face's characters as polylines, in cap heights: {character: [[(x, y), ...], ...]}."""
    with tempfile.TemporaryDirectory() as folder:
        scene, out = os.path.join(folder, "s.toml"), os.path.join(folder, "p.csv")
        open(scene, "w").write(f'[letters]\nfont = "{font}"\ntrace = "{trace}"\ncap_height_m = 0.5\n'
                               f'[plan]\nstyle = "even"\norder = "drawn"\ncorner_error_m = 0.003\n'
                               'setpoint_interval_s = 0.05\n')
        letters = CHARACTERS if not font.startswith("ae483") else CHARACTERS[:26]
        run = subprocess.run([program, "plan", letters, "--scene", scene, "-o", out], capture_output=True, text=True)
        if run.returncode:
            raise RuntimeError(run.stderr)
        rows = list(csv.DictReader(open(out)))
    light = [key for key in rows[0] if key.startswith("light.")][0]
    strokes, last = {}, None
    for row in rows:
        lit = float(row[light] or 0) > 0 and row["letter"] not in ("", "0")
        if lit:
            character = letters[int(row["letter"]) - 1]
            if last != character:
                strokes.setdefault(character, []).append([])
            strokes[character][-1].append((float(row["x_m"]) / 0.5, (float(row["z_m"]) - 0.5) / 0.5))
            last = character
        else:
            last = None
    face = {}
    for character, lines in strokes.items():
        lines = [np.array(line) for line in lines if len(line) > 1]
        if lines:
            left = min(line[:, 0].min() for line in lines)
            face[character] = [line - [left, 0] for line in lines]
    return face


def random_text(rng, most):
    kind, n = rng.random(), rng.randint(1, most)
    upper, lower, digits = CHARACTERS[:26], CHARACTERS[26:52], CHARACTERS[52:]
    if kind < 0.5:
        return "".join(rng.choice(upper) for _ in range(n))
    if kind < 0.7:
        return "".join(rng.choice(lower) for _ in range(n))
    if kind < 0.8:
        return rng.choice(upper) + "".join(rng.choice(lower) for _ in range(n - 1))
    if kind < 0.92:
        return "".join(rng.choice(digits) for _ in range(n))
    return "".join(rng.choice(upper + digits) for _ in range(n))


def resampled(line, step=STEP):
    d = np.hypot(*np.diff(line, axis=0).T)
    s = np.concatenate([[0], np.cumsum(d)])
    n = max(2, int(math.ceil(s[-1] / step)) + 1)
    t = np.linspace(0, s[-1], n)
    return np.stack([np.interp(t, s, line[:, 0]), np.interp(t, s, line[:, 1])], 1)


def scrawl(rng):
    """A letter that is none."""
    points = np.array([[rng.uniform(0, 0.7), rng.uniform(0, 1)] for _ in range(rng.randint(3, 6))])
    return [resampled(points)]


def word_path(rng, face, text):
    """Points along the pen's way with their letter and whether they are lit; each letter's own distortion applied."""
    nrg = np.random.default_rng(rng.getrandbits(32))
    boxed = rng.random() < 0.25
    gap = rng.uniform(0.06, 0.4)
    jitter = abs(rng.gauss(0, 1)) * rng.choice([0.3, 1.0])
    points, letters, lit, x, labels = [], [], [], 0.0, []
    for index, character in enumerate(text):
        strokes = face.get(character)
        label = CHARACTERS.index(character) + 1
        if rng.random() < 0.01:
            strokes, label = scrawl(rng), NO_LETTER
        width = max(line[:, 0].max() for line in strokes)
        if boxed and character.isupper() and width > 0.2:
            strokes = [line * [0.6 / width, 1] for line in strokes]
            width = 0.6
        angle, shear = nrg.normal(0, 0.05 * jitter), nrg.normal(0, 0.06 * jitter)
        sx, sy = np.exp(nrg.normal(0, 0.07 * jitter, 2))
        dx, dy = nrg.normal(0, 0.04 * jitter, 2)
        for line in strokes:
            line = resampled(line)
            if rng.random() < 0.1:
                line = line[::-1]
            c = line - [width / 2, 0.5]
            c = np.stack([sx * c[:, 0] + shear * c[:, 1], sy * c[:, 1]], 1)
            c = c @ np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
            line = c + [x + width / 2 + dx, 0.5 + dy]
            if rng.random() < 0.08 * jitter:
                line = line + nrg.normal(0, 0.07, 2)
            if points:
                way = resampled(np.stack([points[-1][-1], line[0]]), 3 * STEP)[1:-1]
                if len(way):
                    points.append(way)
                    letters.append(np.full(len(way), index))
                    lit.append(np.zeros(len(way), bool))
            points.append(line)
            letters.append(np.full(len(line), index))
            lit.append(np.ones(len(line), bool))
        labels.append(label)
        x += width + gap + rng.uniform(-0.04, 0.04)
    return np.concatenate(points), np.concatenate(letters), np.concatenate(lit), labels


def strip(rng, faces, most=7):
    """A strip (HEIGHT, width, 2) of bytes, its labels, and the left and right end of each letter in pixels."""
    face = rng.choice(faces)
    text = "".join(c if c in face else (c.upper() if c.upper() in face else rng.choice(CHARACTERS[:26]))
                   for c in random_text(rng, most))
    points, letters, lit, labels = word_path(rng, face, text)
    nrg = np.random.default_rng(rng.getrandbits(32))
    n = len(points)
    clean = rng.random() < 0.15
    hard = 0.0 if clean else rng.random()

    # A drone that drifts, in the order of flying; that trails; whose lamps are late.
    s = np.arange(n) * STEP
    if rng.random() < 0.75 and not clean:
        sway = abs(rng.gauss(0, 0.055)) * (0.5 + hard)
        for _ in range(4):
            wave, phase = 0.5 * 10 ** rng.uniform(0, 1.2), nrg.uniform(0, 6.3, 2)
            points = points + sway * 0.7 * np.sin(s[:, None] * 6.283 / wave + phase)
    if rng.random() < 0.35 and not clean:
        length = abs(rng.gauss(0, 0.09)) / STEP + 1e-3
        a = math.exp(-1 / length)
        points = points[0] + signal.lfilter([1 - a], [1, -a], points - points[0], axis=0)
    if rng.random() < 0.25 and not clean:
        late = int(abs(rng.gauss(0, 0.16)) / STEP)
        lit = np.concatenate([np.zeros(late, bool), lit])[:n]
    if rng.random() < 0.3 and not clean:
        for index in range(len(labels)):
            own = np.flatnonzero((letters == index) & lit)
            if len(own) > 6 and rng.random() < 0.6:
                share = rng.uniform(0.03, 0.15) if rng.random() < 0.6 else rng.uniform(0.1, 0.8)
                run = int(share * len(own))
                start = rng.randrange(len(own) - run)
                lit[own[start:start + run]] = False
                if share > 0.45:
                    labels[index] = NO_LETTER
    if rng.random() < 0.3:  # ends that are a bit short
        lit = lit & ~(np.random.default_rng(rng.getrandbits(32)).random(n) < 0.004)

    # The whole word's slant, turn, size and place.
    slant, turn = rng.gauss(0, 0.07), rng.gauss(0, 0.03)
    size = math.exp(rng.gauss(0, 0.07))
    wide = math.exp(rng.gauss(0, 0.12))
    middle = points.mean(0)
    c = points - [middle[0], 0.5]
    c = np.stack([wide * (c[:, 0] + slant * c[:, 1]), c[:, 1] + turn * c[:, 0]], 1) * size
    c[:, 1] += 0.5 + rng.gauss(0, 0.07)
    left = c[lit, 0].min() if lit.any() else 0.0
    px = np.stack([(c[:, 0] - left) * CAP_PX + MARGIN_PX + rng.gauss(0, 2), HEAD_ROW + (1 - c[:, 1]) * CAP_PX], 1)
    right = px[lit, 0].max() if lit.any() else 2 * MARGIN_PX
    width = int(right + MARGIN_PX)

    ends = []
    for index in range(len(labels)):
        own = px[letters == index, 0]
        ends.append((own.min(), own.max()))
    scale = 3
    pen = rng.uniform(0.9, 3.2)
    def draw(mask, offset, shades):
        page = Image.new("F", (width * scale, HEIGHT * scale), 0.0)
        pencil = ImageDraw.Draw(page)
        w = max(1, round(pen * scale))
        at = 0
        while at < n:
            if not mask[at]:
                at += 1
                continue
            end = at
            while end < n and mask[end] and letters[end] == letters[at] and end - at < 12:
                end += 1
            run = (px[at:min(end + 1, n) if end < n and mask[end] else end] + offset) * scale
            if len(run) > 1:
                pencil.line([tuple(p) for p in run], fill=float(shades[at]), width=w, joint="curve")
            at = max(end, at + 1)
        image = np.asarray(page).reshape(HEIGHT, scale, width, scale).mean((1, 3))
        return image

    uneven = abs(rng.gauss(0, 0.35))
    shades = np.exp(np.clip(ndimage.gaussian_filter1d(nrg.normal(0, 1, n), 8) * 4 * uneven, -2, 1.5))
    ink = draw(lit, np.zeros(2), shades)
    other = np.zeros_like(ink)
    if rng.random() < 0.55:
        level = 10 ** rng.uniform(-1.6, -0.1)
        for _ in range(rng.randint(1, 3)):
            offset = nrg.normal(0, 0.1, 2) * CAP_PX
            mask = np.ones(n, bool) if rng.random() < 0.7 else lit
            other = other + level * draw(mask, offset, np.ones(n))
    glow = 0.0 if rng.random() < 0.15 else abs(rng.gauss(0, 1.0)) * (0.5 + hard)
    if rng.random() < 0.06:
        glow += rng.uniform(1, 4.5)
    blur = lambda image: ndimage.gaussian_filter(image, glow) if glow > 0.2 else image
    ink, other = blur(ink), blur(other)
    if rng.random() < 0.5:
        wide_glow, share = rng.uniform(2, 6), rng.uniform(0, 0.25)
        ink = ink + share * ndimage.gaussian_filter(ink, wide_glow) * 2
        other = other + share * ndimage.gaussian_filter(other, wide_glow)
    top = np.partition(ink.ravel(), -max(1, ink.size // 30))[-max(1, ink.size // 30)] + 1e-6
    gain = rng.choice([1.0, 1.0, 1.3, 2.0, 4.0]) / top
    ink, other = ink * gain, other * gain
    if rng.random() < 0.35:  # few pixels
        low = 10 ** rng.uniform(math.log10(4.0), math.log10(20)) / CAP_PX
        small = (max(4, round(HEIGHT * low)), max(4, round(width * low)))
        resize = lambda image, size, how: np.asarray(Image.fromarray(image.astype(np.float32)).resize(size[::-1], how))
        how = rng.choice([Image.BILINEAR, Image.NEAREST, Image.BOX])
        ink, other = (resize(resize(np.minimum(image, 1.5), small, Image.BOX), (HEIGHT, width), how)
                      for image in (ink, other))
    noise = 10 ** rng.uniform(-3, -0.9 if rng.random() < 0.3 else -1.7)
    grain = nrg.normal(0, noise, (HEIGHT, width))
    if rng.random() < 0.5:
        grain = ndimage.gaussian_filter(grain, 0.6) * 1.5
    bright = np.clip(ink + other + grain, 0, 1)
    pure = np.clip(ink - other * rng.uniform(0.0, 0.6) * (rng.random() < 0.5) + other * rng.choice([0, 0, 0.2, 1.0])
                   + 0.7 * grain, 0, 1)
    # Dimmer letters have another color than those that saturate: they are lost from the second channel.
    if rng.random() < 0.5:
        level = np.interp(np.arange(width), np.linspace(0, width, 6), nrg.uniform(-0.6, 1.2, 6))
        pure = pure * np.clip(level, 0, 1)
    if rng.random() < 0.2:
        pure = np.clip(pure - rng.uniform(0.1, 0.6), 0, 1)
    image = np.stack([bright, pure], 2) * (rng.uniform(0.15, 0.8) if rng.random() < 0.3 else 1.0)
    return np.round(255 * np.sqrt(image)).astype(np.uint8), labels, ends


def column_targets(width, labels, ends):
    """What each column of logits should say: a letter near its middle (its class), the blank between letters (0), and
    in between either (the letter's class, negative)."""
    x = 2 * np.arange(width // 2) + 1.0
    middles = np.array([(left + right) / 2 for left, right in ends])
    halves = np.array([max(2.6, (right - left) / 2) for left, right in ends])
    off = np.abs(x[:, None] - middles) / halves
    nearest = off.argmin(1)
    least = off[np.arange(len(x)), nearest]
    targets = np.asarray(labels)[nearest]
    return np.where(least < 0.3, targets, np.where(least > 0.9, 0, -targets))


def load_faces(program, paths):
    faces = []
    for path in paths:
        for trace in ("centre-line", "outline") if path.endswith((".ttf", ".otf")) else ("centre-line",):
            try:
                face = face_strokes(program, path, trace)
            except RuntimeError as error:
                print(path, trace, str(error).strip().splitlines()[-1][:100])
                continue
            if len(face) > 20:
                faces.append((path, trace, face))
    return faces
