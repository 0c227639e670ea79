"""Filters the readings of scalar flights in a folder with FilterPy: see tests/filter."""

import csv
import json
import math
import pathlib
import sys

import numpy as np
from filterpy.kalman import KalmanFilter

GRAVITY, PERIOD, START = 9.81, 0.1, (0.05, 0.05, 0.02)
STATES = ("z_m", "v_m_s", "offset_m_s2", "gain_m_s2", "ranger_bias_m", "barometer_bias_m")
ROWS = {
    "gnss_m": ([1, 0, 0, 0, 0, 0], "gnss_sigma_m"),
    "time_of_flight_m": ([1, 0, 0, 0, 1, 0], "time_of_flight_sigma_m"),
    "barometer_m": ([1, 0, 0, 0, 0, 1], "barometer_sigma_m"),
}
RANGER = 4


def started(options, hover, altitude_m):
    """The filter before the flight: the hover throttle ties the offset to the gain."""
    gain, spread = GRAVITY / hover, options["gain_sigma_m_s2"] ** 2
    kf = KalmanFilter(dim_x=6, dim_z=1)
    kf.x = np.array([altitude_m, 0, -GRAVITY, gain, 0, 0], float)
    kf.P = np.diag([START[0] ** 2, START[1] ** 2, 0, spread, START[2] ** 2,
                    options["barometer_bias_sigma_m"] ** 2])
    kf.P[2, 2] = hover**2 * spread + (options["hover_throttle_sigma"] * gain) ** 2
    kf.P[2, 3] = kf.P[3, 2] = -hover * spread
    return kf


def predict(kf, options, throttle):
    t = PERIOD
    a = np.eye(6)
    a[0, 1], a[0, 2:4] = t, [t * t / 2, throttle * t * t / 2]
    a[1, 2:4] = [t, throttle * t]
    q = np.zeros((6, 6))
    density = options["acceleration_noise_m_s2_sqrt_hz"] ** 2
    q[:2, :2] = density * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
    walks = ("offset_walk_m_s2_sqrt_s", "gain_walk_m_s2_sqrt_s", "ranger_walk_m_sqrt_s",
             "barometer_walk_m_sqrt_s")
    q[range(2, 6), range(2, 6)] = [options[walk] ** 2 * t for walk in walks]
    kf.predict(F=a, Q=q)


def worst_difference(path, options, hover):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    kf = started(options, hover, 1.5)
    beyond, throttle, worst, steps = [], None, 0.0, 0
    for row in rows:
        if throttle is not None:
            predict(kf, options, throttle)
        for name, (h, sigma) in ROWS.items():
            if not row[name]:
                continue
            measured, h = float(row[name]), np.array([h], float)
            r = options[sigma] ** 2
            if name == "time_of_flight_m":
                innovation = measured - (h @ kf.x).item()
                spread = math.sqrt((h @ kf.P @ h.T).item() + r)
                if abs(innovation) / spread > options["step_gate_sigmas"]:
                    beyond.append(innovation)
                    if len(beyond) == 2:
                        kf.x[RANGER] += sum(beyond) / 2
                        kf.P[RANGER, RANGER] += options["step_sigma_m"] ** 2
                        beyond, steps = [], steps + 1
                    continue
                beyond = []
            kf.update(np.array([measured]), R=np.array([[r]]), H=h)
        for i, state in enumerate(STATES):
            found = (kf.x[i], math.sqrt(kf.P[i, i]))
            wanted = (float(row[f"{state}_estimated"]), float(row[f"{state}_sigma"]))
            worst = max(worst, *(abs(a - b) / max(1.0, abs(b)) for a, b in zip(found, wanted)))
        throttle = float(row["throttle"])
    return worst, steps, len(rows)


def main():
    work = pathlib.Path(sys.argv[1])
    report = json.loads((work / "hold.json").read_text())
    flights = sorted(work.glob("*-scalar.csv"))
    assert len(flights) == 6, flights
    for path in flights:
        worst, steps, n = worst_difference(path, report["filter"], report["hover_throttle"])
        print(f"{path.stem:20} {n} steps of the filter, {steps} of the floor: {worst:.1e} apart")
        assert n == 601 and worst <= 1e-9, path
        assert steps == (2 if path.stem.startswith("step") else 0), path


main()
