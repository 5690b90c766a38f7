"""What drives or holds the joints of an arm, as robot files and recordings tell it."""

from __future__ import annotations

from urmpipe_models.drives.controller import Gains
from urmpipe_models.drives.drive import Drive
from urmpipe_models.drives.joint_drives import (
    DRIVE_KEYS,
    GAIN_KEYS,
    NO_SPRING,
    SPRING_KEYS,
    DrivenJoint,
    HeldJoint,
    JointDrive,
    ReliefSpring,
)
from urmpipe_models.files.tables import Table

HELD_KEYS = DRIVE_KEYS[:2]
"""The keys of a joint that is only held; any other key makes it a driven one, which needs them all."""


def read_drive(joint: str, table: Table) -> JointDrive:
    """Return the drive of a table, in SI whatever the units of the file; faults are noted in the table."""
    further = (*DRIVE_KEYS[2:], "period", *GAIN_KEYS, "u_max")
    driven = [key for key in (*further, *SPRING_KEYS) if table.has(key)]
    sprung = SPRING_KEYS if any(map(table.has, SPRING_KEYS)) else ()
    values = {key: table.number(key) for key in (*HELD_KEYS, *(further if driven else ()), *sprung)}
    table.close()
    if not driven:
        return HeldJoint(joint, *values.values())
    drive, gains = Drive(*map(values.get, DRIVE_KEYS)), Gains(*map(values.get, GAIN_KEYS))
    spring = ReliefSpring(*map(values.get, SPRING_KEYS)) if sprung else NO_SPRING
    return DrivenJoint(joint, drive, values["period"], gains, values["u_max"], spring)


def drive_to_dict(drive: JointDrive) -> dict[str, float]:
    """Return the constants of a drive as a JSON object: `read_drive`'s exact inverse."""
    if isinstance(drive, HeldJoint):
        return {"k": float(drive.stiffness), "l": float(drive.damping)}
    given = {
        **dict(zip(DRIVE_KEYS, drive.drive, strict=True)),
        "period": drive.period,
        **dict(zip(GAIN_KEYS, drive.gains, strict=True)),
        "u_max": drive.largest_voltage,
        **(dict(zip(SPRING_KEYS, drive.spring, strict=True)) if drive.spring != NO_SPRING else {}),
    }
    return {key: float(value) for key, value in given.items()}
