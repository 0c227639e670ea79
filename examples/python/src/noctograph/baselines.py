# pyright: basic
"""`VectorEnv` as an environment of Stable-Baselines3, which this module needs."""

from __future__ import annotations

from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]

from .learning import ACTIONS, OBSERVATIONS, VectorEnv


class Drones(VecEnv):
    """The drones of a `VectorEnv`, with episodes that begin in the step in which the previous ones end."""

    def __init__(self, drones: VectorEnv) -> None:
        self._drones = drones
        self._actions: Any = None
        super().__init__(drones.num_envs, OBSERVATIONS, ACTIONS)

    def reset(self) -> Any:
        seeds = [seed for seed in self._seeds if seed is not None]
        observations, _ = self._drones.reset(seed=seeds[0] if seeds else None)
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return observations

    def step_async(self, actions: Any) -> None:
        self._actions = actions

    def step_wait(self) -> Any:
        observations, rewards, over, _, found = self._drones.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if over.any():
            # The next step begins the episodes that ended, and continues the others.
            ended = observations.copy()
            observations = self._drones.begin_again(observations)
            for index in np.flatnonzero(over):
                infos[index] = {"terminal_observation": ended[index], "TimeLimit.truncated": False}
                infos[index].update({key: found[key][index] for key in ("probability", "read") if key in found and found["_" + key][index]})
        return observations, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        self._drones.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self._drones, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        setattr(self._drones, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        return [getattr(self._drones, method_name)(*args, **kwargs) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]
