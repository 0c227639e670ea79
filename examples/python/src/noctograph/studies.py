"""Studies: many flights at once."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._noctograph import Scene, outcomes as _outcomes, ranking as _ranking, tuning as _tuning
from .commands import PathLike, Report

Floats = NDArray[np.float64]
Words = Mapping[str, int] | Sequence[str]
Progress = Callable[[int, int], Any] | bool


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What came of N scenes, each flown with S seeds; arrays are (N, S).

    A lost drone leaves no photo: its probability and similarity are 0, the figures of its flight NaN.

    Attributes
    ----------
    probability : ndarray of float64
        Probability that a reader reads the word, 0 to 1.
    similarity : ndarray of float64
        Likeness to the word's reference rendering, 0 to 1.
    legible, lost : ndarray of bool
        The verdict; whether a drone crashed or flew out of control.
    contour_m : ndarray of float64
        Mean distance from the path in the word's plane, m.
    lag_s : ndarray of float64
        Lag behind the design, s.
    rmse_x_m, rmse_y_m, rmse_z_m : ndarray of float64
        Root mean square error against the design, m.
    drift_y_m : ndarray of float64
        Largest distance from the word's plane, m.
    tilt_rad : ndarray of float64
        Largest roll or pitch, rad.
    saturated_frac : ndarray of float64
        Share of the time in which a motor is saturated, 0 to 1.
    duration_s : ndarray of float64
        Duration of the flight, s.
    energy_j : ndarray of float64
        Energy drawn from the battery, J.
    read : list of list of str
        What is read in each photo.
    """

    probability: Floats
    similarity: Floats
    legible: NDArray[np.bool_]
    lost: NDArray[np.bool_]
    contour_m: Floats
    lag_s: Floats
    rmse_x_m: Floats
    rmse_y_m: Floats
    rmse_z_m: Floats
    drift_y_m: Floats
    tilt_rad: Floats
    saturated_frac: Floats
    duration_s: Floats
    energy_j: Floats
    read: list[list[str]]

    def __repr__(self) -> str:
        n, s = self.legible.shape
        return f"<Outcomes: {n} × {s} flights, {self.legible.mean():.0%} legible, {self.lost.sum()} lost>"


@contextmanager
def _bar(progress: Progress, what: str) -> Any:
    """The caller's progress, a bar of tqdm where that is installed, or none."""
    try:
        with warnings.catch_warnings():
            # Without ipywidgets a notebook has the bar as text.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm
    except ImportError:
        tqdm = None
    if callable(progress) or not progress or tqdm is None:
        yield progress if callable(progress) else None
        return
    with tqdm(desc=what, unit="flight") as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show


def _words(scene: Scene, words: Words | None, seeds: int) -> list[tuple[str, int]]:
    """Words with their numbers of seeds."""
    if isinstance(words, Mapping):
        return list(words.items())
    return [(word, seeds) for word in ([scene.word] if words is None else words)]


def fly_many(
    scenes: Scene | Sequence[Scene],
    seeds: int | Sequence[int] = 1,
    *,
    gains: ArrayLike | None = None,
    conditions: str = "still",
    progress: Progress = True,
) -> Outcomes:
    """Flies scenes with seeds on all cores, photographs and reads each flight.

    Parameters
    ----------
    scenes : Scene or sequence of N Scene
        What to fly.
    seeds : int or sequence of S int
        Seeds of the noise and of the conditions; a number S is the seeds from 0 to S − 1.
    gains : array_like (N, 4, 12), optional
        Gains K of linear controllers, u = u_hover − K (x − x_ref), to fly in the one scene; (N, 4, 15) with
        integrals of the position. Rows: torques about x, y, z (N m), thrust (N). Columns: position (m, world),
        yaw, pitch, roll (rad), velocity (m/s) and angular velocity (rad/s) in the body frame.
    conditions : {"still", "room", "drone"} or path
        What differs from seed to seed: nothing but noise; drafts, battery and light of a room; the drone as
        well; or a TOML file of conditions.
    progress : bool or callable
        Whether to show a bar (by tqdm, where installed), or a function of flights done and of all.

    Returns
    -------
    Outcomes
        Arrays (N, S).
    """
    scenes = [scenes] if isinstance(scenes, Scene) else list(scenes)
    if gains is not None:
        (scene,) = scenes
        kind = "lqr-integral" if np.shape(gains)[-1] == 15 else "lqr"
        settings = ({"controller.kind": kind, "controller.lqr.k": np.asarray(k).tolist()} for k in np.asarray(gains))
        scenes = [Scene(scene, set=setting) for setting in settings]
    seeds = list(range(seeds)) if isinstance(seeds, int) else list(seeds)
    with _bar(progress, "flying") as show:
        return Outcomes(**_outcomes(scenes, seeds, conditions, show))


def rank(
    scenes: Mapping[str, Scene],
    words: Words | None = None,
    *,
    seeds: int = 50,
    conditions: str = "room",
    seed: int = 0,
    folder: PathLike | None = None,
    progress: Progress = True,
) -> Report:
    """Ranks controllers by how legibly they write, on the same seeds, with 95 % intervals.

    Parameters
    ----------
    scenes : dict of str to Scene
        The contenders by name.
    words : sequence of str, or dict of str to int, optional
        Words, with their numbers of seeds where these differ; the first scene's word by default.
    seeds : int
        Seeds of each word.
    conditions : str
        As for `fly_many`.
    seed : int
        Seed that all seeds are drawn from.
    folder : path, optional
        Keeps the flights, so that the next call flies only what is new.
    progress : bool or callable
        As for `fly_many`.

    Returns
    -------
    Report
        The keys of ``noctograph rank --json``, and ``report["flights"]``.
    """
    with _bar(progress, "ranking") as show:
        named = list(scenes.items())
        counted = _words(named[0][1], words, seeds) if named else []
        return Report(*_ranking(named, counted, conditions, seed, folder, show))


def tune(
    scene: Scene,
    words: Words | None = None,
    *,
    seeds: int = 6,
    knobs: Sequence[str] | None = None,
    budget: int = 2000,
    conditions: str = "room",
    seed: int = 0,
    folder: PathLike | None = None,
    callback: Callable[[int, dict[str, Any]], bool | None] | None = None,
) -> tuple[Scene, Report]:
    """Searches the settings with which a scene writes most legibly in the least time.

    Parameters
    ----------
    scene : Scene
        Where the search begins.
    words, seeds
        As for `rank`; the seeds of a candidate.
    knobs : sequence of str, optional
        Keys to vary with their bounds, as ``"plan.stroke_speed_m_s=0.2..0.8"``; the usual ones of the
        controller by default.
    budget : int
        Flights in all.
    conditions, seed, folder
        As for `rank`.
    callback : callable, optional
        Called with the flights so far and the best candidate, a dict; False ends the search, and what it
        raises is raised.

    Returns
    -------
    Scene
        The tuned scene.
    Report
        The keys of ``noctograph tune --json`` and all candidates.
    """
    counted = _words(scene, words, seeds)
    text, keys, tuned = _tuning(scene, counted, knobs, budget, conditions, seed, folder, callback)
    return tuned, Report(text, keys)
