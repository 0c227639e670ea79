"""Photographs a flight of RotorPy: `pip install rotorpy`, then `python rotorpy_flight.py NOOR noor.png`.

Run with rotorpy 3.0.0.
"""

import sys

import noctograph as nc
import numpy as np
from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.environments import Environment
from rotorpy.vehicles.crazyflie_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor

word, photo = sys.argv[1:]
# For any controller, the setpoints and the lights are those of the design.
scene = nc.Scene("cf21", word=word, set={"plan.reference": "design", "plan.light_clock": "setpoint"})
(plan,) = nc.plan(scene)


class Trajectory:
    def update(self, t):
        x, v, a, j, yaw, *_ = plan.at(t)
        return {"x": x, "x_dot": v, "x_ddot": a, "x_dddot": j, "x_ddddot": 0 * j, "yaw": yaw, "yaw_dot": 0.0, "yaw_ddot": 0.0}


hover = np.sqrt(quad_params["mass"] * 9.81 / 4 / quad_params["k_eta"])
start = {"x": plan.position_m[0], "v": np.zeros(3), "q": np.array([0.0, 0, 0, 1]), "w": np.zeros(3),
         "wind": np.zeros(3), "rotor_speeds": np.full(4, hover)}  # fmt: skip
environment = Environment(Multirotor(quad_params, initial_state=start), SE3Control(quad_params), Trajectory())
flown = environment.run(t_final=plan.duration_s, terminate=False, plot=False, animate_bool=False)

time_s, position_m, attitude_rad = flown["time"], flown["state"]["x"], nc.attitude_rad(flown["state"]["q"])
design = plan.at(time_s)
flight = nc.Flight(time_s, position_m, light=design.light, attitude_rad=attitude_rad, design_m=design.position_m)
shot = nc.photograph(scene, flight)
shot.save(photo)
print(shot)
