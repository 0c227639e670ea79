"""Model predictive control of the position over a second, about a cascade for the attitude."""

import noctograph as nc
import numpy as np

scene = nc.Scene("cf-brushless")
mixer = scene.motors_from_wrench
inertia = 1 / np.diag(np.array(nc.gains(scene)["B"])[9:])
GRAVITY = 9.81
#: Steps of the horizon, and their length in s; a solution every so many calls of the controller.
STEPS, STEP_S, CALLS = 25, 0.04, 10
#: With what lag x, y and z answer a wanted acceleration, s.
LAG_S = np.array([0.2, 0.2, 0.06])
#: Costs of the errors of position and velocity, and of the acceleration; largest acceleration, m/s².
POSITION, VELOCITY, EFFORT, MOST = 60.0, 6.0, 0.3, 3.0


def condensed(lag_s):
    """Errors (position, velocity) over the horizon: of the state, and of the accelerations that are wanted."""
    a = np.array([[1, STEP_S, STEP_S**2 / 2], [0, 1, STEP_S], [0, 0, np.exp(-STEP_S / lag_s)]])
    b = np.array([0, 0, 1 - a[2, 2]])
    powers = [np.linalg.matrix_power(a, k) for k in range(STEPS + 1)]
    free = np.vstack([powers[k][:2] for k in range(1, STEPS + 1)])
    forced = np.zeros((2 * STEPS, STEPS))
    for k in range(STEPS):
        for j in range(k + 1):
            forced[2 * k : 2 * k + 2, j] = (powers[k - j] @ b)[:2]
    weights = np.tile([POSITION, VELOCITY], STEPS)[:, None]
    hessian = forced.T @ (weights * forced) + EFFORT * np.eye(STEPS)
    return hessian, forced.T @ (weights * free)


class Mpc:
    def __init__(self):
        self.problems = [condensed(lag_s) for lag_s in LAG_S]
        self.plans = np.zeros((3, STEPS))
        self.sum, self.wanted, self.calls, self.rises = np.zeros(3), np.zeros(3), 0, 0.0

    def solve(self, axis, error, feedforward):
        """The first acceleration of the best plan within the bounds, by projected gradients from the last plan."""
        hessian, gradient = self.problems[axis]
        bounds = -MOST - feedforward, MOST - feedforward
        plan = np.linalg.solve(hessian, -gradient @ error)
        if np.abs(plan + feedforward).max() > MOST:
            plan, length = np.clip(self.plans[axis], *bounds), 1 / np.linalg.norm(hessian, 2)
            for _ in range(40):
                plan = np.clip(plan - length * (hessian @ plan + gradient @ error), *bounds)
        self.plans[axis] = plan
        return plan[0] + feedforward

    def __call__(self, state, reference):
        position, angles, velocity, rate = np.split(state, 4)
        if self.calls % CALLS == 0:
            away, ahead = position - reference[:3], reference[6:]
            self.sum = np.clip(self.sum + CALLS / 500 * away, -0.2, 0.2)
            flown = np.array([GRAVITY * angles[1], -GRAVITY * angles[2], self.rises])
            errors = np.stack([away + 0.3 * self.sum, velocity - reference[3:6], flown - ahead])
            self.wanted = np.array([self.solve(axis, errors[:, axis], ahead[axis]) for axis in range(3)])
        self.calls += 1
        self.rises += (self.wanted[2] - self.rises) / (500 * LAG_S[2])
        lean = np.clip([0, self.wanted[0] / GRAVITY, -self.wanted[1] / GRAVITY], -0.35, 0.35)
        turn = np.array([10.0, 80.0, 80.0]) * (lean - angles) - np.array([5.0, 16.0, 16.0]) * rate[::-1]
        return mixer @ [*(inertia * turn[::-1]), scene.mass_kg * (GRAVITY + self.wanted[2])]
