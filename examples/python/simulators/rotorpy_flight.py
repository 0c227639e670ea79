"""A flight of RotorPy as a photograph: `pip install rotorpy`, then `python rotorpy_flight.py NOOR noor.png`."""

import sys

import noctograph as nc
import numpy as np
from rotorpy.controllers.quadrotor_control import SE3Control
from rotorpy.environments import Environment
from rotorpy.vehicles.crazyflie_params import quad_params
from rotorpy.vehicles.multirotor import Multirotor

word, photo = sys.argv[1:]
# Any controller: the design is sent as it is, and the lights follow it.
scene = nc.Scene("cf21", word=word, set={"plan.reference": "design", "plan.light_clock": "setpoint"})
(plan,) = nc.plan(scene)


class Written:
    """The plan as a trajectory of RotorPy."""

    def update(self, t):
        at = max(int(np.searchsorted(plan.time_s, t, "right")) - 1, 0)
        x, v = plan.position_m[at], plan.velocity_m_s[at]
        zero = np.zeros(3)
        return {"x": x + v * (t - plan.time_s[at]), "x_dot": v, "x_ddot": zero, "x_dddot": zero, "x_ddddot": zero,
                "yaw": 0.0, "yaw_dot": 0.0, "yaw_ddot": 0.0}  # fmt: skip


hover = np.sqrt(quad_params["mass"] * 9.81 / 4 / quad_params["k_eta"])
start = {"x": plan.position_m[0], "v": np.zeros(3), "q": np.array([0.0, 0, 0, 1]), "w": np.zeros(3),
         "wind": np.zeros(3), "rotor_speeds": np.full(4, hover)}  # fmt: skip
environment = Environment(
    vehicle=Multirotor(quad_params, initial_state=start), controller=SE3Control(quad_params), trajectory=Written()
)
flown = environment.run(t_final=plan.duration_s, terminate=False, plot=False, animate_bool=False)

time_s, position_m = flown["time"], flown["state"]["x"]
in_force = np.searchsorted(plan.time_s, time_s, "right") - 1
flight = nc.Flight(time_s, position_m, light=plan.light[in_force], design_m=plan.position_m[in_force])
shot = nc.photograph(scene, [flight])
shot.save(photo)
print(shot)
