"""Runs the notebooks and writes a page with the output of each to docs/notebooks.

usage: python examples/python/pages.py [NOTEBOOK...]    needs noctograph, nbclient, ipykernel, matplotlib, scipy, pillow
"""

import base64
import io
import pathlib
import sys
import tempfile

import nbclient
import nbformat
from PIL import Image

HERE = pathlib.Path(__file__).resolve().parent
PAGES = HERE.parent.parent / "docs/notebooks"
#: Maximum size of a picture, in bytes and in pixels.
MOST, WIDTH = 200_000, 1000


def picture(data, name):
    """Writes the picture of an output, and returns its file."""
    if "image/svg+xml" in data:
        file = PAGES / f"{name}.svg"
        file.write_text(data["image/svg+xml"])
    else:
        raw = base64.b64decode(data.get("image/jpeg") or data["image/png"])
        image = Image.open(io.BytesIO(raw)).convert("RGB")
        image.thumbnail((WIDTH, WIDTH))
        file = PAGES / f"{name}.png"
        colors = image.quantize(64, dither=Image.Dither.NONE) if "image/png" in data else image
        colors.save(file, optimize=True)
        if file.stat().st_size > MOST or "image/jpeg" in data:
            file.unlink()
            file = file.with_suffix(".jpg")
            image.save(file, quality=85)
    assert file.stat().st_size <= MOST, f"{file}: {file.stat().st_size} bytes"
    return file


def shown(outputs, name):
    """Returns the text of a cell's outputs in a page. `name` is the name of its pictures."""
    printed, pictures = "", []
    for output in outputs:
        data = output.get("data", {})
        if output.output_type == "stream":
            printed += output.text if output.name == "stdout" else ""
        elif any(kind.startswith("image/") for kind in data):
            file = picture(data, f"{name}{chr(ord('a') + len(pictures))}")
            pictures.append(f"![Output of the code above]({file.name})\n")
        else:
            printed += data.get("text/plain", "") + "\n"
    return ([f"```text\n{printed.rstrip()}\n```\n"] if printed.strip() else []) + pictures


def page(path):
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": folder}}).execute()
    for old in PAGES.glob(f"{path.stem}*"):
        old.unlink()
    parts = [f"<!-- Made from examples/python/notebooks/{path.name} by examples/python/pages.py -->\n"]
    for at, cell in enumerate(notebook.cells):
        code = cell.cell_type == "code"
        parts.append(f"```python\n{cell.source}\n```\n" if code else f"{cell.source}\n")
        parts += shown(cell.get("outputs", []), f"{path.stem}-{at}")
    (PAGES / f"{path.stem}.md").write_text("\n".join(parts))


if __name__ == "__main__":
    PAGES.mkdir(exist_ok=True)
    for path in [pathlib.Path(name) for name in sys.argv[1:]] or sorted((HERE / "notebooks").glob("*.ipynb")):
        page(path)
