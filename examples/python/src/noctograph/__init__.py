"""The photograph of a drone's light painting before the flight, and whether it reads.

>>> import noctograph as nc
>>> nc.preview("NOOR")
<Shot: 1920 × 1080, NOOR reads as NOOR: legible>

The stages one by one: `Scene` → `plan` → `fly` → `photograph`, whose `Shot` has the verdict. A `Flight`
made of your own simulator's arrays is photographed like any other.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

# Without this folder Mesa's device-select layer prints an error at each look at the graphics devices.
if "XDG_RUNTIME_DIR" not in os.environ:
    os.environ.setdefault("NODEVICE_SELECT", "1")

from ._noctograph import (  # noqa: E402
    Flight, Plan, Scene, Shot, __version__, fly, import_log, photograph, plan, read, score,
)  # fmt: skip
from .commands import (  # noqa: E402
    Report, check, command, compare, coverage, export, gains, hold, identify, locate, meter,
)  # fmt: skip
from .errors import InfeasibleError, InputError  # noqa: E402
from .studies import Outcomes, fly_many, rank, tune  # noqa: E402

if TYPE_CHECKING:
    from .learning import Env, VectorEnv, sb3_env

__all__ = [
    "Env", "Flight", "InfeasibleError", "InputError", "Outcomes", "Plan", "Report", "Scene", "Shot", "check",
    "command", "compare", "coverage", "export", "fly", "fly_many", "gains", "hold", "identify", "import_log",
    "locate", "meter", "photograph", "plan", "preview", "rank", "read", "sb3_env", "score", "VectorEnv",
    "tune", "__version__",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """The environments, which need gymnasium."""
    if name in ("Env", "VectorEnv", "sb3_env"):
        from . import learning

        return getattr(learning, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def preview(
    word: str, scene: str = "cf21", *, seed: int | None = None, set: Mapping[str, Any] | None = None
) -> Shot:
    """Plans, flies and photographs a word; in a notebook, the result shows its photo.

    Parameters
    ----------
    word : str
        Word to write.
    scene : str
        A preset, a shipped scene or a file, as for `Scene`.
    seed : int, optional
        Seed of all noise.
    set : dict, optional
        Further keys of the scene, as for `Scene`.
    """
    return photograph(Scene(scene, word=word, seed=seed, set=dict(set or {})))
