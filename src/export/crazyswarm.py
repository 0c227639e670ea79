#!/usr/bin/env python3
"""Writes a word with light in Crazyswarm2.

Made by noctograph. Start the server with the crazyflies.yaml beside this script, then:
    ros2 run SCRIPT, or python3 SCRIPT with Crazyswarm2's workspace sourced
Nothing moves before you press Enter. Ctrl-C lands all drones.
"""

import json
import os

TAKE_OFF_S = 3.0
SINK_M_S = 0.3


def main():
    from crazyflie_py import Crazyswarm
    from crazyflie_py.uav_trajectory import Trajectory

    swarm = Crazyswarm()
    clock, crew = swarm.timeHelper, list(zip(swarm.allcfs.crazyflies, DRONES))
    folder = os.path.dirname(os.path.abspath(__file__))
    for cf, drone in crew:
        trajectory = Trajectory()
        trajectory.loadcsv(os.path.join(folder, drone["csv"]))
        cf.uploadTrajectory(0, 0, trajectory)
        for name, value in drone["parameters"]:
            cf.setParam(name, value)
    input("Shutter ready, everyone behind the net? Enter takes off, Ctrl-C ends. ")
    try:
        for cf, drone in crew:
            cf.takeoff(drone["first_m"][2], TAKE_OFF_S)
        clock.sleep(TAKE_OFF_S + 0.5)
        for cf, drone in crew:
            cf.goTo(drone["first_m"], drone["yaw_rad"], TAKE_OFF_S)
        clock.sleep(TAKE_OFF_S + 0.5)
        events = [(drone["start_s"], cf.startTrajectory, (0,)) for cf, drone in crew]
        events += [(time_s, cf.setParam, (name, value))
                   for cf, drone in crew for time_s, name, value in drone["lights"]]
        events += [(drone["end_s"] + 0.2, lambda: None, ()) for _, drone in crew]
        events.sort(key=lambda event: event[0])
        zero_s = clock.time() - min(drone["start_s"] for drone in DRONES)
        for time_s, command, values in events:
            clock.sleep(max(0.0, zero_s + time_s - clock.time()))
            command(*values)
    finally:
        top_m = max(drone["top_m"] for drone in DRONES)
        for cf, drone in crew:
            for name, value in drone["dark"]:
                cf.setParam(name, value)
            cf.land(0.03, top_m / SINK_M_S)
        clock.sleep(top_m / SINK_M_S + 0.5)


# One entry for each drone, as `noctograph export` made it.
DRONES = json.loads(@DATA@)

if __name__ == "__main__":
    main()
