"""Commands of the program as functions that return their tables, figures and files."""

from __future__ import annotations

import html
import importlib
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, cast

import numpy as np

from ._noctograph import Flight, Plan, Scene, Shot, command as _command, import_log, setting as _setting
from .errors import InfeasibleError, InputError, warn

PathLike = str | os.PathLike[str]


class Report(dict[str, Any]):
    """Result of a command: the keys that it prints with ``--json``. A notebook shows its table.

    Attributes
    ----------
    text : str
        The table that the command prints.
    files : dict of str to bytes
        The files that the command wrote, by name. Empty if they were written to a folder that you named.
    """

    def __init__(self, text: str, keys: dict[str, Any], files: dict[str, bytes] | None = None) -> None:
        super().__init__(keys)
        self.text = text
        self.files = files or {}

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.text)}</pre>"

    def __reduce__(self) -> tuple[Any, ...]:
        return Report, (self.text, dict(self), self.files)


def command(verb: str, *inputs: Any, **options: Any) -> Report:
    """Runs a command of the program. ``noctograph VERB --help`` lists its options.

    Parameters
    ----------
    verb : str
        Name of the command, such as ``"coverage"``.
    *inputs : str, path, Scene, Flight, Plan or Shot
        Inputs of the command. Objects are passed as files.
    **options
        Options of the command, such as ``max_gap=0.5`` for ``--max-gap=0.5``. Pass ``True`` for a flag without a value,
        a list for a flag that is repeated, a dict for ``set``, and objects as for `inputs`.

    Returns
    -------
    Report
    """
    with tempfile.TemporaryDirectory(prefix="noctograph-") as folder:
        words = _words(folder, verb, *inputs, **options)
        try:
            text, keys = _command(words)
        except InputError as error:
            # The caller does not know the paths of temporary files.
            parts = (error.place, error.found, error.wanted, error.hint)
            raise InputError(*(part.replace(folder + os.sep, "") for part in parts)) from None
        keys = keys or {}
        if isinstance(keys.get("warnings"), list):
            # Warnings about the file of an object are omitted, because the object already contains
            # them.
            kept = [str(text) for text in keys["warnings"] if not str(text).startswith(folder + os.sep)]
            keys["warnings"] = [text.replace(folder + os.sep, "") for text in kept]
            for text_of_warning in keys["warnings"]:
                warn(text_of_warning)
        return Report(text.replace(folder + os.sep, ""), keys)


def _words(folder: str, verb: str, *inputs: Any, **options: Any) -> list[str]:
    """Returns the command line of a command. Objects are written to files in `folder`."""
    count = 0

    def word(value: Any) -> str:
        nonlocal count
        if not isinstance(value, (Flight, Plan, Scene, Shot)):
            return str(value)
        count += 1
        suffix = "toml" if isinstance(value, Scene) else "png" if isinstance(value, Shot) else "csv"
        path = os.path.join(folder, f"{type(value).__name__.lower()}-{count}.{suffix}")
        value.save(path)
        return path

    words = [verb, *(word(value) for value in inputs)]
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if name == "set":
            words += [f"--set={key}={_setting(item)}" for key, item in value.items()]
        elif value is True:
            words.append(flag)
        elif value is not None and value is not False:
            items = cast("list[Any]", value) if isinstance(value, (list, tuple)) else [value]
            words += [f"{flag}={word(item)}" for item in items]
    return words


def follow(log: PathLike, *, output: PathLike | None = None, **options: Any) -> Report:
    """Shows the photograph of a flight in a notebook while it is flown, and prints how it reads so far.

    Parameters
    ----------
    log : path
        Log that an exported script writes during the flight, ``NAME_flight.jsonl``. It may not exist yet.
    output : path, optional
        Photo to write. Without it, ``report.files`` contains the final photo.
    **options
        Options of ``noctograph expose``, such as ``plan="NIGHT.csv"``.

    Returns
    -------
    Report
        Report of ``noctograph expose``, returned when the flight has ended. Interrupt the cell to stop earlier.
    """
    with tempfile.TemporaryDirectory(prefix="noctograph-") as folder:
        photo = Path(output) if output is not None else Path(folder, "photo.png")
        words = _words(folder, "expose", log, follow=True, output=photo, json=True, **options)
        program = [sys.executable, "-m", "noctograph", *words]
        with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
            told: list[str] = []
            reader = threading.Thread(target=_tell, args=(run.stderr, told))
            reader.start()
            try:
                _show_until(lambda: run.poll() is not None, photo)
            except BaseException:
                run.terminate()
                raise
            finally:
                reader.join()
            text = run.stdout.read() if run.stdout else ""
        if run.returncode != 0:
            raise InputError(os.fspath(log), "".join(told).strip(), "a log that can be followed", "see above")
        files = {} if output is not None else {photo.name: photo.read_bytes()}
        keys = json.loads(text)
        read = f"{keys['word']} reads as {keys['read']}\n" if "read" in keys else ""
        return Report(f"{read}files     {photo.name if output is None else photo}\n", keys, files)


def _tell(lines: Iterable[str] | None, told: list[str]) -> None:
    """Prints lines to standard output as they arrive, and appends them to `told`."""
    for line in lines or ():
        told.append(line)
        print(line, end="", flush=True)


def _show_until(has_ended: Callable[[], bool], photo: Path) -> None:
    """Shows a photo in a notebook whenever its file has been rewritten, until `has_ended` returns true."""
    notebook, last, ends = _notebook(), b"", False
    shown: Any = None
    while not ends:
        ends = has_ended()
        content = photo.read_bytes() if notebook and photo.exists() else b""
        if content != last:
            picture, last = notebook.Image(data=content), content
            if shown:
                shown.update(picture)
            else:
                shown = notebook.display(picture, display_id=True)
        time.sleep(0.0 if ends else 0.1)


def _notebook() -> Any:
    """Returns the module IPython.display in a notebook, otherwise None."""
    try:
        ipython: Any = importlib.import_module("IPython")
        return importlib.import_module("IPython.display") if ipython.get_ipython() else None
    except ImportError:
        return None


def _with_files(verb: str, *inputs: Any, output: PathLike | None, name: str = "", **options: Any) -> Report:
    """Runs a command that writes files, or one file called `name`. Without `output` the report contains the files."""
    if output is not None or options.get("region"):
        return command(verb, *inputs, output=output, **options)
    with tempfile.TemporaryDirectory(prefix="noctograph-") as folder:
        report = command(verb, *inputs, output=os.path.join(folder, name), **options)
        report.files = {path.name: path.read_bytes() for path in Path(folder).rglob("*") if path.is_file()}
        report.text = report.text.replace(folder + os.sep, "")
        if "files" in report:
            report["files"] = list(report.files)
        return report


def check(scene: Scene | str, *plans: Plan, **options: Any) -> Report:
    """Checks everything that could go wrong with a flight: limits of the drone, battery, room and obstacles.

    Parameters
    ----------
    scene : Scene or str
        The scene.
    *plans : Plan
        Plans that fly together. The scene's word by default.
    **options
        Options of ``noctograph check``, such as ``profile="careful"``.

    Returns
    -------
    Report
        Report with ``report["fly"]``, and with ``report["findings"]`` and their advice.
    """
    return command("check", *plans, scene=scene, **options)


def export(scene: Scene | str, to: str, *plans: Plan, output: PathLike | None = None, **options: Any) -> Report:
    """Exports files for drones or other programs.

    Parameters
    ----------
    scene : Scene or str
        The scene.
    to : str
        Format, such as ``"poly4d"`` or ``"crazyswarm2"``. The error for a wrong name lists all formats.
    *plans : Plan
        Plans that fly together. The scene's word by default.
    output : path, optional
        File or folder to write to. Without it, ``report.files`` contains the bytes.
    **options
        Options of ``noctograph export``, such as ``tolerance=2`` (mm).

    Returns
    -------
    Report

    Raises
    ------
    InfeasibleError
        If `check` stops the flight, because it would not be safe. Nothing is written.
    """
    report = _with_files("export", *plans, scene=scene, to=to, output=output, **options)
    if not report.get("files"):
        raise InfeasibleError(report.text.strip(), "nothing is exported: nc.check has each finding with its advice")
    return report


def identify(log: PathLike | Flight, **options: Any) -> Report:
    """Identifies mass, inertia, delays and noise of a drone from the log of a flight.

    Parameters
    ----------
    log : path or Flight
        The log.
    **options
        Options of ``noctograph identify``, such as ``scene``.

    Returns
    -------
    Report
    """
    return command("identify", log, **options)


def compare(
    a: PathLike | Flight,
    b: PathLike | Flight,
    *,
    design: Plan | None = None,
    output: PathLike | None = None,
    **options: Any,
) -> Report:
    """Compares two flights: errors along each axis, after their clocks and frames are aligned.

    Parameters
    ----------
    a, b : path or Flight
        Logs or flights, such as a measured and a simulated flight.
    design : Plan, optional
        Plan that both flights followed from their first times on, for flights that do not contain a design. Without a
        design a flight has no tracking error, and the clocks are aligned by the flown paths.
    output : path, optional
        Folder for the plots. Without it, ``report.files`` contains them as SVG.
    **options
        Options of ``noctograph compare``, such as ``part="letters"``.

    Returns
    -------
    Report
    """
    flights = [it if design is None else _designed(it, design) for it in (a, b)]
    lack = any(isinstance(it, Flight) and np.isnan(it.design_m).any() for it in flights)
    if lack and not options.keys() & {"align", "offset"}:
        options["align"] = "flown"  # the clocks cannot be aligned by a design
    return _with_files("compare", *flights, output=output, **options)


def _designed(flight: PathLike | Flight, plan: Plan) -> Flight:
    """Returns a flight or log with the design of a plan instead of its own."""
    flight = flight if isinstance(flight, Flight) else import_log(flight)
    return flight.with_design(plan)


def locate(*ranges: PathLike, output: PathLike | None = None, **options: Any) -> Report:
    """Estimates positions of drones from ranges between them and three or more anchors.

    Parameters
    ----------
    *ranges : path
        CSV files of ranges, one for each drone. `noctograph locate --help` describes the columns.
    output : path, optional
        Folder for the positions and plots. Without it, ``report.files`` contains them.
    **options
        Options of ``noctograph locate``, such as ``anchors="anchors.yaml"``. For the map of the shared-anchor observer,
        pass ``region=True`` and a `scene`, without ranges.

    Returns
    -------
    Report
    """
    return _with_files("locate", *ranges, output=output, **options)


def coverage(scene: Scene | str, *, output: PathLike | None = None, **options: Any) -> Report:
    """Computes how well the base stations or anchors of a scene can locate its drones, as a table and a map.

    Parameters
    ----------
    scene : Scene or str
        The scene.
    output : path, optional
        SVG file for the map. Without it, ``report.files["coverage.svg"]`` contains the bytes.
    **options
        Options of ``noctograph coverage``, such as ``step=0.1`` (m).

    Returns
    -------
    Report
        Report with ``report["bound_m"]``, the smallest error that ranges allow (1 σ over three axes, in m), and with
        the bound of each letter.
    """
    return _with_files("coverage", scene=scene, output=output, name="coverage.svg", **options)


def gains(scene: Scene | str, **options: Any) -> Report:
    """Computes gains and stability margins of a scene's controller.

    Parameters
    ----------
    scene : Scene or str
        The scene.
    **options
        Options of ``noctograph gains``: ``motor_lag`` (s) and ``bryson``.

    Returns
    -------
    Report
        ``report["A"]`` (12, 12) and ``["B"]`` (12, 4) describe the drone at hover, with ẋ = A x + B u for small
        deviations.
        ``["K"]`` of the regulator and ``["L"]`` of the observer are lists of rows. ``["states"]`` and ``["inputs"]``
        name the columns and rows. A, the poles and the margins include the drag of the air, whereas K and L are
        designed without it. The report also contains the poles, the margins and ``["bryson_r"]``.
    """
    return command("gains", scene=scene, **options)


def hold(scenario: str = "all", *, runs: int = 80, output: PathLike | None = None, **options: Any) -> Report:
    """Simulates altitude hold with three imperfect sensors. Reports errors of the estimate, and whether its σ is
    right.

    Parameters
    ----------
    scenario : str
        Name of a scenario, several separated by commas, or ``"all"``.
    runs : int
        Number of flights of each scenario.
    output : path, optional
        Folder for the plots and tables. Without it, ``report.files`` contains them.
    **options
        Options of ``noctograph hold``, such as ``model`` and ``seed``.

    Returns
    -------
    Report
    """
    return _with_files("hold", scenario=scenario, runs=runs, output=output, **options)


def meter(scene: Scene | str, *plans: Plan, **options: Any) -> Report:
    """Computes each lamp's stops over saturation, and the exposure to set.

    Parameters
    ----------
    scene : Scene or str
        The scene.
    *plans : Plan
        Plans that fly together. The scene's word by default.
    **options
        Options of ``noctograph meter``.

    Returns
    -------
    Report
    """
    return command("meter", *plans, scene=scene, **options)
