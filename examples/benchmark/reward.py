"""Measures whether the environments' reward ranks flights like their photographs, by Spearman's correlation with
P(read).

usage: python examples/benchmark/reward.py [EPISODES]

The flights use random policies (gains of a third to three times good values, a target with an offset of up to 6 cm
and a
delay of up to 0.3 s, and noisy commands) and six words, in different rooms.
"""

import sys

import noctograph as nc
import numpy as np

WORDS = ("T", "NO", "TEA", "FOX", "NOOR", "HELLO")
#: Gains of position and velocity (1/s², 1/s; x, y, z), attitude and rate (1/s², 1/s; yaw, pitch, roll).
GOOD = np.array([[9.0, 9.0, 20.0], [5.0, 5.0, 8.0], [10.0, 80.0, 80.0], [5.0, 16.0, 16.0]])


def ranks(values):
    """Returns ranks from 0, with the mean rank for equal values."""
    _, place, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - (count + 1) / 2)[place]


def spearman(a, b):
    """Returns the correlation of the ranks."""
    return float(np.corrcoef(ranks(a), ranks(b))[0, 1])


def episodes(word, n, seed):
    """Flies random policies. Returns rewards, rewards without that of the landing, P(read) and landing flags, each
    (n,)."""
    scene = nc.Scene("cf-brushless", word=word)
    env = nc.VectorEnv(scene, n, conditions="room")
    random = np.random.default_rng(seed)
    kp, kd, attitude_p, attitude_d = (gain * 3.0 ** random.uniform(-1, 1, (n, 3)) ** 3 for gain in GOOD)
    off_m = random.uniform(0, 0.06, (n, 1)) * random.normal(size=(n, 3)) * random.integers(0, 2, (n, 1))
    late_s = random.uniform(0, 0.3, (n, 1)) * random.integers(0, 2, (n, 1))
    trembling = random.uniform(0, 0.3, (n, 1)) * random.integers(0, 2, (n, 1))
    mixer, inertia = scene.motors_from_wrench, 1 / np.diag(np.array(nc.gains(scene)["B"])[9:])
    hover = mixer @ [0, 0, 0, 9.81 * scene.mass_kg]
    seen, _ = env.reset(seed=seed)
    rewards, on_the_way, probability = np.zeros((3, n))
    landed, over = np.zeros((2, n), bool)
    while not over.all():
        error, angles, velocity, rate, goal_m_s, goal_m_s2 = np.split(seen.astype(float), 6, axis=1)
        wanted = goal_m_s2 - kp * (error - off_m + late_s * goal_m_s) - kd * (velocity - goal_m_s)
        lean = np.clip(np.column_stack([0 * wanted[:, 0], wanted[:, 0] / 9.81, -wanted[:, 1] / 9.81]), -0.4, 0.4)
        turn = attitude_p * (lean - angles) - attitude_d * rate[:, ::-1]
        wrench = np.column_stack([inertia * turn[:, ::-1], scene.mass_kg * (9.81 + wanted[:, 2])])
        action = wrench @ mixer.T / hover - 1 + trembling * random.normal(size=(n, 4))
        seen, reward, ends, _, found = env.step(action)
        rewards += np.where(over, 0, reward)
        on_the_way += np.where(over | ends, 0, reward)
        if "probability" in found:
            new = ends & ~over & found["_probability"]
            probability[new], landed[new] = found["probability"][new], True
        over |= ends
    return rewards, on_the_way, probability, landed


def main(n):
    """Prints the correlation of each word and of all."""
    print("| word | episodes | landed | mean P(read) | all | landed | without the landing's reward |\n|---|---|---|---|---|---|---|")
    shares = []
    for seed, word in enumerate(WORDS):
        rewards, on_the_way, *rest = episodes(word, n // len(WORDS), seed)
        row(word, rewards, on_the_way, *rest)
        duration_s = nc.plan(nc.Scene("cf-brushless", word=word))[0].duration_s
        shares.append((rewards / duration_s, on_the_way / duration_s, *rest))
    row("all, per second of the plan", *(np.concatenate(column) for column in zip(*shares, strict=True)))


def row(name, rewards, on_the_way, probability, landed):
    """Returns a row of the table."""
    pairs = (rewards, probability), (rewards[landed], probability[landed]), (on_the_way[landed], probability[landed])
    found = " | ".join(f"{spearman(*pair):.2f}" for pair in pairs)
    print(f"| {name} | {len(landed)} | {landed.sum()} | {probability.mean():.2f} | {found} |", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 384)
