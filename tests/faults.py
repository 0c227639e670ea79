"""Flies exported scripts in a folder with everything that can go wrong, see tests/export.

After each fault the drone has landed with its motors off, or never took off, and the script has printed
a reason. In three cases the script cannot do this: a link that is lost while setpoints are sent ends in
the firmware's watchdog, the firmware stops the motors of a drone that has tumbled, crashed, is locked or
has a faulty deck, and a second Ctrl-C stops the motors.
"""

import contextlib
import io
import json
import math
import os
import re
import signal
import sys
import tempfile
import threading
import time
import unittest
import unittest.mock
import warnings

import cflib.crazyflie.log
import cflib.crazyflie.syncCrazyflie
import cflib.crtp
from cflib.crtp.crtpstack import CRTPPacket

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sentences import TRUE, sentences, untrue  # noqa: E402
from drone import CFLIB, LOGS, PARAMS, Block, Clock, Linked, Radio, SharedClock, links, load_script  # noqa: E402

WORK = sys.argv[1]
cflib.crazyflie.log.LogConfig = Block
SEEN = []  # (fault, outcome, reason) of all
ALL_MOMENTS = os.environ.get("NOCTOGRAPH_MOMENTS") == "all"


def load(name):
    return load_script(os.path.join(WORK, name))


class Flight:
    """One flight of a script from the checks to the floor, with a fault on the way."""

    def __init__(self, name="I.py", mode="position", at_s=None, do=None, on_ground=None, again_s=None,
                 key=None, set_gains=False, accepted=(), log=None, **radio):
        self.script, self.clock = load(name), Clock()
        self.script.time = self.clock
        data = self.script.DATA
        radio.setdefault("place", data["start_m"])
        radio.setdefault("gains", data["gains"])
        self.radio = self.first = Radio(self.clock, **radio)
        folder = tempfile.mkdtemp(dir=WORK)
        self.again_s = again_s
        self.drone = self.script.Drone(self.radio, log or os.path.join(folder, "log.json"),
                                       self.connect if again_s else None)
        self.error, self.begun_s, printed = None, None, io.StringIO()
        with contextlib.redirect_stdout(printed):
            try:
                if on_ground:
                    on_ground(self)
                self.script.prepare(self.drone, mode, data["controller"], set_gains, accepted)
                if key:
                    key(self)
                self.script.still_ready(self.drone, accepted)
                self.begun_s = self.clock.now_s
                if do:
                    self.clock.after(at_s, lambda: do(self))
                self.script.fly(self.drone, mode, data["controller"])
            except BaseException as error:
                self.error = error
            self.clock.sleep(60.0)  # what the drone does when the script has ended
        self.printed = printed.getvalue()
        self.body = self.radio.body
        self.body.move()
        self.outcome, self.reason = self.body.outcome(), str(self.error or "")

    def connect(self, wait):
        """Opens a new link to the same drone, if there is one, which takes some time."""
        self.clock.sleep(self.again_s)
        if self.again_s > 5.0:
            raise OSError("no drone answers")
        self.radio = self.radio.again()
        return self.radio


class Part:
    """Record of what the double did in one drone's part of a show."""

    def __init__(self, show, script):
        self.show, self.script, self.radios, self.mode = show, script, [], None
        self.drone, self.is_dead_s, self.down_at_prompt, self.log_named = None, None, False, None
        self.failed = self.pressed = False
        make = script.Drone

        def made(*values):
            self.drone = make(*values)
            return self.drone

        script.Drone = made

    @property
    def radio(self):
        return self.radios[-1]

    @property
    def body(self):
        return self.radios[0].body

    def judge(self, said):
        """Returns the printed sentences that are not true of the drone, and the required sentences that were not
        printed."""
        self.body.move()
        self.outcome = self.body.outcome()
        self.lights_sent = len(self.radios[0].blocks) and self.noted()
        logs = [line.split("log: ")[1] for line in said.splitlines() if "log: " in line]
        self.log_named = logs[0] if logs else None
        self.another_ended = len(self.show.parts) > 1
        wrong = untrue(said, self)
        if self.in_the_air_at_the_end and "Stay behind the net" not in said:
            wrong.append("nobody is told to stay behind the net")
        return wrong

    def noted(self):
        """Returns the light changes that the script has sent or logged."""
        return sum(len(column["data"]) - 1 for name, column in self.drone.columns.items()
                   if name.startswith("light."))


class Link(Linked):
    """Stands in for cflib's SyncCrazyflie: a link that is opened at once, or after `again_s` to a drone
    that was lost."""

    def __init__(self, part):
        self.part, self.is_first = part, not part.radios
        data = part.script.DATA
        if self.is_first:
            part.radios.append(Radio(part.show.clock, place=data["start_m"], gains=data["gains"],
                                     **part.show.radio))
            self.cf = part.radio
        else:
            self.cf = part.radios[0].again()

    def __enter__(self):
        again_s = self.part.show.again_s
        if not self.is_first:
            self.part.show.clock.sleep(min(again_s or 0.5, 5.0))
            if again_s is None:
                raise OSError("no drone answers")
            self.part.radios.append(self.cf)
        return self


class Show:
    """Runs an exported script of one drone or several from `main` on, with an event at a moment after Enter. Records
    how the flight ends, and which printed sentences are not true."""

    def __init__(self, name, mode="position", at_s=None, do=None, again_s=None, before_the_key=False,
                 **radio):
        script = load(name)
        files = getattr(script, "SCRIPTS", None)
        scripts = [load(os.path.join(os.path.dirname(name), file)) for file in files] if files else [script]
        self.clock = SharedClock(len(scripts)) if files else Clock()
        self.parts, self.again_s, self.radio = [Part(self, part) for part in scripts], again_s, radio
        for part in self.parts:
            part.mode, part.script.time = mode.replace("-", "_"), self.clock
        script.load = lambda file: scripts[files.index(file)]
        by_uri = {part.script.DATA["uri"]: part for part in self.parts}
        self.do, self.at_s, self.before_the_key = do, at_s, before_the_key
        # Each Crazyflie of cflib consists of several threads that do not end.
        stand_ins = contextlib.ExitStack()
        for what, with_what in (("crtp.init_drivers", lambda: None), ("crazyflie.Crazyflie", lambda rw_cache: None),
                                ("crazyflie.syncCrazyflie.SyncCrazyflie", lambda uri, cf: Link(by_uri[uri]))):
            stand_ins.enter_context(unittest.mock.patch(f"cflib.{what}", with_what))
        script.input, before = self.pressed, (sys.argv, os.getcwd())
        sys.argv = [name, "--mode", mode, "--controller", str(scripts[0].DATA["controller"])]
        os.chdir(tempfile.mkdtemp(dir=WORK))
        self.printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(self.printed), stand_ins:
                script.main()
            self.ended = ""
        except (SystemExit, Exception) as ended:
            self.ended = str(ended)
        finally:
            sys.argv = before[0]
        for part in self.parts:
            part.body.move()
            part.in_the_air_at_the_end = part.body.on
        self.clock.n_threads = 1
        self.clock.sleep(90.0)  # what the drones do when the script has ended
        said = f"{self.printed.getvalue()}{self.ended}"
        self.said, self.wrong = said, [f"{text!r} of {part.script.DATA['uri']}" for part in self.parts
                                       for text in part.judge(self.of(part, said))]
        os.chdir(before[1])
        self.outcomes = [part.outcome for part in self.parts]

    def of(self, part, said):
        """Returns the lines about one drone. With several drones, each line begins with the drone's address."""
        lines, mine = [], len(self.parts) == 1
        for line in said.splitlines():
            for other in self.parts:
                if other.script.DATA["uri"] + ":" in line:
                    mine = other is part
            if mine or "Landed." in line:
                lines.append(line)
        return "\n".join(lines)

    def pressed(self, prompt):
        print(prompt)
        if "Landed" in prompt:
            for part in self.parts:
                part.body.move()
                part.down_at_prompt = not part.body.on
        elif self.before_the_key:
            self.do(self.parts)
            self.clock.sleep(1.0)
        elif self.do:
            self.clock.after(self.at_s, lambda: self.do(self.parts))
        return ""


def press(number=signal.SIGINT, *later_s):
    """Sends Ctrl-C or another signal, and further ones later."""
    def do(parts):
        for part in parts:
            part.pressed = True
        received = signal.getsignal(number)
        if received in (signal.default_int_handler, signal.SIG_DFL):
            return  # it has landed, or does not fly yet
        for s in later_s:
            parts[0].show.clock.after(s, lambda: press(number)(parts))
        if threading.current_thread() is threading.main_thread():
            return signal.raise_signal(number)
        signal.raise_signal(number)
        time.sleep(0.12)  # until the main thread has handled it

    return do


def broken(do):
    """Returns an event that silences the link of the last drone."""
    def broken_link(parts):
        parts[-1].is_dead_s = parts[-1].show.clock.now_s
        do(parts[-1].radio)

    return broken_link


def last(do):
    """Returns an event that happens to the last drone."""
    return lambda parts: do(parts[-1])


def failing(*calls):
    def fail(parts):
        part = parts[-1]
        part.failed = True
        part.radio.failing.update({call: part.radio.calls.get(call, 0) + 1 for call in calls})

    return fail


def returns(notice_s, after_s):
    """Returns an event that interrupts a link in both directions for some time, after which it works again."""
    def hushed(radio):
        radio.hush(notice_s)
        radio.clock.after(after_s, lambda: setattr(radio, "is_lost", radio.is_closed))

    return hushed


# Events, whom they affect, and whether and when a new link is available. A signal reaches all
# drones.
MOMENTS = {
    "Ctrl-C": (press(), None), "SIGTERM": (press(signal.SIGTERM), None), "SIGHUP": (press(signal.SIGHUP), None),
    "Ctrl-C twice": (press(signal.SIGINT, 1.0), None),
    "Ctrl-C three times in 40 ms": (press(signal.SIGINT, 0.02, 0.04), None),
    "link lost": (broken(Radio.lose), None), "link lost, new in 0.5 s": (broken(Radio.lose), 0.5),
    "link lost, new in 1.5 s": (broken(Radio.lose), 1.5), "link lost, new in 2.5 s": (broken(Radio.lose), 2.5),
    "link lost, new in 5 s": (broken(Radio.lose), 5.0),
    **{f"dead for {s} s, {what}": (broken(lambda radio, s=s: radio.hush(s)), again_s)
       for s in (0.3, 1.2, 3.0) for what, again_s in (("none new", None), ("new in 0.3 s", 0.3), ("new in 4 s", 4.0))},
    "deaf for 0.3 s": (broken(lambda radio: radio.hush(0.3, passes=1)), None),
    "deaf for 1.2 s": (broken(lambda radio: radio.hush(1.2, passes=2)), None),
    "dead for 0.7 s, then well": (broken(returns(9.0, 0.7)), 0.3),
    "dead for 1.4 s, then well": (broken(returns(9.0, 1.4)), 0.3),
    "dead for 3 s, then well": (broken(returns(9.0, 3.0)), None),
    "dead, and Ctrl-C at once": (lambda parts: (MOMENTS["dead for 1.2 s, none new"][0](parts), press()(parts)), None),
    "dead, and Ctrl-C twice": (lambda parts: (MOMENTS["dead for 3.0 s, none new"][0](parts),
                                              press(signal.SIGINT, 1.0)(parts)), None),
    "battery empty": (last(lambda part: empty(part)), None), "battery low": (last(lambda part: low(part)), None),
    "outside the fence": (last(lambda part: outside(part)), None), "drifts": (last(lambda part: drifts(part)), None),
    "unsure": (last(lambda part: unsure(part)), None), "silent log": (broken(lambda radio: [
        setattr(block, "on", False) for block in radio.blocks]), None),
    "silent position": (broken(lambda radio: [setattr(block, "on", False) for block in radio.blocks
                                              if block.name in ("position", "where")]), None),
    "crash": (last(lambda part: part.radio.fault(7)), None), "tumbled": (last(lambda part: part.radio.fault(5)), None),
    "deck fault": (last(lambda part: part.radio.fault(11)), None),
    "no number": (last(lambda part: part.radio.values.update({"kalman.varPY": math.nan})), None),
    "setpoint fails": (failing("commander.send_position_setpoint", "commander.send_full_state_setpoint"), None),
    "landing fails": (failing("high_level_commander.land"), None),
}


def lose(flight):
    flight.radio.lose()


def interrupt(flight):
    raise KeyboardInterrupt


def empty(flight):
    flight.radio.fixed["pm.vbat"] = 2.9


def low(flight):
    flight.radio.fixed["pm.vbat"] = 3.1


def unsure(flight):
    flight.radio.fixed["kalman.varPX"] = 1.0


def drifts(flight):
    radio = flight.radio

    def step():
        radio.drift[0] += 0.02
        radio.clock.after(0.05, step)

    step()


def outside(flight):
    flight.radio.drift = [0.0, 5.0, 0.0]


def silent(flight):
    for block in flight.radio.blocks:
        block.on = False


def block_silent(name):
    """Silences one block of the log while others continue. Its last values remain."""
    def silence(flight):
        for block in flight.radio.blocks:
            block.on = block.on and block.name != name

    return silence


def bit(number):
    return lambda flight: flight.radio.fault(number)


def no_number(name):
    return lambda flight: flight.radio.values.update({name: math.nan})


LANDED, STAYED, FALLS = "landed", "never took off", "falls by the firmware's own cut"


class Faults(unittest.TestCase):
    def judged(self, fault, flight, outcomes=(LANDED, STAYED), reason=""):
        """Records a flight, which must have an allowed outcome and print a reason."""
        SEEN.append((fault, flight.outcome, flight.reason.split("\n")[0]))
        self.assertIn(flight.outcome, outcomes, f"{fault}: {flight.printed}")
        self.assertIsNotNone(flight.error, f"{fault}: not noticed")
        self.assertIn(reason, flight.reason, fault)
        self.assertTrue(flight.reason or isinstance(flight.error, KeyboardInterrupt), fault)
        return flight

    def test_a_sound_flight_lands_and_leaves_the_drone_as_it_was(self):
        for name, mode in (("I.py", "position"), ("I.py", "full_state"),
                           ("I_trajectory.py", "trajectory"), ("ring.py", "trajectory"),
                           ("bl.py", "position")):
            brushless = name == "bl.py"
            flight = Flight(name, mode, platform="Crazyflie 2.1" + " Brushless" * brushless,
                            auto_arm=not brushless)
            self.assertIsNone(flight.error, f"{name}: {flight.error!r}\n{flight.printed}")
            self.assertEqual(flight.outcome, LANDED)
            gains = {gain for gain, _ in flight.script.DATA["gains"]}
            sent = {param for _, param, _ in flight.radio.params}
            self.assertEqual(gains & sent, set(), "what the drone has so already is not sent")
            changed = {param.split(".")[0] for param in flight.radio.changed()}
            self.assertLessEqual(changed, {"led", "ring"})
            flight.drone.put_back(lamps=True)
            flight.clock.sleep(1.0)
            self.assertEqual(flight.radio.changed() - {"ring.headlightEnable", "ring.fadeColor"}, set())
            with open(flight.drone.log_file, encoding="utf-8") as file:
                about = json.load(file)["noctograph"]
            self.assertEqual(about["serial"][:8], "1a2b3c4d")
            self.assertEqual(about["firmware"], "2026.08")

    def test_what_is_not_as_it_was_checked_never_takes_off(self):
        wrong = {
            "wrong platform": (dict(platform="Crazyflie 2.1 Brushless"), "drone"),
            "no answer of the version port": (dict(platform=None, firmware=None), "no answer"),
            "old firmware": (dict(firmware="2022.05"), "firmware"),
            "no lamp deck": (dict(decks=("bcLighthouse4",)), "deck for the ring"),
            "no positioning deck": (dict(decks=("bcLedRing",)), "deck for positioning"),
            "wrong nose": (dict(nose=90.0), "nose"),
            "tilted": (dict(lean=12.0), "roll, pitch"),
            "wrong place": (dict(place=(3.0, 0.0)), "place"),
            "no position": (dict(variance=1.0), "position known"),
            "low battery": (dict(battery_v=3.6), "battery"),
            "locked": (dict(bits=1 << 6), "locked"),
            "tumbled": (dict(bits=1 << 5), "tumbled"),
            "crashed": (dict(bits=1 << 7), "crashed"),
            "deck fault": (dict(bits=1 << 11), "deck"),
            "a parameter is missing": (dict(missing=("led.bitmask",)), "led.bitmask"),
            "a log is missing": (dict(missing=("supervisor.info",)), "supervisor.info"),
        }
        for fault, (radio, reason) in wrong.items():
            self.judged(fault, Flight(**radio), (STAYED,), reason)
        for name in ("pm.vbat", "kalman.varPY", "stateEstimate.x", "stateEstimate.yaw", "stateEstimate.roll",
                     "stateEstimate.pitch"):
            flight = Flight(on_ground=no_number(name))
            self.judged(f"{name} is no number on the floor", flight, (STAYED,), "wanted")
        gains = [(gain, 2 * value) for gain, value in load("I.py").DATA["gains"][:3]]
        all_gains = {**dict(load("I.py").DATA["gains"]), **dict(gains)}
        self.judged("other gains", Flight(gains=all_gains), (STAYED,), "--set-gains")

    def test_gains_that_are_set_are_put_back_after_landing(self):
        gain, value = load("I.py").DATA["gains"][0]
        flight = Flight(gains={**dict(load("I.py").DATA["gains"]), gain: 2 * value}, set_gains=True)
        self.assertIsNone(flight.error)
        self.assertEqual([v for _, n, v in flight.radio.params if n == gain], [value, 2 * value])

    def test_what_turns_wrong_before_the_key_never_takes_off(self):
        def carried(flight):
            flight.radio.body.at[0] += 1.0
            flight.clock.sleep(1.0)

        self.judged("carried away before Enter", Flight(key=carried), (STAYED,), "place")

        def fails(flight):
            flight.radio.lose()

        self.judged("link lost before Enter", Flight(key=fails), (STAYED,), "link was lost")

        def falls_silent(flight):
            silent(flight)
            flight.clock.sleep(2.0)

        self.judged("silent before Enter", Flight(key=falls_silent), (STAYED,), "log")

    def test_what_goes_wrong_in_the_air_lands(self):
        in_the_air = {
            "Ctrl-C": (interrupt, ""), "battery empty": (empty, "battery"),
            "battery low": (low, "battery"), "position unsure": (unsure, "position"),
            "estimator drifts": (drifts, "from its target"), "outside the fence": (outside, "fence"),
            "no log": (silent, "does not send log data"),
            "signal": (lambda flight: flight.drone.stopped.set(), "Ctrl-C"),
        }
        script = load("I.py")
        for block in (*script.WATCH, *script.LOG):
            in_the_air[f"log block {block} silent"] = (block_silent(block), f"log data: {block}")
        for name in ("stateEstimate.x", "stateEstimate.z", "stateEstimate.yaw", "kalman.varPX",
                     "kalman.varPY", "kalman.varPZ", "pm.vbat", "ctrltarget.z"):
            in_the_air[f"{name} no number"] = (no_number(name), "not a number")
        cuts = {"tumbled": (bit(5), "tumbled"), "crashed": (bit(7), "crashed: it falls"),
                "locked": (bit(6), "locked: it falls"), "deck": (bit(11), "fault: it falls")}
        for name, mode in (("I.py", "position"), ("I_trajectory.py", "trajectory")):
            later_s = 3.5 if mode == "trajectory" else 0.0
            for faults, outcome in ((in_the_air, LANDED), (cuts, FALLS)):
                for fault, (do, reason) in faults.items():
                    flight = Flight(name, mode, later_s + (2.0 if do is low else 4.0), do)
                    self.judged(f"{fault} in the air, {mode}", flight, (outcome,), reason)

    def test_every_call_that_fails_once_lands_or_never_takes_off(self):
        for name, mode in (("I.py", "position"), ("I.py", "full_state"),
                           ("I_trajectory.py", "trajectory"), ("ring.py", "trajectory")):
            calls = Flight(name, mode).radio.calls
            self.assertGreater(len(calls), 10)
            for call, n in calls.items():
                for nth in range(1, n + 1) if n < 16 else (1, 2, n // 2, n - 1, n):
                    def on_ground(flight, call=call, nth=nth):
                        flight.radio.failing[call] = nth

                    flight = Flight(name, mode, on_ground=on_ground)
                    SEEN.append((f"{call} fails at {nth} of {n}, {mode}", flight.outcome, flight.reason))
                    self.assertIn(flight.outcome, (LANDED, STAYED), f"{call} {nth}: {flight.printed}")
                    said = flight.reason + flight.printed
                    self.assertIn(f"{call} failed", said, f"{call} at {nth} of {n}")

    def test_a_second_ctrl_c_stops_the_motors_and_all_is_put_back(self):
        for name, mode in (("I.py", "position"), ("ring.py", "trajectory")):
            show = Show(name, mode, 6.0 + 3.0 * (mode == "trajectory"), press(signal.SIGINT, 1.0))
            self.assertEqual((show.outcomes, show.wrong), (["falls by the script"], []))
            self.assertIn("motors stopped", show.said)
            changed = show.parts[0].radio.changed()
            self.assertEqual(changed - {"ring.headlightEnable", "ring.fadeColor", "kalman.resetEstimation"}, set())

    def test_a_log_on_a_full_disk_is_whole_elsewhere_or_not_there(self):
        whole, dump = [], json.dump

        def full(limit):
            def dumped(value, file):
                text = json.dumps(value)
                file.write(text[:len(text) // 2] if len(whole) < limit else text)
                whole.append(file.name)
                if len(whole) <= limit:
                    raise OSError(28, "No space left on device")
            return dumped

        for limit in (1, 2):
            whole.clear()
            with unittest.mock.patch("json.dump", full(limit)):
                flight = Flight()
            self.assertEqual(flight.outcome, LANDED)
            folder = os.path.dirname(flight.drone.log_file)
            self.assertEqual(os.listdir(folder), ["log.jsonl"], "no cut file is left")
            [path] = re.findall("log: (.*)", flight.printed)
            with open(path, encoding="utf-8") as file:
                self.assertIn("stateEstimate.z", file.read())
            if limit == 1:
                os.remove(path)
            else:
                self.assertEqual(path, os.path.join(folder, "log.jsonl"), "samples as they came")
        self.assertIs(json.dump, dump)

    def test_the_samples_are_kept_as_they_come_and_are_those_of_the_whole_log(self):
        flight = Flight()
        stem = flight.drone.log_file[:-len(".json")]
        with open(stem + ".json", encoding="utf-8") as file:
            whole = json.load(file)
        with open(stem + ".jsonl", encoding="utf-8") as file:
            head, *rows, end = map(json.loads, file)
        self.assertEqual((head["noctograph"]["scene"], end), (whole["noctograph"]["scene"], {"end": True}))
        columns = {}
        for row in rows:
            for name in row.keys() - {"time"}:
                column = columns.setdefault(name, {"time": [], "data": []})
                column["time"].append(row["time"])
                column["data"].append(row[name])
        self.assertEqual(columns, {name: column for name, column in whole.items() if name != "noctograph"})
        again = Flight(log=stem + ".json")
        self.assertIn(f"log: {stem}-2.json\n", again.printed)
        os.remove(stem + ".json")
        self.assertIn(f"log: {stem}-3.json\n", Flight(log=stem + ".json").printed, "the name of its samples")

    def test_a_disk_that_hangs_or_is_full_changes_nothing_in_the_air(self):
        class Disk:
            def __init__(self, hangs_at, fails_at):
                self.left, self.hangs_at, self.fails_at, self.go_on = 0, hangs_at, fails_at, threading.Event()

            def __enter__(self):
                return self

            def __exit__(self, *_):
                pass

            def fileno(self):
                raise OSError(5, "Input/output error")

            def write(self, data):
                self.left += 1
                if self.left > self.hangs_at:
                    self.go_on.wait()
                if self.left > self.fails_at:
                    raise OSError(28, "No space left on device")
                return max(len(data) // 2, 1)

        never = 10**9
        sound = Flight()
        for disk, why in ((Disk(0, never), "the disk hangs"), (Disk(2, never), "the disk hangs"),
                          (Disk(never, 0), "No space left"), (Disk(never, 3), "No space left"),
                          (Disk(never, never), "Input/output error")):
            def on_ground(flight, disk=disk):
                flight.script.END_S = 0.3
                flight.script.Diary._opened = lambda diary: disk

            flight = Flight(on_ground=on_ground)
            self.assertEqual((flight.error, flight.outcome), (None, LANDED), why)
            self.assertEqual(flight.radio.sent, sound.radio.sent, "the same packets at the same times")
            self.assertRegex(flight.printed, f"could not be stored during the flight: .*{why}")
            [path] = re.findall("log: (.*)", flight.printed)
            self.assertEqual(path.startswith(WORK), why != "the disk hangs", "elsewhere, if this one hangs")
            with open(path, encoding="utf-8") as file:
                self.assertIn("stateEstimate.z", json.load(file))
            disk.go_on.set()
            if not path.startswith(WORK):
                os.remove(path)

    def test_samples_that_wait_for_a_disk_are_bounded(self):
        script = load("I.py")
        script.WAITING_ROWS, script.END_S, go_on = 100, 0.1, threading.Event()
        script.Diary._opened = lambda diary: go_on.wait()
        diary = script.Diary(os.path.join(WORK, "bounded.json"), {})
        for k in range(1000):
            diary.add({"time": k})
        self.assertEqual((len(diary.rows), diary.end()), (100, "the disk hangs"))
        go_on.set()

    def test_a_link_that_is_lost_while_tables_are_read_is_an_error(self):
        # cflib's own SyncCrazyflie waits for its tables indefinitely.
        script = load("I.py")
        import cflib.crtp

        class Driver:
            needs_resending = False

            def __init__(self, uri, statistics, error):
                self.error = error

            def send_packet(self, packet):
                threading.Timer(0.05, self.first).start()
                return True

            def first(self):
                self.packets.append(CRTPPacket(0xFF, [0]))
                threading.Timer(0.05, lambda: self.error("Too many packets lost")).start()

            packets = []

            def receive_packet(self, wait=0):
                time.sleep(0.01)
                return self.packets.pop() if self.packets else None

            def close(self):
                pass

        with unittest.mock.patch("cflib.crtp.get_link_driver", Driver), contextlib.ExitStack() as links_opened:
            warnings.simplefilter("ignore")
            thread = threading.Thread(target=lambda: self.assertRaises(
                script.Stopped, script.opened, links_opened, "radio://0/80/2M/E7E7E7E7E7"), daemon=True)
            thread.start()
            thread.join(10.0)
            self.assertFalse(thread.is_alive())

    def test_files_that_cannot_be_written_come_after_landing(self):
        flight = Flight(log=os.path.join(WORK, "no", "such", "folder", "fault-log.json"))
        self.assertIsNone(flight.error)
        self.assertEqual(flight.outcome, LANDED)
        self.assertIn("writing the log failed", flight.printed)

    def test_the_clock_on_board_is_known_or_measured(self):
        for firmware, rate in (("2026.08", 84 / 85), ("2025.12.1", 84 / 85), ("2026.08 +12", 1.0),
                               ("2026.08 +12", 84 / 85), ("my own", 1.0)):
            flight = Flight("I_trajectory.py", "trajectory", firmware=firmware, clock_rate=rate)
            self.assertIsNone(flight.error, f"{flight.error!r}")
            self.assertAlmostEqual(flight.drone.about["clock"], rate, msg=firmware)
        flight = Flight("I_trajectory.py", "trajectory", firmware="odd", clock_rate=0.97)
        self.judged("an unknown clock", flight, (LANDED,), "0.97")

    def test_the_fence_and_the_question_are_of_the_room_that_was_checked(self):
        script = load("bl.py")
        self.assertIn("room of 4 x 6 x 2.5 m", script.room())
        self.assertEqual(script.LIMITS["fence_m"], [[-1.9, -2.6, -0.1], [1.9, 2.6, 2.4]])
        self.assertIn("without a room", load("I.py").room())

    def test_an_old_cflib_or_none_is_named_first(self):
        script = load("I.py")
        import importlib.metadata as metadata

        def missing(name):
            raise metadata.PackageNotFoundError(name)

        for version, word in ((lambda name: "0.1.26", "0.1.26 is too old"), (missing, "is needed")):
            with unittest.mock.patch("importlib.metadata.version", version):
                with self.assertRaisesRegex(SystemExit, word):
                    script.need_cflib()
        script.need_cflib()

    def test_no_dongle_is_one_line(self):
        script, said = load("I.py"), io.StringIO()

        def nothing_plugged_in(*_, **__):
            raise Exception("Cannot find a Crazyradio Dongle")

        drivers = unittest.mock.patch("cflib.crtp.get_link_driver", nothing_plugged_in)
        with drivers, contextlib.redirect_stderr(said), contextlib.ExitStack() as links_opened:
            warnings.simplefilter("ignore")  # of cflib's own Python
            with self.assertRaises(script.Stopped) as ended:
                script.opened(links_opened, "radio://0/80/2M/E7E7E7E7E7")
        self.assertEqual(said.getvalue(), "")
        self.assertEqual(len(str(ended.exception).splitlines()), 1, ended.exception)
        self.assertIn("Cannot find a Crazyradio Dongle: plug the radio in", str(ended.exception))

    def test_signals_land_and_the_second_one_stops(self):
        script, before, clock = load("I.py"), signal.getsignal(signal.SIGTERM), Clock()
        script.time = clock
        drone = script.Drone(Radio(clock), os.path.join(WORK, "signal.json"))
        with script.landing_on_signals([drone]):
            for _ in range(3):  # a key that bounces
                signal.raise_signal(signal.SIGTERM)
                clock.sleep(0.02)
                self.assertEqual((drone.stopped.is_set(), drone.killed.is_set()), (True, False))
            self.assertEqual(drone.why, "stopped by kill")
            clock.sleep(0.6)
            signal.raise_signal(signal.SIGINT)
            self.assertTrue(drone.killed.is_set())
        self.assertEqual(signal.getsignal(signal.SIGTERM), before)

    def test_accepted_rows_fly(self):
        flight = Flight(decks=("bcLedRing",), accepted=("deck for positioning",))
        self.assertEqual((flight.error, flight.outcome), (None, LANDED))

    def test_every_name_of_the_script_is_in_the_firmware(self):
        for name in ("I.py", "I_trajectory.py", "ring.py", "bl.py", "NOOR.py", "color.py"):
            script = load(name)
            data = script.DATA
            rows = data["parameters"] + data["gains"] + data["dark"]
            rows += [row[1:] for row in data["lights"] + data["trajectory"]["lights"]]
            params = {row[0] for row in rows}
            decks = {f"deck.{deck}" for _, decks in data["limits"]["decks"] for deck in decks}
            self.assertGreater(len(params), 4)
            self.assertEqual((params | decks) - PARAMS, set(), name)
            logs = {v for block in {**script.LOG, **script.WATCH}.values() for v in block}
            self.assertEqual(logs - LOGS, set(), name)
            self.assertNotIn("commander.enHighLevel", params)
            with open(os.path.join(WORK, name), encoding="utf-8") as file:
                text = file.read().split("DATA = json.loads")[0]
            for word in ("kalman.initialYaw", "kalman.resetEstimation", "stabilizer.controller"):
                self.assertIn(word, text)
                self.assertIn(word, PARAMS)

    def test_the_geometry_is_compared_at_four_corners(self):
        def run(off_m):
            script, clock = load("I.py"), Clock()
            script.time = clock
            radio = Radio(clock, place=script.DATA["start_m"])
            drone, corners = script.Drone(radio, os.path.join(WORK, "geometry.json")), []

            def pressed(prompt):
                corner = script.DATA["corners_m"][len(corners)]
                corners.append(corner)
                radio.body.at = [corner[0] + off_m, *corner[1:]]
                return ""

            script.input = pressed
            printed, error = io.StringIO(), None
            with contextlib.redirect_stdout(printed):
                try:
                    script.check_geometry(drone)
                except script.Stopped as stopped:
                    error = stopped
            self.assertEqual((len(corners), radio.sent), (4, []))
            return printed.getvalue(), error

        table, error = run(0.01)
        self.assertEqual((table.count(" ok"), error), (4, None))
        table, error = run(0.03)
        self.assertEqual(table.count(" NO"), 4)
        self.assertIn("2 cm", str(error))


class Moments(unittest.TestCase):
    """Tests that no event at any moment makes the script drop a drone or print a false sentence.

    NOCTOGRAPH_MOMENTS=all tries all moments, otherwise some of each kind."""

    OF_ONE = {"position": "I.py", "full-state": "I.py", "trajectory": "I_trajectory.py"}
    # Outcomes of events that do not depend on the script.
    FATES = {"crash": FALLS, "tumbled": FALLS, "deck fault": FALLS, "Ctrl-C twice": "falls by the script",
             "dead, and Ctrl-C twice": "falls by the script"}

    def tried(self, name, mode, what, at_s):
        do, again_s = MOMENTS[what]
        show = Show(name, mode, at_s, do, again_s)
        kind = f"{name} {mode}: {what} at {at_s:.1f} s"
        self.assertEqual(show.wrong, [], f"{kind}: {show.said}")
        SEEN.extend((kind, outcome, show.ended.split("\n")[0]) for outcome in show.outcomes)
        allowed = {LANDED, STAYED, self.FATES.get(what, LANDED)}
        part = show.parts[-1]
        if part.is_dead_s is not None and mode != "trajectory":
            allowed.add("falls by the firmware's watchdog")
        self.assertIn(part.outcome, allowed, f"{kind}: {show.said}")
        for outcome in show.outcomes[:-1]:
            others = {LANDED, STAYED, "falls by the script" if "twice" in what else LANDED}
            self.assertIn(outcome, others, f"{kind}: {show.said}")
        # A new link that is available in time lands the drone.
        if what in ("link lost, new in 0.5 s", "link lost, new in 1.5 s", "dead for 1.2 s, new in 0.3 s"):
            self.assertIn(part.outcome, (LANDED, STAYED), f"{kind}: {show.said}")
        return show

    def test_every_text_of_the_scripts_has_a_claim(self):
        sources = [os.path.join(os.path.dirname(__file__), "..", "src", "export", name)
                   for name in ("cflib.py", "launcher.py")]
        texts = set()
        for source in sources:
            with open(source, encoding="utf-8") as file:
                texts |= sentences(file.read())
        self.assertEqual((texts - set(TRUE), set(TRUE) - texts), (set(), set()))

    def test_what_happens_to_one_drone(self):
        # The moments are different for each mode and each kind of event.
        step_s = 0.9 if ALL_MOMENTS else 30.0
        for k, (mode, name) in enumerate(self.OF_ONE.items()):
            lasts_s = 21.0 if mode == "trajectory" else 13.0
            for number, what in enumerate(MOMENTS):
                at_s = 0.1 + (2.3 * number + 3.1 * k) % min(step_s, lasts_s)
                while at_s < lasts_s:
                    with self.subTest(what):
                        self.tried(name, mode, what, at_s)
                    at_s += step_s

    def test_what_happens_to_one_drone_of_several(self):
        folders = {2: "fleet/fly_NOOR.py", 5: "fleet5/fly_NOORI.py"}
        kinds = list(MOMENTS) if ALL_MOMENTS else [
            "Ctrl-C", "Ctrl-C twice", "link lost", "dead for 1.2 s, none new", "crash"]
        for n, name in folders.items():
            for number, what in enumerate(kinds):
                for at_s in (2.2, 5.0, 9.5, 16.0) if ALL_MOMENTS and n == 2 else (5.0 + 0.7 * number % 4.0,):
                    with self.subTest(what):
                        self.tried(name, "full-state", what, at_s)

    def test_the_first_press_lands_though_another_drone_has_ended_the_flight(self):
        for s in (0.3, 1.5, 2.5):
            def crash_and_press(parts, s=s):
                parts[-1].radio.fault(7)
                parts[0].show.clock.after(s, lambda: press()(parts))

            show = Show("fleet/fly_NOOR.py", "full-state", 5.0, crash_and_press)
            self.assertEqual((show.outcomes, show.wrong), ([LANDED, FALLS], []), show.said)
            told_s = min(show.parts[0].body.landings) - show.parts[1].body.turned_s
            self.assertLess(told_s, 0.5, "the others are told at once")

    def test_none_takes_off_when_one_is_not_ready(self):
        def refuse(parts):
            parts[-1].radio.fixed["pm.vbat"] = 3.0

        show = Show("fleet/fly_NOOR.py", "full-state", 0.0, refuse, before_the_key=True)
        self.assertEqual((show.outcomes, show.wrong), ([STAYED] * 2, []))
        self.assertIn("battery", show.ended)


def summary():
    """Returns the number of faults for each outcome, with the reasons of one example each."""
    counts = {}
    for _, outcome, _ in SEEN:
        counts[outcome] = counts.get(outcome, 0) + 1
    told = ", ".join(f"{n} {outcome}" for outcome, n in sorted(counts.items()))
    print(f"cflib {'.'.join(map(str, CFLIB))}: {len(SEEN)} faults: {told}")
    if os.environ.get("NOCTOGRAPH_FAULTS"):
        for fault, outcome, reason in SEEN:
            print(f"  {fault:60} {outcome:16} {reason}")


if __name__ == "__main__":
    ran = unittest.main(argv=["faults", *sys.argv[2:]], exit=False)
    summary()
    sys.exit(not ran.result.wasSuccessful())
