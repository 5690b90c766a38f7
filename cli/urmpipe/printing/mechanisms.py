"""Robots and networks in the terminal and as JSON.

1. Catalogues: `urmpipe robot list`, `urmpipe network list`.
2. A robot in one pose, `urmpipe robot show`: parameters, joints, masses, drives, points.
3. Numbers: six digits, from a nanometre; angles in [deg].
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from urmpipe.printing.terminal import new_console, new_table
from urmpipe_models.arm.chain import GRAVITY, Chain, Joint, frame_to_steps
from urmpipe_models.drives import PassiveJoint
from urmpipe_models.ik.closed import closed_form, format_method
from urmpipe_models.kinematics.forward import forward, points_over_log
from urmpipe_models.math3d import Transform, euler_zyx, matrix_to_rpy
from urmpipe_models.robots.toml import chain_to_dict, drive_to_dict

if TYPE_CHECKING:
    from rich.table import Table

    from urmpipe_models.networks.file import Network

LIMIT_COLUMNS = {"velocity": "Speed", "acceleration": "Acceleration", "effort": "Effort"}
ANGLE_UNIT = ("deg", 180.0 / math.pi)  # its factor is from [rad]
TIME_UNITS = {"velocity": "s", "acceleration": "s²"}  # divisor of the position's unit


def robots_dict(robots: Sequence[Chain]) -> dict[str, Any]:
    """Return the object that `urmpipe robot list --json` prints."""
    listed = [
        {
            "name": chain.name,
            "joints": list(chain.coordinates),
            "description": chain.description,
            "source": chain.source,
        }
        for chain in robots
    ]
    return {"schema": 1, "robots": listed}


def networks_dict(networks: Sequence[Network]) -> dict[str, Any]:
    """Return the object that `urmpipe network list --json` prints."""
    listed = [
        {
            "name": network.name,
            "bodies": len(network.body_names),
            "joints": len(network.joints),
            "elements": len(network.elements),
            "controls": [control.name for control in network.controls],
            "description": network.description,
            "source": network.source,
        }
        for network in networks
    ]
    return {"schema": 1, "networks": listed}


def print_robots(robots: Sequence[Chain]) -> None:
    """Print the robots of the catalogue."""
    table = new_table("Name", "Joints", "Length [m]", "Description", title=f"{len(robots)} robots")
    for chain in robots:
        links = np.diff(chain_at(chain, chain.start).skeleton, axis=0)
        length = float(np.linalg.norm(links, axis=1).sum())
        table.add_row(chain.name, str(len(chain.coordinates)), f"{length:.3f}", chain.description)
    new_console().print(table)


def print_networks(networks: Sequence[Network]) -> None:
    """Print the networks of the catalogue."""
    heads = ("Name", "Bodies", "Joints", "Elements", "Controls", "Description")
    table = new_table(*heads, title=f"{len(networks)} networks")
    for network in networks:
        counts = (len(network.body_names), len(network.joints), len(network.elements))
        controls = ", ".join(control.name for control in network.controls)
        table.add_row(network.name, *map(str, counts), controls, network.description)
    new_console().print(table)


class PosedChain(NamedTuple):
    """A robot in one pose.

    Attributes:
        chain: The robot.
        q: Its coordinates in [rad] or [m].
        poses: The points p1..pn.
        skeleton: The base and the points in [m], shape (n + 1, 3).
    """

    chain: Chain
    q: tuple[float, ...]
    poses: tuple[Transform, ...]
    skeleton: NDArray[np.float64]

    @property
    def inverse(self) -> str:
        """The closed form of its inverse kinematics, such as "spherical wrist"; "iterative" without one."""
        form = closed_form(self.chain)
        return "iterative" if form is None else form.name

    @property
    def title(self) -> str:
        """The robot's name, and its description if it has one."""
        return ": ".join(filter(None, (self.chain.name, self.chain.description)))

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe robot show --json` prints."""
        keys = ("name", "value", "unit", "kind", "axis", "place", "source")
        parameters = [
            {key: getattr(parameter, key) for key in keys} | {"value": float(parameter.value)}
            for parameter in self.chain.parameters
        ]
        points = {
            name: {"position": list(pose.translation), "euler_zyx": list(euler_zyx(pose.rotation)[:3])}
            for name, pose in zip(self.chain.point_names, self.poses, strict=True)
        }
        return {
            "schema": 1, **chain_to_dict(self.chain), "parameters": parameters,
            "coordinates": list(self.chain.coordinates), "q": list(self.q), "points": points,
            "inverse": self.inverse,
        }  # fmt: skip


def chain_at(chain: Chain, q: Sequence[float]) -> PosedChain:
    """Return a robot in one pose, q in [rad] or [m], one value per coordinate."""
    values = tuple(float(value) for value in q)
    return PosedChain(chain, values, forward(chain, values), points_over_log(chain, np.array([values]))[0])


def print_chain(posed: PosedChain) -> None:
    """Print the parameters, joints, masses, drives and points of a robot."""
    console, chain = new_console(), posed.chain
    console.print(posed.title, soft_wrap=True)
    if chain.source:
        console.print(f"Source: {chain.source}", soft_wrap=True)
    console.print(f"Inverse: {format_method(posed.inverse)}", soft_wrap=True)
    if chain.gravity != GRAVITY:
        console.print(f"Gravity: {_format_numbers(chain.gravity)} m/s²", soft_wrap=True)
    console.print(_parameter_table(chain))
    console.print(_joint_table(posed))
    if chain.inertials:
        console.print(_mass_table(chain))
    if chain.drives:
        console.print(_drive_table(chain))
    console.print(_point_table(posed))


def _parameter_table(chain: Chain) -> Table:
    zeros = sum(not parameter.value for parameter in chain.parameters)
    table = new_table(
        "Parameter", "Value", "Motion", "Frame", "Source",
        title=f"Parameters; {zeros} of value 0 not shown",
    )  # fmt: skip
    for k, (name, frame) in enumerate(zip(chain.frame_names, chain.frames, strict=True)):
        for parameter in chain.parameters:
            if parameter.frame_index == k and parameter.value:
                unit, factor = ("m", 1.0) if parameter.kind == "along" else ANGLE_UNIT
                value = f"{_format_number(parameter.value * factor)} {unit}"
                motion = f"{parameter.kind} {parameter.axis}"
                table.add_row(parameter.name, value, motion, name, parameter.source)
        for step in frame_to_steps(frame):
            if isinstance(step, Transform) and step != Transform():
                angles = _format_numbers(map(math.degrees, matrix_to_rpy(step.rotation)))
                table.add_row("", f"{angles} deg", "about x, y, z", name, "constant")
    return table


def _joint_table(posed: PosedChain) -> Table:
    joints = posed.chain.joints
    rates = [
        key
        for key in LIMIT_COLUMNS
        if key == "velocity" or any(math.isfinite(getattr(joint, key)) for joint in joints)
    ]
    columns = (LIMIT_COLUMNS[key] for key in rates)
    table = new_table("Joint", "Kind", "Axis", "Limits", *columns, "q", title="Joints")
    values = dict(zip(posed.chain.coordinates, posed.q, strict=True))
    for joint in joints:
        kind: str = joint.kind
        if joint.mimic is not None:
            kind = f"{kind}, {_format_number(joint.mimic.multiplier)} x {joint.mimic.joint}"
        cells: list[str] = []
        if joint.kind != "fixed":
            unit, factor = ("m", 1.0) if joint.kind == "prismatic" else ANGLE_UNIT
            limits = [_format_limit(joint, key, unit, factor) for key in rates]
            value = f"{_format_number(values[joint.name] * factor)} {unit}" if joint.name in values else ""
            cells = [_format_numbers(joint.axis), _format_range(joint, unit, factor), *limits, value]
        table.add_row(joint.name, kind, *cells)
    return table


def _format_limit(joint: Joint, key: str, unit: str, factor: float) -> str:
    """Return the limit of a speed, acceleration or effort, in a unit with its factor from [rad] or [m]."""
    limit = getattr(joint, key)
    if not math.isfinite(limit):
        return "no limit"
    if key == "effort":
        return f"{_format_number(limit)} {'N' if joint.kind == 'prismatic' else 'N.m'}"
    return f"{_format_number(limit * factor)} {unit}/{TIME_UNITS[key]}"


def _format_range(joint: Joint, unit: str, factor: float) -> str:
    lower, upper = joint.lower * factor, joint.upper * factor
    if not math.isfinite(lower) and not math.isfinite(upper):
        return "no limit"
    end = f"{_format_number(upper)} {unit}"
    if lower == upper:
        return f"only {end}"
    return f"+-{end}" if lower == -upper else f"{_format_number(lower)} .. {end}"


def _mass_table(chain: Chain) -> Table:
    total = sum(float(inertial.mass) for inertial in chain.inertials)
    table = new_table(
        "Joint", "Mass [kg]", "Centre x, y, z [m]", "Principal moments [kg.m²]", "Source",
        title=f"Masses; {_format_number(total)} kg in all",
    )  # fmt: skip
    for inertial in chain.inertials:
        moments = ", ".join(f"{moment + 0.0:.4g}" for moment in inertial.principal_moments)
        mass, centre = _format_number(inertial.mass), _format_numbers(inertial.centre)
        table.add_row(inertial.joint or "base", mass, centre, moments, inertial.source)
    return table


def _drive_table(chain: Chain) -> Table:
    table = new_table("Joint", "Kind", "Constants", title="Drives; constants in SI")
    for drive in chain.drives:
        constants = ", ".join(f"{key} = {value:.6g}" for key, value in drive_to_dict(drive).items())
        table.add_row(drive.joint, "held" if isinstance(drive, PassiveJoint) else "driven", constants)
    return table


def _point_table(posed: PosedChain) -> Table:
    table = new_table("Point", "x, y, z [m]", "rz, ry, rx [deg]", title="Points in this pose")
    for name, pose in zip(posed.chain.point_names, posed.poses, strict=True):
        angles = _format_numbers(map(math.degrees, euler_zyx(pose.rotation)[:3]))
        table.add_row(name, _format_numbers(pose.translation), angles)
    return table


def _format_numbers(values: Iterable[Any]) -> str:
    return ", ".join(map(_format_number, values))


def _format_number(value: float) -> str:
    """Return a number in six digits; what is below a nanometre is 0, without a sign."""
    return f"{round(float(value), 9) + 0.0:.6g}"
