"""The process of one submission, which only receives estimates and returns motor commands.

The process tells the grader in its first answer which accesses the system cannot block. Audit events of Python block
less than the kernel does, but they show what a submission tried to do.
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
import select
import signal
import socket
import struct
import sys
import warnings
from collections.abc import Callable
from types import CodeType, FrameType, ModuleType
from typing import Any, NoReturn

import noctograph
import numpy as np

from ._noctograph import Scene
from .commands import Report
from .studies import _made, _takes_time  # pyright: ignore[reportPrivateUsage]

NAME = "submission.py"
#: Columns of a row: flight, estimate, reference and time.
COLUMNS = 1 + 12 + 9 + 1
#: Readings that are arrays.
VECTORS = ("rate_rad_s", "specific_force_m_s2", "position_m")
#: Audit events that no controller needs, except for files in its own folder and imports.
NEVER = ("socket.", "subprocess.", "os.", "shutil.", "signal.")
IMPORTS = ("os.listdir", "os.scandir", "os.walk", "os.fwalk", "os.putenv", "os.unsetenv")
#: Audit events whose first argument is a file, which may be in the submission's own folder.
FILES = ("open", "os.chmod", "os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.truncate", "os.utime", "shutil.")
#: Audit events that are forbidden only during a flight, because a controller needs them at most while it is loaded.
FLYING = ("open", "sys._getframe", "gc.", *IMPORTS)
#: Bytes that a submission may write to its own folder while it is loaded.
WRITTEN = 4 << 20
# Linux: unshare(2), mount(2), mount_setattr(2), prctl(2), capset(2).
NAMESPACES = 0x1000_0000 | 0x4000_0000 | 0x2_0000 | 0x2000_0000 | 0x0800_0000  # user, network, mounts, processes, IPC
NEW_USER, READ_ONLY, RECURSIVE, MOUNT_SETATTR = 0x1000_0000, 1, 0x8000, 442
DEATH_SIGNAL, DUMPABLE, SECCOMP, SUBREAPER, NO_NEW_PRIVILEGES = 1, 4, 22, 36, 38
#: Numbers for each architecture: its own in audit(3), then those of clone, clone3, and calls that no controller needs.
#: These are fork, vfork, add_key, request_key and keyctl. Keys would outlive the process, and its user could read them.
CALLS = {
    "x86_64": (0xC000_003E, 56, 435, (57, 58, 248, 249, 250)),
    "aarch64": (0xC000_00B7, 220, 435, (217, 218, 219)),
}
CLONE_THREAD, OTHER_CALLS = 0x1_0000, 0x4000_0000
BIND, CAPABILITIES = 0x1000 | 0x4000, 0x2008_0522


def receive(wire: socket.socket) -> bytes:
    """Reads one message: its length, then its bytes. Ends this process if the grader has closed the connection."""

    def exactly(n: int) -> bytes:
        parts = bytearray()
        while len(parts) < n:
            part = wire.recv(n - len(parts))
            if not part:
                os._exit(0)  # the grader has finished
            parts += part
        return bytes(parts)

    return exactly(struct.unpack("<I", exactly(4))[0])


def send(wire: socket.socket, message: bytes) -> None:
    """Sends one message: its length, then its bytes."""
    wire.sendall(struct.pack("<I", len(message)) + message)


def fail(wire: socket.socket, why: str) -> NoReturn:
    """Sends the reason, up to 200 characters, and ends this process."""
    send(wire, b"f" + why[:200].encode("utf-8", "replace"))
    os._exit(1)


def children() -> list[int]:
    """Returns the processes whose parent is this one."""
    found: list[int] = []
    for process in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError), open(f"/proc/{process}/stat") as file:
            if int(file.read().rpartition(")")[2].split()[1]) == os.getpid():
                found.append(int(process))
    return found


def guard(first: int) -> NoReturn:
    """Waits until the first process ends or the grader closes standard input. Then ends all descendants of this one.

    Orphans among the descendants become children of this process, even if they have moved to a new session. The exit
    code is that of the first process, or 128 plus the number of the signal that ended it.
    """
    ended, status = 0, 0
    while not ended and not select.select([0], [], [], 0.05)[0]:
        ended, status = os.waitpid(first, os.WNOHANG)
    with contextlib.suppress(ChildProcessError):  # no child is left
        while True:
            for child in children():
                os.kill(child, signal.SIGKILL)
            os.wait()
    os._exit(os.WEXITSTATUS(status) if os.WIFEXITED(status) else 128 + os.WTERMSIG(status))


def descend(wire: socket.socket, libc: ctypes.CDLL) -> None:
    """Continues in a grandchild, which runs the submission and can neither reach nor leave the processes above it.

    The grandparent is the guard. The parent is the first process of a PID namespace. The kernel ends all processes of
    the namespace when the parent ends, and delivers no signal from within the namespace to the parent.
    """
    libc.prctl(SUBREAPER, 1)
    if first := os.fork():
        wire.close()
        guard(first)
    libc.prctl(DEATH_SIGNAL, signal.SIGKILL)
    if submission := os.fork():
        wire.close()
        libc.prctl(DUMPABLE, 0)  # the parent cannot be traced
        while (ended := os.wait())[0] != submission:
            pass
        code = ended[1]
        os._exit(os.WEXITSTATUS(code) if os.WIFEXITED(code) else 128 + os.WTERMSIG(code))
    libc.prctl(DEATH_SIGNAL, signal.SIGKILL)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)


def shut_off(wire: socket.socket, shown: list[str], own: str) -> str:
    """Removes access to network, files and other processes as far as the system allows. Continues in a grandchild.

    The shown paths remain readable, and the submission's own folder writable. Returns a sentence about what could not
    be blocked, or an empty text.
    """
    libc, uid, gid = ctypes.CDLL(None), os.getuid(), os.getgid()
    if not hasattr(libc, "unshare"):
        return "network and files are not shut off here: this is not Linux"
    alone, mapped = libc.unshare(NAMESPACES) == 0, True
    try:
        for name, text in (("setgroups", "deny"), ("uid_map", f"{uid} {uid} 1"), ("gid_map", f"{gid} {gid} 1")):
            if alone:
                with open(f"/proc/self/{name}", "w") as file:
                    file.write(text)
    except OSError:
        mapped = False  # AppArmor, for example, permits the namespace but not the mapping
    descend(wire, libc)
    if not alone:
        return "network and files are not shut off here: the system has no namespaces for users"
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
    libc.unshare(NEW_USER)  # otherwise the submission could undo the mounts
    os.chroot(own)
    os.chdir(own)
    # Without capabilities, the submission cannot leave this root.
    libc.capset((ctypes.c_uint32 * 2)(CAPABILITIES, 0), (ctypes.c_uint32 * 6)())
    return "files are not read-only here" if failed else ""


def handed_in(code: CodeType, scene: Scene) -> tuple[Any, Any]:
    """Imports a submission anew with seeded random numbers. Returns its controller for a flight, and its estimator.

    The controller is `controller`, `Controller`, or the last class or function that can be one. It may be missing only
    if there is an `estimator` or `Estimator`.
    """
    random.seed(0)
    np.random.seed(0)
    sys.modules["submission"] = ModuleType("submission")
    module = vars(sys.modules["submission"])
    module["__file__"] = NAME
    exec(code, module)
    estimator = module.get("estimator", module.get("Estimator"))
    own = [it for it in module.values() if getattr(it, "__module__", None) == "submission" and it is not estimator]
    classes = [it for it in own if isinstance(it, type) and "__call__" in dir(it)]
    functions = [it for it in own if hasattr(it, "__code__") and it.__code__.co_argcount in (2, 3)]
    named = module.get("controller"), module.get("Controller")
    found = named if estimator is not None else (*named, *classes[::-1], *functions[::-1])
    controller = next((it for it in found if it is not None), None)
    if controller is None and estimator is None:
        raise TypeError("no class with __call__ and no function of state and reference")
    return None if controller is None else _made(controller, scene), estimator


def said(error: BaseException) -> str:
    """Returns a text with an exception and the innermost line of the submission that raised it.

    An exception whose own text cannot be computed is only named.
    """
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
    """Returns the answer of a submission as finite numbers of a shape. Raises an exception for anything else."""
    found = np.asarray(found)
    if found.shape != shape or found.dtype.kind not in "fiu":
        raise TypeError(f"{what}s are wanted, {shape[0]} of them, not {found.dtype} of shape {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"a {what} is {found[~np.isfinite(found)][0]}")
    return found


def estimate(makes: list[Any], running: list[Any], message: bytes) -> bytes:
    """Returns the estimate of a flight from its readings. For a message that begins a flight, creates its estimator."""

    def vector(value: Any) -> Any:
        return np.array(value, float)

    asked = json.loads(message)
    if "start" in asked:
        running.append(makes[len(running)](vector(asked["start"])))
        return b""
    readings = {name: vector(it) if name in VECTORS else it for name, it in asked["readings"].items()}
    state = numbers(running[asked["flight"]](readings, asked["tick_s"]), (12,), "state")
    return bytes(state.astype(float))


def fly(wire: socket.socket, each: list[tuple[Any, Any]]) -> NoReturn:
    """Answers rows of the flights that are not over with motor commands, and readings with estimates, forever."""
    controllers, estimators = ([it[place] for it in each] for place in (0, 1))
    timed = controllers[0] is not None and _takes_time(controllers[0])
    running: list[Any] = []
    while True:
        message = receive(wire)
        if message[:1] == b"e":
            send(wire, b"e" + estimate(estimators, running, message[1:]))
            continue
        rows = np.frombuffer(bytearray(message[1:])).reshape(-1, COLUMNS)
        motors = np.empty((len(rows), 4))
        for row, command in zip(rows, motors, strict=True):
            # Copies, so that a controller cannot change other flights.
            state, reference = row[1:13].copy(), row[13:22].copy()
            controller = controllers[int(row[0])]
            found = controller(state, reference, row[22]) if timed else controller(state, reference)
            command[:] = numbers(found, (4,), "motor command")
        send(wire, b"m" + motors.tobytes())


def bind(flying: bool) -> None:
    """Forbids new processes, and during the flight also new threads, by a filter of system calls (seccomp(2), in BPF).

    A filter cannot read the flags of clone3. Before the flight, clone3 therefore fails with ENOSYS, so that the C
    library calls clone. Systems other than Linux, and unknown architectures, have no filter.
    """
    if sys.platform != "linux" or (machine := os.uname().machine) not in CALLS:
        return
    arch, clone, clone3, refused = CALLS[machine]
    # Operation, operand, and where it goes on if true and if false: a label, or the next step.
    load, equal, reaches, has, answer = 0x20, 0x15, 0x35, 0x45, 0x06
    steps = [(load, 4, "", ""), (equal, arch, "", "EPERM"), (load, 0, "", ""), (reaches, OTHER_CALLS, "EPERM", "")]
    steps += [(equal, call, "EPERM", "") for call in (*refused, *((clone, clone3) if flying else ()))]
    steps += [(equal, clone3, "ENOSYS", ""), (equal, clone, "", "allowed"), (load, 16, "", ""), (has, CLONE_THREAD, "allowed", "EPERM")]
    ends = {"allowed": 0x7FFF_0000, "EPERM": 0x0005_0001, "ENOSYS": 0x0005_0026}
    to = {label: len(steps) + place for place, label in enumerate(ends)}
    jumps = [(op, *(to[it] - place - 1 if it else 0 for it in goes), k) for place, (op, k, *goes) in enumerate(steps)]
    jumps += [(answer, 0, 0, k) for k in ends.values()]
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *step) for step in jumps))
    libc = ctypes.CDLL(None)
    libc.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    libc.prctl(SECCOMP, 2, struct.pack("HP", len(jumps), ctypes.addressof(code)))


def remembered(ask: Callable[..., Report]) -> Callable[..., Report]:
    """Returns a function of a scene with a cache, because each of a hundred imports calls it with equal arguments."""
    answers: dict[str, Report] = {}

    def again(scene: Scene | str, **options: Any) -> Report:
        key = repr((scene.to_toml() if isinstance(scene, Scene) else scene, options))
        if key not in answers:
            answers[key] = ask(scene, **options)
        return copy.deepcopy(answers[key])

    return again


def running_lines() -> tuple[str, str]:
    """Returns the module that is being imported, if any, and the line of the submission that runs."""
    try:
        raise RuntimeError
    except RuntimeError as error:  # sys._getframe would cause an audit event itself
        frame: FrameType | None = error.__traceback__ and error.__traceback__.tb_frame
    module = line = ""
    while frame is not None and not line:
        if frame.f_code.co_filename == NAME:
            line = f", line {frame.f_lineno}"
        elif frame.f_code.co_name == "_find_and_load":
            module = str(frame.f_locals.get("name", ""))
        frame = frame.f_back
    return module, line


def main() -> NoReturn:
    """Loads the submission and answers the grader until the grader closes the connection.

    Before it is loaded, access and resources of this process are limited. An exception is sent as the reason.
    """
    wire = socket.socket(fileno=int(sys.argv[1]))
    limits, own, flying = json.loads(sys.argv[2]), os.getcwd(), False

    def audit(event: str, arguments: tuple[Any, ...]) -> None:
        if not event.startswith((*NEVER, *FLYING)):
            return
        named = arguments[0] if arguments and isinstance(arguments[0], (str, bytes)) else ""
        path = os.path.abspath(os.fsdecode(named)) + os.sep
        is_own = event.startswith(FILES) and bool(named) and path.startswith(own + os.sep)
        writes = event == "open" and bool(set(str(arguments[1] or "")) & set("wax+") or arguments[2] & os.O_ACCMODE)
        # A descriptor is already open, and data written to the null device is lost.
        is_nowhere = event == "open" and (isinstance(arguments[0], int) or named in (os.devnull, os.fsencode(os.devnull)))
        forbidden = writes or (event.startswith(NEVER) and event not in IMPORTS)
        if flying or (forbidden and not is_own and not is_nowhere):
            module, line = running_lines()
            what = f"{event} {os.fsdecode(named)}".rstrip() + " is not a controller's"
            if flying and module:
                what = f"import {module} in flight: import it at the top of the file"
            elif not flying and (module or event.startswith("subprocess.")):
                # Packages that ask the system while they are imported can do without the answer.
                raise PermissionError(what)
            fail(wire, what + line)

    def limit(what: int, most: int) -> None:
        with contextlib.suppress(ValueError, OSError):  # the limit is already lower, or macOS does not have it
            resource.setrlimit(what, (most, most))

    try:
        warnings.simplefilter("ignore")
        for lazy in ("fft", "linalg", "ma", "polynomial", "random"):
            importlib.import_module(f"numpy.{lazy}")  # NumPy could not import them lazily during the flight
        left = shut_off(wire, limits["shown"], own)
        source, (n,) = receive(wire), struct.unpack("<I", receive(wire))
        with open("task.toml", "wb") as task:
            task.write(receive(wire))
        scene = Scene("task.toml")
        noctograph.gains = remembered(noctograph.gains)
        limit(resource.RLIMIT_CORE, 0)
        limit(resource.RLIMIT_FSIZE, WRITTEN)
        limit(resource.RLIMIT_CPU, limits["total_s"])
        limit(resource.RLIMIT_AS, limits["memory_mb"] << 20)
        sys.addaudithook(audit)
        bind(flying=False)
        code = compile(source, NAME, "exec")
        each = [handed_in(code, scene)]
        made = [it is not None for it in each[0]]
        send(wire, b"n" + bytes([48 + it for it in made]) + left.encode())
        each += [handed_in(code, scene) for _ in range(n - 1)]
        limit(resource.RLIMIT_FSIZE, 0)
        limit(resource.RLIMIT_NOFILE, 0)
        limit(resource.RLIMIT_NPROC, 0)
        bind(flying=True)
        flying = True
        send(wire, b"r")
        fly(wire, each)
    except BaseException as error:
        fail(wire, said(error))
