"""Networks of a gear, a rack and a cam, as tables."""

from __future__ import annotations

from typing import Any

UNEVEN = [[10, 0.0], [55, 4.0], [90, 9.0], [200, -3.0], [310, 1.5]]  # deg and mm


def shaft(bodies: tuple[str, str], x: float = 0.0, **more: Any) -> dict[str, Any]:
    return {"kind": "revolute", "bodies": bodies, "n": [0, 0, 1], "a": [[x, 0, 0], [0, 0, 0]], **more}


def wheels(element: dict[str, Any], **joints: dict[str, Any]) -> dict[str, Any]:
    """Return tables of a driven shaft A, what else is on the ground, and a pair; in mm and deg."""
    names = ["A", *joints]
    return {
        "length_unit": "mm", "angle_unit": "deg",
        "bodies": {name.lower(): {} for name in names},
        "controls": {"turn": {"start": 50}},
        "joints": {"A": shaft(("ground", "a"), driven="turn"), **joints},
        "elements": {"pair": {"joints": ["A", names[-1]], **element}},
    }  # fmt: skip


SLIDE = {"kind": "prismatic", "bodies": ["ground", "s"], "n": [1, 0, 0]}
GEARED = wheels({"kind": "gear", "teeth": [20, 40], "offset": 30}, B=shaft(("ground", "b"), 300))
RACK = wheels({"kind": "rack", "radius": -8, "offset": 3}, S=SLIDE)
CAM = wheels({"kind": "cam", "profile": UNEVEN}, S=SLIDE)
