"""The design of a plan at any time."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Design(NamedTuple):
    """The design of a plan at some times. For a single time there is no axis of times.

    Attributes
    ----------
    position_m, velocity_m_s, acceleration_m_s2, jerk_m_s3 : ndarray (N, 3)
        x right, y into the scene, z up.
    yaw_rad : ndarray (N,)
        Heading of the nose.
    light : ndarray (N,)
        Level of the light, 0 to 1: the highest of all lamps.
    lights : dict of str to ndarray (N,)
        Commands of each lamp by its channel, 0 to 1, as `Flight` takes them.
    """

    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats
    jerk_m_s3: Floats
    yaw_rad: Any
    light: Any
    lights: dict[str, Any]


def _design(is_one: bool, columns: list[Any], lights: dict[str, Any]) -> Design:  # pyright: ignore[reportUnusedFunction]
    """Creates a design from arrays with a row for each time, or only from their first rows."""
    row = 0 if is_one else slice(None)
    return Design(*[column[row] for column in columns], lights={name: levels[row] for name, levels in lights.items()})
