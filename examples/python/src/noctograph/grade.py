"""Grades a class: scenes and Python controllers for one task. A fault affects only its owner.

A submission is a scene or a few of its keys (TOML), whose controller keys may differ from the task's, or a
controller in Python, as for ``nc.fly``. The simulation runs in this process. Each controller runs in a separate
process, which receives the estimates and returns motor commands, see `isolated`.

``python -m noctograph.grade TASK SUBMISSIONS -o marks``
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import os
import secrets
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._noctograph import Scene, Sessions, ladder as _ladder, least_flights, submission as _submission, trials as _trials
from .commands import PathLike, Report, command
from .errors import InfeasibleError, InputError
from .studies import MOST_FLIGHTS, Words, _bar, _Part, _parts, _ranked, _whole, _words  # pyright: ignore[reportPrivateUsage]

#: Number of seeds for a word without one, as in ``noctograph rank --task``.
SEEDS = 100
#: Number of cap heights on the ladder of ``acuity``.
LADDER = 7
#: Seeds below this limit can be found by trial, as in ``noctograph rank``.
PUBLIC_SEEDS = 1 << 32
#: Paths that Python itself needs, and that every controller may read.
SYSTEM = ("/usr", "/lib", "/lib64", "/nix", "/etc/alternatives", "/etc/ld.so.cache", "/dev/null", "/dev/urandom")
#: Time within which a guard has to end the processes of its submission, s. A slower guard is killed, and the kernel
#: ends the processes.
GUARD_S = 10.0
#: Time between checks for a stop and for further processes of a submission, s.
STOPS_S = 0.1
#: Maximum CPU time of a submission's other threads during a flight, s. Idle threads of a package sleep within 1 ms.
WORKS_S = 0.02
#: Maximum size of a controller's source, bytes.
MOST_BYTES = 1 << 20


@dataclass(frozen=True)
class Limits:
    """Limits of a controller in Python for a word, whose flights advance in step.

    Attributes
    ----------
    step_s : float
        Wall time of one step of all flights, s.
    load_s : float
        Wall time of loading, s.
    total_s : int
        Wall time of all steps, and CPU time of the process, s.
    memory_mb : int
        Address space of the process, MB.
    """

    step_s: float = 5.0
    load_s: float = 60.0
    total_s: int = 900
    memory_mb: int = 4096


def _no_window() -> dict[str, str]:
    """Returns the variables with which packages of MuJoCo are imported without a display.

    Without the name of its library, pyGLFW would start a process to ask for the library's version.
    """
    spec = importlib.util.find_spec("glfw")
    libraries = sorted(Path(spec.origin).parent.rglob("libglfw*")) if spec and spec.origin else []
    return {"MUJOCO_GL": "disable", **{"PYGLFW_LIBRARY": str(it) for it in libraries[-1:]}}


class Failed(Exception):
    """Reason why a submission is not ranked."""


def _line(answer: bytes) -> str:
    """Returns the first 200 characters of a process's output for a table, with a space for each unprintable one."""
    text = answer.decode("utf-8", "replace")
    return "".join(sign if sign.isprintable() else " " for sign in text[:200])


class _Process:
    """A submission in a separate process, which starts with this object and ends with `end`."""

    def __init__(self, source: bytes, scene: Scene, n: int, limits: Limits, shown: Sequence[str], running: _Running) -> None:
        self.limits, self.waited_s, self.looks_s, self.flights, self.running = limits, 0.0, 0.0, 0, running
        self.worked_s: float | None = None
        self.wire, theirs = socket.socketpair()
        self.folder = tempfile.TemporaryDirectory(prefix="noctograph-grade-")
        own = os.path.realpath(self.folder.name)
        path = os.pathsep.join(folder for folder in sys.path if folder)
        threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        kept = {name: os.environ[name] for name in ("PATH", "LD_LIBRARY_PATH") if name in os.environ}
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-c", "from noctograph.isolated import main; main()", str(theirs.fileno()),
                 json.dumps({**asdict(limits), "shown": shown})],
                cwd=own, pass_fds=[theirs.fileno()], start_new_session=True, stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                env={"PYTHONPATH": path, **dict.fromkeys(("TMPDIR", "HOME", "MPLCONFIGDIR"), own), "PYTHONHASHSEED": "0", "PYTHONDONTWRITEBYTECODE": "1", **_no_window(), **threads, **kept},
            )  # fmt: skip
        running.add(self)
        try:
            for message in (source, struct.pack("<I", n), scene.to_toml().encode()):
                self._send(message)
            answer = self._receive("n", 0, limits.load_s)
            self.controls, self.estimates, self.left = answer[:1] == b"1", answer[1:2] == b"1", _line(answer[2:])
            self._receive("r", 0, limits.total_s)  # the submission is imported for each of the flights
        except BaseException:
            self.end()
            raise

    def control(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns motor commands (N, 4) for the N flights that are not over, from their rows (`isolated.COLUMNS`)."""
        return self._ask("m", rows.tobytes(), 4 * len(rows)).reshape(-1, 4)

    def estimator(self, start: NDArray[np.float64]) -> Callable[[dict[str, Any], float], NDArray[np.float64]]:
        """Creates the submission's estimator of the next flight. Returns a function that calls it, as `fly` does."""
        flight, self.flights = self.flights, self.flights + 1
        self._ask("e", json.dumps({"start": start.tolist()}).encode(), 0)

        def update(readings: dict[str, Any], tick_s: float) -> NDArray[np.float64]:
            asked = {"flight": flight, "readings": readings, "tick_s": tick_s}
            return self._ask("e", json.dumps(asked, default=np.ndarray.tolist).encode(), 12)

        return update

    def _ask(self, kind: str, message: bytes, n: int) -> NDArray[np.float64]:
        """Sends a message and returns the n finite numbers of its answer. Fails if all answers have taken `total_s`."""
        begun = time.monotonic()
        if begun > self.looks_s:
            self._is_alone()
            self.looks_s = begun + STOPS_S
        self._send(kind.encode() + message)
        answer = self._receive(kind, 8 * n, self.limits.step_s)
        self.waited_s += time.monotonic() - begun
        if self.waited_s > self.limits.total_s:
            raise Failed(f"more than {self.limits.total_s} s in all")
        numbers = np.frombuffer(answer) if len(answer) == 8 * n else np.array([np.nan])
        if not np.isfinite(numbers).all():
            raise Failed("its answer is broken")
        return numbers

    def _is_alone(self) -> None:
        """Fails if the submission has further processes (see `isolated.descend`), or if its further threads work.

        Threads that only wait are allowed, because packages such as NumPy start them.
        """

        def children(pid: int) -> list[int]:
            with open(f"/proc/{pid}/task/{pid}/children") as file:
                return [int(it) for it in file.read().split()]

        with contextlib.suppress(OSError, IndexError):  # the process has ended, or the system does not list children
            first = children(self.process.pid)
            found = children(first[0])
            if others := len(first) + len(found) + len(children(found[0])) - 2:
                raise Failed(f"it flies with {others} processes beside its own")
            threads = Path(f"/proc/{found[0]}/task").glob("[0-9]*/schedstat")
            worked_s = sum(1e-9 * int(it.read_text().split()[0]) for it in threads if it.parent.name != str(found[0]))
            if self.worked_s is None:
                self.worked_s = worked_s
            if worked_s > self.worked_s + WORKS_S:
                raise Failed("it flies with a thread that works beside its own")

    def _send(self, message: bytes) -> None:
        self.wire.settimeout(self.limits.load_s)
        try:
            self.wire.sendall(struct.pack("<I", len(message)) + message)
        except TimeoutError:
            raise Failed("it does not listen") from None
        except OSError:
            pass  # the process has ended, and its last output is read next

    def _receive(self, kind: str, most: int, within_s: float) -> bytes:
        """Returns the next answer of a kind, of at most `most` bytes. Fails with the reason why there is none.

        An answer is its length, its kind and its bytes. The kind `f` contains the reason for a failure.
        """
        until, parts, length = time.monotonic() + within_s, bytearray(), 4
        while len(parts) < length:
            try:
                self.wire.settimeout(STOPS_S)
                part = self.wire.recv(length - len(parts))
            except TimeoutError:
                if self.running.stopped.is_set():
                    raise Failed("stopped") from None
                if time.monotonic() > until:
                    raise Failed(f"no answer within {within_s:g} s") from None
                continue
            except OSError:
                part = b""
            if not part:
                raise Failed(f"its process ended: {self._status()}")
            parts += part
            if len(parts) == length == 4:
                length = 4 + struct.unpack("<I", parts)[0]
                if not 5 <= length <= 5 + max(most, 1000):
                    raise Failed("its answer is broken")
        answer = bytes(parts[5:])
        if parts[4] == ord("f"):
            raise Failed(_line(answer))
        if parts[4] != ord(kind):
            raise Failed("its answer is broken")
        return answer

    def _status(self) -> str:
        """Returns how the process ended."""
        try:
            code = self.process.wait(1)
        except subprocess.TimeoutExpired:
            return "it closed its pipe"
        number = -code if code < 0 else code - 128
        names = {it.value: it.name for it in signal.Signals}
        return f"killed by {names[number]} (memory or CPU time)" if number in names else f"exit code {code}"

    def end(self) -> None:
        """Ends the process and all that it started, and deletes its folder.

        The guard ends them when the pipe is closed (see `isolated.guard`). After `GUARD_S` the guard itself is killed.
        """
        self.wire.close()
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(GUARD_S)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self.folder.cleanup()
        self.running.discard(self)


class _Running(set[_Process]):
    """Processes that have not ended. They all fail after the event `stopped` is set."""

    def __init__(self) -> None:
        super().__init__()
        self.stopped = threading.Event()


@contextlib.contextmanager
def _workers(n: int | None) -> Generator[tuple[ThreadPoolExecutor, _Running]]:
    """Provides n threads that fly controllers, by default one for each core, and the set of their processes.

    An exception, such as an interrupt by Ctrl-C, ends all processes without waiting for their flights.
    """
    pool, running = ThreadPoolExecutor(n or os.cpu_count()), _Running()
    try:
        yield pool, running
    except BaseException:
        running.stopped.set()
        pool.shutdown(wait=False, cancel_futures=True)
        while running:
            time.sleep(0.02)
        raise
    pool.shutdown()


def _fly(
    scene: Scene, seeds: list[int], source: bytes, conditions: str, limits: Limits, shown: Sequence[str], running: _Running
) -> tuple[list[str], list[str], str]:
    """Flies a submission with each seed. Returns the outcomes as JSON, the warnings about its flights, and what of the
    system could not be blocked."""
    process, motors = _Process(source, scene, len(seeds), limits, shown, running), np.zeros((len(seeds), 4))
    try:
        estimator = process.estimator if process.estimates else None
        sessions = Sessions(scene, len(seeds), conditions, estimator, not process.controls)
        sessions.reset(list(seeds))
        seen = sessions.observations()
        while not (over := seen["landed"] | seen["lost"]).all():
            if not process.controls:
                # The scene's controller flies with the estimator, 0.1 s at a time.
                sessions.step(None, [sessions.command_hz // 10] * len(seeds))
                seen = sessions.observations()
                continue
            flying = np.flatnonzero(~over)
            rows = [flying.astype(float), seen["state"][flying], seen["reference"][flying], seen["time_s"][flying]]
            motors[over] = 0
            motors[flying] = process.control(np.column_stack(rows))
            sessions.step(motors, [1] * len(seeds))
            seen = sessions.observations()
    finally:
        process.end()
    _, outcomes, doubtful = sessions.outcomes()
    return outcomes, doubtful, process.left


def _shown(hidden: Sequence[str]) -> list[str]:
    """Returns the paths that a controller may read: those of Python and its packages, except for paths within `hidden`.

    A path within another one is left out.
    """
    private = [Path(it).resolve() for it in hidden]
    packages = [it for it in sys.path if not any(path.is_relative_to(Path(it).resolve()) for path in private)]
    paths = [*SYSTEM, sys.base_prefix, sys.prefix, *os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep), *packages]
    found: list[str] = []
    for path in sorted(os.path.abspath(it) for it in paths if os.path.exists(it)):
        if not any(Path(path).is_relative_to(it) for it in found):
            found.append(path)
    return found


def _submissions(given: PathLike | Sequence[PathLike]) -> dict[str, Path]:
    """Returns the submitted files by the names of their rows in the table.

    A row has the name of the file without its ending, preceded by the name of the student's folder. If that name is not
    unique, the row has the whole path. Hidden files are left out with a warning.
    """
    files: list[tuple[str, Path]] = []
    for path in [Path(it) for it in ([given] if isinstance(given, (str, os.PathLike)) else given)]:
        files += _handed(path, "") if path.is_dir() else [(path.stem, path)]
    same = Counter(name for name, _ in files)
    return {name if same[name] == 1 else str(file): file for name, file in files}


def _handed(folder: Path, student: str) -> list[tuple[str, Path]]:
    """Returns the files in a folder and in its students' folders, with names. Prints a warning about hidden files."""
    entries = sorted(folder.iterdir())
    hidden = [it.name for it in entries if it.name.startswith((".", "_"))]
    if hidden:
        print(f"warning: {folder}: hidden files are not read: {', '.join(hidden)}", file=sys.stderr)
    files: list[tuple[str, Path]] = []
    for it in entries:
        if it.name in hidden:
            continue
        if it.is_dir() and not student:
            files += _handed(it, f"{it.name}/") or [(it.name, it)]
        else:
            files.append((student + it.stem, it))
    return files


def _warnings(task: Scene, handed: dict[str, bytes], seed: int) -> list[str]:
    """Returns warnings that matter when marks are compared: a guessable seed, unequal references, and equal files."""
    found: list[str] = []
    sources = [name for name, source in handed.items() if source]
    if sources and seed < PUBLIC_SEEDS:
        found.append(f"seed {seed} can be found by trial, in flight: for marks of a class leave it out, or take 2^32 or more")
    # A controller in Python receives the design at each tick, and lights by the plan's clock.
    tick_s = 1 / task.get("rates.control_hz")
    alike = {"plan.reference": "design", "plan.light_clock": "setpoint", "plan.setpoint_interval_s": tick_s}
    differ = [f"{key} = {json.dumps(value)}" for key, value in alike.items() if task.get(key) != value]
    if 0 < len(sources) < len(handed) and differ:
        found.append(
            "scenes are sent a plan at intervals that leads their lag, with lights timed by a rehearsal; controllers in Python "
            f"are not: both receive the same with {', '.join(differ)} in the task"
        )
    for name, source in handed.items():
        same = [other for other in sources if handed[other] == source]
        if source and name == same[0] and len(same) > 1:
            found.append(f"the same file: {', '.join(same)}")
    return found


def grade(
    task: Scene | str,
    submissions: PathLike | Sequence[PathLike],
    *,
    may: Sequence[str] = (),
    words: Words | None = None,
    seeds: int = SEEDS,
    conditions: str = "room",
    seed: int | None = None,
    acuity: int | None = None,
    workers: int | None = None,
    limits: Limits | None = None,
    progress: Any = True,
) -> Report:
    """Ranks the submissions of a class and marks them. A mark is 100 times P(read).

    Parameters
    ----------
    task : Scene or str
        Scene that is flown. Its word by default.
    submissions : path or sequence of path
        Files (``.toml``, ``.py``), or folders with such files or with a folder for each student.
    may : sequence of str
        Keys that a scene may change, such as ``"controller.*"``. By default, these are the keys of the controller and
        the weights of the observers. Keys of files and of the true state are always refused.
    words, conditions
        As for `rank`.
    seeds : int
        Seeds of each word.
    seed : int, optional
        Seed from which the seeds of all flights are derived. By default, an unguessable seed is drawn, which
        ``report["seed"]`` contains. A controller could find a seed below 2**32 by trial during a flight.
    acuity : int, optional
        Number of further seeds of each word at each of seven cap heights, with which the smallest legible letters of
        each submission are found, as for `rank`. Marks do not change.
    workers : int, optional
        Number of controllers in Python that run at once, by default one for each core. It does not affect the marks.
    limits : Limits, optional
        Time and memory of a controller in Python.
    progress : bool or callable
        As for `rank`.

    Returns
    -------
    Report
        Report with the keys of `rank`. ``report["unranked"]`` contains the submissions that were refused or failed,
        with the reasons. ``report.files`` contains the tables, among them ``marks.csv``.
    """
    seed = PUBLIC_SEEDS + secrets.randbelow((1 << 64) - PUBLIC_SEEDS) if seed is None else _whole("seed", seed)
    acuity = None if acuity is None else _whole("acuity", acuity, 1, MOST_FLIGHTS)
    task, limits = task if isinstance(task, Scene) else Scene(task), limits or Limits()
    files = _submissions(submissions)
    unranked: dict[str, str] = {}
    scenes: dict[str, Scene] = {}
    sources: dict[str, bytes] = {}
    if not files:
        raise InputError("submissions", str(submissions), "at least one file", "name the folder that has them")
    for name, file in files.items():
        try:
            if file.is_symlink():
                raise Failed("a link, which is not followed")
            ending = file.suffix.lower() if file.is_file() else ""  # a folder or a pipe has no ending
            if ending == ".py" and os.name == "posix":
                if file.stat().st_size > MOST_BYTES:
                    raise Failed(f"more than {MOST_BYTES} bytes")
                sources[name] = file.read_bytes()
            elif ending != ".toml":
                raise Failed("wanted a scene (.toml) or a controller in Python (.py, on Linux and macOS)")
            scenes[name] = task if name in sources else _submission(task, may, file)
        except (InputError, InfeasibleError, Failed, OSError) as error:
            if isinstance(error, InputError) and error.place == "may":
                raise
            unranked[name] = f"refused: {error}"
    least = least_flights(len(scenes))
    counted = _words(task, words, seeds)
    trials = _trials([("task", task)], counted, seed)
    fly = "submission flies" if len(scenes) == 1 else "submissions fly"
    smaller = f" and {LADDER * acuity * len(counted)} times with smaller letters" if acuity else ""
    print(f"{len(scenes)} {fly} {len(trials)} times each{smaller}, seed {seed}; at least {least} tell two apart", file=sys.stderr)
    warned = _warnings(task, {name: sources.get(name, b"") for name in scenes}, seed)
    for warning in warned:
        print(f"warning: {warning}", file=sys.stderr)
    shown = _shown([os.getcwd(), *(str(file.parent) for file in files.values())])
    flown: dict[tuple[str, str], list[str]] = {}

    def studies() -> list[list[_Part]]:
        """Returns the flights of controllers in Python: those of the study, and those of each rung of its ladder."""
        named = list(scenes.items())
        ladder = [] if acuity is None or not named else _ladder(named, counted, seed, acuity)
        study = list(scenes.values()), _trials(named, counted, seed) if named else []
        return [list(_parts(named, counted, *flights, sources)) for flights in (study, *ladder)]

    def key(part: _Part) -> tuple[str, str]:
        return part.name, f"{part.seeds}{part.scene.to_toml()}"

    def of_word(part: _Part) -> tuple[list[str], list[str], str] | Failed:
        try:
            return _fly(part.scene, part.seeds, sources[part.name], conditions, limits, shown, running)
        except Failed as failed:
            return failed

    left: set[str] = set()
    doubts: dict[str, str] = {}
    with _workers(workers) as (pool, running):
        # A submission that fails in the study does not fly the ladder, which depends on the remaining scenes.
        parts = studies()[0]
        while parts:
            with _bar(progress, "controllers") as show:
                for done, (part, result) in enumerate(zip(parts, pool.map(of_word, parts), strict=True), 1):
                    if isinstance(result, Failed):
                        unranked.setdefault(part.name, f"failed: {result}")
                        scenes.pop(part.name, None)
                    else:
                        flown[key(part)] = result[0]
                        if result[1]:
                            doubts.setdefault(part.name, f"{part.name}: {'; '.join(result[1])}")
                        left |= {result[2]} - {""}
                    if show is not None:
                        show(done, len(parts))
            parts = [part for study in studies() for part in study if key(part) not in flown]
    warned += doubts.values()
    for warning in [*sorted(left), *doubts.values()]:
        print(f"warning: {warning}", file=sys.stderr)
    by_trial, *rungs = [
        {trial: outcome for part in study for trial, outcome in zip(part.trials, flown[key(part)], strict=True)}
        for study in studies()
    ]
    with _bar(progress, "ranking") as show:
        named = list(scenes.items())
        report = _ranked(named, counted, conditions, seed, None, by_trial, unranked, show, (acuity, rungs) if rungs else None)
    report["seed"] = seed
    report.text += "".join(f"\nwarning: {it}\n" for it in warned)
    return report


def _word(text: str) -> tuple[str, int]:
    """Returns a word of ``--words`` with its number of seeds, which is `SEEDS` if it is missing."""
    word, _, n = text.partition(":")
    if n and not n.isdecimal():
        raise InputError("--words", text, "a word with its number of seeds", "TEA:100")
    return word, int(n or SEEDS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Grades submissions, and writes the tables and a page.

    Returns the exit code: 1 if a submission was refused or failed, 2 for an error.
    """
    parser = argparse.ArgumentParser(prog="python -m noctograph.grade", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("task", metavar="TASK", help="scene: a file or a name, as for noctograph")
    parser.add_argument("submissions", metavar="SUBMISSION", nargs="+", help="folder, or files (.toml, .py)")
    parser.add_argument("-o", "--output", metavar="DIR", default="noctograph-grade", help="folder for marks.csv, tables and report.html")
    parser.add_argument("--may", metavar="KEY", action="append", default=[], help="a key that a scene may change; repeatable")
    parser.add_argument("--words", metavar="WORD[:N],...", help="words, with their numbers of seeds, or a file with one on each line [default: the task's]")
    parser.add_argument("--seed", metavar="N", type=int, help="seed that all seeds are drawn from [default: one that nobody can guess, which is printed]")
    parser.add_argument("--conditions", metavar="NAME|FILE", default="room", help="as of noctograph rank")
    parser.add_argument("--acuity", metavar="N", type=int, help="also find the smallest legible letters, with N more seeds of each word at each of seven cap heights, as of noctograph rank")
    parser.add_argument("--workers", metavar="N", type=int, help="controllers in Python that run at once")
    for name, most in asdict(Limits()).items():
        kind = int if isinstance(most, int) else float
        parser.add_argument(f"--{name.replace('_', '-')}", metavar="N", type=kind, default=most, help=f"limit of a controller in Python [default: {most}]")
    args = parser.parse_args(arguments)
    try:
        listed: list[str] = args.words.split(",") if args.words else []
        if args.words and Path(args.words).is_file():
            lines = map(str.strip, Path(args.words).read_text("utf-8").splitlines())
            listed = [line for line in lines if line and not line.startswith("#")]
        output = Path(args.output)
        output.mkdir(parents=True, exist_ok=True)
        given: Any = args.submissions if len(args.submissions) > 1 else args.submissions[0]
        limits = Limits(**{name: getattr(args, name) for name in asdict(Limits())})
        words = dict(map(_word, listed)) or None
        report = grade(
            args.task, given, may=args.may, words=words, conditions=args.conditions, seed=args.seed,
            acuity=args.acuity, workers=args.workers, limits=limits,
        )  # fmt: skip
        files = {**report.files, "ranking.json": (json.dumps(dict(report), indent=2) + "\n").encode()}
        for name, table in files.items():
            (output / name).write_bytes(table)
        command("report", output, output=output / "report.html")
    except (ValueError, InfeasibleError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{report.text}\nfiles     {output / 'marks.csv'}\n          {output / 'report.html'}")
    return 1 if report["unranked"] else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        print("error: interrupted: no marks are written", file=sys.stderr, flush=True)
        os._exit(130)  # without waiting for threads that still photograph flights
