"""The body of drone.py behind a link of cflib, packet by packet and in real time: see tests/export.

Nothing of cflib is replaced here: it fetches the tables of contents, parameters and logs by its own
protocol, and the exported script's `main` runs as it is.
"""

import contextlib
import importlib.util
import io
import json
import os
import queue
import struct
import sys
import tempfile
import threading
import time
import unittest
from zlib import crc32

import cflib.crtp
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
    """Time as it is."""

    @property
    def now_s(self):
        return time.monotonic()

    def after(self, s, action):
        threading.Timer(s, action).start()


class FakeLink(CRTPDriver):
    """Answers cflib as the firmware does, of protocol 12."""

    radio = None

    def connect(self, uri, statistics, link_error):
        if not uri.startswith("fake://"):
            raise WrongUriType()
        self.uri, self.answers, self.open = uri, queue.Queue(), True
        self.params, self.logs, self.blocks = sorted(PARAMS), sorted(LOGS), {}
        self.radio.clock = self.radio.body.clock = RealClock()
        threading.Thread(target=self.log_rows, daemon=True).start()

    def get_name(self):
        return "fake"

    def scan_interface(self, address=None):
        return []

    def close(self):
        self.open = False

    def receive_packet(self, wait=0):
        try:
            return self.answers.get(wait != 0, None if wait < 0 else wait)
        except queue.Empty:
            return None

    def answer(self, port, channel, data):
        packet = CRTPPacket()
        packet.set_header(port, channel)
        packet.data = bytearray(data)
        self.answers.put(packet)

    def send_packet(self, packet):
        port, channel, data = packet.port, packet.channel, bytes(packet.data)
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
        elif port == MEMORY and channel == 0:
            self.answer(port, channel, bytes([data[0], 0]))
        elif port in (7, 8):
            self.radio.send_packet(packet)
        return True

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
            time.sleep(0.01)
            now_s = time.monotonic()
            for number, block in list(self.blocks.items()):
                if block[0] and now_s >= block[1]:
                    block[1] = now_s + block[0]
                    stamp = struct.pack("<I", int(1000 * now_s) & 0xFFFFFF)[:3]
                    values = [(kind, self.radio.read(name)) for kind, name in block[2]]
                    packed = b"".join(struct.pack(forms[kind], int(value) if kind == 2 else value)
                                      for kind, value in values)
                    self.answer(LOG, 2, bytes([number]) + stamp + packed)


class WholeScript(unittest.TestCase):
    def test_a_word_is_flown_through_cflib_itself(self):
        path = os.path.join(WORK, "I.py")
        spec = importlib.util.spec_from_file_location("I", path)
        script = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(script)
        # In real time here: a machine that stalls for a second is no drone that falls silent.
        script.SILENT_S = 10.0
        folder, prompts = tempfile.mkdtemp(dir=WORK), []
        radio = FakeLink.radio = Radio(RealClock(), place=script.DATA["start_m"],
                                       gains=script.DATA["gains"])
        cflib.crtp.init_drivers = lambda: None
        cflib.crtp.CLASSES[:] = [FakeLink]
        script.input = lambda prompt: prompts.append(prompt) or ""
        os.chdir(folder)
        sys.argv = ["I.py", "--uri", "fake://0", "--log", os.path.join(folder, "flight.json")]
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            try:
                script.main()
            except SystemExit as ended:
                self.fail(f"{ended}\n{printed.getvalue()}")
        self.assertEqual(radio.body.outcome(), "landed", printed.getvalue())
        self.assertEqual(len(prompts), 2)
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


if __name__ == "__main__":
    unittest.main(argv=["link"])
