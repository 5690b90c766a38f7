"""The masses of an arm, as robot files and recordings tell them."""

from __future__ import annotations

from typing import Any, cast

from urmpipe_models.chains.inertial import Inertial
from urmpipe_models.elementwise import ZERO
from urmpipe_models.files.tables import Table
from urmpipe_models.robots.robot_frames import Units


def read_inertial(table: Table, units: Units) -> Inertial:
    """Return the inertial of a table, in [kg], [m] and [kg.m2]; faults are noted in the table.

    Masses and inertias are SI whatever the units of the file; `centre` is in its unit of length.
    """
    x, y, z = (units.length(value) for value in table.numbers("centre", 3, ZERO))
    inertial = Inertial(
        table.text("joint", "") if table.has("joint") else None,
        table.number("mass"),
        (x, y, z),
        cast("Any", table.numbers("inertia", 6, (0.0,) * 6)),
        table.text("source", ""),
    )
    table.close()
    return inertial


def inertial_to_dict(inertial: Inertial) -> dict[str, Any]:
    """Return an inertial as a JSON object: `read_inertial`'s exact inverse."""
    given = {
        "joint": inertial.joint,
        "mass": float(inertial.mass),
        "centre": [float(value) for value in inertial.centre],
        "inertia": [float(value) for value in inertial.inertia],
        "source": inertial.source or None,
    }
    return {key: value for key, value in given.items() if value is not None}
