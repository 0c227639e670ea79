"""Flies unchanged controllers of other projects in Noctograph: `nc.fly(scene, controller=RotorPy(scene))`.

As classes they are what `nc.fly_many`, `nc.rank` and a graded submission take, too. Each imports its package when it
is made. Run with rotorpy 3.0.0, crazyflow 0.4.0, gym-pybullet-drones 2.1.0, udaan 1.3.0 and foundation-policy 1.0.2.
"""

import os

import numpy as np

os.environ.setdefault("SCIPY_ARRAY_API", "1")  # crazyflow wants it before SciPy is imported
from scipy.spatial.transform import Rotation  # noqa: E402


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
        import array_api_compat.numpy  # noqa: F401 crazyflow imports it in flight, which no submission may
        from crazyflow.control import parametrize
        from crazyflow.control.mellinger import attitude2force_torque, state2attitude

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
    """`DSLPIDControl` of gym-pybullet-drones at 100 Hz, with the forces of a Crazyflie 2.x.

    The controller computes rates from differences of angles. At 500 Hz the noise of an estimate makes the drone turn
    over.
    """

    def __init__(self, scene):
        from gym_pybullet_drones.control.DSLPIDControl import DSLPIDControl
        from gym_pybullet_drones.utils.enums import DroneModel

        self.law, self.motors = DSLPIDControl(DroneModel.CF2X), scene.motors_from_wrench
        self.gain = scene.mass_kg * 9.81 / self.law.GRAVITY
        arm_m = self.law._getURDFParameter("arm") / np.sqrt(2)
        drag_m = self.law.KM / self.law.KF
        self.wrench = np.array([[-1, -1, 1, 1], [-1, 1, 1, -1], [-1, 1, -1, 1], [1, 1, 1, 1]], float)
        self.wrench *= np.array([[arm_m], [arm_m], [drag_m], [1]])
        self.calls = 0

    def __call__(self, state, reference):
        if self.calls % 5 == 0:
            body = Rotation.from_euler("ZYX", state[3:6])
            velocity, rate = body.apply(state[6:9]), body.apply(state[9:12])
            seen = state[:3], body.as_quat(), velocity, rate, reference[:3]
            self.rpm, _, _ = self.law.computeControl(1 / 100, *seen, target_vel=reference[3:6])
        self.calls += 1
        return self.motors @ (self.wrench @ (self.gain * self.law.KF * self.rpm**2))


class Udaan:
    """`PositionPDController` and `GeometricAttitudeController`, whose gains are scaled by mass and inertia."""

    def __init__(self, scene):
        from udaan.control.quadrotor import GeometricAttitudeController, PositionPDController
        from udaan.core.defaults import DEFAULT_QUAD_INERTIA, DEFAULT_QUAD_MASS
        from udaan.manif import SO3, TSO3

        inertia = np.diag(scene.get("vehicle.inertia_kg_m2"))
        self.outer = PositionPDController(mass=scene.mass_kg)
        self.inner = GeometricAttitudeController(inertia=inertia)
        for law, ratio in (
            (self.outer, scene.mass_kg / DEFAULT_QUAD_MASS),
            (self.inner, np.diag(inertia) / np.diag(DEFAULT_QUAD_INERTIA)),
        ):
            law._gains.kp, law._gains.kd = ratio * law._gains.kp, ratio * law._gains.kd
        self.motors, self.attitude = scene.motors_from_wrench, lambda body, rate: (SO3(body.as_matrix()), TSO3(rate))

    def __call__(self, state, reference, time_s):
        body = Rotation.from_euler("ZYX", state[3:6])
        self.outer.setpoint = lambda _: np.split(reference, 3)
        force = self.outer.compute(time_s, (state[:3], body.apply(state[6:9])))
        thrust, torque = self.inner.compute(time_s, self.attitude(body, state[9:12]), force)
        return self.motors @ [*torque, thrust]


class Raptor:
    """`foundation_policy.Raptor` at 100 Hz, a trained policy that identifies its drone in flight."""

    def __init__(self, scene):
        from foundation_policy import Raptor as Policy

        self.law, self.action, self.calls = Policy(), np.zeros(4), 0
        self.law.reset()

    def __call__(self, state, reference):
        if self.calls % 5 == 0:
            body = Rotation.from_euler("ZYX", state[3:6])
            velocity = body.apply(state[6:9]) - reference[3:6]
            seen = [*state[:3] - reference[:3], *body.as_matrix().ravel(), *velocity, *state[9:12], *self.action]
            self.action = self.law.evaluate_step(np.array([seen]))[0]
        self.calls += 1
        return 65535 * (self.action + 1) / 2
