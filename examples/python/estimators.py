"""Two custom estimators for `nc.fly(scene, estimator=...)`, for scenes in which `sensors.positioning` is `position`.

usage: python examples/python/estimators.py

A class is given the state at rest, and is called at each tick with what the sensors read.
"""

import noctograph as nc
import numpy as np

SCENE = nc.Scene("ae483-2022", word="NO", seed=1)


class Luenberger:
    """The observer of the reference flight, as `observer.kind = "luenberger"`: the gain L of `nc.gains`."""

    gain = np.array(nc.gains(SCENE)["L"])

    def __init__(self, state):
        self.x = state[[0, 1, 2, 4, 5, 6, 7, 8]]  # all but the yaw, which no position shows
        self.measured_m, self.yaw_rad = state[:3], state[3]

    def __call__(self, readings, tick_s):
        rate, force = readings["rate_rad_s"], readings["specific_force_m_s2"]
        self.measured_m = readings.get("position_m", self.measured_m)
        _, _, _, pitch, roll, v_x, v_y, v_z = self.x
        slope = np.array([v_x, v_y, v_z, rate[1], rate[0], 9.81 * pitch, -9.81 * roll, force[2] - 9.81])
        self.x = self.x + tick_s * (slope - self.gain @ (self.x[:3] - self.measured_m))
        self.yaw_rad += tick_s * rate[2]
        return np.array([*self.x[:3], self.yaw_rad, *self.x[3:], *rate])


class Ekf:
    """An extended Kalman filter of position, attitude and velocity, driven by gyroscope and accelerometer."""

    #: Standard deviations of a position, and of gyroscope and accelerometer in one tick, including errors of the model.
    position_m, rate_rad_s, force_m_s2 = 0.002, 0.1, 2.0

    def __init__(self, state):
        self.x, self.p = state[:9].copy(), np.diag([1e-4] * 3 + [1e-3] * 6)

    @staticmethod
    def slope(x, rate, force):
        """ẋ of position, yaw, pitch, roll and velocity in the body frame; x may be of shape (..., 9)."""
        yaw, pitch, roll, *velocity = (x[..., i] for i in range(3, 9))
        (cy, cp, cr), (sy, sp, sr) = (of([yaw, pitch, roll]) for of in (np.cos, np.sin))
        v_x, v_y, v_z = velocity
        across, down = cr * v_y - sr * v_z, sr * v_y + cr * v_z
        ahead = cp * v_x + sp * down
        turn = (rate[1] * sr + rate[2] * cr) / cp
        carried = np.cross(np.stack(velocity, -1), rate)
        down_m_s2 = 9.81 * np.stack([sp, -sr * cp, -cr * cp], -1)
        moved = [cy * ahead - sy * across, sy * ahead + cy * across, cp * down - sp * v_x]
        turned = [turn, rate[1] * cr - rate[2] * sr, rate[0] + turn * sp]
        return np.concatenate([np.stack([*moved, *turned], -1), force + down_m_s2 + carried], -1)

    def __call__(self, readings, tick_s):
        rate, force = readings["rate_rad_s"], readings["specific_force_m_s2"]
        apart = 1e-5 * np.eye(9)
        ways = self.slope(np.vstack([self.x + apart, self.x - apart, self.x]), rate, force)
        a = np.eye(9) + tick_s * (ways[:9] - ways[9:18]).T / 2e-5
        self.x = self.x + tick_s * ways[18]
        noise = np.diag([0] * 3 + [self.rate_rad_s**2] * 3 + [self.force_m_s2**2] * 3)
        self.p = a @ self.p @ a.T + tick_s**2 * noise
        if "position_m" in readings:
            gain = self.p[:, :3] @ np.linalg.inv(self.p[:3, :3] + self.position_m**2 * np.eye(3))
            self.x = self.x + gain @ (readings["position_m"] - self.x[:3])
            self.p = self.p - gain @ self.p[:3]
        return np.concatenate([self.x, rate])


if __name__ == "__main__":
    for name, estimator in [("luenberger", Luenberger), ("ekf", Ekf), ("the scene's", None)]:
        (flight,) = nc.fly(SCENE, estimator=estimator)
        error_m = np.linalg.norm(flight.estimate_m - flight.position_m, axis=1)
        shot = nc.photograph(SCENE, [flight])
        print(f"{name}: reads as {shot.verdict['read']}, estimate off by {1e3 * np.sqrt(np.mean(error_m**2)):.1f} mm rms")
