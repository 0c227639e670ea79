"""Photographs a flight of crazyflow: `pip install crazyflow`, then `python crazyflow_flight.py NOOR noor.png`.

Run with crazyflow 0.4.0, JAX 0.10.1 and MuJoCo 4.0.0.
"""

import sys

import noctograph as nc
import numpy as np
from crazyflow.control import Control
from crazyflow.sim import Sim

word, photo = sys.argv[1:]
# For any controller, the setpoints and the lights are those of the design.
scene = nc.Scene("cf21", word=word, set={"plan.reference": "design", "plan.light_clock": "setpoint"})
(plan,) = nc.plan(scene)

sim = Sim(drone="cf2x_L250", dynamics="first_principles", control=Control.state, freq=500, state_freq=100)
sim.reset()
states = sim.data.states
sim.data = sim.data.replace(states=states.replace(pos=states.pos.at[...].set(plan.position_m[0])))

time_s = np.arange(0, plan.duration_s, 1 / 100)
design = plan.at(time_s)
flown = []
for x, v, a in zip(design.position_m, design.velocity_m_s, design.acceleration_m_s2):
    flown.append([np.asarray(sim.data.states.pos[0, 0]), np.asarray(sim.data.states.quat[0, 0])])
    command = [*x, *v, *a, 0, 0, 0, 1, 0, 0, 0]  # the last seven: quaternion x, y, z, w and rates
    sim.state_control(np.array([[command]], np.float32))
    sim.step(5)

position_m, quaternion = zip(*flown)
attitude_rad = nc.attitude_rad(quaternion)
flight = nc.Flight(time_s, position_m, light=design.light, attitude_rad=attitude_rad, design_m=design.position_m)
shot = nc.photograph(scene, flight)
shot.save(photo)
print(shot)
