"""Fetch the page's libraries anew: ``make vendor``.

``app/page/static/vendor/vendor.json`` names them: npm package, version, licence, and of every file its path in the
package and the SHA-256 of what stands in ``vendor/FOLDER/``. A new version: change it, and empty the hashes of its
files. A file whose hash is empty is taken as it comes and its hash written down; any other must come as it came
before. ``replace`` of a file lists pairs of texts, each of which must occur: a browser without an import map finds no
bare module names.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

VENDOR = Path(__file__).resolve().parents[1] / "app" / "page" / "static" / "vendor"
LIST = VENDOR / "vendor.json"


class VendorError(Exception):
    """A library did not come, or came otherwise than before; the message is one sentence with the remedy."""


def packed(package: str, version: str, folder: Path) -> Path:
    """The package as npm's client delivers it, a tar archive in a folder.

    Raises:
        VendorError: npm is not there, or does not have it.
    """
    npm = shutil.which("npm")
    if npm is None:
        raise VendorError("npm was not found: install it with 'sudo apt-get install npm'")
    command = [npm, "pack", "--silent", "--ignore-scripts", "--pack-destination", str(folder), f"{package}@{version}"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode:
        raise VendorError(f"npm did not deliver {package} {version}: {done.stderr.strip()}")
    return folder / done.stdout.split()[-1]


def content(archive: tarfile.TarFile, path: str, entry: dict[str, Any]) -> bytes:
    """A file of a package as the page uses it; its hash is written into the entry if that has none.

    Raises:
        VendorError: it is not there, or not as it was.
    """
    try:
        member = archive.extractfile(f"package/{path}")
    except KeyError:
        member = None
    if member is None:
        raise VendorError(f"the package has no file {path}: correct {LIST.name}")
    data = member.read()
    for old, new in entry.get("replace", []):
        if old.encode() not in data:
            raise VendorError(f"{path} does not hold {old!r}, which is to be replaced: correct {LIST.name}")
        data = data.replace(old.encode(), new.encode())
    found = hashlib.sha256(data).hexdigest()
    if entry["sha256"] not in ("", found):
        raise VendorError(f"{path} is not what it was (SHA-256 {found}): empty its hash in {LIST.name} to take it")
    entry["sha256"] = found
    return data


def main() -> None:
    """Fetch every package, write its files, remove what no package has, and write the hashes down."""
    listed = json.loads(LIST.read_text(encoding="utf-8"))
    kept = {LIST}
    with tempfile.TemporaryDirectory() as folder:
        for one in listed["packages"]:
            target = VENDOR / one["folder"]
            target.mkdir(exist_ok=True)
            with tarfile.open(packed(one["package"], one["version"], Path(folder))) as archive:
                for path, entry in one["files"].items():
                    file = target / Path(path).name
                    file.write_bytes(content(archive, path, entry))
                    kept.add(file)
            print(f"{one['package']} {one['version']}: {len(one['files'])} files")
    for path in VENDOR.rglob("*"):
        if path.is_file() and path not in kept:
            path.unlink()
    LIST.write_text(json.dumps(listed, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    try:
        main()
    except VendorError as error:
        sys.exit(f"touchmove: {error}")
