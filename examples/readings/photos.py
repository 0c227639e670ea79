"""Draws the photo set that readers read: scenes of all kinds from seeds, photographed by the program.

    python3 photos.py PROGRAM OUT FACES... [--first 0 --count 640 --negatives 104]

OUT/photos/pNNNN.png are plain pictures in shuffled order, without the scene inside; OUT/truth.json
holds the word, the fault and the half (choose or test) of each, and OUT/scenes/pNNNN.toml the scene
that `score` needs. FACES are typefaces (*.ttf, *.otf) under free licenses. PROGRAM is the one of
commit 2cc4af9, whose scene files these are; the photos of readings.tsv are its.
"""

import argparse
import concurrent.futures
import csv
import functools
import hashlib
import json
import math
import os
import random
import struct
import subprocess
import tempfile
import tomllib

from words import AMBIGUOUS, EVERYDAY, NAMES, NEAR_WORDS, word_list

SIZES = [(160, 90), (240, 135), (320, 180), (320, 240), (480, 270), (480, 320), (640, 360), (640, 480), (800, 450),
         (960, 540), (1280, 720)]
COLORS = [(0.3127, 0.329)] * 5 + [(0.44, 0.40), (0.56, 0.43), (0.66, 0.32), (0.22, 0.68), (0.155, 0.08), (0.21, 0.33),
                                  (0.36, 0.18)]
FAULTS = ["wander", "lag", "late lamps", "missing run", "drift", "spacing", "blur", "resolution", "exposure", "mixture",
          "aside", "shutter", "room", "slow drone"]


def between(low, high, share):
    return low + (high - low) * share


def geometric(low, high, share):
    return low * (high / low) ** share


def random_word(rng):
    kind = rng.random()
    if kind < 0.4:
        letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
    elif kind < 0.6:
        letters = "abcdefghijklmnopqrstuvwxyz"
    elif kind < 0.85:
        letters = "0123456789"
    else:
        letters = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"
    return "".join(rng.choice(letters) for _ in range(rng.randint(2, 6)))


def all_words(rng, count, only_random=False):
    """Words without repeats: two in seven random, the rest names and everyday words."""
    names, everyday = ([], []) if only_random else (word_list(NAMES), word_list(EVERYDAY))
    rng.shuffle(names)
    rng.shuffle(everyday)
    words, seen = [], set()
    while len(words) < count:
        part = rng.random()
        if part < 0.28 or not (names or everyday):
            word = random_word(rng)
        elif part < 0.62 and names or not everyday:
            word = names.pop()
            word = rng.choice([word.upper(), word.upper(), word, word.lower()])
        else:
            word = everyday.pop()
            word = rng.choice([word.upper(), word.upper(), word.lower(), word.capitalize()])
        if word.lower() not in seen:
            seen.add(word.lower())
            words.append(word)
    return words


def scene_for(index, word, faces, fault=None, severity=None, font=None):
    """The scene of a photo: what the planner knows, what flies differently, and the light commands that go missing."""
    rng = random.Random(f"noctograph readings {index}")
    capitals = word == word.upper() and word.isalpha()
    fonts = ["simplex", "simplex", "simplex"] + rng.sample(faces, min(3, len(faces)))
    if capitals:
        fonts += ["ae483", "ae483", "ae483-fixed", "ae483-fixed", "ae483-fixed"]
    font = font or rng.choice(fonts)
    if fault is None:
        fault = "none" if rng.random() < 0.08 else rng.choice(FAULTS)
    severity = rng.random() if severity is None else severity
    cap = rng.choice([0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6])
    preset = rng.choice(["ae483-2022"] * 4 + ["cf21", "cf21-thrust-kit", "cf-brushless", "bzzz"])
    style = rng.choice(["team", "even", "even"])
    controller = rng.choice(["lqr", "lqr", "lqr-feedforward", "lqr-feedforward", "lqr-integral", "pid", "geometric"])
    width, height = rng.choice(SIZES)
    words_box = max(1, len(word))
    scene = {
        "": {"preset": preset, "word": word, "seed": index},
        "letters": {"font": font, "cap_height_m": cap, "width_m": 0.6 * cap, "gap_m": 0.2 * cap},
        "plan": {"style": style, "stroke_speed_m_s": cap * between(0.25, 0.7, rng.random())},
        "air": {},
        "controller": {"kind": controller},
        "sensors": {},
        "light": {"led_bitmask": rng.choice([0, 128]), "ring_effect": rng.choice(["off", "off", "double-spin"])},
        "camera": {"width_px": width, "height_px": height, "fill_frac": round(between(0.35, 0.85, rng.random()), 3),
                   "focal_length_m": round(between(0.02, 0.06, rng.random()), 4)},
        "photo": {"ambient_cd_m2": round(0.02 * 2.0 ** between(-3, 2.5, rng.random()), 5)},
    }
    if style == "team":
        scene["plan"]["step_m"] = 0.2 * cap
    if font.endswith((".ttf", ".otf")) and rng.random() < 0.25:
        scene["letters"]["trace"] = "outline"
    late_s, missing, known_as, color, stops = 0.0, 0.0, None, rng.choice(COLORS), between(-1, 4, rng.random())
    if rng.random() < 0.3:
        scene["camera"]["distortion"] = [round(rng.uniform(-0.25, 0.1), 3), 0.0, 0.0, 0.0]
    mild = rng.random() < 0.4

    def gusts(speed):
        scene["air"].update(gusts="ornstein-uhlenbeck", gust_sigma_m_s=[round(speed, 3)] * 3,
                            gust_torque_sigma_n_m=[speed / 0.08 * 0.00012, speed / 0.08 * 0.00011,
                                                   speed / 0.08 * 0.000055])
        scene.setdefault("vehicle", {})["body_drag_n_s_m"] = [0.016, 0.016, 0.016]

    def aside(angle):
        scene["aside"] = {"angle_rad": angle, "up_m": rng.uniform(-0.5, 0.8)}

    def blur(share):
        scene["camera"]["blur_share"] = share

    if mild and fault not in ("wander", "mixture"):
        gusts(between(0.03, 0.12, rng.random()))
    if rng.random() < 0.25 and fault != "aside":
        aside(rng.uniform(-0.5, 0.5))
    u = severity
    scale = cap / 0.5
    if fault == "wander":
        gusts(geometric(0.1, 0.9, u) * scale)
    elif fault == "lag":
        scene["controller"]["kind"] = "lqr"
        scene["plan"] = {"style": "team", "stroke_speed_m_s": geometric(0.12, 1.0, u) * scale, "step_m": 0.2 * cap}
    elif fault == "late lamps":
        late_s = geometric(0.1, 2.2, u) * cap / 0.5 * 0.2 / scene["plan"]["stroke_speed_m_s"]
    elif fault == "missing run":
        missing = between(0.08, 0.75, u)
    elif fault == "drift":
        scene["sensors"].update(lighthouse_distortion_m=geometric(0.02, 0.3, u) * scale,
                                lighthouse_distortion_length_m=cap * rng.uniform(0.7, 1.6))
    elif fault == "spacing":
        if font.startswith("ae483"):
            scene["letters"]["font"] = font = "simplex"
        scene["letters"]["spacing_m"] = -between(0.05, 0.75, u) * cap
    elif fault == "blur":
        blur(geometric(0.01, 0.35, u))
    elif fault == "resolution":
        scene["camera"]["cap_px"] = geometric(45.0, 3.0, u)
    elif fault == "exposure":
        stops = between(6.0, 11.5, u)
    elif fault == "mixture":
        times = geometric(0.7, 6.0, u)
        gusts(0.04 * times * scale)
        scene["sensors"].update(lighthouse_distortion_m=0.012 * times * scale)
        late_s = 0.12 * times * cap / 0.5 * 0.2 / scene["plan"]["stroke_speed_m_s"]
        missing = 0.04 * times
        blur(0.015 * times)
    elif fault == "aside":
        aside(rng.choice([-1, 1]) * between(0.3, 1.35, u))
    elif fault == "shutter":
        scene["shutter_frac"] = between(0.0, 0.6, u)
    elif fault == "room":
        scene["photo"]["ambient_cd_m2"] = 0.1 * 2.0 ** between(0, 6, u)
        stops = between(0, 4, u)
    elif fault == "slow drone":
        scene["vehicle"] = dict(scene.get("vehicle", {}), mass_kg=0.0351 * between(1.0, 1.25, u))
        scene["controller"]["kind"] = rng.choice(["lqr", "lqr-feedforward"])
        if preset in ("bzzz", "cf-brushless"):
            scene[""]["preset"] = "ae483-2022"
    return {"scene": scene, "fault": fault, "severity": round(severity, 3), "late_s": late_s, "missing": missing,
            "color": color, "stops": stops, "words_box": words_box}


def toml(scene):
    def value(v):
        if isinstance(v, str):
            return json.dumps(v)
        if isinstance(v, list):
            return "[" + ", ".join(value(x) for x in v) + "]"
        return repr(v)

    text = "".join(f"{key} = {value(v)}\n" for key, v in scene[""].items())
    for section, keys in scene.items():
        if section and keys:
            text += f"[{section}]\n" + "".join(f"{key} = {value(v)}\n" for key, v in keys.items())
    return text


def scene_of_score(scene):
    """Letters and camera of a scene, in today's form: what `readings verdicts` needs."""
    camera, letters = scene["camera"], dict(scene["letters"])
    part = lambda table, *keys: {key: table[key] for key in keys if key in table}
    framing = part(camera, "position_m", "target_m") if "position_m" in camera else part(camera, "fill_frac")
    kind = "fixed" if "position_m" in camera else "word"
    return toml({"": part(scene[""], "word"), "letters": letters,
                 "camera": part(camera, "width_px", "height_px", "blur_m", "shutter_close_s"),
                 "camera.framing": {"kind": kind, **framing},
                 "camera.lens": {"kind": "custom", **part(camera, "focal_length_m", "distortion")}})


@functools.cache
def preset_scene(program, preset):
    return subprocess.run([program, "scene", "--preset", preset], capture_output=True, text=True, check=True).stdout


def fixtures(program, preset, color, stops):
    """The lamps of a preset, the writing ones in a color and all dimmer by some stops."""
    lamps = tomllib.loads(preset_scene(program, preset))["light"].get("fixtures", [])
    for lamp in lamps:
        for die in lamp["dies"]:
            die["intensity_cd"] = die["intensity_cd"] * 2.0 ** -stops
        if lamp["name"].startswith("headlight"):
            lamp["dies"][0]["chromaticity"] = list(color)

    def inline(v):
        if isinstance(v, dict):
            return "{ " + ", ".join(f"{k} = {inline(x)}" for k, x in v.items()) + " }"
        if isinstance(v, list):
            return "[" + ", ".join(inline(x) for x in v) + "]"
        return json.dumps(v) if isinstance(v, str) else repr(v)

    return inline(lamps)


def lose_light(path, frac, seed, letters=None):
    """Takes a run of light commands out of each letter (or of some) of a plan."""
    rng = random.Random(f"missing {seed}")
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    head, rows = rows[0], rows[1:]
    letter, lights = head.index("letter"), [i for i, name in enumerate(head) if name.startswith("light.")]
    for which in sorted({row[letter] for row in rows if row[letter]}, key=int):
        lit = [row for row in rows if row[letter] == which and any(float(row[i] or 0) > 0 for i in lights)]
        place = rng.random()
        if letters is not None and int(which) not in letters:
            continue
        start = int(place * (len(lit) - int(frac * len(lit))))
        for row in lit[start:start + int(frac * len(lit))]:
            for i in lights:
                row[i] = "0"
    with open(path, "w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([head] + rows)


def extent(path):
    """Bounds of the lit part of a plan: x from, x to, z from, z to; and the end of the plan and of its light."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    lit = [row for row in rows if any(float(row[key] or 0) > 0 for key in row if key.startswith("light."))]
    xs, zs = [float(row["x_m"]) for row in lit], [float(row["z_m"]) for row in lit]
    return min(xs), max(xs), min(zs), max(zs), float(lit[0]["time_s"]), float(lit[-1]["time_s"])


def place_camera(draw, bounds):
    """Resolves what depends on the word's extent: resolution, blur, a camera aside, a shutter that closes early."""
    scene, camera = draw["scene"], draw["scene"]["camera"]
    x0, x1, z0, z1, lit_from, lit_to = bounds
    width, height, fill = camera["width_px"], camera["height_px"], camera["fill_frac"]
    wide, high, cap = max(x1 - x0, 0.05), max(z1 - z0, 0.05), scene["letters"]["cap_height_m"]
    px_per_m = min(fill * width / wide, fill * height / high)
    if "cap_px" in camera:
        smaller = camera.pop("cap_px") / (px_per_m * cap)
        if smaller < 1.0:
            camera["width_px"], camera["height_px"] = (max(24, round(side * smaller)) for side in (width, height))
            px_per_m *= camera["width_px"] / width
    sensor_px_per_m = camera["width_px"] / 0.036
    if "blur_share" in camera:
        camera["blur_m"] = round(camera.pop("blur_share") * cap * px_per_m / sensor_px_per_m, 7)
    draw["cap_px"] = round(cap * px_per_m, 2)
    if "aside" in scene:
        angle, up = scene["aside"]["angle_rad"], scene.pop("aside")["up_m"]
        px_wide = camera["focal_length_m"] * sensor_px_per_m
        away = px_wide / px_per_m
        middle = [0.5 * (x0 + x1), 0.5 * (z0 + z1)]
        camera.update(framing="fixed",
                      position_m=[middle[0] + away * math.sin(angle), -away * math.cos(angle),
                                  max(0.1, middle[1] + up)],
                      target_m=[middle[0], 0.0, middle[1]])
    if "shutter_frac" in scene:
        camera["shutter_close_s"] = round(lit_to - scene.pop("shutter_frac") * (lit_to - lit_from), 2)


def strip(path, out):
    """Copies a PNG without its text chunks and metadata."""
    data = open(path, "rb").read()
    with open(out, "wb") as file:
        file.write(data[:8])
        at = 8
        while at < len(data):
            (length,) = struct.unpack(">I", data[at:at + 4])
            kind = data[at + 4:at + 8]
            if kind in (b"IHDR", b"IDAT", b"IEND", b"PLTE"):
                file.write(data[at:at + 12 + length])
            at += 12 + length


def scribble(path, rng):
    """A drawing that means nothing: a few curves at random."""
    paths = []
    for letter in range(rng.randint(2, 4)):
        x, y = 60.0 * letter + 30, 50.0
        point = lambda: f"{x + rng.uniform(-28, 28):.1f} {y + rng.uniform(-45, 45):.1f}"
        data = f"M {point()}"
        for _ in range(rng.randint(2, 5)):
            data += f" L {point()}" if rng.random() < 0.5 else f" Q {point()} {point()}"
        paths.append(f'<path d="{data}" fill="none" stroke="black"/>')
    open(path, "w").write('<svg xmlns="http://www.w3.org/2000/svg" width="260" height="100">' + "".join(paths)
                          + "</svg>")


def shoot(program, draw, photo, scene_out, seed, svg=None, cut=None):
    """Plans, flies and photographs a draw. Returns the exposed picture's size, or raises when a stage fails."""
    def call(*args):
        subprocess.run([program, *args], capture_output=True, text=True, check=True, timeout=240)

    with tempfile.TemporaryDirectory() as folder:
        in_folder = lambda name: os.path.join(folder, name)
        scene = draw["scene"]
        if svg:
            scene["letters"] = {"drawing": svg, "canvas_m": [4 * scene["letters"]["cap_height_m"],
                                                             scene["letters"]["cap_height_m"]],
                                "cap_height_m": scene["letters"]["cap_height_m"]}
            scene[""].pop("word", None)
            drawing_letters = scene["letters"]
        hidden = {k: scene.pop(k) for k in ("aside", "shutter_frac") if k in scene}
        camera = {k: scene["camera"].pop(k) for k in ("cap_px", "blur_share") if k in scene["camera"]}
        open(in_folder("known.toml"), "w").write(toml(scene))
        call("plan", "--scene", in_folder("known.toml"), "-o", in_folder("plan.csv"))
        bounds = extent(in_folder("plan.csv"))
        scene.update(hidden)
        scene["camera"].update(camera)
        if draw["missing"]:
            lose_light(in_folder("plan.csv"), draw["missing"], seed, cut)
        place_camera(draw, bounds)
        light = dict(scene["light"])
        if draw["late_s"]:
            light["radio_delay_s"] = round(0.02 + draw["late_s"], 4)
        text = toml(dict(scene, light=light))
        lamps = fixtures(program, scene[""]["preset"], draw["color"], draw["stops"])
        text = text.replace("[light]\n", f"[light]\nfixtures = {lamps}\n")
        open(in_folder("scene.toml"), "w").write(text)
        call("fly", in_folder("plan.csv"), "--scene", in_folder("scene.toml"), "-o", in_folder("flight.csv"))
        call("expose", in_folder("flight.csv"), "--scene", in_folder("scene.toml"), "--backend", "cpu", "-o",
             in_folder("photo.png"))
        strip(in_folder("photo.png"), photo)
        open(scene_out, "w").write(scene_of_score(scene))


def draws(first, count, negatives, faces, only_random):
    """All photos of the set: (id of the draw, word shown, word expected, kind, keyword arguments)."""
    rng = random.Random(f"noctograph words {first}")
    for at, word in enumerate(all_words(rng, count, only_random)):
        yield first + at, word, word, "photo", {}
    at = first + count
    near, ambiguous = word_list(NEAR_WORDS), word_list(AMBIGUOUS)
    stock = all_words(random.Random(f"noctograph negatives {first}"), 2000)
    used = {word.lower() for word in all_words(random.Random(f"noctograph words {first}"), count)}
    stock = iter([word for word in stock if word.lower() not in used and word.isalpha()])
    for n in range(negatives):
        kind = ["cut", "scribble", "wrong", "ambiguous"][n % 4]
        rng = random.Random(f"negative {first} {n}")
        if kind == "wrong" and n // 4 < len(near):
            expected, shown = near[n // 4].split(":")
        elif kind == "ambiguous":
            shown = expected = ambiguous.pop() if ambiguous else "".join(rng.choice("IWUMVLAET") for _ in range(4))
        else:
            shown = expected = next(stock).upper()
        yield at + n, shown, expected, kind, {"severity": 0.25 * rng.random(), "number": n}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("out")
    parser.add_argument("faces", nargs="*")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=640)
    parser.add_argument("--negatives", type=int, default=104)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--random", action="store_true", help="random letters and digits only, as the net is trained on")
    args = parser.parse_args()
    for folder in ("raw", "photos", "scenes"):
        os.makedirs(os.path.join(args.out, folder), exist_ok=True)
    faces = [os.path.abspath(face) for face in args.faces]

    def one(item):
        index, shown, expected, kind, extra = item
        rng = random.Random(f"kind {index}")
        raw = os.path.join(args.out, "raw", f"{index}.png")
        scene_out = os.path.join(args.out, "raw", f"{index}.toml")
        svg = cut = None
        fault, severity, font = None, None, None
        if kind != "photo":
            fault, severity = rng.choice(["none", "none", "wander", "drift", "blur", "exposure"]), extra["severity"]
            font = "ae483" if kind == "ambiguous" else None
            if kind == "wrong":
                font = "simplex" if not shown.isalpha() else rng.choice(["simplex", "ae483-fixed"] + faces[:2])
        draw = scene_for(index, shown, faces, fault, severity, font)
        if kind == "scribble":
            svg = os.path.join(args.out, "raw", f"{index}.svg")
            scribble(svg, rng)
        if kind == "cut":
            draw["missing"], cut = rng.uniform(0.2, 0.6), {rng.randrange(len(shown))}
        try:
            shoot(args.program, draw, raw, scene_out, index, svg, cut)
        except subprocess.CalledProcessError as error:
            print(index, shown, draw["fault"], (error.stderr or "").strip().replace("\n", " ")[:300], flush=True)
            return None
        truth = {"shown": "" if kind == "scribble" else shown, "expected": expected, "kind": kind,
                 "fault": draw["fault"], "severity": draw["severity"], "cap_px": draw.get("cap_px"),
                 "font": os.path.basename(draw["scene"]["letters"].get("font", "drawing")), "index": index}
        half = hashlib.sha256(f"half {index}".encode()).digest()[0] % 2
        truth["half"] = ["choose", "test"][half]
        return truth

    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        taken = [truth for truth in pool.map(one, draws(args.first, args.count, args.negatives, faces, args.random)) if truth]
    random.Random("shuffle").shuffle(taken)
    truths = {}
    for n, truth in enumerate(taken, 1):
        name = f"p{n:04}"
        os.replace(os.path.join(args.out, "raw", f"{truth['index']}.png"),
                   os.path.join(args.out, "photos", name + ".png"))
        os.replace(os.path.join(args.out, "raw", f"{truth['index']}.toml"),
                   os.path.join(args.out, "scenes", name + ".toml"))
        truths[name] = truth
    with open(os.path.join(args.out, "truth.json"), "w") as file:
        json.dump(truths, file, indent=0)
    print(len(truths), "photos")


if __name__ == "__main__":
    main()
