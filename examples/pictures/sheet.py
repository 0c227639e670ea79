"""Draws typical inputs, flies them, and shows inputs and photographs side by side.

    python3 sheet.py NOCTOGRAPH ../../docs/pictures.jpg [FOLDER]      (needs Pillow, numpy)
"""

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter, ImageFont

W, H, SCALE = 800, 600, 2
INK, RED, BLUE, YELLOW, GREEN = (25, 25, 35), (205, 30, 40), (30, 70, 190), (245, 200, 20), (20, 130, 70)
LAMP = ["--set", "light.deck=color-led", "--set", 'plan.lights=["color-led"]']


class Page:
    """A picture that is drawn at twice its size."""

    def __init__(self, paper=(255, 255, 255), mode="RGB"):
        self.image = Image.new(mode, (W * SCALE, H * SCALE), paper)
        self.pen = ImageDraw.Draw(self.image)

    def line(self, points, color=INK, width=9):
        points = [(x * SCALE, y * SCALE) for x, y in points]
        r = width * SCALE / 2
        self.pen.line(points, color, round(2 * r), joint="curve")
        for x, y in (points[0], points[-1]):
            self.pen.ellipse((x - r, y - r, x + r, y + r), color)

    def fill(self, points, color=INK):
        self.pen.polygon([(x * SCALE, y * SCALE) for x, y in points], color)

    def done(self):
        return self.image.resize((W, H), Image.LANCZOS)


def circle(x, y, r, a=0, b=360, n=90):
    angles = [math.radians(a + (b - a) * k / n) for k in range(n + 1)]
    return [(x + r * math.cos(t), y + r * math.sin(t)) for t in angles]


def star(x, y, r):
    corner = lambda k: (r if k % 2 == 0 else 0.42 * r, math.pi * k / 5)
    return [(x + l * math.sin(t), y - l * math.cos(t)) for l, t in map(corner, range(10))]


def heart(x, y, r):
    t = np.linspace(0, 2 * math.pi, 120)
    down = 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)
    return list(zip(x + r * np.sin(t) ** 3, y - r * down / 17))


def wave(x, y, w, h, n, phase=0):
    return [(x + w * k / 120, y + h * math.sin(phase + 2 * math.pi * n * k / 120)) for k in range(121)]


def boat(page, color=INK, width=9):
    page.line([(180, 400), (640, 400), (560, 500), (250, 500), (180, 400)], color, width)
    page.line([(410, 380), (410, 90), (580, 350), (410, 350)], color, width)
    page.line([(385, 130), (270, 350), (385, 350), (385, 130)], color, width)


def child(page):
    page.line(circle(640, 130, 70), YELLOW, 12)
    for k in range(8):
        (x, y), (u, v) = circle(640, 130, 90, 45 * k, 45 * k, 1)[0], circle(640, 130, 125, 45 * k, 45 * k, 1)[0]
        page.line([(x, y), (u, v)], YELLOW, 12)
    page.line([(150, 280), (150, 520), (420, 520), (420, 280), (150, 280)], RED, 11)
    page.line([(120, 290), (285, 130), (450, 290)], INK, 11)
    page.line([(250, 520), (250, 400), (320, 400), (320, 520)], INK, 11)
    page.line([(580, 520), (580, 400)], (120, 70, 30), 14)
    page.line(circle(580, 340, 65), GREEN, 11)


def strokes(text, x, y, size, slant=0.0):
    """Returns the strokes of a text in the font simplex."""
    cap, found = 21, {}
    for row in (Path(__file__).parents[2] / "fonts/simplex.strokes").read_text().splitlines():
        words = row.split()
        if row.startswith("#") or len(words) < 2 or words[0] == "cap" or words[1] == "=":
            continue
        runs = []
        for word in words[2:]:
            runs.append([]) if word in "+-" else runs[-1].append(tuple(map(float, word.split(","))))
        found[words[0]] = (float(words[1]), runs)
    lines, pen = [], 0
    for letter in text:
        advance, runs = found.get(letter, (16, []))
        for run in runs:
            lines.append([(x + size * (pen + px + slant * py) / cap, y - size * py / cap) for px, py in run])
        pen += advance
    return lines


def text(page, words, x, y, size, color=INK, width=9, slant=0.0):
    for line in strokes(words, x, y, size, slant):
        page.line(line, color, width)


def table(page, desk, corners, shadow=1.0):
    """Returns the corners of a sheet on a table in a photograph of it."""
    sheet = page.done()
    unit = [(0, 0), (W, 0), (W, H), (0, H)]
    rows, right = [], []
    for (x, y), (u, v) in zip(corners, unit):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        right += [u, v]
    map_ = np.linalg.solve(np.array(rows, float), np.array(right, float))
    ground = Image.new("RGB", (W, H), desk)
    mask = Image.new("L", (W, H), 255).transform((W, H), Image.PERSPECTIVE, map_, Image.BICUBIC)
    ground.paste(sheet.transform((W, H), Image.PERSPECTIVE, map_, Image.BICUBIC), (0, 0), mask)
    return taken(ground, shadow)


def taken(picture, shadow=1.0, to_side=0.85):
    """Adds light from the side, a hard shadow over a part, a lens and grain."""
    values = np.asarray(picture.convert("RGB"), float)
    y, x = np.mgrid[0:H, 0:W]
    values *= (1 - (1 - to_side) * x / W)[..., None]
    values[x + 0.4 * y > 620] *= shadow
    values += np.random.default_rng(1).normal(0, 2.5, values.shape)
    return Image.fromarray(values.clip(0, 255).astype("uint8")).filter(ImageFilter.GaussianBlur(0.8))


def inputs(folder):
    """Returns the name, the file and further arguments of each input, and the picture that represents an input that
    is none."""
    made = []

    def add(name, picture, *more, ending="png", shown=None):
        path = folder / f"{len(made) + 1:02}.{ending}"
        picture(path) if callable(picture) else picture.save(path, quality=92)
        made.append((name, path, shown or path, more))

    def drawn(draw, paper=(255, 255, 255), mode="RGB"):
        page = Page(paper, mode)
        draw(page)
        return page

    def thick(page):
        page.fill(circle(400, 300, 230))
        page.fill(circle(400, 300, 150), (255,) * 3)
        for left, lower in ((320, 320), (430, 430), (320, 430)):
            page.fill([(left, 210), (left + 50, 210), (lower + 50, 390), (lower, 390)])

    def icons(page):
        page.fill(star(180, 180, 130), YELLOW)
        page.fill(heart(560, 190, 130), RED)
        page.fill([(180, 370), (290, 550), (70, 550)], BLUE)
        page.fill(circle(420, 470, 60), GREEN)
        page.line([(560, 420), (620, 540), (740, 380)], INK, 12)

    def signature(page):
        text(page, "Noor", 120, 370, 150, (25, 30, 90), 7, 0.35)
        page.line(wave(100, 430, 580, 22, 2.5), (25, 30, 90), 6)

    def board(page):
        text(page, "Plan A", 60, 180, 100, BLUE, 8, 0.2)
        page.line([(80, 260), (330, 260), (330, 400), (80, 400), (80, 260)], INK, 9)
        text(page, "Drone", 110, 350, 52, INK, 6, 0.2)
        page.line([(350, 330), (500, 330)], RED, 8)
        page.line([(470, 300), (500, 330), (470, 360)], RED, 8)
        text(page, "Light!", 520, 355, 56, RED, 7, 0.2)
        page.fill([(0, 570), (W, 570), (W, H), (0, H)], (120, 120, 126))

    def chart(page):
        turns = np.linspace(0, 2 * math.pi, 121)
        coast = [(400 + (260 + 40 * math.sin(3 * t) + 25 * math.sin(7 * t)) * math.cos(t),
                  300 + (200 + 30 * math.sin(5 * t)) * math.sin(t)) for t in turns]
        page.line(coast, INK, 7)
        page.line([(330 + 200 * t, 130 + 300 * t + 30 * math.sin(12 * t)) for t in np.linspace(0, 1, 40)], BLUE, 6)
        page.line(circle(300, 350, 60), GREEN, 7)
        page.line([(510, 230), (550, 270)], RED, 9)
        page.line([(550, 230), (510, 270)], RED, 9)

    def portrait(page):
        page.line(circle(400, 300, 200, 200, 520), INK, 8)
        page.line([(230, 230), (260, 120), (400, 80), (540, 120), (570, 230)], INK, 8)
        for x in (330, 470):
            page.line(circle(x, 270, 24), INK, 7)
        page.line([(400, 290), (380, 350), (410, 355)], INK, 7)
        page.line(circle(400, 370, 70, 30, 150), RED, 8)

    def kraft(page):
        page.line(circle(220, 300, 130), INK, 10)
        page.line(star(560, 300, 170) + [star(560, 300, 170)[0]], INK, 10)
        page.line(wave(100, 520, 600, 20, 4), INK, 10)

    def ruled(page):
        for y in range(40, H, 36):
            page.line([(-9, y), (W + 9, y)], (170, 200, 235), 2)
        text(page, "42 + x", 110, 350, 110, (40, 40, 120), 8, 0.1)

    def squares(page):
        for k in range(0, W, 32):
            page.line([(k, -9), (k, H + 9)], (190, 205, 220), 2)
            page.line([(-9, k), (W + 9, k)], (190, 205, 220), 2)
        boat(page)

    add("logo, thick", drawn(thick).done())
    add("icons", drawn(icons).done(), *LAMP)
    add("child's drawing", drawn(child).done(), *LAMP)
    add("the same, --ink red", drawn(child).done(), "--ink", "red", *LAMP)
    add("signature", taken(drawn(signature, (250, 248, 240)).done()), ending="jpg")
    add("sheet on a desk, --corners", table(drawn(boat, (250, 248, 238)), (92, 60, 40), [(140, 60), (650, 110), (730, 560), (60, 480)], 0.55), "--corners", "140,60 650,110 730,560 60,480", ending="jpg")
    add("light desk", table(drawn(boat, (252, 252, 250)), (205, 205, 200), [(180, 70), (640, 40), (740, 540), (90, 560)]), ending="jpg")
    add("whiteboard", taken(drawn(board, (205, 206, 210)).done(), to_side=0.75), *LAMP, ending="jpg")
    add("ruled paper", taken(drawn(ruled, (252, 250, 244)).done()), ending="jpg")
    add("squares, shadow", taken(drawn(squares, (252, 250, 244)).done(), 0.5), ending="jpg")
    add("chalk", taken(drawn(lambda page: text(page, "E = mc2", 60, 350, 105, (225, 225, 215), 8), (40, 62, 52)).done()), ending="jpg")
    add("kraft paper", taken(drawn(kraft, (176, 132, 88)).done()), ending="jpg")
    add("blueprint", drawn(lambda page: boat(page, (240, 245, 255), 7), (30, 70, 150)).done())
    add("red on yellow", drawn(lambda page: page.line(wave(100, 300, 600, 150, 2), RED, 14), YELLOW).done())
    add("white, transparent", drawn(lambda page: page.line(heart(400, 290, 220) + heart(400, 290, 220)[:2], (255,) * 4, 16), (0, 0, 0, 0), "RGBA").done())
    add("map", drawn(chart, (246, 243, 232)).done(), *LAMP)
    add("line portrait", drawn(portrait).done())
    svg = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 80 60' fill='none' stroke-width='2'><linearGradient id='g'><stop stop-color='red'/><stop offset='.5' stop-color='lime'/><stop offset='1' stop-color='blue'/></linearGradient><path stroke='url(#g)' d='M5 40C20 0 30 60 40 30S60 10 75 35'/><circle cx='40' cy='30' r='26' stroke='orange'/></svg>"
    vector = lambda page: [page.line([(10 * x, 10 * y) for x, y in curve], color, 9) for curve, color in ((circle(40, 30, 26), (255, 165, 0)), ([(5 + 0.58 * k, 38 - 12 * math.sin(k / 9)) for k in range(121)], GREEN))]
    shown = folder / "svg.png"
    drawn(vector).done().save(shown)
    add("SVG, gradient", lambda path: path.write_text(svg), *LAMP, ending="svg", shown=shown)
    hand = strokes("hello", 90, 380, 165, 0.25)
    shown = folder / "hand.png"
    drawn(lambda page: text(page, "hello", 90, 380, 165, INK, 7, 0.25)).done().save(shown)
    add("handwriting", lambda path: path.write_text(json.dumps({"strokes": hand})), ending="json", shown=shown)
    shown = folder / "word.png"
    drawn(lambda page: [page.line(line, INK, 8) for line in strokes("Привет", 60, 340, 115)]).done().save(shown)
    add("a word", lambda path: path.write_text("Привет"), ending="txt", shown=shown)
    return made


def photograph(program, path, more, folder):
    word = [path.read_text(), "--font", "simplex"] if path.suffix == ".txt" else ["--drawing", path]
    canvas = ["--set", "letters.canvas_m=[2.4, 1.5]", "--set", "letters.fit=fill"] if path.suffix == ".txt" else ["--set", "letters.canvas_m=[2.4, 1.5]"]
    command = [program, "preview", *word, *canvas, *more, "--size", "480x360", "--backend", "cpu", "-o", folder]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode > 1:
        sys.exit(f"{path}: {done.stderr}")
    return Image.open(folder / "photo.png"), done.stderr


def main():
    program, out = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    folder = Path(sys.argv[3]) if len(sys.argv) > 3 else Path(tempfile.mkdtemp())
    folder.mkdir(exist_ok=True)
    wide, high, top, columns = 200, 150, 16, 4
    made = inputs(folder)
    rows = -(-len(made) // columns)
    sheet = Image.new("RGB", (columns * (2 * wide + 12), rows * (high + top + 8)), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(12)
    for index, (name, path, shown, more) in enumerate(made):
        photo, said = photograph(program, path, more, folder / f"{index + 1:02}")
        print(name, said.strip().replace("\n", " "), sep=": ")
        x, y = (index % columns) * (2 * wide + 12), (index // columns) * (high + top + 8)
        ground = Image.new("RGB", (W, H), (150, 150, 150) if "transparent" in name else "white")
        picture = Image.open(shown).convert("RGBA")
        ground.paste(picture, (0, 0), picture)
        for k, image in enumerate((ground, photo.convert("RGB"))):
            image = image.resize((wide, high), Image.LANCZOS)
            sheet.paste(image, (x + k * wide, y + top))
        pen.text((x, y), name, "black", font)
    sheet.save(out, quality=82, optimize=True)
    print(f"{out}: {out.stat().st_size / 1000:.0f} kB")


main()
