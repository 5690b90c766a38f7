"""Checks of the options that a unit is made with: they come from a file or a command line."""

from __future__ import annotations

from typing import Any

from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import UnitError, shown

MOST = 1000
"""Most of what an option counts: as many as the links of a robot; each adds variables, equations and C."""


def an_arm(unit: str, value: Any) -> None:
    """Check the option of a robot.

    Raises:
        UnitError: If it is none.
    """
    if not isinstance(value, Chain):
        raise UnitError(f"unit {unit}: option robot: found {shown(value)}, allowed: a robot (Chain)")


def whole_number(unit: str, option: str, value: Any) -> int:
    """Return an option that counts something.

    Raises:
        UnitError: If it is no integer from 1 to `MOST`.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= MOST:
        too_many = isinstance(value, int) and value > MOST
        allowed = f"{MOST} at most" if too_many else "an integer, 1 or more"
        raise UnitError(f"unit {unit}: option {option}: found {shown(value)}, allowed: {allowed}")
    return value


def yes_or_no(unit: str, option: str, value: Any) -> bool:
    """Return an option that is true or false.

    Raises:
        UnitError: If it is neither.
    """
    if not isinstance(value, bool):
        raise UnitError(f"unit {unit}: option {option}: found {shown(value)}, allowed: true or false")
    return value


def some_of(unit: str, option: str, value: Any, allowed: tuple[str, ...]) -> tuple[str, ...]:
    """Return an option that names one or some of what there is, in the order in which that stands.

    Raises:
        UnitError: If it is neither a name nor a list, or with every name that there is not.
    """
    if isinstance(value, str):
        value = [value]
    if not isinstance(value, (list, tuple)):
        raise UnitError(
            f"unit {unit}: option {option}: found {shown(value)}, allowed: a list of {', '.join(allowed)}"
        )
    wrong = [one for one in value if one not in allowed]
    if wrong:
        raise UnitError(
            *(
                f"unit {unit}: option {option}: found {shown(one)}, allowed: {', '.join(allowed)}"
                for one in wrong
            )
        )
    return tuple(one for one in allowed if one in value)
