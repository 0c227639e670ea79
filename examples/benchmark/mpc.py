"""A baseline of the benchmark: linear model predictive control at 250 Hz, with numpy only.

The model is `nc.Model` at hover with its rotors, and with the accelerations and torques that it does not explain. The
horizon is 0.6 s in steps of 20 ms, with the plan's future design as the reference, and the motors' range bounds every
command in it. Because the cost is quadratic, the commands are the solution of a quadratic program. It is a product
with
precomputed matrices, which projected gradients correct if a bound is exceeded.
"""

import numpy as np

import noctograph as nc

STEP_S, STEPS = 0.02, 30
#: Time between two quadratic programs, s, which is every second call of the controller.
TICK_S = 0.004
#: Weights of errors of position (m), yaw pitch roll (rad), velocity (m/s) and angular velocity (rad/s).
ERRORS = np.array([1.0, 1.0, 1.0, 0.3, 0.02, 0.02, 0.02, 0.02, 0.02, 2e-5, 2e-5, 2e-5])
#: Weight of a motor's command, as a fraction of the hover command.
COMMAND = 2e-3
#: Mean lag that rooms add to that of the rotors, s.
MORE_LAG_S = 0.025
#: Time constant with which unexplained accelerations and torques are estimated, s.
LEARNED_S = 0.5
#: Mean delay of the lamps after their commands, s, by which the drone is delayed as well.
LATE_S = 0.03
#: Number of steps of projected gradients.
DESCENTS = 15


class Program:
    """The quadratic program of a scene's drone: U = start @ x + ahead @ references + learned @ d if no bound is
    active."""

    def __init__(self, scene):
        lags = {f"vehicle.motor_{way}_s": scene.get(f"vehicle.motor_{way}_s") + MORE_LAG_S for way in ("rise", "fall")}
        self.model = nc.Model(nc.Scene(scene, set=lags))
        x, self.hover = self.model.hover()
        self.rotors, self.lag_s = x[12:], np.mean(list(lags.values()))
        a, b = self.model.linearize(x, self.hover, STEP_S)
        b = b * self.hover
        unknown = np.zeros((16, 6))
        unknown[6:12] = np.eye(6) * STEP_S
        unknown[:3, :3], unknown[[5, 4, 3], [3, 4, 5]] = np.eye(3) * STEP_S**2 / 2, STEP_S**2 / 2
        q, r = np.diag([*ERRORS, 0, 0, 0, 0]), COMMAND * np.eye(4)
        end = q
        for _ in range(500):
            gain = np.linalg.solve(r + b.T @ end @ b, b.T @ end @ a)
            end = q + a.T @ end @ (a - b @ gain)
        powers = [np.eye(16)]
        for _ in range(STEPS):
            powers.append(a @ powers[-1])
        free = np.vstack(powers[1:])
        forced, of_unknown = np.zeros((16 * STEPS, 4 * STEPS)), np.zeros((16 * STEPS, 6))
        for row in range(STEPS):
            for column in range(row + 1):
                forced[16 * row : 16 * row + 16, 4 * column : 4 * column + 4] = powers[row - column] @ b
                of_unknown[16 * row : 16 * row + 16] += powers[column] @ unknown
        weights = np.kron(np.eye(STEPS), q)
        weights[-16:, -16:] = end
        self.hessian = forced.T @ weights @ forced + COMMAND * np.eye(4 * STEPS)
        back = np.linalg.solve(self.hessian, forced.T @ weights)
        self.start, self.learned = -back @ free, -back @ of_unknown
        # References are positions and velocities of each step.
        places = np.arange(16 * STEPS).reshape(STEPS, 16)
        self.ahead = back[:, np.hstack([places[:, :3], places[:, 6:9]]).ravel()]
        self.pace = 1 / np.linalg.eigvalsh(self.hessian)[-1]
        self.most = 65_535 / self.hover[0] - 1

    def solve(self, x, references, unexplained):
        """Returns the first commands, as fractions of the hover command."""
        best = x @ self.start.T + references @ self.ahead.T + unexplained @ self.learned.T
        commands = np.clip(best, -1, self.most)
        if (commands != best).any():
            last = commands
            for turn in range(DESCENTS):
                further = commands + turn / (turn + 3) * (commands - last)
                last, commands = commands, np.clip(further - self.pace * (further - best) @ self.hessian, -1, self.most)
        return commands[..., :4]


PROGRAMS = {}


class Mpc:
    """A controller in Python. `state` and `reference` may be those of many flights in step."""

    def __init__(self, scene=None):
        scene = scene or nc.Scene("task.toml")
        design = {"plan.reference": "design", "plan.light_clock": "setpoint"}
        key = scene.to_toml()
        if key not in PROGRAMS:
            PROGRAMS[key] = Program(scene), nc.plan(nc.Scene(scene, set=design))[0]
        self.program, plan = PROGRAMS[key]
        times_s = np.arange(0, plan.duration_s + STEPS * STEP_S, TICK_S)
        columns = np.hstack([plan.position_m, plan.velocity_m_s]).T
        self.design = np.stack([np.interp(times_s, plan.time_s, column) for column in columns], -1)
        self.expected, self.turn = None, -1

    def __call__(self, state, reference, time_s):
        program, self.turn = self.program, self.turn + 1
        if self.turn % 2:
            return self.motors
        if self.expected is None:
            self.rotors, self.motors, self.unexplained = (np.zeros((*state.shape[:-1], n)) for n in (4, 4, 6))
            self.expected = state[..., 6:]
        self.unexplained = self.unexplained + (state[..., 6:] - self.expected) / LEARNED_S
        x = np.concatenate([state, self.rotors], -1)
        slope = program.model.f(x, self.motors)
        self.expected = state[..., 6:] + TICK_S * (slope[..., 6:12] + self.unexplained)

        # Near hover, the velocity is taken to be in the world frame.
        x[..., 6:9] = slope[..., :3]
        x[..., 12:] -= program.rotors
        ahead = np.round((np.max(time_s) - LATE_S + STEP_S * np.arange(1, STEPS + 1)) / TICK_S).astype(int)
        references = self.design[np.clip(ahead, 0, len(self.design) - 1)].ravel()
        shares = 1 + program.solve(x, references, self.unexplained)
        self.motors = shares * program.hover
        self.rotors = self.rotors + (np.sqrt(shares) * program.rotors - self.rotors) * TICK_S / program.lag_s
        return self.motors
