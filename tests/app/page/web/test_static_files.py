"""The page's own files: whole, packed, known again, and all modules of the page linked to from the beginning."""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.page.web.static_files import STATIC, StaticFiles
from tests.app.page.serving import ServedPage, served


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedPage]:
    with served(tmp_path_factory.mktemp("records")) as found:
        yield found


@pytest.mark.parametrize("name", ["app.js", "css/tokens.css", "icons.svg", "vendor/three/three.core.js"])
def test_a_file_comes_as_it_is_packed_or_not_at_all(page: ServedPage, name: str) -> None:
    content = (STATIC / name).read_bytes()
    plain = page.get(f"/static/{name}")
    assert plain.content == content  # type: ignore[attr-defined]
    packed = page.get(f"/static/{name}", {"Accept-Encoding": "br, gzip"})
    assert packed.headers["Content-Encoding"] == "gzip"
    assert gzip.decompress(packed.content) == content  # type: ignore[attr-defined]
    assert len(packed.content) < 0.6 * len(content)  # type: ignore[attr-defined]
    assert packed.headers["Vary"] == "Accept-Encoding"
    assert packed.headers["Content-Type"] == plain.headers["Content-Type"]
    for known in (packed.headers["ETag"], f'W/"other", W/{packed.headers["ETag"]}'):
        again = page.get(f"/static/{name}", {"If-None-Match": known})
        assert (again.status, again.content) == (304, b"")  # type: ignore[attr-defined]
    assert page.get(f"/static/{name}", {"If-None-Match": '"other"'}).status == 200


@pytest.mark.parametrize("name", ["", "nowhere.js", "../server.py", "%2e%2e/process.py", "/app.js", "css", "css/"])
def test_no_other_name_is_a_file(page: ServedPage, name: str) -> None:
    assert page.get(f"/static/{name}").status == 404


def test_the_page_links_to_all_modules_and_to_one_style_sheet(page: ServedPage) -> None:
    text = page.get("/").content.decode()  # type: ignore[attr-defined]
    assert re.findall(r'<link rel="stylesheet" href="([^"]+)">', text) == ["/static/page.css"]
    styles = page.get("/static/page.css").content.decode()  # type: ignore[attr-defined]
    source = (STATIC / "index.html").read_text()
    parts = [STATIC / one for one in re.findall(r'rel="stylesheet" href="/static/([^"]+)"', source)]
    assert len(parts) == 6
    places = [styles.index(part.read_text()) for part in parts]
    assert places == sorted(places)
    linked = re.findall(r'<link rel="modulepreload" href="/static/([^"]+)">', text)
    assert len(linked) == len(set(linked)) > 20
    assert {"app.js", "store.js", "vendor/chessground/chessground.min.js"} <= set(linked)
    assert not [name for name in linked if "three" in name or "uplot" in name], "those wait for their panels"


def test_every_colour_is_a_name_of_one_sheet() -> None:
    sheets = {sheet.name: sheet.read_text() for sheet in (STATIC / "css").glob("*.css")}
    named = sheets.pop("tokens.css")
    assert len(sheets) >= 4
    own = {
        name: re.findall(r"#[0-9a-fA-F]{3,8}\b(?=[^{]*[;}])|\b(?:rgb|hsl)a?\(", text) for name, text in sheets.items()
    }
    assert {name: colours for name, colours in own.items() if colours} == {}
    known = set(re.findall(r"(--[\w-]+):", "".join([named, *sheets.values()])))
    sources = [*sheets.values(), named, *(one.read_text() for one in STATIC.rglob("*.js") if "vendor" not in one.parts)]
    used = {name for text in sources for name in re.findall(r"var\((--[\w-]+)[,)]|'(--[\w-]+)'", text)}
    assert {one or other for one, other in used} <= known


def test_modules_are_found_however_they_are_imported(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "index.html").write_text("")
    (tmp_path / "app.js").write_text(
        "import {\n  one,\n} from './parts/one.js';\nimport './parts/bare.js';\nlater(() => import('./late.js'));\n"
    )
    (tmp_path / "parts" / "one.js").write_text(
        "export {three} from '../three.js';\nconst text = 'import x from nowhere';\n"
    )
    for name in ("parts/bare.js", "three.js", "late.js"):
        (tmp_path / name).write_text("")
    assert StaticFiles(tmp_path).modules() == ("app.js", "parts/one.js", "parts/bare.js", "three.js")
