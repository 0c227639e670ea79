"""A baseline of the benchmark: a linear policy with a memory, whose weights `train.py` found by CMA-ES.

The policy receives the observations of `nc.VectorEnv`, stores the integral of its error and its low-passed commands,
and
adds a fraction of the hover command to each motor. Both horizontal axes have the same weights.
"""

import numpy as np

import noctograph as nc

#: Fractions of the hover command for a weight of 1, sideways, per m, m/s, m/s² of the design, rad, rad/s, m s and
#: fraction of the hover command.
SIDEWAYS = np.array([0.1, 0.1, 0.02, 0.2, 0.03, 0.1, 1.0])
#: Likewise upward, without an angle, and about the vertical, per rad, rad/s and fraction of the hover command.
UPWARD, TURNING = np.array([2.0, 1.0, 0.1, 2.0, 1.0]), np.array([0.2, 0.1, 1.0])
N_WEIGHTS = len(SIDEWAYS) + len(UPWARD) + len(TURNING)
#: Lag of the stored commands in s, and bound of the integral of the error in m s.
LAG_S, MOST_INTEGRAL = 0.08, 0.3
#: Weights after 38 generations of `train.py`.
WEIGHTS = np.array([-25.969, -39.31, 4.33, -16.219, -28.533, -17.99, -2.425, -19.001, -24.006, 7.969, -12.492, -9.98, -19.654, -19.989, 3.177])


class Linear:
    """Computes fractions of the hover command for m1 to m4, with weights (n,), or (flights, n) for many flights."""

    def __init__(self, weights, tick_s):
        weights = np.asarray(weights, float)
        self.sideways, self.upward, self.turning = np.split(weights, [7, 12], axis=-1)
        self.tick_s, self.integral, self.lagged = tick_s, np.zeros((*weights.shape[:-1], 3)), np.zeros((*weights.shape[:-1], 4))

    def __call__(self, error, angles, velocity, rate, goal_m_s, goal_m_s2):
        self.integral = np.clip(self.integral + error * self.tick_s, -MOST_INTEGRAL, MOST_INTEGRAL)
        slower = velocity - goal_m_s

        def dot(weights, scales, *columns):
            return (weights * scales * np.stack(columns, -1)).sum(-1)

        def along(axis, angle, turn, channel):
            """Returns a torque that tilts the thrust toward a world axis. A positive roll tilts it backward along
            y."""
            sign = 1 if axis == 0 else -1
            return dot(self.sideways, SIDEWAYS, sign * error[..., axis], sign * slower[..., axis], sign * goal_m_s2[..., axis],
                       angles[..., angle], rate[..., turn], sign * self.integral[..., axis], self.lagged[..., channel])  # fmt: skip

        thrust = dot(self.upward, UPWARD, error[..., 2], slower[..., 2], goal_m_s2[..., 2], self.integral[..., 2], self.lagged[..., 3])
        turning = dot(self.turning, TURNING, angles[..., 0], rate[..., 2], self.lagged[..., 2])
        channels = np.stack([along(1, 2, 0, 0), along(0, 1, 1, 1), turning, thrust], -1)
        channels = np.clip(channels, -0.4, 0.4)
        self.lagged = self.lagged + (channels - self.lagged) * self.tick_s / LAG_S
        return channels


def motors_from(scene):
    """Converts fractions that roll, pitch, turn and lift to fractions for m1 to m4. Also returns the hover command."""
    mixer = scene.motors_from_wrench
    return np.sign(mixer), mixer[0, 3] * 9.81 * scene.mass_kg


class Policy:
    """A controller in Python. `state` and `reference` may be those of many flights in step."""

    def __init__(self, scene=None, weights=WEIGHTS):
        self.mixer, self.hover = motors_from(scene or nc.Scene("task.toml"))
        self.weights, self.linear = weights, None

    def __call__(self, state, reference):
        if self.linear is None:
            self.linear = Linear(np.broadcast_to(self.weights, (*state.shape[:-1], N_WEIGHTS)), 0.002)
        seen = state[..., :3] - reference[..., :3], *np.split(state[..., 3:], 3, -1), *np.split(reference[..., 3:], 2, -1)
        return self.hover * (1 + self.linear(*seen) @ self.mixer.T)
