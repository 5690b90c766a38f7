"""How a name that is not there is told: with the one that may have been meant, and those that are allowed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import SequenceMatcher

from urmpipe_models.errors import shown

MOST_LISTED = 16
"""So many names are listed; of more, those most like the one that was given."""
LEAST_LIKE = 0.6
"""Share of letters that two names have in common, from where on one may have been meant by the other."""

LONGEST = 200
"""Letters of a name that may have been meant otherwise."""


def did_you_mean(name: str, allowed: Iterable[str]) -> str:
    """Return ` (did you mean NAME?)` with the allowed name most like another, or nothing if none is.

    Small and capital letters count as the same, hyphens, underscores and spaces for nothing.
    """
    near = nearest(name, allowed)
    return f" (did you mean {near}?)" if near else ""


def nearest(name: str, allowed: Iterable[str]) -> str | None:
    """Return the allowed name most like another; None if none is."""
    near = _nearest_first(name, allowed, LEAST_LIKE)
    return near[0] if near else None


def not_among(name: str, allowed: Iterable[str]) -> str:
    """Return `found NAME (did you mean ONE?), allowed: ONE, ...` for a name that is not among others."""
    names = list(dict.fromkeys(allowed))
    return f"found {shown(name)}{did_you_mean(name, names)}, allowed: {listed(name, names)}"


def listed(name: str, allowed: Iterable[str]) -> str:
    """Return the allowed names in their order; of more than `MOST_LISTED`, those like a given one."""
    names = list(dict.fromkeys(allowed))
    if len(names) <= MOST_LISTED:
        return ", ".join(names) or "none"
    first = ((name and _nearest_first(name, names, 0.0)) or names)[:MOST_LISTED]
    return f"{', '.join(first)} and {len(names) - len(first)} others"


def _nearest_first(name: str, allowed: Iterable[str], least: float) -> list[str]:
    """Return the names that are at least so much like another, the nearest first; of equal ones the last."""
    if len(name) > LONGEST:
        return []
    wanted = _letters(name)
    like = {one: SequenceMatcher(None, _letters(one), wanted).ratio() for one in allowed}
    return sorted((one for one in like if like[one] >= least), key=lambda one: (like[one], one), reverse=True)


def _letters(name: str) -> str:
    """Return a name without what is easily written otherwise."""
    return re.sub("[-_ ]", "", name.casefold())
