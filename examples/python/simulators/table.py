"""Prints the table of docs/model.md on flights of other simulators, and of their controllers in Noctograph.

`python examples/python/simulators/table.py [cf2.xml]`; a simulator that is not installed has no row.
"""

import contextlib
import importlib.metadata
import os
import pathlib
import runpy
import sys
import tempfile

import controllers
import noctograph as nc

#: Motors that are faster than those of `cf21`.
FAST = {"vehicle.motor_rise_s": 0.05, "vehicle.motor_fall_s": 0.05}
#: Simulators, each with its package, its example, its controller and the settings of the scene.
ROWS = {
    "RotorPy": ("rotorpy", "rotorpy_flight.py", "RotorPy", {}),
    "crazyflow": ("crazyflow", "crazyflow_flight.py", "Crazyflow", {}),
    # The controller does not model the lag of the motors, and turns over with the 0.14 s of `cf21`. udaan's gains oscillate with it.
    "gym-pybullet-drones": ("gym_pybullet_drones", "pybullet_flight.py", "Pybullet", FAST),
    "Menagerie's cf2 in MuJoCo": ("mujoco", "mujoco_flight.py", None, {}),
    # Controllers whose simulators have no Crazyflie.
    "udaan, its geometric controller": ("udaan", None, "Udaan", FAST),
    "RAPTOR, a trained policy": ("foundation_policy", None, "Raptor", {}),
}  # fmt: skip
STILL = {"observer.kind": "truth", "air.gusts": "none", "plan.reference": "design", "plan.light_clock": "setpoint"}


def figures(shot, flight):
    """Returns P(read), the lag, and the mean and largest contour error over the letters."""
    tracking = nc.compare(flight, flight, part="letters")["a"]["tracking"]
    contour = tracking["contour"]
    read = f"{shot.verdict['read']} {shot.verdict['readability']:.3f}"
    return f"{read} | {round(tracking['lag_s'], 2) + 0.0:.2f} s | {1000 * contour['mean_m']:.1f} / {1000 * contour['max_m']:.0f} mm"


def main():
    print("| simulator | reads as, P | lag | contour error, mean / largest | the same controller in Noctograph: P | lag | contour error |")
    print("|---|---|---|---|---|---|---|")
    here = pathlib.Path(__file__).parent
    for name, (package, example, controller, keys) in ROWS.items():
        models = sys.argv[1:] if controller is None else []
        try:
            version = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            version = None
        if version is None or (controller is None and not models):
            print(f"skipped: {name}", file=sys.stderr)
            continue
        theirs = ours = "– | – | –"
        if example is not None:
            with tempfile.TemporaryDirectory() as folder:
                typed, sys.argv = sys.argv, [example, "NOOR", os.path.join(folder, "noor.png"), *models]
                with contextlib.redirect_stdout(sys.stderr):
                    made = runpy.run_path(str(here / example))
                sys.argv = typed
            theirs = figures(made["shot"], made["flight"])
        if controller is not None:
            scene = nc.Scene("cf21", word="NOOR", set={**STILL, **keys})
            (own,) = nc.fly(scene, controller=getattr(controllers, controller)(scene))
            # Only lit samples are compared, as in the other simulators.
            flight = nc.Flight(own.time_s, own.position_m, light=own.lights, design_m=own.design_m)
            ours = figures(nc.photograph(scene, own), flight)
        print(f"| {name} {version} | {theirs} | {ours} |", flush=True)


if __name__ == "__main__":
    main()
