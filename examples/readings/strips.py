"""Draws strips like those that `score` cuts out of photos, of words that were not flown, for the first training of
the network.

A strip is 40 pixels high, 22 to a cap height, the capitals' heads at row 8 and their feet at row 30. It has two
channels: how bright the light looks, and how much of it has the color of the brightest; both are square roots.
"""

import csv
import math
import os
import subprocess
import tempfile

import numpy as np
import torch
import torch.nn.functional as F

CAP_PX, HEIGHT, HEAD_ROW = 22, 40, 8
MARGIN_PX = 13
CHARACTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"
NO_LETTER = len(CHARACTERS) + 1  # class 0 is the blank
N_CLASSES = len(CHARACTERS) + 2
STEP = 0.035  # distance between points of a path, in cap heights
MOST_PX = 320  # of a strip's width


def face_strokes(program, font, trace):
    """Returns a face's characters as polylines, in cap heights: {character: [[(x, y), ...], ...]}."""
    with tempfile.TemporaryDirectory() as folder:
        scene, out = os.path.join(folder, "s.toml"), os.path.join(folder, "p.csv")
        # The letters are not fitted to a room, and no setpoint or light command leads the drone.
        open(scene, "w").write(f'[letters]\nfont = "{font}"\ntrace = "{trace}"\n'
                               'cap_height_m = 0.5\ncanvas_m = [1000, 10]\n'
                               '[plan]\nsetpoint_interval_s = 0.05\nreference = "design"\nlight_clock = "setpoint"\n'
                               '[plan.style]\nkind = "even"\norder = "drawn"\ncorner_error_m = 0.003\n')
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
            face[character] = [resampled(line - [left, 0]) for line in lines]
    return face


def load_faces(program, paths):
    """Returns (path, trace, face, weight of its choice) for each typeface that the program can decompose into
    strokes."""
    faces = []
    for path in paths:
        typeface = path.endswith((".ttf", ".otf"))
        for trace in ("center-line", "outline") if typeface else ("center-line",):
            try:
                face = face_strokes(program, path, trace)
            except RuntimeError as error:
                print(path, trace, str(error).strip().splitlines()[-1][:100])
                continue
            if len(face) > 20:
                faces.append((path, trace, face, 1 if trace == "outline" else 3 if typeface else 8))
    return faces


def random_text(rng, most):
    kind, n = rng.random(), int(rng.integers(1, most + 1))
    upper, lower, digits = CHARACTERS[:26], CHARACTERS[26:52], CHARACTERS[52:]
    pick = lambda letters, n: "".join(letters[k] for k in rng.integers(0, len(letters), n))
    if kind < 0.5:
        return pick(upper, n)
    if kind < 0.7:
        return pick(lower, n)
    if kind < 0.8:
        return pick(upper, 1) + pick(lower, n - 1)
    if kind < 0.92:
        return pick(digits, n)
    return pick(upper + digits, n)


def resampled(line, step=STEP):
    d = np.hypot(*np.diff(line, axis=0).T)
    s = np.concatenate([[0], np.cumsum(d)])
    n = max(2, int(math.ceil(s[-1] / step)) + 1)
    t = np.linspace(0, s[-1], n)
    return np.stack([np.interp(t, s, line[:, 0]), np.interp(t, s, line[:, 1])], 1)


def scrawl(rng):
    """Returns a shape that is not a letter."""
    return [resampled(rng.uniform(0, 1, (int(rng.integers(3, 7)), 2)) * [0.7, 1])]


def accented(rng, character, strokes):
    """Returns a letter with a mark above, below or through it, which is read as the same letter."""
    right, top = (max(line[:, axis].max() for line in strokes) for axis in (0, 1))
    middle, kind = right / 2 + rng.normal(0, 0.02), rng.random()
    above = lambda *at: [resampled(np.array([[middle + x, top + y] for x, y in at]))]
    if character in "LDOo" and kind < 0.3:
        y, rise = rng.uniform(0.4, 0.6) * top, rng.uniform(0, 0.15)
        mark = [resampled(np.array([[middle - 0.25, y - rise], [middle + 0.15, y + rise]]))]
    elif character in "CcSsTtAaEe" and kind < 0.3:
        mark = [resampled(np.array([[middle, 0], [middle + 0.06, -0.12], [middle - 0.05, -0.22]]))]
    elif kind < 0.5:
        slant = rng.choice([-1, 1]) * rng.uniform(0.05, 0.12)
        mark = above((-slant, 0.1), (slant, 0.3))
    elif kind < 0.7:
        mark = above((-0.16, 0.2), (-0.12, 0.2)) + above((0.12, 0.2), (0.16, 0.2))
    elif kind < 0.8:
        mark = above(*[(0.09 * math.cos(a), 0.2 + 0.09 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 17)])
    else:
        mark = above((-0.14, 0.15), (-0.05, 0.15 + rng.uniform(-0.1, 0.15)), (0.05, 0.15 + rng.uniform(-0.1, 0.15)),
                     (0.14, 0.15))
    return strokes + mark


def smooth(rng, n, length):
    """Returns noise of unit size with a correlation length in points, interpolated cubically between random values."""
    knots = rng.normal(0, 1, int(n / length) + 5)
    at = np.arange(n) / length + rng.random()
    k, t = at.astype(int) + 1, at % 1
    a, b, c, d = knots[k - 1], knots[k], knots[k + 1], knots[k + 2]
    return 1.2 * (b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))))


def word_path(rng, face, text):
    """Returns the points along the pen's path with their letters (from 0) and light, and the labels. Each letter is
    distorted
    separately."""
    boxed = rng.random() < 0.25
    gap = rng.uniform(-0.05, 0.08) if rng.random() < 0.08 else rng.uniform(0.06, 0.4)
    jitter = abs(rng.normal()) * rng.choice([0.3, 1.0])
    points, letters, lit, x, labels = [], [], [], 0.0, []
    accents = 0.4 if rng.random() < 0.06 else 0.0
    for index, character in enumerate(text):
        strokes, label = face[character], CHARACTERS.index(character) + 1
        if character.isalpha() and rng.random() < accents:
            strokes = accented(rng, character, strokes)
        if rng.random() < 0.01:
            strokes, label = scrawl(rng), NO_LETTER
        width = max(line[:, 0].max() for line in strokes)
        stretch = 1.0
        if boxed and character.isupper() and width > 0.2:
            stretch, width = 0.6 / width, 0.6
        angle, shear, sx, sy, dx, dy = rng.normal(0, 1, 6) * jitter * [0.05, 0.06, 0.07, 0.07, 0.04, 0.04]
        sx, sy = math.exp(sx), math.exp(sy)
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        map = turn @ np.array([[sx * stretch, shear], [0, sy]])
        for line in strokes:
            if rng.random() < 0.1:
                line = line[::-1]
            line = (line - [width / 2 / stretch, 0.5]) @ map.T + [x + width / 2 + dx, 0.5 + dy]
            if rng.random() < 0.08 * jitter:
                line = line + rng.normal(0, 0.07, 2)
            if points:
                a, b = points[-1][-1], line[0]
                n = int(math.hypot(*(b - a)) / (3 * STEP))
                if n:
                    points.append(a + (np.arange(1, n + 1) / (n + 1))[:, None] * (b - a))
                    letters.append(np.full(n, index))
                    lit.append(np.zeros(n))
            points.append(line)
            letters.append(np.full(len(line), index))
            # A drone is slow at the start, at turns and at the end.
            lit.append(np.ones(len(line)))
        labels.append(label)
        x += width + gap + rng.uniform(-0.04, 0.04)
    return np.concatenate(points), np.concatenate(letters), np.concatenate(lit), labels


def flown(rng, face, text, hard):
    """Returns a word's path in pixels of the strip, the light of its points, the labels, the ends of each letter, and
    the
    width."""
    points, letters, lit, labels = word_path(rng, face, text)
    n = len(points)
    if hard:
        # The drone drifts in the order of flying, lags, and has late lamps.
        if rng.random() < 0.75:
            sway = abs(rng.normal(0, 0.055)) * (0.5 + hard)
            for length in 0.5 * 10 ** rng.uniform(0, 1.2, 4):
                wave = smooth(rng, 2 * n, length / STEP / 2)
                points = points + 0.6 * sway * np.stack([wave[:n], wave[n:2 * n]], 1)
        if rng.random() < 0.35:
            length = abs(rng.normal(0, 0.09)) / STEP + 1e-3
            a = math.exp(-1 / length)
            weights = (1 - a) * a ** np.arange(int(6 * length) + 1)
            start = np.repeat(points[:1], len(weights) - 1, 0)
            late = np.concatenate([start, points])
            points = np.stack([np.convolve(late[:, k], weights / weights.sum(), "valid") for k in (0, 1)], 1)
        if rng.random() < 0.1:  # and swings about
            length, period = rng.uniform(0.2, 0.6) / STEP, rng.uniform(0.25, 1.0) / STEP
            t = np.arange(int(3 * length))
            weights = np.exp(-t / length) * np.sin(6.283 * t / period + rng.uniform(0, 1))
            turn = np.diff(points, axis=0, prepend=points[:1])
            start = np.zeros((len(t) - 1, 2))
            swing = np.concatenate([start, np.diff(turn, axis=0, prepend=turn[:1])])
            swing = np.stack([np.convolve(swing[:, k], weights, "valid") for k in (0, 1)], 1)
            points = points + swing * abs(rng.normal(0, 0.07)) / STEP
        if rng.random() < 0.25:
            late = int(abs(rng.normal(0, 0.16)) / STEP)
            lit = np.concatenate([np.zeros(late), lit])[:n]
        if rng.random() < 0.3:
            for index in range(len(labels)):
                own = np.flatnonzero((letters == index) & (lit > 0))
                if len(own) > 6 and rng.random() < 0.6:
                    share = rng.uniform(0.03, 0.15) if rng.random() < 0.6 else rng.uniform(0.1, 0.8)
                    run = int(share * len(own))
                    start = int(rng.integers(0, len(own) - run))
                    lit[own[start:start + run]] = 0
                    if share > 0.45:
                        labels[index] = NO_LETTER
    # The whole word gets a slant, a rotation, a size and a position.
    slant, turn, size, wide, high = rng.normal(0, 1, 5) * [0.07, 0.03, 0.07, 0.12, 0.07]
    size, wide = math.exp(size), math.exp(wide)
    c = points - [points[:, 0].mean(), 0.5]
    c = np.stack([wide * (c[:, 0] + slant * c[:, 1]), c[:, 1] + turn * c[:, 0]], 1) * size
    shown = lit > 0
    left = c[shown, 0].min() if shown.any() else 0.0
    px = np.stack([(c[:, 0] - left) * CAP_PX + MARGIN_PX + rng.normal(0, 2),
                   HEAD_ROW + (0.5 - high - c[:, 1]) * CAP_PX], 1)
    right = px[shown, 0].max() if shown.any() else 2 * MARGIN_PX
    ends = [(own.min(), own.max()) for own in (px[letters == index, 0] for index in range(len(labels)))]
    uneven = abs(rng.normal(0, 0.35)) * (2.5 if rng.random() < 0.1 else 1)
    light = lit * np.exp(np.clip(smooth(rng, n, 8 if rng.random() < 0.7 else 30) * uneven, -2.5, 1.5))
    if rng.random() < 0.25:
        pace = np.hypot(*np.diff(px, axis=0, prepend=px[:1]).T) / CAP_PX / STEP
        light = light * np.clip(pace, 0.3, 3)  # each step has the same light, independently of its length
    if rng.random() < 0.2:  # dots where it waits
        stop = np.flatnonzero(np.diff(lit, prepend=0, append=0))[:-1]
        light[np.minimum(stop, n - 1)] += rng.uniform(1, 12) * lit[np.minimum(stop, n - 1)]
    return px, light, (lit if rng.random() < 0.3 else np.ones(n)), labels, ends, int(right + MARGIN_PX) // 2 * 2


def splat(px, weights, rows, n_rows, width):
    """Draws points on pages (`rows` counts pages), with each point distributed over the four pixels around it."""
    x, y = px[:, 0] - 0.5, px[:, 1] - 0.5
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = x - x0, y - y0
    size = n_rows * HEIGHT * width
    out = np.zeros(size, np.float32)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        at_x, at_y = (x0 + dx).astype(int), (y0 + dy).astype(int)
        ok = (at_x >= 0) & (at_x < width) & (at_y >= 0) & (at_y < HEIGHT)
        share = weights * (fx if dx else 1 - fx) * (fy if dy else 1 - fy)
        out += np.bincount(((rows * HEIGHT + at_y) * width + at_x)[ok], share[ok], size).astype(np.float32)
    return torch.from_numpy(out.reshape(n_rows, HEIGHT, width))


def blurred(pages, sigma):
    """Blurs each page by its own sigma, in pixels."""
    n, height, width = pages.shape
    reach = max(1, min(12, int(3 * sigma.max() + 1)))
    t = torch.arange(-reach, reach + 1)
    kernel = torch.exp(-0.5 * (t / sigma[:, None].clamp(min=0.05)) ** 2)
    kernel = kernel / kernel.sum(1, keepdim=True)
    pages = F.conv2d(pages[None], kernel[:, None, None, :], padding=(0, reach), groups=n)
    return F.conv2d(pages, kernel[:, None, :, None], padding=(reach, 0), groups=n)[0]


def rendered(rng, paths):
    """Renders a batch of strips (batch, HEIGHT, width, 2) of bytes from paths of similar width."""
    n, width = len(paths), max(path[5] for path in paths)
    draw = lambda low, high: torch.from_numpy(rng.uniform(low, high, n).astype(np.float32))
    some = lambda share: torch.from_numpy(rng.random(n) < share)
    gauss = lambda sigma: torch.from_numpy(np.abs(rng.normal(0, sigma, n)).astype(np.float32))
    each = lambda values: values[:, None, None]
    px = np.concatenate([path[0] for path in paths])
    rows = np.repeat(np.arange(n), [len(path[0]) for path in paths])
    ink = splat(px, np.concatenate([path[1] for path in paths]), rows, n, width)
    other = torch.zeros_like(ink)
    has_other = rng.random(n) < 0.55
    for copy in range(2):
        away, level = rng.normal(0, 0.1 * CAP_PX, (n, 2)), 10 ** rng.uniform(-1.6, -0.1, n) * has_other
        if copy:
            level = level * (rng.random(n) < 0.5)
        way = np.concatenate([path[2] for path in paths]) * level[rows]
        keep = way > 0
        other = other + splat((px + away[rows])[keep], way[keep], rows[keep], n, width)
    pen = draw(0.3, 1.15)
    glow = torch.where(some(0.15), torch.zeros(n), gauss(1.0) * draw(0.5, 1.5))
    glow = glow + torch.where(some(0.06), draw(1, 4.5), torch.zeros(n))
    sigma = torch.sqrt(pen ** 2 + glow ** 2)
    both = blurred(torch.cat([ink, other]), torch.cat([sigma, sigma]))
    if rng.random() < 0.7:
        wide, share = draw(2, 4), draw(0, 0.25) * some(0.6)
        both = both + torch.cat([2 * share, share])[:, None, None] * blurred(both, torch.cat([wide, wide]))
    ink, other = both[:n], both[n:]
    top = torch.quantile(ink.reshape(n, -1), 0.967, dim=1) + 0.1 * ink.amax((1, 2)) + 1e-6
    gain = torch.from_numpy(rng.choice([0.8, 1.0, 1.3, 2.0, 4.0], n).astype(np.float32)) / top
    ink, other = ink * each(gain), other * each(gain)
    low = 10 ** rng.uniform(math.log10(4.0), math.log10(20), n) / CAP_PX
    for at in np.flatnonzero(rng.random(n) < 0.35):  # few pixels
        small = (max(4, round(HEIGHT * low[at])), max(4, round(width * low[at])))
        how = rng.choice(["bilinear", "nearest"])
        page = torch.stack([ink[at], other[at]])[None].clamp(max=1.5)
        page = F.interpolate(F.interpolate(page, small, mode="area"), (HEIGHT, width), mode=how)
        ink[at], other[at] = page[0, 0], page[0, 1]
    noise = 10 ** torch.where(some(0.3), draw(-3, -0.9), draw(-3, -1.7))
    grain = torch.randn(n, HEIGHT, width) * each(noise)
    if rng.random() < 0.5:
        grain = 1.5 * blurred(grain, torch.full((n,), 0.6))
    bright = (ink + other + grain).clamp(0, 1)
    less = draw(0, 0.6) * some(0.5)
    more = torch.from_numpy(rng.choice([0, 0, 0.2, 1.0], n).astype(np.float32))
    pure = (ink + each(more - less) * other + 0.7 * grain).clamp(0, 1)
    # Dimmer letters have a different color from saturated ones, and are therefore missing in the
    # second channel.
    level = torch.from_numpy(rng.uniform(-0.6, 1.2, (n, 1, 6)).astype(np.float32)).clamp(0, 1)
    level = F.interpolate(level, width, mode="linear", align_corners=True)
    pure = torch.where(each(some(0.5)), pure * level, pure)
    pure = (pure - each(draw(0.1, 0.6) * some(0.2))).clamp(min=0)
    image = torch.stack([bright, pure], 3) * torch.where(some(0.3), draw(0.15, 0.8), torch.ones(n))[:, None, None, None]
    return torch.round(255 * torch.sqrt(image)).to(torch.uint8)


def batches(rng, faces, weights, n_batches, size, most=7):
    """Yields batches of strips of similar width: images, column targets and labels."""
    paths = []
    while len(paths) < n_batches * size:
        face = faces[rng.choice(len(faces), p=weights)]
        known = lambda c: c if c in face else (c.upper() if c.upper() in face else CHARACTERS[rng.integers(0, 26)])
        text = "".join(known(c) for c in random_text(rng, most))
        path = flown(rng, face, text, 0.0 if rng.random() < 0.15 else rng.random())
        if path[5] <= MOST_PX:
            paths.append(path)
    paths.sort(key=lambda path: path[5])
    made = []
    for at in range(0, len(paths), size):
        group = paths[at:at + size]
        images = rendered(rng, group)
        targets = np.stack([column_targets(images.shape[2], path[3], path[4]) for path in group])
        made.append((images, torch.from_numpy(targets), [path[3] for path in group]))
    return [made[k] for k in rng.permutation(len(made))]


def column_targets(width, labels, ends):
    """Returns the target of each column of logits: a letter's class near its middle, the blank (0) between letters,
    and the
    negative class where either is allowed."""
    x = 2 * np.arange(width // 2) + 1.0
    middles = np.array([(left + right) / 2 for left, right in ends])
    halves = np.array([max(2.6, (right - left) / 2) for left, right in ends])
    off = np.abs(x[:, None] - middles) / halves
    nearest = off.argmin(1)
    least = off[np.arange(len(x)), nearest]
    targets = np.asarray(labels)[nearest]
    return np.where(least < 0.3, targets, np.where(least > 0.9, 0, -targets))
