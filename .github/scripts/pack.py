"""Packs a folder: the same files, the same bytes. usage: pack.py FOLDER ARCHIVE.tar.gz|ARCHIVE.zip"""

import gzip
import os
import pathlib
import sys
import tarfile
import zipfile

folder, archive = map(pathlib.Path, sys.argv[1:])
files = sorted(path for path in folder.rglob("*") if path.is_file())
# Those of the packed folder are no programs but ours; Windows has no such mode.
modes = {path: 0o755 if os.access(path, os.X_OK) and not path.suffix else 0o644 for path in files}
if archive.suffix == ".zip":
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
        for path in files:
            entry = zipfile.ZipInfo(path.relative_to(folder.parent).as_posix())
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, modes[path] << 16
            packed.writestr(entry, path.read_bytes())
else:
    with open(archive, "wb") as out, gzip.GzipFile("", "wb", 9, out, mtime=0) as zipped, tarfile.open(fileobj=zipped, mode="w") as packed:
        for path in files:
            entry = tarfile.TarInfo(path.relative_to(folder.parent).as_posix())
            entry.size, entry.mode = path.stat().st_size, modes[path]
            with path.open("rb") as content:
                packed.addfile(entry, content)
print(f"{archive}: {archive.stat().st_size / 1e6:.2f} MB, {len(files)} files")
