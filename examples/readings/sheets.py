"""Lays photos out for blind reading: twelve a sheet, each with its number in a gray strip above it.

    python3 sheets.py PHOTOS OUT        (needs Pillow)
"""

import math
import os
import sys

from PIL import Image, ImageDraw, ImageFont

COLUMNS, ROWS, TILE_W, TILE_H, STRIP = 3, 4, 480, 300, 18


def sheet(names, folder, captions=None):
    """Returns a sheet of photos, each with its name or caption above it."""
    page = Image.new("RGB", (COLUMNS * (TILE_W + 8) + 8, ROWS * (TILE_H + STRIP + 8) + 8), (70, 70, 70))
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(14)
    for n, name in enumerate(names):
        left, top = 8 + n % COLUMNS * (TILE_W + 8), 8 + n // COLUMNS * (TILE_H + STRIP + 8)
        pen.rectangle([left, top, left + TILE_W - 1, top + STRIP - 1], fill=(110, 110, 110))
        pen.text((left + 4, top), captions[n] if captions else name, fill="white", font=font)
        photo = Image.open(os.path.join(folder, name + ".png")).convert("RGB")
        by = min(TILE_W / photo.width, TILE_H / photo.height)
        size = (max(1, round(photo.width * by)), max(1, round(photo.height * by)))
        photo = photo.resize(size, Image.BICUBIC if by > 1 else Image.LANCZOS)
        page.paste(photo, (left + (TILE_W - size[0]) // 2, top + STRIP))
    return page


def main():
    folder, out = sys.argv[1:3]
    os.makedirs(out, exist_ok=True)
    names = sorted(name[:-4] for name in os.listdir(folder) if name.endswith(".png"))
    each = COLUMNS * ROWS
    for n in range(math.ceil(len(names) / each)):
        sheet(names[n * each:(n + 1) * each], folder).save(os.path.join(out, f"sheet_{n + 1:03}.png"), optimize=True)
    print(math.ceil(len(names) / each), "sheets")


if __name__ == "__main__":
    main()
