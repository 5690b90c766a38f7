"""Figures of reasons, with as many digits as tell what was found from what is allowed."""

from __future__ import annotations

DIGITS = 4
"""Significant digits, where they are enough."""


def figures(found: float, *allowed: float) -> tuple[str, ...]:
    """Return what was found and the limits that are allowed as texts.

    All have four significant digits, or as many more as let the found one differ from every limit: "at
    2.7000001 rad, allowed: up to 2.7000000" would else read as within it.
    """
    for digits in range(DIGITS, 18):
        text, *limits = (f"{value:.{digits}g}" for value in (found, *allowed))
        if text not in limits:
            break
    return text, *limits
