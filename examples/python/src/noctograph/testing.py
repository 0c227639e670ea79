"""Golden photographs, flights and verdicts for tests: approved results with which new results are compared."""

from __future__ import annotations

import hashlib
import html
import json
import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from ._noctograph import Flight, Shot, flip
from .commands import PathLike
from .errors import InputError

#: Keys that a golden compared by FLIP need not keep.
DIGESTS = ("flight_sha256", "image_sha256")
PAGE = """<!doctype html><meta charset="utf-8"><title>{name}</title>
<style>body {{ font: 16px sans-serif; background: #222; color: #eee }} figure {{ display: inline-block; width: 32%; margin: 0 }}
img {{ width: 100% }}</style><h1>{name}</h1><pre>{moved}</pre>
<figure><img src="wanted.png"><figcaption>wanted</figcaption></figure>
<figure><img src="found.png"><figcaption>found</figcaption></figure>
<figure><img src="difference.png"><figcaption>FLIP</figcaption></figure>
"""


def assert_golden(
    found: Shot | Flight | Mapping[str, Any],
    golden: PathLike,
    *,
    most_flip: float | None = None,
    failures: PathLike = "golden-failures",
) -> None:
    """Asserts that a photograph, a flight or a verdict equals its golden. With NOCTOGRAPH_BLESS=1, replaces the
    golden.

    Parameters
    ----------
    found : Shot, Flight or dict
        The result of a test. A dict is a verdict, or any other dict that can be stored as JSON.
    golden : path
        Folder of the golden, with ``golden.json`` and, for a Shot, ``photo.png``. Keep this folder with the tests.
    most_flip : float, optional
        Maximum mean FLIP (0 for equal photos, 1 for black instead of white) between the photo of a Shot and its golden.
        The digests of its flights are then not compared. At 240 × 135 pixels, another flight of HI has a FLIP of 0.11,
        mostly by the noise of the sensor, and a flight of HO has 0.22. By default all digests are compared, because the
        same scene yields the same bytes on every machine.
    failures : path
        Folder for a page with both photographs and their difference if they are not the same.

    Raises
    ------
    AssertionError
        With each value that changed, and the path of the page.
    """
    __tracebackhide__ = True
    golden = Path(golden)
    if most_flip is not None and not isinstance(found, Shot):
        raise InputError("most_flip", type(found).__name__, "a Shot", "leave it out: there is no picture to compare")
    facts = _facts(found)
    if _is_blessed(golden):
        golden.mkdir(parents=True, exist_ok=True)
        (golden / "golden.json").write_text(json.dumps(facts, indent=1, ensure_ascii=False) + "\n", "utf-8")
        if isinstance(found, Shot):
            found.save(golden / "photo.png")
        return
    if not (golden / "golden.json").exists():
        raise AssertionError(f"{golden} has no golden.json: NOCTOGRAPH_BLESS=1 pytest makes it; then look at it")
    wanted = json.loads((golden / "golden.json").read_text("utf-8"))
    skipped = () if most_flip is None else DIGESTS
    moved = [line for key in {**wanted, **facts} if key not in skipped for line in _moved(key, facts.get(key), wanted.get(key))]
    if isinstance(found, Shot) and (moved or most_flip is not None):
        difference, picture = flip(golden / "photo.png", found)
        if most_flip is not None and not difference <= most_flip:
            moved.append(f"mean FLIP: found {difference:.4f}, wanted at most {most_flip}")
        if moved:
            # Goldens with the same last name in different folders have separate pages.
            page = Path(failures) / os.path.relpath(golden).replace("..", "").strip(os.sep).replace(os.sep, "-") / "index.html"
            page.parent.mkdir(parents=True, exist_ok=True)
            pictures = {"wanted": (golden / "photo.png").read_bytes(), "found": found.to_png(), "difference": picture}
            for name, png in pictures.items():
                (page.parent / f"{name}.png").write_bytes(png)
            text = PAGE.format(name=html.escape(golden.name), moved=html.escape("\n".join(moved)))
            page.write_text(text, "utf-8")
            moved.append(f"both pictures, mean FLIP {difference:.4f}: {page}")
    if moved:
        raise AssertionError("\n".join([f"{golden} is not what is found:", *moved]))


def _is_blessed(golden: Path) -> bool:
    """Returns true if goldens are replaced: NOCTOGRAPH_BLESS is 1. Another value causes a warning."""
    value = os.environ.get("NOCTOGRAPH_BLESS")
    if value == "1":
        warnings.warn(f"NOCTOGRAPH_BLESS=1: {golden} is written anew", stacklevel=3)
    elif value:
        warnings.warn(f"NOCTOGRAPH_BLESS={value}: only 1 blesses {golden}", stacklevel=3)
    return value == "1"


def _moved(key: str, found: Any, wanted: Any) -> list[str]:
    """Returns a line for each value that differs, with its path."""
    if isinstance(found, dict) and isinstance(wanted, dict):
        new, old = cast("dict[str, Any]", found), cast("dict[str, Any]", wanted)
        return [line for name in {**old, **new} for line in _moved(f"{key}.{name}", new.get(name), old.get(name))]
    if isinstance(found, list) and isinstance(wanted, list):
        ones, others = cast("list[Any]", found), cast("list[Any]", wanted)
        if len(ones) == len(others):
            pairs = enumerate(zip(ones, others))
            return [line for index, (one, other) in pairs for line in _moved(f"{key}[{index}]", one, other)]
    return [] if found == wanted else [f"{key}: found {found}, wanted {wanted}"]


def _facts(found: Shot | Flight | Mapping[str, Any]) -> dict[str, Any]:
    """Returns the part of a product that a golden stores, as JSON would return it."""
    if isinstance(found, Flight):
        return {"flight_sha256": found.sha256}
    if isinstance(found, Shot):
        verdict = found.verdict or {}
        return {
            "flight_sha256": [flight.sha256 for flight in found.flights],
            "image_sha256": hashlib.sha256(found.image.tobytes()).hexdigest(),
            "size_px": [found.image.shape[1], found.image.shape[0]],
            "read": verdict.get("read"),
            "legible": found.legible,
        }
    return json.loads(json.dumps(dict(found)))
