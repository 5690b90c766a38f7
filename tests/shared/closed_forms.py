"""The closed form of an arm that must have one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from asserting import there
from urmpipe_models.arm.chain import Chain
from urmpipe_models.kinematics.forward import Screws, chain_to_screws

Form = TypeVar("Form")


def form_by(recognised: Callable[[Screws, tuple[str, ...]], Form | None], chain: Chain) -> Form:
    """Return what a form recognises in a chain."""
    found = there(chain_to_screws(chain))
    return there(recognised(found, chain.coordinates))
