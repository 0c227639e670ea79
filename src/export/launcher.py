#!/usr/bin/env python3
"""Flies several drones that write one word together: one script of noctograph for each.

    python3 LAUNCHER --dry-run
    python3 LAUNCHER radio://0/80/2M/E7E7E7E701 radio://0/80/2M/E7E7E7E702

One radio serves up to four drones. All wait for one Enter. Ctrl-C lands all of them, and so does
the end of one of them before its time.
"""

import argparse
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


def together(work, items):
    """Runs work for every item in a thread of its own; returns the threads and what went wrong."""
    errors = []

    def guarded(item):
        try:
            work(item)
        except Exception as error:
            errors.append(error)

    threads = [threading.Thread(target=guarded, args=(item,)) for item in items]
    for thread in threads:
        thread.start()
    return threads, errors


def main():
    scripts = [load(name) for name in SCRIPTS]
    parser = argparse.ArgumentParser(description="Writes a word with several drones.")
    parser.add_argument("uris", nargs="*", default=[script.DATA["uri"] for script in scripts],
                        help="addresses, in the order of the scripts (default: %(default)s)")
    scripts[0].options(parser)
    args = parser.parse_args()
    if len(args.uris) != len(scripts):
        parser.error(f"{len(scripts)} addresses are wanted")
    chosen = [script.settings(args, parser) for script in scripts]
    if args.dry_run:
        for script, name, (mode, controller, clock) in zip(scripts, SCRIPTS, chosen):
            print(f"# {name}")
            script.prepare(script.Paper(), mode)
            script.fly(script.Paper(), mode, controller, clock)
        return
    import contextlib

    import cflib.crtp
    from cflib.crazyflie import Crazyflie
    from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

    cflib.crtp.init_drivers()
    with contextlib.ExitStack() as links:
        crew = []
        for script, uri, choice in zip(scripts, args.uris, chosen):
            link = links.enter_context(SyncCrazyflie(uri, cf=Crazyflie(rw_cache="./cache")))
            link.wait_for_params()
            crew.append((script, script.Drone(link.cf, script.DATA["log"]), choice))
        threads, errors = together(lambda c: c[0].prepare(c[1], c[2][0]), crew)
        for thread in threads:
            thread.join()
        if errors:
            raise SystemExit(f"error: {errors[0]}")
        input(f"{len(crew)} drones are ready. Enter takes off, Ctrl-C ends. ")
        barrier = threading.Barrier(len(crew), timeout=10.0)
        threads, errors = together(lambda c: c[0].fly(c[1], *c[2], begin=barrier.wait), crew)
        reason = None
        while any(thread.is_alive() for thread in threads):
            try:
                time.sleep(0.05)
                reason = reason or (f"error: {errors[0]}" if errors else None)
                if reason:
                    for _, drone, _ in crew:
                        drone.stopped.set()
            except KeyboardInterrupt:
                if reason:
                    for _, drone, _ in crew:
                        drone.stop()
                reason = reason or "stopped by Ctrl-C"
        if reason or errors:
            raise SystemExit(reason or f"error: {errors[0]}")


if __name__ == "__main__":
    main()
