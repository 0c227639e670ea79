"""Photographs a flight of MuJoCo: `pip install mujoco`, then `python mujoco_flight.py NOOR noor.png cf2.xml`.

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
# For any controller, the setpoints and the lights are those of the design.
scene = nc.Scene("cf21", word=word, set={"plan.reference": "design", "plan.light_clock": "setpoint"})
(plan,) = nc.plan(scene)

xml = re.sub(r'<(mesh|geom) [^>]*(file|mesh)="[^>]*/>', "", open(model_file).read())
model = mujoco.MjModel.from_xml_string(xml.replace("-0.00001 0.00001", "-0.01 0.01"))
data, mass, inertia = mujoco.MjData(model), model.body_mass.sum(), model.body_inertia[1]
data.qpos[:3] = plan.position_m[0]
time_s = np.arange(0, plan.duration_s, model.opt.timestep)
design, flown = plan.at(time_s), []
for x, v, a in zip(design.position_m, design.velocity_m_s, design.acceleration_m_s2):
    mujoco.mj_kinematics(model, data)
    flown.append(data.qpos[:7].copy())
    # Geometric control: the thrust acts along the body's z, and the torque turns z toward the desired force and x forward.
    rotation = data.xmat[1].reshape(3, 3)
    force = mass * (a + [0, 0, 9.81] + 30 * (x - data.qpos[:3]) + 10 * (v - data.qvel[:3]))
    turn = rotation.T @ np.cross(rotation[:, 2], force / np.linalg.norm(force)) - [0, 0, rotation[1, 0]]
    data.ctrl[:] = [force @ rotation[:, 2], *-inertia * (800 * turn - 40 * data.qvel[3:6])]  # its gears are negative
    mujoco.mj_step(model, data)

position_m, quaternion = np.split(np.array(flown), [3], axis=1)
attitude_rad = nc.attitude_rad(quaternion, "wxyz")
flight = nc.Flight(time_s, position_m, light=design.light, attitude_rad=attitude_rad, design_m=design.position_m)
shot = nc.photograph(scene, flight)
shot.save(photo)
print(shot)
