"""Tests the page without a server in Chromium: tests/web.py NOCTOGRAPH FOLDER [NAME …]

Compares the browser's photographs, verdicts, flights and plans with those of the command line byte by byte, and tests
the page with its link, its files and its element, and without a network."""

import base64
import csv
import functools
import http.server
import io
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from hashlib import sha256
from pathlib import Path

from browser import *
from firefox import FIREFOX, Firefox
from webkit import WATCH, WEBKIT, WebKit

PROGRAM, FOLDER = [Path(path).resolve() for path in sys.argv[1:3]]
CHOSEN = sys.argv[3:]
WORDS = ["NOOR", "HI", "AMARA", "Łukasz", "NO WAY", "Straße", "42", "Illi", "RALF", "Жаба", "Θεός", "Zoë+Max"]
PRESETS = ["cf-brushless", "bzzz", "ae483-2022", "cf21-thrust-kit"]
HOUSE = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><path d="M20 90 V45 L50 15 L80 45 V90 Z" fill="none" stroke="#d22"/><circle cx="50" cy="62" r="9" fill="none" stroke="#22d"/></svg>'
SMILE = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100" fill="none"><circle cx="50" cy="50" r="40" stroke="#ffcc00"/><path d="M30 60 Q50 85 70 60" stroke="#00aa44"/><path d="M36 38 V44 M64 38 V44" stroke="#2244dd"/></svg>'
HAND = json.dumps({"strokes": [[[0, 80, 0], [5, 10, 0.4], [60, 85, 1.1], [62, 12, 1.6]], [[90, 10, 2.0], [90, 80, 2.5]]], "y": "down"})
CASES = [*(({"word": word}, {}) for word in WORDS), *(({"word": "NOOR"}, {"preset": preset}) for preset in PRESETS),
         ({"drawing": {"kind": "svg", "text": HOUSE}}, {}), ({"drawing": {"kind": "json", "text": HAND}}, {"letters.pace": "even"}), ({"drawing": {"kind": "svg", "text": SMILE}}, {}),
         ({"word": "HELLO", "room": "4x3x2.5"}, {}), ({"word": "HI", "room": "6x4x3"}, {"letters.cap_height_m": "0.8", "controller.kind": "geometric"}),
         ({"word": "RIGA"}, {"controller.kind": "pid", "controller.pid.vel_x": "[12.0, 1.0, 0.0]"})]
# Cases of every run: a word, the other drone, both kinds of drawing, a room, and gains. Other engines make fewer of them.
FEW = [CASES[n] for n in (3, 13, 16, 17, 20, 21)]
FEW_ELSEWHERE = [CASES[n] for n in (1, 3, 16)]
# Variables of cfclient's log by the columns of a flight, with their units and signs.
DEGREES = math.degrees(1)
LOGGED = {**{f"stateEstimate.{axis}": (f"{axis}_m", 1) for axis in "xyz"}, **{f"ctrltarget.{axis}": (f"{axis}_design_m", 1) for axis in "xyz"},
          **{f"stateEstimate.{turn}": (f"{turn}_rad", sign * DEGREES) for turn, sign in [("roll", 1), ("pitch", -1), ("yaw", 1)]}}
# Keys of the verdict, which `preview --json` prints among others.
VERDICT = ["read", "legible", "readability", "reason", "rival", "letters", "faithfulness", "causes", "advice", "flight_sha256"]


class Files(http.server.SimpleHTTPRequestHandler):
    def __init__(self, *arguments, fields=(), **options):
        self.fields = fields
        super().__init__(*arguments, **options)

    def log_message(self, *_):
        pass

    def end_headers(self):
        for name, value in self.fields:
            self.send_header(name, value)
        super().end_headers()


class Host:
    """A web server of a folder that can be stopped. `fields` are the header fields of each answer."""

    def __init__(self, folder=FOLDER, fields=()):
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Files, directory=folder, fields=fields))
        self.url = f"http://127.0.0.1:{self.server.server_port}/"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def end(self):
        self.server.shutdown()
        self.server.server_close()


def words(code):
    """Returns the page's texts in a language."""
    return json.loads((PAGES / f"words/{code}.json").read_text())


def request_of(subject, settings):
    return {**subject, "settings": settings, "files": True, "visitor": "test", "aspect": 16 / 9}


@functools.cache
def by_command_line(request):
    """Returns the output of `preview` and its files, for a request as JSON."""
    subject = json.loads(request)
    settings = subject["settings"]
    arguments = [f"--set={key}={value}" for key, value in settings.items()]
    arguments += [f"--room={subject['room']}"] if "room" in subject else []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder).resolve()
        if "drawing" in subject:
            name = f"drawing.{subject['drawing']['kind']}"
            (folder / name).write_text(subject["drawing"]["text"])
            arguments += ["--drawing", name]
        else:
            arguments += ["--word", subject["word"]]
        command = [PROGRAM, "preview", *arguments, "--size=1920x1080", "--backend=cpu", "--json", "-o", "out"]
        made = subprocess.run(command, cwd=folder, capture_output=True, text=True)
        assert made.returncode in (0, 1), made.stderr
        files = {path.name: path.read_bytes() for path in (folder / "out").iterdir()}
        return json.loads(made.stdout), files


def digest(content):
    return sha256(content).hexdigest()


def the_same_bytes(browser, host):
    """Compares photograph, plan and flight by their digests, and the verdict."""
    page, trouble = opened(browser, host.url)
    ready(page)
    cases = CASES if os.environ.get("NOCTOGRAPH_WEB") else FEW
    if cases is FEW:
        print(f"left out: {len(CASES) - len(FEW)} of {len(CASES)} photographs (NOCTOGRAPH_WEB=1 compares all)")
    print(f"{'':26}{'photo':18}{'plan':18}{'flight':18}read      (browser, command line)")
    for subject, settings in cases:
        name = " ".join([subject.get("word") or f"drawing.{subject['drawing']['kind']}", *settings.values(), subject.get("room", "")])
        request = json.dumps(request_of(subject, settings))
        here = page.evaluate("async request => (await import('./maker.js')).make('photos', request)", request)
        assert "error" not in here, (name, here)
        told, files = by_command_line(request)
        own = {file: base64.b64decode(text) for file, text in here["files"].items()}
        for file in own:
            assert own[file] == files[file], f"{name}: {file} differs"
        for key in VERDICT:
            assert here.get(key) == told.get(key), f"{name}: {key} is {here.get(key)}, by the command line {told.get(key)}"
        digests = [[digest(made[file]) for made in (own, files)] for file in ["photo.png", "plan.csv"]]
        digests += [[here["flight_sha256"], told["flight_sha256"]]]
        print(f"{name:26}" + "".join(f"{a[:7]} {b[:7]}   " for a, b in digests) + f"{told.get('read')}", flush=True)
    assert not trouble, trouble


def a_link_opens_with_what_it_says(browser, host):
    begun = time.monotonic()
    page, trouble = opened(browser, host.url + "#word=NOOR")
    until(page, "document.querySelector('main').dataset.shown")
    first_s = time.monotonic() - begun
    ready(page)
    assert shown(page).startswith("Reads as NOOR."), page.inner_text("#verdict")
    until(page, "document.querySelector('main').dataset.large", "the large photograph")
    times = page.evaluate("""async () => {
        const { make } = await import('./maker.js'), times = [];
        for (const word of ['AMARA', 'KENJI', 'RIGA', 'NOOR', 'SALMA', 'AMARA']) {
            const begun = performance.now();
            const { verdict } = await make('live', JSON.stringify({ word, visitor: 'test', settings: {} }));
            if (!verdict) throw new Error(word);
            times.push(Math.round(performance.now() - begun));
        }
        return times;
    }""")
    memory = int(page.get_attribute("html", "data-memory")) / 1e6
    print(f"first photograph {first_s:.2f} s after opening; photograph and verdict in {times} ms; {memory:.0f} MB", flush=True)
    assert memory <= 120, f"{memory} MB"

    # A word with settings is shared, and another browser makes the same photograph.
    write(page, "RIGA")
    more(page)
    before = page.get_attribute("main", "data-shown")
    page.select_option("[data-key='controller.kind']", "lqr")
    until(page, f"document.querySelector('main').dataset.shown !== {before!r}")
    # The gains come with the large photograph. An invalid gain is refused in the program's words.
    page.click("#drawer .gains >> xpath=preceding-sibling::summary")
    weights = "#drawer [data-key='controller.lqr.r']"
    page.wait_for_selector(weights)
    page.fill(weights, "many")
    page.press(weights, "Tab")
    until(page, "document.querySelector('#drawer .stop')?.textContent.includes('wanted')", "the refusal of a gain")
    before = page.get_attribute("main", "data-shown")
    page.fill(weights, "1e6, 1e6, 4e7, 300")
    page.press(weights, "Tab")
    assert page.locator("#drawer .stop").count() == 0, "the refusal of a gain that was put back"
    until(page, f"document.querySelector('main').dataset.shown !== {before!r}", "the photograph with other gains")
    page.keyboard.press("Escape")
    page.click("#send")
    until(page, "document.querySelector('#verdict').textContent.includes('any browser')", what="the link")
    link = page.evaluate("location.href")
    assert "controller.lqr.r" in link, link
    photo = page.get_attribute("#photo", "src")
    other, more_trouble = opened(browser, link, viewport=PHONE)
    shown(other)
    until(other, "document.querySelector('#word').value === 'RIGA' && document.querySelector('main').dataset.shown")
    until(other, f"document.querySelector('#photo').src === {photo!r} || document.querySelector('main').dataset.large", what="the photograph of the link")
    # After a change, the address no longer contains the settings.
    write(other, "RIGAS")
    assert "#" not in other.evaluate("location.href")
    assert not trouble and not more_trouble, (trouble, more_trouble)


def a_link_of_another_version_loses_what_is_unknown_and_says_so(browser, host):
    """Opens a link with a lamp, colors, a body and settings that this version does not know. Known settings must be kept."""
    known = '"letters.cap_height_m":"0.6"'
    for parts in ['lamp="laser"&color="ultraviolet"&painted=[null,null,null,null]', 'body="pinhole"&room="cave"&pace="soon"&seed=-1', "wind=3&aspect=99",
                  'settings={"wings.flap":"7",%s}' % known, 'settings={"controller.kind":"psychic",%s}' % known, 'settings={"letters.font":"/etc/passwd"}',
                  'settings={"light.letters_wrgb":"[\\"null\\"]",%s}' % known, 'settings={"plan.drones":"many","preset":"ufo",%s}' % known]:
        page, trouble = opened(browser, f"{host.url}#word=NOOR&{parts}", locale="de-DE")
        ready(page)
        until(page, "document.querySelector('#verdict').textContent.includes('andere')", "that something was left out")
        said = shown(page)
        assert said == f"Man liest: NOOR. {words('de')['left-out']}", (parts, said)
        if known in parts:
            assert kept(page)["settings"] == {"letters.cap_height_m": "0.6"}, (parts, kept(page)["settings"])
        # The next word is photographed, also at the plain address.
        assert write(page, "HELLO").startswith("Man liest: HELLO."), page.inner_text("#verdict")
        assert "Version" not in page.inner_text("#verdict")
        page.goto(host.url)
        ready(page)
        assert shown(page).startswith("Man liest: HELLO."), page.inner_text("#verdict")
        assert not trouble, (parts, trouble)
        page.context.close()


def a_file_that_is_nothing_gets_a_sentence(browser, host):
    """The sentence is in the page's language, with the program's own words behind a button."""
    for code in ["de", "en"]:
        want, why = words(f"{code}-more")["errors"]["log"].removeprefix("{name} "), words(code)["why"]
        page, trouble = opened(browser, host.url, locale=f"{code}-{code.upper()}")
        ready(page)
        page.fill("#word", "NOOR")
        for name, text in [("note.txt", "hello"), ("empty.json", "{}"), ("nothing.csv", ""), ("noise", "\\x00\\x01\\xff")]:
            drop(page, f"() => {{ const data = new DataTransfer(); data.items.add(new File(['{text}'], '{name}')); return data; }}")
            until(page, f"document.querySelector('#verdict').textContent.startsWith('{name} {want}')", f"what {name} is")
            assert page.inner_text("#verdict").strip() in (f"{name} {want}", f"{name} {want} {why}"), page.inner_text("#verdict")
        drop(page, "() => { const data = new DataTransfer(); data.items.add(new File(['hello'], 'note.txt')); return data; }")
        until(page, "document.querySelector('#verdict button')", "the button")
        page.click("#verdict button")
        page.wait_for_selector("#drawer[open]")
        assert "wanted" in page.inner_text("#drawer .stop"), page.inner_text("#drawer")
        assert not trouble, trouble
        page.context.close()


def the_scene_of_a_drawing_brings_it(browser, host):
    """Saves drawings of the pad and of an opened file, which give the same photograph in a separate folder."""
    def on_the_pad(page):
        page.click("#draw")
        page.wait_for_selector("#pad .cursor", state="attached")
        stroke(page, (0.3, 0.8), (0.3, 0.2), (0.6, 0.8), (0.6, 0.2))
    def of_a_file(page):
        drop(page, f"() => {{ const data = new DataTransfer(); data.items.add(new File([{HOUSE!r}], 'house.svg')); return data; }}")
    for draws, name in [(on_the_pad, "drawing.json"), (of_a_file, "drawing.svg"), (drop_sheet, "drawing.jpg")]:
        page, trouble = opened(browser, host.url)
        ready(page)
        draws(page)
        until(page, "document.querySelector('main').dataset.large", "the large photograph")
        page.click("#more")
        button = page.wait_for_selector("[data-file='scene.toml']")
        assert button.inner_text() == "Scene with its drawing"
        with tempfile.TemporaryDirectory() as folder:
            saved = []
            page.on("download", lambda download: saved.append(download))
            for file in ["scene.toml", "photo.png"]:
                n = len(saved) + (2 if file == "scene.toml" else 1)
                page.click(f"[data-file='{file}']")
                end = time.monotonic() + PATIENCE_S
                while len(saved) < n and time.monotonic() < end:
                    page.wait_for_timeout(50)
            for download in saved:
                download.save_as(Path(folder) / download.suggested_filename)
            assert {download.suggested_filename for download in saved} == {"scene.toml", name, "photo.png"}, saved
            made = subprocess.run([PROGRAM, "preview", "--scene", "scene.toml", "--backend=cpu", "-o", "out"], cwd=folder, capture_output=True, text=True)
            assert made.returncode in (0, 1), made.stderr
            assert (Path(folder) / "photo.png").read_bytes() == (Path(folder) / "out/photo.png").read_bytes(), f"another photograph of {name}"
        assert not trouble, trouble
        page.context.close()


def an_update_never_mixes_two_versions(browser):
    """Updates the page on a host that lets browsers cache files, while a page is open."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "site"
        shutil.copytree(FOLDER, root)
        host = Host(root, [("Cache-Control", "max-age=600")])
        context = browser.new_context(locale="en-US", viewport=DESK)
        page = context.new_page()
        page.goto(host.url)
        ready(page)
        page.evaluate("navigator.serviceWorker.ready.then(() => true)")
        until(page, "navigator.serviceWorker.controller !== null", "the service worker")

        def change(name, was, now):
            text = (root / name).read_text()
            assert was in text, (name, was)
            (root / name).write_text(text.replace(was, now))

        change("words/en.json", "A drone will write it in the dark", "SECOND VERSION")
        change("words/en-more.json", '"How it flies"', '"SECOND VERSION"')
        change("drawer.js", "of-shot", "of-shot second-version")
        version = re.search("noctograph-[0-9a-f]{16}", (root / "sw.js").read_text())[0]
        change("sw.js", version, "noctograph-0000000000000002")
        page.evaluate("navigator.serviceWorker.getRegistration().then(it => it.update())")
        until(page, "navigator.serviceWorker.getRegistration().then(it => it.waiting !== null)", "the next version")
        # The open page stays consistent: files that it loads later are of its version.
        write(page, "NOOR")
        page.click("#more")
        page.wait_for_selector("#drawer[open]")
        assert page.locator(".second-version").count() == 0 and "SECOND" not in page.inner_text("#drawer"), "an open page got a file of the next version"
        page.keyboard.press("Escape")
        page.fill("#word", "")
        page.reload()
        until(page, "document.querySelector('#verdict')?.textContent.startsWith('SECOND VERSION')", "the next version, whole")
        ready(page)
        page.click("#more")
        page.wait_for_selector("#drawer[open] .second-version", state="attached")
        assert "SECOND VERSION" in page.inner_text("#drawer")
        assert page.evaluate("caches.keys()") == ["noctograph-0000000000000002"]
        context.close()
        host.end()


def an_element_stands_in_a_page_of_another_host(browser):
    """The element makes its photograph there with a worker that it loads. If it may not, it shows the word and the
    reason."""
    maker = Host(FOLDER, [("Access-Control-Allow-Origin", "*")])
    with tempfile.TemporaryDirectory() as folder:
        french = {"": "On lit\u00a0: HI.", "worker-src 'none'": "Pas de photo ici"}
        for policy, want in [("", "Man liest: NOOR."), ("worker-src 'none'", words("de-more")["element-none"])]:
            meta = f'<meta http-equiv="Content-Security-Policy" content="{policy}">' if policy else ""
            (Path(folder) / "index.html").write_text(f"""<!doctype html><html lang="de"><head>{meta}<script type="module" src="{maker.url}element.js"></script></head>
                <body><noctograph-photo word="NOOR"></noctograph-photo><div style="height: 400vh"></div><noctograph-photo lang="fr" word="HI"></noctograph-photo></body></html>""")
            host = Host(folder)
            context = browser.new_context(locale="en-US", viewport=DESK)
            page = context.new_page()
            page.goto(host.url)
            caption = lambda n: f"document.querySelectorAll('noctograph-photo')[{n}].shadowRoot?.querySelector('figcaption')?.textContent ?? ''"
            until(page, f"({caption(0)}).startsWith({want!r})", want)
            if policy:
                assert page.evaluate("document.querySelector('noctograph-photo').shadowRoot.querySelector('span').textContent") == "NOOR", "the word is seen"
            # An element far below shows its word, and makes its photograph when it becomes visible.
            assert page.evaluate(caption(1)) == ""
            page.evaluate("document.querySelectorAll('noctograph-photo')[1].scrollIntoView()")
            until(page, f"({caption(1)}).startsWith({french[policy]!r})", "the second one, in its own language")
            context.close()
            host.end()
    maker.end()


def what_is_typed_before_the_answer_keeps_no_unknown_setting(browser, host):
    """The answer to the settings of a link or of a stored state arrives when another word has been typed."""
    for parts in ['settings={"controller.kind":"psychic","letters.cap_height_m":"0.6"}', 'settings={"wings.flap":"7"}&room="0x0x0"', 'settings={"plan.lights":"many"}']:
        page, trouble = opened(browser, "about:blank", service_workers="block")
        held = []
        page.route("**/amiss.js", lambda route: held.append(route))
        page.goto(f"{host.url}#word=NOOR&{parts}")
        come(page, held)
        page.fill("#word", "HELLO")
        held[0].continue_()
        page.unroute("**/amiss.js")
        until(page, "document.querySelector('#photo').alt.includes('HELLO')", "the photograph of what was typed")
        assert shown(page) == f"Reads as HELLO. {words('en')['left-out']}", page.inner_text("#verdict")
        assert set(kept(page)["settings"]) <= {"letters.cap_height_m"}, kept(page)["settings"]
        assert not trouble, (parts, trouble)
        page.context.close()


PROBE = """<!doctype html><pre></pre><script type="module">
    import { make } from "./maker.js";
    const hex = (bytes) => Array.from(new Uint8Array(bytes), (byte) => byte.toString(16).padStart(2, "0")).join("");
    const digest = async (text) => hex(await crypto.subtle.digest("SHA-256", Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0))));
    const told = [];
    for (const asked of REQUESTS) {
        const { files, error, ...made } = await make("photos", JSON.stringify(asked));
        const digests = {};
        for (const name of Object.keys(files ?? {})) digests[name] = await digest(files[name]);
        told.push({ ...made, error, photo: "", digests });
    }
    document.querySelector("pre").textContent = JSON.stringify(told);
</script>"""


def another_engine_makes_the_same_bytes(engine):
    """Compares photographs, and checks that the page starts without errors in the console."""
    cases = CASES if os.environ.get("NOCTOGRAPH_WEB") else FEW_ELSEWHERE
    requests = [request_of(*case) for case in cases]
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "site"
        shutil.copytree(FOLDER, root)
        (root / "probe.html").write_text(PROBE.replace("REQUESTS", json.dumps(requests)))
        (root / "watch.js").write_text(WATCH)
        index = (root / "index.html").read_text()
        (root / "index.html").write_text(index.replace('<script type="module"', '<script src="watch.js"></script><script type="module"', 1))
        host, browser = Host(root), engine(PATIENCE_S)
        try:
            browser.open("about:blank")
            begun = browser.cpu_s()
            browser.open(host.url + "#word=HI")
            browser.until("document.querySelector('main')?.dataset.shown", "the first photograph")
            used_s = browser.cpu_s() - begun
            browser.until("document.querySelector('main').dataset.large", "the large photograph of a link")
            said = browser.until("document.querySelector('#verdict').textContent", "the verdict")
            assert said.startswith("Reads as HI."), said
            assert not browser.faults(host.url), browser.faults(host.url)
            browser.open(host.url + "probe.html")
            made = json.loads(browser.until("document.querySelector('pre').textContent", "the photographs", len(cases)))
            for here, request in zip(made, requests, strict=True):
                told, files = by_command_line(json.dumps(request))
                assert here["digests"] == {name: digest(files[name]) for name in here["digests"]} and "photo.png" in here["digests"], (request, here)
                assert all(here.get(key) == told.get(key) for key in VERDICT), (request, here)
        finally:
            browser.end()
            host.end()
    print(f"{len(cases)} photographs have the same bytes in {engine.__name__}, whose first one took {used_s:.1f} s of processor", flush=True)


def a_broken_link_opens_the_page(browser, host):
    for hash_ in ["#word=HI&seed=x&settings=[1]&sketch={}&painted=7&aspect=null", "#sketch=nonsense", "#word=" + "W" * 30,
                  "#word=HI&settings=" + '{"letters.font":"/etc/passwd"}']:
        page, trouble = opened(browser, host.url + hash_)
        ready(page)
        assert not trouble, (hash_, trouble)


def an_old_browser_is_told_so(browser, host):
    """Opens the page in a browser that cannot run the module."""
    context = browser.new_context(locale="fr-FR", service_workers="block")
    context.route("**/noctograph.wasm*", lambda route: route.fulfill(body=b"\0asm\1\0\0\0\x0a\xff", content_type="application/wasm"))
    page = context.new_page()
    page.goto(host.url)
    until(page, "document.querySelector('#verdict').textContent.includes('trop ancien')")
    context.close()


def files_are_saved(browser, host):
    page, trouble = opened(browser, host.url)
    ready(page)
    assert "send" not in write(page, "Illi"), "nobody sends from here"
    write(page, "SALMA")
    until(page, "document.querySelector('main').dataset.large", "the large photograph")
    page.click("#more")
    until(page, "document.querySelectorAll('#drawer .files button').length === 3")
    for name, begins in {"photo.png": b"\x89PNG", "scene.toml": b"# A noctograph", "flight.zip": b"PK"}.items():
        with page.expect_download() as download:
            page.click(f"[data-file='{name}']")
        content = Path(download.value.path()).read_bytes()
        assert content.startswith(begins), (name, content[:40])
    names = zipfile.ZipFile(io.BytesIO(content)).namelist()
    assert any(name.endswith(".py") for name in names), names
    assert not trouble, trouble


def drawings_and_pictures_are_photographed(browser, host):
    page, trouble = opened(browser, host.url)
    ready(page)
    page.click("#draw")
    page.wait_for_selector("#pad .cursor", state="attached")
    stroke(page, (0.3, 0.8), (0.3, 0.2), (0.6, 0.8), (0.6, 0.2))
    until(page, "document.querySelectorAll('#pad .lit').length === 1")
    page.click("#send-drawing")
    until(page, "location.hash.includes('sketch=')")
    other, _ = opened(browser, page.evaluate("location.href"))
    until(other, "document.querySelectorAll('#pad .lit').length === 1", what="the drawing of the link")
    page.click("#type")
    drop_sheet(page)
    page.click("#choose")
    until(page, "document.querySelectorAll('#picture path[data-n]').length === 2", what="two strokes of a picture")
    assert not trouble, trouble


def a_log_gives_its_photograph(browser, host):
    """Compares the photograph of a cfclient log without word and lights with that of `expose`, byte by byte."""
    with tempfile.TemporaryDirectory() as folder:
        def run(*arguments):
            return subprocess.run([PROGRAM, *arguments], cwd=folder, capture_output=True, text=True)
        run("preview", "NOOR", "--scene", "team", "--size=480x270", "--backend=cpu", "-o", "flown")
        lines = [["Timestamp", *LOGGED]]
        for row in csv.DictReader((Path(folder) / "flown/flight.csv").read_text().splitlines()):
            lines.append([round(5000 + 1000 * float(row["time_s"])), *(f"{factor * float(row[name]):.5f}" for name, factor in LOGGED.values())])
        log = "\n".join(",".join(map(str, line)) for line in lines)
        (Path(folder) / "log").write_text(log)
        photos = {}
        for name, flags in {"NOOR": ["--word", "NOOR"], "": ["--lit"]}.items():
            made = run("expose", "log", *flags, "--size=1920x1080", "--backend=cpu", "--json")
            photos[name] = json.loads(made.stdout), (Path(folder) / "photo.png").read_bytes()
    page, trouble = opened(browser, host.url)
    ready(page)
    for word, (told, photo) in photos.items():
        request = json.dumps({"word": word, "log": base64.b64encode(log.encode()).decode(), "files": True, "visitor": "test", "aspect": 16 / 9})
        here = page.evaluate("async request => (await import('./maker.js')).make('photos', request)", request)
        assert here.get("flight_sha256") == told["flight_sha256"], (here, told)
        assert base64.b64decode(here["files"]["photo.png"]) == photo, f"another photograph of the log with the word {word!r}"
        assert any("not in the log" in said["text"] for said in here["warnings"]), here["warnings"]
    # The log is opened like any file.
    drop(page, f"() => {{ const data = new DataTransfer(); data.items.add(new File([{json.dumps(log)}], 'log00')); return data; }}")
    until(page, "document.querySelector('#verdict').textContent.includes('This is how it looked.')", "the photograph of a log")
    assert write(page, "NOOR").startswith("Reads as NOOR."), page.inner_text("#verdict")
    until(page, "document.querySelector('main').dataset.large", "the large photograph")
    page.click("#more")
    until(page, "document.querySelectorAll('#drawer .files button').length === 2")
    assert page.locator("#drawer [data-key]").count() == 1, "what was flown is flown by another controller"
    page.keyboard.press("Escape")
    # If the typed word was not flown, the page reports this.
    page.fill("#word", "HELLO")
    until(page, "document.querySelector('#verdict').textContent.startsWith('This flight did not write HELLO.')", "the log's refusal")
    drop(page, "() => { const data = new DataTransfer(); data.items.add(new File(['what, is, this'], 'notes.txt')); return data; }")
    until(page, "document.querySelector('#verdict').textContent.startsWith('notes.txt is neither')", "the refusal of what is no log")
    assert not trouble, trouble


def an_element_stands_in_any_page(browser, host):
    page, trouble = opened(browser, "about:blank", service_workers="block")
    held = []
    page.route("**/noctograph.wasm.gz", lambda route: held.append(route))
    page.goto(host.url + "example.html")
    seen = "['span', 'figcaption'].map(name => document.querySelector('noctograph-photo').shadowRoot.querySelector(name).textContent).join()"
    until(page, f"{seen} === 'RIGA,The photograph is being made: 0 %'", "the word, and what becomes of it")
    come(page, held)
    held[0].continue_()
    page.evaluate("document.querySelectorAll('noctograph-photo')[1].scrollIntoView()")
    captions = "[...document.querySelectorAll('noctograph-photo')].map(it => it.shadowRoot.querySelector('figcaption').textContent)"
    until(page, f"{captions}[0].startsWith('Reads as RIGA.') && {captions}[1].startsWith('Most people would read BIGA.')", "both photographs")
    link = page.evaluate("document.querySelectorAll('noctograph-photo')[1].shadowRoot.querySelector('a').href")
    page.evaluate("document.querySelector('noctograph-photo').setAttribute('word', '')")
    until(page, f"{captions}[0].startsWith('No photograph:')")
    page.evaluate("document.querySelector('noctograph-photo').setAttribute('word', 'HI')")
    until(page, f"{captions}[0].startsWith('Reads as HI.')")
    assert not trouble, trouble
    page.goto(link)
    until(page, "JSON.parse(sessionStorage.noctograph).settings['controller.kind'] === 'lqr'")


def a_visitor_of_the_exhibit_makes_own_photographs(browser):
    """Opens the page by its network address, like a visitor on another machine."""
    server = Server(PROGRAM, "--network", "--scene", "pid", "--module", str(FOLDER / "noctograph.wasm.gz"))
    try:
        context = browser.new_context(locale="en-US", viewport=PHONE)
        page, asked = context.new_page(), []
        page.on("request", lambda request: asked.append(request.url.rsplit("/", 1)[-1]))
        # Until the module is loaded, the server makes the photographs, and a line shows the
        # progress.
        held = []
        page.route("**/noctograph.wasm.gz", lambda route: held.append(route))
        page.goto(server.network)
        ready(page)
        assert write(page, "HELLO").startswith("Reads as HELLO."), page.inner_text("#verdict")
        assert "live" in asked, "the server's photograph"
        asked.clear()
        come(page, held)
        held[0].continue_()
        until(page, "import('./maker.js').then(({ ready }) => ready())", "the module")
        begun = cpu_s(server)
        for word in ["NOOR", "AMARA", "LEA"]:
            assert write(page, word).startswith(f"Reads as {word}."), page.inner_text("#verdict")
        used_s = cpu_s(server) - begun
        assert used_s < 0.1 and not {"live", "photos"} & set(asked), (used_s, asked)
        print(f"three photographs of a visitor cost the server {used_s:.2f} s of processor", flush=True)
        # The server's own scene is flown, and an entry that is sent is made again by the server.
        source = "document.querySelector('#photo').src"
        own = until(page, source + ".startsWith('data:') && " + source)
        there = page.evaluate("""async () => {
            const headers = {'Content-Type': 'application/json'}, kept = JSON.parse(sessionStorage.noctograph);
            const { wish } = await import('./wish.js'), { state } = await import('./state.js');
            const area = document.querySelector('.stage'), aspect = Math.round(20 * area.clientWidth / area.clientHeight) / 20;
            const body = JSON.stringify({...wish(Math.min(2.5, Math.max(0.4, aspect))), visitor: state.visitor});
            return Promise.all(['live', 'photos'].map(async (route) => (await (await fetch(route, {method: 'POST', headers, body})).json()).photo));
        }""")
        assert own in there, "another photograph than the server's"
        send(page, timeout=120_000)
        context.close()
        # A browser that cannot run the module gets the server's photograph and a message.
        context = browser.new_context(locale="en-US", viewport=PHONE)
        context.route("**/noctograph.wasm*", lambda route: route.fulfill(body=b"\0asm\1\0\0\0\x0a\xff", content_type="application/wasm"))
        page = context.new_page()
        page.goto(server.network)
        ready(page)
        page.evaluate("window.said = []; new MutationObserver(() => window.said.push(document.querySelector('#verdict').textContent)).observe(document.querySelector('#verdict'), {childList: true, subtree: true})")
        assert write(page, "NOOR").startswith("Reads as NOOR.")
        assert any("one at a time" in said for said in page.evaluate("window.said")), page.evaluate("window.said")
        context.close()
    finally:
        server.kill()


def no_network_is_needed(browser):
    host = Host()
    context = browser.new_context(locale="de-DE", viewport=DESK)
    page = context.new_page()
    page.goto(host.url)
    ready(page)
    page.evaluate("navigator.serviceWorker.ready.then(() => true)")
    until(page, "navigator.serviceWorker.controller !== null", what="the service worker")
    host.end()
    page.reload()
    ready(page)
    assert write(page, "NOOR").startswith("Man liest: NOOR."), page.inner_text("#verdict")
    page.click("#more")
    page.wait_for_selector("#drawer[open]")
    page.goto(host.url + "example.html")
    until(page, "document.querySelector('noctograph-photo').shadowRoot?.querySelector('img')?.src")
    context.close()


def drive_in_a_browser(playwright, drive, *args):
    """Starts a new browser for each test, because pages and service workers of an earlier test continue to run."""
    if CHOSEN and drive.__name__ not in CHOSEN:
        return
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
    drive(browser, *args)
    browser.close()


if __name__ == "__main__":
    host = Host()
    with sync_playwright() as playwright:
        for drive in (a_link_opens_with_what_it_says, an_old_browser_is_told_so, files_are_saved, a_broken_link_opens_the_page,
                      a_link_of_another_version_loses_what_is_unknown_and_says_so, what_is_typed_before_the_answer_keeps_no_unknown_setting, a_file_that_is_nothing_gets_a_sentence,
                      the_scene_of_a_drawing_brings_it, drawings_and_pictures_are_photographed, a_log_gives_its_photograph, an_element_stands_in_any_page,
                      the_same_bytes):  # fmt: skip
            drive_in_a_browser(playwright, drive, host)
        for drive in (a_visitor_of_the_exhibit_makes_own_photographs, an_update_never_mixes_two_versions, an_element_stands_in_a_page_of_another_host,
                      no_network_is_needed):  # fmt: skip
            drive_in_a_browser(playwright, drive)
    host.end()
    engines = ["Chromium"]
    for program, engine in [(FIREFOX, Firefox), (WEBKIT, WebKit)]:
        if not program:
            print(f"left out: {engine.__name__} (none is installed)")
        elif not CHOSEN or another_engine_makes_the_same_bytes.__name__ in CHOSEN:
            another_engine_makes_the_same_bytes(engine)
            engines.append(engine.__name__)
    print(f"the page without a server in {', '.join(engines)}: link, files, drawing, picture, log, element, exhibit, no network, the same bytes")
