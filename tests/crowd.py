"""Simulates a hall full of visitors: tests/crowd.py NOCTOGRAPH [VISITORS] [SECONDS]

First a single visitor types, in Chromium and over HTTP, and then many at once. The script prints the time from a
letter to its photograph, the refusals, and the processor time per photograph. It is not part of tests/run, because
its result is meaningful only on an idle machine. It therefore prints the load."""

import http.client
import json
import os
import random
import statistics
import sys
import threading
import time

from browser import CHROMIUM, Server, cpu_s, opened, ready, sync_playwright, until

WORDS = "AMARA BENJAMIN CHLOE DMITRI ELENA FELIX GABRIEL HANNAH IBRAHIM JULIA KENJI LUCIA MATTEO NADIA OLIVER PAULA QUENTIN ROSA SAMIRA THEO".split()
program = sys.argv[1]
n_visitors, seconds = [int(text) for text in [*sys.argv[2:], "20", "40"][:2]]


def ask(server, visitor, number, word):
    """Returns the seconds, the status and the answer of the request for a letter."""
    host, path = server.page.removeprefix("http://").split("/", 1)
    wish = {"visitor": visitor, "number": number, "word": word, "settings": {}, "aspect": 1.6}
    begun = time.perf_counter()
    connection = http.client.HTTPConnection(host, timeout=60)
    connection.request("POST", f"/{path}live", json.dumps(wish), {"Content-Type": "application/json", "Origin": f"http://{host}"})
    answer = connection.getresponse()
    body = answer.read()
    return time.perf_counter() - begun, answer.status, json.loads(body or "{}")


def types(server, k, end, answers):
    """Types words until the end without waiting for answers, like a browser."""
    rng, number, asking = random.Random(k), 0, []
    word = WORDS[k % len(WORDS)]
    time.sleep(rng.uniform(0, 1.5))
    while time.monotonic() < end:
        for n in range(1, len(word) + 1):
            number += 1
            asking.append(threading.Thread(target=lambda of: answers.append(ask(server, f"v{k}", *of)), args=[(number, word[:n])]))
            asking[-1].start()
            time.sleep(rng.uniform(0.25, 0.6))
        time.sleep(rng.uniform(2, 5))
        word = rng.choice(WORDS)
    for thread in asking:
        thread.join()


def answers_keystrokes(browser, url):
    """Measures the milliseconds from a keystroke to photograph and verdict, as median and 95th percentile."""
    page, _ = opened(browser, url, viewport={"width": 1280, "height": 900})
    ready(page)
    # The time runs from the key event until the photograph is decoded and the verdict is shown
    # beside it.
    page.evaluate("""() => {
        window.times = [];
        document.querySelector('#word').addEventListener('input', () => { window.begun = performance.now(); }, true);
        const main = document.querySelector('main');
        new MutationObserver(() => window.times.push(performance.now() - window.begun)).observe(main, {attributes: true, attributeFilter: ['data-shown']});
    }""")
    wanted = 0
    for word in ["NOOR", "SOPHIE", "QUARTZ", "MELODY", "LANTERNS"]:
        page.fill("#word", "")
        for letter in word:
            page.keyboard.type(letter)
            wanted += 1
            until(page, f"window.times.length >= {wanted}")
    times = sorted(page.evaluate("window.times"))
    return statistics.median(times), times[int(0.95 * len(times))]


def told(what, answers, used_s):
    times = sorted(s for s, _, answer in answers if "photo" in answer)
    refused = sum(status != 200 for _, status, _ in answers)
    print(f"{what}: {len(times)} photographs, median {statistics.median(times):.3f} s, p95 {times[int(0.95 * len(times))]:.3f} s; {refused} refused; {used_s / len(times):.3f} s of processor each; load {os.getloadavg()[0]:.1f}")


server = Server(program)
try:
    for n in range(3):
        ask(server, "warm", n, WORDS[n])
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        median, late = answers_keystrokes(browser, server.page)
        browser.close()
    print(f"in Chromium, decoded and with its verdict: median {median:.0f} ms, p95 {late:.0f} ms; load {os.getloadavg()[0]:.1f}")
    begun = cpu_s(server)
    alone = [ask(server, "alone", 100 * k + n, word[:n]) for k, word in enumerate(WORDS[:10]) for n in range(1, len(word) + 1)]
    told("alone", alone, cpu_s(server) - begun)
    begun, answers, end = cpu_s(server), [], time.monotonic() + seconds
    visitors = [threading.Thread(target=types, args=(server, k, end, answers)) for k in range(n_visitors)]
    for visitor in visitors:
        visitor.start()
    for visitor in visitors:
        visitor.join()
    told(f"{n_visitors} visitors", answers, cpu_s(server) - begun)
finally:
    server.kill()
