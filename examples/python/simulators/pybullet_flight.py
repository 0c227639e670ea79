"""Photographs a flight of gym-pybullet-drones: `python pybullet_flight.py NOOR noor.png`.

It is not in the Python package index: `pip install git+https://github.com/utiasDSL/gym-pybullet-drones`.
Run with gym-pybullet-drones 2.1.0 (commit 90b178a) and pybullet 3.2.7.
"""

import sys

import noctograph as nc
import numpy as np
from gym_pybullet_drones.control.DSLPIDControl import DSLPIDControl
from gym_pybullet_drones.envs.CtrlAviary import CtrlAviary
from gym_pybullet_drones.utils.enums import DroneModel

word, photo = sys.argv[1:]
# For any controller, the setpoints and the lights are those of the design.
scene = nc.Scene("cf21", word=word, set={"plan.reference": "design", "plan.light_clock": "setpoint"})
(plan,) = nc.plan(scene)

hertz = 240
start_m = plan.position_m[:1] + [0, 0, 0.03]
aviary = CtrlAviary(DroneModel.CF2X, initial_xyzs=start_m, pyb_freq=hertz, ctrl_freq=hertz, user_debug_gui=False)
controller = DSLPIDControl(DroneModel.CF2X)
time_s = np.arange(0, plan.duration_s, 1 / hertz)
design = plan.at(time_s)
observations, rpm = [], np.zeros((1, 4))
for x, v in zip(design.position_m, design.velocity_m_s):
    observations.append(aviary.step(rpm)[0][0])
    rpm[0], _, _ = controller.computeControlFromState(1 / hertz, observations[-1], target_pos=x, target_vel=v)
aviary.close()

flight = nc.from_pybullet(time_s, observations, light=design.light, design_m=design.position_m)
shot = nc.photograph(scene, flight)
shot.save(photo)
print(shot)
