"""Equations of motion of a scene's drone, for controllers and filters that predict."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._noctograph import Scene

Floats = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
#: Step sizes of the differences in `Model.linearize`, for a state and for a motor command.
APART, APART_COMMAND = 1e-5, 1.0


class Model:
    """Equations of motion ẋ = f(x, u) of a scene's drone in still air, as in the simulator, without unknown
    disturbances.

    States x, shape (..., 16): position (m, world: x to the viewer's right, y into the scene, z up), yaw, pitch and
    roll (rad; the body is turned by roll about x, then pitch about y, then yaw about z), velocity (m/s) and angular
    velocity (rad/s) in the body frame (x forward, y left, z up), speeds of the rotors m1 to m4 (rad/s). The first
    twelve are a controller's ``state``. If the scene's motors have no lag, these twelve are all states, shape (...,
    12).

    Inputs u, shape (..., 4): commands of the motors m1 to m4, 0 to 65535.

    The model omits gusts, the ground effect (5 % of the thrust at a height of 4 cm), the battery's sag and the floor.
    If the body points straight up or down (pitch ±90°), yaw and roll are not defined.

    Parameters
    ----------
    scene : Scene
        The scene, whose ``vehicle`` is modeled.
    """

    def __init__(self, scene: Scene) -> None:
        vehicle: dict[str, Any] = scene.get("vehicle")
        self.mass_kg = float(vehicle["mass_kg"])
        self.inertia_kg_m2 = np.array(vehicle["inertia_kg_m2"], float)
        self._lags_s = float(vehicle["motor_rise_s"]), float(vehicle["motor_fall_s"])
        self._thrust_n_s2 = float(vehicle["rotor_thrust_n_s2"])
        self._command_n = float(vehicle["k_f_n"])
        self._given = 1 - np.array(vehicle["motor_loss_frac"], float)
        # Torques about the center of mass and thrust, from the rotors' thrusts in N.
        self._wrench = np.linalg.inv(scene.motors_from_wrench) / self._command_n
        x_m, y_m = vehicle["center_of_mass_m"]
        self._wrench[:2] += np.array([[-y_m], [x_m]]) * self._wrench[3]
        self._spins = -np.sign(self._wrench[2])
        self._rotor_kg_m2 = float(vehicle["rotor_inertia_kg_m2"])
        self._drag_n_s_m = np.array(vehicle["body_drag_n_s_m"], float)
        self._rotor_drag_n_s2_m = float(vehicle["rotor_drag_n_s2_m"])
        self._moment_n_s = float(vehicle["airspeed_moment_n_s"])
        self.n = 16 if max(self._lags_s) > 0 else 12

    def hover(self, position_m: ArrayLike = (0, 0, 0), yaw_rad: float = 0) -> tuple[Floats, Floats]:
        """Returns states x and inputs u of a hovering drone whose center of mass has no offset."""
        u = np.full(4, self.mass_kg * GRAVITY_M_S2 / 4 / self._command_n)
        state = np.concatenate([np.asarray(position_m, float), [yaw_rad], np.zeros(8)])
        return self.complete(state, u), u

    def complete(self, state: ArrayLike, u: ArrayLike) -> Floats:
        """Returns the states x from the twelve of a controller, with rotors that have settled at the commands u."""
        state = np.asarray(state, float)
        speeds = np.broadcast_to(self._followed(u), (*state.shape[:-1], 4))
        return np.concatenate([state, speeds], -1)[..., : self.n]

    def f(self, x: ArrayLike, u: ArrayLike) -> Floats:
        """Returns the time derivative ẋ of the states x under the motor commands u."""
        x, followed = np.asarray(x, float), self._followed(u)
        of_all = np.broadcast_shapes(x.shape[:-1], followed.shape[:-1])
        x, followed = np.broadcast_to(x, (*of_all, self.n)), np.broadcast_to(followed, (*of_all, 4))
        yaw, pitch, roll, v_x, v_y, v_z, p, q, r = (x[..., i] for i in range(3, 12))
        speeds = x[..., 12:] if self.n == 16 else followed
        change = 0 * speeds
        if self.n == 16:
            rise_s, fall_s = (max(lag_s, 1e-4) for lag_s in self._lags_s)
            change = (followed - speeds) / np.where(speeds < followed, rise_s, fall_s)
        torque_x, torque_y, torque_z, thrust = ((self._thrust_n_s2 * speeds**2) @ row for row in self._wrench)
        spin, spin_up = (self._rotor_kg_m2 * (it @ self._spins) for it in (speeds, change))
        drag_x, drag_y, drag_z = self._drag_n_s_m
        of_rotors = self._rotor_drag_n_s2_m * speeds.sum(-1)
        mass, (j_x, j_y, j_z), g = self.mass_kg, self.inertia_kg_m2, GRAVITY_M_S2

        sin_yaw, sin_pitch, sin_roll = np.sin(yaw), np.sin(pitch), np.sin(roll)
        cos_yaw, cos_pitch, cos_roll = np.cos(yaw), np.cos(pitch), np.cos(roll)
        across, down = cos_roll * v_y - sin_roll * v_z, sin_roll * v_y + cos_roll * v_z
        ahead = cos_pitch * v_x + sin_pitch * down
        yaw_rate = (q * sin_roll + r * cos_roll) / cos_pitch
        slopes = [
            cos_yaw * ahead - sin_yaw * across,
            sin_yaw * ahead + cos_yaw * across,
            cos_pitch * down - sin_pitch * v_x,
            yaw_rate,
            q * cos_roll - r * sin_roll,
            p + yaw_rate * sin_pitch,
            g * sin_pitch + r * v_y - q * v_z - (drag_x + of_rotors) / mass * v_x,
            -g * sin_roll * cos_pitch + p * v_z - r * v_x - (drag_y + of_rotors) / mass * v_y,
            thrust / mass - g * cos_roll * cos_pitch + q * v_x - p * v_y - drag_z / mass * v_z,
            ((j_y - j_z) * q * r + torque_x + self._moment_n_s * v_y - q * spin) / j_x,
            ((j_z - j_x) * p * r + torque_y - self._moment_n_s * v_x + p * spin) / j_y,
            ((j_x - j_y) * p * q + torque_z - spin_up) / j_z,
        ]
        return np.concatenate([np.stack(slopes, -1), change], -1)[..., : self.n]

    def step(self, x: ArrayLike, u: ArrayLike, dt_s: float) -> Floats:
        """Returns the states after `dt_s` seconds of constant commands, by one Runge-Kutta step of order 4.

        Use steps of at most 20 ms.
        """
        x = np.asarray(x, float)
        k1 = self.f(x, u)
        k2 = self.f(x + dt_s / 2 * k1, u)
        k3 = self.f(x + dt_s / 2 * k2, u)
        return x + dt_s / 6 * (k1 + 2 * k2 + 2 * k3 + self.f(x + dt_s * k3, u))

    def linearize(self, x: ArrayLike, u: ArrayLike, dt_s: float | None = None) -> tuple[Floats, Floats]:
        """Returns A (n, n) and B (n, 4) for small deviations from x and u, by central differences.

        With `dt_s` they belong to `step`, otherwise to ẋ = f(x, u).
        """
        x, u = np.asarray(x, float), np.asarray(u, float)
        x_apart, u_apart = APART * np.eye(self.n), APART_COMMAND * np.eye(4)

        def along(x: Floats, u: Floats) -> Floats:
            return self.f(x, u) if dt_s is None else self.step(x, u, dt_s)

        a = (along(x + x_apart, u) - along(x - x_apart, u)) / (2 * APART)
        b = (along(x, u + u_apart) - along(x, u - u_apart)) / (2 * APART_COMMAND)
        return a.T, b.T

    def _followed(self, u: ArrayLike) -> Floats:
        """Returns the speeds, in rad/s, at which the rotors settle under motor commands, clipped to 0 to 65535."""
        thrust_n = np.clip(np.asarray(u, float), 0, 65_535) * self._command_n * self._given
        return np.sqrt(thrust_n / self._thrust_n_s2)
