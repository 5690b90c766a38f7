"""The letters of a figure: none acts, and those that its font lacks come from another one of the system."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import chain

from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, fontManager, get_font
from matplotlib.text import Text

from urmpipe_models.errors import escape_control_characters
from urmpipe_pipeline.text import drop_surrogates

FONT = "DejaVu Sans"
"""The font that comes with matplotlib: a figure is the same everywhere."""


def drawable(words: str) -> str:
    """Return a text from a file as it is drawn: with escapes for what acts, without what is no letter."""
    return drop_surrogates(escape_control_characters(words))


def complete(made: Figure) -> None:
    """Draw the letters that the font of a figure lacks in other fonts, where some have them."""
    texts = [one for one in made.findobj(Text) if isinstance(one, Text)]
    lacking = frozenset(map(ord, chain(*(one.get_text() for one in texts)))) - _letters(findfont(FONT)) - {10}
    others = list(_fonts_with(lacking)) if lacking else []
    for one in texts if others else ():
        one.set_fontfamily([FONT, *others])


def _fonts_with(lacking: frozenset[int]) -> Iterator[str]:
    """Yield fonts of the system that have some letters, until all are found or there is no further font."""
    upright = (one for one in fontManager.ttflist if one.style == "normal" and one.weight in (400, "normal"))
    for font in sorted(upright, key=lambda one: one.name):
        if not lacking:
            return
        if found := lacking & _letters(font.fname):
            lacking -= found
            yield font.name


@cache
def _letters(path: str) -> frozenset[int]:
    """Return the letters that the font of a file has, as code points."""
    return frozenset(get_font(path).get_charmap())
