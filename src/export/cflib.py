#!/usr/bin/env python3
"""Writes a word with light: flies a Crazyflie, switches its lights and records the flight.

Made by noctograph. Needs: pip install cflib
    python3 SCRIPT --dry-run      prints everything that would be sent, without a radio
    python3 SCRIPT --uri radio://0/80/2M/E7E7E7E7E7

The drone stands where the plan takes off, its nose along the world's x axis, or turned to the left as
far as the script says, and the positioning system runs. Before you press Enter the script only reads, resets the position estimate and uploads.
Ctrl-C lands where the drone is; a second Ctrl-C stops the motors.
"""

import argparse
import json
import math
import os
import threading
import time

BATTERY_MIN_V = 3.8  # at rest; a full cell has 4.1 to 4.2 V
BATTERY_EMPTY_V = 3.0  # in flight, over a second: lands
START_RADIUS_M = 0.2  # largest distance of the drone from the plan's start
VARIANCE_MAX_M2 = 1e-3  # of the estimated position, when it has settled
SETTLE_S = 10.0
TAKE_OFF_S = 3.0
SINK_M_S = 0.3
RESEND_S = 0.1  # the firmware levels the drone after 0.5 s without a setpoint
LOG_PERIOD_MS = 20
RING_TIMING = 17  # ring.effect that plays the LED timing memory from its beginning

# What noctograph's import, compare and learn read, by type; 26 bytes a block at most.
LOG = @LOG@
# The observer of the AE483 course, where the firmware has it.
OPTIONAL = @OPTIONAL@


class Stopped(Exception):
    """The flight ends early; the text says why."""


class LinkLost(Stopped):
    """Nothing can be sent anymore."""


class Paper:
    """Stands in for a drone in a dry run: prints what would be sent, and takes no time."""

    now_s = 0.0

    def clock(self):
        return self.now_s

    def wait_until(self, time_s, watching=True):
        self.now_s = max(self.now_s, time_s)

    def __getattr__(self, command):
        if command.startswith("_"):
            raise AttributeError(command)

        def send(*values):
            text = ", ".join(f"{v:.6g}" if isinstance(v, float) else str(v) for v in values)
            print(f"{self.now_s:9.3f} s  {command}({text})")

        return send


class Drone:
    """A Crazyflie on the radio."""

    def __init__(self, cf, log_file):
        self.cf, self.log_file = cf, log_file
        self.high = cf.high_level_commander
        self.columns, self.blocks = {}, []
        self.stamp_ms, self.stamped_s, self.low = None, 0.0, 0
        self.stopped = threading.Event()  # set by the launcher when another drone ends early
        self.lost = threading.Event()
        cf.disconnected.add_callback(lambda uri: self.lost.set())
        cf.connection_lost.add_callback(lambda uri, message: self.lost.set())

    def clock(self):
        return time.monotonic()

    def wait_until(self, time_s, watching=True):
        while True:
            if self.lost.is_set():
                raise LinkLost("the radio link was lost")
            if watching and self.stopped.is_set():
                raise Stopped("another drone ended early")
            if watching and self.low * LOG_PERIOD_MS > 1000:
                raise Stopped("the battery is empty")
            left_s = time_s - self.clock()
            if left_s <= 0.0:
                return
            time.sleep(min(left_s, 0.05))

    def param(self, name, value):
        self.cf.param.set_value(name, value)

    def light(self, name, value, channel, level):
        self.param(name, value)
        self._note(channel, level)

    def position(self, x, y, z):
        self.cf.commander.send_position_setpoint(x, y, z, math.degrees(DATA["yaw_rad"]))

    def full_state(self, position, velocity, acceleration):
        # cflib truncates to millimeters; a quarter of one makes that rounding.
        rounded = [[(round(1000 * v) + math.copysign(0.25, v)) / 1000 for v in vector]
                   for vector in (position, velocity, acceleration)]
        half_yaw = DATA["yaw_rad"] / 2
        heading = [0.0, 0.0, math.sin(half_yaw), math.cos(half_yaw)]
        self.cf.commander.send_full_state_setpoint(*rounded, heading, 0.0, 0.0, 0.0)

    def lit(self, channel, level):
        """A light that changes by the timing memory on board: nothing is sent."""
        self._note(channel, level)

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
        end_s = self.clock() + SETTLE_S
        while not written.is_set():
            if self.clock() > end_s:
                raise Stopped("the lights could not be uploaded")
            self.wait_until(self.clock() + 0.05)

    def upload(self, n_bytes, data, n_pieces):
        from cflib.crazyflie.mem import MemoryElement

        class Raw:
            def pack(self):
                return bytes.fromhex(data)

        memory = self.cf.mem.get_mems(MemoryElement.TYPE_TRAJ)[0]
        memory.trajectory = [Raw()]
        if not memory.write_data_sync():
            raise Stopped("the trajectory could not be uploaded")
        self.high.define_trajectory(1, 0, n_pieces, type=1)

    def start_trajectory(self):
        self.high.start_trajectory(1, 1.0)

    def take_off(self, z, duration_s):
        self.high.takeoff(z, duration_s, yaw=DATA["yaw_rad"])

    def go_to(self, x, y, z, duration_s):
        self.high.go_to(x, y, z, DATA["yaw_rad"], duration_s)

    def arm(self):
        self.cf.supervisor.send_arming_request(True)

    def hand_over(self):
        """Lets the commander on board take over from the setpoints, at the last one."""
        self.cf.commander.send_notify_setpoint_stop()

    def land(self, duration_s):
        self.high.land(0.0, duration_s, yaw=DATA["yaw_rad"])

    def stop(self):
        self.high.stop()
        self.cf.commander.send_stop_setpoint()

    def log(self):
        known = self.cf.log.toc.get_element_by_complete_name
        optional = {name: vs for name, vs in OPTIONAL.items() if all(known(v) for v in vs)}
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
        return block

    def _row(self, stamp_ms, values, block):
        if self.stamp_ms is None:
            self.stamp_ms = stamp_ms
            for channel in DATA["channels"]:
                self._note(channel, 0.0, stamp_ms)
        self.stamp_ms, self.stamped_s = stamp_ms, self.clock()
        for variable, value in values.items():
            self._add(variable, stamp_ms, value)
        if "pm.vbat" in values:
            self.low = self.low + 1 if values["pm.vbat"] < BATTERY_EMPTY_V else 0

    def _note(self, channel, level, stamp_ms=None):
        """Keeps a light command in the log, on the drone's clock."""
        if stamp_ms is None and self.stamp_ms is not None:
            stamp_ms = round(self.stamp_ms + 1000 * (self.clock() - self.stamped_s))
        if stamp_ms is not None:
            self._add(f"light.{channel}", stamp_ms, level)

    def _add(self, name, stamp_ms, value):
        column = self.columns.setdefault(name, {"time": [], "data": []})
        column["time"].append(stamp_ms)
        column["data"].append(value)

    def ready(self):
        """Waits for a position that has settled; refuses a low battery and a wrong place."""
        self.param("kalman.initialYaw", DATA["yaw_rad"])
        self.param("kalman.resetEstimation", 1)
        self.wait_until(self.clock() + 0.1)
        self.param("kalman.resetEstimation", 0)
        self.wait_until(self.clock() + 2.0)
        latest = {}
        names = ["stateEstimate.x", "stateEstimate.y", "pm.vbat",
                 "kalman.varPX", "kalman.varPY", "kalman.varPZ"]
        check = self._block("check", 100, dict.fromkeys(names, "float"),
                            lambda stamp, values, block: latest.update(values))
        end_s = self.clock() + SETTLE_S
        while max(latest.get(name, 1.0) for name in names[3:]) >= VARIANCE_MAX_M2:
            if self.clock() > end_s:
                raise Stopped(f"no settled position after {SETTLE_S:.0f} s: is the positioning "
                              "system on, and its geometry on the drone?")
            self.wait_until(self.clock() + 0.2)
        check.stop()
        x, y, battery_v = (latest[name] for name in names[:3])
        if battery_v < BATTERY_MIN_V:
            raise Stopped(f"the battery has {battery_v:.2f} V, {BATTERY_MIN_V} V are wanted: "
                          "charge it")
        start_x, start_y = DATA["start_m"]
        if math.hypot(x - start_x, y - start_y) > START_RADIUS_M:
            raise Stopped(f"the drone stands at ({x:.2f}, {y:.2f}) m, the plan starts at "
                          f"({start_x:.2f}, {start_y:.2f}) m: carry it there")
        print(f"ready: battery {battery_v:.2f} V, at ({x:.2f}, {y:.2f}) m; nose "
              f"{math.degrees(DATA['yaw_rad']):.0f}° to the left of world x")

    def finish(self):
        for block in self.blocks:
            if not self.lost.is_set():
                block.stop()
        stem, ending = os.path.splitext(self.log_file)
        path, number = self.log_file, 2
        while os.path.exists(path):
            path, number = f"{stem}-{number}{ending}", number + 1
        with open(path, "w", encoding="utf-8") as file:
            json.dump(self.columns, file)
        print(f"log: {path}")


def paced(time_s, clock):
    """True time of a time in the plan, where the clock on board runs at another rate."""
    start_s = DATA["trajectory"]["start_s"]
    return start_s + (time_s - start_s) / clock


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
    if mode == "trajectory":
        start = (DATA["trajectory"]["start_s"], "start_trajectory", ())
        return sorted([start] + listed, key=lambda event: event[0])
    rows = DATA["setpoints"]
    for index, (time_s, sent, p, v, a) in enumerate(rows):
        until_s = rows[index + 1][0] if index + 1 < len(rows) else time_s
        since_s = 0.0
        while since_s == 0.0 or time_s + since_s < until_s - RESEND_S / 2:
            moved = [(x + vx * since_s + ax * since_s**2 / 2, vx + ax * since_s)
                     for x, vx, ax in zip(p, v, a)]
            values = tuple(sent) if mode == "position" else (
                [x for x, _ in moved], [vx for _, vx in moved], a)
            listed.append((time_s + since_s, mode, values))
            since_s += RESEND_S
    return sorted(listed, key=lambda event: event[0])


def prepare(drone, mode):
    """Checks the drone and loads its memory; nothing moves and no lamp changes."""
    drone.ready()
    if mode == "trajectory":
        trajectory = DATA["trajectory"]
        drone.upload(len(trajectory["hex"]) // 2, trajectory["hex"], trajectory["pieces"])
        if on_board(mode):
            drone.upload_lights(on_board(mode)["entries"])


def fly(drone, mode, controller, clock, begin=lambda: None):
    """Takes off, writes and lands. `begin` returns when all drones may start."""
    for name, value in DATA["parameters"] + [["stabilizer.controller", controller]]:
        drone.param(name, value)
    if controller == DATA["controller"]:
        for name, value in DATA["gains"]:
            drone.param(name, value)
    if on_board(mode):
        drone.param("ring.effect", 0)
    drone.log()
    drone.wait_until(drone.clock() + 0.5)
    begin()
    airborne = False
    try:
        drone.arm()
        drone.wait_until(drone.clock() + 0.5)
        airborne = True
        begin_s = 0.0
        if mode == "trajectory":
            x, y, z = DATA["trajectory"]["first_m"]
            begin_s = DATA["before_s"]
            for command, values in [("take_off", (z,)), ("go_to", (x, y, z))]:
                getattr(drone, command)(*values, TAKE_OFF_S)
                drone.wait_until(drone.clock() + TAKE_OFF_S + 0.5)
        zero_s = drone.clock() - begin_s
        for time_s, command, values in events(mode, clock):
            drone.wait_until(zero_s + time_s)
            getattr(drone, command)(*values)
        end_s = (DATA["trajectory"] if mode == "trajectory" else DATA)["end_s"]
        drone.wait_until(zero_s + paced(end_s, clock))
    except LinkLost:
        drone.finish()
        raise
    except BaseException:
        end(drone, mode, airborne)
        raise
    end(drone, mode, airborne)


def end(drone, mode, airborne):
    """Lights off, down, motors off; the log is kept whatever happens."""
    try:
        if airborne:
            if on_board(mode):
                drone.param("ring.effect", 0)
            for values in DATA["dark"]:
                drone.light(*values)
            if mode != "trajectory":
                drone.hand_over()
            duration_s = max(2.0, DATA["top_m"] / SINK_M_S)
            drone.land(duration_s)
            drone.wait_until(drone.clock() + duration_s + 0.5, watching=False)
        drone.stop()
    except KeyboardInterrupt:
        drone.stop()
    except LinkLost:
        pass
    finally:
        drone.finish()


def options(parser):
    parser.add_argument("--mode", choices=["position", "full-state", "trajectory"],
                        default=DATA["mode"], help="what is sent (default: %(default)s)")
    parser.add_argument("--controller", type=int, default=DATA["controller"], metavar="N",
                        help="stabilizer.controller: 1 PID, 2 Mellinger, 5 Lee, or the number of "
                             "your own in your firmware (default: %(default)s)")
    parser.add_argument("--clock", type=float, default=1.0, metavar="RATE",
                        help="rate of the clock on board that paces a trajectory: 0.98824 (84/85) "
                             "on firmware before August 2026 (default: %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="print what would be sent")


def settings(args, parser):
    """Mode, controller and clock as they were typed."""
    if args.controller is None:
        parser.error("this plan is for a controller of your own: say its number with --controller")
    mode = args.mode.replace("-", "_")
    if mode == "trajectory" and not DATA["trajectory"]["hex"]:
        parser.error(DATA["trajectory"]["refused"])
    return mode, args.controller, args.clock if mode == "trajectory" else 1.0


def main():
    parser = argparse.ArgumentParser(description="Writes a word with light.")
    parser.add_argument("--uri", default=DATA["uri"], help="address (default: %(default)s)")
    parser.add_argument("--log", default=DATA["log"], help="file for the flight (%(default)s)")
    options(parser)
    args = parser.parse_args()
    mode, controller, clock = settings(args, parser)
    if args.dry_run:
        prepare(Paper(), mode)
        return fly(Paper(), mode, controller, clock)
    import cflib.crtp
    from cflib.crazyflie import Crazyflie
    from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

    cflib.crtp.init_drivers()
    try:
        with SyncCrazyflie(args.uri, cf=Crazyflie(rw_cache="./cache")) as link:
            link.wait_for_params()
            drone = Drone(link.cf, args.log)
            prepare(drone, mode)
            input("Shutter ready, everyone behind the net? Enter takes off, Ctrl-C ends. ")
            fly(drone, mode, controller, clock)
    except KeyboardInterrupt:
        raise SystemExit("stopped by Ctrl-C") from None
    except Stopped as stopped:
        raise SystemExit(f"error: {stopped}") from None


# The plan, as `noctograph export` made it.
DATA = json.loads(@DATA@)

if __name__ == "__main__":
    main()
