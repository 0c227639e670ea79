"""A double of a Crazyflie in virtual time for exported scripts.

It has a clock, a body that obeys commands like the firmware, and a link with cflib's own commanders. Each of these can
fail.
"""

import importlib.metadata
import importlib.util
import math
import os
import struct
import threading
import time
import types

from cflib.crazyflie.commander import Commander
from cflib.crazyflie.high_level_commander import HighLevelCommander
from cflib.crazyflie.mem import MemoryElement
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort

CFLIB = tuple(int(part) for part in importlib.metadata.version("cflib").split(".")[:3])
RPYT, COMMANDER, HIGH_LEVEL = 3, 7, 8
POSITION, FULL_STATE, STOP = 7, 6, 0
LAND, DEFINE, HIGH_STOP = 8, 6, 3
WATCHDOG_S, LEVEL_S, HYSTERESIS_S = 2.0, 0.5, 2.0
START = 13 if CFLIB >= (0, 1, 29) else 5

with open(os.path.join(os.path.dirname(__file__), "firmware-names.txt"), encoding="utf-8") as file:
    NAMES = [line.split() for line in file if not line.startswith("#")]
PARAMS = {name for kind, name in NAMES if kind == "param"}
LOGS = {name for kind, name in NAMES if kind == "log"}


class Clock:
    """Virtual time that passes only while the script sleeps, and then runs the events that are due."""

    def __init__(self):
        self.now_s, self.due, self.lock = 100.0, [], threading.RLock()

    def monotonic(self):
        return self.now_s

    def sleep(self, s):
        with self.lock:
            end_s = self.now_s + s
            while self.due and min(self.due, key=lambda event: event[0])[0] <= end_s:
                event = min(self.due, key=lambda event: event[0])
                self.due.remove(event)
                self.now_s = max(self.now_s, event[0])
                event[1]()
            self.now_s = max(self.now_s, end_s)

    def after(self, s, action):
        self.due.append((self.now_s + s, action))


class SharedClock(Clock):
    """Virtual time for several threads. It passes when all threads that have ever slept are asleep, or if one of them
    has not slept for a quarter of a second, because it then waits for something else."""

    def __init__(self, n_threads):
        super().__init__()
        self.n_threads, self.asleep, self.turn, self.known = n_threads, [], threading.Condition(), set()

    def sleep(self, s):
        with self.turn:
            wake = (self.now_s + s, threading.get_ident())
            self.known.add(threading.current_thread())
            self.asleep.append(wake)
            self.turn.notify_all()
            begun_s = time.monotonic()
            while wake != min(self.asleep) or time.monotonic() < begun_s + self.patience_s():
                self.turn.wait(0.005)
            self.asleep.remove(wake)
            super().sleep(max(wake[0] - self.now_s, 0.0))
            self.turn.notify_all()

    def patience_s(self):
        """Returns the time for which threads that are awake are waited for, which is short for threads that may still
        start."""
        self.known = {thread for thread in self.known if thread.is_alive()}
        awake = len(self.known) > len(self.asleep)
        return 0.25 if awake else 0.02 * (len(self.asleep) < min(self.n_threads, threading.active_count() - 1))


class Body:
    """A drone that is exactly where it is commanded to be, with the firmware's order of commanders, planner, watchdog,
    supervisor and clock. `fell_m` is the height at which its motors stopped."""

    def __init__(self, clock, place=(0.0, 0.0), clock_rate=84 / 85):
        self.clock, self.clock_rate = clock, clock_rate
        self.at, self.target, self.top_m, self.fell_m = [*place, 0.0], [0.0] * 3, 0.0, 0.0
        self.low_s, self.leg, self.on, self.locked, self.cut_by = None, None, False, False, None
        # Actions of the firmware and received commands, with which the script's messages are
        # compared.
        self.moved_s, self.leveled, self.turned_s = clock.now_s, False, -math.inf
        self.landings, self.took_over = [], False

    def setpoint(self, place):
        """Executes a setpoint from the radio, which stops the planner on board."""
        if not self.locked:
            self.low_s, self.target, self.on, self.leg = self.clock.now_s, list(place), True, None

    def land(self, duration_s):
        """Executes a landing on board, on the drone's clock, after which the motors are off."""
        start = list(self.at)

        def way(time_s):
            u = min(max(time_s / duration_s, 0.0), 1.0)
            share = u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)
            return [*start[:2], start[2] * (1 - share)]

        if not self.locked and not (self.leg and self.leg[3] == "stop"):
            self.leg = (self.clock.now_s, way, duration_s, "stop")
            self.landings.append(self.clock.now_s)

    def fly_pieces(self, data):
        """Flies a compressed trajectory, parsed like `pptraj_compressed.c`. At its end the drone hovers, or has no
        goal if the
        last piece divides by its duration of 0."""
        end, at, pieces = list(struct.unpack_from("<hhhh", data)), 8, []
        while True:
            header, duration_ms = struct.unpack_from("<BH", data, at)
            at += 3
            if duration_ms == 0:
                break
            curves = []
            for axis in range(4):
                n = [0, 1, 3, 7][header >> 2 * axis & 3]
                curves.append([end[axis], *struct.unpack_from(f"<{n}h", data, at)])
                at, end[axis] = at + 2 * n, curves[-1][-1]
            pieces.append((duration_ms / 1000, curves[:3]))

        def way(time_s):
            for duration_s, curves in pieces:
                if time_s < duration_s:
                    break
                time_s -= duration_s
            u = min(max(time_s / duration_s, 0.0), 1.0)
            return [casteljau(curve, u) / 1000 for curve in curves]

        lasts_s = sum(duration_s for duration_s, _ in pieces)
        if not self.locked:  # a setpoint of it is not executed then
            self.leg = (self.clock.now_s, way, lasts_s, "no goal" if header else "hold")

    def relax(self):
        """Ends the setpoints. A planner that is stopped then commands the motors off."""
        self.low_s, self.took_over = None, self.leg is not None
        if self.leg is None:
            self.cut("a null setpoint")

    def cut(self, by, locks=False):
        if self.on:
            self.fell_m, self.cut_by, self.turned_s = self.at[2], by, self.clock.now_s
        self.on, self.leg, self.low_s, self.locked = False, None, None, self.locked or locks
        self.at[2] = self.target[2] = 0.0

    def move(self):
        """Moves the drone to the present time. Setpoints take precedence over the commander on board."""
        now_s, moved_s = self.clock.now_s, self.moved_s
        self.moved_s = now_s
        if self.low_s is not None:
            self.leveled = self.leveled or self.on and now_s - self.low_s > LEVEL_S
            if now_s - self.low_s > WATCHDOG_S:
                return self.cut("the firmware's watchdog", locks=True)
        elif self.leg:
            begin_s, way, lasts_s, then = self.leg
            time_s = (now_s - begin_s) * self.clock_rate
            # If the position was not queried for some time, the path in between counts as well.
            steps = min(int(4 * (now_s - moved_s)), 400)
            heights = [way(min(time_s - k / 4, lasts_s))[2] for k in range(1, steps + 1) if time_s > k / 4]
            self.top_m = max([self.top_m, *heights])
            self.target, self.on = way(min(time_s, lasts_s)), True
            self._be_there()
            if then == "stop" and time_s > lasts_s:
                return self.cut("the end of a landing")
            if then == "no goal" and time_s > lasts_s + WATCHDOG_S:
                return self.cut("the firmware's watchdog", locks=True)
        if self.on:
            self._be_there()

    def _be_there(self):
        self.at = [*self.target[:2], max(self.target[2], 0.0)]
        self.top_m = max(self.top_m, self.at[2])

    def is_flying(self):
        """Returns bit 4 of `supervisor.info`, which is set while there is thrust and for two seconds after it."""
        return not self.locked and (self.on or self.clock.now_s - self.turned_s < HYSTERESIS_S)

    def outcome(self):
        if self.top_m < 0.05:
            return "never took off"
        if self.on:
            return "in the air" if self.at[2] > 0.05 else "on the floor with its propellers on"
        return "landed" if self.fell_m < 0.3 else f"falls by {self.cut_by}"


def casteljau(points, u):
    """Evaluates a Bézier curve at a fraction of its duration."""
    while len(points) > 1:
        points = [(1 - u) * a + u * b for a, b in zip(points, points[1:])]
    return points[0]


class Callbacks(list):
    def add_callback(self, callback):
        self.append(callback)


class Counted:
    """A part of a link whose calls are counted, and may be configured to fail."""

    def __init__(self, radio, name, part):
        self._radio, self._name, self._part = radio, name, part

    def __getattr__(self, verb):
        value = getattr(self._part, verb)
        if not callable(value) or isinstance(value, types.SimpleNamespace):
            return value

        def call(*args, **kwargs):
            self._radio.touch(f"{self._name}.{verb}")
            return value(*args, **kwargs)

        return call


class Radio:
    """A link to a body, which records packets and parameters with their times."""

    def __init__(self, clock, body=None, battery_v=4.1, place=(0.0, 0.0), variance=1e-5, nose=0.0,
                 lean=0.0, platform="Crazyflie 2.1", firmware="2026.08", clock_rate=84 / 85, gains=(),
                 decks=("bcLighthouse4", "bcLedRing"), bits=0, missing=(), auto_arm=True):
        self.clock, self.body = clock, body or Body(clock, place, clock_rate)
        self.sent, self.params, self.blocks, self.calls, self.failing = [], [], [], {}, {}
        self.platform_name, self.firmware, self.bits, self.missing = platform, firmware, bits, missing
        self.armed, self.is_lost, self.drift = auto_arm, False, [0.0] * 3
        self.is_closed, self.passes = False, 0
        self.values, self.fixed = {}, {
            "pm.vbat": battery_v, "stateEstimate.yaw": nose, "stateEstimate.roll": lean,
            "kalman.varPX": variance, "kalman.varPY": variance, "kalman.varPZ": variance}
        self.memory_of_params = dict.fromkeys(PARAMS, 0.0)
        self.memory_of_params.update({f"deck.{deck}": 1 for deck in decks})
        self.memory_of_params.update({"ring.effect": 6, "cpu.id0": 0x1A2B3C4D, "stabilizer.controller": 1})
        self.memory_of_params.update(dict(gains))
        self.was = dict(self.memory_of_params)
        self.disconnected, self.connection_lost, self.ports = Callbacks(), Callbacks(), []
        self.commander = Counted(self, "commander", Commander(self))
        self.high_level_commander = Counted(self, "high_level_commander", HighLevelCommander(self))
        self.param = Counted(self, "param", types.SimpleNamespace(
            set_value=self.set_value, get_value=self.get_value, toc=self.toc(PARAMS), is_updated=True))
        arming = types.SimpleNamespace(send_arming_request=self.arm)
        self.platform = types.SimpleNamespace(get_protocol_version=lambda: 12, **vars(arming))
        if CFLIB >= (0, 1, 32):
            self.supervisor = Counted(self, "supervisor", arming)
        self.log = Counted(self, "log", types.SimpleNamespace(
            add_config=self.add_block, toc=self.toc(LOGS)))
        self.memory = types.SimpleNamespace(trajectory=[], write_data_sync=self.uploaded)
        self.mem = Counted(self, "mem", types.SimpleNamespace(get_mems=lambda kind: [
            self.memory if kind == MemoryElement.TYPE_TRAJ else self.led]))
        self.upload, self.timings = None, None
        self.led = types.SimpleNamespace(timings=[], add=self.add_timing, write_data=self.write_led)

    def fault(self, bit):
        """Sets a bit of the supervisor in flight, after the firmware has stopped the motors
        (`supervisor_state_machine.c`, `transitionsFlying`)."""
        self.body.move()
        self.body.cut("the firmware's own cut", locks=True)
        self.bits |= 1 << bit

    def touch(self, call):
        """Counts a call, and fails at the nth call if it was configured to."""
        self.calls[call] = self.calls.get(call, 0) + 1
        if self.failing.get(call) == self.calls[call]:
            raise OSError(f"{call} failed")

    def toc(self, names):
        return types.SimpleNamespace(get_element_by_complete_name=lambda name: (
            name if name in names and name not in self.missing else None))

    # Link

    def lose(self):
        """Loses the link in the way that cflib detects: no more packets arrive, and its callbacks are called."""
        if not self.is_closed:
            self.is_lost = self.is_closed = True
            for callback in list(self.connection_lost):
                callback("radio://", "lost")

    def _link_error_cb(self, why):
        self.lose()

    def hush(self, notice_s, passes=0):
        """Silences both directions of the link, which cflib detects only after 100 packets (0.3 s with one drone). If
        only the acknowledgments are lost, the drone receives one more packet, which the driver repeats."""
        self.is_lost, self.passes = True, passes
        self.clock.after(notice_s, lambda: self.lose() if self.is_lost else None)

    def close_link(self):
        """Closes the link like cflib, which first sends a setpoint without thrust."""
        if not self.is_lost:
            self.body.move()
            self.body.cut("cflib's end of the link")
        self.is_lost = self.is_closed = True

    def again(self):
        """Opens a new link to the same drone, for which cflib reads the parameters for one second."""
        radio = Radio(self.clock, body=self.body)
        for name in ("memory_of_params", "was", "values", "fixed", "drift", "bits", "armed", "missing",
                     "platform_name", "firmware", "params", "sent"):
            setattr(radio, name, getattr(self, name))
        updated = radio.param._part
        updated.is_updated = False
        self.clock.after(1.0, lambda: setattr(updated, "is_updated", True))
        return radio

    def add_port_callback(self, port, callback):
        self.ports.append((port, callback))

    def remove_port_callback(self, port, callback):
        self.ports.remove((port, callback))

    def send_packet(self, packet, *_, **__):
        if self.is_lost and (self.is_closed or not self.passes):
            return
        self.passes -= self.is_lost
        port, channel, data = packet.port, packet.channel, bytes(packet.data)
        if port == CRTPPort.PLATFORM:
            self.touch("version port")
            return self.clock.after(0.02, lambda: self.answer(data[0]))
        self.sent.append((self.clock.now_s, port, channel, data))
        self.body.move()
        if port == RPYT:
            self.body.cut("cflib's end of the link")
        elif port == COMMANDER and channel == 1:
            self.body.relax()
        elif port == COMMANDER and data[0] == POSITION:
            self.body.setpoint(struct.unpack_from("<fff", data, 1))
        elif port == COMMANDER and data[0] == FULL_STATE:
            self.body.setpoint([v / 1000 for v in struct.unpack_from("<hhh", data, 1)])
        elif port == COMMANDER or data[0] == HIGH_STOP:
            self.body.cut("the script")
        elif data[0] == LAND:
            self.body.land(struct.unpack_from("<ff?f", data, 2)[3])
        elif data[0] == START:
            self.body.fly_pieces(self.upload)

    def answer(self, question):
        text = {1: self.firmware, 2: self.platform_name}[question]
        if text is None or self.is_lost:
            return
        packet = CRTPPacket()
        packet.set_header(CRTPPort.PLATFORM, 1)
        packet.data = bytes([question]) + text.encode()
        for _, callback in list(self.ports):
            callback(packet)

    def packets(self, port, kind):
        return [(t, data) for t, p, c, data in self.sent if p == port and c == 0 and data[0] == kind]

    # Parameters, arming, memory

    def set_value(self, name, value):
        assert isinstance(value, (int, float)), f"{name} = {value!r}"
        self.wait_for_params()
        if self.toc(PARAMS).get_element_by_complete_name(name) is None:
            raise KeyError(f"{name} not in param TOC")
        if not self.is_lost:
            self.params.append((self.clock.now_s, name, value))
            stored = struct.unpack("<f", struct.pack("<f", value))[0] if value % 1 else value
            self.clock.after(0.02, lambda: self.memory_of_params.update({name: stored}))

    def wait_for_params(self):
        """Waits like cflib for all parameters of a new link, for up to a minute."""
        for _ in range(600):
            if not self.param._part.is_updated:
                self.clock.sleep(0.1)

    def get_value(self, name):
        self.wait_for_params()
        if self.toc(PARAMS).get_element_by_complete_name(name) is None:
            raise KeyError(name)
        return str(self.memory_of_params[name])

    def changed(self):
        """Returns the parameters whose values differ from those before the script."""
        return {name for name, value in self.memory_of_params.items()
                if not math.isclose(value, self.was[name], rel_tol=1e-6)}

    def arm(self, armed):
        """Executes an arming request. If the drone is disarmed in the air, its motors stop."""
        if not self.is_lost:
            self.body.move()
            self.armed = armed
            if not armed and self.body.is_flying():
                self.body.cut("disarming")

    def add_timing(self, duration, rgb):
        self.led.timings.append((duration, rgb["r"], rgb["g"], rgb["b"]))

    def write_led(self, done):
        self.timings = list(self.led.timings)
        self.clock.after(0.2, lambda: done(self.led, 0))

    def uploaded(self):
        self.upload = b"".join(bytes(element.pack()) for element in self.memory.trajectory)
        return True

    # Log

    def add_block(self, block):
        for name, _ in block.variables:
            if self.toc(LOGS).get_element_by_complete_name(name) is None:
                raise KeyError(f"Variable {name} not in TOC")
        block.radio = self
        self.blocks.append(block)

    def read(self, name):
        """Returns the current value of a logged variable."""
        self.body.move()
        group, _, variable = name.partition(".")
        default = self.fixed.get(name, 0.0)
        if group == "stateEstimate" and variable in "xyz":
            axis = "xyz".index(variable)
            default = self.body.at[axis] + self.drift[axis]
        elif group == "ctrltarget" and variable in "xyz":
            default = self.body.target["xyz".index(variable)]
        elif name == "supervisor.info":
            can_fly = self.armed and not self.body.locked and not self.bits & 0xE0
            default = (self.bits | 1 | self.armed << 1 | can_fly << 3 | self.body.is_flying() << 4
                       | self.body.locked << 6)
        return self.values.get(name, default)


class Block:
    """Stands in for cflib's LogConfig. A started block sends a row when the clock advances."""

    def __init__(self, name, period_in_ms):
        self.name, self.variables, self.data_received_cb, self.on = name, [], Callbacks(), False
        self.period_s = period_in_ms / 1000

    def add_variable(self, name, kind):
        self.variables.append((name, kind))
        sizes = {"float": 4, "uint16_t": 2}
        assert sum(sizes[kind] for _, kind in self.variables) <= 26, self.name

    def start(self):
        radio = self.radio
        radio.touch("block.start")
        self.on = True

        def row():
            if not self.on or radio.is_closed:
                return
            if not radio.is_lost:
                values = {name: radio.read(name) for name, _ in self.variables}
                for callback in self.data_received_cb:
                    callback(round(1000 * (radio.clock.now_s - 50)), values, self)
            radio.clock.after(self.period_s, row)

        radio.clock.after(self.period_s, row)

    def stop(self):
        self.radio.touch("block.stop")
        self.on = False


def load_script(path):
    """Loads a script as a module."""
    name = os.path.basename(path)[:-3].replace("-", "_")
    spec = importlib.util.spec_from_file_location(name, path)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


class Linked:
    """The members of cflib's SyncCrazyflie that scripts use, in addition to its drone."""

    def __exit__(self, *_):
        self.cf.close_link()

    def _connection_failed(self, uri, why):
        pass

    def is_params_updated(self):
        return True


def links(parts, clock, radios):
    """Replaces cflib's SyncCrazyflie, so that each opened link is the drone of the next script."""
    class Link(Linked):
        def __init__(self, uri, cf):
            data = parts[len(radios)].DATA
            self.cf = Radio(clock, place=data["start_m"], gains=data["gains"])
            radios.append(self.cf)

        def __enter__(self):
            return self

    return Link
