"""A flight of MuJoCo as a photograph: `pip install mujoco`, then `python mujoco_flight.py NOOR noor.png cf2.xml`.

The Crazyflie is Menagerie's: `bitcraze_crazyflie_2/cf2.xml` of https://github.com/google-deepmind/mujoco_menagerie,
read without its meshes. It brings no controller. Its torques, at most 1e-5 N m as shipped, do not turn it fast enough
to write: here they are 1e-2 N m. Run with MuJoCo 4.0.0 and Menagerie's commit 24d7b69.
"""

import re
import sys

import mujoco
import noctograph as nc
import numpy as np

word, photo, model_file = sys.argv[1:]
# Any controller: the design is sent as it is, and the lights follow it.
scene = nc.Scene("cf21", word=word, set={"plan.reference": "design", "plan.light_clock": "setpoint"})
(plan,) = nc.plan(scene)

xml = re.sub(r'<(mesh|geom) [^>]*(file|mesh)="[^>]*/>', "", open(model_file).read())
model = mujoco.MjModel.from_xml_string(xml.replace("-0.00001 0.00001", "-0.01 0.01"))
data, gravity = mujoco.MjData(model), np.array([0, 0, 9.81])
data.qpos[:3] = plan.position_m[0]
time_s = np.arange(0, plan.duration_s, model.opt.timestep)
design, mass, flown = plan.at(time_s), model.body_mass.sum(), []
for x, v, a in zip(design.position_m, design.velocity_m_s, design.acceleration_m_s2):
    # Geometric control: the thrust along the body's z, the torque turns it toward the force.
    force = mass * (a + gravity + 30 * (x - data.qpos[:3]) + 10 * (v - data.qvel[:3]))
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, data.qpos[3:7])
    rotation = rotation.reshape(3, 3)
    up = force / np.linalg.norm(force)
    ahead = np.cross([0, 1, 0], up)
    wanted = np.stack([ahead / np.linalg.norm(ahead), np.cross(up, ahead / np.linalg.norm(ahead)), up], axis=1)
    twist = wanted.T @ rotation - rotation.T @ wanted
    turn = -400 * np.array([twist[2, 1], twist[0, 2], twist[1, 0]]) - 40 * data.qvel[3:6]
    torque = model.body_inertia[1] * turn
    data.ctrl[:] = [force @ rotation[:, 2], *-torque]  # its gears are negative
    flown.append(data.qpos[:7].copy())
    mujoco.mj_step(model, data)

flown = np.array(flown)
flight = nc.Flight(
    time_s, flown[:, :3], light=design.light, attitude_rad=nc.attitude_rad(flown[:, 3:], "wxyz"), design_m=design.position_m
)
shot = nc.photograph(scene, flight)
shot.save(photo)
print(shot)
