"""Compares the model f(x, u) with the simulator, and tests Python estimators in the loop."""

import pathlib
import sys

import noctograph as nc
import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
from estimators import SCENE, Ekf, Luenberger  # noqa: E402

STILL = {"air.gusts": "none", "battery.capacity_ah": 0, "vehicle.ground_effect": "none", "rates.log_hz": 500}
TICK_S = 0.002


@pytest.mark.parametrize("preset", ["cf-brushless", "cf21", "ae483-2022"])
def test_the_model_flies_as_the_simulator(preset):
    scene = nc.Scene(preset, word="T", set={**STILL, "controller.kind": "lqr-integral"})
    model, (flight,) = nc.Model(scene), nc.fly(scene)
    states = [flight.position_m, flight.attitude_rad, flight.velocity_body_m_s, flight.rate_body_rad_s]
    x = model.complete(np.hstack(states), flight.motors)
    for k in range(len(x) - 1 if model.n == 16 else 0):  # a log has no rotors: they start at rest
        x[0, 12:] = 0
        x[k + 1, 12:] = model.step(x[k], flight.motors[k], TICK_S)[12:]
    air = np.flatnonzero(x[:-1, 2] > 0.05)
    one = np.abs(model.step(x[air], flight.motors[air], TICK_S) - x[air + 1])[:, :12]
    assert len(air) > 3000 and one.max() < 2e-6, "a log has six decimals"
    for k in air[500:-500:500]:
        y = x[k]
        for motors in flight.motors[k : k + 250]:
            y = model.step(y, motors, TICK_S)
        assert np.abs(y - x[k + 250])[:12].max() < 1e-5, "half a second ahead"


def test_the_linear_model_is_that_of_gains():
    scene = nc.Scene("cf21", set={"vehicle.rotor_inertia_kg_m2": 0})
    model, found = nc.Model(scene), nc.gains(scene)
    x, u = model.hover([1, 2, 3])
    assert np.abs(model.f(x, u)).max() < 1e-12
    a, b = model.linearize(x, u)
    assert a[:12, :12] == pytest.approx(np.array(found["A"]), abs=1e-6)
    # The effect of a command after the rotors have followed it.
    slow = -a[:12, 12:] @ np.linalg.inv(a[12:, 12:]) @ b[12:]
    assert slow == pytest.approx(np.array(found["B"]) @ np.linalg.inv(scene.motors_from_wrench), rel=1e-5, abs=1e-8)
    discrete, _ = model.linearize(x, u, 0.01)
    assert discrete == pytest.approx(np.linalg.matrix_power(np.eye(16) + a * 0.01 / 64, 64), abs=1e-2)
    at_once = nc.Model(nc.Scene("ae483-2022"))
    assert at_once.n == 12 and at_once.f(np.zeros((5, 2, 12)), np.zeros(4)).shape == (5, 2, 12)


def test_an_observer_in_python_flies_as_ours():
    (ours,), (theirs,) = nc.fly(SCENE), nc.fly(SCENE, estimator=Luenberger)
    assert np.abs(ours.position_m - theirs.position_m).max() < 1e-4, "m"
    assert np.abs(ours.estimate_m - theirs.estimate_m).max() < 1e-4, "m"
    many = nc.fly_many(SCENE, [1, 2], estimator=Luenberger, progress=False)
    same = nc.fly_many(SCENE, [1, 2], progress=False)
    assert many.rmse_x_m == pytest.approx(same.rmse_x_m, abs=1e-4) and not many.lost.any()


def test_a_filter_in_python_is_better_than_the_observer_and_meets_a_controller():
    def error_m(estimator):
        (flight,) = nc.fly(SCENE, estimator=estimator)
        return np.sqrt(np.mean((flight.estimate_m - flight.position_m) ** 2))

    assert error_m(Ekf) < error_m(Luenberger)
    seen = []

    def controller(state, reference):
        seen.append(state)
        return [0, 0, 0, 0]

    nc.fly(SCENE, controller=controller, estimator=lambda start: lambda readings, tick_s: start + 0.125)
    assert np.ptp(seen, axis=0).max() == 0 and seen[0][11] == 0.125, "it is told their estimate"


def test_readings_are_those_of_the_sensors():
    kinds = {"sweeps": (3, "sweeps"), "uwb-tdoa": (3, "ranges"), "gnss": (3, "position_m")}
    for positioning, (length, name) in kinds.items():
        scene = nc.Scene(word="I", set={"sensors.positioning": positioning, "sensors.heights": ["barometer", "time-of-flight"]})
        got = {}

        def make(start, got=got):
            def update(readings, tick_s):
                got.update(readings)
                assert tick_s == TICK_S and readings["rate_rad_s"].flags.writeable
                return start

            return update

        nc.fly(scene, controller=lambda state, reference: [0, 0, 0, 0], estimator=make)
        assert {"rate_rad_s", "specific_force_m_s2", "throttle", "barometer", "time-of-flight", name} == set(got)
        assert len(got[name] if name == "position_m" else got[name][0]) == length
        assert got["specific_force_m_s2"][2] == pytest.approx(9.81, abs=0.5)


def test_faults_of_an_estimator_are_told_as_a_controllers():
    with pytest.raises(ZeroDivisionError):
        nc.fly(SCENE, estimator=lambda start: lambda readings, tick_s: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        nc.fly(SCENE, estimator=lambda start: 1 / 0)
    with pytest.raises(nc.InputError, match="twelve states"):
        nc.fly(SCENE, estimator=lambda start: lambda readings, tick_s: start[:9])
    with pytest.raises(nc.InputError, match="nan for state 3|NaN for state 3"):
        nc.fly_many(SCENE, 2, estimator=lambda start: lambda readings, tick_s: start / (np.arange(12) != 3), progress=False)
    with pytest.raises(nc.InputError, match="2 plans"):
        nc.fly(nc.Scene(word="NOOR", set={"plan.drones": 2}), estimator=Luenberger)
