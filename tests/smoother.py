"""Locates two drones from a range log with noctograph and with GTSAM, see tests/smoother."""

import csv
import json
import math
import pathlib
import subprocess
import sys

import gtsam
import numpy as np

ANCHORS = np.array([[-2.5, -2.5, 2.4], [2.5, -2.5, 0.2], [0.5, 2.5, 2.4], [-2.5, 2.5, 0.2]])
# Ranges are farther apart than the 10 ms within which they use a common state.
SIGMA, DENSITY, RATE, END = 0.06, 1.0, 50, 8
# Like noctograph, this starts at rest from the mean ranges of the first second in which the drones
# are heard.
START_S, START_SIGMA, START_SPEED = 1.0, 0.05, 0.5
LINKS = [("a", d, k) for d in range(2) for k in range(4)] + [("d", 0, 1)]


def place(drone, time):
    phase = (0.0, 1.9)[drone]
    wave = [math.sin(rate * time + phase) for rate in (0.7, 1.1, 0.9)]
    return np.array([0.8 * wave[0], 0.4 * wave[1], 1.0 + 0.4 * wave[2]])


def ends(link, at):
    kind, i, j = link
    return at[i], ANCHORS[j] if kind == "a" else at[j]


def log():
    random, rows = np.random.default_rng(5), []
    for k in range(END * RATE):
        link = LINKS[k % len(LINKS)]
        one, other = ends(link, [place(d, k / RATE) for d in range(2)])
        distance = np.linalg.norm(one - other) + SIGMA * random.standard_normal()
        rows.append((k / RATE, link, round(distance, 6)))
    return rows


def write(work, rows):
    anchors = [f"{k}:\n  x: {x}\n  y: {y}\n  z: {z}\n" for k, (x, y, z) in enumerate(ANCHORS)]
    (work / "anchors.yaml").write_text("".join(anchors))
    for drone in range(2):
        columns = [f"ranging.distance{k}" for k in range(4)] + ["ranging.drone2"] * (drone == 0)
        held = dict.fromkeys(columns, 0.0)
        with open(work / f"ranges-{drone + 1}.csv", "w", newline="") as file:
            out = csv.writer(file)
            out.writerow(["t", *columns])
            for time, (kind, i, j), distance in rows:
                if i == drone:
                    held["ranging.drone2" if kind == "d" else f"ranging.distance{j}"] = distance
                out.writerow([f"{time:.2f}", *held.values()])


def start(rows):
    """Fits positions to the mean ranges of the first seconds by least squares. Returns them with their information."""
    means, since = {}, {}
    for time, (kind, i, j), _ in rows:
        for drone in [i, j] if kind == "d" else [i]:
            since.setdefault(drone, time)
    for time, (kind, i, j), distance in rows:
        begin = max(since[i], since[j]) if kind == "d" else since[i]
        if begin <= time <= begin + START_S:
            means.setdefault((kind, i, j), []).append(distance)
    x = np.concatenate([place(d, 0.0) for d in range(2)])
    for _ in range(50):
        slopes, left = np.zeros((len(means), 6)), np.zeros(len(means))
        for row, (link, distances) in enumerate(means.items()):
            one, other = ends(link, x.reshape(2, 3))
            away = one - other
            unit = away / np.linalg.norm(away)
            slopes[row, 3 * link[1]:3 * link[1] + 3] = unit
            if link[0] == "d":
                slopes[row, 3 * link[2]:3 * link[2] + 3] = -unit
            left[row] = np.mean(distances) - np.linalg.norm(away)
        x = x + np.linalg.lstsq(slopes, left, rcond=None)[0]
    return x, slopes.T @ slopes


def gtsam_places(rows):
    """Computes positions by the Levenberg-Marquardt method, with one factor for each range and each step."""
    x, v, a = gtsam.symbol_shorthand.X, gtsam.symbol_shorthand.V, gtsam.symbol_shorthand.A
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    n = len(rows)
    for k, anchor in enumerate(ANCHORS):
        graph.add(gtsam.NonlinearEqualityPoint3(a(k), anchor))
        values.insert(a(k), anchor)
    key = lambda drone, k: drone * n + k
    first, information = start(rows)
    information = information / max(SIGMA, START_SIGMA) ** 2
    # One linear factor contains all six coordinates of the start, because their fit correlates the
    # drones.
    keys = [x(key(d, 0)) for d in range(2)]
    root = np.linalg.cholesky(information).T
    prior = gtsam.JacobianFactor(keys[0], root[:, :3], keys[1], root[:, 3:], np.zeros(6),
                                 gtsam.noiseModel.Unit.Create(6))
    about = gtsam.Values()
    for d in range(2):
        about.insert(keys[d], first[3 * d:3 * d + 3])
    graph.add(gtsam.LinearContainerFactor(prior, about))
    speed = gtsam.noiseModel.Isotropic.Sigma(3, START_SPEED)
    for d in range(2):
        graph.add(gtsam.PriorFactorPoint3(v(key(d, 0)), np.zeros(3), speed))
        for k, (time, _, _) in enumerate(rows):
            values.insert(x(key(d, k)), place(d, time) + 0.02)
            values.insert(v(key(d, k)), np.zeros(3))
    # Whitened factor of white acceleration over a time span.
    span, q, eye = 1 / RATE, 0.5 * DENSITY**2, np.eye(3)
    noise = q * np.block([[span**3 / 3 * eye, span**2 / 2 * eye], [span**2 / 2 * eye, span * eye]])
    white = np.linalg.inv(np.linalg.cholesky(noise))
    phi = np.block([[eye, span * eye], [0 * eye, eye]])
    blocks = np.hsplit(np.hstack([white @ -phi, white]), 4)

    def step(factor, values, jacobians):
        if jacobians is not None:
            for k, block in enumerate(blocks):
                jacobians[k] = np.asfortranarray(block)
        return sum(block @ values.atPoint3(one) for block, one in zip(blocks, factor.keys()))

    for d in range(2):
        for k in range(n - 1):
            keys = [x(key(d, k)), v(key(d, k)), x(key(d, k + 1)), v(key(d, k + 1))]
            graph.add(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(6), keys, step))
    sigma = gtsam.noiseModel.Isotropic.Sigma(1, SIGMA)
    for k, (_, (kind, i, j), distance) in enumerate(rows):
        other = a(j) if kind == "a" else x(key(j, k))
        graph.add(gtsam.RangeFactor3(x(key(i, k)), other, distance, sigma))
    options = gtsam.LevenbergMarquardtParams()
    options.setRelativeErrorTol(1e-9)
    options.setAbsoluteErrorTol(1e-9)
    found = gtsam.LevenbergMarquardtOptimizer(graph, values, options).optimize()
    places = [[found.atPoint3(x(key(d, k))) for k in range(n)] for d in range(2)]
    return np.array(places), graph.size()


def main():
    work, noctograph = pathlib.Path(sys.argv[1]), sys.argv[2]
    rows = log()
    write(work, rows)
    out = subprocess.run(
        [noctograph, "locate", "ranges-1.csv", "ranges-2.csv", "--anchors", "anchors.yaml",
         "--set", f"observer.ekf.two_way_sigma_m={SIGMA}", "--json", "-o", "out"],
        cwd=work, check=True, capture_output=True, text=True)
    assert json.loads(out.stdout)["refused_frac"] == 0.0, "one gate would be a factor less"
    wanted, factors = gtsam_places(rows)
    for drone in range(2):
        with open(work / "out" / f"flight-{drone + 1}.csv", newline="") as file:
            flown = list(csv.DictReader(file))
        # A flight extends from the first range of its drone to the last.
        found = np.array([[float(row[c]) for c in ("x_m", "y_m", "z_m")] for row in flown])
        times = np.array([float(row["time_s"]) for row in flown])
        heard = [time for time, (kind, i, j), _ in rows if drone == i or (kind, j) == ("d", drone)]
        first = round(heard[0] * RATE)
        at = np.arange(first, round(heard[-1] * RATE) + 1)
        assert np.abs(times - times[0] - (at - first) / RATE).max() < 1e-6
        apart = np.linalg.norm(found - wanted[drone][at], axis=1).max()
        true = np.array([place(drone, time) for time in at / RATE])
        rmse = math.sqrt(np.mean(np.sum((found - true) ** 2, axis=1)))
        print(f"drone {drone + 1}: {factors} factors, {1000 * apart:.3f} mm apart at most, "
              f"RMSE {1000 * rmse:.1f} mm")
        assert apart <= 1e-3


main()
