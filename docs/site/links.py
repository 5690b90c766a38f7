"""Hooks of mkdocs: files beside docs/ that pages link to, as files of the site.

In the site, docs/ is the root. A file elsewhere in the repository keeps its path, README.md is the first
page, and a folder is a list of its pages. So a link works in the repository and in the site.
"""

from __future__ import annotations

import re
from functools import cache
from os.path import relpath
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from mkdocs.structure.files import File, Files

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(?<=\]\()([^)#:\s]+)")
"""The path of a link to a file, without an anchor."""

BESIDE = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")
"""Pages beside docs/ that are in the navigation."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files beside docs/ that pages link to, and those that these link to."""
    new = {PurePosixPath(name) for name in BESIDE} | {
        target for file in files.documentation_pages() for target in links(repository_path(file.src_uri))
    }
    added = set[PurePosixPath]()
    while new:
        added |= new
        new = {target for path in new for target in links(path)} - added
    for path in sorted(added):
        if path.parts[0] != "docs":
            files.append(generated(config, path))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links lead to where the site has what the repository has elsewhere."""
    path = repository_path(page.file.src_uri)

    def moved(link: re.Match[str]) -> str:
        target = linked(path, link[1])
        return link[1] if target is None else relative(site_path(target), page.file.src_uri)

    return LINK.sub(moved, markdown)


def generated(config: MkDocsConfig, path: PurePosixPath) -> File:
    """Return a file of the repository, or the list of a folder's pages, as a file of the site."""
    place = ROOT / path
    if place.is_dir():
        return File.generated(config, site_path(path), content=listing(place))
    return File.generated(config, site_path(path), abs_src_path=str(place))


def listing(folder: Path) -> str:
    """Return a page that links to each page of a folder by its title."""
    rows = [f"- [{title(page)}]({page.name})" for page in sorted(folder.glob("*.md"))]
    return "\n".join([f"# {folder.parent.name.capitalize()}: {folder.name}", "", *rows, ""])


def title(page: Path) -> str:
    """Return the first heading of a page."""
    return page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")


@cache
def links(path: PurePosixPath) -> frozenset[PurePosixPath]:
    """Return what a page links to in the repository; a folder's list links to its pages."""
    place = ROOT / path
    if place.is_dir():
        return frozenset(path / page.name for page in place.glob("*.md"))
    if path.suffix != ".md":
        return frozenset()
    found = (linked(path, link) for link in LINK.findall(place.read_text(encoding="utf-8")))
    return frozenset(target for target in found if target is not None)


def linked(path: PurePosixPath, link: str) -> PurePosixPath | None:
    """Return the path in the repository that a link of a page leads to, or None if nothing is there."""
    target = (ROOT / path.parent / link).resolve()
    if not target.exists() or not target.is_relative_to(ROOT):
        return None
    return PurePosixPath(target.relative_to(ROOT).as_posix())


def site_path(path: PurePosixPath) -> str:
    """Return where the site has a file of the repository."""
    if path == PurePosixPath("README.md"):
        return "index.md"
    if (ROOT / path).is_dir():
        return (path / "index.md").as_posix()
    if path.suffix == ".ipynb":
        path = path.with_suffix(".md")
    return path.relative_to("docs").as_posix() if path.parts[0] == "docs" else path.as_posix()


def repository_path(uri: str) -> PurePosixPath:
    """Return where the repository has a page of the site."""
    if uri == "index.md":
        return PurePosixPath("README.md")
    path = PurePosixPath(uri)
    in_docs = "docs" / path
    if (ROOT / in_docs.with_suffix(".ipynb")).exists():
        return in_docs.with_suffix(".ipynb")
    return in_docs if (ROOT / in_docs).exists() else path.parent if path.name == "index.md" else path


def relative(target: str, page: str) -> str:
    """Return the link from one page of the site to a file of it."""
    return PurePosixPath(relpath(target, PurePosixPath(page).parent)).as_posix()
