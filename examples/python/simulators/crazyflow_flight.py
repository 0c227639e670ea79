"""A flight of crazyflow as a photograph: `pip install crazyflow`, then `python crazyflow_flight.py NOOR noor.png`."""

import sys

import noctograph as nc
import numpy as np
from crazyflow.control import Control
from crazyflow.sim import Sim

word, photo = sys.argv[1:]
# Any controller: the design is sent as it is, and the lights follow it.
scene = nc.Scene("cf21", word=word, set={"plan.reference": "design", "plan.light_clock": "setpoint"})
(plan,) = nc.plan(scene)

sim = Sim(drone="cf2x_L250", dynamics="first_principles", control=Control.state, freq=500, state_freq=100)
sim.reset()
states = sim.data.states
sim.data = sim.data.replace(states=states.replace(pos=states.pos.at[...].set(plan.position_m[0])))

time_s = np.arange(0, plan.duration_s, 1 / 100)
in_force = np.searchsorted(plan.time_s, time_s, "right") - 1
ahead_s = (time_s - plan.time_s[in_force])[:, None]
design_m = plan.position_m[in_force] + plan.velocity_m_s[in_force] * ahead_s
position_m = []
for position, velocity in zip(design_m, plan.velocity_m_s[in_force]):
    position_m.append(np.asarray(sim.data.states.pos[0, 0]))
    command = [*position, *velocity, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]  # then acceleration, quaternion, rates
    sim.state_control(np.array([[command]], np.float32))
    sim.step(5)

flight = nc.Flight(time_s, position_m, light=plan.light[in_force], design_m=design_m)
shot = nc.photograph(scene, [flight])
shot.save(photo)
print(shot)
