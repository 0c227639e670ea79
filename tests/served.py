"""The page at home in Chromium: tests/served.py NOCTOGRAPH

Words, drawings, files, advice, settings and downloads, by keyboard and by pointer."""

import re
import sys

from browser import *

STAR = "M50 5 L61 39 L97 39 L68 60 L79 95 L50 73 L21 95 L32 60 L3 39 L39 39 Z"
SVG = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><path d="{STAR}" fill="none" stroke="red"/></svg>'


def large(page):
    """Waits for the large photograph of what is shown."""
    until(page, "document.querySelector('main').dataset.large", 60, "the large photograph")


def more(page):
    page.click("#more")
    page.wait_for_selector("#drawer[open]")


def flight_s(page):
    return int(re.search(r"(\d+) second", page.inner_text("#left") or page.inner_text("#verdict")).group(1))


def drop(page, files):
    page.dispatch_event("body", "drop", {"dataTransfer": page.evaluate_handle(files)})


def types_reads_and_downloads(browser, url):
    page, trouble = opened(browser, url, viewport={"width": 1280, "height": 900})
    ready(page)
    # By keyboard alone: the word has the focus, and Tab reaches every control.
    until(page, "document.activeElement.id === 'word'")
    page.evaluate("new PerformanceObserver(list => window.shift = (window.shift ?? 0) + list.getEntries().reduce((sum, entry) => sum + (entry.hadRecentInput ? 0 : entry.value), 0)).observe({type: 'layout-shift', buffered: true})")
    page.keyboard.type("RIGA", delay=120)
    until(page, "document.querySelector('#photo').alt.includes('RIGA')")
    assert shown(page).startswith("Reads as RIGA."), page.inner_text("#verdict")
    large(page)
    assert page.evaluate("window.shift ?? 0") < 0.1, "the page moves while the photograph arrives"
    reached = set()
    for _ in range(14):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id || document.activeElement.name || document.activeElement.className"))
    assert {"language", "more", "light-word", "draw", "send", "word"} <= reached, reached

    more(page)
    until(page, "document.querySelectorAll('#drawer .files button').length === 4")
    assert page.locator("#drawer .letters li").count() == 4
    for name, begins in {"photo.png": b"\x89PNG", "plan.svg": b"<svg", "report.html": b"<!doctype", "flight.zip": b"PK"}.items():
        with page.expect_download(timeout=60_000) as download:
            page.click(f"[data-file='{name}']")
        assert open(download.value.path(), "rb").read().startswith(begins), name
    before = page.get_attribute("main", "data-shown")
    page.focus("[data-key='letters.cap_height_m']")
    page.keyboard.press("ArrowRight")
    until(page, f"document.querySelector('main').dataset.shown !== {before!r}")
    assert "0.55 m" in page.inner_text("label:has([data-key='letters.cap_height_m'])")
    names = page.evaluate("[...document.querySelectorAll('input, select, button, #pad')].filter(e => !(e.labels?.length || e.textContent || e.getAttribute('aria-label'))).map(e => e.outerHTML)")
    assert not names, f"controls without a name: {names}"
    page.keyboard.press("Escape")
    # What was set is there after a reload.
    page.reload()
    ready(page)
    assert kept(page)["settings"] == {"letters.cap_height_m": "0.55"}
    assert not trouble, trouble


def a_refused_script_is_no_file(browser, url):
    """A word that is too large for its room: the button is off, and the reason stands beside it."""
    page, trouble = opened(browser, url)
    ready(page)
    write(page, "HELLO")
    more(page)
    page.select_option("#room", "4x3x2.5")
    page.evaluate("const range = document.querySelector(\"[data-key='letters.cap_height_m']\"); range.value = 1.2; range.dispatchEvent(new Event('input'))")
    until(page, "document.querySelector('#drawer [data-file=\"flight.zip\"]')?.getAttribute('aria-disabled') === 'true' || document.querySelector('#photo').hidden || document.querySelector('#frame').hidden", 90, "a script that is refused")
    if page.locator("#frame").is_visible():
        assert page.locator("#drawer .stop").first.inner_text()
    page.keyboard.press("Escape")
    assert page.get_attribute("#send", "aria-disabled") == "true"
    assert not trouble, trouble


def draws_and_drops(browser, url):
    page, trouble = opened(browser, url, viewport={"width": 1280, "height": 900})
    ready(page)
    page.click("#draw")
    page.wait_for_selector("#pad .cursor", state="attached")
    stroke(page, (0.3, 0.8), (0.3, 0.2), (0.6, 0.8), (0.6, 0.2))
    until(page, "document.querySelectorAll('#pad .lit').length === 1")
    slow = flight_s(page)
    more(page)
    before = page.get_attribute("main", "data-shown")
    page.select_option("#pace", "even")
    until(page, f"document.querySelector('main').dataset.shown !== {before!r}")
    page.keyboard.press("Escape")
    assert flight_s(page) < slow, f"{flight_s(page)} s evenly, {slow} s at the speed of the pen"

    # A second stroke in another color.
    page.click("[name=light-pad][value=red]", force=True)
    stroke(page, (0.7, 0.8), (0.7, 0.2))
    assert [line["color"] for line in strokes(page)] == ["white", "red"]
    until(page, "document.querySelectorAll('#pad .lit').length === 2")

    # An SVG file, by its name, and away again.
    drop(page, f"() => {{ const data = new DataTransfer(); data.items.add(new File([{SVG!r}], 'star.svg')); return data; }}")
    until(page, "document.querySelector('#opened-name').textContent === 'star.svg'")
    shown(page)

    # A picture of a cross, larger than what is sent; it can be followed as a drawing or a photograph.
    before = page.get_attribute("main", "data-shown")
    drop(page, """async () => {
        const canvas = Object.assign(document.createElement('canvas'), {width: 3000, height: 1500});
        const pen = canvas.getContext('2d');
        pen.fillStyle = '#ddd'; pen.fillRect(0, 0, 3000, 1500);
        pen.lineWidth = 40; pen.strokeStyle = '#222';
        pen.moveTo(500, 300); pen.lineTo(2500, 1200); pen.moveTo(500, 1200); pen.lineTo(2500, 300); pen.stroke();
        const data = new DataTransfer();
        data.items.add(new File([await new Promise(done => canvas.toBlob(done))], 'cross.png'));
        return data;
    }""")
    until(page, f"document.querySelector('main').dataset.shown !== {before!r}")
    assert page.locator("#opened-as").is_visible()

    # A file that is none: a sentence, and no photograph.
    drop(page, "() => { const data = new DataTransfer(); data.items.add(new File(['x'], 'me.jpg')); return data; }")
    until(page, "document.querySelector('#verdict').textContent.includes('me.jpg')")
    assert page.locator("#frame").is_hidden()
    assert not trouble, trouble


def takes_advice(browser, url):
    """The team's flight, fast and in a lit room, does not read; a button mends it."""
    page, trouble = opened(browser, url, viewport={"width": 1280, "height": 900})
    ready(page)
    write(page, "MILCH")
    more(page)
    page.select_option("[data-key='photo.ambient_cd_m2']", "1")
    page.evaluate("const range = document.querySelector(\"[data-key='plan.stroke_speed_m_s']\"); range.value = 0.8; range.dispatchEvent(new Event('input'))")
    until(page, "document.querySelector('#drawer .advice button')", 90, "advice")
    percent = lambda: int(re.search(r": (\d+) of", page.inner_text("#drawer .read")).group(1))
    before = percent()
    advice = page.locator("#drawer .advice button").first
    assert not re.search(r"--set|[a-z]+\.[a-z]+_|scene", advice.inner_text()), f"advice in words: {advice.inner_text()}"
    shown_before = page.get_attribute("main", "data-shown")
    advice.click()
    until(page, f"document.querySelector('main').dataset.shown !== {shown_before!r}", 60)
    page.keyboard.press("Escape")
    more(page)
    assert percent() > before, f"{before} of 100 before the advice, {percent()} after it"
    assert not trouble, trouble


with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
    server, team = Server(sys.argv[1]), Server(sys.argv[1], "--scene", "team")
    try:
        types_reads_and_downloads(browser, server.page)
        a_refused_script_is_no_file(browser, server.page)
        draws_and_drops(browser, server.page)
        takes_advice(browser, team.page)
    finally:
        server.kill()
        team.kill()
        browser.close()

print("the page at home in Chromium: keyboard, pointer, drop, advice, settings, downloads")
