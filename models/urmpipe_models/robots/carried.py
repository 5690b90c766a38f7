"""What an arm has besides its joints, as robot files and recordings tell it: looks, masses and drives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from urmpipe_models.chains.chain import Chain
from urmpipe_models.chains.inertial import GRAVITY
from urmpipe_models.files.tables import Table
from urmpipe_models.robots.robot_drives import drive_to_dict, read_drive
from urmpipe_models.robots.robot_frames import Units
from urmpipe_models.robots.robot_inertials import inertial_to_dict, read_inertial
from urmpipe_models.robots.robot_visuals import read_visual, visual_to_dict

PARTS = ("visuals", "inertials", "drives")
"""Fields of a chain whose items know their own faults."""


def read_carried(table: Table, units: Units) -> dict[str, Any]:
    """Return fields of a chain: what it shows, weighs and is driven by, in SI; faults are noted in the table.

    What the file leaves out is left to a URDF. Masses that it gives take the place of a URDF's, whatever is
    wrong with those.
    """
    rows = {key: table.tables(key) if table.has(key) else [] for key in ("visuals", "inertials")}
    drives = table.named_tables("drives").items()
    parts = {
        "visuals": tuple(read_visual(row, units) for row in rows["visuals"]),
        "inertials": tuple(read_inertial(row, units) for row in rows["inertials"]),
        "drives": tuple(read_drive(name, one) for name, one in drives),
    }
    carried: dict[str, Any] = {key: part for key, part in parts.items() if part}
    for key in ("left_out", "mass_faults"):
        texts = table.texts(key) if table.has(key) else ()
        if texts or "inertials" in carried:
            carried[key] = texts
    return {**carried, "gravity": table.numbers("gravity", 3, GRAVITY)}


def own_faults(carried: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with the parts that `read_carried` returned, whatever joints they hang on."""
    for key in PARTS:
        for one in carried.get(key, ()):
            yield from one.faults()


def carried_to_dict(chain: Chain) -> dict[str, Any]:
    """Return what an arm has besides its joints as keys of a JSON object, without what it has not."""
    given: dict[str, Any] = {
        "gravity": [float(value) for value in chain.gravity] if chain.gravity != GRAVITY else [],
        "left_out": list(chain.left_out),
        "mass_faults": list(chain.mass_faults),
        "visuals": [visual_to_dict(visual) for visual in chain.visuals],
        "inertials": [inertial_to_dict(inertial) for inertial in chain.inertials],
        "drives": {drive.joint: drive_to_dict(drive) for drive in chain.drives},
    }
    return {key: value for key, value in given.items() if value}
