#!/usr/bin/env python3
"""Flies a light painting with a Crazyflie, switches its lights and records the flight.

Made by noctograph. Needs: pip install cflib
    python3 SCRIPT --dry-run      prints everything that would be sent, without a radio
    python3 SCRIPT --uri radio://0/80/2M/E7E7E7E7E7

The drone stands where it will take off, x to the photographer's right, and the positioning system
runs. Nothing moves before you press Enter. Ctrl-C lands; a second Ctrl-C stops the motors.
"""

import argparse
import json
import sys
import threading
import time

DATA = json.loads(@DATA@)

BATTERY_MIN_V = 3.8  # at rest; a full cell has 4.1 to 4.2 V
START_RADIUS_M = 0.3  # largest distance of the drone from the plan's start
VARIANCE_MAX_M2 = 1e-3  # of the estimated position, when it has settled
SETTLE_S = 10.0
TAKE_OFF_S = 2.5
LAND_S = 2.5
LOG_PERIOD_MS = 20

# What noctograph's import, compare and learn read; 26 bytes of payload a block at most.
LOG = {
    "position": ["stateEstimate.x", "stateEstimate.y", "stateEstimate.z",
                 "stateEstimate.vx", "stateEstimate.vy", "stateEstimate.vz"],
    "attitude": ["stateEstimate.yaw", "stateEstimate.pitch", "stateEstimate.roll"],
    "rate": ["gyro.x", "gyro.y", "gyro.z"],
    "target": ["ctrltarget.x", "ctrltarget.y", "ctrltarget.z"],
    "motors": ["motor.m1", "motor.m2", "motor.m3", "motor.m4", "pm.vbat"],
}


class LinkLost(Exception):
    """The radio link broke; the firmware's watchdog takes the drone down."""


class Paper:
    """Stands in for a drone in a dry run: prints what would be sent, and takes no time."""

    def __init__(self):
        self.now_s = 0.0

    def clock(self):
        return self.now_s

    def wait_until(self, time_s):
        self.now_s = max(self.now_s, time_s)

    def __getattr__(self, command):
        def send(*values):
            text = ", ".join(f"{v:.4f}" if isinstance(v, float) else str(v) for v in values)
            print(f"{self.now_s:9.3f} s  {command}({text})")
        return send

    def ready(self):
        print("           checks battery, position and its variance")

    def finish(self):
        print("           writes the log")


class Drone:
    """A Crazyflie on the radio."""

    def __init__(self, cf, log_file):
        self.cf, self.log_file = cf, log_file
        self.high = cf.high_level_commander
        self.columns, self.blocks, self.latest = {}, [], {}
        self.lost = threading.Event()
        cf.disconnected.add_callback(lambda uri: self.lost.set())
        cf.connection_lost.add_callback(lambda uri, message: self.lost.set())

    def clock(self):
        return time.monotonic()

    def wait_until(self, time_s):
        while True:
            if self.lost.is_set():
                raise LinkLost("the radio link was lost")
            left_s = time_s - time.monotonic()
            if left_s <= 0.0:
                return
            time.sleep(min(left_s, 0.05))

    def param(self, name, value):
        self.cf.param.set_value(name, value)

    def position(self, x, y, z):
        self.cf.commander.send_position_setpoint(x, y, z, 0.0)

    def full_state(self, p, v, a):
        self.cf.commander.send_full_state_setpoint(p, v, a, [0.0, 0.0, 0.0, 1.0], 0.0, 0.0, 0.0)

    def upload(self, data, n_pieces):
        from cflib.crazyflie.mem import MemoryElement

        class Raw:
            def pack(self):
                return data

        memory = self.cf.mem.get_mems(MemoryElement.TYPE_TRAJ)[0]
        memory.trajectory = [Raw()]
        if not memory.write_data_sync():
            raise RuntimeError("the trajectory could not be uploaded")
        self.high.define_trajectory(1, 0, n_pieces, type=1)

    def start_trajectory(self):
        self.high.start_trajectory(1, 1.0, False)

    def take_off(self, z, duration_s):
        self.high.takeoff(z, duration_s)

    def go_to(self, x, y, z, duration_s):
        self.high.go_to(x, y, z, 0.0, duration_s)

    def arm(self):
        self.cf.supervisor.send_arming_request(True)

    def hand_over(self):
        self.cf.commander.send_notify_setpoint_stop()

    def land(self, duration_s):
        self.high.land(0.0, duration_s)

    def stop(self):
        self.cf.commander.send_stop_setpoint()
        self.high.stop()

    def log(self):
        from cflib.crazyflie.log import LogConfig

        for name, variables in LOG.items():
            block = LogConfig(name=name, period_in_ms=LOG_PERIOD_MS)
            for variable in variables:
                block.add_variable(variable)
                self.columns[variable] = {"time": [], "data": []}
            block.data_received_cb.add_callback(self._row)
            self.cf.log.add_config(block)
            block.start()
            self.blocks.append(block)

    def _row(self, timestamp_ms, values, block):
        for variable, value in values.items():
            self.columns[variable]["time"].append(timestamp_ms)
            self.columns[variable]["data"].append(value)

    def ready(self):
        """Waits for a position that has settled; refuses a low battery and a wrong place."""
        from cflib.crazyflie.log import LogConfig

        check = LogConfig(name="check", period_in_ms=100)
        for variable in ["stateEstimate.x", "stateEstimate.y", "pm.vbat",
                         "kalman.varPX", "kalman.varPY", "kalman.varPZ"]:
            check.add_variable(variable)
        check.data_received_cb.add_callback(lambda stamp, values, block: self.latest.update(values))
        self.cf.log.add_config(check)
        check.start()
        end_s = self.clock() + SETTLE_S
        settled = False
        while not settled:
            if self.clock() > end_s:
                sys.exit(f"error: no settled position after {SETTLE_S:.0f} s ({self.latest}); is the "
                         "positioning system on, and its geometry on the drone?")
            self.wait_until(self.clock() + 0.2)
            variances = [self.latest.get(f"kalman.varP{axis}", 1.0) for axis in "XYZ"]
            settled = max(variances) < VARIANCE_MAX_M2
        check.stop()
        battery_v = self.latest.get("pm.vbat", 0.0)
        if battery_v < BATTERY_MIN_V:
            sys.exit(f"error: the battery has {battery_v:.2f} V, {BATTERY_MIN_V} V are wanted: "
                     "charge it")
        x, y = self.latest["stateEstimate.x"], self.latest["stateEstimate.y"]
        start_x, start_y, _ = DATA["start_m"]
        if abs(x - start_x) > START_RADIUS_M or abs(y - start_y) > START_RADIUS_M:
            sys.exit(f"error: the drone stands at ({x:.2f}, {y:.2f}) m, the plan starts at "
                     f"({start_x:.2f}, {start_y:.2f}) m: carry it there")
        print(f"ready: battery {battery_v:.2f} V, at ({x:.2f}, {y:.2f}) m")

    def finish(self):
        for block in self.blocks:
            if not self.lost.is_set():
                block.stop()
        with open(self.log_file, "w", encoding="utf-8") as file:
            json.dump(self.columns, file)
        print(f"log: {self.log_file}; next: noctograph import {self.log_file}")


def events(mode, clock):
    """Everything that is sent while writing: (time in s, command, values), in order of time."""
    listed = [(t / clock, "param", (name, value)) for t, name, value in DATA["lights"]]
    if mode == "trajectory":
        listed.append((DATA["trajectory"]["start_s"], "start_trajectory", ()))
    else:
        for t, sent, p, v, a in DATA["setpoints"]:
            send = ("position", tuple(sent)) if mode == "position" else ("full_state", (p, v, a))
            listed.append((t, *send))
    return sorted(listed, key=lambda event: event[0])


def fly(drone, mode, clock):
    for name, value in DATA["parameters"] + [["stabilizer.controller", DATA["controllers"][mode]]]:
        drone.param(name, value)
    drone.ready()
    if mode == "trajectory":
        drone.upload(bytes.fromhex(DATA["trajectory"]["hex"]), DATA["trajectory"]["pieces"])
    if not isinstance(drone, Paper):
        input("Lights out, shutter ready? Enter takes off, Ctrl-C ends. ")
    drone.log()
    drone.arm()
    try:
        x, y, z = DATA["first_m"]
        drone.take_off(z, TAKE_OFF_S)
        drone.wait_until(drone.clock() + TAKE_OFF_S)
        drone.go_to(x, y, z, TAKE_OFF_S)
        drone.wait_until(drone.clock() + TAKE_OFF_S)
        zero_s = drone.clock() - DATA["write_from_s"]
        for time_s, command, values in events(mode, clock):
            if time_s >= DATA["write_from_s"]:
                drone.wait_until(zero_s + time_s)
                getattr(drone, command)(*values)
        drone.wait_until(zero_s + DATA["write_to_s"])
    finally:
        end(drone, mode)


def end(drone, mode):
    """Lights off, down, motors off; the log is kept whatever happens."""
    try:
        for name, value in DATA["dark"]:
            drone.param(name, value)
        if mode != "trajectory":
            drone.hand_over()
        drone.land(LAND_S)
        drone.wait_until(drone.clock() + LAND_S)
        drone.stop()
    except KeyboardInterrupt:
        drone.stop()
    except LinkLost:
        pass
    finally:
        drone.finish()


def main():
    parser = argparse.ArgumentParser(description=f"Writes {DATA['word']!r} with light.")
    parser.add_argument("--uri", default="radio://0/80/2M/E7E7E7E7E7")
    parser.add_argument("--mode", choices=["position", "full-state", "trajectory"],
                        default=DATA["mode"], help="what is sent (default: %(default)s)")
    parser.add_argument("--clock", type=float, default=DATA["clock"], metavar="RATE",
                        help="rate of the on-board trajectory clock; 0.98824 (84/85) on firmware "
                             "before August 2026 (default: %(default)s)")
    parser.add_argument("--log", default=DATA["log"], help="file for the flight (%(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="print what would be sent")
    args = parser.parse_args()
    mode = args.mode.replace("-", "_")
    clock = args.clock if mode == "trajectory" else 1.0
    if args.dry_run:
        return fly(Paper(), mode, clock)
    import cflib.crtp
    from cflib.crazyflie import Crazyflie
    from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

    cflib.crtp.init_drivers()
    with SyncCrazyflie(args.uri, cf=Crazyflie(rw_cache="./cache")) as link:
        try:
            fly(Drone(link.cf, args.log), mode, clock)
        except KeyboardInterrupt:
            sys.exit("stopped by Ctrl-C")
        except LinkLost as lost:
            sys.exit(f"error: {lost}")


if __name__ == "__main__":
    main()
