"""Shows the photograph of a drone's light painting before the flight, and judges whether the word is legible.

>>> import noctograph as nc
>>> nc.preview("NOOR")
<Shot: 1920 × 1080, NOOR reads as NOOR: legible>

The stages are `Scene` → `plan` → `fly` → `photograph`, whose `Shot` contains the verdict. A `Flight` made from
the arrays of your own simulator is photographed like any other.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Without this folder Mesa's device-select layer prints an error at each query of the graphics devices.
if "XDG_RUNTIME_DIR" not in os.environ:
    os.environ.setdefault("NODEVICE_SELECT", "1")

from ._noctograph import (  # noqa: E402
    Flight, Plan, Scene, Shot, __version__, fly, import_log, photograph, plan, read, score,
)  # fmt: skip
from .commands import (  # noqa: E402
    Report, check, command, compare, coverage, export, follow, gains, hold, identify, locate, meter,
)  # fmt: skip
from .errors import InfeasibleError, InputError, NoctographWarning  # noqa: E402
from .model import Model  # noqa: E402
from .studies import Outcomes, fly_many, rank, tune  # noqa: E402

if TYPE_CHECKING:
    from .learning import Env, VectorEnv, sb3_env

__all__ = [
    "Env", "Flight", "InfeasibleError", "InputError", "Model", "NoctographWarning", "Outcomes", "Plan", "Report", "Scene", "Shot", "check",
    "command", "compare", "coverage", "export", "fly", "fly_many", "follow", "from_pybullet", "gains", "hold", "identify", "import_log",
    "locate", "meter", "photograph", "plan", "preview", "rank", "read", "sb3_env", "score", "VectorEnv",
    "attitude_rad", "tune", "__version__",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """Imports the environments on first use, because they need gymnasium."""
    if name in ("Env", "VectorEnv", "sb3_env"):
        from . import learning

        return getattr(learning, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def attitude_rad(quaternion: ArrayLike, order: str = "xyzw") -> NDArray[np.float64]:
    """Converts quaternions to yaw, pitch and roll, as `Flight` expects them.

    Parameters
    ----------
    quaternion : array_like (N, 4)
        Rotations from the body (x forward, y left, z up) to the world. Their length does not matter.
    order : {"xyzw", "wxyz"}
        ``"xyzw"`` is that of ROS, PyBullet, SciPy, RotorPy and crazyflow, ``"wxyz"`` that of MuJoCo and drake.

    Returns
    -------
    ndarray (N, 3)
        In rad, without jumps of 2π.
    """
    q = np.asarray(quaternion, float)
    if q.ndim != 2 or q.shape[1] != 4 or not (np.linalg.norm(q, axis=1) > 0).all():
        raise InputError("quaternion", f"shape {q.shape}", "(N, 4), none of them zero", "one row for each time")
    if order not in ("xyzw", "wxyz"):
        raise InputError("order", repr(order), "'xyzw' or 'wxyz'", "look where your simulator keeps the scalar part")
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    x, y, z, w = (q if order == "xyzw" else np.roll(q, -1, axis=1)).T
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x**2 + y**2))
    return np.unwrap(np.stack([yaw, pitch, roll], axis=1), axis=0)


def from_pybullet(
    time_s: ArrayLike, observations: ArrayLike, *, light: Any = None, design_m: ArrayLike | None = None
) -> Flight:
    """Returns the flight of one drone from gym-pybullet-drones.

    Parameters
    ----------
    time_s : array_like (N,)
        Rising times, s.
    observations : array_like (N, M)
        States of the drone (``obs[i]`` of ``CtrlAviary``): position in m, z up, then the quaternion x, y, z, w; what
        follows is not used.
    light : array_like or dict, optional
        As for `Flight`.
    design_m : array_like (N, 3), optional
        Position that was to be flown, m, as ``plan.at(time_s).position_m``. Without it there is no tracking error.

    Returns
    -------
    Flight
    """
    states = np.asarray(observations, float)
    if states.ndim != 2 or states.shape[1] < 7:
        raise InputError("observations", f"shape {states.shape}", "(N, 20), or (N, 7) and more", "one drone's rows")
    return Flight(
        time_s, states[:, :3], light=light, attitude_rad=attitude_rad(states[:, 3:7]), design_m=design_m
    )


def preview(
    word: str, scene: str = "cf21", *, seed: int | None = None, set: Mapping[str, Any] | None = None
) -> Shot:
    """Plans, flies and photographs a word. In a notebook, the result shows its photo.

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
