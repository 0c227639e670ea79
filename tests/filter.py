"""Filters the readings of scalar flights in a folder with FilterPy, see tests/filter."""

import csv
import json
import math
import pathlib
import sys

import numpy as np
from filterpy.kalman import KalmanFilter

GRAVITY, PERIOD, START = 9.81, 0.1, (0.05, 0.05, 0.02)
#: Constants that no scene sets, from altitude_filter.rs and AltitudeOptions.
FIXED = {
    "gnss_sigma_m": 0.05, "time_of_flight_sigma_m": 0.06, "gust_sigma_m_s2": 0.15, "gust_time_s": 2.0,
    "offset_walk_m_s2_sqrt_s": 0.005, "gain_walk_m_s2_sqrt_s": 0.3, "ranger_walk_m_sqrt_s": 0.003,
    "barometer_walk_m_sqrt_s": 0.05, "step_gate_sigmas": 4.0, "step_sigma_m": 0.5, "offset_sigma_m_s2": 0.1,
    "gain_sigma_m_s2": 1.9, "barometer_bias_sigma_m": 0.5,
}
STATES = ("z_m", "v_m_s", "offset_m_s2", "gain_m_s2", "ranger_bias_m", "barometer_bias_m")
ROWS = {
    "gnss_m": ([1, 0, 0, 0, 0, 0, 0], "gnss_sigma_m"),
    "time_of_flight_m": ([1, 0, 0, 0, 1, 0, 0], "time_of_flight_sigma_m"),
    "barometer_m": ([1, 0, 0, 0, 0, 1, 0], "barometer_sigma_m"),
}
RANGER, GUST = 4, 6


def started(options, hover, altitude_m):
    """Returns the filter before the flight."""
    kf = KalmanFilter(dim_x=7, dim_z=1)
    kf.x = np.array([altitude_m, 0, -GRAVITY, GRAVITY / hover, 0, 0, 0], float)
    sigmas = [START[0], START[1], options["offset_sigma_m_s2"], options["gain_sigma_m_s2"], START[2],
              options["barometer_bias_sigma_m"], options["gust_sigma_m_s2"]]
    kf.P = np.diag(np.square(sigmas))
    return kf


def predict(kf, options, throttle):
    t = PERIOD
    a = np.eye(7)
    a[0, 1] = t
    a[0, [2, 3, GUST]] = np.array([1, throttle, 1]) * t * t / 2
    a[1, [2, 3, GUST]] = np.array([1, throttle, 1]) * t
    a[GUST, GUST] = math.exp(-t / options["gust_time_s"])
    q = np.zeros((7, 7))
    density = options["acceleration_noise_m_s2_sqrt_hz"] ** 2 / 2  # of one-sided noise
    q[:2, :2] = density * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
    walks = ("offset_walk_m_s2_sqrt_s", "gain_walk_m_s2_sqrt_s", "ranger_walk_m_sqrt_s",
             "barometer_walk_m_sqrt_s")
    q[range(2, 6), range(2, 6)] = [options[walk] ** 2 * t for walk in walks]
    q[GUST, GUST] = (1 - a[GUST, GUST] ** 2) * options["gust_sigma_m_s2"] ** 2
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
        worst, steps, n = worst_difference(path, {**FIXED, **report["filter"]}, report["hover_throttle"])
        print(f"{path.stem:20} {n} steps of the filter, {steps} of the floor: {worst:.1e} apart")
        assert n == 601 and worst <= 1e-9, path
        assert steps == (2 if path.stem.startswith("step") else 0), path


main()
