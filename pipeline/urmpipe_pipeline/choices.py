"""What is given as one of some words."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.errors import Finding, OptionError


def check_choice(parameter: str, found: str, allowed: Sequence[str]) -> None:
    """Raise an `OptionError` if what was given for a parameter is none of the words that are allowed."""
    if found not in allowed:
        raise OptionError(Finding(parameter=parameter, found=found, allowed=", ".join(allowed)))
