"""docs/tutorials/first-controller.md: its code runs, and prints what the page shows.

NOCTOGRAPH_BLESS=1 writes what it prints into the page.
"""

import contextlib
import io
import os
import pathlib
import re
import warnings

PAGE = pathlib.Path(__file__).parents[3] / "docs/tutorials/first-controller.md"
BLOCK = re.compile(r"^```(python|output)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def test_the_first_controller_prints_what_its_page_shows(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, printed = {}, ""

    def run(block):
        nonlocal printed
        if block[1] == "output":
            return f"```output\n{printed}```"
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(block[2], names)
        printed = out.getvalue()
        return block[0]

    text = PAGE.read_text()
    found = BLOCK.sub(run, text)
    assert printed and names
    if os.environ.get("NOCTOGRAPH_BLESS") == "1":
        PAGE.write_text(found)
        warnings.warn(f"NOCTOGRAPH_BLESS=1: {PAGE} is written anew", stacklevel=1)
    else:
        assert found == text
