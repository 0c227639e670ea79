"""Common parts of the browser tests: a server, a page that reports all errors, and waiting.

`until` polls, because the page forbids `eval`, which playwright's wait_for_function needs."""

import itertools
import os
import subprocess
import time
from pathlib import Path

from playwright.sync_api import Error, sync_playwright

PAGES = Path(__file__).resolve().parent.parent / "src/serve/page"
CHROMIUM = os.environ.get("NOCTOGRAPH_CHROMIUM", "/usr/bin/chromium")  # tests/chromium
# Time after which a wait counts as endless, even on a busy machine.
PATIENCE_S = 300
PHONE, TABLET, DESK, WALL = [{"width": w, "height": h} for w, h in [(390, 844), (768, 1024), (1440, 900), (3840, 2160)]]


class Server:
    """A server of the program, with the addresses that it prints."""

    def __init__(self, program, *flags):
        self.process = subprocess.Popen([program, "serve", *flags], stdout=subprocess.PIPE, text=True)
        words = {}
        while "Ctrl-C" not in (line := self.process.stdout.readline()):
            assert line, f"the server ended: {self.process.poll()}"
            name, _, address = line.strip().partition(" ")
            words[name] = address.strip()
        self.page, self.operator, self.network = words["page"], words["operator"], words.get("network")
        self.host = self.page.split("/k/")[0]

    def kill(self):
        self.process.kill()
        self.process.wait()


def processes(server):
    """Returns the fields after the name in /proc, for the server and each of its workers."""
    known = {process.name: fields for process in Path("/proc").glob("[0-9]*") if (fields := stat(process))}
    own = str(server.process.pid)
    return {name: fields for name, fields in known.items() if name == own or fields[1] == own}


def cpu_s(server):
    """Returns the processor time of the server and its workers."""
    return sum(int(it[11]) + int(it[12]) for it in processes(server).values()) / os.sysconf("SC_CLK_TCK")


def cpu_of_family_s(process):
    """Returns the processor time of a process and all processes that it started."""
    known = {other.name: fields for other in Path("/proc").glob("[0-9]*") if (fields := stat(other))}
    family = {str(process.pid)}
    while more := {name for name, fields in known.items() if fields[1] in family} - family:
        family |= more
    return sum(int(known[name][n]) for name in family & known.keys() for n in (11, 12)) / os.sysconf("SC_CLK_TCK")


def stat(process):
    try:
        return (process / "stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return None


EXPECTED = ("Failed to load resource", "Service Worker registration blocked by Playwright")


def opened(browser, url, **options):
    """Opens a page, and returns it with its errors and foreign requests. Tests that hold or answer requests block the
    service worker, which would otherwise take these requests."""
    context = browser.new_context(**{"locale": "en-US", "viewport": DESK, "color_scheme": "dark", **options})
    page = context.new_page()
    page.set_default_timeout(1000 * PATIENCE_S)
    trouble = []
    page.on("console", lambda message: message.type in ("error", "warning") and not any(part in message.text for part in EXPECTED) and trouble.append(message.text))
    page.on("response", lambda response: response.status >= 400 and response.status != 503 and trouble.append(f"{response.status} {response.url}"))
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("request", lambda request: request.url.startswith(("data:", "blob:", "http://127.0.0.1:")) or trouble.append(request.url))
    page.goto(url)
    return page, trouble


def ready(page):
    page.wait_for_selector("body[data-ready]")
    return page


def more(page):
    """Opens the drawer with all of its parts."""
    page.click("#more")
    page.wait_for_selector("#drawer[open]")
    page.locator("#drawer .how").evaluate("how => { how.open = true; }")


def until(page, expression, what=None):
    """Waits for an expression of the page to be true, and returns its value."""
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            value = page.evaluate(expression)
        except Error as error:
            if "context was destroyed" not in str(error):
                raise
            value = None  # the page is being loaded again
        if value:
            return value
        assert time.monotonic() < end, f"not within {PATIENCE_S} s: {what or expression}; the page says {page.inner_text('body')[:300]!r}"
        time.sleep(0.02)


def shown(page):
    """Waits for the photograph of the current word or drawing and for its verdict, and returns the verdict."""
    until(page, "!document.querySelector('#frame').hidden && !document.querySelector('#frame').classList.contains('waits')", "a photograph")
    until(page, "document.querySelector('main').dataset.judged === 'true'", "the verdict of the photograph that is kept")
    return page.inner_text("#verdict")


def send(page, **wait):
    """Sends what is shown, and waits until the page says so."""
    page.click("#send")
    page.wait_for_selector("#sent h2", **wait)


def write(page, word):
    """Enters a whole word, and waits for its photograph."""
    before = page.get_attribute("main", "data-shown")
    page.fill("#word", word)
    until(page, f"document.querySelector('main').dataset.shown !== {before!r}" if before else "document.querySelector('main').dataset.shown")
    return shown(page)


def on_pad(page):
    """Returns the position on the screen of a point given as fractions of the pad's width and height."""
    box = page.locator("#pad").bounding_box()
    return lambda x, y: (box["x"] + x * box["width"], box["y"] + y * box["height"])


def judged_as(page, **verdict):
    """Replaces the verdict of all small and large photographs."""
    def answer(route):
        response = route.fetch()
        shot = response.json()
        told = shot.get("verdict") or shot
        told.update({key: value(told) if callable(value) else value for key, value in verdict.items()})
        route.fulfill(response=response, json=shot)
    for route in ("**/live", "**/photos"):
        page.route(route, answer)


def come(page, requests):
    """Waits for the first of the requests that a route collects."""
    end = time.monotonic() + PATIENCE_S
    while not requests:
        assert time.monotonic() < end, f"no request within {PATIENCE_S} s"
        page.wait_for_timeout(20)


def stroke(page, *points, steps=(12,)):
    """Draws a line through points of the pad. The pen is slower on a segment with more steps."""
    place = on_pad(page)
    page.mouse.move(*place(*points[0]))
    page.mouse.down()
    for point, n in zip(points[1:], itertools.cycle(steps)):
        page.mouse.move(*place(*point), steps=n)
    page.mouse.up()


def drop(page, files):
    page.dispatch_event("body", "drop", {"dataTransfer": page.evaluate_handle(files)})


SHEET = [[150, 90], [640, 110], [690, 520], [90, 500]]


def drop_sheet(page):
    """Drops a photograph of a sheet on a dark desk, with a black and a red stroke, on the page."""
    drop(page, f"""async () => {{
        const canvas = Object.assign(document.createElement('canvas'), {{width: 800, height: 600}});
        const pen = canvas.getContext('2d');
        for (let y = 0; y < 600; y += 8) {{ pen.fillStyle = y % 24 ? '#50372a' : '#75533f'; pen.fillRect(0, y, 800, 8); }}
        pen.fillStyle = '#faf8f2'; pen.beginPath(); {SHEET}.forEach(([x, y]) => pen.lineTo(x, y)); pen.fill();
        pen.lineWidth = 7;
        for (const [color, ...line] of [['#222', 240, 200, 460, 260], ['#d12', 250, 400, 520, 350]]) {{
            pen.strokeStyle = color; pen.beginPath(); pen.moveTo(line[0], line[1]); pen.lineTo(line[2], line[3]); pen.stroke();
        }}
        const data = new DataTransfer();
        data.items.add(new File([await new Promise(done => canvas.toBlob(done, 'image/jpeg', 0.95))], 'sheet.jpg'));
        return data;
    }}""")
    until(page, "document.querySelector('#opened-name').textContent === 'sheet.jpg'")
    return shown(page)


def kept(page):
    """Returns the data that the page keeps over a reload."""
    return page.evaluate("JSON.parse(sessionStorage.getItem('noctograph'))")


def strokes(page):
    sketch = kept(page)["sketch"]
    known = {stroke["id"]: stroke for stroke in sketch["strokes"]}
    return [known[number] for number in sketch["states"][sketch["now"]]]
