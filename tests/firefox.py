"""Drives Firefox for the tests of the pages by its Marionette protocol, which sends JSON with a length prefix.

The system's Firefox supports this protocol without a driver, whereas playwright drives only its own Firefox."""

import json
import shutil
import socket
import subprocess
import tempfile
import time
from pathlib import Path

from browser import cpu_of_family_s

MAC = "/Applications/Firefox.app/Contents/MacOS/firefox"
# Path of the program, or None if it is not installed.
FIREFOX = next(filter(None, map(shutil.which, ("firefox-esr", "firefox", MAC))), None)
# Errors of the page's scripts, policies and requests in the browser's console.
FAULTS = "return Services.console.getMessageArray().filter(it => it instanceof Ci.nsIScriptError && !(it.flags & it.warningFlag)).map(it => `${it.sourceName}: ${it.errorMessage}`)"


class Firefox:
    """A Firefox with one page, in English, with a separate profile."""

    def __init__(self, patience_s):
        self.patience_s = patience_s
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        folder = Path(self.profile.name)
        (folder / "user.js").write_text('user_pref("marionette.port", 0);\nuser_pref("intl.accept_languages", "en-US");\n')
        command = [FIREFOX, "--headless", "--marionette", "--no-remote", "--remote-allow-system-access", "--profile", folder]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        port = folder / "MarionetteActivePort"
        end = time.monotonic() + patience_s
        while not port.exists() or not port.read_text():
            assert self.process.poll() is None and time.monotonic() < end, "Firefox does not begin"
            time.sleep(0.1)
        self.link = socket.create_connection(("127.0.0.1", int(port.read_text())), timeout=patience_s)
        self._read()
        self._say("WebDriver:NewSession", capabilities={})

    def _read(self):
        length = b""
        while not length.endswith(b":"):
            length += self.link.recv(1)
        answer = b""
        while len(answer) < int(length[:-1]):
            answer += self.link.recv(int(length[:-1]) - len(answer))
        return json.loads(answer)

    def _say(self, command, **parameters):
        message = json.dumps([0, 1, command, parameters]).encode()
        self.link.sendall(f"{len(message)}:".encode() + message)
        _, _, error, value = self._read()
        assert not error, error
        return value

    def open(self, url):
        self._say("WebDriver:Navigate", url=url)

    def until(self, expression, what, n_jobs=1):
        """Waits for an expression of the page to be true, which takes `n_jobs` jobs, and returns its value."""
        end = time.monotonic() + n_jobs * self.patience_s
        while not (value := self._say("WebDriver:ExecuteScript", script=f"return {expression}", args=[])["value"]):
            assert time.monotonic() < end, f"not within {self.patience_s} s in Firefox: {what}"
            time.sleep(0.1)
        return value

    def faults(self, url):
        """Returns the console messages about the pages of an address."""
        self._say("Marionette:SetContext", value="chrome")
        told = self._say("WebDriver:ExecuteScript", script=FAULTS, args=[])["value"]
        self._say("Marionette:SetContext", value="content")
        return [fault for fault in told if fault.startswith(url)]

    def cpu_s(self):
        """Returns the processor time of all processes of the browser."""
        return cpu_of_family_s(self.process)

    def end(self):
        self.process.kill()
        self.process.wait()
        self.profile.cleanup()
