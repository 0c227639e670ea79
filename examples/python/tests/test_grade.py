"""Marks for a class: cheats and faults cost their owner alone."""

import csv
import importlib.util
import io
import os
import pathlib
import signal
import subprocess
import sys
import textwrap
import time

import noctograph as nc
import pytest
from noctograph.grade import Limits, _submissions, grade, main

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
from estimators import Luenberger  # noqa: E402

pytestmark = pytest.mark.skipif(os.name != "posix", reason="a process cannot be limited here")

TASK = nc.Scene("cf-brushless", word="I")
#: The controller of docs/tutorials/first-controller.md; its gains are a class's own.
CASCADE = """
import numpy as np
import noctograph as nc

scene = nc.Scene("cf-brushless", word="I")
mixer = scene.motors_from_wrench
weight_n = 9.81 * scene.mass_kg
inertia = 1 / np.diag(np.array(nc.gains(scene)["B"])[9:])


class Cascade:
    kp, kd = np.array({kp}), np.array({kd})
    attitude_p, attitude_d = np.array([10.0, 80.0, 80.0]), np.array([5.0, 16.0, 16.0])

    def __call__(self, state, reference):
        position, angles, velocity, rate = np.split(state, 4)
        wanted = self.kp * (reference[:3] - position) + self.kd * (reference[3:6] - velocity) + reference[6:]
        lean = np.clip([0, wanted[0] / 9.81, -wanted[1] / 9.81], -0.4, 0.4)
        turn = self.attitude_p * (lean - angles) - self.attitude_d * rate[::-1]
        return mixer @ [*(inertia * turn[::-1]), weight_n + scene.mass_kg * wanted[2]]
"""
HONEST = {
    "stiff.py": CASCADE.format(kp=[9.0, 9.0, 20.0], kd=[5.0, 5.0, 8.0]),
    "soft.py": CASCADE.format(kp=[2.0, 2.0, 12.0], kd=[2.0, 2.0, 6.0]),
    "gains.toml": 'controller.kind = "lqr-integral"\n',
}
ZERO = "    return [0, 0, 0, 0]\n"
#: What it does and, in its row, why it has no place.
CHEATS = {
    "frame.py": ("import sys\ndef controller(state, reference):\n    try:\n        sys._getframe(1).f_locals\n"
                 "    except BaseException:\n        pass\n" + ZERO, "failed: sys._getframe is not a controller's"),
    "reads.py": ("def controller(state, reference):\n    open('/etc/hostname')\n" + ZERO, "failed: open /etc/hostname"),
    "writes.py": ("open('/tmp/marks.csv', 'w')\ndef controller(state, reference):\n" + ZERO, "failed: open /tmp/marks.csv"),
    "calls.py": ("import socket\ndef controller(state, reference):\n    socket.socket()\n"
                 + ZERO, "failed: socket."),
    "kills.py": ("import os\nos.kill(os.getppid(), 9)\ndef controller(state, reference):\n" + ZERO, "failed: os.kill"),
    "thread.py": ("import threading\ndef spin():\n    while True: pass\nthreading.Thread(target=spin, daemon=True).start()\n"
                  "def controller(state, reference):\n" + ZERO, "failed: it flies with a thread that works"),
    "child.py": ("import ctypes\nlibc = ctypes.CDLL(None)\nassert libc.fork() > 0\n"
                 "def controller(state, reference):\n" + ZERO, "failed: AssertionError, line 3"),
    "keys.py": ("import ctypes, os\nlibc = ctypes.CDLL(None)\nadd_key = {'x86_64': 248, 'aarch64': 217}[os.uname().machine]\n"
                "assert libc.syscall(add_key, b'user', b'noctograph', b'state', 5, -3) > 0\n"
                "def controller(state, reference):\n" + ZERO, "failed: AssertionError, line 4"),
    "starts.py": ("import _thread\ndef controller(state, reference):\n    _thread.start_new_thread(print, ())\n"
                  + ZERO, "failed: RuntimeError: can't start new thread, line 3"),
    "asks.py": ("import subprocess\nsubprocess.run(['id'])\ndef controller(state, reference):\n" + ZERO,
                "failed: PermissionError: subprocess.Popen id is not a controller's, line 2"),
    "patches.py": ("import noctograph.isolated as grader\ngrader.numbers = lambda found, shape, what: found\n"
                   "def controller(state, reference):\n    return [float('nan')] * 4\n", "failed: its answer is broken"),
    "forges.py": ("import gc, socket, struct\nwire = [it for it in gc.get_objects() if isinstance(it, socket.socket)][0]\n"
                  "def controller(state, reference):\n    wire.sendall(struct.pack('<I', 2) + b'm1')\n" + ZERO,
                  "failed: its answer is broken"),
    "lazy.py": ("def controller(state, reference):\n    import xml.dom.minidom\n" + ZERO,
                "failed: import xml.dom.minidom in flight: import it at the top of the file, line 2"),
    "mass.toml": ("vehicle.mass_kg = 0.02\n", "refused: vehicle.mass_kg differs from the task's"),
}  # fmt: skip
FAULTY = {
    "raises.py": ("def controller(state, reference):\n    return 1 / 0\n", "failed: ZeroDivisionError: division by zero, line 2"),
    "sleeps.py": ("import time\ndef controller(state, reference):\n    time.sleep(1e6)\n", "failed: no answer within"),
    "shape.py": ("def controller(state, reference):\n    return [0, 0, 0]\n", "failed: TypeError: motor commands are wanted, 4 of them"),
    "assigns.py": ("def controller(state, reference):\n    state[12] = 0\n" + ZERO, "failed: IndexError: index 12 is out of bounds"),
    "exits.py": ("import os\ndef controller(state, reference):\n    os._exit(3)\n", "failed: its process ended: exit code 3"),
    "leaves.py": ("def controller(state, reference):\n    raise SystemExit\n", "failed: it exits"),
    "grows.py": ("def controller(state, reference):\n    return [bytearray(1 << 36)]\n", "failed: MemoryError"),
    "nan.py": ("def controller(state, reference):\n    return [float('nan')] * 4\n", "failed: ValueError: a motor command is nan"),
    "broken.py": ("def controller(state, reference:\n", "failed: SyntaxError"),
    "nothing.py": ("import numpy as np\n", "failed: TypeError: no class with __call__"),
    "essay.txt": ("I flew well.\n", "refused: wanted a scene"),
}


def rows(report):
    return list(csv.DictReader(io.StringIO(report.files["marks.csv"].decode())))


def hand_in(folder, submissions):
    folder.mkdir()
    for name, text in submissions.items():
        (folder / name).write_text(text if isinstance(text, str) else text[0])
    return folder


def graded(folder, workers, seeds=2):
    limits = Limits(step_s=10, load_s=300)
    return grade(TASK, folder, seeds=seeds, seed=5, workers=workers, limits=limits, progress=False)


def test_cheats_and_faults_cost_their_owner_alone(tmp_path):
    alone = graded(hand_in(tmp_path / "honest", HONEST), 1)
    report = graded(hand_in(tmp_path / "all", {**HONEST, **CHEATS, **FAULTY}), 4)
    assert not alone["unranked"] and rows(alone)[0]["place"] == "1"
    assert rows(report)[:3] == rows(alone), "honest order and marks unchanged"
    assert report["measures"] == alone["measures"] and report["flights"] == alone["flights"], "bit for bit"
    notes = {row["name"]: row["note"] for row in rows(report)[3:]}
    for name, (_, why) in {**CHEATS, **FAULTY}.items():
        note = notes.pop(name.rsplit(".", 1)[0])
        assert note.startswith(why), f"{name}: {note}"
    assert not notes


#: A controller that falls over letters lower than 10 cm.
TALL = """class Controller:
    def __init__(self, scene):
        assert scene.get("letters.cap_height_m") > 0.1

    def __call__(self, state, reference):
        return [0, 0, 0, 0]
"""


def test_the_acuity_of_submissions_is_that_of_rank(tmp_path):
    files = {**HONEST, "tall.py": TALL, "raises.py": FAULTY["raises.py"]}
    folder, limits = hand_in(tmp_path / "all", files), Limits(10, 300)
    report = grade(TASK, folder, seeds=2, seed=5, acuity=1, workers=2, limits=limits, progress=False)

    def cascade(name):
        spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return TASK, module.Cascade

    gains = nc.Scene(TASK, set={"controller.kind": "lqr-integral"})
    contenders = {"gains": gains, "soft": cascade("soft"), "stiff": cascade("stiff")}
    ranked = nc.rank(contenders, seeds=2, seed=5, acuity=1, progress=False)
    assert report["acuity"] == ranked["acuity"] and len(report["acuity"]["limits"]) == 3
    assert report["measures"] == ranked["measures"], "marks do not depend on the ladder"
    # Who fails on the ladder fails.
    *marked, raises, tall = rows(report)
    assert raises["note"].startswith("failed: ZeroDivisionError") and tall["note"].startswith("failed: AssertionError")
    limit_m = {limit["contender"]: limit["cap_height_m"]["value"] for limit in ranked["acuity"]["limits"]}
    assert {row["name"]: float(row["acuity_m"]) for row in marked} == limit_m and tall["acuity_m"] == ""


#: What packages do as they are imported: null device, open descriptors, and what they do without if it is refused.
PACKAGE = """import os, socket, subprocess
open(os.devnull, "w").close()
os.fdopen(os.dup(1), "w").close()
for refused in (lambda: subprocess.run(["id"]), lambda: os.mkdir("/tmp/theirs"), lambda: open("/tmp/theirs.txt", "w"), socket.socket):
    try:
        refused()
    except PermissionError:
        continue
    raise SystemExit("it is allowed")
"""


def test_packages_do_without_what_they_are_refused_as_they_are_imported(tmp_path):
    written = f"import os, sys\nopen('package.py', 'w').write({PACKAGE!r})\nsys.path.insert(0, os.getcwd())\nimport package\n"
    (row,) = rows(graded(hand_in(tmp_path / "all", {"ada.py": written + HONEST["soft.py"]}), 1))
    assert not row["note"], row


def test_every_entry_of_a_folder_has_a_row_or_is_named(tmp_path, capsys):
    names = ["BEN.TOML", "cy.toml.txt", "dora.zip", ".ed.toml", "eve_13/gains.toml", "fay_14/more/x.toml"]
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(HONEST["gains.toml"])
    (tmp_path / "gus_15").mkdir()
    handed = _submissions(tmp_path)
    assert set(handed) == {"BEN", "cy.toml", "dora", "eve_13/gains", "fay_14/more", "gus_15"}
    assert handed["eve_13/gains"] == tmp_path / "eve_13/gains.toml"
    assert ".ed.toml" in capsys.readouterr().err


def test_links_are_not_followed_and_copies_are_named(tmp_path, capsys):
    folder = hand_in(tmp_path / "all", {"ada.py": HONEST["soft.py"], "ben.py": HONEST["soft.py"], "cy.toml": HONEST["gains.toml"]})
    renamed = HONEST["soft.py"].replace("Cascade", "Mine")
    for name, text in {"dora.py": renamed, "eve.toml": "controller = { kind = 'lqr-integral' }\n", "fay\x1b[1m.toml": "a = 1"}.items():
        (folder / name).write_text(text)
    for name, target in {"gus.py": "ada.py", "hal.toml": "cy.toml", "ida.toml": "nothing.toml"}.items():
        (folder / name).symlink_to(target)
    notes = {row["name"]: row["note"] for row in rows(graded(folder, 2, seeds=1))}
    (fay,) = (name for name in notes if name.startswith("fay"))
    assert notes.pop(fay).startswith("refused: ")
    link = "refused: a link, which is not followed"
    assert notes == {"ada": "", "ben": "flies exactly as ada", "cy": "", "dora": "flies exactly as ada", "eve": "flies exactly as cy",
                     "gus": link, "hal": link, "ida": link}  # fmt: skip
    said = capsys.readouterr().err
    assert "the same file: ada, ben\n" in said and "seed 5 can be found by trial" in said
    assert "plan.light_clock" in said and "plan.setpoint_interval_s = 0.002" in said


def left_over():
    """Processes of submissions."""
    lines = [path.read_bytes() for path in pathlib.Path("/proc").glob("[0-9]*/cmdline") if path.exists()]
    return [line for line in lines if b"noctograph.isolated" in line and b'"total_s": 4321' in line]


OUTLIVES = """
import ctypes
libc = ctypes.CDLL(None)
libc.prctl(1, 0), libc.setsid()
if libc.fork() == 0:
    if libc.fork() == 0:
        libc.prctl(1, 0), libc.setsid()
    libc.sleep(60)
def controller(state, reference):
    libc.sleep(60)
"""


@pytest.mark.skipif(not os.path.exists("/proc/self"), reason="processes are looked for in /proc")
@pytest.mark.parametrize("namespaces", [True, False])
def test_no_submission_outlives_its_grader(tmp_path, namespaces):
    hand_in(tmp_path / "all", {"outlives.py": OUTLIVES, "good.toml": HONEST["gains.toml"]})
    TASK.save(tmp_path / "task.toml")
    command = [sys.executable, "-m", "noctograph.grade", "task.toml", "all", "--words", "I:1", "--total-s", "4321", "-o", "m"]
    if not namespaces:
        command = ["unshare", "-Ur", "sh", "-c", 'echo 0 > /proc/sys/user/max_user_namespaces && exec "$@"', "sh", *command]
    run = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    if "unshare" in run.stderr:
        pytest.skip("no namespaces for users here")
    assert "outlives failed: no answer within" in run.stdout, run
    assert not left_over()


@pytest.mark.skipif(not os.path.exists("/proc/self"), reason="processes are looked for in /proc")
def test_an_interrupt_ends_all_at_once(tmp_path):
    hand_in(tmp_path / "all", {"slow.py": "import time\ndef controller(state, reference):\n    time.sleep(4)\n" + ZERO})
    command = [sys.executable, "-m", "noctograph.grade", "cf-brushless", "all", "--words", "I:1,L:1", "--total-s", "4321", "-o", "m"]
    run = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    while run.poll() is None and not left_over():
        time.sleep(0.1)
    begun = time.monotonic()
    run.send_signal(signal.SIGINT)
    said = run.communicate()[0]
    assert time.monotonic() - begun < 2, "no step of 4 s is waited for"
    assert run.returncode == 130 and said.endswith("error: interrupted: no marks are written\n") and "Traceback" not in said
    assert not left_over() and not list((tmp_path / "m").iterdir())


def test_the_seeds_of_a_class_cannot_be_counted_through(tmp_path):
    folder = hand_in(tmp_path / "all", {"gains.toml": HONEST["gains.toml"]})
    secret, again = (grade(TASK, folder, seeds=20, progress=False) for _ in range(2))
    assert secret["seed"] != again["seed"]
    seeds = [[flight["seed"] for flight in report["flights"]] for report in (secret, again)]
    assert len({*seeds[0], *seeds[1]}) == 40 and all(max(it).bit_length() > 60 for it in seeds)
    same = grade(TASK, folder, seeds=20, seed=secret["seed"], progress=False)
    assert same["flights"] == secret["flights"], "the seed that is printed gives the same marks"


HONEST_WAYS = {
    "scene.py": "class Controller:\n    def __init__(self, scene):\n        self.hover = scene.mass_kg\n"
                "    def __call__(self, state, reference):\n        return [1e6 * self.hover] * 4\n",
    "global.py": "steps = 0\ndef controller(state, reference):\n    global steps\n    steps += 1\n"
                 "    controller.last = getattr(controller, 'last', -1) + 1\n    return [20000 + steps, 20000 + controller.last, 2e4, 2e4]\n",
    "dataclass.py": "from __future__ import annotations\nfrom dataclasses import dataclass\n@dataclass\nclass Controller:\n"
                    "    total: float = 0\n    def __call__(self, state, reference):\n        return [2e4] * 4\n",
    "writes.py": "def controller(state, reference):\n    state[0] = 0\n    return [2e4] * 4\n",
    "alone.py": "def controller(state, reference):\n    assert state.base is None and reference.base is None\n    return [2e4] * 4\n",
    "threads.py": "import threading\nthread = threading.Thread(target=print)\nthread.start(), thread.join()\n"
                  "def controller(state, reference):\n    return [2e4] * 4\n",
    "plots.py": "import matplotlib.pyplot as plt\ndef controller(state, reference):\n    return [2e4] * 4\n",
}  # fmt: skip


def test_what_flies_in_rank_flies_here_and_flights_share_nothing(tmp_path):
    pytest.importorskip("matplotlib")
    shares = "def controller(state, reference):\n    return [0.6] * 4\n"
    report = graded(hand_in(tmp_path / "all", {**HONEST_WAYS, "shares.py": shares}), 2)
    assert not report["unranked"], report["unranked"]
    assert "warning: shares: 2 of 2 flights: the drone never left the floor: its motor commands reach 0.6" in report.text

    class Alone:
        steps = 0

        def __call__(self, state, reference):
            self.steps += 1
            return [20000 + self.steps, 20000 + self.steps - 1, 2e4, 2e4]

    free = nc.rank({"global": (TASK, Alone)}, seeds=2, seed=5, progress=False)
    assert [it for it in report["flights"] if it["contender"] == "global"] == free["flights"], "a state of its own for each flight"


def test_a_controller_flies_as_it_does_without_a_process_of_its_own(tmp_path):
    source = HONEST["stiff.py"]
    module = {}
    exec(source, module)
    report = graded(hand_in(tmp_path / "a", {"stiff.py": source}), 1)
    free = nc.rank({"stiff": (TASK, module["Cascade"])}, seeds=2, seed=5, progress=False)
    assert report["measures"] == free["measures"] and report["flights"] == free["flights"]


def test_what_the_system_forbids_is_out_of_reach(tmp_path):
    spy = """
    import ctypes, os
    libc = ctypes.CDLL(None)
    libc.open.argtypes = libc.umount2.argtypes = (ctypes.c_char_p, ctypes.c_int)
    free = [libc.open(b"/tmp/noctograph-spy", 0o101) >= 0, (libc.kill(os.getppid(), 9), os.getppid() != 1)[1],
            libc.open(b"%s", 0) >= 0, libc.open(b"%s", 0) >= 0, libc.umount2(b"/usr", 2) == 0]
    def controller(state, reference):
        raise RuntimeError(f"free {free}")
    """
    folder = tmp_path / "all"
    others, seed = folder / "other.toml", tmp_path / "ranking.json"
    seed.write_text("5")
    hand_in(folder, {"other.toml": HONEST["gains.toml"], "spy.py": textwrap.dedent(spy % (others, seed))})
    note = rows(graded(folder, 1))[-1]["note"]
    if subprocess.run(["unshare", "-rn", "true"], check=False).returncode:
        pytest.skip("no namespaces for users here")
    assert "free [False, False, False, False, False]" in note, note


def test_the_command_leaves_marks_and_a_page(tmp_path, capsys):
    folder = hand_in(tmp_path / "all", {"good.toml": HONEST["gains.toml"], "bad<b>.toml": "[vehicle]\nmass_kg = 0.02\n"})
    TASK.save(tmp_path / "task.toml")
    output = tmp_path / "marks"
    arguments = [str(tmp_path / "task.toml"), str(folder), "-o", str(output), "--words", "I:2", "--seed", "5"]
    assert main(arguments) == 1, "one was refused"
    assert "refused: vehicle.mass_kg" in capsys.readouterr().out
    page = (output / "report.html").read_text()
    assert "refused: vehicle.mass_kg" in page and "bad&lt;b>" in page
    assert (output / "marks.csv").read_text().startswith("name,place,p_read,low,high,marks,note\ngood,1,")
    for wrong in (["--may", "letters.font"], ["--words", "I:x"], ["--words", "I:0"], ["--acuity", "0"], ["--seed", "-1"]):
        assert main([*arguments, *wrong]) == 2, wrong
    command = [sys.executable, "-m", "noctograph.grade", "--help"]
    assert b"--memory-mb" in subprocess.run(command, check=True, capture_output=True).stdout


def test_an_estimator_is_flown_in_a_process_of_its_own(tmp_path):
    task = nc.Scene("ae483-2022", word="I", set={"controller.kind": "lqr-feedforward"})
    source = (pathlib.Path(__file__).parents[1] / "estimators.py").read_text()
    faulty = "class Estimator:\n    def __init__(self, state):\n        pass\n    def __call__(self, readings, tick_s):\n        return "
    handed_in = {
        "observer.py": source + "\nEstimator = Luenberger\n",
        "both.py": source + "\nEstimator = Luenberger\n" + CASCADE.format(kp=[2.0, 2.0, 12.0], kd=[2.0, 2.0, 6.0]) + "\nController = Cascade\n",
        "short.py": faulty + "[0] * 9\n",
        "raises.py": faulty + "1 / 0\n",
    }
    report = grade(task, hand_in(tmp_path / "all", handed_in), seeds=1, seed=5, limits=Limits(10, 300), progress=False)
    free = nc.rank({"free": (task, None, Luenberger)}, seeds=1, seed=5, progress=False)
    flights = [{**it, "contender": "free"} for it in report["flights"] if it["contender"] == "observer"]
    assert flights == free["flights"], "bit for bit"
    assert {it["contender"] for it in report["flights"]} == {"observer", "both"}
    notes = {row["name"]: row["note"] for row in rows(report)}
    assert notes["short"].startswith("failed: TypeError: states are wanted, 12 of them, not int64 of shape (9,)")
    assert notes["raises"].startswith("failed: ZeroDivisionError: division by zero, line 5")
