"""Tests flights of other simulators: checks, warnings, and missing quantities."""

import importlib.util
import os
import pathlib
import subprocess
import sys
import warnings

import noctograph as nc
import numpy as np
import pytest

SMALL = {"camera.width_px": 640, "camera.height_px": 360}


@pytest.fixture(scope="module")
def scene():
    return nc.Scene("cf21", word="T", set=SMALL)


@pytest.fixture(scope="module")
def plan(scene):
    return nc.plan(scene)[0]


def heard(make):
    """Returns the warnings while a function runs, and its result."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        made = make()
    assert all(issubclass(it.category, nc.NoctographWarning) for it in said)
    return [str(it.message) for it in said], made


def test_a_flight_as_documented_is_not_asked_about(scene, plan):
    said, shot = heard(lambda: nc.photograph(scene, nc.Flight(plan.time_s, plan.position_m, light=plan.light)))
    assert said == [] == shot.warnings and shot.legible


def test_units_axes_and_lamps_are_asked_about(scene, plan):
    t, x, on = plan.time_s, plan.position_m, plan.light
    level = np.zeros((len(t), 3))
    flights = {
        "meters": lambda: nc.Flight(t, 1000 * x, light=on),
        "z down": lambda: nc.Flight(t, x * [1, -1, -1], light=on),
        "y up": lambda: nc.Flight(t, x[:, [0, 2, 1]] * [1, 1, -1], light=on),
        "degrees": lambda: nc.Flight(t, x, light=on, attitude_rad=level + [0, 20, 0]),
        "quaternion": lambda: nc.Flight(t, x, light=on, attitude_rad=level + [0, 0, 3.1]),
        "never left the floor": lambda: nc.Flight(t, x * [1, 1, 0], light=on, design_m=x),
        "float32": lambda: nc.Flight((t + 1.7e9).astype(np.float32), x, light=on),
        "the design is": lambda: nc.Flight(t, x, light=on, design_m=1000 * x),
    }
    for word, make in flights.items():
        said, flight = heard(make)
        assert any(word in it for it in said) and said == flight.warnings, (word, said)
        assert set(flight.warnings) <= set(heard(lambda flight=flight: nc.photograph(scene, [flight]))[1].warnings), word
    pictures = {
        "away from the camera": lambda: nc.Flight(t, x, light=on, attitude_rad=level + [1.5708, 0, 0]),
        "outside the picture": lambda: nc.Flight(t, x + [3, 0, 0], light=on),
        "no lamp for the light of color-led": lambda: nc.Flight(t, x, light={"headlights": on, "color-led": on}),
        "no lamp that writes is lit": lambda: nc.Flight(t, x, light={"color-led": on}),
    }
    for word, make in pictures.items():
        said, shot = heard(lambda make=make: nc.photograph(scene, [make()]))
        assert any(word in it for it in said) and any(word in it for it in shot.warnings), (word, said, shot.warnings)
    for advice in shot.warnings:
        assert "camera.framing = word" not in advice, "it is"
    with pytest.raises(nc.NoctographWarning), warnings.catch_warnings():
        warnings.simplefilter("error")
        flights["meters"]()


def test_an_exposure_begins_with_the_flight(scene, plan, tmp_path):
    first = nc.photograph(scene, [nc.Flight(plan.time_s, plan.position_m, light=plan.light)])
    for begins_s in (-8.0, 600.0, 16_903.25, 1.7e9):
        flight = nc.Flight(plan.time_s + begins_s, plan.position_m, light=plan.light)
        assert flight.time_s[0] == begins_s, "its own clock"
        shot = nc.photograph(scene, [flight])
        assert shot.film_sha256 == first.film_sha256 and shot.to_png() == first.to_png(), begins_s
        flight.save(tmp_path / "flight.csv")
        again = nc.photograph(scene, [tmp_path / "flight.csv"])
        assert (again.image == first.image).all(), "and of its file"
    late = nc.Scene(scene, set={"camera.shutter_open_s": 5.0})
    assert any("shutter opens" in it for it in heard(lambda: nc.photograph(late, [flight]))[1].warnings)


def test_without_a_design_there_is_no_figure(scene, plan):
    late_m = plan.at(plan.time_s - 0.4).position_m + [0, 0, 0.03]
    flight = nc.Flight(plan.time_s, late_m, light=plan.light)
    for name in ("design_m", "velocity_body_m_s", "motors", "estimate_m", "rate_body_rad_s"):
        assert np.isnan(getattr(flight, name)).all(), name
    verdict = nc.photograph(scene, [flight]).verdict
    assert not any("according to the log" in it["text"] for it in verdict["advice"])
    assert nc.compare(flight, flight)["a"]["tracking"] is None
    compared = nc.compare(flight, flight, design=plan)
    assert compared["a"]["tracking"]["lag_s"] == pytest.approx(0.4, abs=0.02)
    later = nc.Flight(plan.time_s + 600, late_m, light=plan.light)
    assert (later.with_design(plan).design_m == flight.with_design(plan).design_m).all()
    assert (later.with_design(plan, begins_s=600).design_m == flight.with_design(plan, begins_s=0).design_m).all()
    observations = np.zeros((len(plan.time_s), 20))
    observations[:, :3], observations[:, 6] = late_m, 1
    same = nc.from_pybullet(plan.time_s, observations, light=plan.light, design_m=plan.position_m)
    assert nc.compare(same, same)["a"]["tracking"]["lag_s"] == pytest.approx(0.4, abs=0.02)


def test_a_plan_is_known_at_any_time(plan):
    for name in ("position_m", "velocity_m_s", "acceleration_m_s2", "light"):
        # The last setpoint may have a velocity, but the design rests after it.
        assert getattr(plan.at(plan.time_s), name)[:-1] == pytest.approx(getattr(plan, name)[:-1], abs=1e-12), name
    time_s = np.linspace(0, plan.duration_s, 40_001)[1:-1]
    at = plan.at(time_s)
    moved = np.gradient(at.position_m, time_s, axis=0)
    # If the acceleration jumps, the difference quotient of two samples has an error of half the jump.
    assert np.quantile(np.abs(moved - at.velocity_m_s), 0.99) < 2e-3
    assert at.jerk_m_s3.shape == (len(time_s), 3) and at.yaw_rad.shape == at.light.shape == time_s.shape
    assert (plan.at(plan.time_s).lights["headlights"] == plan.lights["headlights"]).all()
    assert (plan.at(plan.time_s - 1e-9).light == plan.light).all(), "as binary fractions have it"
    one = plan.at(1.23)
    assert one.position_m.shape == (3,) and np.ndim(one.light) == 0 and one.position_m == pytest.approx(plan.at([1.23]).position_m[0])
    before, after = plan.at(-1.0), plan.at(plan.duration_s + 9)
    assert (before.position_m == plan.position_m[0]).all() and (after.position_m == plan.position_m[-1]).all()
    assert not before.velocity_m_s.any() and not after.velocity_m_s.any() and not after.light
    with pytest.raises(nc.InputError, match="finite"):
        plan.at([0, np.nan])
    with pytest.raises(nc.InputError, match="one row"):
        plan.at(np.zeros((2, 2)))
    references = []
    scene = nc.Scene("cf21", word="T", set={"plan.reference": "design", "plan.light_clock": "setpoint"})
    lqr_scene = nc.Scene(scene, set={"controller.kind": "lqr"})
    k, motors = lqr_scene.gain()[:, :12], scene.motors_from_wrench

    def lqr(state, reference, time_s):
        references.append((time_s, *reference))
        error = state.copy()
        error[:3] -= reference[:3]
        return motors @ (np.array([0, 0, 0, 9.81 * scene.mass_kg]) - k @ error)

    nc.fly(scene, controller=lqr)
    rows = np.array(references)
    at = nc.plan(scene)[0].at(rows[:, 0])
    assert np.hstack([at.position_m, at.velocity_m_s, at.acceleration_m_s2]) == pytest.approx(rows[:, 1:], abs=1e-6)


def test_arrays_may_be_written_to(scene, plan):
    hover, seen = scene.motors_from_wrench @ [0, 0, 0, 9.81 * scene.mass_kg], []

    def controller(state, reference):
        state += 1
        reference *= 0
        seen.append(True)
        return hover

    class Estimator:
        def __init__(self, state):
            state += 0
            self.state = state

        def __call__(self, readings, tick_s):
            readings["rate_rad_s"] -= 1
            self.state[2] += 1e-6
            return self.state

    for call in (lambda: nc.fly(scene, controller=controller), lambda: nc.fly(scene, estimator=Estimator)):
        try:
            call()
        except nc.InfeasibleError as lost:
            assert "observer.ekf" not in str(lost), "it did not fly"
    for vectorized in (False, True):
        def many(state, reference):
            state += 0
            return hover if not vectorized else np.tile(hover, (len(state), 1))
        nc.fly_many(scene, 2, controller=many, vectorized=vectorized, progress=False)
    flight = nc.Flight(plan.time_s, plan.position_m)
    flight.position_m[:] = 0
    assert flight.position_m.any() and seen, "a copy"


def test_shapes_are_told_what_to_do(plan):
    with pytest.raises(nc.InputError) as caught:
        nc.Flight(plan.time_s, plan.position_m.T)
    assert "position_m.T" in caught.value.hint and "reshape" not in str(caught.value)
    with pytest.raises(nc.InputError) as caught:
        nc.Flight(plan.time_s, plan.position_m, attitude_rad=np.zeros((3, len(plan.time_s))))
    assert "attitude_rad.T" in caught.value.hint
    with pytest.raises(nc.InputError, match=r"time_s\.ravel"):
        nc.Flight(plan.time_s[:, None], plan.position_m)
    with pytest.raises(nc.InputError, match="two or more"):
        nc.Flight([], np.zeros((0, 3)))
    with pytest.raises(nc.InputError, match="wanted a Flight"):
        nc.photograph(nc.Scene("cf21", word="T"), plan)


@pytest.mark.parametrize("command", [0.6, 1000.0])
def test_commands_in_other_units_are_told_of(scene, command):
    said, (flight,) = heard(lambda: nc.fly(scene, controller=lambda state, reference: [command] * 4))
    assert any("never left the floor" in it and f"{command:.1f} of 65535" in it for it in said)
    assert said == flight.warnings
    said, outcomes = heard(lambda: nc.fly_many(scene, 2, controller=lambda s, r: [command] * 4, progress=False))
    assert any("2 of 2 flights: the drone never left the floor" in it for it in said) and not outcomes.legible.any()


def table(path, plan, columns):
    """Writes a log with the given columns."""
    names = ["t", "x", "y", "z", *columns]
    rows = np.column_stack([plan.time_s, plan.position_m, *columns.values()])
    path.write_text(",".join(names) + "\n" + "\n".join(",".join(f"{v:.5f}" for v in row) for row in rows) + "\n")
    return path


def test_a_log_keeps_its_lights(scene, plan, tmp_path):
    design = dict(zip(["x_des", "y_des", "z_des"], plan.position_m.T))
    log = table(tmp_path / "log.csv", plan, {**design, "light.headlights": plan.light})
    assert nc.photograph(scene, nc.import_log(log, scene)).legible
    assert nc.photograph(scene, [log]).legible
    dark = table(tmp_path / "dark.csv", plan, {**design, "light.headlights": 0 * plan.light})
    assert nc.import_log(dark, scene).lights["headlights"].max() == 0


def test_the_table_of_rotorpy_has_its_design(plan, tmp_path):
    late_m = plan.at(plan.time_s - 0.2).position_m
    names = ["xdot", "ydot", "zdot", "qx", "qy", "qz", "qw", "wx", "wy", "wz"]
    still = dict(zip(names, np.tile([0, 0, 0, 0, 0, 0, 1, 0, 0, 0], (len(plan.time_s), 1)).T))
    late = nc.Plan(plan.time_s, late_m)
    log = table(tmp_path / "rotorpy.csv", late, {**still, **dict(zip(["xdes", "ydes", "zdes"], plan.position_m.T))})
    flight = nc.import_log(log)
    assert np.isfinite(flight.design_m).all()
    assert nc.compare(flight, flight)["a"]["tracking"]["lag_s"] == pytest.approx(0.2, abs=0.03), "setpoints of a log are held"


def test_reports_name_no_temporary_file(plan):
    flight = nc.Flight(plan.time_s, plan.position_m)
    said, report = heard(lambda: nc.compare(flight, flight))
    assert said == [] and "noctograph-" not in report.text, said


def test_environments_refuse_what_they_cannot_step(scene):
    gymnasium = pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    env = nc.Env(scene)
    with pytest.raises(nc.InputError, match="reset"):
        env.step(np.zeros(4))
    env.reset(seed=1)
    with pytest.raises(nc.InputError, match=r"\(3,\)"):
        env.step(np.zeros(3))
    with pytest.raises(nc.InputError, match="control_hz"):
        nc.Env(scene, control_hz=0)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        check_env(nc.Env(scene), skip_render_check=True)
    assert not said, [str(it.message) for it in said]
    assert np.isfinite(env.observation_space.low).all() and gymnasium


def test_strokes_in_another_order_are_named_as_the_cause(tmp_path):
    scene = nc.Scene("cf21", word="NOOR")
    (plan,) = nc.plan(scene)
    log = table(tmp_path / "log.csv", plan, dict(zip(["x_des", "y_des", "z_des"], plan.position_m.T)))
    with pytest.raises(nc.InputError, match="in their order"):
        nc.import_log(log, scene)


def test_a_photo_without_light_is_scored_as_the_shot_is(scene, plan):
    shot = nc.photograph(scene, nc.Flight(plan.time_s, plan.position_m, light=0 * plan.light))
    scored = nc.score(shot.image, shot.scene)
    assert scored["readability"] == shot.verdict["readability"] and scored["reason"] == shot.verdict["reason"] == "no_light"


SIMULATORS = pathlib.Path(__file__).parent.parent / "simulators"


@pytest.mark.parametrize("package", ["rotorpy", "crazyflow", "gym_pybullet_drones", "mujoco"])
def test_the_flights_of_other_simulators_are_read(package, tmp_path):
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed")
    model = [os.environ.get("NOCTOGRAPH_CF2", "")] if package == "mujoco" else []
    if model == [""]:
        pytest.skip("NOCTOGRAPH_CF2 names cf2.xml of Menagerie")
    name = "pybullet" if package == "gym_pybullet_drones" else package
    words = [sys.executable, SIMULATORS / f"{name}_flight.py", "T", tmp_path / "t.png", *model]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "reads as T: legible" in done.stdout, done.stdout + done.stderr
    assert "NoctographWarning" not in done.stderr, done.stderr


CONTROLLERS = {
    "RotorPy": "rotorpy", "Crazyflow": "crazyflow", "Pybullet": "gym_pybullet_drones", "Udaan": "udaan",
    "Raptor": "foundation_policy",
}  # fmt: skip


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controllers_of_other_projects_fly(name, tmp_path):
    if importlib.util.find_spec(CONTROLLERS[name]) is None:
        pytest.skip(f"{CONTROLLERS[name]} is not installed")
    handed_in = tmp_path / "handed-in"
    handed_in.mkdir()
    (handed_in / "theirs.py").write_text((SIMULATORS / "controllers.py").read_text() + f"\n\ncontroller = {name}\n")
    code = f"""
import sys; sys.path.insert(0, {str(SIMULATORS)!r})
import controllers, noctograph as nc
from noctograph.grade import grade
lags = {{"vehicle.motor_rise_s": 0.05, "vehicle.motor_fall_s": 0.05}}
task = nc.Scene("cf21", word="T", set={{**{SMALL!r}, **lags, "air.gusts": "none"}})
scene, made = nc.Scene(task, set={{"observer.kind": "truth"}}), controllers.{name}
assert nc.photograph(scene, nc.fly(scene, controller=made(scene))).legible
found = nc.fly_many(scene, 2, controller=made, progress=False)
assert found.legible.all() and found.contour_m.max() < 0.03, found
ranked = nc.rank({{"theirs": (scene, made)}}, seeds=1, conditions="still", progress=False)
graded = grade(task, {str(handed_in)!r}, seeds=1, conditions="still", progress=False)
for report in (ranked, graded):
    assert [it["legible"] for it in report["flights"]] == [True], report.text
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_stable_baselines_asks_nothing_of_the_environment(scene):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.env_checker import check_env

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        check_env(nc.Env(scene))
    assert not said, [str(it.message) for it in said]
