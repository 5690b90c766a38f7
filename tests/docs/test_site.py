"""The site builds without a warning, its links have targets, and no page loads anything from a network."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from pages import ROOT, text_of


class Links(HTMLParser):
    """The links of a page, what it loads, and the places that links may lead to."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.places: set[str] = {""}
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.places |= {given[name] for name in ("id", "name") if name in given}
        if "href" in given:
            (self.links if tag == "a" else self.loaded).append(given["href"])
        if "src" in given:
            self.loaded.append(given["src"])


links_of = cache(Links)
"""The links of a page, which is parsed once."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built with warnings as errors."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def missing(folder: Path) -> list[str]:
    """Return the links and files of a site's pages that lead nowhere in it."""
    pages = {page: links_of(page) for page in folder.rglob("*.html") if page.name != "404.html"}
    found = []
    for page, links in pages.items():
        for link in [*links.links, *links.loaded]:
            parts = urlsplit(link)
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            if parts.scheme or parts.netloc:
                continue
            places = pages[target].places if target in pages else {unquote(parts.fragment)}
            if not target.exists() or unquote(parts.fragment) not in places:
                found.append(f"{page.relative_to(folder)}: {link}")
    return found


@pytest.mark.slow
def test_every_link_of_the_site_leads_somewhere(site: Path) -> None:
    assert missing(site) == []


@pytest.mark.slow
def test_no_page_loads_anything_from_a_network(site: Path) -> None:
    loaded = {link for page in site.rglob("*.html") for link in links_of(page).loaded}
    assert [link for link in loaded if urlsplit(link).netloc] == []


def test_a_link_that_leads_nowhere_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text('<a href="b.html#x"></a><a href="c.html"></a><img src="d.png">')
    (tmp_path / "b.html").write_text('<p id="y"></p><a href="a.html">')
    assert missing(tmp_path) == ["a.html: b.html#x", "a.html: c.html", "a.html: d.png"]


def test_the_api_page_has_every_public_name() -> None:
    import urmpipe

    named = re.findall(r"^::: urmpipe\.(\w+)$", text_of("docs/api.md"), re.MULTILINE)
    assert sorted(named) == sorted({*urmpipe.__all__} - {"__version__"})
