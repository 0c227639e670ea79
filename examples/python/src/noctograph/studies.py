"""Studies, which simulate many flights at once."""

from __future__ import annotations

import hashlib
import inspect
import json
import operator
import sys
import time
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._noctograph import (
    Scene, Sessions, __version__, ladder as _ladder, outcomes as _outcomes, ranking as _ranking, trials as _trials, tuning as _tuning,
)  # fmt: skip
from .answers import Candidate
from .commands import PathLike, Report
from .errors import InputError, warn

Floats = NDArray[np.float64]
Words = Mapping[str, int] | Sequence[str]
Progress = Callable[[int, int], Any] | bool
Controller = Callable[..., Any]
#: Largest seed, and maximum number of flights of a study.
MOST_SEED, MOST_FLIGHTS = (1 << 64) - 1, 500_000
#: Trials of a study: indices of contender and word, and the seed.
Trials = Sequence[tuple[int, int, int]]


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Outcomes of N scenes, each flown with S seeds. Arrays are (N, S).

    A lost drone leaves no photo. Its probability and similarity are 0, and the figures of its flight are NaN.

    Attributes
    ----------
    probability : ndarray of float64
        Probability that a reader reads the word, 0 to 1.
    similarity : ndarray of float64
        Likeness to the word's reference rendering, 0 to 1.
    legible, lost : ndarray of bool
        `legible` is the verdict, and `lost` is true if a drone crashed or flew out of control.
    contour_m : ndarray of float64
        Mean distance from the path in the word's plane, m.
    lag_s : ndarray of float64
        Lag behind the design, s. A negative lag is a lead.
    rmse_x_m, rmse_y_m, rmse_z_m : ndarray of float64
        Root mean square error against the design, m.
    drift_y_m : ndarray of float64
        Largest distance from the word's plane, m.
    tilt_rad : ndarray of float64
        Largest roll or pitch, rad.
    saturated_frac : ndarray of float64
        Fraction of the time in which a motor is saturated, 0 to 1.
    duration_s : ndarray of float64
        Duration of the flight, s.
    energy_j : ndarray of float64
        Energy drawn from the battery, J.
    read : list of list of str
        Reading of each photo.
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


class _Line:
    """A progress bar as text, used if tqdm is not installed, for notebooks and terminals."""

    def __init__(self, what: str) -> None:
        self.what, self.shown, self.begun = what, -1, time.monotonic()

    def show(self, done: int, total: int) -> None:
        tenths = 1000 * done // max(total, 1)
        if tenths == self.shown:
            return
        self.shown = tenths
        bar = "#" * (20 * done // max(total, 1))
        elapsed_s = time.monotonic() - self.begun
        left = f", {elapsed_s * (total - done) / done:.0f} s left" if done else ""
        sys.stderr.write(f"\r{self.what} |{bar:<20}| {done}/{total}{left}      ")
        sys.stderr.flush()


@contextmanager
def _bar(progress: Progress, what: str) -> Any:
    """Provides the caller's progress function, a bar of tqdm or, if it is not installed, of text, or None."""
    if callable(progress) or not progress:
        yield progress if callable(progress) else None
        return
    try:
        with warnings.catch_warnings():
            # Without ipywidgets a notebook shows the bar as text.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm
    except ImportError:
        line = _Line(what)
        try:
            yield line.show
        finally:
            sys.stderr.write("\n")
        return
    with tqdm(desc=what, unit="flight") as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield show


def _takes_time(controller: Controller) -> bool:
    """Returns true if a controller accepts a third positional argument, the time."""
    try:
        parameters = inspect.signature(controller).parameters.values()
    except (TypeError, ValueError):
        return False
    positional = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    return len(positional) >= 3 or any(p.kind == p.VAR_POSITIONAL for p in parameters)


def _commands(found: Any, shape: tuple[int, ...], hint: str) -> Any:
    """Returns the motor commands in a controller's answer. Raises an `InputError` if their shape or type is wrong."""
    commands = np.asarray(found)
    if commands.dtype.kind not in "biuf" or commands.shape != shape:
        what = f"{commands.dtype} of shape {commands.shape}"
        raise InputError("controller", what, f"motor commands, numbers of shape {shape}", hint)
    return commands


def _made(controller: Controller, scene: Scene) -> Controller:
    """Returns the controller of a flight. A class is instantiated, with the scene if its constructor has a `scene`."""
    if not isinstance(controller, type):
        return controller
    return controller(scene) if "scene" in inspect.signature(controller).parameters else controller()


def _fly_controlled(
    scene: Scene,
    seeds: Sequence[int],
    controller: Controller | None,
    estimator: Controller | None,
    conditions: str,
    vectorized: bool,
    show: Callable[[int, int], Any] | None,
) -> tuple[dict[str, Any], list[str]]:
    """Flies a scene with all seeds in step, by a controller or estimator of Python.

    Returns the row of the scene in the columns of `Outcomes`, and the outcomes as JSON. Issues the warnings of the
    flights.
    """
    n = len(seeds)
    sessions = Sessions(scene, n, conditions, estimator, controller is None)
    sessions.reset(list(seeds))
    each: list[Any] = [None if controller is None else _made(controller, scene) for _ in (seeds[:1] if vectorized else seeds)]
    timed = controller is not None and _takes_time(each[0])
    motors = np.zeros((n, 4))
    while not (over := (seen := sessions.observations())["landed"] | seen["lost"]).all():
        rows = (seen["state"], seen["reference"], seen["time_s"])[: 3 if timed else 2]
        if controller is None:  # an estimator with the scene's controller
            sessions.step(None, [sessions.command_hz // 10] * n)
        else:
            if vectorized:
                hint = "a vectorized controller takes (N, 12), (N, 9) and (N,) and returns m1 to m4 of each"
                motors[:] = _commands(each[0](*rows), (n, 4), hint)
            else:
                for index in np.flatnonzero(~over):
                    row = (column[index] for column in rows)
                    motors[index] = _commands(each[index](*row), (4,), "return m1 to m4, 0 to 65535")
            sessions.step(np.where(over[:, None], 0, motors), [1] * n)
        if show is not None:
            show(int(n * min(float(seen["time_s"].max()) / sessions.duration_s, 1)), n)
    if show is not None:
        show(n, n)
    columns, outcomes, warned = sessions.outcomes()
    for text in warned:
        warn(text)
    return columns, outcomes


def _kept(
    folder: PathLike | None,
    makers: Sequence[Controller | None],
    key: object,
    fly: Callable[[], tuple[dict[str, Any], list[str]]],
) -> list[str]:
    """Returns outcomes of flights, from a folder if it has those of the same key and of classes from the same files."""
    classes = [it for it in makers if isinstance(it, type)]
    files = [getattr(sys.modules.get(it.__module__), "__file__", None) for it in classes]
    if folder is None or len(classes) < sum(it is not None for it in makers) or None in files:
        return fly()[1]
    names = [getattr(it, "__qualname__", None) for it in makers]
    sources = [Path(str(file)).read_bytes() for file in files]
    name = hashlib.sha256(repr((__version__, key, names, sources)).encode()).hexdigest()[:16]
    path = Path(folder, f"{name}.json")
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_suffix(".new")
        new.write_text(json.dumps(fly()[1]), "utf-8")
        new.replace(path)
    return json.loads(path.read_text("utf-8"))


@dataclass(frozen=True)
class _Part:
    """Flights of one word by one controller of Python: indices of their trials, and their seeds."""

    name: str
    scene: Scene
    trials: list[int]
    seeds: list[int]


def _parts(
    named: Sequence[tuple[str, Scene]],
    counted: Sequence[tuple[str, int]],
    scenes: Sequence[Scene],
    trials: Trials,
    controllers: Collection[str],
) -> Iterator[_Part]:
    """Yields the flights of a study, or of a rung of its ladder, by controllers of Python."""
    for index, (name, _) in enumerate(named):
        for at, (word, _) in enumerate(counted):
            chosen = [number for number, trial in enumerate(trials) if trial[:2] == (index, at)]
            if name in controllers and chosen:
                yield _Part(name, Scene(scenes[index], word=word), chosen, [trials[number][2] for number in chosen])


def _whole(place: str, value: SupportsIndex, least: int = 0, most: int = MOST_SEED) -> int:
    """Returns a whole number within limits, by default a seed."""
    number = operator.index(value)
    if not least <= number <= most:
        raise InputError(place, str(number), f"{least} to {most}", "type another number")
    return number


def _words(scene: Scene, words: Words | None, seeds: SupportsIndex) -> list[tuple[str, int]]:
    """Returns words with their numbers of seeds."""
    named = [scene.word] if words is None else [words] if isinstance(words, str) else words
    counted = named.items() if isinstance(named, Mapping) else [(word, seeds) for word in named]
    return [(word, _whole(f"seeds of {word}", n, 1, MOST_FLIGHTS)) for word, n in counted]


def fly_many(
    scenes: Scene | Sequence[Scene],
    seeds: int | Sequence[int] = 1,
    *,
    gains: ArrayLike | None = None,
    controller: Controller | None = None,
    estimator: Controller | None = None,
    vectorized: bool = False,
    conditions: str = "still",
    progress: Progress = True,
) -> Outcomes:
    """Flies scenes with seeds on all cores, photographs and reads each flight.

    Parameters
    ----------
    scenes : Scene or sequence of N Scene
        The scenes to fly.
    seeds : int or sequence of S int
        Seeds of the noise and of the conditions. A number S stands for the seeds from 0 to S − 1.
    gains : array_like (N, 4, 12) or (N, 4, 16), optional
        Gains K of linear controllers, u = u_hover − K (x − x_ref), to fly in a single scene, or (N, 4, 15) with
        integrals of the position. The rows are the torques about x, y, z (N m) and the thrust (N). The columns are
        position (m, world), yaw, pitch, roll (rad), velocity (m/s) and angular velocity (rad/s) in the body frame. Four
        further columns, as in `Scene.gain`, feed back the modeled rotors.
    controller : callable or type, optional
        Your own controller for one drone, as for `fly`: ``controller(state, reference)``, or ``controller(state,
        reference, time_s)``. All flights advance in step, so pass a controller with internal state as its class. An
        object is then created for each flight, with the scene if the constructor has a parameter `scene`.
    estimator : callable, optional
        Your own estimator for one drone, as for `fly`, which is created for each flight.
    vectorized : bool
        True if the controller processes all flights at once, as arrays (N, 12), (N, 9) and (N,), and returns (N, 4).
        This is as fast as the simulator itself. The rows of flights that have ended are 0.
    conditions : {"still", "room", "drone"} or path
        What varies from seed to seed: only the noise, or also drafts, battery and light of a room, or the drone as
        well, or the conditions in a TOML file.
    progress : bool or callable
        True to show a progress bar (by tqdm if it is installed, else as text), or a function that is called with the
        numbers of finished and of all flights.

    Returns
    -------
    Outcomes
        Arrays (N, S).
    """
    scenes = [scenes] if isinstance(scenes, Scene) else list(scenes)
    if gains is not None:
        (scene,) = scenes
        kind = "lqr-integral" if np.shape(gains)[-1] in (15, 19) else "lqr"
        settings = ({"controller.kind": kind, "controller.lqr.k": np.asarray(k).tolist()} for k in np.asarray(gains))
        scenes = [Scene(scene, set=setting) for setting in settings]
    given: Any = seeds
    try:
        seeds = list(range(operator.index(given)))
    except TypeError:
        seeds = [_whole("seeds", seed) for seed in given]
    with _bar(progress, "flying") as show:
        if controller is None and estimator is None:
            return Outcomes(**_outcomes(scenes, seeds, conditions, show))
        rows: list[dict[str, Any]] = []
        total = len(scenes) * len(seeds)
        for done, scene in enumerate(scenes):

            def tick(flown: int, n: int, before: int = done * len(seeds)) -> None:
                if show is not None:
                    show(before + flown, total)

            rows.append(_fly_controlled(scene, seeds, controller, estimator, conditions, vectorized, tick)[0])
        columns = {name: [row[name] for row in rows] for name in rows[0]}
        read = [letters for row in columns.pop("read") for letters in row]
        return Outcomes(**{name: np.concatenate(all_rows) for name, all_rows in columns.items()}, read=read)


def rank(
    scenes: Mapping[str, Scene | tuple[Scene, Controller | None] | tuple[Scene, Controller | None, Controller]],
    words: Words | None = None,
    *,
    seeds: int = 50,
    conditions: str = "room",
    seed: int = 0,
    acuity: int | None = None,
    folder: PathLike | None = None,
    vectorized: bool = False,
    progress: Progress = True,
) -> Report:
    """Ranks controllers by how legibly they write, on the same seeds, with 95 % intervals.

    Parameters
    ----------
    scenes : dict of str to Scene or tuple
        The contenders by name. ``(scene, controller)`` flies your own controller, as in `fly_many`, and ``(scene,
        controller, estimator)`` also your own estimator. A controller of None stands for the scene's.
    vectorized : bool
        As for `fly_many`, for all controllers.
    words : sequence of str, or dict of str to int, optional
        Words, optionally with their numbers of seeds. The first scene's word by default.
    seeds : int
        Number of seeds of each word.
    conditions : str
        As for `fly_many`.
    seed : int
        Seed from which the seeds of all flights are derived.
    acuity : int, optional
        Number of further seeds of each word at each of seven cap heights with a narrow lamp, with which the smallest
        legible letters are found. ``report["acuity"]["limits"]`` contains the result. Acuity also distinguishes
        controllers with a P(read) above 0.96.
    folder : path, optional
        Folder that stores the flights, so that the next call simulates only new ones. Flights of your own class are
        stored word by word, as long as the file that defines the class is unchanged. Flights of other callables are not
        stored.
    progress : bool or callable
        As for `fly_many`.

    Returns
    -------
    Report
        Report with the keys of ``noctograph rank --json``, and ``report["flights"]``. ``report.files`` contains the
        tables as CSV.
    """
    if not isinstance(scenes, Mapping):  # pyright: ignore[reportUnnecessaryIsInstance]
        hint = 'a dict names them: rank({"mine": scene, "theirs": other})'
        raise InputError("scenes", type(scenes).__name__, "contenders by name", hint)
    seed = _whole("seed", seed)
    acuity = None if acuity is None else _whole("acuity", acuity, 1, MOST_FLIGHTS)
    with _bar(progress, "ranking") as show:
        controllers = {name: (it[1], it[2] if len(it) == 3 else None) for name, it in scenes.items() if not isinstance(it, Scene)}
        named = [(name, it if isinstance(it, Scene) else it[0]) for name, it in scenes.items()]
        counted = _words(named[0][1], words, seeds) if named else []

        def flown_by_python(scenes: Sequence[Scene], trials: Trials) -> dict[int, str]:
            flown: dict[int, str] = {}
            for part in _parts(named, counted, scenes, trials, controllers):
                fly = partial(_fly_controlled, part.scene, part.seeds, *controllers[part.name], conditions, vectorized, None)
                key = (part.scene.to_toml(), part.seeds, conditions, vectorized)
                flown.update(zip(part.trials, _kept(folder, controllers[part.name], key, fly), strict=True))
            return flown

        trials = _trials(named, counted, seed) if controllers else []
        flown = flown_by_python([scene for _, scene in named], trials)
        smaller = None
        if acuity is not None:
            smaller = (acuity, [flown_by_python(*rung) for rung in _ladder(named, counted, seed, acuity)])
        return _ranked(named, counted, conditions, seed, folder, flown, {}, show, smaller)


def _ranked(*arguments: Any) -> Report:
    """Returns the report of a ranking, with its tables as files."""
    text, keys = _ranking(*arguments)
    files = {f"{name}.csv": table.encode() for name, table in keys.pop("csv").items()}
    return Report(text, keys, files)


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
    callback: Callable[[int, Candidate], bool | None] | None = None,
) -> tuple[Scene, Report]:
    """Searches the settings with which a scene writes most legibly.

    A candidate's flight may be as long as the scene's. Shorter flights are preferred only if their P(read) is equal.

    Parameters
    ----------
    scene : Scene
        Scene from which the search starts.
    words, seeds
        As for `rank`, with the number of seeds of a candidate.
    knobs : sequence of str, optional
        Keys to tune with their bounds, such as ``"plan.stroke_speed_m_s=0.2..0.8"``. By default, the usual keys of the
        controller.
    budget : int
        Total number of flights.
    conditions, seed, folder
        As for `rank`.
    callback : callable, optional
        Function that is called with the number of flights so far and the best candidate, a dict. The search ends if
        the function returns False. An exception of the function is passed on.

    Returns
    -------
    Scene
        The tuned scene if it is distinguishably better on new seeds (``report["helped"]``), otherwise the scene from
        which the search started.
    Report
        Report with the keys of ``noctograph tune --json`` and all candidates.
    """
    counted, seed, budget = _words(scene, words, seeds), _whole("seed", seed), _whole("budget", budget, 1)
    text, keys, tuned = _tuning(scene, counted, knobs, budget, conditions, seed, folder, callback)
    return tuned, Report(text, keys)
