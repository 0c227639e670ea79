"""Environments for reinforcement learning, which need gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ._noctograph import Scene, Sessions
from .errors import InputError

Floats = NDArray[np.float32]

#: Distance from the design, in m, from which on a second of flight has no reward.
WORTHLESS_M = 0.1
#: Largest motor command.
MOTOR_MAX = 65_535.0
#: Bound of all states of a drone in SI units. A drone farther than 10 km away counts as lost.
LARGEST = 1e5
OBSERVATIONS = gymnasium.spaces.Box(-LARGEST, LARGEST, (18,), np.float32)
ACTIONS = gymnasium.spaces.Box(-1, 1, (4,), np.float32)


class VectorEnv(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """N drones that write a word and are flown by motor commands, in one process and on all cores.

    An episode is the scene's plan from take-off to landing, planned as for the controller of `fly`, with new noise
    and conditions each time. With gymnasium's `AutoresetMode.NEXT_STEP`, the step after the last step of an episode
    begins the next episode.

    Action, shape (N, 4), -1 to 1: commands of the motors m1 to m4. 0 is hover and -1 is off.

    Observation, shape (N, 18), by the estimator, in SI units: position minus the design's (3, world), yaw, pitch
    and roll (3), velocity (3) and angular velocity (3) in the body frame. Velocity (3) and acceleration (3) of the
    design, in the world. All 0 once a drone has landed.

    Reward: the step's duration in s, times 1 - d / 0.1 m with the true distance d from the design, but at least 0. A
    landing adds the flight's duration in s times the probability that its photo is read, so that a flight that lands
    is worth at most twice its duration. Over random policies and six words, the rank correlation of an episode's
    reward with its photo's P(read) is 0.84 (examples/benchmark/reward.py).
    A drone that turns over or flies away terminates its episode, as landing does. The info of a landing contains
    ``probability`` and ``read``, the verdict on its photo.

    Parameters
    ----------
    scene : Scene
        Scene that one drone flies.
    num_envs : int
        Number N of drones.
    control_hz : float
        Actions per second. Each is held for the nearest whole number of periods of ``rates.attitude_hz`` (500).
    conditions : {"still", "room", "drone"} or path
        What varies from episode to episode, as for `fly_many`.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(self, scene: Scene, num_envs: int = 1, *, control_hz: float = 250, conditions: str = "still") -> None:
        if not 0 < control_hz < np.inf:
            raise InputError("control_hz", repr(control_hz), "a number above 0", "250 is the default")
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = OBSERVATIONS, ACTIONS
        self.observation_space = batch_space(OBSERVATIONS, num_envs)
        self.action_space = batch_space(ACTIONS, num_envs)
        self._sessions = Sessions(scene, num_envs, conditions)
        self._hover = scene.motors_from_wrench @ [0, 0, 0, 9.81 * scene.mass_kg]
        self._turns = max(1, round(self._sessions.command_hz / control_hz))
        self._over = np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begins all episodes. `seed` also determines the seeds of later episodes."""
        first = seed[0] if isinstance(seed, list) else seed
        if first is not None or not hasattr(self, "_seeds"):
            self._seeds = np.random.default_rng(first)
        seeds = [None] * self.num_envs if not isinstance(seed, list) else seed
        self._sessions.reset([self._draw() if given is None else given for given in seeds])
        self._over[:] = False
        seen = self._sessions.observations()
        self._time_s = seen["time_s"]
        return self._observe(seen), {}

    def step(self, actions: Any) -> tuple[Floats, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Applies motor commands for a step, and restarts the episodes that ended in the previous step."""
        if not hasattr(self, "_time_s"):
            raise InputError("step", "no episode", "a call of `reset` before it", "env.reset(seed=0) begins one")
        actions = np.asarray(actions, float)
        if actions.shape != (self.num_envs, 4):
            hint = "one command for each of the motors m1 to m4, of each drone"
            raise InputError("actions", f"shape {actions.shape}", f"({self.num_envs}, 4)", hint)
        if np.isnan(actions).any():
            row = int(np.argwhere(np.isnan(actions))[0][0])
            raise InputError("actions", f"NaN in row {row}", "numbers from -1 to 1", "look at what your policy returns")
        begun = self._over.copy()
        if begun.any():
            self._sessions.reset([self._draw() if over else None for over in begun])
        commands = np.clip(self._hover * (1 + actions), 0, MOTOR_MAX)
        self._sessions.step(commands, np.where(begun, 0, self._turns).tolist())
        seen = self._sessions.observations()
        distance = np.linalg.norm(seen["position_m"] - seen["design_m"], axis=1)
        elapsed_s = np.where(begun, 0, seen["time_s"] - self._time_s)
        reward = elapsed_s * np.clip(1 - distance / WORTHLESS_M, 0, 1)
        self._time_s = seen["time_s"]
        self._over = seen["landed"] | seen["lost"]
        infos: dict[str, Any] = {}
        for index in np.flatnonzero(seen["landed"]):
            outcome = self._sessions.outcome(int(index))
            assert outcome is not None, "an episode ends once"
            info = {"probability": outcome["probability"], "read": outcome["read"]}
            infos = self._add_info(infos, info, int(index))
            reward[index] += seen["time_s"][index] * outcome["probability"]
        return self._observe(seen), reward, self._over.copy(), np.zeros(self.num_envs, bool), infos

    def begin_again(self, observations: Floats) -> Floats:
        """Begins the episodes that ended in the last step. Returns `observations` with their first observations."""
        begun = self._over.copy()
        self._sessions.reset([self._draw() if over else None for over in begun])
        seen = self._sessions.observations()
        self._time_s = seen["time_s"]
        self._over[:] = False
        return np.where(begun[:, None], self._observe(seen), observations)

    def _draw(self) -> int:
        return int(self._seeds.integers(1 << 31))

    def _observe(self, seen: dict[str, Any]) -> Floats:
        state, reference = seen["state"], seen["reference"]
        error = state[:, :3] - reference[:, :3]
        seen_now = np.concatenate([error, state[:, 3:], reference[:, 3:]], axis=1)
        return np.clip(seen_now, -LARGEST, LARGEST).astype(np.float32)


class Env(gymnasium.Env[Any, Any]):
    """One drone of `VectorEnv`, with the same reward and parameters, and spaces without the axis of drones.

    ``gymnasium.make("noctograph.learning:noctograph/Write-v0", scene=scene)`` also creates it.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, scene: Scene | None = None, *, control_hz: float = 250, conditions: str = "still") -> None:
        scene = Scene(word="T") if scene is None else scene
        self._drones = VectorEnv(scene, 1, control_hz=control_hz, conditions=conditions)
        self.observation_space, self.action_space = OBSERVATIONS, ACTIONS

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Begins an episode. `seed` also determines the seeds of later episodes."""
        super().reset(seed=seed)
        observations, infos = self._drones.reset(seed=seed, options=options)
        return observations[0], infos

    def step(self, action: Any) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Holds motor commands for a step."""
        action = np.asarray(action)
        if action.shape != (4,):
            hint = "one command for each of the motors m1 to m4"
            raise InputError("action", f"shape {action.shape}", "(4,)", hint)
        observations, rewards, terminated, truncated, infos = self._drones.step(action[None])
        # Keys with an underscore state which drones of the vector have a value.
        info = {key: value[0] for key, value in infos.items() if not key.startswith("_")}
        return observations[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), info


def sb3_env(scene: Scene, num_envs: int = 1, *, control_hz: float = 250, conditions: str = "still") -> Any:
    """Creates a `VectorEnv` for Stable-Baselines3: a `VecEnv` of N drones in one process on all cores.

    As Stable-Baselines3 expects, the step that ends an episode begins the next one, and the last observation of the
    ended episode is in ``info["terminal_observation"]``.

    Parameters
    ----------
    scene, num_envs, control_hz, conditions
        As for `VectorEnv`.

    Returns
    -------
    stable_baselines3.common.vec_env.VecEnv
    """
    from . import baselines

    return baselines.Drones(VectorEnv(scene, num_envs, control_hz=control_hz, conditions=conditions))


gymnasium.register(id="noctograph/Write-v0", entry_point="noctograph.learning:Env")  # pyright: ignore[reportUnknownMemberType]
