"""Checks exported files in a folder with cflib: see tests/export."""

import bisect
import contextlib
import csv
import io
import json
import math
import os
import re
import struct
import subprocess
import sys
import unittest
import zipfile

from cflib.crazyflie.mem.trajectory_memory import CompressedSegment, CompressedStart, Poly4D
from cflib.utils.encoding import compress_quaternion

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from drone import (COMMANDER, DEFINE, FULL_STATE, HIGH_LEVEL, LAND, PARAMS, POSITION, START,  # noqa: E402
                   STOP, Block, Clock, Radio, links, load_script)

WORK = sys.argv[1]


def load(name):
    return load_script(os.path.join(WORK, name))


def content(name):
    with open(os.path.join(WORK, name), "rb") as file:
        return file.read()


def flight(script, mode, controller=5, begun=None, **radio):
    """Prepares and flies a script with the recording drone. Returns the script, its drone and the reason of its
    end."""
    import cflib.crazyflie.log

    cflib.crazyflie.log.LogConfig = Block
    clock = Clock()
    script.time = clock
    due = radio.pop("due", None)
    radio.setdefault("place", script.DATA["start_m"])
    radio.setdefault("nose", math.degrees(script.DATA["yaw_rad"]))
    radio.setdefault("gains", script.DATA["gains"])
    cf = Radio(clock, **radio)
    log = os.path.join(WORK, f"log-{clock.__hash__()}.json")
    drone = script.Drone(cf, log)
    ended = None
    with contextlib.redirect_stdout(io.StringIO()):
        try:
            script.prepare(drone, mode)
            cf.begun_s = clock.now_s
            if begun:
                begun(cf)
            if due:
                clock.due.append((clock.now_s + due[0], lambda: due[1](cf)))
            script.fly(drone, mode, controller)
        except (script.Stopped, KeyboardInterrupt) as error:
            ended = error
    return cf, drone, ended


def interrupt(_):
    raise KeyboardInterrupt


def lose(cf):
    cf.lose()


class Bytes(unittest.TestCase):
    def test_compressed_bytes_are_cflibs_where_it_does_not_truncate(self):
        data = content("NOOR.traj")
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
        data = content("NOOR.poly4d")
        # Only the letters, without the header, take-off, path to the first letter, hover, landing
        # and end.
        rows = content("swarm/NOOR.csv").decode().splitlines()[3:-3]
        self.assertEqual(len(data), 132 * len(rows))
        self.assertLessEqual(len(rows), 31)
        packed = b""
        for row in rows:
            t, *c = [float(value) for value in row.split(",")]
            packed += Poly4D(t, *[Poly4D.Poly(c[8 * k:8 * k + 8]) for k in range(4)]).pack()
        self.assertEqual(packed, data)

    def test_a_show_keeps_skybrushs_rules_and_flies_as_in_vviz(self):
        with zipfile.ZipFile(os.path.join(WORK, "NOOR.skyc")) as archive:
            self.assertIsNone(archive.testzip())
            show = json.loads(archive.read("show.json"))
        points = show["swarm"]["drones"][0]["settings"]["trajectory"]["points"]
        # These are the requirements of TrajectorySpecification.iter_segments of skybrush-server
        # (065df0b).
        self.assertEqual(points[0][2], [])
        steps = [round(b[0] - a[0], 3) for a, b in zip(points, points[1:])]
        self.assertGreater(min(steps), 0.0)
        self.assertTrue(all(len(control) in (0, 2) for _, _, control in points))
        self.assertEqual(points[-1][1][2], 0.0)

        def place(time_s):
            """Evaluates a segment by de Casteljau's algorithm, like skybrush.js."""
            at = next(k for k, point in enumerate(points) if point[0] >= time_s)
            if at == 0:
                return points[0][1]
            (from_s, start, _), (to_s, end, control) = points[at - 1], points[at]
            share, left = (time_s - from_s) / (to_s - from_s), [start, *control, end]
            while len(left) > 1:
                left = [[(1 - share) * u + share * v for u, v in zip(p, q)]
                        for p, q in zip(left, left[1:])]
            return left[0]

        drone = json.loads(content("NOOR.vviz"))["performances"][0]
        home = drone["agentDescription"]
        at = [home["homeX"], home["homeZ"], home["homeY"]]
        colors = drone["payloadDescription"][0]["payloadActions"]
        lit = 0
        for row, (step, color) in enumerate(zip(home["agentTraversal"], colors[::2])):
            at = [a + b for a, b in zip(at, (step["dx"], step["dz"], step["dy"]))]
            # Only letters are compared, because transits are cubic in a show but of degree 7 in the
            # firmware.
            if color["r"] > 0:
                lit += 1
                self.assertLess(math.dist(place(row / 10), at), 0.001, row)
        self.assertGreater(lit, 100)


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
        self.assertGreaterEqual(land[0][0], packets[-1][0])
        notify = [t for t, p, c, d in cf.sent if p == COMMANDER and c == 1]
        self.assertTrue(notify and 0.02 <= notify[0] - land[0][0] < 0.45,
                        "it lands before setpoints are over: no null setpoint comes in between")
        self.assertEqual(cf.sent[-1][3][0], STOP)
        self.assertTrue(all(t > cf.begun_s for t, *_ in cf.sent), "nothing before the key")
        names = [n for t, n, v in cf.params if t < cf.begun_s]
        self.assertEqual(set(names), {"kalman.resetEstimation"}, "and no lamp")
        log = json.loads(content(os.path.abspath(drone.log_file)))
        self.assertIn("light.headlights", log)
        self.assertEqual(log["light.headlights"]["data"][0], 0.0)
        self.assertGreater(len(log["stateEstimate.x"]["data"]), 500)

    def test_a_heading_is_sent_in_every_mode_and_stored_in_every_trajectory(self):
        script = load("turned.py")
        self.assertEqual(script.DATA["yaw_rad"], -1.5)
        for mode in ("position", "full_state", "trajectory"):
            cf, _, ended = flight(script, mode)
            self.assertIsNone(ended)
            self.assertIn(("kalman.initialYaw", -1.5), [(n, v) for _, n, v in cf.params])
            for _, data in cf.packets(HIGH_LEVEL, LAND):
                self.assertAlmostEqual(struct.unpack_from("<f", data, 6)[0], -1.5, places=6)
            for _, data in cf.packets(COMMANDER, POSITION):
                yaw = struct.unpack("<ffff", data[1:])[3]
                self.assertAlmostEqual(yaw, math.degrees(-1.5), places=4)
            for _, data in cf.packets(COMMANDER, FULL_STATE):
                heading = struct.unpack_from("<I", data, 19)[0]
                self.assertEqual(heading, compress_quaternion([0.0, 0.0, math.sin(-0.75), math.cos(-0.75)]))
        self.assertEqual(struct.unpack_from("<h", cf.upload, 6)[0], round(math.degrees(-15.0)))
        pieces = struct.iter_unpack("<33f", content("turned.poly4d"))
        self.assertEqual({numbers[24:32] for numbers in pieces}, {(-1.5,) + (0.0,) * 7})

    def test_a_heading_on_board_flies_by_a_firmware_that_reads_it(self):
        turned, straight = load("turned.py"), load("trajectory.py")
        for firmware in ("2023.11", "2025.12.1", "2026.04", "2026.08 +12", "my own"):
            cf, _, ended = flight(turned, "trajectory", firmware=firmware)
            self.assertIn("heading on board", str(ended), firmware)
            self.assertEqual((cf.upload, cf.packets(HIGH_LEVEL, START)), (None, []), firmware)
            for script, mode in ((turned, "position"), (straight, "trajectory")):
                self.assertIsNone(flight(script, mode, firmware=firmware)[2], firmware)
        for firmware in ("2026.08", "2026.08.1", "2026.10"):
            self.assertIsNone(flight(turned, "trajectory", firmware=firmware)[2], firmware)

    def test_full_states_are_rounded_not_truncated(self):
        cf, _, _ = flight(self.script, "full_state")
        packets = cf.packets(COMMANDER, FULL_STATE)
        t, sent, v, a = self.data["setpoints"][40]
        zero_s = packets[0][0] - self.data["setpoints"][0][0]
        near = min(packets, key=lambda s: abs(s[0] - zero_s - t))
        found = struct.unpack("<hhhhhhhhh", near[1][1:19])
        want = [1000 * value for vector in (sent, v, a) for value in vector]
        self.assertTrue(all(abs(f - w) <= 0.5001 for f, w in zip(found, want)), (found, want))

    def test_a_trajectory_is_uploaded_started_and_left_by_landing(self):
        script = load("trajectory.py")
        for rate in (1.0, 84 / 85):
            firmware = "2026.08" if rate < 1.0 else "2026.08 +40"
            cf, _, ended = flight(script, "trajectory", clock_rate=rate, firmware=firmware)
            self.assertIsNone(ended)
            # The trajectory starts on the floor, and includes a landing for a drone that has lost
            # its link.
            before, after = cf.upload.split(content("NOOR.traj")[8:-3])
            self.assertEqual((len(before), after[0], after[3], after[-5:]), (56, 0, 0x30, b"\x10\0\0\0\0"))
            kinds = [d[0] for t, p, c, d in cf.sent if p == HIGH_LEVEL]
            self.assertEqual(kinds[:3], [DEFINE, START, LAND])
            self.assertGreater(cf.packets(HIGH_LEVEL, START)[0][0] - cf.begun_s, 3.0, "the link was tried")
            started_s = cf.packets(HIGH_LEVEL, START)[0][0]
            start_s = script.DATA["trajectory"]["start_s"]
            edges = [e for e in self.lights(cf) if e[0] > started_s]
            for (t, _, value, *_), (sent_s, sent) in zip(script.DATA["trajectory"]["lights"], edges):
                self.assertEqual(sent, value)
                self.assertLessEqual(abs(sent_s - started_s - (t - start_s) / rate), 0.05)

    def test_a_trajectory_rises_where_the_drone_stands_and_goes_to_the_first_letter(self):
        script, seen = load("trajectory.py"), {}
        x, y = script.DATA["start_m"]

        def look(cf):
            cf.body.move()
            seen[round(cf.clock.now_s - cf.packets(HIGH_LEVEL, START)[0][0], 2)] = list(cf.body.at)
            if len(seen) < 150:
                cf.clock.after(0.05, lambda: look(cf))

        places = []
        for place in ((x, y), (x + 0.1, y - 0.15)):
            seen.clear()
            cf, _, ended = flight(script, "trajectory", place=place, due=(3.6, look), clock_rate=1.0,
                                  firmware="2026.08 +40")
            self.assertIsNone(ended)
            up = [at for t, at in seen.items() if t <= 3.45]
            self.assertLess(max(math.dist(at[:2], place) for at in up), 6e-4, "straight up")
            self.assertGreater(up[-1][2], 0.3)
            places.append([at for t, at in seen.items() if t >= 7.0])
        self.assertLess(max(map(math.dist, *places)), 1e-9, "the same letters")

    def test_few_lights_of_the_ring_play_from_its_timing_memory(self):
        script = load("ring.py")
        timing = script.DATA["trajectory"]["timing"]
        cf, drone, ended = flight(script, "trajectory", clock_rate=1.0, firmware="2026.08 +40")
        self.assertIsNone(ended)
        self.assertEqual(cf.timings, [tuple(entry) for entry in timing["entries"]])
        started_s = cf.packets(HIGH_LEVEL, START)[0][0]
        zero_s = started_s - script.DATA["trajectory"]["start_s"]
        effects = [(t - zero_s, v) for t, n, v in cf.params if n == "ring.effect"]
        self.assertEqual([v for _, v in effects], [0, 17, 0])
        self.assertLessEqual(abs(effects[1][0] - script.DATA["trajectory"]["lights"][0][0]), 0.05)
        sent = [t for t, n, _ in cf.params if n == "ring.fadeColor" and t > started_s]
        self.assertEqual(len(sent), 1, "only in the end")
        notes = json.loads(content(os.path.abspath(drone.log_file)))["light.ring"]
        played = [(t / 1000 + 50 - zero_s, v) for t, v in zip(notes["time"], notes["data"])][1:]
        for (t, _, level, _), (found_s, found) in zip(timing["changes"], played):
            self.assertEqual(found, level)
            self.assertLessEqual(abs(found_s - t), 0.05)
        # The log has the color of each change, as the bytes of the parameter.
        log = json.loads(content(os.path.abspath(drone.log_file)))
        logged = list(zip(*(log[f"light.ring.{color}"]["data"][1:] for color in ("red", "green", "blue"))))
        self.assertGreater(max(max(color) for color in logged), 0.0)
        for (_, _, level, value), color in zip(timing["changes"], logged):
            self.assertEqual([round(255 * part) for part in color], list(value.to_bytes(4, "big")[1:]))
        # In a mode with lights over the radio, the same script sends every change.
        cf, _, _ = flight(script, "position")
        sent = [v for t, n, v in cf.params if n == "ring.fadeColor" and t > cf.begun_s]
        self.assertEqual(sent[:-1], [light[2] for light in script.DATA["lights"]])

    def test_ctrl_c_at_any_time_lands_from_there(self):
        for mode, name in (("position", "NOOR.py"), ("trajectory", "trajectory.py")):
            for after_s in (1.5, 3.0, 9.0, 20.0):  # the first setpoint is sent after 1.35 s
                after_s += 2.5 if mode == "trajectory" else 0.0
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

    def test_a_lamp_of_ones_own_is_demanded_and_goes_back_with_the_lamps(self):
        script = load("laser.py")
        _, _, ended = flight(script, "position")
        self.assertIn("laser.power", str(ended), "the firmware has no such lamp")
        PARAMS.add("laser.power")
        self.addCleanup(PARAMS.remove, "laser.power")
        gains = [*script.DATA["gains"], ["laser.power", 7]]
        cf, drone, ended = flight(script, "position", gains=gains)
        self.assertIsNone(ended)
        self.assertEqual(cf.memory_of_params["laser.power"], 0, "dark while the shutter is open")
        drone.put_back(lamps=True)
        self.assertEqual(cf.memory_of_params["laser.power"], 7)

    def test_a_dry_run_prints_what_is_sent(self):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            paper = self.script.Paper()
            self.script.prepare(paper, "position")
            self.script.fly(paper, "position", 5, 1.0)
        lines = printed.getvalue()
        self.assertGreaterEqual(lines.count("  position("), len(self.data["setpoints"]))
        self.assertEqual(lines.count("  land("), 1)

    def test_a_dry_run_may_be_cut_off(self):
        program = [sys.executable, "-u", os.path.join(WORK, "NOOR.py"), "--dry-run"]
        with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
            run.stdout.readline()
            run.stdout.close()
            self.assertEqual(run.stderr.read(), b"")

    def test_the_launcher_finds_its_scripts(self):
        names = sorted(os.listdir(os.path.join(WORK, "fleet")))
        self.assertEqual(names, ["NOOR-1.py", "NOOR-2.py", "fly_NOOR.py"])
        launcher = load("fleet/fly_NOOR.py")
        printed = io.StringIO()
        sys.argv = ["fly_NOOR.py", "--dry-run", "--controller", "5"]
        with contextlib.redirect_stdout(printed):
            launcher.main()
        self.assertEqual(printed.getvalue().count("  land("), 2)


class Main(unittest.TestCase):
    """Tests the start of scripts up to the key press."""

    def start(self, name, key):
        """Runs a script's main. Returns the radios and the printed text. `key` is the key press."""
        import cflib.crazyflie.log
        import cflib.crazyflie.syncCrazyflie
        import cflib.crtp

        cflib.crazyflie.log.LogConfig = Block
        script, clock, radios = load(name), Clock(), []
        parts = [load("fleet/" + part) for part in getattr(script, "SCRIPTS", [])] or [script]
        script.load = lambda part: parts[script.SCRIPTS.index(part)]
        for part in parts:
            part.time = clock

        def pressed(prompt):
            if "Enter to restore the lamps" in prompt:
                return ""
            self.assertIn("Press Enter to take off", prompt)
            for radio in radios:
                self.assertEqual(radio.sent, [], "nothing is sent before the key")
                names = {name for _, name, _ in radio.params}
                self.assertEqual(names, {"kalman.resetEstimation"}, "and no lamp")
            return key()

        cflib.crtp.init_drivers = lambda: None
        cflib.crazyflie.syncCrazyflie.SyncCrazyflie = links(parts, clock, radios)
        script.input = pressed
        sys.argv = [name, "--controller", "5"]
        if len(parts) == 1:
            sys.argv += ["--log", os.path.join(WORK, "main.json")]
        with contextlib.redirect_stdout(io.StringIO()), self.assertRaises(SystemExit) as ended:
            script.main()
            raise SystemExit("flown")
        return radios, str(ended.exception)

    def test_nothing_is_sent_without_the_key(self):
        def refuse():
            raise KeyboardInterrupt

        radios, ended = self.start("NOOR.py", refuse)
        self.assertEqual((radios[0].sent, ended), ([], "stopped by Ctrl-C"))
        radios, ended = self.start("NOOR.py", lambda: "")
        self.assertEqual(ended, "flown")
        self.assertEqual(len(radios[0].packets(HIGH_LEVEL, LAND)), 1)

    def test_several_drones_wait_for_one_key(self):
        def refuse():
            raise SystemExit("no key")

        radios, ended = self.start("fleet/fly_NOOR.py", refuse)
        self.assertEqual((len(radios), ended), (2, "no key"))
        self.assertEqual([radio.sent for radio in radios], [[], []])


def noctograph(*arguments):
    """Runs the program in the work folder, and returns its JSON."""
    program = [os.environ["NOCTOGRAPH"], *arguments, "--json"]
    run = subprocess.run(program, cwd=WORK, capture_output=True, text=True, check=False)
    if run.returncode > 1:
        raise AssertionError(f"{arguments}: {run.stderr}")
    return json.loads(run.stdout)


def table(name):
    with open(os.path.join(WORK, name), encoding="utf-8") as file:
        return list(csv.DictReader(file))


class Flown(dict):
    """Provides the firmware's variables of a simulated flight, on the clock of a script with the stub."""

    SCALE = {"yaw": 57.29577951308232, "pitch": -57.29577951308232, "roll": 57.29577951308232}

    def __init__(self, path, radio):
        self.rows, self.radio = table(path), radio
        self.times = [float(row["time_s"]) for row in self.rows]

    def get(self, name, default=0.0):
        time_s = self.radio.clock.now_s - self.radio.begun_s - 1.0
        row = self.rows[max(bisect.bisect_right(self.times, time_s + 1e-9) - 1, 0)]
        group, variable = name.split(".")
        if group == "stateEstimate" and variable in "xyz":
            return float(row[f"{variable}_m"])
        if group == "stateEstimate" and variable in self.SCALE:
            return self.SCALE[variable] * float(row[f"{variable}_rad"])
        if group == "ctrltarget":
            return float(row[f"{variable}_design_m"])
        if group == "motor":
            return round(float(row[variable]))
        return {"pm.vbat": 4.0}.get(name, default)


def dry_run(script):
    """Returns the output of a dry run of a script as rows of a plan: (time in s, (x, y, z), light)."""
    program = [sys.executable, os.path.join(WORK, script), "--dry-run"]
    lines = subprocess.run(program, capture_output=True, text=True, check=True).stdout.splitlines()
    (x, y), lit, rows = load(script).DATA["start_m"], 0.0, []
    place = (x, y, 0.0)
    rows.append((0.0, place, lit))
    for line in lines:
        time_s, command, values = re.match(r"\s*(\S+) s  (\w+)\((.*)\)", line).groups()
        time_s = float(time_s) - 1.0  # the second in which it arms
        if command == "position":
            place = tuple(float(value) for value in values.split(", "))
        elif command == "light":
            lit = float(values.split(", ")[3])
        elif command == "land":
            place = (place[0], place[1], 0.0)
        else:
            continue
        rows.append((time_s, place, lit))
    # Of several commands at the same time, the last one takes effect.
    return sorted(dict((row[0], row) for row in rows).values())


class RoundTrip(unittest.TestCase):
    """Tests the round trip from the design to the photo: the simulator flies what the script sends, the script
    records this flight, and its log gives the same photo."""

    SCENE = ["--scene", "pid", "--style", "even", "--set", "plan.style.exposure=switched"]

    def test_the_log_of_the_script_makes_the_same_photo(self):
        plan = ["NO", *self.SCENE]
        noctograph("preview", *plan, "-o", "designed", "--size", "640x360")
        noctograph("export", *plan, "--to", "cflib", "-o", "NO.py")
        with open(os.path.join(WORK, "sent.csv"), "w", encoding="utf-8") as file:
            motion = [f"{q}{axis}_m_{unit}" for q, unit in (("v", "s"), ("a", "s2")) for axis in "xyz"]
            file.write(f"time_s,x_m,y_m,z_m,{','.join(motion)},letter,light.headlights\n")
            rows = table("designed/plan.csv")
            times = [float(row["time_s"]) - 0.0005 for row in rows]
            for time_s, (x, y, z), lit in dry_run("NO.py"):
                letter = rows[bisect.bisect(times, time_s) - 1]["letter"]
                file.write(f"{time_s:.3f},{x},{y},{z},0,0,0,0,0,0,{letter},{lit}\n")
        noctograph("fly", "sent.csv", "--scene", "pid", "-o", "sent_flight.csv")

        def fed(cf):
            cf.values = Flown("sent_flight.csv", cf)

        cf, drone, ended = flight(load("NO.py"), "position", controller=1, begun=fed)
        self.assertIsNone(ended)
        log = os.path.basename(drone.log_file)
        noctograph("import", log, "--word", "NO", "-o", "imported.csv")
        with open(drone.log_file, encoding="utf-8") as file:
            first_s = json.load(file)["stateEstimate.x"]["time"][0] / 1000
        offset_s = first_s + 50.0 - cf.begun_s - 1.0  # the stub stamps from 50 s on
        compared = noctograph("compare", "sent_flight.csv", "imported.csv",
                              "--offset", f"{offset_s:.4f}")
        self.assertLess(compared["max_m"], 0.002, "the log against the flight")
        off_m = self.apart_in_letters("designed/flight.csv", "imported.csv", offset_s)
        self.assertGreater(len(off_m), 1000)
        self.assertLess(max(off_m), 0.002, "the log against the flight of the design")

        picture = ["--word", "NO", "--scene", "pid", "--size", "640x360", "-o", "log.png"]
        noctograph("expose", "imported.csv", *picture)
        verdicts = [noctograph("score", photo, "NO") for photo in ("designed/photo.png", "log.png")]
        self.assertEqual(*[(verdict["read"], verdict["legible"]) for verdict in verdicts])
        apart = abs(verdicts[0]["readability"] - verdicts[1]["readability"])
        self.assertLess(apart, 0.03, "readability")

        noctograph("plan", "NO", "--scene", "pid", "--set", "plan.style.kind=even",
                   "--after", "imported.csv", "-o", "corrected.csv")
        sent, corrected = table("designed/plan.csv"), table("corrected.csv")
        moved = [math.dist([float(row[a]) for a in axes], [float(old[a]) for a in axes])
                 for axes in [("x_sent_m", "z_sent_m")] for old, row in zip(sent, corrected)]
        self.assertEqual(len(sent), len(corrected))
        self.assertTrue(0.0001 < max(moved) < 0.2, f"corrected by up to {max(moved)} m")

    def apart_in_letters(self, designed, logged, offset_s):
        """Returns the distances of a log from a flight at the flight's samples of letters, in m."""
        axes, rows = ("x_m", "y_m", "z_m"), table(logged)
        times = [float(row["time_s"]) + offset_s for row in rows]
        off_m = []
        for row in table(designed):
            time_s = float(row["time_s"])
            at = bisect.bisect(times, time_s)
            if row["letter"] != "0" and 0 < at < len(times):
                share = (time_s - times[at - 1]) / (times[at] - times[at - 1])
                there = [(1 - share) * float(rows[at - 1][axis]) + share * float(rows[at][axis])
                         for axis in axes]
                off_m.append(math.dist(there, [float(row[axis]) for axis in axes]))
        return off_m


class SecondFlight(unittest.TestCase):
    """Tests the documented steps from a room to the second flight (docs/tutorials/first-flight.md and
    docs/how-to/log-to-photo.md), with each flight on the double."""

    def flown(self, script, simulated):
        """Returns the log of a script's flight with the double, which follows a simulated flight."""
        script = load(script)

        def fed(cf):
            cf.values = Flown(simulated, cf)

        cf, drone, ended = flight(script, "position", controller=1, begun=fed)
        self.assertIsNone(ended)
        low, high = script.LIMITS["fence_m"]
        sent = [struct.unpack("<ffff", data[1:])[:3] for _, data in cf.packets(COMMANDER, POSITION)]
        self.assertGreater(len(sent), 300)
        for place in sent:
            self.assertTrue(all(a < b < c for a, b, c in zip(low, place, high)), f"sent to {place}")
        return os.path.basename(drone.log_file), [low, high]

    def test_the_second_flight_is_legible_and_in_the_room_of_the_first(self):
        room = ["--room", "4x6x2.5"]
        noctograph("preview", "HI", *room, "--seed", "41", "--size", "640x360", "-o", "first")
        noctograph("export", "HI", *room, "--to", "cflib", "-o", "HI.py")
        log, fence = self.flown("HI.py", "first/flight.csv")
        self.assertEqual(fence[1], [1.9, 2.6, 2.4])
        photo = ["--size", "640x360", "-o", "flown.png"]
        noctograph("expose", log, *photo)
        self.assertTrue(noctograph("score", "flown.png")["legible"], "the first flight")

        noctograph("plan", "HI", "--after", log, "-o", "HI2.csv")
        self.assertTrue(noctograph("check", "HI2.csv")["fly"])
        noctograph("export", "HI2.csv", "--to", "cflib", "-o", "HI2.py")
        noctograph("preview", "HI2.csv", "--seed", "41", "--size", "640x360", "-o", "second")
        log, again = self.flown("HI2.py", "second/flight.csv")
        self.assertEqual(again, fence)
        noctograph("expose", log, *photo)
        self.assertTrue(noctograph("score", "flown.png")["legible"], "the second flight")


class Killed(unittest.TestCase):
    def test_a_killed_export_leaves_a_whole_file_or_none(self):
        program = [os.environ["NOCTOGRAPH"], "export", "NOOR", "--style", "even", "--to", "cflib"]
        for out in ("whole.py", "killed.py"):
            for delay_s in [10.0] if out == "whole.py" else [0.02 * k for k in range(1, 16)]:
                path = os.path.join(WORK, out)
                run = subprocess.Popen([*program, "-o", out], cwd=WORK, stdout=subprocess.DEVNULL)
                try:
                    run.wait(delay_s)
                except subprocess.TimeoutExpired:
                    run.kill()
                    run.wait()
                if os.path.exists(path):
                    self.assertEqual(content(out), content("whole.py"), f"killed at {delay_s} s")
                    if out == "killed.py":
                        os.remove(path)


if __name__ == "__main__":
    unittest.main(argv=["export"])
