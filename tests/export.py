"""Checks exported files in a folder with cflib: see tests/export."""

import contextlib
import importlib.util
import io
import json
import os
import struct
import sys
import types
import unittest
import zipfile

from cflib.crazyflie.commander import Commander
from cflib.crazyflie.high_level_commander import HighLevelCommander
from cflib.crazyflie.mem.trajectory_memory import CompressedSegment, CompressedStart, Poly4D

WORK = sys.argv[1]


def load(name):
    path = os.path.join(WORK, name)
    spec = importlib.util.spec_from_file_location(os.path.basename(name)[:-3].replace("-", "_"), path)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


class Clock:
    """Time that passes only while somebody sleeps; runs what is due then."""

    def __init__(self):
        self.now_s, self.due = 100.0, []

    def monotonic(self):
        return self.now_s

    def sleep(self, s):
        self.now_s += s
        for event in [event for event in self.due if event[0] <= self.now_s]:
            self.due.remove(event)
            event[1]()


class Callbacks(list):
    def add_callback(self, callback):
        self.append(callback)


class Radio:
    """A Crazyflie that records packets and parameters with their times. Its commanders are cflib's."""

    def __init__(self, clock, battery_v=4.1, place=(0.0, 0.0), variance=1e-5):
        self.clock, self.sent, self.params, self.blocks = clock, [], [], []
        self.values = {"pm.vbat": battery_v, "stateEstimate.x": place[0], "stateEstimate.y": place[1],
                       "kalman.varPX": variance, "kalman.varPY": variance, "kalman.varPZ": variance}
        self.disconnected, self.connection_lost = Callbacks(), Callbacks()
        self.platform = types.SimpleNamespace(get_protocol_version=lambda: 12)
        self.commander, self.high_level_commander = Commander(self), HighLevelCommander(self)
        self.param = types.SimpleNamespace(set_value=self.set_value)
        self.supervisor = types.SimpleNamespace(send_arming_request=lambda arm: None)
        self.log = types.SimpleNamespace(add_config=self.blocks.append, toc=types.SimpleNamespace(
            get_element_by_complete_name=lambda name: None if "ae483" in name else name))
        self.memory = types.SimpleNamespace(trajectory=[], write_data_sync=self.uploaded)
        self.mem = types.SimpleNamespace(get_mems=lambda kind: [self.memory])
        self.upload = None

    def uploaded(self):
        self.upload = b"".join(bytes(element.pack()) for element in self.memory.trajectory)
        return True

    def send_packet(self, packet, *_, **__):
        self.sent.append((self.clock.now_s, packet.port, packet.channel, bytes(packet.data)))

    def set_value(self, name, value):
        assert isinstance(value, (int, float)), f"{name} = {value!r}"
        self.params.append((self.clock.now_s, name, value))

    def packets(self, port, kind):
        return [(t, data) for t, p, c, data in self.sent if p == port and c == 0 and data[0] == kind]


class Block:
    """Stands in for cflib's LogConfig; a started block sends a row when the clock moves."""

    radio = None

    def __init__(self, name, period_in_ms):
        self.name, self.variables, self.data_received_cb, self.on = name, [], Callbacks(), False
        self.period_s = period_in_ms / 1000

    def add_variable(self, name, kind):
        self.variables.append((name, kind))
        sizes = {"float": 4, "uint16_t": 2}
        assert sum(sizes[kind] for _, kind in self.variables) <= 26, self.name

    def start(self):
        self.on, radio = True, Block.radio

        def row():
            if not self.on:
                return
            values = {name: radio.values.get(name, 0.0) for name, _ in self.variables}
            for callback in self.data_received_cb:
                callback(round(1000 * (radio.clock.now_s - 50)), values, self)
            radio.clock.due.append((radio.clock.now_s + self.period_s, row))

        radio.clock.due.append((radio.clock.now_s + self.period_s, row))

    def stop(self):
        self.on = False


def flight(script, mode, clock_rate=1.0, **radio):
    """Prepares and flies a script under the recording drone; returns it, its drone and what ended it."""
    import cflib.crazyflie.log

    cflib.crazyflie.log.LogConfig = Block
    clock = Clock()
    script.time = clock
    due = radio.pop("due", None)
    radio.setdefault("place", script.DATA["start_m"])
    cf = Block.radio = Radio(clock, **radio)
    log = os.path.join(WORK, f"log-{clock.__hash__()}.json")
    drone = script.Drone(cf, log)
    ended = None
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            script.prepare(drone, mode)
            cf.begun_s = clock.now_s
            if due:
                clock.due.append((clock.now_s + due[0], lambda: due[1](cf)))
            script.fly(drone, mode, 5, clock_rate)
        except (script.Stopped, KeyboardInterrupt) as error:
            ended = error
    return cf, drone, ended


def interrupt(_):
    raise KeyboardInterrupt


def lose(cf):
    for callback in cf.connection_lost:
        callback("radio://", "lost")


COMMANDER, HIGH_LEVEL = 7, 8
POSITION, FULL_STATE, STOP = 7, 6, 0
TAKE_OFF, LAND, GO_TO, DEFINE, START = 7, 8, 12, 6, 13


class Bytes(unittest.TestCase):
    def test_compressed_bytes_are_cflibs_where_it_does_not_truncate(self):
        data = open(os.path.join(WORK, "NOOR.traj"), "rb").read()
        start = struct.unpack_from("<hhhh", data)
        half = 2e-4  # keeps cflib's truncation from losing a millimeter
        meters = [v / 1000 + (half if v > 0 else -half if v < 0 else 0) for v in start[:3]]
        packed, at = bytes(CompressedStart(*meters, 0.0).pack()), 8
        while data[at:] != b"\0\0\0":
            header, duration_ms = struct.unpack_from("<BH", data, at)
            at += 3
            axes = []
            for axis in range(4):
                n = [0, 1, 3, 7][header >> 2 * axis & 3]
                values = struct.unpack_from(f"<{n}h", data, at)
                axes.append([v / 1000 + (half if v > 0 else -half if v < 0 else 0) for v in values])
                at += 2 * n
            packed += bytes(CompressedSegment(duration_ms / 1000 + 2e-4, *axes).pack())
        self.assertEqual(packed + b"\0\0\0", data)
        self.assertLessEqual(len(data), 700)

    def test_polynomials_are_cflibs(self):
        data = open(os.path.join(WORK, "NOOR.poly4d"), "rb").read()
        rows = open(os.path.join(WORK, "NOOR.csv")).read().splitlines()[1:]
        self.assertEqual(len(data), 132 * len(rows))
        self.assertLessEqual(len(rows), 31)
        packed = b""
        for row in rows:
            t, *c = [float(value) for value in row.split(",")]
            packed += Poly4D(t, *[Poly4D.Poly(c[8 * k:8 * k + 8]) for k in range(4)]).pack()
        self.assertEqual(packed, data)

    def test_a_show_is_a_zip_that_python_reads(self):
        with zipfile.ZipFile(os.path.join(WORK, "NOOR.skyc")) as archive:
            self.assertIsNone(archive.testzip())
            show = json.loads(archive.read("show.json"))
        points = show["swarm"]["drones"][0]["settings"]["trajectory"]["points"]
        self.assertTrue(all(a[0] <= b[0] for a, b in zip(points, points[1:])))
        self.assertEqual(points[-1][1][2], 0.0)


class Flights(unittest.TestCase):
    def setUp(self):
        self.script = load("NOOR.py")
        self.data = self.script.DATA

    def lights(self, cf):
        return [(t, v) for t, name, v in cf.params if name == "ring.headlightEnable"]

    def test_positions_lights_and_landing_are_sent_on_time(self):
        cf, drone, ended = flight(self.script, "position")
        self.assertIsNone(ended)
        packets = cf.packets(COMMANDER, POSITION)
        zero_s = packets[0][0] - self.data["setpoints"][0][0]
        sent = [(t - zero_s, struct.unpack("<ffff", data[1:])) for t, data in packets]
        for t, want, *_ in self.data["setpoints"]:
            near = min(sent, key=lambda s: abs(s[0] - t))
            self.assertLess(abs(near[0] - t), 0.02)
            self.assertTrue(any(max(abs(a - b) for a, b in zip(s[1], want)) < 1e-6
                                for s in sent if abs(s[0] - t) < 0.02), f"{want} at {t} s")
        gaps = [b[0] - a[0] for a, b in zip(sent, sent[1:])]
        self.assertLess(max(gaps), 0.45, "the watchdog levels the drone after 0.5 s")
        edges = [e for e in self.lights(cf) if e[0] >= packets[0][0]]
        for t, _, value, *_ in self.data["lights"]:
            self.assertTrue(any(abs(s - zero_s - t) <= 0.05 and v == value for s, v in edges), t)
        land = cf.packets(HIGH_LEVEL, LAND)
        self.assertEqual(len(land), 1)
        self.assertGreater(land[0][0], packets[-1][0])
        notify = [t for t, p, c, d in cf.sent if p == COMMANDER and c == 1]
        self.assertTrue(notify and notify[-1] <= land[0][0], "handed over before landing")
        self.assertEqual(cf.sent[-1][3][0], STOP)
        self.assertTrue(all(t > cf.begun_s for t, *_ in cf.sent), "nothing before the key")
        names = [n for t, n, v in cf.params if t < cf.begun_s]
        self.assertEqual(set(names), {"kalman.resetEstimation"}, "and no lamp")
        log = json.load(open(drone.log_file))
        self.assertIn("light.headlights", log)
        self.assertEqual(log["light.headlights"]["data"][0], 0.0)
        self.assertGreater(len(log["stateEstimate.x"]["data"]), 1000)

    def test_full_states_are_rounded_not_truncated(self):
        cf, _, _ = flight(self.script, "full_state")
        packets = cf.packets(COMMANDER, FULL_STATE)
        t, _, p, v, a = self.data["setpoints"][40]
        zero_s = packets[0][0] - self.data["setpoints"][0][0]
        near = min(packets, key=lambda s: abs(s[0] - zero_s - t))
        found = struct.unpack("<hhhhhhhhh", near[1][1:19])
        want = [1000 * value for vector in (p, v, a) for value in vector]
        self.assertTrue(all(abs(f - w) <= 0.5001 for f, w in zip(found, want)), (found, want))

    def test_a_trajectory_is_uploaded_started_and_left_by_landing(self):
        script = load("trajectory.py")
        for rate in (1.0, 84 / 85):
            cf, _, ended = flight(script, "trajectory", rate)
            self.assertIsNone(ended)
            self.assertEqual(cf.upload, open(os.path.join(WORK, "NOOR.traj"), "rb").read())
            kinds = [d[0] for t, p, c, d in cf.sent if p == HIGH_LEVEL]
            self.assertEqual(kinds[:5], [DEFINE, TAKE_OFF, GO_TO, START, LAND])
            started_s = cf.packets(HIGH_LEVEL, START)[0][0]
            start_s = script.DATA["trajectory"]["start_s"]
            edges = [e for e in self.lights(cf) if e[0] > started_s]
            for (t, _, value, *_), (sent_s, sent) in zip(script.DATA["lights"], edges):
                self.assertEqual(sent, value)
                self.assertLessEqual(abs(sent_s - started_s - (t - start_s) / rate), 0.05)

    def test_ctrl_c_at_any_time_lands_from_there(self):
        for mode, name in (("position", "NOOR.py"), ("trajectory", "trajectory.py")):
            for after_s in (1.3, 3.0, 9.0, 20.0):
                cf, _, ended = flight(load(name), mode, due=(after_s, interrupt))
                self.assertIsInstance(ended, KeyboardInterrupt)
                self.assertEqual(len(cf.packets(HIGH_LEVEL, LAND)), 1, f"{mode}, {after_s} s")
                self.assertEqual(self.lights(cf)[-1][1], 0, "dark")
                self.assertEqual(cf.sent[-1][3][0], STOP, "motors off in the end")

    def test_a_lost_link_ends_the_flight_and_keeps_the_log(self):
        cf, drone, ended = flight(self.script, "position", due=(15.0, lose))
        self.assertIsInstance(ended, self.script.LinkLost)
        self.assertLess(max(t for t, *_ in cf.sent), cf.begun_s + 15.2, "nothing more is sent")
        self.assertTrue(os.path.exists(drone.log_file))

    def test_low_battery_wrong_place_and_no_position_keep_it_on_the_floor(self):
        x, y = self.data["start_m"]
        for problem, word in (({"battery_v": 3.5}, "charge"), ({"place": (x + 1, y)}, "carry"),
                              ({"variance": 1.0}, "positioning")):
            cf, _, ended = flight(self.script, "position", **problem)
            self.assertIn(word, str(ended))
            self.assertEqual(cf.sent, [], "nothing is sent")

    def test_an_empty_battery_in_flight_lands(self):
        def empty(cf):
            cf.values["pm.vbat"] = 2.8

        cf, _, ended = flight(self.script, "position", due=(10.0, empty))
        self.assertIn("battery", str(ended))
        self.assertEqual(len(cf.packets(HIGH_LEVEL, LAND)), 1)

    def test_a_dry_run_prints_what_is_sent(self):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            paper = self.script.Paper()
            self.script.prepare(paper, "position")
            self.script.fly(paper, "position", 5, 1.0)
        lines = printed.getvalue()
        self.assertGreaterEqual(lines.count("  position("), len(self.data["setpoints"]))
        self.assertEqual(lines.count("  land("), 1)

    def test_the_launcher_finds_its_scripts(self):
        names = sorted(os.listdir(os.path.join(WORK, "fleet")))
        self.assertEqual(names, ["NOOR-1.py", "NOOR-2.py", "fly_NOOR.py"])
        launcher = load("fleet/fly_NOOR.py")
        printed = io.StringIO()
        sys.argv = ["fly_NOOR.py", "--dry-run", "--controller", "5"]
        with contextlib.redirect_stdout(printed):
            launcher.main()
        self.assertEqual(printed.getvalue().count("  land("), 2)


if __name__ == "__main__":
    unittest.main(argv=["export"])
