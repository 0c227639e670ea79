"""Tests the exhibit in Chromium: tests/exhibit.py NOCTOGRAPH [AXE_JS] [PART/PARTS] [NAME …]

Each fault that was found in a hall has a test here, which is named after a claim."""

import csv
import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
import zipfile
from itertools import chain
from pathlib import Path

from browser import *
from soak import soak

PROGRAM = sys.argv[1]
AXE = Path(sys.argv[2]).read_text() if len(sys.argv) > 2 and Path(sys.argv[2]).is_file() else None
PART, PARTS = next(([int(n) for n in text.split("/")] for text in sys.argv[2:] if re.fullmatch(r"\d+/\d+", text)), [1, 1])
CHOSEN = [name for name in sys.argv[2:] if name.isidentifier()]
LANGUAGES = ["en", "de", "fr", "es"]
# Three presses of F: one, one before its answer, and one as soon as the page shows the answer.
DOUBLE_TAPS = """() => new Promise((done) => {
    const entry = document.querySelector("#entry");
    const tap = () => document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "f", bubbles: true }));
    new MutationObserver(() => { if (entry.classList.contains("held")) done(tap()); }).observe(entry, { attributes: true });
    tap(), tap();
})"""


# ---------- Words ----------


def flat(table, place=""):
    for key, value in table.items():
        if isinstance(value, dict):
            yield from flat(value, f"{place}{key}/")
        else:
            yield place + key, value


def words_are_complete_in_four_languages(hall):
    # The tables contain the phrases that a visitor reads first, and those that come later.
    tables = {code: {key: phrase for part in ("", "-more") for key, phrase in flat(json.loads((PAGES / f"words/{code}{part}.json").read_text()))} for code in LANGUAGES}
    known = set(tables["en"])
    for code, table in tables.items():
        assert set(table) == known, f"{code}: {set(table) ^ known}"
        for key, phrase in table.items():
            assert phrase.strip(), f"{code}: {key} is empty"
            values = lambda text: set(re.findall(r"\{(\w+)\}", text))
            assert values(phrase) == values(tables["en"][key]), f"{code}: {key} has other values"
    # French has a non-breaking space before a punctuation mark with two parts.
    breaks = [key for key, phrase in tables["fr"].items() if re.search(r"[ \w)}][;:!?]", phrase)]
    assert not breaks, f"a line may end before a sign: {breaks}"
    same = [key for key, phrase in tables["en"].items() if len(phrase) > 24 and tables["de"][key] == phrase]
    assert not same, f"not translated: {same}"
    # The table contains all phrases that the pages use and all that the program can send.
    sources = "".join(path.read_text() for path in [*PAGES.glob("*.js"), *PAGES.glob("*.html")])
    named = set(re.findall(r"\bt\(\"([\w-]+)\"", sources)) | set(re.findall(r"data-[tlp]=\"([\w-]+)\"", sources))
    top = {key.split("/")[0] for key in known}
    assert named <= top, f"no words for {named - top}"
    said = json.loads((PAGES / "keys.json").read_text())
    for group, keys in said.items():
        missing = [key for key in keys if f"{group}/{key}" not in known]
        assert not missing, f"the program says what no language has: {group} {missing}"


def errors_are_said_in_the_visitors_language(hall):
    """Checks that a foreign visitor sees no percentages, keys, paths or English sentences."""
    for code, want in {"en": "has not learned", "de": "noch nicht gelernt", "fr": "pas encore appris", "es": "aún no ha aprendido"}.items():
        page, trouble = opened(hall.browser, hall.page, locale=f"{code}-{code.upper()}", viewport=PHONE)
        ready(page)
        assert page.get_attribute("html", "lang") == code
        page.fill("#word", "A🦉")
        until(page, f"document.querySelector('#verdict').textContent.includes({want!r})", what=f"an error in {code}")
        said = page.inner_text("#verdict")
        assert "🦉" in said and len(said) < 120, said
        assert not re.search(r"/|scene|U\+|%|--set|_", said), said
        assert page.locator("#frame").is_hidden(), "beside an error there is no photograph"
        assert page.get_attribute("#send", "aria-disabled") == "true"
        assert not trouble, trouble
        page.context.close()


# ---------- No keystroke hangs ----------


def no_keystroke_hangs(hall, sessions=12):
    """Delays each request at random, so that the answers arrive in another order. The last word must be shown."""
    page, trouble = opened(hall.browser, hall.page, viewport=PHONE)
    ready(page)
    rng = random.Random(7)
    delays = []

    def late(route):
        delays.append(rng.uniform(0, 0.3))
        time.sleep(delays[-1])
        try:
            route.continue_()
        except Exception:
            pass  # the page abandoned it for a newer request

    # Each request is delayed separately in the browser.
    page.route("**/live", late)
    for session in range(sessions):
        word = rng.choice(["NOOR", "ANNA", "ZOE", "OTTO", "LEA"])
        page.fill("#word", "")
        page.type("#word", word, delay=rng.uniform(10, 120))
        until(page, f"document.querySelector('#photo').alt.includes({word!r}) && !document.querySelector('#frame').classList.contains('waits')", f"session {session}: {word}")
    page.unroute("**/live")
    assert not [line for line in trouble if "ERR_" not in line], trouble


def a_photograph_that_takes_long_comes(hall):
    """Simulates a busy machine, on which a photograph that takes 20 s would never be finished if it were requested
    again after 15 s."""
    page, trouble = opened(hall.browser, "about:blank", viewport=PHONE)
    page.clock.install()
    page.goto(hall.page)
    ready(page)
    held = []
    page.route("**/live", lambda route: held.append(route))
    page.fill("#word", "NOOR")
    for n_asked in [1, 2]:
        page.clock.run_for(1000)
        while len(held) < n_asked:
            page.wait_for_timeout(20)
        page.clock.run_for(16_000)
    page.wait_for_timeout(200)
    assert len(held) == 2, "the second time it has twice as long"
    held[0].abort()
    held[1].continue_()
    assert shown(page).startswith("Reads as NOOR."), page.inner_text("#verdict")
    assert not trouble, trouble


def a_lost_connection_is_noticed_and_mended(hall):
    with tempfile.TemporaryDirectory() as gallery:
        server = Server(PROGRAM, "--gallery", gallery)
        page, _ = opened(hall.browser, server.page, viewport=TABLET)
        ready(page)
        write(page, "ANNA")
        server.kill()
        until(page, "document.querySelector('#lost').textContent", "that the connection is lost")
        page.fill("#word", "OTTO")
        again = Server(PROGRAM, "--gallery", gallery)
        try:
            assert again.page == server.page, "the address survives a restart"
            until(page, "document.querySelector('#photo').alt.includes('OTTO') && !document.querySelector('#lost').textContent", "the photograph after the restart")
        finally:
            again.kill()


# ---------- The pad ----------


def the_pad_stands_still_while_one_draws(hall):
    """Checks that a straight line by a slow finger stays straight while photographs arrive."""
    for size in [PHONE, TABLET, {"width": 844, "height": 390}]:
        page, trouble = opened(hall.browser, hall.page, viewport=size, has_touch=True)
        ready(page)
        page.click("#draw")
        page.wait_for_selector("#pad .cursor", state="attached")
        stroke(page, (0.2, 0.2), (0.8, 0.2))
        place, box = on_pad(page), page.locator("#pad").bounding_box()
        page.mouse.move(*place(0.1, 0.6))
        page.mouse.down()
        for step in range(30):
            page.mouse.move(*place(0.1 + 0.8 * step / 29, 0.6))
            time.sleep(0.08)
            assert page.locator("#pad").bounding_box() == box, f"the pad moved on {size}"
        page.mouse.up()
        drawn = strokes(page)[-1]["points"]
        heights = [y for _, y, _ in drawn]
        assert max(heights) - min(heights) < 2, f"a straight line has a step of {max(heights) - min(heights)} units of 1000"
        until(page, "document.querySelectorAll('#pad .lit').length === 2", what="both strokes in the photograph")
        assert page.locator("#pad").bounding_box() == box
        assert not trouble, trouble
        page.context.close()


def one_pointer_draws_and_a_palm_does_not(hall):
    page, _ = opened(hall.browser, hall.page, viewport=TABLET, has_touch=True)
    ready(page)
    page.click("#draw")
    page.wait_for_selector("#pad .cursor", state="attached")
    place = on_pad(page)
    touch = page.context.new_cdp_session(page)
    point = lambda number, x, y: dict(zip("xy", place(x, y)), id=number)
    send = lambda kind, *points: touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": list(points)})
    send("touchStart", point(1, 0.2, 0.3))
    send("touchMove", point(1, 0.3, 0.3))
    send("touchStart", point(1, 0.3, 0.3), point(2, 0.8, 0.9))
    for step in range(10):
        send("touchMove", point(1, 0.3 + 0.03 * step, 0.3), point(2, 0.8, 0.9 - 0.01 * step))
    send("touchEnd")
    drawn = strokes(page)
    assert len(drawn) == 1, f"{len(drawn)} strokes of one finger"
    height = kept(page)["sketch"]["page"][1]
    assert all(abs(y - 0.3 * height) < 3 for _, y, _ in drawn[0]["points"]), "the palm is no part of the stroke"
    send("touchStart", point(1, 0.5, 0.5))
    send("touchEnd")
    assert len(strokes(page)[-1]["points"]) == 1, "a tap is a dot"


def strokes_are_undone_rubbed_out_painted_and_moved(hall):
    page, trouble = opened(hall.browser, hall.page, viewport=TABLET)
    ready(page)
    page.click("#draw")
    page.wait_for_selector("#pad .cursor", state="attached")
    stroke(page, (0.2, 0.2), (0.8, 0.2))
    stroke(page, (0.2, 0.5), (0.8, 0.5))
    page.click("#undo")
    assert len(strokes(page)) == 1
    page.click("#redo")
    assert len(strokes(page)) == 2
    page.click("[name=light-pad][value=red]", force=True)
    page.click("#paint")
    page.mouse.click(*on_pad(page)(0.5, 0.2))
    assert [line["color"] for line in strokes(page)] == ["red", "white"], "a stroke has the color that is chosen"
    page.click("#rub")
    page.mouse.click(*on_pad(page)(0.5, 0.5))
    assert [line["color"] for line in strokes(page)] == ["red"]
    page.click("#move")
    before = strokes(page)[0]["points"][0]
    stroke(page, (0.5, 0.2), (0.5, 0.4))
    after = strokes(page)[0]["points"][0]
    height = kept(page)["sketch"]["page"][1]
    assert abs(after[1] - before[1] - 0.2 * height) < 0.02 * height and abs(after[0] - before[0]) < 5, f"{before} → {after}"
    # After a reload everything is kept, including the history, and Back leads to the word.
    page.reload()
    ready(page)
    assert page.locator("#pad").is_visible() and len(strokes(page)) == 1
    page.click("#undo")
    assert strokes(page)[0]["points"][0] == before
    page.go_back()
    assert page.locator("#word").is_visible()
    # This part uses only the keyboard.
    page.click("#draw")
    page.focus("#pad")
    n = len(strokes(page))
    for key in [" ", "ArrowRight", "ArrowRight", "ArrowDown", " "]:
        page.keyboard.press(key)
    assert len(strokes(page)) == n + 1
    page.keyboard.press("Control+z")
    assert len(strokes(page)) == n
    assert not trouble, trouble


def a_stroke_lands_where_it_was_drawn(hall):
    """Compares the lamp's path in the photograph with the finger's, in pixels of the screen."""
    for size in [PHONE, DESK]:
        page, _ = opened(hall.browser, hall.page, viewport=size)
        ready(page)
        page.click("#draw")
        page.wait_for_selector("#pad .cursor", state="attached")
        ways = [[(0.25, 0.3), (0.25, 0.7)], [(0.6, 0.3), (0.6, 0.7)]]
        for way in ways:
            stroke(page, *way)
        until(page, "document.querySelectorAll('#pad .lit').length === 2", what="both strokes in the photograph")
        bright = page.evaluate("""() => {
            const photo = document.querySelector('#photo'), canvas = document.createElement('canvas');
            [canvas.width, canvas.height] = [photo.naturalWidth, photo.naturalHeight];
            const pen = canvas.getContext('2d');
            pen.drawImage(photo, 0, 0);
            const { data, width, height } = pen.getImageData(0, 0, canvas.width, canvas.height);
            const sums = new Float64Array(width);
            for (let i = 0; i < width * height; i += 1) if (data[4 * i] > 128) sums[i % width] += 1;
            const box = photo.getBoundingClientRect(), middle = width * 0.5;
            const mean = (from, to) => { let [s, n] = [0, 0]; for (let x = from; x < to; x += 1) { s += sums[x] * x; n += sums[x]; } return box.left + (s / n) / width * box.width; };
            return [mean(0, Math.round(middle)), mean(Math.round(middle), width)];
        }""")
        place = on_pad(page)
        for found, way in zip(bright, ways):
            off = found - place(*way[0])[0]
            assert abs(off) < 0.02 * size["width"], f"{off:.1f} px beside the finger on {size}"
        page.context.close()


# ---------- The word ----------


def a_pasted_word_is_cut_and_it_is_said(hall):
    page, _ = opened(hall.browser, hall.page, viewport=PHONE)
    ready(page)
    page.fill("#word", "A" * 60)
    assert page.input_value("#word") == "A" * 24
    assert "24" in page.inner_text("#verdict"), page.inner_text("#verdict")


def nothing_is_lost_on_reload_or_back(hall):
    page, _ = opened(hall.browser, hall.page, viewport=PHONE)
    ready(page)
    write(page, "ANNA")
    page.click("[name=light-word][value=red]", force=True)
    page.reload()
    ready(page)
    assert page.input_value("#word") == "ANNA" and page.is_checked("[name=light-word][value=red]")
    shown(page)
    page.goto("about:blank")
    page.go_back()
    ready(page)
    assert page.input_value("#word") == "ANNA"


def a_colored_word_shines_on_every_lamp(hall):
    """Checks that the bright pixels of the photograph have the lamp's color, and that the photograph is not black."""
    page, _ = opened(hall.browser, hall.page)
    ready(page)
    light = """() => {
        const canvas = document.createElement('canvas'), photo = document.querySelector('#photo');
        [canvas.width, canvas.height] = [photo.naturalWidth, photo.naturalHeight];
        const pen = canvas.getContext('2d');
        pen.drawImage(photo, 0, 0);
        const { data } = pen.getImageData(0, 0, canvas.width, Math.round(0.7 * canvas.height));
        const sums = [0, 0, 0];
        for (let i = 0; i < data.length; i += 4) if (Math.max(data[i], data[i + 1], data[i + 2]) > 150) sums.forEach((_, k) => { sums[k] += data[i + k] / 255; });
        return sums.map(Math.round);
    }"""
    write(page, "OTTO")
    for lamp in ["ring", "color-led"]:
        more(page)
        page.select_option("#lamp", lamp)
        page.keyboard.press("Escape")
        page.click("[name=light-word][value=green]", force=True)
        time.sleep(0.1)
        shown(page)
        red, green, blue = page.evaluate(light)
        assert green > 500 and green > 1.2 * red and green > 1.2 * blue, f"{lamp} in green: {red}, {green}, {blue}"
        page.click("[name=light-word][value=white]", force=True)
        shown(page)


def the_reason_of_not_legible_is_said(hall):
    """Checks that the reason is shown in words and without a number if all letters are legible but the word is not."""
    page, trouble = opened(hall.browser, hall.page, viewport=PHONE)
    ready(page)

    judged_as(page, legible=False, readability=0.5, reason="too_small")
    said = write(page, "HELLO")
    assert "Not everybody could read it." in said and "too small in the photograph" in said, said
    assert not re.search(r"%|0\.5|_", said), said
    assert page.inner_text("#send") == "Send it as it is"
    # The page names the letter that may be misread and its rival, and marks the letter in the
    # photograph.
    for word, reason, rival, want in [("LEO", "unsure", "LEC", "The O could be C."), ("I", "unsure", "l", "A single line could be I, l or 1."),
                                      ("RNA", "other_length", "MA", "It could be read as MA."), ("HAUS", "misread", "MAUS", "The H could be M.")]:
        page.unroute("**/live"), page.unroute("**/photos")
        judged_as(page, legible=False, readability=0.5, reason=reason, rival={"word": rival, "p": 0.4},
                  letters=lambda told: [{**letter, "best": letter["expected"], "rivals": []} for letter in told["letters"]])
        said = write(page, word)
        assert want in said and "small" not in said and "run into" not in said, said
        if len(rival) == len(word) > 1:
            until(page, f"document.querySelector('#marks .wrong b')?.textContent === 'could be {want[-2]}'", "the letter that is marked")
    assert not trouble, trouble


def the_verdict_is_that_of_the_photograph_that_is_kept(hall):
    """The small photograph is illegible and the large one legible. The visitor must not see "no" in between."""
    page, trouble = opened(hall.browser, hall.page, viewport={"width": 1024, "height": 768})
    ready(page)
    page.evaluate("window.said = []; new MutationObserver(() => window.said.push(document.querySelector('#verdict').textContent)).observe(document.querySelector('#verdict'), {childList: true, subtree: true})")
    page.route("**/live", lambda route: route.fulfill(json={**(shot := route.fetch().json()), "verdict": {**shot["verdict"], "legible": False, "readability": 0.2, "reason": "other_length"}}))
    held = []
    page.route("**/photos", lambda route: held.append(route))
    page.fill("#word", "HELLO")
    come(page, held)
    assert page.inner_text("#verdict").startswith("This is how it will look."), page.inner_text("#verdict")
    assert page.get_attribute("#send", "aria-disabled") == "true", "it is not judged yet"
    held[0].continue_()
    assert shown(page).startswith("Reads as HELLO."), page.inner_text("#verdict")
    assert page.get_attribute("#send", "aria-disabled") == "false"
    assert not [said for said in page.evaluate("window.said") if "could" in said], page.evaluate("window.said")
    assert not trouble, trouble


def what_only_directs_a_text_is_in_no_title(hall):
    """Pastes a name with direction marks and overrides, and with spaces of any kind."""
    with tempfile.TemporaryDirectory() as gallery:
        server = Server(PROGRAM, "--gallery", gallery)
        try:
            page, trouble = opened(hall.browser, server.page, viewport=PHONE)
            ready(page)
            said = write(page, "\u202eLO\u00a0\u200dHI\u200b\u2066")
            assert "LO HI" in said or "could" in said, said
            send(page)
            assert page.inner_text("#sent h2") == "LO HI has been sent.", page.inner_text("#sent h2")
            entry = next(Path(gallery).glob("0*/entry.json"))
            assert json.loads(entry.read_text())["title"] == "LO HI", entry.read_text()
            assert not trouble, trouble
        finally:
            server.kill()


def what_another_version_kept_is_left_out_and_it_is_said(hall):
    """Stores a lamp, a color and settings that this version does not know. What it knows must be kept."""
    page, trouble = opened(hall.browser, "about:blank", viewport=PHONE)
    page.goto(hall.page)
    ready(page)
    for kept_state in [{"lamp": "laser", "color": "ultraviolet", "painted": [None] * 4}, {"settings": {"wings.flap": "7", "letters.cap_height_m": "0.6"}},
                       {"settings": {"controller.kind": "psychic", "letters.cap_height_m": "0.6"}}, {"sketch": {"page": 3}, "opened": 7, "wind": 4}]:
        page.evaluate("state => sessionStorage.noctograph = JSON.stringify({...JSON.parse(sessionStorage.noctograph), word: 'NOOR', settings: {}, ...state})", kept_state)
        page.reload()
        ready(page)
        said = shown(page)
        assert said.startswith("Reads as NOOR.") and "from another version. Some of" in said, (kept_state, said)
        until(page, "JSON.parse(sessionStorage.noctograph).word === 'NOOR'")
        if "settings" in kept_state:
            assert kept(page)["settings"] == {"letters.cap_height_m": "0.6"}, "what is known stays"
        said = write(page, "HELLO")
        assert said.startswith("Reads as HELLO.") and "version" not in said, said
    assert not trouble, trouble


def what_is_gone_or_unreadable_is_said_in_a_sentence(hall):
    page, _ = opened(hall.browser, hall.page, viewport=PHONE)
    ready(page)
    judged_as(page, legible=False, read="????", letters=lambda told: [{**letter, "best": None} for letter in told["letters"]])
    said = write(page, "OTTO")
    assert said and "?" not in said, said
    # This is the code of an entry that was withdrawn.
    response = page.goto(f"{hall.page.split('/k/')[0]}/e/{'0' * 32}/")
    until(page, "document.querySelector('#title').textContent.includes('gone')", "that the photograph is gone")
    assert response.status == 404


def letters_have_colors_by_touch(hall):
    page, _ = opened(hall.browser, hall.page)
    ready(page)
    write(page, "OTTO")
    assert page.locator("#marks button").count() == 4
    page.locator("#marks button").nth(1).click()
    shown(page)
    assert kept(page)["painted"] == ["white", "red", "white", "white"]
    page.locator("#marks button").nth(1).focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Enter")
    assert kept(page)["painted"][2] == "red"


# ---------- The replay ----------


def a_large_photograph_stops_no_replay(hall):
    """Starts the replay while the large photograph has arrived and is being decoded."""
    page, trouble = opened(hall.browser, hall.page)
    ready(page)
    write(page, "OTTO")
    page.evaluate("""() => {
        const decode = Image.prototype.decode;
        Image.prototype.decode = async function () {
            await decode.call(this);
            await new Promise(goOn => { window.goOn = goOn; });
        };
    }""")
    until(page, "!!window.goOn", "the large photograph")
    page.click("#replay button")
    until(page, "!document.querySelector('#light').hidden", "the exposure plays")
    page.evaluate("window.goOn()")
    until(page, "document.querySelector('main').dataset.large", "the large photograph hangs")
    assert page.get_attribute("#replay button", "aria-label") == "Pause"
    assert not trouble, trouble


def the_scrubber_exposes_the_photograph_along_the_stroke(hall):
    page, trouble = opened(hall.browser, hall.page)
    ready(page)
    write(page, "OTTO")
    slide = "share => { const range = document.querySelector('#replay input'); range.value = 1000 * share; range.dispatchEvent(new Event('input')); }"
    # These are the bright pixels of the exposure and of the photograph, and those that only one of
    # them has.
    bright = """() => {
        const light = document.querySelector('#light'), photo = document.querySelector('#photo');
        const canvas = Object.assign(document.createElement('canvas'), { width: light.width, height: light.height });
        canvas.getContext('2d').drawImage(photo, 0, 0, canvas.width, canvas.height);
        const [now, whole] = [light, canvas].map(of => of.getContext('2d').getImageData(0, 0, of.width, of.height).data);
        const counts = { now: 0, whole: 0, extra: 0, ghost: 0 };
        let [wall, ghost, n] = [0, 0, 0];
        for (let i = 0; i < now.length; i += 4) {
            const [a, b] = [now[i] > 180 && now[i + 3] > 180, whole[i] > 180];
            counts.now += a; counts.whole += b; counts.extra += a && !b;
            // The future place of the lamp is compared with the wall twenty pixels beside it.
            const j = i + 80;
            if (b && now[i] < 60 && whole[j] < 60 && now[j] < 60) { n += 1; ghost += now[i]; wall += now[j]; }
        }
        counts.ghost = Math.abs(ghost - wall) / n;
        return counts;
    }"""
    exposed = {}
    for share in [0.2, 0.5, 0.9, 0.5001]:
        page.evaluate(slide, share)
        until(page, "!document.querySelector('#light').hidden")
        time.sleep(0.3)
        exposed[share] = page.evaluate(bright)
        exposed[share]["share"] = exposed[share]["now"] / exposed[share]["whole"]
        assert exposed[share]["extra"] < 0.15 * exposed[share]["whole"], f"light that the photograph has not: {exposed}"
        assert share > 0.6 or exposed[share]["ghost"] < 1.5, f"letters that are not yet written are seen: {exposed}"
    shares = [exposed[share]["share"] for share in [0.2, 0.5, 0.9]]
    assert 0.03 < shares[0] < shares[1] - 0.1 and shares[1] < shares[2] - 0.1, f"exposed {shares}"
    assert abs(exposed[0.5001]["share"] - shares[1]) < 0.03, "backward, too"
    page.evaluate(slide, 1)
    assert page.locator("#light").is_hidden(), "all of it is the photograph itself"
    page.click("#replay button")
    until(page, "!document.querySelector('#light').hidden", "the exposure plays")
    page.click("#replay button")
    trouble = [line for line in trouble if "willReadFrequently" not in line]  # this test's own
    assert not trouble, trouble


def a_picture_is_flown_in_its_colors_on_the_ground_of_its_ink_above_the_desk(hall):
    page, trouble = opened(hall.browser, hall.page)
    asked = []
    page.on("request", lambda request: request.url.endswith("/live") and asked.append(request.post_data_json["settings"]))
    ready(page)

    def draw(name, ground, *lines):
        drop(page, f"""async () => {{
            const canvas = Object.assign(document.createElement('canvas'), {{width: 400, height: 600}});
            const pen = canvas.getContext('2d');
            pen.fillStyle = '{ground}'; pen.fillRect(0, 0, 400, 600); pen.lineWidth = 12;
            for (const [color, ...p] of {[list(line) for line in lines]}) {{ pen.strokeStyle = color; pen.beginPath(); pen.moveTo(p[0], p[1]); pen.lineTo(p[2], p[3]); pen.stroke(); }}
            const data = new DataTransfer();
            data.items.add(new File([await new Promise(done => canvas.toBlob(done))], '{name}'));
            return data;
        }}""")
        until(page, f"document.querySelector('#opened-name').textContent === '{name}'")
        return shown(page)

    draw("white.png", "transparent", ["#fff", 60, 60, 340, 540], ["#fff", 340, 60, 60, 540])
    assert asked[-1].get("light.deck") is None, "white light needs no deck of colors"
    draw("child.png", "#fff", ["#d22", 60, 60, 340, 540], ["#1a3fd0", 340, 60, 60, 540])
    until(page, "!document.querySelector('#frame').classList.contains('waits')")
    assert asked[-1].get("light.deck"), f"colors need a deck of colors: {asked[-1]}"
    time.sleep(0.5)  # it has moved to its place
    low = page.evaluate("(() => { const box = document.querySelector('#photo').getBoundingClientRect(); return box.top + box.height * getComputedStyle(frame).getPropertyValue('--low'); })()")
    assert low < page.locator("#verdict strong").bounding_box()["y"], "no light runs under the verdict"
    svg = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><text y="5">Hi</text></svg>'
    drop(page, f"() => {{ const data = new DataTransfer(); data.items.add(new File([{svg!r}], 'text.svg')); return data; }}")
    until(page, "document.querySelector('#verdict').textContent.includes('convert the text to paths')", "why a text is refused")
    assert page.locator("#choose").is_hidden(), "there is nothing to choose from"
    assert not trouble, trouble


def buttons_and_strip_stand_still(hall):
    """Checks that controls keep their place in the states word, unread, pad and sent."""
    for size in [DESK, {"width": 1024, "height": 768}]:
        page, _ = opened(hall.browser, hall.page, viewport=size)
        ready(page)
        place = lambda selector: [round(page.locator(selector).bounding_box()[side]) for side in ("x", "y", "width", "height")]
        judged_as(page, legible=False)
        write(page, "OTTO")
        assert page.inner_text("#send") == "Send it as it is"
        unread = place("#send"), place("#word"), place("#draw")
        page.unroute("**/live"), page.unroute("**/photos")
        write(page, "LO")
        assert (place("#send"), place("#word"), place("#draw")) == unread, size
        word = place("#send")
        page.click("#draw")
        page.wait_for_selector("#pad .cursor", state="attached")
        stroke(page, (0.2, 0.3), (0.7, 0.6))
        until(page, "document.querySelectorAll('#pad .lit').length === 1")
        assert place("#send-drawing") == word, size
        left, corner = page.locator("#left").bounding_box(), page.locator("#pad").bounding_box()
        assert left["y"] >= corner["y"] + corner["height"] and left["height"] < 40, f"the pad's sentence is one line below it: {left}, {corner}"
        page.context.close()


# ---------- The hall: send, approve, wall, take home ----------


def what_is_sent_is_approved_flown_hung_and_taken_home(hall):
    with tempfile.TemporaryDirectory() as gallery:
        server = Server(PROGRAM, "--gallery", gallery, "--network")
        try:
            page, trouble = opened(hall.browser, server.page, viewport=PHONE)
            ready(page)
            write(page, "ANNA")
            send(page)
            assert "ANNA" in page.inner_text("#sent h2")
            page.get_by_text("Take it back").click()
            assert page.input_value("#word") == "ANNA", "what was taken back can be changed"
            shown(page)
            send(page)
            page.reload()
            ready(page)
            page.wait_for_selector("#sent h2")
            assert "ANNA" in page.inner_text("#sent h2"), "it is still sent after a reload"

            wall, wall_trouble = opened(hall.browser, f"{server.page}wall.html", viewport=DESK)
            wall.wait_for_selector("#invite img")
            assert wall.locator("figure img").count() == 0, "nothing hangs that was not approved"
            assert wall.locator("button, a, input").count() == 0, "the wall has no button"
            coming = []
            wall.route("**/wall/*.jpg", lambda route: coming.append(route))

            host, host_trouble = opened(hall.browser, server.operator)
            host.wait_for_selector("#list button")
            assert "ANNA" in host.inner_text("#list")
            host.keyboard.press("a")
            until(host, "document.querySelector('#tabs button:nth-child(2) b').textContent === '1'", what="one approved")
            wall.wait_for_selector("#newest img")
            assert "ANNA" in wall.inner_text("#newest")
            come(wall, coming)
            assert wall.locator("#bare").is_visible(), "the lamp waits until the first photograph is there"
            coming[0].continue_()
            until(wall, "document.querySelector('#bare').hidden", "the photograph in its place")
            wall.unroute("**/wall/*.jpg")
            until(page, "document.querySelector('#sent p').textContent.includes('will be flown')", what="the visitor is told")
            host.keyboard.press("z")
            until(host, "document.querySelector('#tabs button:nth-child(1) b').textContent === '1'", what="an answer is undone")
            until(wall, "document.querySelector('#newest').hidden", "what is no longer approved comes down")
            host.keyboard.press("a")
            host.click("#tabs button:nth-child(2)")
            host.wait_for_selector("[data-do=fly]")
            still = host.locator("[data-do=fly]").bounding_box()
            host.hover("[data-do=fly]")
            assert host.locator("[data-do=fly]").bounding_box() == still, "a button stands still under the pointer"
            host.evaluate(DOUBLE_TAPS)
            until(page, "document.querySelector('#sent p').textContent.includes('flying now')", what="that a double tap is no flown word")
            with host.expect_download() as download:
                host.click("#export")
            archive = zipfile.ZipFile(download.value.path())
            folders = {name.split("/")[0] for name in archive.namelist() if "/" in name}
            assert folders == {"01-ANNA"}, f"the one in the air counts, and is exported: {archive.read('export.json').decode()}"
            until(host, "document.querySelector('#export').textContent.includes('1')", "the export's end")
            assert not host.inner_text("#toast"), f"nothing went wrong: {host.inner_text('#toast')}"
            until(host, "!document.querySelector('.held')", what="keys that are alive again")
            host.locator("#air button").click()
            until(page, "document.querySelector('#sent p').textContent.includes('was flown')", what="flown")
            host.keyboard.press("z")
            until(page, "document.querySelector('#sent p').textContent.includes('flying now')", what="undone")
            until(host, "document.querySelector('[data-do=back-to-approved]') && !document.querySelector('.held')", what="the way back")
            with host.expect_download() as download:
                host.keyboard.press("s")
            assert open(download.value.path(), "rb").read(2) == b"PK", "the script of this one"
            host.keyboard.press("a")
            until(page, "document.querySelector('#sent p').textContent.includes('will be flown')", what="aborted")

            home = kept(page)["sent"]["id"]
            mine, mine_trouble = opened(hall.browser, f"{server.host}/e/{home}/", viewport=PHONE)
            ready(mine)
            assert "ANNA" in mine.inner_text("#title") and mine.locator("#photo").is_visible()
            with mine.expect_download() as download:
                mine.click("#keep")
            assert open(download.value.path(), "rb").read().startswith(b"\x89PNG")
            mine.emulate_media(media="print")
            assert mine.evaluate("[getComputedStyle(document.documentElement), getComputedStyle(document.body)].every(style => style.backgroundColor === 'rgb(255, 255, 255)')"), "the paper around the card is white"
            card = mine.pdf(prefer_css_page_size=True)
            assert len(re.findall(rb"/Type\s*/Page[^s]", card)) == 1, "the card is one page"
            width, height = [float(side) for side in re.search(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) ([\d.]+)", card).groups()]
            assert abs(width - 148 / 25.4 * 72) < 2 and abs(height - 105 / 25.4 * 72) < 2, f"A6, {width} x {height}"
            for name, found in {"visitor": trouble, "wall": wall_trouble, "operator": host_trouble, "home": mine_trouble}.items():
                assert not found, f"{name}: {found}"
        finally:
            server.kill()


def nothing_hangs_that_nobody_approved(hall):
    """On one machine with a projector and without a network, the usual wall also waits for the operator."""
    for flags, hung, rule in [((), 0, "The wall shows what you approve."), (("--kiosk",), 0, "The wall shows what you approve."),
                              (("--open-wall",), 1, "The wall shows at once what is sent.")]:
        server = Server(PROGRAM, *flags)
        try:
            phones = json.loads(urllib.request.urlopen(f"{server.operator}address.json").read())["visitors"]
            page, trouble = opened(hall.browser, phones, viewport=PHONE)
            ready(page)
            consent = page.inner_text("#consent")
            assert ("at once" in consent) == bool(hung), consent
            write(page, "LO")
            send(page)
            wall = json.loads(urllib.request.urlopen(f"{phones}wall").read())["photos"]
            assert len(wall) == hung, (flags, wall)
            host, _ = opened(hall.browser, server.operator)
            host.wait_for_selector("#list button")
            assert host.inner_text("#list .rule") == rule, host.inner_text("#list")
            assert not trouble, trouble
        finally:
            server.kill()


def no_code_leads_to_this_machine_itself(hall):
    """Without a network no phone can reach the machine, so that a sentence with the reason replaces the code."""
    server = Server(PROGRAM, "--kiosk")
    try:
        page, trouble = opened(hall.browser, server.page, viewport=TABLET)
        ready(page)
        page.mouse.click(300, 300)
        write(page, "LO")
        send(page)
        assert page.locator("#sent img").count() == 0 and "Phones cannot reach this machine" in page.inner_text("#sent"), page.inner_text("#sent")
        wall, wall_trouble = opened(hall.browser, f"{server.page}wall.html")
        wall.wait_for_selector("#invite p")
        assert wall.locator("#invite img").count() == 0 and "phone" not in wall.inner_text("#invite"), wall.inner_text("#invite")
        mine, mine_trouble = opened(hall.browser, f"{server.host}/e/{kept(page)['sent']['id']}/", viewport=PHONE)
        ready(mine)
        assert mine.locator("img[src='qr.svg']").count() == 0
        host, host_trouble = opened(hall.browser, server.operator)
        host.click("#show-code")
        host.wait_for_selector("#sheet[open]")
        assert host.locator("#sheet img").count() == 0 and "Phones cannot reach" in host.inner_text("#sheet"), host.inner_text("#sheet")
        for name, found in {"kiosk": trouble, "wall": wall_trouble, "home": mine_trouble, "operator": host_trouble}.items():
            assert not found, f"{name}: {found}"
    finally:
        server.kill()


def the_codes_are_a_sheet_to_print(hall):
    """Checks that visitors, kiosk and wall each have a page with its name, its code, its address and the WLAN."""
    server = Server(PROGRAM, "--network")
    try:
        addresses = json.loads(urllib.request.urlopen(f"{server.operator}address.json").read())
        if not addresses["network"]:
            print("  left out: the sheet of codes (this machine is in no network)")
            return
        host, trouble = opened(hall.browser, server.operator)
        host.click("#show-code")
        host.wait_for_selector("#sheet[open]")
        assert host.locator("#sheet h3").all_inner_texts() == ["Visitors", "Kiosk", "Wall"]
        assert host.locator("#sheet section a").all_inner_texts() == [addresses[of] for of in ("visitors", "kiosk", "wall")]
        host.fill("#sheet input >> nth=0", 'Hall; "7"')
        host.fill("#sheet input >> nth=1", "light,and,dark")
        host.press("#sheet input >> nth=1", "Tab")
        until(host, "document.querySelectorAll('#sheet img').length === 6", "a code of the page and of the WLAN on each card")
        until(host, "[...document.querySelectorAll('#sheet img')].every(code => code.complete && code.naturalWidth)", "the codes")
        asked = bytes.fromhex(host.get_attribute("#sheet .wlan img >> nth=0", "src").split("?")[1]).decode()
        assert asked == 'WIFI:T:WPA;S:Hall\\; \\"7\\";P:light\\,and\\,dark;;', asked
        host.emulate_media(media="print")
        pages = len(re.findall(rb"/Type\s*/Page[^s]", host.pdf(format="A4")))
        assert pages == 3, f"{pages} pages"
        assert not trouble, trouble
    finally:
        server.kill()


def the_operators_header_has_room_in_every_language(hall):
    """Checks that from 1024 px on no button overlaps another one or is cut off."""
    overlaps = """() => {
        const all = [...document.querySelectorAll('header button')].filter(it => it.offsetParent).map(it => {
            const range = document.createRange();
            range.selectNodeContents(it);
            return { name: it.textContent.trim(), box: range.getBoundingClientRect() };
        });
        return all.flatMap(({ name, box }, i) => [
            ...(box.right > innerWidth || box.left < 0 ? [`${name} is cut off`] : []),
            ...all.slice(i + 1).filter(({ box: c }) => box.left < c.right - 1 && c.left < box.right - 1 && box.top < c.bottom && c.top < box.bottom).map(c => `${name} on ${c.name}`),
        ]);
    }"""
    for code in LANGUAGES:
        host, _ = opened(hall.browser, hall.operator, locale=f"{code}-{code.upper()}", viewport={"width": 1024, "height": 768})
        host.wait_for_selector("#tabs button")
        for width in [1024, 1152, 1280, 1366, 1440]:
            host.set_viewport_size({"width": width, "height": 768})
            until(host, f"innerWidth === {width}")
            found = host.evaluate(overlaps)
            assert not found, f"{code} {width}: {found}"
            tall = host.evaluate("document.documentElement.scrollHeight")
            assert tall <= 768, f"{code} {width}: {tall} px on a screen of 768"
        host.context.close()


def an_old_address_opens_a_page_in_the_visitors_language(hall):
    for code, want in {"en": "Scan the code in the hall again.", "de": "Scanne den Code im Saal noch einmal.", "fr": "Scanne de nouveau le code dans la salle.", "es": "Escanea otra vez el código de la sala."}.items():
        context = hall.browser.new_context(locale=f"{code}-{code.upper()}", viewport=PHONE)
        page = context.new_page()
        for path in ["/", f"/k/{'0' * 32}/", f"/k/{'0' * 32}/wall.html"]:
            response = page.goto(hall.page.split("/k/")[0] + path)
            assert response.status == 403 and want in page.inner_text("main"), (code, path, page.inner_text("body"))
            assert page.get_attribute("html", "lang") == code
        context.close()


def nothing_is_done_to_an_entry_that_nobody_looked_at(hall):
    """One operator answers an entry, and then another operator's key for the same entry arrives."""
    server = Server(PROGRAM)
    try:
        page, _ = opened(hall.browser, server.page, viewport=PHONE)
        ready(page)
        for word in ["LO", "IO"]:
            write(page, word)
            send(page, timeout=120_000)
            page.get_by_text("Write another").click()
        hosts = [opened(hall.browser, server.operator)[0] for _ in range(2)]
        for host in hosts:
            host.wait_for_selector("#list li:nth-child(2) button")
        # The key arrives immediately, independently of the speed of the machine.
        hosts[1].evaluate("""() => {
            const list = document.querySelector("#list");
            new MutationObserver((_, watch) => {
                if (!list.innerText.startsWith("IO")) return;
                watch.disconnect();
                document.body.dispatchEvent(new KeyboardEvent("keydown", {key: "r", bubbles: true}));
            }).observe(list, {childList: true, subtree: true});
        }""")
        hosts[0].keyboard.press("a")
        until(hosts[1], "document.querySelector('#list').innerText.startsWith('IO')")
        assert "answered LO" in hosts[1].inner_text("#toast")
        until(hosts[1], "!document.querySelector('.held')", what="keys that are alive again")
        assert hosts[1].inner_text("#tabs button:nth-child(4) b") == "0", "nobody had looked at IO"
        hosts[1].keyboard.press("r")
        until(hosts[1], "document.querySelector('#tabs button:nth-child(4) b').textContent === '1'")
        server.kill()
        until(hosts[0], "document.querySelector('#lost').textContent", "that the connection is lost")
        bar, tabs = hosts[0].locator("#lost").bounding_box(), hosts[0].locator("#tabs").bounding_box()
        assert bar["y"] >= tabs["y"] + tabs["height"], f"{bar} lies over {tabs}"
    finally:
        server.kill()


def a_refusal_is_said_and_the_word_stays(hall):
    """Sends an entry while sending is paused."""
    server = Server(PROGRAM)
    try:
        page, _ = opened(hall.browser, server.page, viewport=PHONE)
        ready(page)
        host, _ = opened(hall.browser, server.operator)
        host.click("#pause")
        until(host, "document.querySelector('#pause').getAttribute('aria-pressed') === 'true'")
        write(page, "OTTO")
        page.click("#send")
        until(page, "document.querySelector('#verdict').textContent.includes('paused')", "that sending is paused")
        assert page.input_value("#word") == "OTTO" and page.locator("#frame").is_visible()
        host.click("#pause")
        until(host, "document.querySelector('#pause').getAttribute('aria-pressed') === 'false'")
        send(page)
    finally:
        server.kill()


def a_queue_of_people_at_one_kiosk_is_not_refused(hall):
    """*Write another* begins a new visitor. A fast queue waits for a moment, and nothing grows."""
    soak(hall.browser, PROGRAM, 8)


def a_phone_with_the_code_of_the_wall_is_no_kiosk(hall):
    server = Server(PROGRAM, "--kiosk")
    try:
        phones = json.loads(urllib.request.urlopen(f"{server.operator}address.json").read())["visitors"]
        phone, trouble = opened(hall.browser, phones, viewport=PHONE)
        ready(phone)
        assert phone.locator("#start").is_hidden(), "a phone begins at the word"
        write(phone, "LO")
        send(phone)
        phone.get_by_text("Keep").first.wait_for()
        assert not trouble, trouble
    finally:
        server.kill()


def the_kiosk_begins_anew_after_a_minute(hall):
    server = Server(PROGRAM, "--kiosk")
    try:
        page, trouble = opened(hall.browser, "about:blank", viewport=TABLET, has_touch=True)
        page.clock.install()
        page.goto(server.page)
        ready(page)
        start = page.locator("#start")
        assert start.is_visible(), "a kiosk begins at its start"
        page.mouse.click(300, 300)
        assert start.is_hidden()
        assert page.locator("#more").is_hidden(), "no settings"
        # No link leads out of the page, and it cannot be zoomed.
        page.evaluate("addEventListener('keydown', event => event.defaultPrevented && event.key !== 'Control' && (window.kept = [...(window.kept ?? []), event.key]))")
        for key in ["Control+p", "Control+s", "Control+o", "Control+u", "F5", "F12", "Alt+ArrowLeft", "Control+a", "b", "Backspace"]:
            page.keyboard.press(key)
        assert (kept_back := page.evaluate("window.kept")) == ["p", "s", "o", "u", "F5", "F12", "ArrowLeft"], kept_back
        assert page.evaluate("[new WheelEvent('wheel', {ctrlKey: true, cancelable: true}), new DragEvent('dragstart', {cancelable: true})].every(event => !dispatchEvent(event))"), "neither wheel nor drag"
        touch = page.context.new_cdp_session(page)
        fingers = lambda kind, *places: touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": 300, "id": k} for k, x in enumerate(places)]})
        fingers("touchStart", 380, 420)
        for step in range(1, 9):
            fingers("touchMove", 380 - 20 * step, 420 + 20 * step)
        fingers("touchEnd")
        assert page.evaluate("visualViewport.scale") == 1, "two fingers enlarge nothing"
        # A visitor who draws one slow line counts as present.
        page.click("#draw")
        page.wait_for_selector("#pad .cursor", state="attached")
        page.mouse.move(*on_pad(page)(0.1, 0.5))
        page.mouse.down()
        for step in range(4):
            page.clock.run_for(25_000)
            page.mouse.move(*on_pad(page)(0.2 + 0.1 * step, 0.5))
        page.mouse.up()
        assert start.is_hidden(), "one slow stroke is no idleness"
        page.click("#undo")
        page.click("#type")
        page.fill("#word", "ANNA")
        page.clock.run_for(2000)
        visitor = kept(page)["visitor"]
        page.clock.run_for(50_000)
        assert re.match(r"Starting over in \d+ seconds\.", page.inner_text("#still")), "it is said before"
        page.click("#still button")
        assert page.locator("#still").is_hidden() and page.input_value("#word") == "ANNA"
        page.clock.run_for(62_000)
        page.wait_for_selector("#start:not([hidden])")
        state = kept(page)
        assert state["word"] == "" and state["visitor"] != visitor, "the next visitor is another one"
        # The next visitor does not see what the previous one left behind.
        start.click()
        page.fill("#word", "A" * 60)
        page.select_option("#language", "de")
        page.clock.run_for(62_000)
        page.wait_for_selector("#start:not([hidden])")
        start.click()
        assert page.get_attribute("html", "lang") == "en" and page.input_value("#language") == "en"
        assert page.inner_text("#verdict").startswith("A drone will write it"), page.inner_text("#verdict")
        assert kept(page)["color"] == "red", "each visitor begins with another color: orange, green, red"
        leads = page.evaluate("[...document.querySelectorAll('a[href]')].map(a => a.href)")
        assert not leads, f"nothing leads out: {leads}"
    finally:
        server.kill()


def what_an_export_refuses_is_named(hall):
    with tempfile.TemporaryDirectory() as gallery:
        server = Server(PROGRAM, "--gallery", gallery)
        page, _ = opened(hall.browser, server.page)
        ready(page)
        write(page, "I")
        send(page)
        host, _ = opened(hall.browser, server.operator)
        host.wait_for_selector("[data-do=approve]")
        host.keyboard.press("a")
        until(host, "document.querySelector('#tabs button:nth-child(2) b').textContent === '1'", what="one approved")
        server.kill()
        # In this scene, somebody stands where the word is flown.
        scene = Path(gallery, "people.toml")
        scene.write_text("sensors.lighthouse.people_m = [[0.0, 0.0, 0.5]]\n")
        server = Server(PROGRAM, "--gallery", gallery, "--scene", str(scene))
        try:
            host, _ = opened(hall.browser, server.operator)
            host.click("#tabs button:nth-child(2)")
            with host.expect_download():
                host.click("#export")
            host.wait_for_selector("#sheet[open]")
            said = host.inner_text("#sheet")
            assert "1: It is not safe to fly. People are too close." in said, said
        finally:
            server.kill()


def a_wall_whose_server_was_restarted_hangs_on(hall):
    with tempfile.TemporaryDirectory() as gallery:
        server = Server(PROGRAM, "--gallery", gallery, "--open-wall")
        page, _ = opened(hall.browser, server.page)
        ready(page)
        wall, _ = opened(hall.browser, "about:blank", reduced_motion="reduce")
        wall.clock.install()
        wall.goto(f"{server.page}wall.html")
        for word in ["ANNA", "OTTO"]:
            write(page, word)
            send(page)
            page.get_by_text("Write another").click()
            until(wall, f"document.querySelector('#wall img[alt^={word}]')", what=f"{word} on the wall")
        assert "ANNA" in wall.inner_text("#newest"), "the newest hangs for a minute before the next one takes its place"
        for word in ["OTTO", "ANNA"]:
            wall.clock.fast_forward(61_000)
            until(wall, f"document.querySelector('#newest').innerText.includes('{word}')", what="all hang large, one after the other")
        wall.set_viewport_size({"width": 1920, "height": 1080})
        sizes = wall.evaluate("[...document.querySelectorAll('figcaption, small')].map(line => parseFloat(getComputedStyle(line).fontSize))")
        assert min(sizes) >= 28, f"read from five meters: {sizes} px"
        assert wall.inner_text("#older") == "OTTO", "a small photograph has its name"
        server.kill()
        until(wall, "document.querySelector('#lost').textContent", "the wall notices")
        assert wall.evaluate("getComputedStyle(document.querySelector('#lost')).fontSize") == "0px", "the hall sees a dot"
        again = Server(PROGRAM, "--gallery", gallery, "--open-wall")
        try:
            until(wall, "!document.querySelector('#lost').textContent && document.querySelectorAll('figure img').length === 2", "the wall after the restart")
            host, _ = opened(hall.browser, again.operator)
            host.wait_for_selector("#tabs button")
            # An entry that is taken down disappears from the wall.
            host.click("#tabs button:nth-child(1)")
            host.wait_for_selector("#list button")
            host.keyboard.press("r")
            until(wall, "document.querySelectorAll('figure img').length === 1", "one of two")
        finally:
            again.kill()


def an_empty_evening_shows_what_comes(hall):
    """The start screen and the wall show three photographs one after another, until the first of the evening is
    approved."""
    server = Server(PROGRAM, "--kiosk", "--open-wall")
    try:
        pages = [opened(hall.browser, "about:blank", viewport=size) for size in (TABLET, DESK)]
        for (page, _), address, box in zip(pages, (server.page, f"{server.page}wall.html"), ("#start .show", "#bare")):
            page.clock.install()
            page.goto(address)
            seen = set()
            for n in range(1, 5):
                photo = until(page, f"document.querySelector('{box} canvas:not([hidden])')?.parentElement.querySelector('img').src", f"photograph {n} that is written")
                seen.add(photo)
                page.clock.fast_forward(14_500)
                until(page, f"document.querySelector('{box} img').src !== {photo!r}", f"the one after photograph {n}")
            assert len(seen) == 3, f"{len(seen)} photographs"
            assert page.locator("figure img").count() == 0, "nothing hangs yet"
        phone, _ = opened(hall.browser, json.loads(urllib.request.urlopen(f"{server.operator}address.json").read())["visitors"], viewport=PHONE)
        ready(phone)
        write(phone, "LO")
        send(phone)
        (start, _), (wall, _) = pages
        until(start, "document.querySelector('#start .show img')?.alt === 'LO'", "the evening's photograph at the start")
        until(wall, "document.querySelector('#bare').hidden && document.querySelector('#newest img')", "the evening's photograph on the wall")
        assert not [said for _, trouble in pages for said in trouble], pages
    finally:
        server.kill()


def a_phone_counts_down_to_its_flight_and_runs_it_live(hall):
    """Checks the countdown on the page that sent the entry, and on the entry's page."""
    server = Server(PROGRAM)
    try:
        ids = []
        for word in ["LO", "IO"]:
            page, trouble = opened(hall.browser, server.page, viewport=PHONE)
            ready(page)
            write(page, word)
            send(page)
            ids.append(kept(page)["sent"]["id"])
        mine, mine_trouble = opened(hall.browser, f"{server.host}/e/{ids[1]}/", viewport=PHONE)
        ready(mine)
        for phone, clock in [(page, "#sent [role=timer]"), (mine, "#clock")]:
            said = until(phone, f"document.querySelector('{clock}').textContent")
            assert re.fullmatch(r"Take-off in about 1:\d\d min.", said), said
            until(phone, f"document.querySelector('{clock}').textContent !== {said!r}", "another second")
            phone.evaluate("navigator.vibrate = (ms) => { window.felt = ms; }")
        host, _ = opened(hall.browser, server.operator)
        host.wait_for_selector("#list button")
        for n, id in enumerate(ids):
            for act in ["approve", "fly"] if n else ["approve", "fly", "flown"]:
                host.evaluate("([id, act]) => import('./ask.js').then(({ post }) => post(`entries/${id}`, { do: act }))", [id, act])
        begun = time.monotonic()
        flight_s = json.loads(urllib.request.urlopen(f"{server.host}/e/{ids[1]}/entry.json").read())["flight_s"]
        for phone, clock in [(page, "#sent [role=timer]"), (mine, "#clock")]:
            until(phone, "window.felt && document.querySelector('#replay button').getAttribute('aria-label') === 'Pause'", "take-off")
            assert not phone.inner_text(clock), phone.inner_text(clock)
            share = lambda: int(phone.input_value("#replay input")) / 1000
            while time.monotonic() - begun < 4:
                phone.wait_for_timeout(50)
            assert abs(share() - (time.monotonic() - begun) / flight_s) < 1.5 / flight_s, (share(), time.monotonic() - begun, flight_s)
        # A visitor who looks later sees the current state.
        late, _ = opened(hall.browser, f"{server.host}/e/{ids[1]}/", viewport=PHONE)
        until(late, "document.querySelector('#replay button')?.getAttribute('aria-label') === 'Pause'")
        assert int(late.input_value("#replay input")) / 1000 > 3.5 / flight_s, late.input_value("#replay input")
        assert not trouble and not mine_trouble, (trouble, mine_trouble)
    finally:
        server.kill()


# Variables of a script's log, and columns of a flight.
LOGGED = {"stateEstimate.x": "x_m", "stateEstimate.y": "y_m", "stateEstimate.z": "z_m",
          "ctrltarget.x": "x_design_m", "ctrltarget.y": "y_design_m", "ctrltarget.z": "z_design_m"}


def log_of(word):
    """Returns the lines of the log that a script writes of the simulated flight of a word."""
    with tempfile.TemporaryDirectory() as folder:
        for line in (f"plan {word} -o plan.csv", "fly plan.csv -o flight.csv"):
            subprocess.run([Path(PROGRAM).resolve(), *line.split()], cwd=folder, check=True, capture_output=True)
        lines, lamp, due = [{"noctograph": {"word": word, "firmware": "2026.08"}}], None, 0.0
        for row in csv.DictReader(open(Path(folder, "flight.csv"))):
            at = {"time": round(1000 * float(row["time_s"]))}
            if row["light.headlights"] != lamp:
                lamp = row["light.headlights"]
                lines.append({**at, "light.headlights": float(lamp)})
            if float(row["time_s"]) >= due:
                due += 0.02
                lines.append({**at, **{name: float(row[column]) for name, column in LOGGED.items()}})
    return [json.dumps(line) + "\n" for line in [*lines, {"end": True}]]


def flown(path, lines, goes_on):
    """Writes half of the light of a log at once, then single samples, and the rest when the flight continues."""
    changes = [n for n, line in enumerate(lines) if "headlights" in line]
    half = changes[len(changes) // 2]

    def write():
        with open(path, "x", buffering=1) as file:
            file.write("".join(lines[:half]))
            rest = iter(lines[half:])
            while not goes_on.wait(0.5):
                file.write(next(rest))
            file.write("".join(rest))
    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    return thread


# Returns the brightness of a photograph that the server sends for the wall.
BRIGHT = """selector => {
    const image = document.querySelector(selector), pen = new OffscreenCanvas(96, 54).getContext("2d");
    if (!image?.complete || !image.naturalWidth) return 0;
    pen.drawImage(image, 0, 0, 96, 54);
    return pen.getImageData(0, 0, 96, 54).data.reduce((sum, value, n) => sum + (n % 4 < 3 ? value : 0), 0);
}"""


def a_flight_is_shown_as_it_is_written_and_its_photograph_is_kept(hall):
    """The operator starts the script; its log grows in the folder that the server watches."""
    with tempfile.TemporaryDirectory() as gallery, tempfile.TemporaryDirectory() as flights:
        lines = log_of("LO")
        # This log belongs to another evening.
        Path(flights, "LO_flight.jsonl").write_text("".join(lines))
        begin = lambda: Server(PROGRAM, "--network", "--gallery", gallery, "--flights", flights)
        server = begin()
        try:
            page, trouble = opened(hall.browser, server.page, viewport=PHONE)
            ready(page)
            write(page, "LO")
            send(page)
            home = kept(page)["sent"]["id"]
            mine, mine_trouble = opened(hall.browser, f"{server.host}/e/{home}/", viewport=PHONE)
            ready(mine)
            wall, wall_trouble = opened(hall.browser, f"{server.page}wall.html", viewport=DESK)
            wall.wait_for_selector("#invite p")
            host, host_trouble = opened(hall.browser, server.operator)
            host.wait_for_selector("#list button")
            told = lambda text: until(host, f"document.querySelector('#flights').innerText.includes({text!r})", what=text)

            # An entry that nobody has approved is not shown, and the operator is notified. Neither is a file that is not a log.
            Path(flights, "01-LO").mkdir()
            path = Path(flights, "01-LO", "LO_flight.jsonl")
            goes_on = threading.Event()
            flight = flown(path, lines, goes_on)
            told("01-LO/LO_flight.jsonl writes LO, which is neither in the air nor approved.")
            Path(flights, "notes.jsonl").write_text("[1]\n")
            told("notes.jsonl cannot be shown")
            assert wall.locator("figure img").count() == 0, "nothing hangs that nobody approved"

            # From then on, the wall shows it beside the preview.
            host.keyboard.press("a")
            until(wall, "document.querySelector('.pair .side:nth-child(2) img[src*=live]')", "the light on the wall")
            said = wall.inner_text("#newest")
            assert re.search(r"promised 0\.\d+", said) and "flying now" in said and "LO" in said, said
            assert wall.evaluate("document.querySelector('.pair img').src").endswith(".jpg"), "what was promised"
            light = lambda side: wall.evaluate(BRIGHT, f".pair .side:nth-child({side}) img")

            def shines(least, most):
                """Waits until the flown photograph has as much of the promised one's light."""
                begun = time.monotonic()
                while not least < (part := light(2) / max(light(1), 1)) < most:
                    assert time.monotonic() < begun + PATIENCE_S, f"{part} of the light"
                    time.sleep(0.05)
            shines(0.3, 0.8)
            Path(flights, "LO_flight-2.jsonl").write_text("".join(lines[:-1]))
            told("LO_flight-2.jsonl comes after the flight that is shown.")
            if picture := os.environ.get("NOCTOGRAPH_PICTURES"):
                wall.screenshot(path=f"{picture}/flying.png")
            found = axe(wall) + axe(host)
            goes_on.set()
            flight.join()
            until(wall, "document.querySelector('#newest').innerText.includes('flown 0.')", "the end of the flight")
            shines(0.9, 1.1)
            if picture:
                wall.screenshot(path=f"{picture}/flown.png")

            assert not (found := found + axe(wall)), found
            # The visitor can keep it, and both photographs are in the folder of the entry.
            until(mine, "document.querySelector('#keep').textContent === 'Keep the flown photograph'")
            assert re.search(r"Promised 0\.\d+, flown 0\.\d+\.", mine.inner_text("#state")), mine.inner_text("#state")
            until(mine, "document.querySelector('#photo').src.endsWith('/flown-1.jpg')")
            with mine.expect_download() as download:
                mine.click("#keep")
            entry = next(Path(gallery).glob("*-LO"))
            own = Path(download.value.path()).read_bytes()
            assert own == Path(entry, "flown-1.png").read_bytes()
            expose = [PROGRAM, "expose", str(path), "--scene", str(entry / "scene.toml"), "--backend", "cpu", "-o", f"{flights}/exposed.png"]
            subprocess.run(expose, check=True, capture_output=True)
            assert own == Path(flights, "exposed.png").read_bytes(), "the photograph of `expose`"
            with mine.expect_download() as download:
                mine.get_by_text("Keep the promised one").click()
            assert Path(download.value.path()).read_bytes() == Path(entry, "photo.png").read_bytes()
            assert not (found := axe(mine)), found

            # The second log has no end mark. The flight counts as over 20 s after its last line.
            told("LO_flight-2.jsonl ended early.")
            until(mine, "document.querySelector('#photo').src.endsWith('/flown-2.jpg')", "the second flight")
            host.click("#tabs button:nth-child(2)")
            host.wait_for_selector("[data-do=fly]")
            assert "Flown photograph" in host.inner_text(".facts"), host.inner_text(".facts")
            for name, found in {"visitor": trouble, "wall": wall_trouble, "operator": host_trouble, "home": mine_trouble}.items():
                assert not found, f"{name}: {found}"
            server.kill()
            server = begin()
            until(wall, "!document.querySelector('#lost').textContent && document.querySelector('#newest').innerText.includes('flown 0.')", "both after a kill")
            # The folder disappears, and is created again.
            host, _ = opened(hall.browser, server.operator)
            shutil.move(flights, f"{flights}-gone")
            told("The folder of flights cannot be read")
            shutil.move(f"{flights}-gone", flights)
            until(host, "!document.querySelector('#flights').innerText", "the folder again")
        finally:
            server.kill()


def more_has_two_levels(hall):
    """Saving and opening come first. *How it flies* is folded, and stays open once it was opened."""
    page, trouble = opened(hall.browser, hall.page)
    ready(page)
    write(page, "HI")
    until(page, "document.querySelector('main').dataset.large", "the large photograph")
    page.click("#more")
    page.wait_for_selector("#drawer .files button")
    tops = [page.locator(f"#drawer {part}").bounding_box()["y"] for part in (".files", ".file", ".of-shot", ".how")]
    assert tops == sorted(tops), tops
    assert page.locator("#drawer .how :is(select, input)").first.is_hidden()
    page.click("#drawer .how > summary")
    assert page.locator("#drawer .how select").first.is_visible()
    page.keyboard.press("Escape")
    page.click("#more")
    page.locator("#drawer .how select").first.wait_for(state="visible", timeout=5000)
    assert not trouble, trouble


def the_strip_is_seen_at_200_percent(hall):
    """Checks the usual screens and a phone in landscape format. The colors are in one row."""
    for width, height in [(1440, 900), (1366, 768), (1280, 800), (1280, 720), (1024, 768), (1688, 780)]:
        for code in LANGUAGES:
            page, _ = opened(hall.browser, hall.page, locale=f"{code}-{code.upper()}", viewport={"width": width // 2, "height": height // 2})
            ready(page)
            write(page, "HI")
            strip, stage = page.locator("#replay .strip").bounding_box(), page.locator(".stage").bounding_box()
            assert strip["y"] + strip["height"] <= height / 2 and strip["width"] > 100, (code, width, strip)
            assert stage["height"] > 80, (code, width, stage)
            tops = page.evaluate("[...document.querySelectorAll('#lights label')].map(it => it.getBoundingClientRect().top)")
            assert len(set(tops)) == 1, (code, width, tops)
            page.context.close()


def the_brand_is_the_makers(hall):
    with tempfile.TemporaryDirectory() as brand:
        Path(brand, "brand.toml").write_text('title = "Night of the Open Hall"\n[sentence]\nen = "Lamps that fly."\nde = "Lampen, die fliegen."\n[consent]\nen = "Shown tonight, gone tomorrow."\n')
        Path(brand, "logo.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 60 20"><circle cx="10" cy="10" r="8" fill="#9ec1ff"/></svg>')
        server = Server(PROGRAM, "--kiosk", "--brand", brand)
        try:
            page, trouble = opened(hall.browser, server.page, locale="de-DE", viewport=TABLET)
            ready(page)
            assert "Lampen, die fliegen." in page.inner_text("#start")
            page.mouse.click(300, 300)
            assert page.title() == "Night of the Open Hall"
            assert page.get_attribute(".brand img", "alt") == "Night of the Open Hall"
            assert page.evaluate("document.querySelector('.brand img').naturalWidth") > 0, "the logo is seen"
            assert page.inner_text("#consent") == "Shown tonight, gone tomorrow.", "a sentence without the language is the English one"
            assert not trouble, trouble
        finally:
            server.kill()


# ---------- Access ----------


def states(browser, server):
    """Yields the name and the page of every state of every role."""
    def visitor(**options):
        page, _ = opened(browser, server.page, **options)
        return ready(page)
    twice = {"width": DESK["width"] // 2, "height": DESK["height"] // 2}  # enlarged to 200 %
    for size, scheme in [(PHONE, "light"), (TABLET, "dark"), (DESK, "dark"), (twice, "dark")]:
        wide = f"{size['width']} {scheme}"
        page = visitor(viewport=size, color_scheme=scheme)
        yield f"empty {wide}", page
        write(page, "OTTO")
        yield f"word {wide}", page
        page.fill("#word", "🦉")
        until(page, "document.querySelector('#frame').hidden")
        yield f"unwritable {wide}", page
        page.fill("#word", "OTTO")
        shown(page)
        more(page)
        yield f"drawer {wide}", page
        page.keyboard.press("Escape")
        page.click("#draw")
        page.wait_for_selector("#pad .cursor", state="attached")
        stroke(page, (0.2, 0.3), (0.7, 0.6))
        until(page, "document.querySelectorAll('#pad .lit').length === 1")
        yield f"pad {wide}", page
        page.click("#type")
        drop_sheet(page)
        page.click("#choose")
        until(page, "document.querySelectorAll('#picture path[data-n]').length === 2")
        yield f"picture {wide}", page
        page.click("#opened-close")
        write(page, "ANNA")
        send(page)
        yield f"sent {wide}", page
        number = kept(page)["sent"]["id"]
        page.context.close()
        for name, address in {"home": f"{server.host}/e/{number}/", "operator": server.operator, "wall": f"{server.page}wall.html"}.items():
            other, _ = opened(browser, address, viewport=size, color_scheme=scheme)
            other.wait_for_selector({"home": "#acts button", "operator": "#list button", "wall": "#invite p"}[name])
            yield f"{name} {wide}", other
            if name == "operator":
                other.locator("#show-code").evaluate("button => button.click()")  # a phone has none
                other.wait_for_selector("#sheet[open]")
                yield f"codes {wide}", other
            other.context.close()


def kiosk_states(browser, server):
    page, _ = opened(browser, "about:blank", viewport=TABLET)
    page.clock.install()
    page.goto(f"{server.page}?keyboard")
    ready(page)
    yield "start", page
    page.mouse.click(300, 300)
    page.wait_for_selector(".keyboard button")
    for letter in "LO":
        page.locator(".keyboard").get_by_text(letter, exact=False).first.click()
    assert page.input_value("#word") == "Lo", "a name begins with a capital"
    yield "keyboard", page
    page.fill("#word", "ANNA")
    page.clock.run_for(2000)
    page.clock.run_for(50_000)
    page.wait_for_selector("#still:not([hidden])")
    yield "still there", page


def axe(page):
    """Returns the problems that axe-core finds on a page."""
    if not AXE:
        return []
    page.emulate_media(reduced_motion="reduce")  # colors that change have changed
    page.evaluate(AXE)
    return page.evaluate("async () => (await axe.run(document, {resultTypes: ['violations']})).violations.map(v => `${v.id}: ${v.nodes.map(n => n.html.slice(0, 120)).join(' | ')}`)")


def every_state_is_accessible_and_its_targets_are_large(hall):
    """Checks that axe-core finds nothing, no touch target is smaller than 44 px, and nothing overflows."""
    small = """() => [...document.querySelectorAll('button, a[href], select, input:not([type=hidden]), .lights label')].filter(e => {
        // The target of a touch in a photograph is as large as its letter. A hidden input is touched by its label.
        if (e.closest('#marks') || e.matches('.sr, .lights input')) return false;
        const box = e.getBoundingClientRect();
        return box.width > 0 && (box.width < 43.9 || box.height < 43.9 || box.left < -1 || box.right > innerWidth + 1) && e.checkVisibility();
    }).map(e => `${e.outerHTML.slice(0, 90)} ${Math.round(e.getBoundingClientRect().width)} x ${Math.round(e.getBoundingClientRect().height)}`)"""
    faults = []
    with tempfile.TemporaryDirectory() as gallery:
        server, kiosk = Server(PROGRAM, "--gallery", gallery), Server(PROGRAM, "--kiosk")
        try:
            for name, page in chain(states(hall.browser, server), kiosk_states(hall.browser, kiosk)):
                found = page.evaluate(small)
                faults += [f"{name}: a target is small, or outside: {target}" for target in found]
                wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
                if wide[0] > wide[1]:
                    faults.append(f"{name}: {wide[0]} px on a screen of {wide[1]}")
                faults += [f"{name}: {fault}" for fault in axe(page)]
        finally:
            server.kill()
            kiosk.kill()
    assert not faults, "\n".join(faults)


def swatches_are_one_tab_stop_and_seen_in_forced_colors(hall):
    page, _ = opened(hall.browser, hall.page, forced_colors="active")
    ready(page)
    page.focus("#word")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.value") == "white"
    page.keyboard.press("ArrowRight")
    assert kept(page)["color"] == "red"
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "draw", "one tab stop"
    border = page.evaluate("getComputedStyle(document.querySelector('.lights span')).borderTopStyle")
    assert border == "solid", "white is seen on white"


def arabic_runs_from_right_to_left(hall):
    table = (Path(__file__).parent / "fixtures/words-ar.json").read_text()
    page, trouble = opened(hall.browser, "about:blank", viewport=PHONE)
    page.route("**/words/ar*.json", lambda route: route.fulfill(body=table, content_type="application/json"))
    page.add_init_script("sessionStorage.noctograph ??= JSON.stringify({language: 'ar'})")
    page.goto(hall.page)
    ready(page)
    assert page.get_attribute("html", "dir") == "rtl"
    write(page, "OTTO")
    left = lambda selector: page.locator(selector).bounding_box()["x"]
    assert left(".lights[data-of=word]") > left("#draw"), "the colors begin at the right"
    assert left("#replay button") < left("#replay .strip"), "time runs from left to right"
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert not trouble, trouble


def field_and_photograph_are_seen_together_on_small_screens(hall):
    """Checks a phone in landscape format with its keyboard on the screen, and 200 % zoom."""
    for size in [{"width": 844, "height": 390}, {"width": 390, "height": 420}, {"width": 720, "height": 450}]:
        page, _ = opened(hall.browser, hall.page, viewport=size)
        ready(page)
        write(page, "OTTO")
        for selector in ["#word", "#send", "#photo", "#consent"]:
            box = page.locator(selector).bounding_box()
            inside = min(size["height"], box["y"] + box["height"]) - max(0, box["y"])
            assert inside > 0.45 * box["height"] and inside >= min(40, box["height"]), f"{selector} on {size}: {box}"
        field, photo = page.locator("#word").bounding_box(), page.locator(".stage").bounding_box()
        apart = field["y"] >= photo["y"] + photo["height"] - 1 or field["x"] >= photo["x"] + photo["width"] - 1
        assert apart, f"the field covers the photograph on {size}"
        page.context.close()


def without_motion_the_photograph_is_simply_there(hall):
    page, _ = opened(hall.browser, hall.page, reduced_motion="reduce")
    ready(page)
    write(page, "OTTO")
    page.click("#replay button")
    assert page.locator("#light").is_hidden()
    moving = page.evaluate("document.getAnimations().length")
    assert moving == 0, f"{moving} animations"


def the_first_load_is_small_and_asks_nobody_else(hall):
    sizes = {}
    page, trouble = opened(hall.browser, "about:blank", viewport=PHONE)
    page.on("response", lambda response: sizes.__setitem__(response.url, len(response.body())) if response.ok and "news" not in response.url else None)
    page.goto(hall.page)
    ready(page)
    total = sum(sizes.values())
    assert total <= 100_000, f"{total} bytes: {sorted(sizes.items(), key=lambda item: -item[1])[:8]}"
    policy = urllib.request.urlopen(hall.page).headers["Content-Security-Policy"]
    assert "unsafe" not in policy.replace("'wasm-unsafe-eval'", "") and "default-src 'none'" in policy, policy
    print(f"  first load {total} bytes in {len(sizes)} requests")


class Hall:
    pass


def main():
    tests = [test for name, test in globals().items() if callable(test) and "hall" in getattr(getattr(test, "__code__", None), "co_varnames", ())[:1]]
    hall, failed = Hall(), 0
    with sync_playwright() as playwright:
        hall.browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        server = Server(PROGRAM)
        hall.page, hall.operator = server.page, server.operator
        try:
            for test in tests:
                if CHOSEN and test.__name__ not in CHOSEN or tests.index(test) % PARTS != PART - 1:
                    continue
                begun = time.monotonic()
                try:
                    test(hall)
                    print(f"ok    {test.__name__} ({time.monotonic() - begun:.1f} s)", flush=True)
                except Exception as error:
                    failed += 1
                    print(f"FAIL  {test.__name__}: {error}", flush=True)
                for context in hall.browser.contexts:
                    context.close()
        finally:
            server.kill()
            hall.browser.close()
    if not AXE:
        print("skipped: axe-core (no npm here)")
    sys.exit(failed > 0)


main()
