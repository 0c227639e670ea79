"""Tests the page at home in Chromium: tests/served.py NOCTOGRAPH

Words, drawings, files, advice, settings and downloads, by keyboard and by pointer."""

import re
import sys

from browser import *

STAR = "M50 5 L61 39 L97 39 L68 60 L79 95 L50 73 L21 95 L32 60 L3 39 L39 39 Z"
SVG = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><path d="{STAR}" fill="none" stroke="red"/></svg>'


def large(page):
    """Waits for the large photograph of the current word or drawing."""
    until(page, "document.querySelector('main').dataset.large", "the large photograph")


def flight_s(page):
    return int(re.search(r"(\d+) second", page.inner_text("#left") or page.inner_text("#verdict")).group(1))


def types_reads_and_downloads(browser, url):
    page, trouble = opened(browser, url, viewport={"width": 1280, "height": 900})
    ready(page)
    # Only the keyboard is used: the word has the focus, and Tab reaches every control.
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
    until(page, "document.querySelectorAll('#drawer .files button').length === 3")
    assert page.locator("#drawer .letters li").count() == 4
    for name, begins in {"photo.png": b"\x89PNG", "scene.toml": b"", "flight.zip": b"PK"}.items():
        with page.expect_download() as download:
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
    # The settings are kept after a reload.
    page.reload()
    ready(page)
    assert kept(page)["settings"] == {"letters.cap_height_m": "0.55"}
    assert not trouble, trouble


def the_word_is_seen_until_its_first_photograph(browser, url):
    for size in [DESK, PHONE]:
        page, trouble = opened(browser, url, viewport=size)
        ready(page)
        held = []
        page.route("**/live", lambda route: route.continue_() if held else held.append(route))
        page.fill("#word", "Riga 2027")
        until(page, "document.querySelector('#plan .lit')?.textContent === 'Riga 2027'")
        text = page.evaluate("document.querySelector('#plan .lit').getBoundingClientRect().toJSON()")
        stage = page.locator(".stage").bounding_box()
        assert page.locator("#plan").is_visible() and 0.3 * size["width"] < text["width"] < stage["width"], (text, stage)
        assert text["bottom"] < page.locator("#verdict").bounding_box()["y"], "the desk covers the word"
        assert page.inner_text("#verdict") == "The photograph is being made …"
        assert not page.locator(".stage .waiting").is_visible(), "there is one lamp"
        moving = page.evaluate("document.getAnimations().map(({ animationName, effect }) => [animationName, Number(effect.target.style.getPropertyValue('--i')), effect.getComputedTiming().endTime])")
        ends = [round(end) for name, i, end in sorted(moving, key=lambda it: it[1]) if name == "lamp"]
        assert ends == [round(6000 * (i + 1) / 9) for i in range(9)], f"one letter after another, in the time of the strip: {moving}"
        come(page, held)
        try:
            held[0].continue_()
        except Error:
            pass  # given up on a busy machine, and asked for again
        shown(page)
        assert page.locator("#plan").is_hidden()
        assert not trouble, trouble


def a_refused_gain_is_said_until_it_is_put_back(browser, url):
    page, trouble = opened(browser, url)
    ready(page)
    write(page, "HI")
    more(page)
    page.click("#drawer .gains >> xpath=preceding-sibling::summary")
    gain = page.locator("#drawer .gains input").first
    gain.wait_for()
    usual = gain.input_value()
    gain.fill("many")
    gain.press("Tab")
    until(page, "document.querySelector('#drawer .stop')?.textContent.includes('wanted')", "the refusal")
    gain.fill(usual)
    gain.press("Tab")
    assert page.locator("#drawer .stop").count() == 0, "what is put back is not refused"
    assert not trouble, trouble


def a_refused_script_is_no_file(browser, url):
    """For a word that is too large for its room, the button is disabled, and the reason is shown beside it."""
    page, trouble = opened(browser, url)
    ready(page)
    write(page, "HELLO")
    more(page)
    page.select_option("#room", "4x3x2.5")
    page.evaluate("const range = document.querySelector(\"[data-key='letters.cap_height_m']\"); range.value = 1.2; range.dispatchEvent(new Event('input'))")
    until(page, "document.querySelector('#drawer [data-file=\"flight.zip\"]')?.getAttribute('aria-disabled') === 'true' || document.querySelector('#photo').hidden || document.querySelector('#frame').hidden", "a script that is refused")
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
    # The pen is fast at first and slow at the end, independently of the speed of the machine.
    stroke(page, (0.3, 0.8), (0.3, 0.2), (0.6, 0.8), (0.6, 0.2), steps=(4, 4, 120))
    until(page, "document.querySelectorAll('#pad .lit').length === 1")
    slow = flight_s(page)
    more(page)
    page.select_option("#pace", "even")
    # The large photograph with the pen's speed may arrive first.
    until(page, f"parseInt((document.querySelector('#left').innerText || document.querySelector('#verdict').innerText).match(/[0-9]+(?= second)/)) < {slow}", "a flight that is shorter at an even speed")
    page.keyboard.press("Escape")

    # A second stroke is drawn in another color.
    page.click("[name=light-pad][value=red]", force=True)
    stroke(page, (0.7, 0.8), (0.7, 0.2))
    assert [line["color"] for line in strokes(page)] == ["white", "red"]
    until(page, "document.querySelectorAll('#pad .lit').length === 2")

    # An SVG file is opened by its name, and removed again.
    drop(page, f"() => {{ const data = new DataTransfer(); data.items.add(new File([{SVG!r}], 'star.svg')); return data; }}")
    until(page, "document.querySelector('#opened-name').textContent === 'star.svg'")
    shown(page)

    # A picture of a cross is larger than the size that is sent.
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

    # An invalid file gives a sentence and no photograph.
    drop(page, "() => { const data = new DataTransfer(); data.items.add(new File(['x'], 'me.jpg')); return data; }")
    until(page, "document.querySelector('#verdict').textContent.includes('me.jpg')")
    assert page.locator("#frame").is_hidden()
    assert not trouble, trouble


def chooses_what_is_drawn_of_a_picture(browser, url):
    """Sets the corners and strokes of a sheet on a desk by finger, mouse and keys on a small phone."""
    page, trouble = opened(browser, url, viewport={"width": 360, "height": 740}, has_touch=True)
    asked = []
    page.on("request", lambda request: request.url.endswith("/live") and asked.append(request.post_data_json["settings"]))
    ready(page)
    drop_sheet(page)
    page.click("#choose")
    until(page, "document.querySelectorAll('#picture path[data-n]').length === 2", what="two strokes")
    # This is the picture's place on the screen, where it is smaller while corners are set.
    picture = lambda: page.locator("#picture svg").bounding_box()
    place = lambda x, y: (lambda box: (box["x"] + box["width"] / 800 * x, box["y"] + box["width"] / 800 * y))(picture())
    whole = picture()
    middle = lambda k: (lambda b: (b["x"] + b["width"] / 2, b["y"] + b["height"] / 2))(page.locator(".corner").nth(k).bounding_box())
    near = lambda a, b, most: abs(a[0] - b[0]) < most and abs(a[1] - b[1]) < most
    assert page.locator(".corner >> visible=true").count() == 0, "the whole picture is drawn"
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= 360, f"{wide} px on a screen of 360"

    def next_photo(act, *given):
        before = page.get_attribute("main", "data-shown")
        act(*given)
        until(page, f"document.querySelector('main').dataset.shown !== {before!r}")
        shown(page)
        return {key: value for key, value in asked[-1].items() if key in ("letters.ink", "letters.without", "letters.corners_px")}

    # A stroke that is touched is left out, and added again by another touch.
    red = int(page.get_attribute("[aria-label*='Red'][data-n]", "data-n"))
    line = page.locator(f"[data-n='{red}']")
    assert next_photo(page.touchscreen.tap, *place(385, 375 + 8)) == {"letters.without": f"{red}"}
    assert line.get_attribute("aria-checked") == "false" and page.get_attribute("[data-ink=red]", "aria-pressed") == "false"
    assert page.locator("#picture path[data-n]").count() == 2, "what is left out is still seen"
    assert next_photo(page.touchscreen.tap, *place(385, 375)) == {}
    # The same applies to a color. If all strokes are left out, no photograph is requested.
    assert next_photo(page.click, "[data-ink=black]") == {"letters.without": f"{3 - red}"}
    page.focus("[data-n='1']")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("document.activeElement.dataset.n") == "2"
    line.focus()
    page.keyboard.press("Space")
    until(page, "document.querySelector('#verdict').textContent.startsWith('Everything is left out')")
    assert page.get_attribute("#send", "aria-disabled") == "true"
    assert next_photo(page.keyboard.press, "Enter") == {"letters.without": f"{3 - red}"}
    # After a reload everything is unchanged.
    page.reload()
    ready(page)
    until(page, "document.querySelector('[data-ink=black]')?.getAttribute('aria-pressed') === 'false'")
    next_photo(page.click, "[data-ink=black]")

    # Corners follow the mouse, a finger and the arrow keys, and the strokes follow the corners.
    def pull_by_mouse(k, x, y):
        page.mouse.move(*middle(k))
        page.mouse.down()
        page.mouse.move(*place(x, y), steps=4)
        page.mouse.up()

    def pull_by_finger():
        touch = page.context.new_cdp_session(page)
        for kind, points in [("touchStart", [middle(2)]), ("touchMove", [place(600, 400)]), ("touchMove", [place(560, 300)]), ("touchEnd", [])]:
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [dict(zip("xy", point)) for point in points]})

    next_photo(page.click, "#picture .second")
    for k, corner in enumerate(SHEET):
        next_photo(pull_by_mouse, k, *corner)
    assert page.locator("#picture path[data-n]").count() == 2, "both lie on the sheet"
    next_photo(pull_by_mouse, 3, 200, 300)
    next_photo(pull_by_finger)
    own = kept(page)["opened"]["corners"]
    assert near(own[3], (200, 300), 4) and near(own[2], (560, 300), 4), own
    assert page.locator("#picture path[data-n]").count() == 1, "the red one is no longer on the sheet"
    page.locator(".corner").nth(0).focus()
    assert page.evaluate("document.activeElement.getAttribute('aria-label')") == "Upper left corner"
    told = next_photo(page.keyboard.press, "ArrowDown")
    moved = kept(page)["opened"]["corners"]
    assert near(moved[0], (own[0][0], own[0][1] + 8), 0.6), f"{own[0]} by a step to {moved[0]}"
    assert told == {"letters.corners_px": str(sum(moved, [])).replace(" ", "")}, told
    # A corner stays where the four corners form a sheet, and the whole picture can be selected
    # again.
    pull_by_mouse(0, 700, 500)
    assert kept(page)["opened"]["corners"][0][0] < 400, "these four are no sheet"
    next_photo(page.click, "#picture .second")
    assert "corners" not in kept(page)["opened"] and page.inner_text("#picture .second") == "Set the paper’s corners"
    assert picture() == whole, "the picture moved"

    # For another picture the corners are reset.
    drop(page, """async () => {
        const canvas = Object.assign(document.createElement('canvas'), {width: 800, height: 400});
        const pen = canvas.getContext('2d');
        pen.fillStyle = '#ddd'; pen.fillRect(0, 0, 800, 400);
        pen.lineWidth = 9; pen.moveTo(200, 100); pen.lineTo(600, 300); pen.stroke();
        const data = new DataTransfer();
        data.items.add(new File([await new Promise(done => canvas.toBlob(done))], 'line.png'));
        return data;
    }""")
    until(page, "document.querySelector('#opened-name').textContent === 'line.png'")
    shown(page)
    assert page.locator("#picture").is_hidden(), "the photograph comes first"
    page.click("#choose")
    until(page, "document.querySelectorAll('#picture path[data-n]').length === 1")
    assert page.locator(".corner >> visible=true").count() == 0
    assert next_photo(page.click, "#picture .second") == {"letters.corners_px": "[80,40,720,40,720,360,80,360]"}
    assert page.locator(".corner >> visible=true").count() == 4
    page.click("#choose")
    assert page.locator("#picture").is_hidden() and page.locator("#photo").is_visible()
    assert not trouble, trouble


def takes_advice(browser, url):
    """The team's fast flight in a lit room is illegible, and a button with advice makes it legible."""
    page, trouble = opened(browser, url, viewport={"width": 1280, "height": 900})
    ready(page)
    write(page, "MILCH")
    more(page)
    page.select_option("[data-key='photo.ambient_cd_m2']", "1")
    page.evaluate("const range = document.querySelector(\"[data-key='plan.stroke_speed_m_s']\"); range.value = 0.8; range.dispatchEvent(new Event('input'))")
    until(page, "document.querySelector('#drawer .advice button')", "advice")
    percent = lambda: int(re.search(r"(\d+) of 100", page.inner_text("#drawer .read")).group(1))
    before = percent()
    advice = page.locator("#drawer .advice button").first
    assert not re.search(r"--set|[a-z]+\.[a-z]+_|scene", advice.inner_text()), f"advice in words: {advice.inner_text()}"
    shown_before = page.get_attribute("main", "data-shown")
    advice.click()
    until(page, f"document.querySelector('main').dataset.shown !== {shown_before!r}")
    page.keyboard.press("Escape")
    more(page)
    assert percent() > before, f"{before} of 100 before the advice, {percent()} after it"
    assert not trouble, trouble


with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
    server, team = Server(sys.argv[1]), Server(sys.argv[1], "--scene", "team")
    try:
        types_reads_and_downloads(browser, server.page)
        the_word_is_seen_until_its_first_photograph(browser, server.page)
        a_refused_gain_is_said_until_it_is_put_back(browser, server.page)
        a_refused_script_is_no_file(browser, server.page)
        draws_and_drops(browser, server.page)
        chooses_what_is_drawn_of_a_picture(browser, server.page)
        takes_advice(browser, team.page)
    finally:
        server.kill()
        team.kill()
        browser.close()

print("the page at home in Chromium: keyboard, pointer, drop, corners, strokes, advice, settings, downloads")
