"""Drives the report with playwright: tests/page.py REPORT.html FOLDER"""

import re
import sys
from pathlib import Path

from browser import CHROMIUM, sync_playwright

report, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
assert report.stat().st_size <= 2_000_000, f"{report.stat().st_size} bytes"


def opened(browser, **options):
    """Opens the report, and returns the page with its errors and requests."""
    page = browser.new_context(**options).new_page()
    page.set_default_timeout(300_000)
    trouble = []
    page.on("console", lambda message: trouble.append(message.text))
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("request", lambda request: request.url.startswith(("data:", "file:")) or trouble.append(request.url))
    page.goto(report.as_uri())
    return page, trouble


def pixels(page):
    return page.evaluate("document.querySelector('.path').toDataURL()")


with sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])

    page, trouble = opened(browser, viewport={"width": 1280, "height": 800})
    assert "JUNE reads as" in page.inner_text(".lead")
    over = page.locator(".photo svg")
    assert not over.is_visible(), "the overlay is off to begin with"
    page.click("label[for=over]")
    assert over.is_visible(), "and on when it is asked for"

    shown = lambda: page.evaluate("[...document.querySelectorAll('.film figure')].findIndex(f => f.classList.contains('on'))")
    assert shown() == 11, "the film begins at its end: the photo"
    page.focus(".controls input")
    page.keyboard.press("ArrowLeft")
    assert shown() == 10, "the slider moves it"
    page.click(".controls button")
    page.wait_for_function("() => document.querySelector('.controls button').textContent === 'play'")
    assert shown() == 11, "it plays to its end"

    before = pixels(page)
    page.focus(".path")
    page.keyboard.press("ArrowLeft")
    turned = pixels(page)
    assert turned != before, "keys turn the path"
    box = page.locator(".path").bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, box["y"] + 130)
    page.mouse.up()
    assert pixels(page) != turned, "and so does the pointer"

    page.pdf(path=folder / "report.pdf", format="A4")
    n_pages = len(re.findall(rb"/Type\s*/Page[^s]", (folder / "report.pdf").read_bytes()))
    assert 2 <= n_pages <= 8, f"{n_pages} printed pages"
    assert not trouble, trouble

    for options in [{"width": 360, "height": 740}, {"width": 768, "height": 1024}]:
        page, trouble = opened(browser, viewport=options, color_scheme="dark", reduced_motion="reduce")
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= options["width"], f"{width} px on a screen of {options['width']}"
        assert not trouble, trouble

    page, trouble = opened(browser, java_script_enabled=False)
    assert page.locator(".film img").count() == 12 and page.locator(".film img").last.is_visible()
    assert "Safety sheet" in page.inner_text("body")
    browser.close()

print("the report in Chromium: pointer, keyboard, phone, print, no scripts, no request")
