"""Makes the sheet of screenshots of docs/page.md: tests/page_sheet.py NOCTOGRAPH FOLDER SHEET.jpg

The script writes a picture of each state of each role, at the sizes for which it is designed, into the folder, and
all pictures on one sheet."""

import base64
import sys
import tempfile
import time
from pathlib import Path

from browser import *

program, folder, sheet = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
SIDEWAYS = {"width": 844, "height": 390}
ARABIC = (Path(__file__).parent / "fixtures/words-ar.json").read_text()
BOAT = [[(0.22, 0.62), (0.8, 0.6), (0.68, 0.82), (0.34, 0.82), (0.22, 0.62)], [(0.5, 0.6), (0.49, 0.1), (0.74, 0.52), (0.54, 0.54)], [(0.48, 0.14), (0.3, 0.54), (0.46, 0.55)]]
taken = []


def take(page, name, size):
    time.sleep(1.5)  # colors that change have changed
    path = folder / f"{name}-{size['width']}.png"
    page.screenshot(path=path)
    taken.append((path, size))
    page.context.close()


def visitor(browser, url, size, word=None, language=None, **options):
    page, _ = opened(browser, "about:blank", viewport=size, **options)
    if language:
        page.route("**/words/ar*.json", lambda route: route.fulfill(body=ARABIC, content_type="application/json"))
        page.add_init_script(f"sessionStorage.noctograph ??= JSON.stringify({{language: '{language}'}})")
    page.goto(url)
    ready(page)
    if word:
        write(page, word)
        page.wait_for_timeout(2500)
    return page


def draws(page):
    page.click("#draw")
    page.wait_for_selector("#pad .cursor", state="attached")
    for line in BOAT:
        stroke(page, *line)
    until(page, f"document.querySelectorAll('#pad .lit').length === {len(BOAT)}")
    place = on_pad(page)
    page.mouse.move(*place(0.1, 0.9))
    page.mouse.down()
    for step in range(24):
        page.mouse.move(*place(0.1 + 0.025 * step, 0.9 + 0.03 * ((step // 4) % 2)))
    return page


def chooses(page):
    drop_sheet(page)
    page.click("#choose")
    page.click("[data-ink=red]")
    shown(page)
    return page


def exposes(page, share):
    page.evaluate("share => { const range = document.querySelector('#replay input'); range.value = 1000 * share; range.dispatchEvent(new Event('input')); }", share)
    page.wait_for_timeout(500)
    return page


def sends(page):
    page.click("#send")
    page.wait_for_selector("#sent h2", timeout=60_000)
    page.wait_for_timeout(7000)
    return page


with sync_playwright() as playwright, tempfile.TemporaryDirectory() as gallery:
    folder.mkdir(parents=True, exist_ok=True)
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
    server, kiosk = Server(program, "--gallery", gallery, "--network"), None
    url = server.page
    try:
        # These entries are sent and approved, so that the wall shows them.
        host, _ = opened(browser, server.operator)
        ids = []
        for word, colors in [("OWL", []), ("2027", [0, 0, 2, 2, 2]), ("Hej!", []), ("NOOR", [0, 1, 2, 3, 0, 1, 2, 3]), ("Amara", []), ("Zoë", [0, 1, 1, 2, 2, 2])]:
            page = visitor(browser, url, DESK)
            write(page, word)
            for letter in colors:
                page.locator("#marks button").nth(letter).click()
                shown(page)
            page.click("#send")
            page.wait_for_selector("#sent h2", timeout=60_000)
            ids.append(kept(page)["sent"]["id"])
            page.context.close()
        for _ in ids[:-2]:
            host.wait_for_selector("[data-do=approve]")
            before = host.inner_text("#tabs button:nth-child(2) b")
            host.keyboard.press("a")
            until(host, f"document.querySelector('#tabs button:nth-child(2) b').textContent !== '{before}'")
        host.context.close()

        take(visitor(browser, url, PHONE), "empty", PHONE)
        take(visitor(browser, url, PHONE, "Amara"), "word", PHONE)
        page = visitor(browser, url, PHONE)
        page.fill("#word", "🦉")
        until(page, "document.querySelector('#frame').hidden && document.querySelector('#verdict strong')")
        take(page, "unwritable", PHONE)
        take(draws(visitor(browser, url, PHONE)), "pad", PHONE)
        take(chooses(visitor(browser, url, PHONE)), "picture", PHONE)
        take(visitor(browser, url, PHONE, "Amara", "ar"), "arabic", PHONE)
        take(visitor(browser, url, PHONE, "Amara", forced_colors="active"), "forced", PHONE)
        take(exposes(visitor(browser, url, TABLET, "Amara", "de"), 0.7), "exposure", TABLET)
        take(draws(visitor(browser, url, TABLET)), "pad", TABLET)
        take(sends(visitor(browser, url, TABLET, "Lea")), "sent", TABLET)
        take(visitor(browser, url, SIDEWAYS, "Amara"), "sideways", SIDEWAYS)
        take(visitor(browser, url, DESK, "Amara"), "word", DESK)
        take(draws(visitor(browser, url, DESK)), "pad", DESK)
        take(sends(visitor(browser, url, DESK, "Anna")), "sent", DESK)
        take(chooses(visitor(browser, url, DESK)), "picture", DESK)
        page = visitor(browser, url, DESK, "Jazz")
        page.click("#more")
        page.wait_for_selector("#drawer[open]")
        take(page, "drawer", DESK)
        take(exposes(visitor(browser, url, WALL, "Amara"), 0.6), "exposure", WALL)

        for size in [DESK, PHONE]:
            page, _ = opened(browser, server.operator, viewport=size)
            page.wait_for_selector("#list button")
            page.wait_for_timeout(1500)
            take(page, "operator", size)
        page, _ = opened(browser, server.operator, color_scheme="light")
        page.wait_for_selector("#list button")
        page.wait_for_timeout(1500)
        take(page, "operator-light", DESK)
        for size in [WALL, DESK]:
            page, _ = opened(browser, f"{url}wall.html", viewport=size, reduced_motion="reduce")
            page.wait_for_selector("#newest img")
            page.wait_for_timeout(2500)
            take(page, "wall", size)
        for size in [PHONE, DESK]:
            page, _ = opened(browser, f"{server.host}/e/{ids[0]}/", viewport=size)
            ready(page)
            page.wait_for_timeout(7000)
            take(page, "home", size)
        card = {"width": 559, "height": 397}
        page, _ = opened(browser, f"{server.host}/e/{ids[0]}/", viewport=card)
        ready(page)
        page.emulate_media(media="print")
        take(page, "card", card)
        server.kill()
        kiosk = Server(program, "--gallery", gallery, "--kiosk")
        for size in [TABLET, DESK]:
            page, _ = opened(browser, kiosk.page, viewport=size, reduced_motion="reduce")
            ready(page)
            page.wait_for_timeout(2500)
            take(page, "start", size)
        page, _ = opened(browser, f"{kiosk.page}?keyboard", viewport=TABLET)
        ready(page)
        page.mouse.click(300, 300)
        write(page, "Amara")
        page.wait_for_timeout(2500)
        take(page, "keyboard", TABLET)

        # All pictures are put on one sheet, each 420 px high.
        cells = "".join(f'<figure><img src="data:image/png;base64,{base64.b64encode(path.read_bytes()).decode()}"><figcaption>{path.stem.rsplit("-", 1)[0]}, {size["width"]} × {size["height"]}</figcaption></figure>' for path, size in taken)
        page = browser.new_page(viewport={"width": 2400, "height": 1200})
        page.set_content(f"<style>body{{margin:16px;background:#444;color:#eee;font:15px sans-serif;display:flex;flex-wrap:wrap;gap:16px}}figure{{margin:0}}img{{height:420px;display:block}}</style>{cells}")
        page.wait_for_timeout(1000)
        page.screenshot(path=sheet, type="jpeg", quality=82, full_page=True)
    finally:
        server.kill()
        if kiosk:
            kiosk.kill()
        browser.close()
print(f"{len(taken)} pictures in {folder}, all of them in {sheet}")
