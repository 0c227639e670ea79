"""Simulates a day at one kiosk: tests/soak.py NOCTOGRAPH [VISITORS]

One visitor after another types a word, or draws, sees the photograph, sends it and leaves, and an operator
approves it on a separate page. No visitor may be refused, and neither the server nor the browser may grow."""

import os
import random
import statistics
import sys
import time

from browser import *

NAMES = "LEA TOM ZOE EVA MIA LEO ANN BEN IDA KAI NOA UMA".split()


def memory_mb(numbers):
    """Returns the memory, in MB, that only these processes use."""
    sizes = [map(int, Path(f"/proc/{number}/statm").read_text().split()) for number in numbers]
    return sum(resident - shared for _, resident, shared, *_ in sizes) * os.sysconf("SC_PAGE_SIZE") / 1e6


def measured(browser, server, page):
    """Returns the memory of the server with its workers and of Chromium's pages in MB, and the kiosk's objects in MB,
    nodes and listeners."""
    of_browser, of_page = browser.new_browser_cdp_session(), page.context.new_cdp_session(page)
    of_page.send("HeapProfiler.collectGarbage")
    of_page.send("Performance.enable")
    figures = {it["name"]: it["value"] for it in of_page.send("Performance.getMetrics")["metrics"]}
    pages = [it["id"] for it in of_browser.send("SystemInfo.getProcessInfo")["processInfo"] if it["type"] == "renderer"]
    of_browser.detach(), of_page.detach()
    return {"server": memory_mb(processes(server)), "pages": memory_mb(pages), "objects": figures["JSHeapUsedSize"] / 1e6,
            "nodes": figures["Nodes"], "listeners": figures["JSEventListeners"]}


def visit(page, number, rng):
    """Simulates one visitor, from the first letter until the entry is sent, and returns the seconds."""
    # After half a minute without a touch the kiosk shows its start screen.
    if page.locator("#start").is_visible():
        page.mouse.click(300, 300)
    begun = time.monotonic()
    if number % 10 == 9:
        page.click("#draw")
        page.wait_for_selector("#pad .cursor", state="attached")
        stroke(page, (0.2, 0.3), (0.5, rng.uniform(0.2, 0.8)), (0.7, 0.6))
        until(page, "document.querySelectorAll('#pad .lit').length === 1")
        page.click("#send-drawing")
    else:
        word = rng.choice(NAMES)
        page.locator("#word").press_sequentially(word, delay=60)
        until(page, f"document.querySelector('#photo').alt.includes('{word}')")
        shown(page)
        page.click("#send")
    until(page, "document.querySelector('main').dataset.state === 'sent'", f"visitor {number} is told that it was sent")
    took_s = time.monotonic() - begun
    page.get_by_text("Write another").click()
    return took_s


def soak(browser, program, n_visitors, tell=lambda *_: None):
    """Simulates visitors in turn at a kiosk. Returns the seconds of each, and how often a visitor waited for a free
    place."""
    server, rng = Server(program, "--kiosk"), random.Random(1)
    try:
        page, trouble = opened(browser, server.page, viewport=TABLET)
        ready(page)
        host, host_trouble = opened(browser, server.operator)
        times, visitors, first = [], set(), None
        # By then everything that is loaded at its first use has been loaded: the buffers of each
        # worker take four visitors.
        warm = max(4, n_visitors // 4)
        for number in range(1, n_visitors + 1):
            visitors.add(kept(page)["visitor"])
            times.append(visit(page, number, rng))
            host.wait_for_selector("[data-do=approve]")
            host.keyboard.press("a")
            until(host, f"document.querySelector('#tabs button:nth-child(2) b').textContent === '{number}'", "the operator's answer")
            if number in (warm, 10, 100, 300, n_visitors):
                now = measured(browser, server, page)
                first = now if number == warm else first
                tell(number, times, now)
        # A request for a place that is not free yet is repeated. Any other error is a refusal.
        refused = [line for line in [*trouble, *host_trouble] if not line.startswith("429")]
        assert not refused, refused
        assert len(visitors) == n_visitors, "each is a visitor of their own"
        # The memory of a worker for a photograph varies from 7 to 39 MB.
        for name, least in {"server": 40, "objects": 1, "nodes": 300, "listeners": 50}.items():
            assert now[name] < 1.15 * first[name] + least, f"{name}: {first[name]:.1f} after visitor {warm}, {now[name]:.1f} after {n_visitors}"
        return times, len(trouble)
    finally:
        server.kill()


if __name__ == "__main__":
    def tell(number, times, now):
        figures = ", ".join(f"{name} {value:.1f}" for name, value in now.items())
        print(f"visitor {number}: median {statistics.median(times):.1f} s, p95 {sorted(times)[int(0.95 * len(times))]:.1f} s; {figures}; load {os.getloadavg()[0]:.1f}", flush=True)

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        times, n_waits = soak(browser, sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 500, tell)
        browser.close()
    print(f"{len(times)} visitors in {sum(times) / 60:.0f} minutes, none refused; {n_waits} times one waited for a free place")
