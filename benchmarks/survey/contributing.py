"""The table of CONTRIBUTING, between its two markers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

BEGIN = "<!-- house: written by benchmarks/house.py --write -->"
END = "<!-- /house -->"


def shown(page: Path) -> list[str]:
    """Return the lines between the markers."""
    before, after = _parts(page)
    text = page.read_text(encoding="utf-8")
    return text[len(before) : len(text) - len(after)].strip("\n").splitlines()


def show(page: Path, lines: Sequence[str]) -> None:
    """Put lines between the markers, in place of what stands there."""
    before, after = _parts(page)
    page.write_text("\n".join([before, *lines, after]), encoding="utf-8")


def _parts(page: Path) -> tuple[str, str]:
    """Return a page up to its first marker and from its second one; one that lacks them is a ValueError."""
    text = page.read_text(encoding="utf-8")
    start, end = text.find(BEGIN), text.find(END)
    if not 0 <= start < end:
        raise ValueError(f"{page.name} lacks the lines '{BEGIN}' and '{END}'")
    return text[: start + len(BEGIN)], text[end:]
