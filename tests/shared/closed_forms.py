"""The closed form of an arm that must have one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from urmpipe_models.chains.chain import Chain
from urmpipe_models.kinematics.screws import Screws, screws

Form = TypeVar("Form")


def form_by(recognised: Callable[[Screws, tuple[str, ...]], Form | None], chain: Chain) -> Form:
    """Return what a form recognises in a chain."""
    found = screws(chain)
    assert found is not None
    form = recognised(found, chain.coordinates)
    assert form is not None
    return form
