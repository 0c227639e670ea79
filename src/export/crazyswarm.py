#!/usr/bin/env python3
"""Writes a word with light in Crazyswarm2.

Made by noctograph. Start the server with the crazyflies.yaml beside this script:
    ros2 launch crazyflie launch.py crazyflies_yaml_file:=FOLDER/crazyflies.yaml mocap:=False
In another terminal with Crazyswarm2's workspace sourced, name the firmware release of the drones
(cfclient shows it):
    python3 SCRIPT --firmware 2026.08

Place each drone at the start of its plan, with its nose along the world's x axis, or turned to the left
by the angle in the table that the script prints. Nothing moves before you press Enter. Ctrl-C, `kill`
and a closed window land all drones. A second Ctrl-C, at least half a second later, stops their motors,
so that the drones fall. The noses point as the plan says until Crazyswarm2's landing turns them to the x
axis. A drone that receives no more commands flies to the end of its trajectory and lands by itself 3 s
later. Two seconds after that, the firmware stops its motors and locks it. Stay behind the net until the
propellers stand still.
"""

import argparse
import json
import math
import os
import signal
import time  # its clock, not that of ROS, which is set with the computer's

SINK_M_S = 0.3
PRESS_S = 0.5  # a key that bounces or is hit twice in fright is pressed once
DOWN_M = 0.3  # below this it has landed
SETTLE_S = 10.0
LAND_AT_M = 0.03
# Bits of supervisor.info (firmware supervisor.c).
CAN_BE_ARMED, ARMED, CAN_FLY, FLYING = 1, 2, 8, 16
FAULTS = {32: "tumbled", 64: "locked", 128: "crashed", 2048: "a deck has a fault"}
# The custom topic of crazyflies.yaml.
TOPIC = "noctograph"
# What is left of a path from rest to rest, in ascending powers of the fraction of its time.
LEFT = (1, 0, 0, 0, -35, 84, -70, 20)


class Stopped(Exception):
    """The flight ends, or does not begin. The text is the reason."""


class Presses:
    """Ctrl-C, `kill` and a closed window while the drones fly: counted, and asked for between
    commands, so that none is left unsent."""

    def __init__(self):
        self.times_s = []

    def received(self, *_):
        self.times_s.append(time.monotonic())

    def count(self):
        """None, one, or one and another."""
        return 1 + (self.times_s[-1] - self.times_s[0] >= PRESS_S) if self.times_s else 0


PRESSES = Presses()


def attempt(command, *values):
    """Sends what must not keep anything else from being sent."""
    for _ in range(2):
        try:
            return command(*values)
        except KeyboardInterrupt:  # of another handler: it counts as well, and the command goes out
            PRESSES.received()
        except Exception as error:  # whatever it is, the next drone has to land
            return print(f"warning: {command.__name__}: {error!r}")


def take_off_here(trajectory, place):
    """The trajectory straight up from the place of the drone, and from there to the first letter."""
    up, level = trajectory.polynomials[:2]
    for rise, way, x in ((up.px, level.px, place[0]), (up.py, level.py, place[1])):
        off_m = x - rise.p[0]
        rise.p[0] += off_m
        for k, share in enumerate(LEFT):
            way.p[k] += off_m * share / level.duration**k


class Member:
    """A drone with its plan and what it says of itself."""

    def __init__(self, cf, drone, kinds):
        self.cf, self.drone, self.logged, self.airborne = cf, drone, None, False
        self.stamps, self.heard, self.wrong_s = {TOPIC: 0, "pose": 0}, {}, {}
        for topic, kind in zip((TOPIC, "pose"), kinds):
            cf.node.create_subscription(kind, f"{cf.prefix}/{topic}", getattr(self, topic), 10)

    def noctograph(self, message):
        self.logged = list(message.values)
        self.stamps[TOPIC] += 1

    def pose(self, message):
        self.stamps["pose"] += 1

    def faults(self):
        info = self.cf.get_status()["supervisor"]
        return [name for bit, name in FAULTS.items() if info & bit]

    def is_inside(self):
        """True if it is in the volume that was checked. What is not a number is outside."""
        (low, high), most_m = DATA["volume_m"], DATA["fence_m"]
        lows = low[:2] + [-math.inf]
        return all(a - most_m <= x <= b + most_m
                   for a, x, b in zip(lows, self.cf.get_position(), high))

    def rows(self):
        """What is checked on the floor: (what, found, wanted, right)."""
        drone, status = self.drone, self.cf.get_status()
        variances, angles = self.logged[:3], [math.radians(a) for a in self.logged[3:]]
        (x, y, _), (start_x, start_y) = self.cf.get_position(), drone["start_m"]
        most_m2 = DATA["variance_m2"]
        off_rad = (angles[2] - drone["yaw_rad"] + math.pi) % (2 * math.pi) - math.pi
        tilt_rad = max(abs(angles[0]), abs(angles[1]))
        info, faults = status["supervisor"], self.faults()
        ready = not faults and not info & FLYING and info & (CAN_FLY | CAN_BE_ARMED)
        return [
            ("state", ", ".join(faults) or ("can fly" if ready else f"supervisor {info}"),
             "can fly or be armed", bool(ready)),
            ("battery at rest", f"{status['battery']:.2f} V", f"{drone['least_rest_v']:.2f} V",
             status["battery"] >= drone["least_rest_v"]),
            ("position settled",
             ", ".join(f"{100 * math.sqrt(abs(variance)):.1f}" for variance in variances) + " cm",
             f"{100 * math.sqrt(most_m2):.1f} cm", all(v <= most_m2 for v in variances)),
            ("place", f"({x:.2f}, {y:.2f}) m", f"({start_x:.2f}, {start_y:.2f}) m",
             math.hypot(x - start_x, y - start_y) <= DATA["start_radius_m"]),
            ("nose", f"{math.degrees(angles[2]):.0f} deg",
             f"{math.degrees(drone['yaw_rad']):.0f} deg", abs(off_rad) <= DATA["nose_rad"]),
            ("level", f"{math.degrees(tilt_rad):.1f} deg",
             f"{math.degrees(DATA['level_rad']):.0f} deg", tilt_rad <= DATA["level_rad"]),
        ]

    def watch(self, now_s):
        """Ends the flight if the drone reports something wrong for long enough."""
        status = self.cf.get_status()
        self.stamps["status"] = status["timestamp_sec"], status["timestamp_nsec"]
        for topic, stamp in self.stamps.items():
            if topic not in self.heard or stamp != self.heard[topic][0]:
                self.heard[topic] = (stamp, now_s)
            if now_s - self.heard[topic][1] > DATA["silent_s"]:
                alone = ("; if the drone took off and receives no command, it flies to the end and lands "
                         "by itself: stay behind the net until its propellers stand still")
                raise Stopped(f"{self.name()}: no {topic} topic for {DATA['silent_s']:.0f} s"
                              + alone * self.airborne)
        if self.faults():
            raise Stopped(f"{self.name()}: {', '.join(self.faults())}: the firmware has stopped its "
                          "motors" + ", it falls" * self.airborne)
        wrong = {
            "the battery is empty": not status["battery"] >= DATA["critical_v"],
            "the position is lost": not all(v <= DATA["lost_m2"] for v in self.logged[:3]),
            "outside the checked volume": not self.is_inside(),
        }
        for what, is_wrong in wrong.items():
            since_s = self.wrong_s.setdefault(what, now_s) if is_wrong else now_s
            if not is_wrong:
                self.wrong_s.pop(what, None)
            if now_s - since_s > DATA["wrong_s"]:
                raise Stopped(f"{self.name()}: {what}")

    def name(self):
        return self.drone["name"]

    def is_down(self):
        """True if it is known to be on the floor: it was not commanded to fly, or still reports it."""
        says_m = self.cf.get_position()[2]
        stamp = self.heard.get("pose", (None,))[0]
        return not self.airborne or (stamp != self.stamps["pose"] and says_m < DOWN_M)


class Flight:
    """All drones, from the checks on the floor to the floor again."""

    def __init__(self, swarm, rate, kinds, trajectory, spin_once):
        self.rate, self.trajectory = rate, trajectory
        self.node, self.spin_once = swarm.timeHelper.node, spin_once
        known = swarm.allcfs.crazyfliesByName
        missing = [drone["name"] for drone in DRONES if drone["name"] not in known]
        if missing:
            raise Stopped(f"the server has no {', '.join(missing)}: start it with the "
                          "crazyflies.yaml beside this script")
        self.crew = [Member(known[drone["name"]], drone, kinds) for drone in DRONES]

    def sleep(self, seconds):
        """Hears the drones for some seconds."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            self.spin_once(self.node, timeout_sec=min(0.05, end_s - time.monotonic()))

    def set(self, member, parameters):
        for name, value in parameters:
            member.cf.setParam(name, value)

    def prepare(self):
        """Checks every drone and loads its memory. Nothing moves and no lamp changes."""
        for member in self.crew:
            drone = member.drone
            names = [name for name, *_ in drone["before"] + drone["parameters"] + drone["dark"]]
            lacks = sorted({name for name in names if name not in member.cf.paramTypeDict})
            if lacks:
                raise Stopped(f"{member.name()}: its firmware has no {', '.join(lacks)}")
            self.set(member, drone["before"])
        self.sleep(0.1)
        for member in self.crew:
            member.cf.setParam("kalman.resetEstimation", 0)
        self.sleep(2.0)
        end_s = time.monotonic() + SETTLE_S
        while not all(self.settled(member) for member in self.crew):
            if time.monotonic() > end_s:
                break
            self.sleep(0.2)
        self.table()
        for member in self.crew:
            trajectory = self.trajectory()
            folder = os.path.dirname(os.path.abspath(__file__))
            trajectory.loadcsv(os.path.join(folder, member.drone["csv"]))
            take_off_here(trajectory, member.cf.get_position())
            member.cf.uploadTrajectory(0, 0, trajectory)

    def settled(self, member):
        return (member.cf.get_status() and member.logged
                and all(variance <= DATA["variance_m2"] for variance in member.logged[:3]))

    def table(self):
        """Prints what was found and wanted of every drone. Goes on when all is right."""
        wrong = []
        for member in self.crew:
            if not member.cf.get_status() or not member.logged:
                raise Stopped(f"{member.name()}: no {TOPIC} or status topic: start the server with "
                              "the crazyflies.yaml beside this script")
            for what, found, wanted, right in member.rows():
                mark = "ok" if right else "STOP"
                print(f"{mark:5}{member.name():5}{what:18}{found:24}wanted: {wanted}")
                wrong += [] if right else [f"{member.name()}: {what} is {found}, wanted {wanted}"]
        if wrong:
            raise Stopped("; ".join(wrong))
        print(f"check by eye that the drones are {DATA['platform']}, carry the lamps of the plan, and "
              "stand in a frame with the middle of the room at x = y = 0"
              + (f", a room of {'x'.join(f'{m:g}' for m in DATA['room_m'])} m" if DATA["room_m"]
                 else ""))

    def wait_until(self, time_s):
        while True:
            now_s = time.monotonic()
            for member in self.crew:
                member.watch(now_s)
            if PRESSES.count():
                raise KeyboardInterrupt
            if now_s >= time_s:
                return
            self.sleep(min(0.05, time_s - now_s))

    def set_armed(self, armed):
        for member in self.crew:
            def arm_or_disarm():
                member.cf.arm(armed)

            if armed or member.is_down():
                attempt(arm_or_disarm)
            else:
                print(f"{member.name()}: it may be in the air, so it is not disarmed: stay behind the net "
                      "until its propellers stand still")

    def fly(self):
        """Takes off, writes and lands."""
        for member in self.crew:
            self.set(member, member.drone["parameters"])
        self.sleep(1.0)
        for member in self.crew:
            member.heard = {}
        try:
            self.set_armed(True)
            self.wait_until(time.monotonic() + 1.0)
            for member in self.crew:
                if not member.cf.get_status()["supervisor"] & CAN_FLY:
                    raise Stopped(f"{member.name()}: armed, but it cannot fly")
            for member in self.crew:
                member.airborne = True
            self.write()
        except KeyboardInterrupt:
            if not PRESSES.count():
                PRESSES.received()
            raise
        finally:
            self.land()

    def write(self):
        """Starts the trajectories, and switches the lamps at the times of the plan."""
        events = []
        for member in self.crew:
            cf, drone = member.cf, member.drone
            # On the plan's places, and as fast as planned whatever the clock on board.
            events.append((drone["start_s"], cf.startTrajectory, (0, self.rate, False, False)))
            events += [(time_s, cf.setParam, (name, value))
                       for time_s, name, value in drone["lights"]]
            events.append((drone["end_s"], cf.get_status, ()))
        events.sort(key=lambda event: event[0])
        zero_s = time.monotonic() - min(drone["start_s"] for drone in DRONES)
        for time_s, command, values in events:
            self.wait_until(zero_s + time_s)
            command(*values)

    def land(self):
        """Lands before all else, even if a lamp fails."""
        lasts_s = max(2.0, max(drone["top_m"] for drone in DRONES) / SINK_M_S)
        airborne = [member for member in self.crew if member.airborne]
        for member in airborne:
            attempt(member.cf.land, LAND_AT_M, lasts_s)
        for member in self.crew:
            for name, value in member.drone["dark"]:
                attempt(member.cf.setParam, name, value)
        if airborne:
            self.come_down(lasts_s / self.rate + 0.5)
        self.set_armed(False)
        for member in self.crew:
            # The board's LEDs shine again: the red one says that a battery is low.
            attempt(member.cf.setParam, "led.bitmask", 0)
        print("the drones keep the controller and the gains of this flight until they restart")

    def come_down(self, lasts_s):
        """Waits for the floor. A second press cuts the motors."""
        for member in self.crew:
            member.heard["pose"] = (member.stamps["pose"], 0.0)
        end_s, asked = time.monotonic() + lasts_s, False
        while time.monotonic() < end_s:
            attempt(self.sleep, min(0.05, end_s - time.monotonic()))
            if PRESSES.count() and not asked:
                asked = True
                print("landing; press Ctrl-C again to stop the motors")
            if PRESSES.count() > 1:
                for member in self.crew:
                    attempt(member.cf.emergency)
                    member.airborne = False
                return print("motors stopped")


def clock_rate(text):
    """Seconds of the clock on board in a true second, by the release of the firmware."""
    try:
        release = tuple(int(part) for part in text.split("."))
        slow = release[:2] <= tuple(int(part) for part in DATA["last_slow_release"].split("."))
    except ValueError:
        raise argparse.ArgumentTypeError("wanted a release such as 2026.08") from None
    if len(release) < 2 or release[0] < 2015:
        raise argparse.ArgumentTypeError("wanted a release such as 2026.08")
    return DATA["slow_clock"] if slow else 1.0


def main(arguments=None):
    parser = argparse.ArgumentParser(description="Writes a word with light in Crazyswarm2.")
    parser.add_argument("--firmware", type=clock_rate, required=True, metavar="RELEASE",
                        help="release of the drones' firmware, such as 2026.08 (cfclient shows it): "
                             f"up to {DATA['last_slow_release']} its clock is slow, and the "
                             "trajectory is sped up for it")
    rate = parser.parse_args(arguments).firmware
    from crazyflie_interfaces.msg import LogDataGeneric
    from crazyflie_py import Crazyswarm
    from crazyflie_py.uav_trajectory import Trajectory
    from geometry_msgs.msg import PoseStamped
    from rclpy import spin_once
    from rclpy.signals import uninstall_signal_handlers

    swarm = Crazyswarm()
    # Those of ROS shut it down at Ctrl-C, and nothing could be told to land anymore.
    uninstall_signal_handlers()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        flight = Flight(swarm, rate, (LogDataGeneric, PoseStamped), Trajectory, spin_once)
        flight.prepare()
        input("Is the shutter ready, and is everyone behind the net? Press Enter to take off, or Ctrl-C to "
              "exit. ")
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            signal.signal(getattr(signal, name), PRESSES.received)
        flight.fly()
    except KeyboardInterrupt:
        raise SystemExit("stopped by Ctrl-C or another signal") from None
    except Stopped as stopped:
        raise SystemExit(f"error: {stopped}") from None


# What was checked, and one entry for each drone, as `noctograph export` made it.
DATA = json.loads(@DATA@)
DRONES = DATA["drones"]

if __name__ == "__main__":
    main()
