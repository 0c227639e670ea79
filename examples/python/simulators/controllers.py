"""Controllers of RotorPy, crazyflow and gym-pybullet-drones in Noctograph: `nc.fly(scene, controller=RotorPy(scene))`.

As classes they are what `nc.fly_many`, `nc.rank` and a graded submission take, too. Each imports its simulator when
it is made.
"""

import numpy as np
from scipy.spatial.transform import Rotation


class RotorPy:
    """`SE3Control` with the mass and the inertia of the scene's drone."""

    def __init__(self, scene):
        from rotorpy.controllers.quadrotor_control import SE3Control
        from rotorpy.vehicles.crazyflie_params import quad_params

        inertia = dict(zip(["Ixx", "Iyy", "Izz"], scene.get("vehicle.inertia_kg_m2")))
        self.law, self.motors = SE3Control({**quad_params, "mass": scene.mass_kg, **inertia}), scene.motors_from_wrench

    def __call__(self, state, reference, time_s):
        body, still = Rotation.from_euler("ZYX", state[3:6]), np.zeros(3)
        known = {"x": state[:3], "v": body.apply(state[6:9]), "q": body.as_quat(), "w": state[9:12]}
        wanted = {"x": reference[:3], "x_dot": reference[3:6], "x_ddot": reference[6:9], "x_dddot": still,
                  "x_ddddot": still, "yaw": 0.0, "yaw_dot": 0.0, "yaw_ddot": 0.0}  # fmt: skip
        command = self.law.update(time_s, known, wanted)
        return self.motors @ [*command["cmd_moment"], command["cmd_thrust"]]


class Crazyflow:
    """`state2attitude` at 100 Hz and `attitude2force_torque` at 500 Hz, with its own parameters."""

    def __init__(self, scene):
        from crazyflow.control.mellinger import attitude2force_torque, state2attitude
        from crazyflow.control import parametrize

        self.outer = parametrize(state2attitude, "cf2x_L250", xp=np)
        self.inner = parametrize(attitude2force_torque, "cf2x_L250", xp=np)
        self.motors, self.calls = scene.motors_from_wrench, 0
        self.position_i = self.rate_before = self.rotation_i = None

    def __call__(self, state, reference):
        body = Rotation.from_euler("ZYX", state[3:6])
        quaternion, rate = body.as_quat(), state[9:12]
        if self.calls % 5 == 0:
            command = np.array([*reference, 0, 0, 0, 1, 0, 0, 0])
            velocity = body.apply(state[6:9])
            self.attitude, self.position_i = self.outer(state[:3], quaternion, velocity, command, self.position_i, 100)
        self.calls += 1
        force, torque, self.rotation_i = self.inner(
            quaternion, rate, self.attitude, self.rate_before, self.rotation_i, 500
        )
        self.rate_before = rate
        return self.motors @ [*torque, force.item()]


class Pybullet:
    """`DSLPIDControl` of gym-pybullet-drones, its rotors' forces as those of a Crazyflie 2.x."""

    def __init__(self, scene):
        from gym_pybullet_drones.control.DSLPIDControl import DSLPIDControl
        from gym_pybullet_drones.utils.enums import DroneModel

        self.law, self.motors = DSLPIDControl(DroneModel.CF2X), scene.motors_from_wrench
        self.gain = scene.mass_kg * 9.81 / self.law.GRAVITY
        arm_m = self.law._getURDFParameter("arm") / np.sqrt(2)
        drag_m = self.law.KM / self.law.KF
        self.wrench = np.array([[-1, -1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1], [1, 1, 1, 1]], float)
        self.wrench *= np.array([[arm_m], [arm_m], [drag_m], [1]])

    def __call__(self, state, reference):
        body = Rotation.from_euler("ZYX", state[3:6])
        rpm, _, _ = self.law.computeControl(
            1 / 500, state[:3], body.as_quat(), body.apply(state[6:9]), body.apply(state[9:12]), reference[:3],
            target_vel=reference[3:6],
        )  # fmt: skip
        return self.motors @ (self.wrench @ (self.gain * self.law.KF * rpm**2))
