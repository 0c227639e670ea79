"""Drives WebKitGTK for the tests of the pages by the driver of Debian's package webkit2gtk-driver.

The browser is the one that comes with the driver. It needs a display, which Xvfb provides."""

import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.error
import urllib.request
from pathlib import Path

from browser import cpu_of_family_s

DRIVER, SCREEN = map(shutil.which, ("WebKitWebDriver", "Xvfb"))
# Path of the browser, or None if a part is not installed.
WEBKIT = next(Path("/usr").glob("lib*/**/webkit2gtk-4.*/MiniBrowser"), None) if DRIVER and SCREEN else None
# Script that collects the errors of a page, to be loaded before its own scripts.
WATCH = """const faults = [];
    for (const kind of ["error", "unhandledrejection", "securitypolicyviolation"])
        addEventListener(kind, (event) => faults.push(`${kind}: ${event.message ?? event.reason ?? event.violatedDirective ?? event.target.src}`), true);
    console.error = console.warn = (...said) => faults.push(said.join(" "));
"""


class WebKit:
    """A WebKitGTK with one page, in English, with a separate profile."""

    def __init__(self, patience_s):
        self.patience_s = patience_s
        self.folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        shown, number = os.pipe()
        self.screen = subprocess.Popen([SCREEN, "-displayfd", str(number), "-screen", "0", "1600x1000x24"], pass_fds=[number], stderr=subprocess.DEVNULL)
        os.close(number)
        with os.fdopen(shown) as shown, socket.create_server(("127.0.0.1", 0)) as free:
            display, port = shown.readline().strip(), free.getsockname()[1]
        private = {name: self.folder.name for name in ("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME")}
        environment = {**os.environ, **private, "DISPLAY": f":{display}", "LC_ALL": "C.UTF-8", "LANGUAGE": "en"}
        self.driver = subprocess.Popen([DRIVER, f"--port={port}"], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.session = f"http://127.0.0.1:{port}/session"
        end = time.monotonic() + patience_s
        while socket.socket().connect_ex(("127.0.0.1", port)):
            assert self.driver.poll() is None and time.monotonic() < end, "WebKit does not begin"
            time.sleep(0.1)
        options = {"binary": str(WEBKIT), "args": ["--automation"]}
        limits = {"script": 1000 * patience_s, "pageLoad": 1000 * patience_s}
        begun = self._say("", capabilities={"alwaysMatch": {"webkitgtk:browserOptions": options, "timeouts": limits}})
        self.session += f"/{begun['sessionId']}"

    def _say(self, route, **parameters):
        request = urllib.request.Request(self.session + route, json.dumps(parameters).encode(), {"Content-Type": "application/json"})
        try:
            with urllib.request.urlopen(request, timeout=self.patience_s) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as refusal:
            raise AssertionError(refusal.read().decode()) from None

    def open(self, url):
        self._say("/url", url=url)

    def until(self, expression, what, n_jobs=1):
        """Waits for an expression of the page to be true, which takes `n_jobs` jobs, and returns its value."""
        end = time.monotonic() + n_jobs * self.patience_s
        while not (value := self._say("/execute/sync", script=f"return {expression}", args=[])):
            assert time.monotonic() < end, f"not within {n_jobs * self.patience_s} s in WebKit: {what}"
            time.sleep(0.1)
        return value

    def faults(self, _url):
        """Returns the errors that the page collected by `WATCH`, because this driver does not give the console."""
        return self._say("/execute/sync", script="return faults", args=[])

    def cpu_s(self):
        """Returns the processor time of all processes of the browser."""
        return cpu_of_family_s(self.driver)

    def end(self):
        for process in (self.driver, self.screen):
            process.terminate()
            process.wait()
        self.folder.cleanup()
