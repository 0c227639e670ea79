#!/usr/bin/env python3
"""Flies several drones that write one word together, each with a script that noctograph exported.

    python3 LAUNCHER --dry-run
    python3 LAUNCHER radio://0/80/2M/E7E7E7E701 radio://0/80/2M/E7E7E7E702

One radio serves up to four drones. Each drone is checked by its script, and all take off after one press
of Enter. Ctrl-C lands all drones, and they also land if one of them ends its flight early. A second
Ctrl-C, at least half a second after the first, stops their motors.
"""

import argparse
import contextlib
import importlib.util
import os
import threading
import time

SCRIPTS = @SCRIPTS@


def load(name):
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), name)
    spec = importlib.util.spec_from_file_location(os.path.splitext(name)[0], path)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


def together(work, crew):
    """Does work for every drone, each in a thread. Raises what went wrong, causes first."""
    errors = []

    def guarded(script, drone, choice):
        try:
            work(script, drone, choice)
        except BaseException as error:
            errors.append(f"{drone.about['uri']}: {error or repr(error)}")

    threads = [threading.Thread(target=guarded, args=part) for part in crew]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        time.sleep(0.05)
    if errors:
        errors.sort(key=lambda text: "another drone" in text)
        raise SystemExit("error: " + "\n".join(errors))


def fly_all(crew, args):
    """From the checks to the floor, each drone in a thread of its own."""
    script, drones = crew[0][0], [drone for _, drone, _ in crew]

    def prepare(script, drone, choice):
        script.prepare(drone, *choice, args.set_gains, args.accept)

    def fly(script, drone, choice):
        def start():
            try:
                barrier.wait()
            except threading.BrokenBarrierError:
                raise script.Stopped("another drone did not start") from None

        def ended():
            barrier.abort()  # nobody waits for one that does not start
            for other in drones:
                if not other.stopped.is_set():
                    other.why = "another drone ended early"
                    other.stopped.set()

        script.fly(drone, *choice, begin=start, ended=ended)

    together(prepare, crew)
    barrier = threading.Barrier(len(crew), timeout=20.0)
    print(script.room())
    input(f"Is this correct, and are {len(crew)} drones ready? Press Enter to take off, or Ctrl-C to exit. ")
    for part, drone, _ in crew:
        part.still_ready(drone, args.accept)
    with script.landing_on_signals(drones):
        together(fly, crew)
    with contextlib.suppress(EOFError, OSError):
        input("Landed. Close the shutter, and press Enter to restore the lamps. ")


def main():
    scripts = [load(name) for name in SCRIPTS]
    parser = argparse.ArgumentParser(description="Writes a word with several drones.")
    parser.add_argument("uris", nargs="*", default=[script.DATA["uri"] for script in scripts],
                        help="addresses, in the order of the scripts (default: %(default)s)")
    scripts[0].options(parser)
    args = parser.parse_args()
    if len(args.uris) != len(scripts):
        parser.error(f"{len(scripts)} addresses are required")
    chosen = [script.settings(args, parser) for script in scripts]
    if args.dry_run:
        for script, name, (mode, controller) in zip(scripts, SCRIPTS, chosen):
            print(f"# {name}")
            script.prepare(script.Paper(), mode, controller)
            script.fly(script.Paper(), mode, controller, 1.0)
        return
    scripts[0].need_cflib()
    import cflib.crtp

    cflib.crtp.init_drivers()
    crew = []
    try:
        with contextlib.ExitStack() as links:
            for script, uri, choice in zip(scripts, args.uris, chosen):
                def connect(wait=True, script=script, uri=uri):
                    return script.opened(links, uri, wait)

                drone = script.Drone(connect(), script.DATA["log"], connect)
                drone.about["uri"] = uri
                script.say = lambda text, uri=uri, say=script.say: say(f"{uri}: {text}")
                crew.append((script, drone, choice))
            try:
                fly_all(crew, args)
            finally:
                for _, drone, _ in crew:
                    drone.put_back(lamps=False)
                    drone.put_back(lamps=True)
    except KeyboardInterrupt:
        raise SystemExit("stopped by Ctrl-C") from None
    except EOFError:
        raise SystemExit("error: keys cannot be pressed here: start the script in a terminal") from None
    except SystemExit:
        raise
    except Exception as error:
        raise SystemExit(f"error: {error}") from None


if __name__ == "__main__":
    main()
