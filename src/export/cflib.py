#!/usr/bin/env python3
"""Writes a word with light: flies a Crazyflie, switches its lights and records the flight.

Made by noctograph. Needs Python 3.9 and cflib @CFLIB@ or newer: pip install cflib
    python3 SCRIPT --dry-run           prints everything that would be sent, without a radio
    python3 SCRIPT --check-geometry    compares the drone's positions at the corners of the canvas
    python3 SCRIPT --uri radio://0/80/2M/E7E7E7E7E7

Place the drone at the start of the plan, with its nose along the world's x axis, or turned to the left
by the angle in the table that the script prints. Switch the positioning system on. Its origin is the
middle of the floor of the room in which the flight was checked. Before you press Enter, the script
reads what is connected, resets the position estimate, uploads the trajectory and the lights, and shows
a table of measured and required values. It continues only if all of them are right. Ctrl-C, a closed
window and `kill` land the drone where it is. A second Ctrl-C, at least half a second later, stops the
motors. If anything fails in the air, the script lands the drone first.
"""

import argparse
import collections
import contextlib
import datetime
import json
import logging
import math
import os
import re
import signal
import struct
import sys
import tempfile
import threading
import time

TAKE_OFF_S = 3.5  # of a trajectory
TRIAL_S = 3.0  # a trajectory is flown to its end whatever becomes of the link: it is tried first
SINK_M_S = 0.3
RESEND_S = 0.1  # the firmware levels the drone after 0.5 s without a setpoint
SETTLE_S = 10.0  # for the position estimate
ANSWER_S = 1.0  # for anything that the drone is asked
SILENT_S = 1.0  # without a packet of a log block: the script lands
HEARD_S = 0.1  # a packet this long after a command came from a drone that has heard the command
RECONNECT_S = 20.0  # for a new link
WATCHDOG_S = 2.0  # without a setpoint: the firmware stops the motors
PRESS_S = 0.5  # a key that bounces or is hit twice in fright is pressed once
LIFTED_M, DOWN_M = 0.1, 0.3  # above the one it has taken off, below the other it has landed
TAKE_OVER_S = 0.05  # in which the drone has begun to land, before it stops to wait for setpoints
CONNECT_S = 60.0  # for all parameters, without a cache of their names
LOG_PERIOD_MS, WATCH_PERIOD_MS = 20, 100
KEEP_S, KEEPS_A_SYNC = 0.1, 10  # between two writes of the samples, and writes to each that reaches the disk
WAITING_ROWS = 30000  # for a disk that hangs: about two minutes
END_S = 3.0  # for the disk to take the last samples
RING_TIMING = 17  # ring.effect that plays the LED timing memory from its beginning
VERSION_CHANNEL, ASK_FIRMWARE, ASK_PLATFORM = 1, 1, 2  # of the platform port
# Bits of supervisor.info.
CAN_BE_ARMED, CAN_FLY, FLYING = 0, 3, 4
FAULTS = {5: "tumbled", 6: "locked", 7: "crashed", 11: "a deck's fault"}

# What noctograph's import and compare read, by type. A block has 26 bytes at most.
LOG = @LOG@
# The observer of the AE483 course, if the firmware has it.
OPTIONAL = @OPTIONAL@
# What the script judges by, on the ground and in the air.
WATCH = @WATCH@


class Stopped(Exception):
    """The flight ends early. The text is the reason."""


class LinkLost(Stopped):
    """Nothing can be sent anymore."""


class Flag(set):
    """What a signal may set at any moment: an Event has a lock that the interrupted line may hold."""

    def set(self):
        self.add(True)

    def is_set(self):
        return bool(self)


class Diary:
    """Keeps samples in a file as they come, a line each, from a thread of its own: a disk that hangs or
    is full changes nothing in the air. A computer that crashes loses the last second."""

    def __init__(self, log_file, about):
        self.log_file, self.path, self.why = log_file, None, ""
        self.rows, self.over = collections.deque([{"noctograph": dict(about)}]), threading.Event()
        self.thread = threading.Thread(target=self._keep, daemon=True)
        self.thread.start()

    def add(self, row):
        if len(self.rows) < WAITING_ROWS:
            self.rows.append(row)
        else:
            self.why = self.why or "the disk hangs"

    def end(self):
        """Ends the file. Returns why it is not whole, or nothing."""
        self.rows.append({"end": True})
        self.over.set()
        self.thread.join(END_S)
        if self.thread.is_alive():
            self.why = self.why or "the disk hangs"
        return self.why

    def _keep(self):
        try:
            with self._opened() as file:
                self._write(file)  # the head, by which the log is known
                is_over = False
                while not is_over:
                    for _ in range(KEEPS_A_SYNC):
                        is_over = is_over or self.over.wait(KEEP_S)
                        self._write(file)
                    os.fsync(file.fileno())
        except Exception as error:
            self.why = self.why or str(error)

    def _opened(self):
        """A new file, whose name the log will have that is written at the end."""
        stem, ending = os.path.splitext(self.log_file)
        name, number = stem, 2
        while True:
            with contextlib.suppress(FileExistsError):
                if not os.path.exists(name + ending):
                    file = open(name + ".jsonl", "xb", buffering=0)
                    self.log_file, self.path = name + ending, file.name
                    return file
            name, number = f"{stem}-{number}", number + 1

    def _write(self, file):
        lines = [json.dumps(self.rows.popleft()) + "\n" for _ in range(len(self.rows))]
        left = "".join(lines).encode()
        while left:
            left = left[file.write(left):]


class Paper:
    """Stands in for a drone in a dry run: prints what would be sent, and takes no time."""

    now_s, lifted_s, found_again, columns, about = 0.0, None, False, {}, {}

    def __init__(self):
        self.lost, self.may_fly = Flag(), False

    def clock(self):
        return self.now_s

    def wait_until(self, time_s, watching=True):
        self.now_s = max(self.now_s, time_s)

    def stays_heard(self, seconds):
        self.wait_until(self.now_s + seconds)
        return True

    def silent(self):
        return ""

    faults = silent

    def is_down(self):
        return True

    def __getattr__(self, command):
        if command.startswith("_"):
            raise AttributeError(command)

        def send(*values):
            text = ", ".join(f"{v:.6g}" if isinstance(v, float) else str(v) for v in values)
            print(f"{self.now_s:9.3f} s  {command}({text})")

        return send


class Drone:
    """A Crazyflie on the radio."""

    def __init__(self, cf, log_file, connect=None):
        self.cf, self.log_file, self.connect = cf, log_file, connect
        self.columns, self.blocks, self.changed, self.diary = {}, [], {}, None
        self.about = {"word": DATA["word"], "uri": DATA["uri"], **DATA["origin"]}
        self.latest, self.heard_s, self.wrong_since_s = {}, {}, {}
        self.lifted_s = None  # when the first command that lifts it was sent
        self.landing_s = None  # when the last landing was sent
        self.highest_m = -math.inf  # since the first command that lifts it
        self.heard_last_s = -math.inf
        self.may_fly = False
        self.stamp_ms, self.stamped_s = None, 0.0
        self.stopped, self.why = Flag(), "stopped by Ctrl-C"
        self.killed = Flag()  # a second Ctrl-C
        self.lost, self.found_again = Flag(), False
        self._listen()

    def _listen(self):
        self.cf.disconnected.add_callback(lambda uri: self.lost.set())
        self.cf.connection_lost.add_callback(lambda uri, message: self.lost.set())

    # Time

    def clock(self):
        return time.monotonic()

    def wait_until(self, time_s, watching=True):
        while True:
            if self.killed.is_set():
                raise KeyboardInterrupt
            if self.lost.is_set():
                raise LinkLost("the radio link was lost")
            if watching and self.stopped.is_set():
                raise Stopped(self.why)
            if watching:
                self._watch()
            left_s = time_s - self.clock()
            if left_s <= 0.0:
                return
            time.sleep(min(left_s, 0.05))

    def wait_for(self, condition, seconds):
        """Waits for a condition. Returns True if it came true."""
        end_s = self.clock() + seconds
        while not condition():
            if self.clock() >= end_s:
                return False
            self.wait_until(self.clock() + 0.05, watching=False)
        return True

    def heard(self, sent_s):
        """True if the drone has heard what was sent until then: its packets are answers to ours."""
        return self.heard_last_s > sent_s + HEARD_S

    def hears(self, sent_s):
        """True if it hears what was just sent."""
        with contextlib.suppress(LinkLost):
            return self.wait_for(lambda: self.heard(sent_s), 4 * HEARD_S)
        return False

    def stays_heard(self, seconds):
        """Waits. Returns True if the drone's packets came to the end."""
        least_s = self.clock() + 2 * HEARD_S
        with contextlib.suppress(LinkLost):
            return not self.wait_for(
                lambda: self.clock() > max(least_s, self.heard_last_s + SILENT_S), seconds)
        return False

    # Commands

    def position(self, x, y, z):
        self.cf.commander.send_position_setpoint(x, y, z, math.degrees(DATA["yaw_rad"]))

    def full_state(self, position, velocity, acceleration):
        # cflib truncates to millimeters. A quarter of one makes that rounding.
        rounded = [[(round(1000 * v) + math.copysign(0.25, v)) / 1000 for v in vector]
                   for vector in (position, velocity, acceleration)]
        half_yaw = DATA["yaw_rad"] / 2
        heading = [0.0, 0.0, math.sin(half_yaw), math.cos(half_yaw)]
        self.cf.commander.send_full_state_setpoint(*rounded, heading, 0.0, 0.0, 0.0)

    def upload(self, data):
        """Loads the trajectory, which takes off from the place of the drone."""
        from cflib.crazyflie.mem import MemoryElement

        data = bytearray.fromhex(data)
        for axis, places in zip("xy", DATA["trajectory"]["start_bytes"]):
            for place in places:
                struct.pack_into("<h", data, place, round(1000 * self.latest[f"stateEstimate.{axis}"]))

        class Raw:
            def pack(self):
                return data

        memory = self.cf.mem.get_mems(MemoryElement.TYPE_TRAJ)[0]
        memory.trajectory = [Raw()]
        if not memory.write_data_sync():
            raise Stopped("the trajectory could not be uploaded")
        # The number of pieces is not read of a compressed trajectory.
        self.cf.high_level_commander.define_trajectory(1, 0, 1, type=1)

    def upload_lights(self, entries):
        from cflib.crazyflie.mem import MemoryElement

        memories = self.cf.mem.get_mems(MemoryElement.TYPE_DRIVER_LEDTIMING)
        if not memories:
            raise Stopped("this drone has no LED-ring deck")
        written = threading.Event()
        memories[0].timings = []
        for duration, r, g, b in entries:
            memories[0].add(duration, {"r": r, "g": g, "b": b})
        memories[0].write_data(lambda memory, address: written.set())
        if not self.wait_for(written.is_set, SETTLE_S):
            raise Stopped("the lights could not be uploaded")

    def start_trajectory(self):
        self.cf.high_level_commander.start_trajectory(1, 1.0)

    def arm(self, armed=True):
        # cflib before 0.1.32 has no supervisor.
        (getattr(self.cf, "supervisor", None) or self.cf.platform).send_arming_request(armed)

    def can_fly(self):
        return self.has(CAN_FLY, True)

    def hand_over(self):
        """Lets the commander on board, which lands already, take over from the setpoints."""
        self.cf.commander.send_notify_setpoint_stop()

    def land(self, duration_s):
        self.cf.high_level_commander.land(0.0, duration_s, yaw=DATA["yaw_rad"])

    def is_down(self):
        """True if a drone that heard the landing is down. One that reports no height anymore is."""
        return self.latest.get("stateEstimate.z", math.inf) < DOWN_M or "where" in self.silent()

    def was_up(self):
        """True if it was last heard above the floor."""
        return self.latest.get("stateEstimate.z", 0.0) > DOWN_M

    def stop(self):
        self.cf.high_level_commander.stop()
        self.cf.commander.send_stop_setpoint()

    def give_up(self):
        """Ends a link as cflib ends a lost one: `close_link` would send a setpoint without thrust."""
        if not self.lost.is_set():
            self.cf._link_error_cb("silent")

    def reconnect(self):
        """A new link to a drone that may be in the air by itself."""
        self.give_up()
        end_s, link = self.clock() + RECONNECT_S, None
        while link is None:
            if self.killed.is_set():
                raise KeyboardInterrupt
            try:
                link = self.connect(False)
            except Exception as error:
                if self.clock() > end_s:
                    raise LinkLost(f"no new link within {RECONNECT_S:.0f} s: {error}") from None
                time.sleep(0.2)
        self.cf = link
        self.blocks.clear()
        self.heard_s.clear()
        self.latest.clear()
        self.lost.clear()
        self.found_again = True
        self._listen()

    # Parameters and lamps

    def value(self, name):
        """A parameter's value on the drone. None if it is unknown."""
        found = self.cf.param.get_value(name)
        return None if found is None else float(found)

    def param(self, name, value):
        """Sets what is not so already, and keeps what it was."""
        found = self.value(name)
        if not same(found, value):
            self.changed.setdefault(name, found)
            self.cf.param.set_value(name, value)

    def light(self, name, value, channel, level):
        self.cf.param.set_value(name, value)
        self._note(channel, level, value)

    def lit(self, channel, level, value):
        """A light that changes by the timing memory on board: nothing is sent."""
        self._note(channel, level, value)

    def set(self, values):
        """Sets parameters before the flight, and reads them back."""
        for name, value in values:
            self.param(name, value)

        if not self.wait_for(lambda: self.has_all(values), SETTLE_S):
            raise Stopped("parameters could not be set")

    def has_all(self, values):
        """True if parameters are as they were set. Unknown ones count as set."""
        found = [(self.value(name), value) for name, value in values]
        return all(value is None or same(value, wanted) for value, wanted in found)

    def put_back(self, lamps):
        """Puts back what was changed, the lamps or all else, and waits until the drone has it. What
        may be in the air keeps its controller, and cflib would wait for the names of a new link."""
        if self.lost.is_set() or self.may_fly or not self.cf.param.is_updated:
            return
        values = [(name, value) for name, value in reversed(list(self.changed.items())) if
                  (name in DATA["lamps"]) == lamps and value is not None]
        for name, value in values:
            attempt(f"restoring {name}", self.cf.param.set_value, name, value)
            del self.changed[name]
        attempt("waiting for the restored parameters", self.wait_for, lambda: self.has_all(values), ANSWER_S)

    # What is connected

    def ask(self, question):
        """A text from the drone's version port. None if it does not answer."""
        from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

        answers = []

        def received(packet):
            data = bytes(packet.data)
            if packet.channel == VERSION_CHANNEL and data[0] == question:
                answers.append(data[1:].split(b"\0")[0].decode("ascii", "replace"))

        self.cf.add_port_callback(CRTPPort.PLATFORM, received)
        for _ in range(3):
            packet = CRTPPacket()
            packet.set_header(CRTPPort.PLATFORM, VERSION_CHANNEL)
            packet.data = (question,)
            self.cf.send_packet(packet)
            if self.wait_for(lambda: answers, ANSWER_S):
                break
        self.cf.remove_port_callback(CRTPPort.PLATFORM, received)
        return answers[0] if answers else None

    def identify(self):
        """Reads platform, firmware and serial number into the log."""
        self.about["platform"] = self.ask(ASK_PLATFORM)
        self.about["firmware"] = self.ask(ASK_FIRMWARE)
        parts = [f"cpu.id{k}" for k in range(3)]
        if all(map(self.knows_param, parts)):
            self.about["serial"] = "".join(f"{int(self.value(part)):08x}" for part in parts)

    def knows_param(self, name):
        return self.cf.param.toc.get_element_by_complete_name(name) is not None

    def knows_log(self, name):
        return self.cf.log.toc.get_element_by_complete_name(name) is not None

    def reset_estimate(self):
        """Starts the position estimate anew, from the plan's heading."""
        self.param("kalman.initialYaw", DATA["yaw_rad"])
        self.cf.param.set_value("kalman.resetEstimation", 1)
        self.wait_until(self.clock() + 0.1)
        self.cf.param.set_value("kalman.resetEstimation", 0)
        self.wait_until(self.clock() + 2.0)

    def start_watch(self):
        for name, variables in WATCH.items():
            self.blocks.append(self._block(name, WATCH_PERIOD_MS, variables, self._heard))

    def watch(self):
        """Begins to read what the script judges by, and waits until the estimate has settled."""
        self.start_watch()
        self.wait_for(lambda: self.sigma_m() < math.sqrt(LIMITS["variance_m2"]), SETTLE_S)

    def sigma_m(self):
        """Standard deviation of the worst coordinate. None if it is not a number."""
        names = ("kalman.varPX", "kalman.varPY", "kalman.varPZ")
        return math.sqrt(max(known(self.latest.get(name, 1e4)) for name in names))

    # Log

    def log(self):
        self.diary = Diary(self.log_file, self.about)
        optional = {name: vs for name, vs in OPTIONAL.items() if all(map(self.knows_log, vs))}
        for name, variables in {**LOG, **optional}.items():
            self.blocks.append(self._block(name, LOG_PERIOD_MS, variables, self._row))

    def _block(self, name, period_ms, variables, received):
        from cflib.crazyflie.log import LogConfig

        block = LogConfig(name=name, period_in_ms=period_ms)
        for variable, kind in variables.items():
            block.add_variable(variable, kind)
        block.data_received_cb.add_callback(received)
        self.cf.log.add_config(block)
        block.start()
        if name not in OPTIONAL:
            self.heard_s[name] = self.clock()
        return block

    def _heard(self, stamp_ms, values, block):
        self.latest.update(values)
        self.highest_m = max(self.highest_m, values.get("stateEstimate.z", -math.inf))
        self.heard_last_s = self.clock()
        if block.name in self.heard_s:
            self.heard_s[block.name] = self.clock()

    def silent(self):
        """The log blocks without a packet for too long, in words. Empty if all came."""
        now_s = self.clock()
        return ", ".join(name for name, heard_s in self.heard_s.items() if now_s - heard_s > SILENT_S)

    def _row(self, stamp_ms, values, block):
        if self.stamp_ms is None:
            self.stamp_ms = stamp_ms
            for channel in DATA["channels"]:
                self._note(channel, 0.0, 0, stamp_ms)
        self.stamp_ms, self.stamped_s = stamp_ms, self.clock()
        self._heard(stamp_ms, values, block)
        self._add(stamp_ms, values)

    def _note(self, channel, level, value, stamp_ms=None):
        """Keeps a light command and its color in the log, on the drone's clock."""
        if stamp_ms is None and self.stamp_ms is not None:
            stamp_ms = round(self.stamp_ms + 1000 * (self.clock() - self.stamped_s))
        if stamp_ms is not None:
            colors = DATA["colors"].get(channel, [])
            parts = value.to_bytes(4, "big")[4 - len(colors):]
            self._add(stamp_ms, {f"light.{channel}": level, **{
                f"light.{color}": round(part / 255 / level, 4) if level else 0.0
                for color, part in zip(colors, parts)}})

    def _add(self, stamp_ms, values):
        for name, value in values.items():
            column = self.columns.setdefault(name, {"time": [], "data": []})
            column["time"].append(stamp_ms)
            column["data"].append(value)
        if self.diary:
            self.diary.add({"time": stamp_ms, **values})

    def finish(self):
        """Ends the log and writes its file, elsewhere if it cannot be written here."""
        for block in self.blocks:
            if not self.lost.is_set():
                attempt("ending a log block", block.stop)
        diary, self.diary = self.diary, None
        why = diary.end() if diary else ""
        if why:
            say(f"the samples could not be stored during the flight: {why}")
        log_file = diary.log_file if diary else self.log_file
        hangs = diary and diary.thread.is_alive()
        if hangs or not attempt("writing the log", self._write, log_file):
            elsewhere = os.path.join(tempfile.gettempdir(), os.path.basename(log_file))
            if not attempt("writing the log to another folder", self._write, elsewhere):
                say(f"log: {diary.path}" if diary and not why else "the log of this flight is lost")

    def _write(self, log_file):
        """Writes the log under another name first: its own is that of a whole file."""
        stem, ending = os.path.splitext(log_file)
        path, number = log_file, 2
        while os.path.exists(path):
            path, number = f"{stem}-{number}{ending}", number + 1
        try:
            with open(path + ".part", "w", encoding="utf-8") as file:
                json.dump({"noctograph": self.about, **self.columns}, file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(path + ".part", path)
        except BaseException:
            with contextlib.suppress(OSError):
                os.remove(path + ".part")
            raise
        say(f"log: {path}")

    # What ends a flight early

    def has(self, bit, unknown=False):
        """True if the supervisor sets a bit."""
        info = self.latest.get("supervisor.info")
        return unknown if info is None else bool(int(info) >> bit & 1)

    def faults(self):
        """Why the firmware has stopped the motors. Empty if it has not."""
        return ", ".join(name for bit, name in FAULTS.items() if self.has(bit))

    def _watch(self):
        """Raises Stopped for what is wrong in the air for too long."""
        if "motor.m1" not in self.latest:
            return  # the log of the flight has not begun
        read, now_s = self.latest.get, self.clock()
        judged = [read(name, 0.0) for block in (*WATCH.values(), LOG["target"]) for name in block]
        place = [read(f"stateEstimate.{axis}", 0.0) for axis in "xyz"]
        target = [read(f"ctrltarget.{axis}", 0.0) for axis in "xyz"]
        low, high = LIMITS["fence_m"]
        falls = "" if self.lifted_s is None else ": it falls"
        lasting = [  # what is wrong, whether it is, for how long it may be
            (f"the firmware has stopped the motors, {self.faults()}{falls}", bool(self.faults()), 0.0),
            ("the drone does not send log data: " + self.silent(), bool(self.silent()), 0.0),
            ("the drone reports a value that is not a number", not all(map(math.isfinite, judged)),
             LIMITS["wrong_s"]),
            ("the battery is empty", read("pm.vbat", 9.0) < LIMITS["critical_v"], LIMITS["wrong_s"]),
            ("the battery is low", read("pm.vbat", 9.0) < LIMITS["low_v"], LIMITS["low_s"]),
            ("the position is lost", self.sigma_m() ** 2 > LIMITS["lost_m2"], LIMITS["wrong_s"]),
            ("the drone is outside its fence",
             any(p < a or p > b for p, a, b in zip(place, low, high)), LIMITS["wrong_s"]),
            ("the drone is far from its target", self.lifted_s is not None
             and now_s - self.lifted_s > 1.0 and math.dist(place, target) > LIMITS["stray_m"],
             LIMITS["wrong_s"]),
        ]
        for what, is_wrong, most_s in lasting:
            since_s = self.wrong_since_s.setdefault(what, now_s) if is_wrong else None
            if not is_wrong:
                self.wrong_since_s.pop(what, None)
            elif now_s - since_s >= most_s:
                raise Stopped(what)


# Help


def say(text):
    """Prints, even to a window that is closed."""
    with contextlib.suppress(OSError, ValueError):
        print(text, flush=True)


def attempt(what, action, *values, times=1):
    """Does what must not keep the next step from being taken. Returns True if it was done."""
    for _ in range(times):
        try:
            action(*values)
            return True
        except Exception as error:
            say(f"{what} failed: {error!r}")
    return False


def known(value):
    """A value, and infinity in place of what is no number: no limit is above it."""
    return value if math.isfinite(value) else math.inf


def same(found, wanted):
    """True if a parameter has a value, in the 32 bits of the firmware."""
    return found is not None and math.isclose(found, wanted, rel_tol=1e-6, abs_tol=1e-9)


def table(rows):
    """Rows of text as aligned columns."""
    widths = [max(len(str(row[k])) for row in rows) for k in range(len(rows[0]))]
    return "\n".join("  ".join(str(v).ljust(w) for v, w in zip(row, widths)).rstrip()
                     for row in rows)


# What is connected, beside what was checked


def release(firmware):
    """Year and month of a release. None for a build between releases or a custom one."""
    found = re.fullmatch(r"(\d{4})\.(\d{2})(?:\.\d+)?", firmware or "")
    return found and (int(found[1]), int(found[2]))


def known_clock(firmware):
    """Rate of the clock on board that paces trajectories. None if it is to be measured."""
    number = release(firmware)
    return LIMITS["slow_clock"] if number and number <= release(LIMITS["slow_release"]) else None


def gains_apart(drone, controller):
    """Gains that the drone has otherwise than they were checked: name, found, wanted."""
    if controller != DATA["controller"]:
        return []
    found = [(name, drone.value(name), wanted)
             for name, wanted in DATA["gains"] if drone.knows_param(name)]
    return [row for row in found if not same(row[1], row[2])]


def names_missing(drone, controller):
    """Names of parameters and logs that the script uses and the firmware lacks."""
    gains = DATA["gains"] if controller == DATA["controller"] else []
    params = [name for name, _ in DATA["parameters"] + gains] + [light[0] for light in DATA["dark"]]
    params += ["kalman.initialYaw", "kalman.resetEstimation", "stabilizer.controller"]
    logs = [name for block in {**LOG, **WATCH}.values() for name in block]
    return ([name for name in dict.fromkeys(params) if not drone.knows_param(name)]
            + [name for name in dict.fromkeys(logs) if not drone.knows_log(name)])


def connected(drone, mode, controller, set_gains):
    """Rows of what is connected: (what, found, wanted, whether it is right)."""
    about, rows = drone.about, []
    if LIMITS["platforms"]:
        rows.append(("drone", about["platform"] or "no answer", LIMITS["platforms"][0],
                     about["platform"] in LIMITS["platforms"]))
    firmware, oldest = about["firmware"], LIMITS["oldest_firmware"]
    is_old = release(firmware) and release(firmware) < release(oldest)
    rows.append(("firmware", firmware or "no answer", f"{oldest} or newer",
                 firmware is not None and not is_old))
    if mode == "trajectory":
        rate = known_clock(firmware)
        rows.append(("clock on board", f"{rate:.5f}" if rate else "measured at take-off",
                     "known or measured", True))
        if DATA["trajectory"]["turns"]:
            since, number = LIMITS["heading_release"], release(firmware)
            rows.append(("heading on board", firmware or "no answer", f"{since} or newer",
                         bool(number and number >= release(since))))
    for what, decks in LIMITS["decks"]:
        found = [d for d in decks if drone.knows_param(f"deck.{d}") and drone.value(f"deck.{d}")]
        rows.append((f"deck for {what}", " ".join(found) or "none", " or ".join(decks), bool(found)))
    missing = names_missing(drone, controller)
    rows.append(("names in the firmware", f"without {', '.join(missing[:4])}" if missing else "all",
                 "all", not missing))
    apart = gains_apart(drone, controller)
    text = ", ".join(f"{name} {found:g} instead of {wanted:g}" for name, found, wanted in apart[:3])
    more = f" and {len(apart) - 3} more" if len(apart) > 3 else ""
    rows.append(("gains", text + more or "as checked",
                 "as checked, or --set-gains", not apart or set_gains))
    return rows


def state(drone):
    """Rows of how the drone stands: (what, found, wanted, whether it is right)."""
    read = drone.latest.get
    names = [name for block in WATCH.values() for name in block]
    missing = ", ".join(name for name in names if name not in drone.latest) or drone.silent()
    if missing:
        return [("log", f"no log data: {missing}", "log data of the drone", False)]
    bad = drone.faults()
    ready = drone.has(CAN_FLY) or drone.has(CAN_BE_ARMED)
    rows = [("state", bad or ("can fly" if ready else "cannot fly"), "can fly",
             ready and not bad)]
    sigma_m, most_m = drone.sigma_m(), math.sqrt(LIMITS["variance_m2"])
    rows.append(("position known within", f"{100 * sigma_m:.1f} cm", f"{100 * most_m:.0f} cm",
                 sigma_m < most_m))
    x, y = read("stateEstimate.x"), read("stateEstimate.y")
    start_x, start_y = DATA["start_m"]
    rows.append(("place", f"({x:.2f}, {y:.2f}) m", f"({start_x:.2f}, {start_y:.2f}) m",
                 math.hypot(x - start_x, y - start_y) <= LIMITS["start_radius_m"]))
    nose, wanted = read("stateEstimate.yaw"), math.degrees(DATA["yaw_rad"])
    turn = (nose - wanted + 180.0) % 360.0 - 180.0
    rows.append(("nose, left of x", f"{nose:.0f}°", f"{wanted:.0f}°",
                 abs(turn) <= math.degrees(LIMITS["nose_rad"])))
    lean = max(known(abs(read(f"stateEstimate.{angle}"))) for angle in ("roll", "pitch"))
    most = math.degrees(LIMITS["level_rad"])
    rows.append(("roll, pitch", f"up to {lean:.0f}°", f"up to {most:.0f}°", lean <= most))
    volts, least_v = read("pm.vbat"), LIMITS["rest_v"]
    rows.append(("battery at rest", f"{volts:.2f} V", f"{least_v:.2f} V" if least_v else "a larger battery",
                 least_v is not None and volts >= least_v))
    return rows


HINTS = {
    "drone": "export for this drone: --scene cf21 or cf-brushless",
    "firmware": "update it with cfclient",
    "heading on board": "update the firmware with cfclient, or fly --mode position or full-state",
    "names in the firmware": "install the firmware release for which this script was exported",
    "gains": "export with the drone's gains, or fly with --set-gains, which restores them later",
    "state": "set the drone upright, and switch it off and on again",
    "position known within": "is the positioning system on, and is its geometry on the drone?",
    "place": "carry the drone to the start of the plan",
    "nose, left of x": "turn the drone",
    "roll, pitch": "put the drone on level ground",
    "battery at rest": ("charge it, because the flight would drain it below the firmware's low-battery "
                        "voltage"),
    "log": "is the radio too far away?",
}


def judge(rows, accepted=()):
    """Prints the table. Raises Stopped if something is not as it was checked."""
    verdict = {True: "ok", False: "NO"}
    shown = [(what, found, wanted, "accepted" if not ok and what in accepted else verdict[ok])
             for what, found, wanted, ok in rows]
    say(table([("what", "found", "wanted", ""), *shown]))
    wrong = [row for row, line in zip(rows, shown) if line[3] == "NO"]
    if wrong:
        raise Stopped("; ".join(
            f"{what}: {found}, wanted {wanted}" + (f" ({HINTS[what]})" if what in HINTS else "")
            for what, found, wanted, _ in wrong))


# The flight


def paced(time_s, clock):
    """True time of a time in the plan, if the clock on board runs at another rate."""
    start_s = DATA["trajectory"]["start_s"]
    return start_s + (time_s - start_s) / clock


def measured_clock(drone, since):
    """Rate of the clock on board, from the targets of the take-off, which have the drone's own time.

    The firmware goes up on a polynomial of degree 7 in time; the shares of the way that it has
    reached tell how far it is in time, and a line through these the duration.
    """
    column = drone.columns.get("ctrltarget.z", {"time": [], "data": []})
    stamps, heights = column["time"][since:], column["data"][since:]
    start = next((z for t, z in zip(stamps, heights) if t >= stamps[0] + 150), None)
    if start is None or heights[-1] - start < 0.1:
        raise Stopped("the clock on board could not be measured: no targets in the log")
    points = []
    for stamp, z in zip(stamps, heights):
        share = (z - start) / (heights[-1] - start)
        if 0.1 < share < 0.9:
            low, high = 0.0, 1.0
            for _ in range(40):
                u = (low + high) / 2
                reached = u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)
                low, high = (u, high) if reached < share else (low, u)
            points.append((low, stamp / 1000))
    mean_u = sum(u for u, _ in points) / len(points)
    mean_t = sum(t for _, t in points) / len(points)
    took_s = (sum((u - mean_u) * (t - mean_t) for u, t in points)
              / sum((u - mean_u) ** 2 for u, _ in points))
    return known_rate(TAKE_OFF_S / took_s)


def known_rate(rate):
    """One of the rates that firmware has."""
    for known in (1.0, LIMITS["slow_clock"]):
        if abs(rate - known) < 0.004:
            return known
    raise Stopped(f"the clock on board runs at {rate:.4f} of true time, unlike that of any known firmware")


def on_board(mode):
    """The lights that the LED ring's timing memory plays, on the clock of the trajectory."""
    return DATA["trajectory"]["timing"] if mode == "trajectory" else None


def lights(mode, clock):
    """Changes of the lights: sent one by one, or the start of the timing memory and notes of it."""
    timing = on_board(mode)
    sent = DATA["trajectory"]["lights"] if mode == "trajectory" else DATA["lights"]
    changes = timing["changes"] if timing else sent
    command = "lit" if timing else "light"
    listed = [(paced(time_s, clock), command, tuple(values)) for time_s, *values in changes]
    return listed + ([(listed[0][0], "param", ("ring.effect", RING_TIMING))] if timing else [])


def events(mode, clock):
    """Everything that is sent while writing: (time in s, command, values), in order of time."""
    listed = lights(mode, clock)
    rows = DATA["setpoints"] if mode != "trajectory" else []
    for index, (time_s, sent, v, a) in enumerate(rows):
        until_s = rows[index + 1][0] if index + 1 < len(rows) else time_s
        since_s = 0.0
        while since_s == 0.0 or time_s + since_s < until_s - RESEND_S / 2:
            moved = [(x + vx * since_s + ax * since_s**2 / 2, vx + ax * since_s)
                     for x, vx, ax in zip(sent, v, a)]
            values = tuple(sent) if mode == "position" else (
                [x for x, _ in moved], [vx for _, vx in moved], a)
            listed.append((time_s + since_s, mode, values))
            since_s += RESEND_S
    return sorted(listed, key=lambda event: event[0])


def prepare(drone, mode, controller=None, set_gains=False, accepted=()):
    """Reads what is connected, judges it and loads the memory. Nothing moves and no lamp changes."""
    controller = DATA["controller"] if controller is None else controller
    if isinstance(drone, Paper):
        drone.reset_estimate()
    else:
        drone.identify()
        rows = connected(drone, mode, controller, set_gains)
        if not names_missing(drone, controller):
            drone.reset_estimate()
            drone.watch()
            rows += state(drone)
        drone.about.update(mode=mode, controller=controller,
                           found={what: found for what, found, _, _ in rows})
        judge(rows, accepted)
    if mode == "trajectory":
        drone.upload(DATA["trajectory"]["hex"])
        if on_board(mode):
            drone.upload_lights(on_board(mode)["entries"])


def still_ready(drone, accepted=()):
    """Judges again how the drone stands: the key may come minutes later."""
    drone.wait_until(drone.clock(), watching=False)
    rows = state(drone)
    if not all(ok or what in accepted for what, _, _, ok in rows):
        judge(rows, accepted)


def fly(drone, mode, controller, clock=None, begin=lambda: None, ended=lambda: None):
    """Takes off, writes and lands. `begin` returns when all drones may start, and `ended` hears of an
    early end before this drone is landed."""
    error = None
    try:
        ready_to_fly(drone, mode, controller)
        begin()
        drone.wait_until(drone.clock())
        drone.arm()
        drone.wait_until(drone.clock() + 0.5)
        if not isinstance(drone, Paper) and not drone.wait_for(drone.can_fly, 3.0):
            raise Stopped("the drone does not arm")
        write(drone, mode, clock)
    except BaseException as early:
        error = early
        ended()
    try:
        # However the flight ends: down first, and only then all that may fail as well.
        words = come_down(drone, mode)
    finally:
        tidy_up(drone)
    if words and (error is None or isinstance(error, Stopped)):
        raise (LinkLost if drone.may_fly else Stopped)(f"{error or 'the word is written'}: {words}")
    if words:
        say(words)
    if error:
        raise error


# What a drone does that nothing can be sent to anymore.
ON_THE_FLOOR = ("no flight was started: the drone is on the floor, and may be armed. If its propellers "
                "turn, the firmware stops them after 30 s. Switch the drone off before you touch it")
FOUND = "reconnected to the drone, which lands"
WITHOUT_LINK = [
    "the firmware levels the drone out after 0.5 s and stops its motors after 2 s, so that it falls",
    "the drone flies to the end of its trajectory, hovers for 3 s and lands by itself, and 2 s later "
    "the firmware stops its motors and locks it",
]
STAY = ("Stay behind the net until the propellers stand still. If they do not stop, wait until the battery "
        "is empty")


def without_link(drone, mode):
    """What a drone does that nothing can be sent to anymore, as far as that is known."""
    if drone.lifted_s is None:
        return ON_THE_FLOOR
    ifs = [] if drone.heard(drone.lifted_s) else ["it has taken off"]
    ifs += [] if drone.landing_s is None else ["it has not received the landing command"]
    known = f"if {' and '.join(ifs)}, " if ifs else ""
    return f"{known}{WITHOUT_LINK[mode == 'trajectory']}. {STAY}"


def ready_to_fly(drone, mode, controller):
    """Sets controller, gains and lamps, and starts the log."""
    wanted = DATA["parameters"] + [["stabilizer.controller", controller]]
    if controller == DATA["controller"]:
        wanted = wanted + DATA["gains"]
    if on_board(mode):
        wanted = [row for row in wanted if row[0] != "ring.effect"] + [["ring.effect", 0]]
    if isinstance(drone, Paper):
        for row in wanted:
            drone.param(*row)
    else:
        drone.set(wanted)
    drone.log()
    drone.wait_until(drone.clock() + (TRIAL_S if mode == "trajectory" else 0.5))


def write(drone, mode, clock):
    """From the floor to the last letter."""
    on_its_own = mode == "trajectory"
    zero_s = drone.clock() - (DATA["trajectory"]["start_s"] if on_its_own else 0.0)
    if on_its_own:
        drone.lifted_s, drone.may_fly, drone.highest_m = drone.clock(), True, -math.inf
        since = len(drone.columns.get("ctrltarget.z", {"time": []})["time"])
        drone.start_trajectory()
        if not isinstance(drone, Paper):
            drone.wait_until(drone.lifted_s + TAKE_OFF_S + 0.5)
            if drone.highest_m < LIFTED_M:
                raise Stopped("the drone has not taken off")
        if clock is None:
            clock = known_clock(drone.about.get("firmware"))
        if clock is None:
            clock = measured_clock(drone, since)
        drone.about["clock"] = clock
    clock = clock or 1.0
    for time_s, command, values in events(mode, clock):
        drone.wait_until(zero_s + time_s)
        if command == mode and not drone.may_fly:
            drone.lifted_s, drone.may_fly = drone.clock(), True
        getattr(drone, command)(*values)
    end_s = (DATA["trajectory"] if on_its_own else DATA)["end_s"]
    drone.wait_until(zero_s + paced(end_s, clock))


def come_down(drone, mode):
    """Lands what is in the air, then stops its motors and disarms it. Nothing keeps the next step from
    being taken. Returns what is to be said of a drone that has not simply landed."""
    words, killed = "", False
    try:
        if drone.lifted_s is not None:
            words = land(drone, mode)
        elif drone.lost.is_set() or drone.silent() and not drone.hears(drone.clock()):
            words = without_link(drone, mode)
    except KeyboardInterrupt:
        killed = True
        drone.killed.clear()  # what comes now may take its time
    if drone.may_fly and not killed:
        drone.give_up()  # it may yet hear what is sent: no stop in the air
        return words
    sent_s = drone.clock()
    attempt("stopping the motors", drone.stop, times=3)
    attempt("disarming", drone.arm, False)
    if killed:
        drone.may_fly = drone.may_fly and not drone.hears(sent_s)
        words = "motors stopped" if not drone.may_fly else (
            f"the drone does not respond, and may not have received the command to stop its motors. {STAY}")
        say(words)
    return words


def land(drone, mode):
    """Lands where the drone is, over a new link where the old one is dead. Returns what is to be said
    of a drone that has not simply landed."""
    words, landings, before = "", 0, drone.faults()
    while landings < 3:
        if not drone.lost.is_set():
            send_landing(drone, mode)
            darken(drone, mode)
            if drone.stays_heard(LANDING_S + 0.5):
                landings += 1
                if not (drone.faults() or drone.is_down()):
                    continue
                drone.may_fly = False
                fell = drone.faults() if not before else ""
                return f"the firmware stopped the motors, {fell}" if fell else words
            if drone.landing_s is not None and drone.heard(drone.landing_s):
                return ("the link was lost during the landing: the drone has received the landing "
                        f"command, and lands by itself. {STAY}")
        words = regain(drone, mode)
        if words != FOUND:
            return words
    drone.may_fly = False
    return ("after three landing commands, the drone still reports a height of "
            f"{drone.latest['stateEstimate.z']:.2f} m: motors stopped")


def send_landing(drone, mode):
    if not attempt("landing", drone.land, LANDING_S, times=3):
        return
    if mode != "trajectory":
        # Without a landing the commander on board would stop the motors.
        with contextlib.suppress(LinkLost):
            drone.wait_until(drone.clock() + TAKE_OVER_S, watching=False)
        attempt("handing over", drone.hand_over, times=3)
    drone.landing_s = drone.clock()


def regain(drone, mode):
    """Seeks a new link to a drone that may be in the air, and lands it. Returns what it says of itself,
    or what is known without."""
    was_up = drone.was_up()
    say(f"the drone does not respond. {STAY}")
    if not drone.connect or not attempt("opening a new link", drone.reconnect):
        return without_link(drone, mode)
    # A drone that the watchdog has not stopped yet is not asked first whether it flies.
    in_time = drone.clock() - drone.heard_last_s < WATCHDOG_S and drone.heard(drone.lifted_s)
    if mode != "trajectory" and in_time:
        send_landing(drone, mode)
    attempt("querying the drone", drone.start_watch)
    attempt("querying the drone", drone.wait_for, lambda: "supervisor.info" in drone.latest, ANSWER_S)
    if "supervisor.info" not in drone.latest:
        send_landing(drone, mode)
        return f"there is a new link, but the drone sends no state. {STAY}"
    if drone.has(FLYING):
        return FOUND
    drone.may_fly = False
    if drone.faults():
        fell = ": it has fallen" if was_up and mode != "trajectory" else ""
        return f"reconnected: the firmware has stopped its motors, {drone.faults()}{fell}"
    return "reconnected: the drone does not fly, and its motors are off"


def darken(drone, mode):
    """All lamps off, unless a new link knows no parameters yet and would wait for them."""
    if drone.found_again:
        return
    if on_board(mode):
        attempt("lamps", drone.param, "ring.effect", 0)
    for values in DATA["dark"]:
        attempt("lamps", drone.light, *values, times=2)


def tidy_up(drone):
    """Controller and gains as they were, and the log: on the floor, whatever fails."""
    if isinstance(drone, Paper):
        return drone.finish()
    try:
        drone.put_back(lamps=False)
    finally:
        drone.finish()


@contextlib.contextmanager
def landing_on_signals(drones):
    """From here on Ctrl-C, a closed window and `kill` land, and a second one stops the motors. What
    ends a flight by itself, or for another drone's sake, is no press."""
    ways = {"SIGINT": "Ctrl-C", "SIGTERM": "kill", "SIGHUP": "a closed window", "SIGBREAK": "Ctrl-Break"}
    ways = {getattr(signal, name): way for name, way in ways.items() if hasattr(signal, name)}
    pressed_s = []

    def received(number, frame):
        pressed_s.append(drones[0].clock())
        for drone in drones:
            if not drone.stopped.is_set():
                drone.why = f"stopped by {ways[number]}"
            drone.stopped.set()
            if pressed_s[-1] - pressed_s[0] >= PRESS_S:
                drone.killed.set()

    before = [(number, signal.signal(number, received)) for number in ways]
    try:
        yield
    finally:
        for number, handler in before:
            signal.signal(number, handler)


# The geometry of the positioning


def check_geometry(drone):
    """Positions that the drone reads at the corners of the canvas, beside the true ones."""
    missing = names_missing(drone, DATA["controller"])
    if missing:
        raise Stopped(f"the firmware has no {', '.join(missing)}")
    drone.reset_estimate()
    drone.watch()
    if "stateEstimate.x" not in drone.latest:
        raise Stopped("the drone reports no position")
    rows, most_m = [], LIMITS["corner_m"]
    for number, corner in enumerate(DATA["corners_m"], 1):
        place = ", ".join(f"{v:.2f}" for v in corner)
        typed = input(f"Corner {number} of 4: hold the drone at ({place}) m, with the nose as in the "
                      "flight, and press Enter, or type its actual position as x, y, z: ")
        if typed.strip():
            corner = [float(part) for part in typed.replace(",", " ").split()]
            if len(corner) != 3:
                raise Stopped(f"{typed.strip()!r} is not a position: wanted three numbers in meters")
        drone.wait_until(drone.clock() + 2.0, watching=False)
        readings = []
        for _ in range(10):
            drone.wait_until(drone.clock() + 0.1, watching=False)
            readings.append([drone.latest[f"stateEstimate.{axis}"] for axis in "xyz"])
        read = [sum(values) / len(values) for values in zip(*readings)]
        off_m = math.dist(read, corner)
        rows.append((number, *(f"{r:.3f} ({w:.3f})" for r, w in zip(read, corner)),
                     f"{100 * off_m:.1f} cm", "ok" if off_m <= most_m else "NO"))
    say(table([("corner", "x measured (wanted)", "y", "z", "off", ""), *rows]))
    if any(row[-1] == "NO" for row in rows):
        raise Stopped(f"the geometry is off by more than {100 * most_m:.0f} cm: estimate it again, "
                      "with the origin in the middle of the room's floor")


# From the command line


def options(parser):
    parser.add_argument("--mode", choices=["position", "full-state", "trajectory"],
                        default=DATA["mode"], help="setpoints to send (default: %(default)s)")
    parser.add_argument("--controller", type=int, default=DATA["controller"], metavar="N",
                        help="stabilizer.controller: 1 PID, 2 Mellinger, 5 Lee, or the number of "
                             "a custom controller in the firmware (default: %(default)s)")
    parser.add_argument("--set-gains", action="store_true",
                        help="set the checked gains, and restore the drone's own after landing")
    parser.add_argument("--accept", action="append", default=[], metavar="WHAT",
                        help="fly although this row of the table is not as required")
    parser.add_argument("--dry-run", action="store_true", help="print what would be sent")


def settings(args, parser):
    """Mode and controller as they were typed."""
    if args.controller is None:
        parser.error("this plan is for a controller of your own: pass its number as --controller")
    mode = args.mode.replace("-", "_")
    if args.mode in DATA["refused"]:
        parser.error(f"--mode {args.mode}: {DATA['refused'][args.mode]}")
    if args.dry_run and hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` ends it without a word
    return mode, args.controller


def need_cflib():
    """Says which cflib it takes, before anything else is done."""
    oldest = LIMITS["oldest_cflib"]
    try:
        from importlib.metadata import version

        found = version("cflib")
    except ImportError:
        raise SystemExit(f"error: cflib {oldest} or newer is needed: pip install cflib") from None
    numbers = [[int(part) for part in re.findall(r"\d+", text)[:3]] for text in (found, oldest)]
    if numbers[0] < numbers[1]:
        raise SystemExit(f"error: cflib {found} is too old, {oldest} or newer is needed: "
                         "pip install --upgrade cflib")


def opened(links, uri, wait=True):
    """An open link, with all parameters read unless there is no time to wait for them."""
    from cflib.crazyflie import Crazyflie
    from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

    logging.getLogger("cflib").setLevel(logging.CRITICAL)  # its tracebacks: errors are said below
    link = SyncCrazyflie(uri, cf=Crazyflie(rw_cache="./cache"))
    # A link that is lost before all tables are read: cflib waits for them without end.
    link.cf.connection_lost.add_callback(link._connection_failed)
    try:
        links.enter_context(link)
    except Exception as error:
        # cflib adds its traceback.
        why = str(error).splitlines()[0] if str(error) else repr(error)
        hint = ": plug the radio in, and close other programs that use it" if "Crazyradio" in why else ""
        raise Stopped(f"no link to {uri}: {why}{hint}") from None
    end_s = time.monotonic() + CONNECT_S
    while wait and not link.is_params_updated():
        if time.monotonic() > end_s:
            raise Stopped(f"the parameters of {uri} could not be read")
        time.sleep(0.05)
    return link.cf


def room():
    """The room in which the flight was checked, in words."""
    if DATA["room_m"] is None:
        return "The flight was checked without a room. The origin is that of the positioning system."
    w, d, h = DATA["room_m"]
    return (f"The flight was checked in a room of {w:g} x {d:g} x {h:g} m. The origin of the positioning "
            f"system must be the middle of the floor, {w / 2:g} m from the left and right walls and "
            f"{d / 2:g} m from the front and back walls, with x to the right of the photographer.")


def main():
    parser = argparse.ArgumentParser(description="Writes a word with light.")
    parser.add_argument("--uri", default=DATA["uri"], help="address (default: %(default)s)")
    parser.add_argument("--log", default=DATA["log"], help="file for the log (default: %(default)s)")
    parser.add_argument("--check-geometry", action="store_true",
                        help=("compare the positions that the drone reports at the corners of the canvas, "
                              "and exit"))
    options(parser)
    args = parser.parse_args()
    mode, controller = settings(args, parser)
    if args.dry_run:
        prepare(Paper(), mode, controller)
        return fly(Paper(), mode, controller, 1.0)
    need_cflib()
    import cflib.crtp

    cflib.crtp.init_drivers()
    drone = None
    try:
        with contextlib.ExitStack() as links:
            def connect(wait=True):
                return opened(links, args.uri, wait)

            drone = Drone(connect(), args.log, connect)
            drone.about["uri"] = args.uri
            try:
                if args.check_geometry:
                    return check_geometry(drone)
                prepare(drone, mode, controller, args.set_gains, args.accept)
                say(room())
                input("Is this correct, is the shutter ready, and is everyone behind the net? Press Enter "
                      "to take off, or Ctrl-C to exit. ")
                still_ready(drone, args.accept)
                with landing_on_signals([drone]):
                    fly(drone, mode, controller)
                with contextlib.suppress(EOFError, OSError):
                    input("Landed. Close the shutter, and press Enter to restore the lamps. ")
            finally:
                drone.put_back(lamps=False)
                drone.put_back(lamps=True)
    except KeyboardInterrupt:
        raise SystemExit("stopped by Ctrl-C") from None
    except EOFError:
        raise SystemExit("error: keys cannot be pressed here: start the script in a terminal") from None
    except Stopped as stopped:
        raise SystemExit(f"error: {stopped}") from None


# The plan, as `noctograph export` made it.
DATA = json.loads(@DATA@)
LIMITS = DATA["limits"]
LANDING_S = max(2.0, DATA["top_m"] / SINK_M_S)

if __name__ == "__main__":
    main()
