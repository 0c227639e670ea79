"""Trains the policy of `policy.py` from zero, by CMA-ES (Hansen 2016) on the reward of `nc.VectorEnv`.

usage: python examples/benchmark/train.py [GENERATIONS [SEED]]

Each generation of 16 policies flies a word in the same three rooms, which no other generation sees. The last line is
the mean of the search, as `policy.py` has it; a file `policy-SEED.npz` keeps the search, which the next call goes on
with. A generation draws its numbers from the seed and its own number alone, so that the weights are the same on any
number of threads, cut off or not.
"""

import pathlib
import sys

import noctograph as nc
import numpy as np
from policy import N_WEIGHTS, Linear, motors_from

WORD, POLICIES, ROOMS, CONTROL_HZ = "T", 16, 3, 250
KEPT = ("mean", "step", "cov", "path", "step_path", "generation")


class Search:
    """The evolution strategy with an adapted covariance matrix, with the defaults of Hansen's tutorial."""

    def __init__(self, n, step):
        self.mean, self.step, self.cov = np.zeros(n), step, np.eye(n)
        self.path, self.step_path, self.generation = np.zeros(n), np.zeros(n), 0

    def ask(self, random):
        """Returns candidates, one per row."""
        values, self.axes = np.linalg.eigh(self.cov)
        self.sizes = np.sqrt(np.maximum(values, 1e-20))
        self.drawn = random.normal(size=(POLICIES, len(self.mean))) * self.sizes @ self.axes.T
        return self.mean + self.step * self.drawn

    def tell(self, rewards):
        """Moves the distribution toward the better half of the candidates."""
        n, half = len(self.mean), POLICIES // 2
        shares = np.log(POLICIES / 2 + 0.5) - np.log(np.arange(1, half + 1))
        shares /= shares.sum()
        mass = 1 / (shares**2).sum()
        c_step = (mass + 2) / (n + mass + 5)
        damping = 1 + 2 * max(0, np.sqrt((mass - 1) / (n + 1)) - 1) + c_step
        c_path = (4 + mass / n) / (n + 4 + 2 * mass / n)
        c_one = 2 / ((n + 1.3) ** 2 + mass)
        c_rank = min(1 - c_one, 2 * (mass - 2 + 1 / mass) / ((n + 2) ** 2 + mass))
        chosen = self.drawn[np.argsort(-rewards)[:half]]
        move = shares @ chosen
        self.mean = self.mean + self.step * move
        white = self.axes @ ((move @ self.axes) / self.sizes)
        self.step_path = (1 - c_step) * self.step_path + np.sqrt(c_step * (2 - c_step) * mass) * white
        self.path = (1 - c_path) * self.path + np.sqrt(c_path * (2 - c_path) * mass) * move
        self.cov = ((1 - c_one - c_rank) * self.cov + c_one * np.outer(self.path, self.path)
                    + c_rank * (chosen.T * shares) @ chosen)  # fmt: skip
        usual = np.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n**2))
        self.step *= np.exp(c_step / damping * (np.linalg.norm(self.step_path) / usual - 1))
        self.generation += 1


def rewards_of(env, scene, weights, seeds):
    """Returns the mean rewards of policies over rooms, and the mean P(read)."""
    mixer, _ = motors_from(scene)
    linear = Linear(np.repeat(weights, ROOMS, axis=0), 1 / CONTROL_HZ)
    seen, _ = env.reset(seed=[*seeds] * POLICIES)
    rewards, over, read = np.zeros(env.num_envs), np.zeros(env.num_envs, bool), np.zeros(env.num_envs)
    while not over.all():
        seen, reward, ended, _, found = env.step(linear(*np.split(seen.astype(float), 6, axis=1)) @ mixer.T)
        rewards += np.where(over, 0, reward)
        if "probability" in found:
            read = np.where(found["_probability"] & ~over, found["probability"], read)
        over |= ended
    return rewards.reshape(POLICIES, ROOMS).mean(1), read.mean()


def main(generations=38, seed=0):
    """Runs the search up to a generation."""
    scene, state = nc.Scene("cf-brushless", word=WORD), pathlib.Path(f"policy-{seed}.npz")
    env = nc.VectorEnv(scene, POLICIES * ROOMS, control_hz=CONTROL_HZ, conditions="room")
    search = Search(N_WEIGHTS, 0.5)
    if state.exists():
        kept = np.load(state)
        search.__dict__.update({name: kept[name] for name in KEPT})
    while search.generation < generations:
        random = np.random.default_rng([seed, int(search.generation)])
        weights = search.ask(random)
        rewards, read = rewards_of(env, scene, weights, random.integers(1 << 31, size=ROOMS).tolist())
        search.tell(rewards)
        np.savez(state, **{name: getattr(search, name) for name in KEPT})
        print(f"{search.generation:4}  step {search.step:.3f}  reward {rewards.mean():6.2f}, best {rewards.max():6.2f}  P(read) {read:.2f}", flush=True)
    print(f"WEIGHTS = np.array({np.round(search.mean, 3).tolist()})")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
