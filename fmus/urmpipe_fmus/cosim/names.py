"""How a name that is not there is told: with the nearest of those that are."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

SHOWN = 12
"""So many names are listed; of more, the nearest."""


def not_among(name: str, allowed: Iterable[str]) -> str:
    """Return `found NAME, allowed: ...` for a name that is not among others."""
    names = list(allowed)
    near = get_close_matches(name, names, n=SHOWN, cutoff=0.5)
    if not names:
        return f"found {name!r}, allowed: none"
    if len(names) <= SHOWN:
        return f"found {name!r}, allowed: {', '.join(dict.fromkeys([*near, *names]))}"
    shown = list(dict.fromkeys([*near, *names]))[: len(near) or SHOWN]
    return f"found {name!r}, allowed: {', '.join(shown)} and {len(names) - len(shown)} others"
