"""The process of one submission: estimates come in, motor commands go out, and nothing else.

What the system cannot forbid is told to the grader in the first answer. Python itself forbids less than a kernel:
its audit events are there to name what a submission tried.
"""

from __future__ import annotations

import contextlib
import copy
import ctypes
import importlib
import json
import os
import random
import resource
import signal
import socket
import struct
import sys
import warnings
from typing import Any, NoReturn

import numpy as np

from .studies import _takes_time  # pyright: ignore[reportPrivateUsage]

NAME = "submission.py"
#: Flight, estimate, reference and time of a row.
COLUMNS = 1 + 12 + 9 + 1
#: Readings that are arrays.
VECTORS = ("rate_rad_s", "specific_force_m_s2", "position_m")
#: Audit events that no controller has a reason for, but for files of its own folder and what imports do.
NEVER = ("socket.", "subprocess.", "os.", "shutil.", "signal.")
IMPORTS = ("os.listdir", "os.scandir", "os.putenv", "os.unsetenv")
#: Those that it has no reason for once it flies.
FLYING = ("open", "sys._getframe", "gc.", *IMPORTS)
#: What it may write while it is loaded, in its own folder, bytes.
WRITTEN = 4 << 20
# Linux: unshare(2), mount(2), mount_setattr(2), prctl(2), capset(2).
NAMESPACES = 0x1000_0000 | 0x4000_0000 | 0x2_0000 | 0x2000_0000 | 0x0800_0000  # user, network, mounts, processes, IPC
NEW_USER, READ_ONLY, RECURSIVE, MOUNT_SETATTR, DEATH_SIGNAL = 0x1000_0000, 1, 0x8000, 442, 1
BIND, CAPABILITIES = 0x1000 | 0x4000, 0x2008_0522


def receive(wire: socket.socket) -> bytes:
    """One message: its length, then its bytes."""

    def exactly(n: int) -> bytes:
        parts = bytearray()
        while len(parts) < n:
            part = wire.recv(n - len(parts))
            if not part:
                os._exit(0)  # the grader has enough
            parts += part
        return bytes(parts)

    return exactly(struct.unpack("<I", exactly(4))[0])


def send(wire: socket.socket, message: bytes) -> None:
    """Sends one message."""
    wire.sendall(struct.pack("<I", len(message)) + message)


def fail(wire: socket.socket, why: str) -> NoReturn:
    """Ends the process with the reason."""
    send(wire, b"f" + why[:200].encode("utf-8", "replace"))
    os._exit(1)


def shut_off(shown: list[str], own: str) -> str:
    """Takes network, files and other processes away where the system allows; what it does not.

    What is shown, read-only, and a folder of its own are all the files there are.
    """
    libc, uid, gid = ctypes.CDLL(None), os.getuid(), os.getgid()
    if not hasattr(libc, "unshare") or libc.unshare(NAMESPACES):
        return "network and files are not shut off here: the system has no namespaces for users"
    mapped = True
    try:
        for name, text in (("setgroups", "deny"), ("uid_map", f"{uid} {uid} 1"), ("gid_map", f"{gid} {gid} 1")):
            with open(f"/proc/self/{name}", "w") as file:
                file.write(text)
    except OSError:
        mapped = False  # as where AppArmor leaves such a namespace without rights
    # The process after a fork is the first of the new namespace, and ends with this one.
    child = os.fork()
    if child:
        status = os.waitpid(child, 0)[1]
        os._exit(os.WEXITSTATUS(status) if os.WIFEXITED(status) else 128 + os.WTERMSIG(status))
    libc.prctl(DEATH_SIGNAL, signal.SIGKILL)
    size = f"size={2 * WRITTEN}".encode()
    if not mapped or libc.mount(b"none", os.fsencode(own), b"tmpfs", 0, size):
        return "files are not shut off here"
    inside = own + own
    os.makedirs(inside)
    for path in shown:
        if os.path.isdir(path):
            os.makedirs(own + path, exist_ok=True)
        else:
            os.makedirs(os.path.dirname(own + path), exist_ok=True)
            os.close(os.open(own + path, os.O_CREAT))
        libc.mount(os.fsencode(path), os.fsencode(own + path), None, BIND, None)
    read_only = (ctypes.c_uint64 * 4)(READ_ONLY, 0, 0, 0)
    failed = libc.syscall(MOUNT_SETATTR, -100, os.fsencode(own), RECURSIVE, read_only, 32)
    libc.mount(b"none", os.fsencode(inside), b"tmpfs", 0, size)
    libc.unshare(NEW_USER)  # without it the mounts could be undone, and without rights the root kept
    os.chroot(own)
    os.chdir(own)
    libc.capset((ctypes.c_uint32 * 2)(CAPABILITIES, 0), (ctypes.c_uint32 * 6)())
    return "files are not read-only here" if failed else ""


def handed_in(source: bytes) -> tuple[Any, Any]:
    """What a submission hands in: `controller` or `Controller`, else the last class or function that can be one, and
    `estimator` or `Estimator`."""
    module: dict[str, Any] = {"__name__": "submission", "__file__": NAME}
    exec(compile(source, NAME, "exec"), module)
    estimator = module.get("estimator", module.get("Estimator"))
    own = [it for it in module.values() if getattr(it, "__module__", None) == "submission" and it is not estimator]
    classes = [it for it in own if isinstance(it, type) and "__call__" in dir(it)]
    functions = [it for it in own if hasattr(it, "__code__") and it.__code__.co_argcount in (2, 3)]
    named = module.get("controller"), module.get("Controller")
    found = named if estimator is not None else (*named, *classes[::-1], *functions[::-1])
    controller = next((it for it in found if it is not None), None)
    if controller is not None or estimator is not None:
        return controller, estimator
    raise TypeError("no class with __call__ and no function of state and reference")


def said(error: BaseException) -> str:
    """An exception and the line of the submission that raised it."""
    trace, line = error.__traceback__, ""
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == NAME:
            line = f", line {trace.tb_lineno}"
        trace = trace.tb_next
    name = "it exits" if isinstance(error, SystemExit) else type(error).__name__
    try:
        text = str(error)
    except BaseException:
        text = ""
    return name + (text and f": {text}") + line


def numbers(found: Any, shape: tuple[int, ...], what: str) -> Any:
    """What a submission returned, where it is what is wanted."""
    found = np.asarray(found)
    if found.shape != shape or found.dtype.kind not in "fiu":
        raise TypeError(f"{what}s are wanted, {shape[0]} of them, not {found.dtype} of shape {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"a {what} is {found[~np.isfinite(found)][0]}")
    return found


def estimate(make: Any, running: list[Any], message: bytes) -> bytes:
    """The estimate of a flight by its readings, or nothing where the flight begins."""

    def vector(value: Any) -> Any:
        return np.array(value, float)

    asked = json.loads(message)
    if "start" in asked:
        running.append(make(vector(asked["start"])))
        return b""
    readings = {name: vector(it) if name in VECTORS else it for name, it in asked["readings"].items()}
    return numbers(running[asked["flight"]](readings, asked["tick_s"]), (12,), "state").astype(float).tobytes()


def fly(wire: socket.socket, each: list[Any], estimator: Any) -> NoReturn:
    """Answers rows of the flights that are not over with their motor commands, and readings with estimates."""
    timed = each[0] is not None and _takes_time(each[0])
    running: list[Any] = []
    while True:
        message = receive(wire)
        if message[:1] == b"e":
            send(wire, b"e" + estimate(estimator, running, message[1:]))
            continue
        rows = np.frombuffer(bytearray(message[1:])).reshape(-1, COLUMNS)
        motors = np.empty((len(rows), 4))
        for row, command in zip(rows, motors, strict=True):
            state, reference = row[1:13], row[13:22]
            controller = each[int(row[0])]
            found = controller(state, reference, row[22]) if timed else controller(state, reference)
            command[:] = numbers(found, (4,), "motor command")
        send(wire, b"m" + motors.tobytes())


def main() -> NoReturn:
    """Loads the submission and flies by it, until the grader has enough."""
    wire = socket.socket(fileno=int(sys.argv[1]))
    limits, own, flying = json.loads(sys.argv[2]), os.getcwd(), False

    def audit(event: str, arguments: tuple[Any, ...]) -> None:
        if not event.startswith((*NEVER, *FLYING)):
            return
        named = arguments[0] if arguments and isinstance(arguments[0], (str, bytes)) else ""
        is_own = bool(named) and os.path.abspath(os.fsdecode(named)).startswith(own + os.sep)
        writes = event == "open" and bool(set(str(arguments[1] or "")) & set("wax+") or arguments[2] & os.O_ACCMODE)
        forbidden = writes or (event.startswith(NEVER) and event not in IMPORTS)
        if flying or (forbidden and not is_own):
            hint = " (import it at the top of the file)" if flying and os.fsdecode(named).endswith((".py", ".pyc", ".so")) else ""
            fail(wire, f"{event} {os.fsdecode(named)}".rstrip() + " is not a controller's" + hint)

    def limit(what: int, most: int) -> None:
        with contextlib.suppress(ValueError, OSError):  # lower already, or unknown to macOS
            resource.setrlimit(what, (most, most))

    try:
        warnings.simplefilter("ignore")
        for lazy in ("fft", "linalg", "ma", "polynomial", "random"):
            importlib.import_module(f"numpy.{lazy}")  # no file can be opened in flight
        random.seed(0)
        np.random.seed(0)
        left = shut_off(limits["shown"], own)
        source, (n,) = receive(wire), struct.unpack("<I", receive(wire))
        with open("task.toml", "wb") as task:
            task.write(receive(wire))
        limit(resource.RLIMIT_CORE, 0)
        limit(resource.RLIMIT_FSIZE, WRITTEN)
        limit(resource.RLIMIT_CPU, limits["total_s"])
        limit(resource.RLIMIT_AS, limits["memory_mb"] << 20)
        sys.addaudithook(audit)
        made, estimator = handed_in(source)
        each = [made() if isinstance(made, type) else copy.deepcopy(made) for _ in range(n)]
        limit(resource.RLIMIT_FSIZE, 0)
        limit(resource.RLIMIT_NOFILE, 0)
        limit(resource.RLIMIT_NPROC, 0)
        flying = True
        send(wire, b"n" + bytes([48 + (made is not None), 48 + (estimator is not None)]) + left.encode())
        fly(wire, each, estimator)
    except BaseException as error:
        fail(wire, said(error))
