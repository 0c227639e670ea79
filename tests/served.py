"""Drives the page of `noctograph serve` with playwright: tests/served.py NOCTOGRAPH"""

import re
import statistics
import subprocess
import sys

from playwright.sync_api import sync_playwright

STAR = "M50 5 L61 39 L97 39 L68 60 L79 95 L50 73 L21 95 L32 60 L3 39 L39 39 Z"
SVG = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><path d="{STAR}" fill="none" stroke="red"/></svg>'


def serving(*flags):
    """A server and its address."""
    server = subprocess.Popen([sys.argv[1], "serve", *flags], stdout=subprocess.PIPE, text=True)
    return server, server.stdout.readline().split()[-1]


def opened(browser, url, **options):
    """The page, and what it complained of or asked others for."""
    page = browser.new_context(locale="en-US", **options).new_page()
    trouble = []
    page.on("console", lambda message: trouble.append(message.text))
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("request", lambda request: request.url.startswith(("data:", url)) or trouble.append(request.url))
    page.goto(url)
    return page, trouble


def src(page):
    return page.get_attribute("#photo img", "src") or ""


def changed(page, before):
    page.wait_for_function("before => document.querySelector('#photo img').src !== before && document.querySelector('#photo img').src", arg=before, timeout=60_000)


def finished(page):
    """Waits for the large photo, and returns its verdict."""
    page.wait_for_selector("#done:not([hidden])", timeout=90_000)
    return page.inner_text("#verdict")


def flight_s(page):
    return int(re.search(r"(\d+) s of flight", page.inner_text("#facts")).group(1))


def fits(page, width):
    found = page.evaluate("document.documentElement.scrollWidth")
    assert found <= width, f"{found} px on a screen of {width}"


def types_and_prints(browser, url):
    page, trouble = opened(browser, url, viewport={"width": 1280, "height": 900})
    # By keyboard alone: the word has the focus, and Tab reaches every control.
    page.wait_for_function("() => document.activeElement.id === 'word'")
    shift = "new PerformanceObserver(list => window.shift = (window.shift ?? 0) + list.getEntries().reduce((sum, entry) => sum + (entry.hadRecentInput ? 0 : entry.value), 0)).observe({type: 'layout-shift', buffered: true})"
    page.evaluate(shift)
    page.keyboard.type("RIGA", delay=120)
    verdict = finished(page)
    assert "reads as RIGA" in verdict and "legible" in verdict, verdict
    assert "RIGA" in page.get_attribute("#photo img", "alt")
    assert page.locator("#letters li").count() == 4
    assert page.evaluate("window.shift ?? 0") < 0.1, "the page moves while the photo arrives"
    before = src(page)
    reached = set()
    for _ in range(40):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.dataset.key ?? document.activeElement.id"))
    assert {"undo", "lamp", "plan.stroke_speed_m_s", "preset", "again", "hang"} <= reached, reached
    page.focus("[data-key='letters.cap_height_m']")
    page.keyboard.press("ArrowRight")
    changed(page, before)
    finished(page)
    assert "0.55 m" in page.inner_text("label:has([data-key='letters.cap_height_m'])")
    names = page.evaluate("[...document.querySelectorAll('input, select, button, canvas')].filter(e => !(e.labels?.length || e.textContent || e.getAttribute('aria-label'))).map(e => e.outerHTML)")
    assert not names, f"controls without a name: {names}"

    page.pdf(path="/dev/null", prefer_css_page_size=True)
    n_pages = len(re.findall(rb"/Type\s*/Page[^s]", page.pdf(prefer_css_page_size=True)))
    assert n_pages == 1, f"{n_pages} printed pages"
    for name, begins in {"photo.png": b"\x89PNG", "plan.svg": b"<svg", "report.html": b"<!doctype", "flight.zip": b"PK"}.items():
        with page.expect_download() as download:
            page.click(f"a[download='{name}']")
        assert open(download.value.path(), "rb").read().startswith(begins), name

    page.click("#hang")
    page.wait_for_selector("#wall[open] figure")
    assert page.inner_text("#wall figcaption") == "RIGA"
    page.keyboard.press("Escape")
    assert not page.locator("#wall").is_visible()
    assert not trouble, trouble


def draws_and_drops(browser, url):
    page, trouble = opened(browser, url, viewport={"width": 1280, "height": 900})
    box = page.locator("#pad").bounding_box()
    place = lambda x, y: (box["x"] + x * box["width"], box["y"] + y * box["height"])
    page.mouse.move(*place(0.3, 0.8))
    page.mouse.down()
    for x, y in [(0.3, 0.2), (0.6, 0.8), (0.6, 0.2)]:
        page.mouse.move(*place(x, y), steps=12)
    page.mouse.up()
    finished(page)
    drawn = src(page)
    assert "m of light" in page.inner_text("#length")
    slow = flight_s(page)
    page.uncheck("#pace")
    changed(page, drawn)
    finished(page)
    assert flight_s(page) < slow, f"{flight_s(page)} s evenly, {slow} s at the speed of the pen"

    # A second stroke in another color.
    page.select_option("#lamp", "color-led")
    page.click("#swatches [aria-label=red]")
    page.mouse.move(*place(0.7, 0.8))
    page.mouse.down()
    page.mouse.move(*place(0.7, 0.2), steps=12)
    page.mouse.up()
    labels = page.eval_on_selector_all("#painted button", "all => all.map(button => button.getAttribute('aria-label'))")
    assert labels == ["1: white", "2: red"], labels
    finished(page)
    drawn = src(page)
    data = "text => { const data = new DataTransfer(); data.items.add(new File([text], 'star.svg')); return data; }"
    page.dispatch_event("body", "drop", {"dataTransfer": page.evaluate_handle(data, SVG)})
    changed(page, drawn)
    finished(page)

    # A picture of a cross, larger than what is sent, and a file that is none.
    drawn = src(page)
    photographed = """async () => {
        const canvas = Object.assign(document.createElement('canvas'), {width: 3000, height: 1500});
        const pen = canvas.getContext('2d');
        pen.fillStyle = '#ddd'; pen.fillRect(0, 0, 3000, 1500);
        pen.lineWidth = 40; pen.strokeStyle = '#222';
        pen.moveTo(500, 300); pen.lineTo(2500, 1200); pen.moveTo(500, 1200); pen.lineTo(2500, 300); pen.stroke();
        const data = new DataTransfer();
        data.items.add(new File([await new Promise(done => canvas.toBlob(done))], 'cross.png'));
        return data;
    }"""
    page.dispatch_event("body", "drop", {"dataTransfer": page.evaluate_handle(photographed)})
    changed(page, drawn)
    finished(page)
    text = "() => { const data = new DataTransfer(); data.items.add(new File(['x'], 'me.jpg')); return data; }"
    page.dispatch_event("body", "drop", {"dataTransfer": page.evaluate_handle(text)})
    page.wait_for_function("() => document.querySelector('#verdict').textContent.includes('wanted a picture')")
    assert not trouble, trouble


def takes_advice(browser, url):
    """The team's flight, fast and in a lit room, does not read; a button mends it."""
    page, trouble = opened(browser, url, viewport={"width": 1280, "height": 900})
    page.fill("#word", "MILCH")
    page.select_option("[data-key='photo.ambient_cd_m2']", "1")
    speed = "const input = document.querySelector(\"[data-key='plan.stroke_speed_m_s']\"); input.value = 0.8; input.dispatchEvent(new Event('input'))"
    page.evaluate(speed)
    percent = lambda text: int(re.search(r"(\d+) %", text).group(1))
    before = percent(finished(page))
    page.locator("#advice button").first.click()
    after = percent(finished(page))
    assert after > before, f"{before} % before the advice, {after} % after it"
    assert not trouble, trouble


def fits_small_screens(browser, url):
    for options in [{"width": 360, "height": 740}, {"width": 768, "height": 1024}]:
        page, trouble = opened(browser, url, viewport=options, color_scheme="dark", reduced_motion="reduce", has_touch=True)
        page.select_option("#language", "de")
        assert page.inner_text("#see-wall") == "Die Wand"
        assert page.get_attribute("html", "lang") == "de"
        page.select_option("#lamp", "color-led")
        page.tap("#swatches [aria-label=rot]")
        page.fill("#word", "Fée")
        assert "liest sich als" in finished(page) or "nicht zu lesen" in page.inner_text("#verdict")
        animation = page.evaluate("getComputedStyle(document.querySelector('figure'), '::after').animationName")
        assert animation == "none", animation
        fits(page, options["width"])
        assert not trouble, trouble


def answers_keystrokes(browser, url):
    """Milliseconds from a keystroke to photo and verdict: median and 95th percentile."""
    page, _ = opened(browser, url, viewport={"width": 1280, "height": 900})
    # From the key's own event to the moment at which the photo is decoded and the verdict stands beside it.
    page.evaluate("""() => {
        window.times = [];
        document.querySelector('#word').addEventListener('input', () => { window.begun = performance.now(); }, true);
        const img = document.querySelector('#photo img');
        const done = async () => { const begun = window.begun; await img.decode(); window.times.push(performance.now() - begun); };
        new MutationObserver(() => img.src.startsWith('data:') && done().catch(() => {})).observe(img, {attributes: true, attributeFilter: ['src']});
    }""")
    wanted = 0
    for word in ["NOOR", "SOPHIE", "QUARTZ", "MELODY", "LANTERNS"]:
        page.fill("#word", "")
        for letter in word:
            page.keyboard.type(letter)
            wanted += 1
            page.wait_for_function("n => window.times.length >= n", arg=wanted, timeout=60_000)
    times = page.evaluate("window.times")
    times.sort()
    return statistics.median(times), times[int(0.95 * len(times))]


with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
    server, url = serving()
    team, of_team = serving("--scene", "team")
    try:
        types_and_prints(browser, url)
        draws_and_drops(browser, url)
        takes_advice(browser, of_team)
        fits_small_screens(browser, url)
        median, late = answers_keystrokes(browser, url)
    finally:
        server.kill()
        team.kill()
        browser.close()

print(f"the page in Chromium: keyboard, pointer, drop, advice, print, wall, phone; a keystroke's photo after {median:.0f} ms (p95 {late:.0f} ms)")
