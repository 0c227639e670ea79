"""Compares the package with the command line: `pytest`, with the path of the program in NOCTOGRAPH."""

import ast
import concurrent.futures
import hashlib
import importlib.util
import inspect
import json
import os
import pathlib
import pickle
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import urllib.request

import noctograph as nc
import numpy as np
import pytest

HERE = pathlib.Path(__file__).parent
SMALL = {"camera.width_px": 640, "camera.height_px": 360}


def program(*arguments, cwd):
    found = os.environ.get("NOCTOGRAPH") or shutil.which("noctograph")
    if not found:
        pytest.skip("the program is not installed: NOCTOGRAPH names it")
    command = [found, *arguments]
    return subprocess.run(command, cwd=cwd, check=False, capture_output=True, text=True).stdout


@pytest.fixture(scope="module")
def shot():
    return nc.preview("RIGA", seed=3)


def test_bytes_are_those_of_the_command_line(shot, tmp_path):
    program("preview", "RIGA", "--seed", "3", "-o", "out", cwd=tmp_path)
    assert shot.to_png() == (tmp_path / "out/photo.png").read_bytes()
    assert shot.flights[0].to_csv() == (tmp_path / "out/flight.csv").read_text()
    verdict = json.loads((tmp_path / "out/verdict.json").read_text())
    assert {key: verdict[key] for key in shot.verdict} == shot.verdict
    assert nc.plan(nc.Scene(word="RIGA", seed=3))[0].to_csv() == (tmp_path / "out/plan.csv").read_text()
    assert nc.read(tmp_path / "out/photo.png") == "RIGA"


def test_the_package_brings_the_program_along(tmp_path):
    def own(*arguments):
        command = [sys.executable, "-m", "noctograph", *arguments]
        return subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)

    own("preview", "RIGA", "--seed", "3", "--size", "320x180", "-o", "own")
    program("preview", "RIGA", "--seed", "3", "--size", "320x180", "-o", "out", cwd=tmp_path)
    for name in ("photo.png", "verdict.json"):
        assert (tmp_path / "own" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()
    assert own("--version").stdout == program("--version", cwd=tmp_path)
    refused = own("preview", "RIGA", "--scene", "none.toml")
    assert refused.returncode == 2 and "none.toml" in refused.stderr and "Traceback" not in refused.stderr
    with subprocess.Popen([sys.executable, "-m", "noctograph", "serve", "--json"], stdout=subprocess.PIPE, text=True) as served:
        page = json.loads(served.stdout.readline())["page"]
        with urllib.request.urlopen(page) as answer:
            assert answer.status == 200
        served.send_signal(signal.SIGINT)
        assert served.wait(10) == -signal.SIGINT


def test_stages_make_the_same_photo(shot):
    scene = nc.Scene(word="RIGA", seed=3)
    flights = nc.fly(scene, nc.plan(scene))
    assert flights[0].sha256 == shot.flights[0].sha256
    assert nc.photograph(scene, flights).film_sha256 == shot.film_sha256
    scored = nc.score(shot.image, shot.scene)
    assert scored["read"] == "RIGA" and scored["readability"] == shot.verdict["readability"]


def test_arrays_have_shapes_and_are_copies(shot):
    flight = shot.flights[0]
    n = len(flight)
    shapes = {"time_s": (n,), "position_m": (n, 3), "design_m": (n, 3), "estimate_m": (n, 3), "attitude_rad": (n, 3),
              "velocity_body_m_s": (n, 3), "rate_body_rad_s": (n, 3), "motors": (n, 4)}  # fmt: skip
    for name, shape in shapes.items():
        array = getattr(flight, name)
        assert array.shape == shape and array.dtype == np.float64, name
        array[:] = 0
        assert name == "time_s" or getattr(flight, name).any(), name
    assert set(flight.lights) == {"headlights"} and {"battery_v", "energy_j"} <= set(flight.extra)
    assert shot.image.shape == (1080, 1920, 3) and not shot.image.flags.writeable
    assert 0.9 < flight.position_m[flight.lights["headlights"] > 0, 2].max() < 1.1, "capitals end at 1 m"


def test_a_flight_of_any_simulator_is_photographed():
    time_s = np.linspace(0, 12, 1201)
    angle = 2 * np.pi * time_s / 10
    on = (time_s < 10).astype(float)
    circle = np.stack([0.3 * np.cos(angle), 0 * angle, 1 + 0.3 * np.sin(angle)], axis=1)
    image = nc.photograph(nc.Scene(word="", set=SMALL), [nc.Flight(time_s, circle, light=on)]).image
    lit = np.argwhere(image.min(axis=2) > 250)
    assert len(lit) > 100
    height, width = np.ptp(lit, axis=0)
    assert abs(height - width) < 0.05 * width, "a circle"
    middle = image[image.shape[0] // 2, image.shape[1] // 2]
    assert middle.max() < 100, "and not a disc"
    # Read-only, strided and integer arrays are accepted.
    nc.Flight(np.arange(5), np.zeros((3, 5)).T)


def test_a_controller_in_python_flies():
    scene = nc.Scene("cf21", word="NOOR", seed=1, set={"controller.kind": "lqr", "air.gusts": "none"})
    k, motors = scene.gain()[:, :12], scene.motors_from_wrench
    assert k.shape == (4, 12) and motors.shape == (4, 4)
    calls = 0

    def lqr(state, reference):
        nonlocal calls
        calls += 1
        error = state.copy()
        error[:3] -= reference[:3]
        return motors @ (np.array([0, 0, 0, 9.81 * scene.mass_kg]) - k @ error)

    (flight,) = nc.fly(scene, controller=lqr)
    assert calls > 15_000
    (ours,) = nc.fly(nc.Scene(scene, set={"plan.reference": "design", "plan.light_clock": "setpoint"}))
    error_m = np.abs(flight.position_m - ours.position_m).max()
    assert 0 < error_m < 0.15, f"{error_m} m from the regulator of the same gain, which also knows the rotors"
    assert nc.photograph(scene, [flight]).verdict["read"] == "NOOR"

    with pytest.raises(ZeroDivisionError):
        nc.fly(scene, controller=lambda state, reference: 1 / 0)
    with pytest.raises(nc.InputError, match="four motor commands"):
        nc.fly(scene, controller=lambda state, reference: [1, 2, 3])
    with pytest.raises(nc.InputError, match="2 plans"):
        nc.fly(nc.Scene(word="NOOR", set={"plan.drones": 2}), controller=lqr)
    with pytest.raises(nc.InputError, match="NaN for m2"):
        nc.fly(scene, controller=lambda state, reference: [0, np.nan, 0, 0])


def hover_lqr(scene):
    """The scene's own gain without its rotors, of one drone or of many."""
    k, motors = nc.Scene(scene, set={"controller.kind": "lqr"}).gain()[:, :12], scene.motors_from_wrench

    def lqr(state, reference):
        error = np.array(state)
        error[..., :3] -= reference[..., :3]
        return (np.array([0, 0, 0, 9.81 * scene.mass_kg]) - error @ k.T) @ motors.T

    return lqr


def test_a_controller_is_told_the_time():
    scene = nc.Scene(word="I", set=SMALL)
    lqr, times = hover_lqr(scene), []

    def timed(state, reference, time_s):
        times.append(time_s)
        return lqr(state, reference)

    (flight,) = nc.fly(scene, controller=timed)
    assert np.allclose(np.diff(times), 1 / 500) and 0 <= times[0] < times[-1] <= flight.time_s[-1]
    first_up = flight.time_s[np.flatnonzero(flight.motors.max(axis=1) > 0)[0]]
    assert abs(times[0] - first_up) <= 1 / 250, "from the first tick on"


def test_controllers_in_python_fly_many_and_are_ranked():
    scene = nc.Scene(word="I", set={"air.gusts": "none", **SMALL})
    lqr, made = hover_lqr(scene), []

    class Counting:
        def __init__(self):
            self.calls = 0
            made.append(self)

        def __call__(self, state, reference):
            self.calls += 1
            return lqr(state, reference)

    one = nc.fly_many(scene, 3, controller=Counting, progress=False)
    all_at_once = nc.fly_many(scene, 3, controller=lqr, vectorized=True, progress=False)
    assert len(made) == 3 and min(each.calls for each in made) > 1000
    for name in ("probability", "contour_m", "rmse_x_m", "lost"):
        assert np.allclose(getattr(one, name), getattr(all_at_once, name)), name
        assert getattr(one, name).shape == (1, 3)
    (flight,) = nc.fly(nc.Scene(scene, seed=2), controller=lqr)
    lit = np.flatnonzero(flight.lights["headlights"])
    error_m = (flight.position_m - flight.design_m)[lit[0]:lit[-1] + 1, 0]
    assert one.rmse_x_m[0, 2] == pytest.approx(np.sqrt(np.mean(error_m**2)), rel=0.05), "the flight of `fly`"

    def falling(state, reference, time_s):
        return np.where((time_s > 5)[:, None], [65535, 65535, 0, 0], lqr(state, reference))

    falls = nc.fly_many(scene, 2, controller=falling, vectorized=True, progress=False)
    assert falls.lost.all() and not falls.probability.any() and np.isnan(falls.contour_m).all()
    ranked = nc.rank({"python": (scene, lqr), "pid": nc.Scene("pid", set=SMALL)}, ["I"], seeds=4, vectorized=True, progress=False)
    assert [flight["contender"] for flight in ranked["flights"]].count("python") == 4 and len(ranked["measures"]) == 2
    with pytest.raises(nc.InputError, match=r"\(2, 4\)"):
        nc.fly_many(scene, 2, controller=lambda state, reference: [0, 0, 0, 0], vectorized=True, progress=False)


def test_a_drone_that_stands_is_asked_about():
    scene = nc.Scene(word="I")

    def shares(state, reference):
        return [0.6, 0.6, 0.6, 0.6]

    with pytest.warns(UserWarning, match="never left the floor.*reach 0.6 of 65535"):
        (flight,) = nc.fly(scene, controller=shares)
    assert "never left the floor" in flight.warnings[0]
    with pytest.warns(UserWarning, match="2 of 2 flights: .*never left the floor.*reach 0.6 of 65535"):
        nc.fly_many(scene, np.int64(2), controller=shares, progress=False)


def test_the_acuity_of_a_controller_is_a_height():
    class Still:
        def __call__(self, state, reference):
            return [0, 0, 0, 0]

    scene = nc.Scene("pid", set=SMALL)
    with pytest.warns(UserWarning, match="never left the floor"):
        contenders = {"pid": scene, "still": (scene, Still)}
        ranked = nc.rank(contenders, ["I"], seeds=2, acuity=1, conditions="still", progress=False)
    small, still = ranked["acuity"]["limits"]
    assert (small["contender"], still["contender"], still["n_flights"]) == ("pid", "still", 7)
    heights_m = [limit["cap_height_m"]["value"] for limit in (small, still)]
    assert heights_m[0] < heights_m[1] and len(small["rungs"]) == 7 and still["rungs"][0]["letters_read"] < 0.1
    assert "acuity_m" in ranked.files["ranking.csv"].decode()


def test_a_flight_has_the_covariance_of_its_filter():
    scene = nc.Scene(word="I")
    (flight,), (plain,) = nc.fly(scene, covariance=True), nc.fly(scene)
    assert (flight.position_m == plain.position_m).all() and (flight.motors == plain.motors).all()
    sigma_m, nees = flight.extra["estimate_sigma_m"], flight.extra["estimate_nees"]
    lit = flight.lights["headlights"] > 0
    error_m = np.linalg.norm(flight.estimate_m - flight.position_m, axis=1)
    assert "estimate_nees" not in plain.extra and (sigma_m[lit] > 0).all() and sigma_m[lit].max() < 0.2
    assert (3 * nees[lit] >= 0.99 * (error_m[lit] / sigma_m[lit]) ** 2 - 1e-3).all()


def test_plans_are_made_of_arrays():
    (plan,) = nc.plan(nc.Scene(word="I"))
    same = nc.Plan(plan.time_s, plan.position_m, light=plan.lights, velocity_m_s=plan.velocity_m_s,
                   acceleration_m_s2=plan.acceleration_m_s2, sent_m=plan.sent_m)  # fmt: skip
    for name in ("time_s", "position_m", "velocity_m_s", "acceleration_m_s2", "sent_m"):
        assert np.allclose(getattr(same, name), getattr(plan, name), atol=2e-6), name
    assert (same.lights["headlights"] == plan.lights["headlights"]).all()
    time_s = np.arange(0, 8, 0.02)
    up = np.clip(time_s / 4, 0, 1)[:, None] * [0, 0, 0.8]
    (flight,) = nc.fly(nc.Scene(word="I"), [nc.Plan(time_s, up, light=(time_s > 4).astype(float))])
    assert abs(flight.position_m[-1, 2] - 0.8) < 0.1


@pytest.mark.parametrize("product", [nc.Plan, nc.Flight])
def test_columns_say_which_row_is_wrong(product):
    rest = np.zeros((2, 3))
    for time_s, position_m, light, said in [
        ([0, 1], np.zeros((3, 3)), None, "3 rows.*2 rows, as time_s"),
        ([0, -1], rest, None, "time_s.*-1 after 0"),
        ([0, np.nan], rest, None, "time_s.*NaN after 0 in row 1"),
        ([0, 1], rest + [[0] * 3, [np.inf, 0, 0]], None, "x_m.*inf in row 1"),
        ([0, 1], rest, [0, 255], "255 in row 1.*from 0 to 1"),
        ([0, 1], rest, {"ring": [0, 1, 1]}, "ring.*3 rows"),
    ]:
        with pytest.raises(nc.InputError, match=said):
            product(time_s, position_m, light=light)


def test_keys_are_read_and_set_with_any_value_of_python():
    scene = nc.Scene(word="I", set={"camera.iso": np.int64(200), "vehicle.mass_kg": np.float32(0.034), "seed": np.int64(4)})
    assert scene.get("camera.iso") == 200 and scene.get("vehicle.mass_kg") == pytest.approx(0.034)
    assert scene.get("vehicle")["arm_m"] == scene.get("vehicle.arm_m") and scene.get("word") == "I"
    assert scene.get("controller.lqr.k") is None and scene.seed == 4
    anchors = [{"x": 1}, (1, 2.5, "a\"b", True)]
    assert nc._noctograph.setting(anchors) == '[{ "x" = 1 }, [1, 2.5, "a\\"b", true]]'
    steps = [{"x_m": [-1.0, 1.0], "y_m": [2.0, 3.0], "height_m": 0.2}]
    assert nc.Scene(set={"floor.steps": steps}).get("floor.steps")[0]["height_m"] == 0.2
    with pytest.raises(nc.InputError, match="no such key"):
        scene.get("camera.isoo")
    with pytest.raises(nc.InputError) as caught:
        nc.Scene(scene, set={"camera.iso": -1})
    assert caught.value.place == "camera.iso", "not a line of a text that nobody wrote"
    with pytest.raises(nc.InputError) as caught:
        nc.check(scene, set={"camera.iso": -1})
    assert "noctograph-" not in str(caught.value)


def test_what_cannot_be_meant_is_refused():
    n = 100
    time_s, still = np.arange(n) / 50, np.ones((n, 3))
    for light in (2.0, -1.0):
        with pytest.raises(nc.InputError, match="light"):
            nc.Flight(time_s, still, light=np.full(n, light))
    with pytest.raises(nc.InputError, match="milliseconds"):
        nc.Flight(1000 * time_s, still)
    with pytest.raises(nc.InputError, match="flights"):
        nc.photograph(nc.Scene(word="I"), [])


def test_ways_out_are_named():
    scene = nc.Scene(word="I", set=SMALL)
    wrong = [
        (lambda: nc.command("check", scene=scene, profile="bold"), "careful", ""),
        (lambda: nc.export(scene, "poly5d"), "poly4d", "poly4d"),
        (lambda: nc.compare("a.csv", "b.csv", part="letter"), "letters", "letters"),
        (lambda: nc.command("meter", scene=scene, target_stop=1), "", "--target-stops"),
        (lambda: nc.rank([scene]), "by name", "dict"),
        (lambda: nc.rank({"a": scene}, seeds=0), "1 to 500000", ""),
        (lambda: nc.rank({"a": scene}, {"TEA": -1}), "1 to 500000", ""),
        (lambda: nc.rank({"a": scene}, acuity=-1), "1 to 500000", ""),
        (lambda: nc.fly_many(scene, [-1]), "0 to 18446744073709551615", ""),
        (lambda: nc.tune(scene, seed=-1), "0 to 18446744073709551615", ""),
        (lambda: nc.Scene(seed=-1), "", ""),
        (lambda: nc.photograph(scene, [{"time_s": 0}]), "Flight", "nc.Flight"),
        (lambda: nc.fly(scene, controller=lambda state, reference: "hover"), "numbers", ""),
        (lambda: nc.fly(scene, controller=lambda state, reference: [1j] * 4), "numbers", ""),
        (lambda: nc.fly_many(scene, controller=lambda state, reference: "hover", progress=False), "motor commands", "m1"),
        (lambda: nc.Flight([0, 1], np.zeros((2, 3)), attitude_rad=np.zeros((2, 4))), "(N, 3)", "nc.attitude_rad"),
        (lambda: nc.attitude_rad(np.zeros((2, 4))), "none of them zero", ""),
    ]  # fmt: skip
    for call, wanted, hint in wrong:
        with pytest.raises(nc.InputError) as caught:
            call()
        assert wanted in caught.value.wanted and hint in caught.value.hint, caught.value
        assert "found unexpected argument '--target-stop' found" not in str(caught.value)


@pytest.mark.parametrize("order", ["xyzw", "wxyz"])
def test_quaternions_are_angles_in_the_order_of_a_flight(order):
    angles = np.array([[0.3, -0.2, 0.1], [3.0, 0.5, -1.0], [3.3, 0.0, 0.0]])
    half = angles / 2
    about = [(np.cos(half[:, i]), np.sin(half[:, i])) for i in range(3)]
    z, y, x = ([(c, *(s if j == axis else 0 * s for j in range(3))) for c, s in [about[i]]][0] for i, axis in enumerate([2, 1, 0]))

    def times(a, b):
        (w, v), (u, p) = (a[0], np.array(a[1:])), (b[0], np.array(b[1:]))
        return (w * u - (v * p).sum(axis=0), *(w * p + u * v + np.cross(v, p, axis=0)))

    w, *rest = times(times(z, y), x)
    quaternion = np.stack([*rest, w] if order == "xyzw" else [w, *rest], axis=1)
    assert nc.attitude_rad(-2 * quaternion, order) == pytest.approx(angles), "of any length, the angle without a jump"


def test_a_flight_of_gym_pybullet_drones_is_ours():
    observations = np.zeros((3, 20))
    observations[:, 2], observations[:, 5:7] = [1, 2, 3], [np.sin(0.1), np.cos(0.1)]
    flight = nc.from_pybullet([0, 1, 2], observations, light=[0, 1, 0])
    assert flight.position_m[:, 2].tolist() == [1, 2, 3] and flight.lights["headlights"].tolist() == [0, 1, 0]
    assert flight.attitude_rad == pytest.approx(np.tile([0.2, 0, 0], (3, 1)))
    with pytest.raises(nc.InputError, match=r"\(N, 20\)"):
        nc.from_pybullet([0, 1, 2], observations[0])


def test_a_lamp_before_the_lens_costs_the_flight_alone():
    keys = {"camera.framing.kind": "fixed", "camera.framing.position_m": [0, -0.08, 0.75], "camera.framing.target_m": [0, 1, 0.75]}
    scene = nc.Scene(word="I", set={**SMALL, **keys})
    with pytest.raises(nc.InfeasibleError, match="from lamp"):
        nc.photograph(scene)
    assert nc.fly_many(scene, 2, progress=False).lost.all()
    assert nc.fly_many(scene, 2, controller=hover_lqr(scene), vectorized=True, progress=False).lost.all()


def test_a_column_light_is_that_of_the_headlights(tmp_path):
    time_s = np.linspace(0, 6, 301)
    line = np.stack([time_s / 6 - 0.5, 0 * time_s, 1 + 0 * time_s], axis=1)
    table = nc.Flight(time_s, line, light=(time_s < 3).astype(float)).to_csv().replace("light.headlights", "light")
    (tmp_path / "flight.csv").write_text(table)
    flight = nc.Flight.read(tmp_path / "flight.csv")
    assert flight.lights["headlights"].sum() == (time_s < 3).sum() and not any("light" in it for it in flight.warnings)
    assert nc.photograph(nc.Scene(word="", set=SMALL), [flight]).film_lx_s.any()


def test_several_lamps_and_colors_are_photographed(tmp_path):
    time_s = np.linspace(0, 6, 601)
    line = np.stack([time_s / 6 - 0.5, 0 * time_s, 1 + 0 * time_s], axis=1)
    on, off = np.ones(601), np.zeros(601)
    scene = nc.Scene(word="", set={"light.ring": "memory", "plan.lights": ["ring"], **SMALL})

    def light_of(red, green):
        channels = {"ring": on, "ring.red": red, "ring.green": green, "ring.blue": off}
        return nc.photograph(scene, [nc.Flight(time_s, line, light=channels)]).film_lx_s.sum(axis=(0, 1))

    red, both = light_of(on, off), light_of(on, 0.5 * on)
    assert red[0] > 0 and red[1] == red[2] == 0, red
    assert both[1] > 0 and both[2] == 0 and both[0] == pytest.approx(red[0], rel=0.1), both
    with pytest.raises(nc.InputError, match="ring.red"):
        light_of(2 * on, off)
    flight = nc.Flight(time_s, line)
    flight.save(tmp_path / "flight.csv")
    scene = nc.Scene(word="", set=SMALL)
    assert nc.photograph(scene, [tmp_path / "flight.csv"]).film_sha256 == nc.photograph(scene, [flight]).film_sha256


def test_commands_of_the_lab_are_functions(shot):
    assert nc.read(shot.image) == "RIGA"
    scene = nc.Scene(word="I", set=SMALL)
    assert nc.meter(scene).text
    assert nc.locate(region=True, scene="two-drones-three-anchors").text
    with pytest.raises(nc.InfeasibleError):
        nc.export(nc.Scene(word="NOOR", set={"plan.stroke_speed_m_s": 5.0}), "poly4d")


def test_environments_are_those_of_gymnasium():
    pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    scene = nc.Scene("cf21", word="I")
    env = nc.Env(scene)
    check_env(env)
    import gymnasium

    made = gymnasium.make("noctograph.learning:noctograph/Write-v0", scene=scene)
    assert made.reset(seed=1)[0].shape == (18,)
    with pytest.raises(nc.InputError, match="NaN"):
        env.reset(seed=1)
        env.step(np.array([0, np.nan, 0, 0]))
    k = nc.Scene(scene, set={"controller.kind": "lqr"}).gain()[:, :12]
    hover = scene.motors_from_wrench @ [0, 0, 0, 9.81 * scene.mass_kg]

    def policy(observation):
        return np.clip(-(observation[..., :12] @ (scene.motors_from_wrench @ k).T) / hover, -1, 1)

    drones = nc.VectorEnv(scene, 3, control_hz=500)
    first, _ = drones.reset(seed=4)
    assert first.shape == (3, 18) and drones.observation_space.contains(first)
    observation, worth, over, info = first, np.zeros(3), np.zeros(3, bool), {}
    while not over.all():
        observation, reward, over, truncated, info = drones.step(policy(observation))
        worth += reward
    assert set(info["read"]) == {"I"} and (info["probability"] > 0.3).all() and not truncated.any()
    assert (worth > 0.5).all() and not observation.any(), "landed"
    # The next step begins the next episode, with other noise.
    second, reward, over, _, info = drones.step(policy(observation))
    assert second.any() and not reward.any() and not over.any() and not info
    assert (drones.reset(seed=4)[0] == first).all() and (second != first).any()
    # The drone has fallen, and the episode ends without a photo.
    for _ in range(2000):
        _, _, over, _, info = drones.step(np.tile([1, 1, 0, 0], (3, 1)))
        if over.any():
            break
    assert over.any() and not info
    with pytest.raises(nc.InputError, match="2 plans"):
        nc.VectorEnv(nc.Scene(word="NOOR", set={"plan.drones": 2}))
    with pytest.raises(nc.InputError, match=r"wanted \(3, 4\)"):
        drones.step(np.zeros((2, 4)))


def test_stable_baselines_takes_the_environment():
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO

    drones = nc.sb3_env(nc.Scene("cf21", word="I"), 2, control_hz=100)
    first = drones.reset()
    assert first.shape == (2, 18)
    for _ in range(600):
        observations, rewards, over, infos = drones.step(np.tile([1, 1, 0, 0], (2, 1)))
        if over.any():
            break
    index = int(np.flatnonzero(over)[0])
    assert infos[index]["terminal_observation"].any() and observations.shape == (2, 18) and rewards.shape == (2,)
    PPO("MlpPolicy", drones, n_steps=16, batch_size=16, n_epochs=1).learn(32)


def test_many_flights_are_those_of_the_command_line(tmp_path):
    scene = nc.Scene("cf21", word="HI", set={"controller.kind": "lqr", **SMALL})
    k = scene.gain()[:, :12]
    shown = []
    found = nc.fly_many(scene, 3, gains=[k, 0.6 * k], progress=lambda *counts: shown.append(counts))
    assert found.legible.shape == found.rmse_x_m.shape == (2, 3) and len(found.read[1]) == 3
    assert shown[-1] == (6, 6)
    (flight,) = nc.fly(nc.Scene(scene, seed=2, set={"controller.lqr.k": k.tolist()}))
    first, last = np.flatnonzero(flight.lights["headlights"])[[0, -1]]
    error_m = (flight.position_m - flight.design_m)[first:last + 1, 0]
    assert found.rmse_x_m[0, 2] > 0 and found.rmse_x_m[1].mean() != found.rmse_x_m[0].mean()
    assert found.rmse_x_m[0, 2] == pytest.approx(np.sqrt(np.mean(error_m**2)), rel=0.02)
    with pytest.raises(nc.InputError, match="controller.lqr.k") as caught:
        nc.fly_many(scene, gains=np.zeros((1, 3, 12)))
    assert "4 rows" in caught.value.wanted

    scene.save(tmp_path / "scene.toml")
    ranked = nc.rank({"scene": scene, "pid": nc.Scene("pid", set=SMALL)}, seeds=4, seed=3, progress=False)
    sets = [f"--set={key}={value}" for key, value in SMALL.items()]
    words = ["--words", "HI", "--seeds", "4", "--seed", "3", "--json", "-o", "rank"]
    printed = json.loads(program("rank", "scene.toml", "pid", *sets, *words, cwd=tmp_path))
    assert ranked["measures"] == printed["measures"] and ranked["pairs"] == printed["pairs"]
    assert len(ranked["flights"]) == 8 and "pid" in ranked.text and "<pre>" in ranked._repr_html_()


def test_a_search_tells_its_callback():
    scene = nc.Scene("pid", word="I", set=SMALL)
    calls = []
    knobs = ["plan.stroke_speed_m_s=0.2..0.5"]
    tuned, report = nc.tune(scene, seeds=2, knobs=knobs, budget=80, callback=lambda n, best: calls.append((n, best)))
    assert calls[0][0] < calls[-1][0] < report["flights"], "the finalists are flown after the search"
    assert calls[-1][1].keys() == report["best"].keys()
    assert (tuned.to_toml() != scene.to_toml()) == report["helped"], "what is no better on new seeds is not handed out"
    ended = []
    nc.tune(scene, seeds=2, knobs=knobs, budget=10_000, callback=lambda n, best: ended.append(n) or False)
    assert len(ended) < 5
    with pytest.raises(ZeroDivisionError):
        nc.tune(scene, seeds=2, knobs=knobs, budget=10_000, callback=lambda n, best: 1 / 0)
    with pytest.raises(nc.InputError, match="mass"):
        nc.tune(scene, knobs=["mass=1..2"])


def test_a_plan_and_its_scene_are_saved_as_one(tmp_path):
    scene = nc.Scene("cf21", word="HI")
    plan, path = nc.plan(scene)[0], tmp_path / "hi.csv"
    plan.save(path, scene)
    assert hashlib.sha256(path.read_bytes()).hexdigest() in (tmp_path / "hi.scene.toml").read_text()
    assert nc.Scene(str(tmp_path / "hi.scene.toml")).to_toml() == scene.to_toml()
    assert "fly" in json.loads(program("check", "hi.csv", "--json", cwd=tmp_path))
    nc.plan(nc.Scene("cf21", word="I"))[0].save(path)
    assert program("check", "hi.csv", "--json", cwd=tmp_path) == "", "another plan beside that scene"


def test_commands_are_functions(shot, tmp_path):
    scene = nc.Scene("cf21", word="HI", set={"controller.kind": "lqr"})
    scene.save(tmp_path / "scene.toml")
    assert repr(nc.gains(scene)).strip() == program("gains", "--scene", "scene.toml", cwd=tmp_path).strip()
    assert nc.check(scene)["fly"] is True
    (tmp_path / "out").mkdir()
    program("export", "--scene", "scene.toml", "--to", "poly4d", "-o", "out", cwd=tmp_path)
    files = nc.export(scene, "poly4d").files
    assert files and all((tmp_path / "out" / name).read_bytes() == data for name, data in files.items())
    flight = shot.flights[0]
    same = nc.compare(flight, flight)
    assert "error.svg" in same.files and pickle.loads(pickle.dumps(same)) == same
    held = nc.hold("step", runs=2)
    assert held.files
    with pytest.raises(nc.InputError):
        nc.export(scene, "no-such-format")
    with pytest.raises(nc.InputError, match="options"):
        nc.command("check", no_such_option=1)


@pytest.mark.parametrize("path", ["README.md", "examples/python/README.md"])
def test_the_code_of_the_readme_runs(path, tmp_path, monkeypatch):
    text = (pathlib.Path(__file__).parents[3] / path).read_text()
    time_s = np.linspace(0, 10, 501)
    circle = np.stack([np.cos(time_s), 0 * time_s, 1 + np.sin(time_s)], axis=1)
    names = {"np": np, "time_s": time_s, "position_m": circle, "on": (time_s < 7).astype(float)}
    blocks = re.findall(r"^```python$(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    for block in blocks:
        exec(block, names)
    assert blocks
    if path.startswith("examples"):
        # The results of the examples are checked, too.
        assert not names["found"].lost.any() and (names["found"].probability[0] > 0.5).any(), names["found"]
        assert names["exported"].files and not names["still"].lost.any(), names["still"]
        order = [it["contender"] for it in sorted(names["ranked"]["measures"], key=lambda it: -it["legibility"]["value"])]
        assert order == ["firmware", "lqr", "rotors forgotten"], order
        with pytest.raises(nc.InfeasibleError):
            nc.fly(names["scene"], estimator=names["Stubborn"])


def test_errors_say_what_is_wrong():
    with pytest.raises(nc.InputError) as caught:
        nc.Scene(set={"vehicle": {"mas_kg": 0.03}})
    assert "vehicle.mas_kg" in str(caught.value) and "vehicle.mass_kg" in caught.value.hint
    for arguments, place in [
        (([0, 1], np.zeros((2, 2))), "position_m"),
        (([0, 1], np.zeros((3, 3))), "position_m"),
        (([1, 0], np.zeros((2, 3))), "time_s"),
        (([0, np.nan], np.zeros((2, 3))), "time_s"),
        (([0, 1], [[0, 0, 0], [0, np.inf, 0]]), "y_m"),
    ]:
        with pytest.raises(nc.InputError) as caught:
            nc.Flight(*arguments)
        assert caught.value.place == place
    with pytest.raises(ValueError, match="wanted uint8"):
        nc.score(np.zeros((4, 4)), nc.Scene(word="A"))
    with pytest.raises(FileNotFoundError):
        nc.Flight.read("none.csv")
    with pytest.raises(nc.InfeasibleError):
        nc.plan(nc.Scene(word="NOOR" * 60, set={"plan.stroke_speed_m_s": 0.001}))
    assert pickle.loads(pickle.dumps(nc.InputError("a", "b", "c", "d"))).wanted == "c"


def test_settings_reach_the_scene(tmp_path):
    scene = nc.Scene("ae483-2022", word="HI", seed=5, set={"camera": {"iso": 200}, "plan.lights": ["headlights"], "vehicle.mass_kg": np.float64(0.035)})
    assert (scene.word, scene.seed) == ("HI", 5) and "mass_kg = 0.035" in scene.to_toml()
    scene.save(tmp_path / "scene.toml")
    assert nc.Scene(str(tmp_path / "scene.toml")).to_toml() == scene.to_toml()
    assert os.listdir(tmp_path) == ["scene.toml"]


def test_tables_are_those_of_the_files(shot, tmp_path):
    pandas = pytest.importorskip("pandas")
    shot.flights[0].save(tmp_path / "flight.csv")
    table = shot.flights[0].to_pandas()
    assert table.equals(pandas.read_csv(tmp_path / "flight.csv"))
    assert nc.Flight.read(tmp_path / "flight.csv").sha256 == shot.flights[0].sha256


def test_threads_of_python_make_the_same_bytes(shot):
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        shots = list(pool.map(lambda word: nc.preview(word, seed=3), ["RIGA", "OSLO", "RIGA"]))
    assert shots[0].film_sha256 == shots[2].film_sha256 == shot.film_sha256 != shots[1].film_sha256
    film = shot.film_lx_s
    assert film.shape == (1080, 1920, 3) and film.dtype == np.float32
    assert film[shot.image.min(axis=2) > 250].mean() > 20 * film.mean() > 0


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_forked_process_is_refused_instead_of_waiting_forever():
    code = "import multiprocessing, noctograph as nc; plan = lambda word: nc.plan(nc.Scene(word=word)); plan('I'); multiprocessing.get_context('fork').Pool(1).apply(nc.plan, (nc.Scene(word='I'),))"
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert child.returncode == 1 and "start workers by spawn" in child.stderr, child.stderr


def test_the_interpreter_is_free_meanwhile():
    ticks = []
    worker = threading.Thread(target=nc.preview, args=("MOON",))
    worker.start()
    while worker.is_alive():
        time.sleep(0.005)
        ticks.append(time.perf_counter())
    assert len(ticks) > 10 and max(np.diff(ticks)) < 0.5 * (ticks[-1] - ticks[0])


def interrupted(code, after_s):
    """Starts a child process, and sends SIGINT some time after its first line. `lasted_s` is the time from then to its end."""
    # If the tests run in the background, SIGINT is ignored, and a child process would inherit this.
    child = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    child.stdout.readline()
    time.sleep(after_s)
    child.send_signal(signal.SIGINT)
    begun = time.perf_counter()
    _, error = child.communicate(timeout=300)
    child.lasted_s = time.perf_counter() - begun
    return child, error


def test_ctrl_c_ends_a_controller_and_its_interpreter():
    code = "import noctograph as nc, itertools; f = lambda s, r, c=itertools.count(): next(c) == 20 and print(1, flush=True) or [40000] * 4; nc.fly(nc.Scene(word='NOOR' * 8), controller=lambda s, r: f(s, r) and __import__('time').sleep(0.005) or [0] * 4)"
    child, error = interrupted(code, after_s=0)
    assert b"KeyboardInterrupt" in error and child.returncode in (1, 130, -signal.SIGINT), (child.returncode, error)


def test_ctrl_c_ends_a_stage():
    code = "import noctograph as nc, sys; print(1, flush=True); nc.photograph(nc.Scene(word='LANTERNS' * 4, set={'camera.width_px': 8000, 'camera.height_px': 4500}))"
    child, error = interrupted(code, after_s=0.2)
    begun = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
    whole_s = time.perf_counter() - begun
    assert b"KeyboardInterrupt" in error and child.lasted_s < 0.5 * whole_s, (child.lasted_s, whole_s)


def test_memory_does_not_grow():
    scene = nc.Scene(word="I", set={"camera.width_px": 320, "camera.height_px": 180})

    def resident_kb():
        with open("/proc/self/status") as status:
            return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))

    for _ in range(20):
        nc.photograph(scene)
    before = resident_kb()
    for _ in range(60):
        nc.photograph(scene)
    assert resident_kb() < 1.1 * before


def test_products_are_pickled(shot):
    scene = nc.Scene(word="HI", seed=2, set={"vehicle.mass_kg": 0.034})
    plan, flight = nc.plan(scene)[0], shot.flights[0]
    assert pickle.loads(pickle.dumps(scene)).to_toml() == scene.to_toml()
    assert pickle.loads(pickle.dumps(plan)).to_csv() == plan.to_csv()
    assert pickle.loads(pickle.dumps(flight)).sha256 == flight.sha256
    again = pickle.loads(pickle.dumps(shot))
    assert again.film_sha256 == shot.film_sha256 and again.verdict == shot.verdict
    with pytest.raises(nc.InputError, match="flight"):
        nc.Flight.from_csv("no flight")


def test_notebooks_show_products(shot):
    assert "<img" in shot._repr_html_() and "reads as RIGA" in shot._repr_html_()
    assert len(shot._repr_jpeg_()) < 200_000 and len(shot._repr_html_()) < 220_000 < len(shot.to_png())
    for product in [shot.flights[0], nc.plan(shot.scene)[0]]:
        assert product._repr_svg_().startswith("<svg")


#: Variables of notebooks with their expected values.
RESULTS = {
    "7-benchmark": """
assert ranking["measures"][0]["contender"] == "firmware-pid" and ranking["measures"][3]["n_lost"] > 0
assert "turns over" in lost_because
""",
    "2-tune-an-lqr": """
assert found.legible.all() and found.probability.min() > 0.8, "with the rotors in the model"
assert nc.fly_many(small, seeds=2, controller=textbook_lqr, vectorized=True, progress=False).lost.all()
""",
    "4-write-your-own-controller": """
shots = {name: nc.photograph(scene, nc.fly(scene, controller=it)) for name, it in {"integral": WithIntegral()}.items()}
assert shots["integral"].verdict["read"] == "TEA" and shots["integral"].verdict["readability"] > 0.5, shots["integral"]
assert firmware.verdict["read"] == "TEA"
assert found.legible.mean() > 0.8 and not found.lost.any(), found
""",
}


#: Fewer flights of the same kind than a notebook shows.
FEWER = {
    "7-benchmark": [("BIRD HELLO GHOST\nKYOTO VOXEL PLANET CASTLE MUSEUM RAINBOW", "GHOST RAINBOW"), ("WORDS[:6], 2", "WORDS[:6], 1")],
    "2-tune-an-lqr": [("seeds=8, gains", "seeds=3, gains"), ("seeds=16", "seeds=6")],
    "4-write-your-own-controller": [("seeds=8", "seeds=4")],
}


def test_pages_have_every_cell_of_their_notebooks():
    pages = HERE.parent.parent.parent / "docs/notebooks"
    for path in (HERE.parent / "notebooks").glob("*.ipynb"):
        page = (pages / path.with_suffix(".md").name).read_text()
        for cell in json.loads(path.read_text())["cells"]:
            assert "".join(cell["source"]) in page, f"{path.name}: python examples/python/pages.py"
        for picture in re.findall(r"\]\((\d-[^)]+)\)", page):
            assert 0 < (pages / picture).stat().st_size <= 200_000, picture


@pytest.mark.parametrize("path", sorted((HERE.parent / "notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def test_notebooks_run(path, tmp_path):
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    for needed in ["ipykernel", "matplotlib", "scipy"]:
        pytest.importorskip(needed)
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "kept without outputs"
    for many, few in FEWER.get(path.stem, []):
        (cell,) = [cell for cell in notebook.cells if many in cell.source]
        cell.source = cell.source.replace(many, few)
    checks = RESULTS.get(path.stem)
    if checks:
        notebook.cells.append(nbformat.v4.new_code_cell(checks))
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    pictures = [key for cell in notebook.cells for output in cell.get("outputs", []) for key in output.get("data", {})]
    assert sum(key.startswith("image/") for key in pictures) >= 2
    assert not os.listdir(tmp_path), "nothing is left behind"


def test_types_are_those_of_the_program():
    stub = ast.parse((pathlib.Path(nc.__file__).parent / "_noctograph.pyi").read_text())
    for class_ in (node for node in stub.body if isinstance(node, ast.ClassDef)):
        declared = {node.name for node in class_.body if isinstance(node, ast.FunctionDef)} - {"__init__", "__new__"}
        there = set(vars(getattr(nc._noctograph, class_.name))) - {"__doc__", "__module__", "__new__", "__repr__"}
        assert declared == there, class_.name
    pytest.importorskip("mypy")
    stubtest = [sys.executable, "-m", "mypy.stubtest", "noctograph._noctograph", "--ignore-disjoint-bases"]
    found = subprocess.run(stubtest, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout + found.stderr
    functions = {node.name for node in stub.body if isinstance(node, ast.FunctionDef)}
    assert functions == {name for name, it in vars(nc._noctograph).items() if type(it).__name__ == "builtin_function_or_method"}
    pyright = pathlib.Path(sys.executable).parent / "pyright"
    if not pyright.exists():
        pytest.skip("pyright is not installed")
    found = subprocess.run([pyright, "--pythonpath", sys.executable], cwd=HERE.parent, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout


def test_every_public_name_is_documented():
    for name in nc.__all__:
        if name in ("Env", "VectorEnv", "sb3_env") and not importlib.util.find_spec("gymnasium"):
            continue
        thing = getattr(nc, name)
        if name == "__version__":
            continue
        assert thing.__doc__, name
        if callable(thing) and not issubclass(type(thing), type):
            for parameter in inspect.signature(thing).parameters:
                assert parameter in thing.__doc__, f"{name}: {parameter}"
        for part in vars(thing) if isinstance(thing, type) and thing.__module__ == "noctograph" else []:
            if not part.startswith("_"):
                doc = getattr(thing, part).__doc__
                assert doc, f"{name}.{part}"
                assert "shape (" in " ".join(doc.split()) or not doc.startswith("numpy.ndarray"), f"{name}.{part}"
