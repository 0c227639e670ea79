"""Flies exported scripts for Crazyswarm2 with a double of its Python interface, see tests/crazyswarm.

The double has the methods and signatures of crazyflie_py (IMRCLab/crazyswarm2, September 2026), and their
behavior there: setParam only warns of a name that the firmware does not have, Ctrl-C shuts ROS down unless
its signal handlers are uninstalled, and a CSV of one row is refused as a trajectory.
"""

import ast
import contextlib
import csv
import importlib.util
import inspect
import io
import json
import math
import os
import signal
import sys
import types
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sentences import SWARM, sentences, untrue_of_swarm  # noqa: E402

WORK = sys.argv[1]
SLOW = 84 / 85
FLYING, CAN_FLY, CAN_BE_ARMED, TUMBLED, LOCKED = 16, 8, 1, 32, 64


class TimeHelper:
    """Virtual time that passes only while the script sleeps, and then runs the events that are due."""

    def __init__(self, node):
        self.node, self.now_s, self.due, self.skew_s = node, 100.0, [], 0.0

    def time(self):
        """Returns the time of ROS, which is that of the computer's clock and may be set."""
        return self.now_s + self.skew_s

    def monotonic(self):
        return self.now_s

    def sleep(self, duration):
        end_s = self.now_s + max(0.0, duration)
        while self.due and min(self.due, key=lambda event: event[0])[0] <= end_s:
            event = min(self.due, key=lambda event: event[0])
            self.due.remove(event)
            self.now_s = max(self.now_s, event[0])
            event[1]()
        self.now_s = end_s


class Ros:
    """State that is common to all drones: whether ROS still runs, and everything that was sent."""

    def __init__(self, fault):
        self.clock, self.sent, self.up, self.handles_signals = TimeHelper(self), [], True, True
        self.fault, self.pressed = fault, False

    def call(self, name, method, *values):
        if not self.up:
            raise RuntimeError("the context is not valid")
        if self.fault and self.fault(self, name, method, values):
            raise OSError(f"{method} does not go out")
        self.sent.append((self.clock.now_s, name, method, values))

    def of(self, method, name=None):
        return [(t, v) for t, n, m, v in self.sent if m == method and name in (None, n)]

    def interrupt(self):
        self.up = self.up and not self.handles_signals
        raise KeyboardInterrupt

    def create_subscription(self, kind, topic, callback, queue):
        self.clock.due.append((self.clock.now_s, lambda: self.publish(topic, callback)))

    def publish(self, topic, callback):
        _, name, kind = topic.split("/")
        cf = self.drones[name]
        if kind not in cf.silent and True not in cf.silent:
            sigma_m, angles = cf.sigma_m, [cf.roll_deg, 0.0, cf.yaw_deg]
            callback(types.SimpleNamespace(timestamp=0, values=[sigma_m**2] * 3 + angles))
        self.create_subscription(None, topic, callback, 10)
        self.clock.due[-1] = (self.clock.now_s + 0.1, self.clock.due[-1][1])


class Crazyflie:
    def __init__(self, node, cfname, paramTypeDict):
        self.node, self.prefix, self.paramTypeDict = node, "/" + cfname, paramTypeDict
        self.name, self.silent, self.carried = cfname, (), None  # topics, or True for all
        self.sigma_m, self.roll_deg, self.yaw_deg, self.battery_v = 0.002, 0.5, 0.0, 4.1
        self.place, self.info, self.arms_well = [0.0, 0.0, 0.0], CAN_BE_ARMED | CAN_FLY, True
        self.clock_rate, self.started, self.trajectory = SLOW, None, None
        self.status, self.deaf, self.landing, self.flew = {}, False, None, False
        self.cut_by, self.fell_m, self.told = None, 0.0, [0.0] * 3

    def _call(self, method, *values):
        self.node.call(self.name, method, *values)
        return not self.deaf

    def land(self, targetHeight, duration, groupMask=0):
        if self._call("land", targetHeight, duration) and not self.landing and not self.cut_by:
            self.place, self.started = self._at(), None
            self.landing = (self.node.clock.now_s, duration / self.clock_rate, self.place[2], targetHeight)

    def _cut(self, by):
        """Stops the motors, like an emergency stop, disarming and the firmware's supervisor."""
        if self.cut_by is None and self.started and not self._is_over():
            self.cut_by, self.fell_m, self.place = by, self._at()[2], [*self._at()[:2], 0.0]
            self.started = None
        elif self.cut_by is None and self.landing and not self._is_over():
            self.cut_by, self.fell_m, self.landing = by, self._at()[2], None

    def _is_over(self):
        """True if the drone has landed, by the script's command or at the end of its trajectory."""
        if self.landing:
            return self.node.clock.now_s >= self.landing[0] + self.landing[1]
        return not self.started or self._on_board_s() > sum(p.duration for p in self.trajectory.polynomials)

    def _on_board_s(self):
        """Returns the seconds since the start on the drone's clock, on which the trajectory runs."""
        start_s, timescale = self.started
        return (self.node.clock.now_s - start_s) * self.clock_rate / timescale

    def _at(self):
        if self.landing:
            begun_s, lasts_s, from_m, to_m = self.landing
            share = min(max((self.node.clock.now_s - begun_s) / lasts_s, 0.0), 1.0)
            share = share**4 * (35 - 84 * share + 70 * share**2 - 20 * share**3)
            return [*self.place[:2], from_m + share * (to_m - from_m)]
        if self.started:
            place = self.trajectory.at(self._on_board_s())
            return place if math.isfinite(place[2]) else [*self.place[:2], 0.0]
        return self.place

    def outcome(self):
        if not self.flew:
            return "never took off"
        if self.cut_by and self.fell_m > 0.3:
            return f"falls by {self.cut_by}"
        return "landed" if self.cut_by or self._is_over() else "in the air"

    def uploadTrajectory(self, trajectoryId, pieceOffset, trajectory):
        if self._call("uploadTrajectory", trajectoryId, pieceOffset):
            self.trajectory = trajectory

    def startTrajectory(self, trajectoryId, timescale=1.0, reverse=False, relative=True, groupMask=0):
        if self._call("startTrajectory", trajectoryId, timescale, reverse, relative):
            self.started, self.flew = (self.node.clock.now_s, timescale), True

    def arm(self, arm=True):
        if self._call("arm", arm):
            self.info = (self.info | CAN_FLY) if arm and self.arms_well else self.info & ~CAN_FLY
            if not arm:
                self._cut("disarming")

    def emergency(self):
        if self._call("emergency"):
            self._cut("the script")

    def getParam(self, name):
        return float("nan")  # the server reads no values unless it is configured to

    def setParam(self, name, value):
        if name not in self.paramTypeDict:
            return print(f"(crazyflie.py)setParam : keyError raised {name}")
        self._call("setParam", name, value)

    def get_status(self):
        if True not in self.silent and "status" not in self.silent:
            now_s = self.node.clock.now_s
            self.status = {"timestamp_sec": int(now_s), "timestamp_nsec": now_s % 1,
                           "supervisor": self.info, "battery": self.battery_v}
        return self.status

    def get_position(self):
        if True not in self.silent and "pose" not in self.silent:
            self.told = self.carried or self._at()
        return self.told


class Trajectory:
    def __init__(self):
        self.polynomials = None

    def n_pieces(self):
        return len(self.polynomials)

    def loadcsv(self, filename):
        with open(filename, encoding="utf-8") as file:
            rows = [[float(n) for n in row[:33]] for row in list(csv.reader(file))[1:]]
        if len(rows) == 1:
            raise IndexError("invalid index to scalar variable: numpy.loadtxt of one row is no table")
        axes = ("px", "py", "pz", "pyaw")
        self.polynomials = [types.SimpleNamespace(duration=row[0], **{
            axis: types.SimpleNamespace(p=row[1 + 8 * k:9 + 8 * k]) for k, axis in enumerate(axes)})
            for row in rows]

    def at(self, time_s):
        for piece in self.polynomials:
            if time_s <= piece.duration:
                break
            time_s -= piece.duration
        else:
            time_s = piece.duration
        return [sum(a * time_s**k for k, a in enumerate(axis.p)) for axis in (piece.px, piece.py, piece.pz)]


def load(name):
    path = os.path.join(WORK, name)
    script = next(file for file in os.listdir(path) if file.startswith("fly_"))
    spec = importlib.util.spec_from_file_location(name, os.path.join(path, script))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def names(script):
    known = {name for drone in script.DRONES for part in ("before", "parameters", "dark")
             for name, *_ in drone[part]}
    return known | {"led.bitmask"}


def flight(name, firmware="2026.08", fault=None, lacks=(), events=(), keys=None, **drones):
    """Runs a script with the double. Returns what it sent, the reason of its end, and its output.

    `drones` are attributes of all drones, and `events` are pairs (seconds after take-off, event)."""
    script = load(name)
    ros = Ros(fault)
    types_of = dict.fromkeys(names(script) - set(lacks), 2)
    ros.drones = {}
    for drone in reversed(script.DRONES):
        cf = Crazyflie(ros, drone["name"], types_of)
        cf.place = [*drone["start_m"], 0.0]
        cf.yaw_deg = math.degrees(drone["yaw_rad"])
        for attribute, value in drones.items():
            setattr(cf, attribute, value)
        ros.drones[drone["name"]] = cf
    crazyflies = list(ros.drones.values())
    allcfs = types.SimpleNamespace(crazyflies=crazyflies, crazyfliesByName=ros.drones)
    swarm = types.SimpleNamespace(allcfs=allcfs, timeHelper=ros.clock)
    modules = {
        "crazyflie_py": {"Crazyswarm": lambda: swarm},
        "crazyflie_py.uav_trajectory": {"Trajectory": Trajectory},
        "crazyflie_interfaces": {}, "crazyflie_interfaces.msg": {"LogDataGeneric": object},
        "geometry_msgs": {}, "geometry_msgs.msg": {"PoseStamped": object},
        "rclpy": {"spin_once": lambda node, timeout_sec: node.clock.sleep(timeout_sec)}, "rclpy.signals": {
            "uninstall_signal_handlers": lambda: setattr(ros, "handles_signals", False)},
    }
    for module, attributes in modules.items():
        sys.modules[module] = types.ModuleType(module)
        vars(sys.modules[module]).update(attributes)

    def enter(question):
        ros.entered_s = ros.clock.now_s
        ros.clock.sleep(5.0)
        if keys:
            keys(ros)
        for after_s, event in events:
            # The trajectory starts two seconds after the key press.
            ros.clock.due.append((ros.clock.now_s + 2.0 + after_s, lambda event=event: event(ros)))

    script.input, script.time = enter, ros.clock
    printed, ended = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        try:
            script.main(["--firmware", firmware])
        except BaseException as error:
            ended = error
    ros.script, ros.ended, ros.printed = script, ended, printed.getvalue()
    ros.ended_in_the_air = [cf.outcome() == "in the air" for cf in ros.drones.values()]
    end_s = ros.clock.now_s + 90.0
    while ros.clock.now_s < end_s:  # what the drones do when the script has ended
        with contextlib.suppress(KeyboardInterrupt):
            ros.clock.sleep(end_s - ros.clock.now_s)
    for number in SIGNALS:
        signal.signal(number, signal.default_int_handler)
    ros.outcomes = {name: cf.outcome() for name, cf in ros.drones.items()}
    return ros


def change(**attributes):
    def event(ros):
        for cf in ros.drones.values():
            vars(cf).update(attributes)
            if cf.info & (TUMBLED | LOCKED):
                cf._cut("the firmware")
    return event


SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP")]


def press(number=signal.SIGINT, *later_s):
    """Sends Ctrl-C or another signal, and further ones later."""
    def event(ros):
        for s in later_s:
            ros.clock.due.append((ros.clock.now_s + s, lambda: press(number)(ros)))
        if signal.getsignal(number) is not signal.default_int_handler:
            ros.pressed = True
            signal.raise_signal(number)
    return event


def set_clock(by_s, then):
    """Sets the computer's clock, and causes a fault one second later."""
    def event(ros):
        ros.clock.skew_s = by_s
        ros.clock.due.append((ros.clock.now_s + 1.0, lambda: then(ros)))
    return event


def dead(ros):
    change(silent=(True,), deaf=True)(ros)


# Events, the allowed outcomes of drones in flight, and the required messages.
MOMENTS = {
    "Ctrl-C": (press(), "landed", ""), "kill": (press(signal.SIGTERM), "landed", ""),
    "a closed window": (press(signal.SIGHUP), "landed", ""),
    "Ctrl-C three times in 40 ms": (press(signal.SIGINT, 0.02, 0.04), "landed", ""),
    "Ctrl-C twice": (press(signal.SIGINT, 1.0), "falls by the script", ""),
    "battery empty": (change(battery_v=2.9), "landed", "battery"),
    "tumbled": (change(info=TUMBLED), "falls by the firmware", "tumbled"),
    "no link": (dead, "landed", "topic"), "no topics": (change(silent=(True,)), "landed", "topic"),
    "no pose": (change(silent=("pose",)), "landed", "topic"),
    "clock back, battery empty": (set_clock(-60.0, change(battery_v=2.9)), "landed", "battery"),
    "clock forth, battery empty": (set_clock(60.0, change(battery_v=2.9)), "landed", "battery"),
    "clock back": (set_clock(-60.0, lambda ros: None), "landed", None),
    "clock forth": (set_clock(60.0, lambda ros: None), "landed", None),
}


def lamp_fails(ros, name, method, values):
    flown = ros.of("startTrajectory")
    return bool(flown) and method == "setParam" and values[0].startswith(("ring", "led", "color"))


class Flights(unittest.TestCase):
    def landed(self, ros):
        """True if every drone that took off was told to land, and no motor was stopped in the air."""
        flew = [name for name in ros.drones if ros.of("startTrajectory", name)]
        return all(ros.of("land", name) for name in flew) and not ros.of("emergency")

    def test_the_whole_flight_is_sent_in_order(self):
        for name in ("pid", "lee", "turned", "brushless", "pair", "dot"):
            ros = flight(name)
            self.assertIsNone(ros.ended, (name, ros.ended, ros.printed))
            for drone in ros.script.DRONES:
                methods = [m for _, n, m, _ in ros.sent if n == drone["name"] and m != "setParam"]
                self.assertEqual(methods, ["uploadTrajectory", "arm", "startTrajectory", "land", "arm"],
                                 "take-off is part of the trajectory")
                before = [v for t, v in ros.of("setParam", drone["name"]) if t <= ros.entered_s]
                self.assertEqual({n for n, _ in before}, {"stabilizer.estimator",
                                 "kalman.initialYaw", "kalman.resetEstimation"}, "nothing else yet")
                self.assertIn(("kalman.initialYaw", drone["yaw_rad"]), before)
                self.assertEqual([v for n, v in before if n.endswith("resetEstimation")], [1, 0])
                sent = dict(v for _, v in ros.of("setParam", drone["name"]))
                self.assertEqual(sent["stabilizer.controller"], 5 if name == "lee" else 1)
                self.assertEqual("ctrlLee.mass" in sent, name == "lee")
                self.assertEqual(sent["led.bitmask"], 0, "the red LED shines after landing")
                yaws = {piece.pyaw.p[0] for piece in ros.drones[drone["name"]].trajectory.polynomials}
                self.assertEqual(yaws, {drone["yaw_rad"]})
                self.assertEqual(ros.of("arm", drone["name"])[-1][1], (False,))
                landed_s = ros.of("land", drone["name"])[0][0]
                lit = [v for t, v in ros.of("setParam", drone["name"]) if t >= landed_s
                       and "bitmask" not in v[0]]
                self.assertEqual({value for _, value in lit}, {0}, "lamps off after landing")

    def test_lamps_change_where_the_plan_has_them_whatever_the_clock_on_board(self):
        def off_m(firmware, clock_rate):
            ros = flight("pid", firmware=firmware, clock_rate=clock_rate)
            drone, cf, worst_m = ros.script.DRONES[0], ros.drones["cf1"], 0.0
            (start_s, (_, timescale, reverse, relative)), = ros.of("startTrajectory")
            self.assertEqual((reverse, relative), (False, False), "in the places that were checked")
            changes = [(t, v) for t, v in ros.of("setParam") if t > start_s][:len(drone["lights"])]
            for (t, sent), (time_s, *want) in zip(changes, drone["lights"]):
                self.assertEqual(list(sent), want)
                flown = cf.trajectory.at((t - start_s) * clock_rate / timescale)
                planned = cf.trajectory.at(time_s - drone["start_s"])
                worst_m = max(worst_m, math.dist(flown, planned))
            self.assertGreaterEqual(len(changes), 8)
            return worst_m

        self.assertLess(off_m("2026.08", SLOW), 0.005)
        self.assertLess(off_m("2024.10.2", SLOW), 0.005)
        self.assertLess(off_m("2026.10", 1.0), 0.005)
        self.assertGreater(off_m("2026.10", SLOW), 0.02, "the double tells them apart")

    def test_what_is_wrong_on_the_floor_keeps_it_there_and_is_said(self):
        wrong = {
            "battery at rest": {"battery_v": 3.6},
            "place": {"place": [9.0, 0.0, 0.0]},
            "nose": {"yaw_deg": 90.0},
            "level": {"roll_deg": 20.0},
            "position settled": {"sigma_m": 0.5},
            "settled is": {"sigma_m": math.nan},
            "tumbled": {"info": CAN_FLY | TUMBLED},
            "locked": {"info": LOCKED},
            "supervisor": {"info": 0},
            "status topic": {"silent": (True,)},
            "cannot fly": {"arms_well": False, "info": CAN_BE_ARMED},
        }
        for what, attributes in wrong.items():
            ros = flight("pid", **attributes)
            self.assertIsInstance(ros.ended, SystemExit, what)
            self.assertIn(what, str(ros.ended))
            self.assertEqual(ros.of("startTrajectory"), [], what)
        ros = flight("lee", lacks={"ctrlLee.mass"})
        self.assertIn("ctrlLee.mass", str(ros.ended))
        self.assertEqual(ros.of("startTrajectory"), [])

    def test_it_lands_in_forty_of_forty_faults(self):
        n = 0
        faults = [dict(fault=lambda ros, name, method, values, which=which: method == which
                       and (method != "setParam" or bool(ros.of("startTrajectory"))))
                  for which in ("startTrajectory", "setParam", "arm", "uploadTrajectory")]
        faults += [dict(fault=lamp_fails)]
        faults += [dict(events=[(at_s, Ros.interrupt)]) for at_s in range(0, 15)]
        faults += [dict(events=[(at_s, change(battery_v=2.9))]) for at_s in (1, 8, 13)]
        faults += [dict(events=[(at_s, change(info=TUMBLED))]) for at_s in (1, 12)]
        faults += [dict(events=[(at_s, change(silent=(True,)))]) for at_s in (2, 12)]
        faults += [dict(events=[(at_s, change(silent=(topic,)))], reason=f"no {topic} topic")
                   for topic in ("status", "pose", "noctograph") for at_s in (1, 8)]
        faults += [dict(events=[(6.2, change(carried=[9.0, 0.0, 1.0]))], reason="outside")]
        faults += [dict(events=[(6.2, change(carried=[math.nan] * 3))], reason="outside")]
        faults += [dict(events=[(6.2, change(sigma_m=sigma_m))], reason="position is lost")
                   for sigma_m in (math.nan, 1.0)]
        faults += [dict(events=[(6.2, change(battery_v=math.nan))], reason="battery")]
        faults += [dict(keys=Ros.interrupt), dict(battery_v=3.0), dict(lacks={"kalman.initialYaw"})]
        for fault in faults:
            reason = fault.pop("reason", "")
            for name in ("pid", "pair"):
                ros = flight(name, **fault)
                self.assertIn(reason, str(ros.ended), fault)
                self.assertTrue(self.landed(ros), (fault, ros.sent[-8:], ros.ended))
                said = str(ros.ended) + ros.printed
                self.assertTrue(ros.ended or "does not go out" in said, fault)
                n += name == "pid"
        self.assertGreaterEqual(n, 40)

    def test_one_drone_that_cannot_be_told_keeps_no_other_in_the_air(self):
        ros = flight("pair", fault=lambda ros, name, method, values: (name, method) == ("cf1", "land"))
        self.assertEqual(len(ros.of("land", "cf2")), 1)

    def test_lamps_that_fail_come_after_the_landing(self):
        ros = flight("pid", fault=lamp_fails)
        self.assertEqual(len(ros.of("land")), 1)
        self.assertIsInstance(ros.ended, OSError)

    def test_a_second_interrupt_cuts_the_motors(self):
        ros = flight("pair", events=[(10, Ros.interrupt), (11, Ros.interrupt)])
        self.assertEqual([len(ros.of("emergency", name)) for name in ("cf1", "cf2")], [1, 1])

    def test_an_interrupt_while_it_lands_lets_it_land(self):
        ros = flight("pid")
        landing_s = ros.of("land")[0][0] - ros.of("startTrajectory")[0][0]
        ros = flight("pid", events=[(landing_s + 1, Ros.interrupt)])
        self.assertEqual((ros.of("emergency"), ros.ended), ([], None))

    def test_a_drone_that_hears_nothing_more_comes_down_by_itself(self):
        ros = flight("pid")
        cf, (start_s, _) = ros.drones["cf1"], ros.of("startTrajectory")[0]
        hover, descent, no_goal = cf.trajectory.polynomials[-3:]
        landing_s = ros.of("land")[0][0] - start_s
        before_s = sum(piece.duration for piece in cf.trajectory.polynomials[:-2])
        self.assertGreater(before_s - landing_s, 2.5, "the script's landing comes first")
        low_m = cf.trajectory.at(before_s + descent.duration)[2]
        self.assertAlmostEqual(low_m, -0.1, places=6)
        self.assertTrue(math.isnan(no_goal.pz.p[0]), "and then the firmware stops the motors")

    def test_a_drone_rises_where_it_stands_and_goes_to_the_first_letter(self):
        ways = []
        for off_m in (0.0, 0.1):
            x, y = load("pid").DRONES[0]["start_m"]
            ros = flight("pid", place=[x + off_m, y - off_m, 0.0])
            self.assertIsNone(ros.ended)
            trajectory = ros.drones["cf1"].trajectory
            for time_s in (0.0, 1.0, 3.5):
                self.assertLess(math.dist(trajectory.at(time_s)[:2], (x + off_m, y - off_m)), 1e-9)
            ways.append([trajectory.at(7.0 + 0.1 * k) for k in range(80)])
        self.assertLess(max(map(math.dist, *ways)), 1e-9, "the same letters")

    def test_the_release_must_be_one(self):
        for wrong in ("84/85", "2026", "new", "1.0"):
            with contextlib.redirect_stderr(io.StringIO()):
                self.assertIsInstance(flight("pid", firmware=wrong).ended, SystemExit, wrong)

    def test_the_server_is_asked_for_what_the_script_reads(self):
        with open(os.path.join(WORK, "pid", "crazyflies.yaml"), encoding="utf-8") as file:
            text = file.read()
        for wanted in ("pose:", "status:", "noctograph:", "kalman.varPX", "stateEstimate.yaw"):
            self.assertIn(wanted, text)


class Moments(unittest.TestCase):
    """Tests that no event at any moment makes the script drop a drone or print a false sentence."""

    def judged(self, ros, kind, outcome="landed"):
        for name, found in ros.outcomes.items():
            self.assertIn(found, ("landed", "never took off", outcome), f"{kind}: {ros.printed}{ros.ended}")
        said = ros.printed + str(ros.ended or "")
        self.assertEqual(untrue_of_swarm(said, ros), [], f"{kind}: {said}")
        if any(ros.ended_in_the_air):
            self.assertIn("stay behind the net", said, kind)

    def test_every_text_of_the_script_has_a_claim(self):
        with open(os.path.join(os.path.dirname(__file__), "..", "src", "export", "crazyswarm.py"),
                  encoding="utf-8") as file:
            texts = sentences(file.read())
        self.assertEqual((texts - set(SWARM), set(SWARM) - texts), (set(), set()))

    def test_what_happens_at_any_moment(self):
        n = 0
        often = 4.0 if os.environ.get("NOCTOGRAPH_MOMENTS") == "all" else 1.0
        for folder, step_s in (("pid", 2.3), ("lee", 8.9), ("pair", 4.7), ("five", 11.9)):
            for number, (what, (event, outcome, reason)) in enumerate(MOMENTS.items()):
                at_s = -2.9 + 0.17 * number
                while at_s < 21.0:
                    ros = flight(folder, events=[(at_s, event)])
                    kind = f"{folder}: {what} at {at_s:.1f} s"
                    self.judged(ros, kind, outcome)
                    if reason is None:
                        self.assertIsNone(ros.ended, kind)
                    elif reason and ros.ended:
                        self.assertIn(reason, str(ros.ended), kind)
                        flown_s = ros.of("land")[0][0] - ros.entered_s - 7.0 - at_s if ros.of("land") else 0.0
                        self.assertLess(flown_s, 4.5, f"{kind}: noticed late")
                    at_s, n = at_s + step_s / often, n + 1
        print(f"{n} flights with what happens at a moment")

    def test_a_press_at_every_call_lands(self):
        for folder in ("pid", "pair"):
            calls = len(flight(folder).sent)
            for nth in range(calls):
                def pressed(ros, name, method, values, nth=nth):
                    if len(ros.sent) == nth and not ros.pressed:
                        press()(ros)

                def raised(ros, name, method, values, nth=nth):
                    # The signal is sent while ROS or another library may have its own handler.
                    if len(ros.sent) == nth and not ros.pressed and ros.of("arm"):
                        ros.pressed = True
                        raise KeyboardInterrupt

                for fault in (pressed, raised):
                    ros = flight(folder, fault=fault)
                    self.judged(ros, f"{folder}: Ctrl-C at call {nth} of {calls}")
                    if ros.of("arm"):
                        self.assertEqual({ros.of("arm", name)[-1][1] for name in ros.drones}, {(False,)})


class Source(unittest.TestCase):
    """Compares the double with the source of crazyflie_py, if that is available."""

    @unittest.skipUnless(os.environ.get("CRAZYSWARM2"), "CRAZYSWARM2 names no checkout")
    def test_methods_have_their_signatures(self):
        folder = os.path.join(os.environ["CRAZYSWARM2"], "crazyflie_py", "crazyflie_py")
        for file, doubles in (("crazyflie.py", (Crazyflie, TimeHelper)), ("uav_trajectory.py", (Trajectory,))):
            with open(os.path.join(folder, file), encoding="utf-8") as source:
                tree = ast.parse(source.read())
            for double in doubles:
                theirs = next(node for node in tree.body
                              if isinstance(node, ast.ClassDef) and node.name == double.__name__)
                methods = {m.name: m for m in theirs.body if isinstance(m, ast.FunctionDef)}
                for name, ours in inspect.getmembers(double, inspect.isfunction):
                    if name.startswith("_") or (double, name) == (Trajectory, "at"):
                        continue
                    arguments = [a.arg for a in methods[name].args.args]
                    self.assertEqual(list(inspect.signature(ours).parameters), arguments, name)
                    defaults = [ast.literal_eval(d) for d in methods[name].args.defaults]
                    found = [p.default for p in inspect.signature(ours).parameters.values()
                             if p.default is not p.empty]
                    self.assertEqual(found, defaults, name)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    unittest.main(argv=sys.argv[:1], verbosity=1)
