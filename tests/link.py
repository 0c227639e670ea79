"""Connects the double of drone.py to cflib's own link, packet by packet and in real time, see tests/export.

No part of cflib is replaced: it fetches the tables of contents, parameters and logs by its own protocol, and
the exported script's `main` runs unchanged.
"""

import contextlib
import glob
import importlib.util
import io
import json
import os
import queue
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from zlib import crc32

import cflib.crtp
from cflib.crazyflie.mem import MemoryElement
from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.crtpstack import CRTPPacket
from cflib.crtp.exceptions import WrongUriType

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from drone import CFLIB, LOGS, PARAMS, Radio  # noqa: E402

WORK = sys.argv[1]
FLOAT, UINT32 = 0x06, 0x0A  # types of parameters
LINK, VERSION, PARAM, MEMORY, LOG = 15, 13, 2, 4, 5
WIDE = [f"cpu.id{k}" for k in range(3)]


class RealClock:
    """Real time, or time at double speed, for the script and the drone but not for cflib."""

    def __init__(self, rate=1.0):
        self.rate = rate

    @property
    def now_s(self):
        return self.rate * time.monotonic()

    def monotonic(self):
        return self.now_s

    def sleep(self, s):
        time.sleep(s / self.rate)

    def after(self, s, action):
        threading.Timer(s / self.rate, action).start()


class FakeLink(CRTPDriver):
    """Answers cflib like firmware with protocol 12."""

    radio, opened = None, []

    def connect(self, uri, statistics, link_error):
        if not uri.startswith("fake://"):
            raise WrongUriType()
        self.uri, self.answers, self.open = uri, queue.Queue(), True
        self.params, self.logs, self.blocks = sorted(PARAMS), sorted(LOGS), {}
        self.dead, self.link_error = False, link_error
        self.opened.append(self)
        threading.Thread(target=self.log_rows, daemon=True).start()

    def get_name(self):
        return "fake"

    def scan_interface(self, address=None):
        return []

    def close(self):
        self.open = False

    def die(self, notice_s):
        """Interrupts both directions, which the driver detects later."""
        self.dead = True
        self.radio.clock.after(notice_s, lambda: self.open and self.link_error("Too many packets lost"))

    def receive_packet(self, wait=0):
        try:
            return self.answers.get(wait != 0, None if wait < 0 else wait)
        except queue.Empty:
            return None

    def answer(self, port, channel, data):
        packet = CRTPPacket()
        packet.set_header(port, channel)
        packet.data = bytearray(data)
        if not self.dead:
            self.answers.put(packet)

    def send_packet(self, packet):
        port, channel, data = packet.port, packet.channel, bytes(packet.data)
        if self.dead or not self.open:
            return True
        if port == LINK and channel == 1:
            self.answer(port, channel, b"Bitcraze Crazyflie\0")
        elif port == VERSION and channel == 1:
            texts = {0: b"\x0c\0\0\0", 1: self.radio.firmware.encode(),
                     2: self.radio.platform_name.encode()}
            self.answer(port, channel, data[:1] + texts[data[0]])
        elif port in (PARAM, LOG) and channel == 0:
            self.contents(port, data)
        elif port == PARAM:
            self.parameter(channel, data)
        elif port == LOG:
            self.block(data)
        elif port == MEMORY:
            self.memory(channel, data)
        elif port in (3, 7, 8):
            self.radio.send_packet(packet)
        return True

    def memory(self, channel, data):
        """The memory of trajectories (crtp_mem.c)."""
        if channel == 2:
            place = struct.unpack_from("<I", data, 1)[0]
            upload = bytearray(self.radio.upload or bytes(4096))
            upload[place:place + len(data) - 5] = data[5:]
            self.radio.upload = bytes(upload)
            self.answer(MEMORY, channel, data[:5] + b"\0")
        elif data[0] == 1:
            self.answer(MEMORY, channel, bytes([1, 1]))
        else:
            self.answer(MEMORY, channel, data[:2] + struct.pack("<BI8s", MemoryElement.TYPE_TRAJ, 4096, bytes(8)))

    def contents(self, port, data):
        names = self.params if port == PARAM else self.logs
        if data[0] == 3:
            answer = struct.pack("<BHI", 3, len(names), crc32(repr(names).encode()))
        else:
            number = struct.unpack_from("<H", data, 1)[0]
            kind = (UINT32 if names[number] in WIDE else FLOAT) if port == PARAM else 7
            answer = data[:3] + bytes([kind]) + names[number].replace(".", "\0").encode() + b"\0"
        self.answer(port, 0, answer)

    def parameter(self, channel, data):
        name = self.params[struct.unpack_from("<H", data)[0]]
        form = "<I" if name in WIDE else "<f"
        if channel == 2:
            self.radio.params.append((time.monotonic(), name, struct.unpack_from(form, data, 2)[0]))
            self.radio.memory_of_params[name] = self.radio.params[-1][2]
            self.answer(PARAM, 2, data)
        else:
            value = self.radio.memory_of_params[name]
            value = struct.pack(form, int(value) if form == "<I" else value)
            self.answer(PARAM, 1, data[:2] + b"\0" + value)

    def block(self, data):
        command, number = data[0], data[1] if len(data) > 1 else 0
        if command == 6:
            kinds = struct.iter_unpack("<BH", data[2:])
            self.blocks[number] = [None, 0.0, [(kind & 15, self.logs[of]) for kind, of in kinds]]
        elif command == 7:
            kinds = struct.iter_unpack("<BH", data[2:])
            self.blocks[number][2] += [(kind & 15, self.logs[of]) for kind, of in kinds]
        elif command == 3:
            self.blocks[number][0] = data[2] / 100
        elif command == 4:
            self.blocks[number][0] = None
        elif command == 5:
            self.blocks.clear()
        self.answer(LOG, 1, bytes([command, number, 0]))

    def log_rows(self):
        forms = {2: "<H", 7: "<f"}
        while self.open:
            time.sleep(0.005)
            now_s = self.radio.clock.now_s
            for number, block in list(self.blocks.items()):
                if block[0] and now_s >= block[1]:
                    block[1] = now_s + block[0]
                    stamp = struct.pack("<I", int(1000 * now_s) & 0xFFFFFF)[:3]
                    values = [(kind, self.radio.read(name)) for kind, name in block[2]]
                    packed = b"".join(struct.pack(forms[kind], int(value) if kind == 2 else value)
                                      for kind, value in values)
                    self.answer(LOG, 2, bytes([number]) + stamp + packed)


class WholeScript(unittest.TestCase):
    def flown(self, name, rate=1.0, watch=lambda: None, prepare=lambda script: None):
        """Runs a script's main. Returns the radio, the output, and the questions that it asked."""
        spec = importlib.util.spec_from_file_location("I", os.path.join(WORK, name))
        script = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(script)
        clock, prompts = RealClock(rate), []
        radio = FakeLink.radio = Radio(clock, place=script.DATA["start_m"], gains=script.DATA["gains"])
        cflib.crtp.init_drivers = lambda: None
        cflib.crtp.CLASSES[:] = [FakeLink]
        FakeLink.opened.clear()
        script.time = clock
        prepare(script)

        def pressed(prompt):
            prompts.append(prompt)
            threading.Thread(target=watch, daemon=True).start()
            return ""

        script.input = pressed
        if watch.__name__ == "<lambda>":
            # This test runs in real time, so that a machine that stalls for a second must not look
            # like a silent drone.
            script.SILENT_S = 10.0
        folder = tempfile.mkdtemp(dir=WORK)
        os.chdir(folder)
        sys.argv = [name, "--uri", "fake://0", "--log", os.path.join(folder, "flight.json")]
        printed, ended = io.StringIO(), ""
        with contextlib.redirect_stdout(printed):
            try:
                script.main()
            except SystemExit as error:
                ended = str(error)
        radio.body.move()
        return script, radio, printed.getvalue() + ended, prompts

    def test_a_word_is_flown_through_cflib_itself(self):
        script, radio, said, prompts = self.flown("I.py")
        self.assertEqual(radio.body.outcome(), "landed", said)
        self.assertEqual(len(prompts), 2, said)
        gains = {name for name, _ in script.DATA["gains"]}
        self.assertEqual({name for _, name, _ in radio.params} & gains, set())
        self.assertEqual(radio.changed() - {"kalman.resetEstimation", "ring.headlightEnable"}, set())
        with open("flight.json", encoding="utf-8") as file:
            log = json.load(file)
        self.assertEqual(log["noctograph"]["platform"], "Crazyflie 2.1")
        self.assertEqual(log["noctograph"]["serial"][:8], "1a2b3c4d")
        self.assertGreater(len(log["stateEstimate.z"]["data"]), 100)
        self.assertIn(1.0, log["light.headlights"]["data"])
        print(f"cflib {'.'.join(map(str, CFLIB))}: flown through its own link")

    def test_a_trajectory_is_uploaded_and_landed_over_a_new_link(self):
        def dies_at_half_a_meter():
            body, link = FakeLink.radio.body, FakeLink.opened[0]
            while body.at[2] < 0.5:
                time.sleep(0.01)
            link.die(1.5)

        script, radio, said, prompts = self.flown("I_trajectory.py", 2.0, dies_at_half_a_meter)
        self.assertIn("reconnected to the drone, which lands", said)
        self.assertEqual((radio.body.outcome(), radio.body.cut_by), ("landed", "the end of a landing"), said)
        self.assertEqual((len(FakeLink.opened), len(prompts)), (2, 1))
        self.assertTrue(radio.upload.startswith(bytes.fromhex(script.DATA["trajectory"]["hex"])[8:20], 8))


def fly_and_tell():
    """Flies a script, and prints the folder of its log and the time of each sample when it arrives."""
    def prepare(script):
        row = script.Drone._row

        def told(drone, stamp_ms, *rest):
            row(drone, stamp_ms, *rest)
            os.write(1, f"{stamp_ms}\n".encode())

        script.Drone._row = told

    tempfile.tempdir = WORK
    os.write(1, f"{WORK}\n".encode())
    WholeScript().flown("../I.py", prepare=prepare)


class Killed(unittest.TestCase):
    """Kills scripts with `kill -9` at NOCTOGRAPH_KILLS moments of the flight."""

    def killed(self, after_s):
        """Returns the folder of the log, and the times of the samples that the script received before it was
        killed."""
        folder = tempfile.mkdtemp(dir=WORK)
        program = [sys.executable, "-W", "ignore", os.path.abspath(__file__), folder, "--fly"]
        with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as run:
            run.stdout.readline()
            first = run.stdout.readline()
            threading.Timer(after_s, run.kill).start()
            told = [first, *run.stdout.read().splitlines(keepends=True)]
        return folder, [int(line) for line in told if line.endswith("\n")]

    def judge(self, after_s, wrong):
        try:
            folder, told_ms = self.killed(after_s)
            [path] = glob.glob(os.path.join(folder, "*", "flight.jsonl"))
            self.assertEqual(glob.glob(os.path.join(folder, "*", "flight.json")), [])
            with open(path, encoding="utf-8") as file:
                head, *rows = [json.loads(line) for line in file if line.endswith("\n")]
            self.assertEqual(head["noctograph"]["word"], "I")
            lost_ms = told_ms[-1] - (rows[-1]["time"] if rows else told_ms[0])
            LOST_MS.append(lost_ms)
            self.assertLessEqual(lost_ms, 1000)
            if after_s > 2.0:
                program = [os.environ["NOCTOGRAPH"], "import", path, "-o", os.path.join(folder, "flight.csv")]
                run = subprocess.run(program, capture_output=True, text=True, check=False)
                self.assertEqual(run.returncode, 0, run.stderr)
                self.assertIn("ends early", " ".join(run.stderr.split()))
        except Exception as error:
            wrong.append(f"killed after {after_s:.2f} s: {error!r}")

    def test_a_killed_script_leaves_its_log_up_to_the_last_second(self):
        n, wrong = int(os.environ.get("NOCTOGRAPH_KILLS", "3")), []
        for begin in range(0, n, 5):
            judges = [threading.Thread(target=self.judge, args=(0.3 + 10.2 * k / n, wrong))
                      for k in range(begin, min(begin + 5, n))]
            for judge in judges:
                judge.start()
            for judge in judges:
                judge.join()
        self.assertEqual(wrong, [])
        print(f"{n} scripts killed in flight: the last {min(LOST_MS)} to {max(LOST_MS)} ms of samples lost")


LOST_MS = []

if __name__ == "__main__":
    if "--fly" in sys.argv:
        fly_and_tell()
    else:
        unittest.main(argv=["link"])
