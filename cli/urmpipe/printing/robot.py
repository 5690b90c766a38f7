"""What `urmpipe robot` prints: the catalogue, and one arm in one pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from urmpipe.printing.terminal import new_console, new_table
from urmpipe_models.arm.chain import GRAVITY, Chain, Joint, Parameter, frame_to_steps
from urmpipe_models.drives import PassiveJoint
from urmpipe_models.ik.closed import closed_form, format_method
from urmpipe_models.kinematics.forward import forward, points_over_log
from urmpipe_models.math3d import Transform, euler_zyx, matrix_to_rpy
from urmpipe_models.robots.toml import chain_to_dict, drive_to_dict

if TYPE_CHECKING:
    from rich.table import Table

COLUMNS = {"velocity": "Speed", "acceleration": "Acceleration", "effort": "Effort"}
"""The limits of a joint that have a column of their own; all but the speed only where one is known."""

PER = {"velocity": "s", "acceleration": "s²"}
"""What a rate of a joint is counted by."""


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


@dataclass(frozen=True, slots=True, eq=False)
class PosedChain:
    """An arm in one pose.

    Attributes:
        chain: The arm.
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
        """What makes its inverse a closed form, such as "spherical wrist"; "iterative" without one."""
        form = closed_form(self.chain)
        return "iterative" if form is None else form.name

    @property
    def title(self) -> str:
        """The robot's name, and what it is if that is known."""
        return ": ".join(filter(None, (self.chain.name, self.chain.description)))

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe robot show --json` prints."""
        names = self.chain.point_names
        points = {
            name: {"position": list(pose.translation), "euler_zyx": list(euler_zyx(pose.rotation)[:3])}
            for name, pose in zip(names, self.poses, strict=True)
        }
        described, parameters = chain_to_dict(self.chain), map(_parameter_dict, self.chain.parameters)
        return {
            "schema": 1, **described, "parameters": list(parameters),
            "coordinates": list(self.chain.coordinates), "q": list(self.q), "points": points,
            "inverse": self.inverse,
        }  # fmt: skip


def _parameter_dict(one: Parameter) -> dict[str, Any]:
    return {
        "name": one.name, "value": float(one.value), "unit": one.unit, "kind": one.kind, "axis": one.axis,
        "place": one.place, "source": one.source,
    }  # fmt: skip


def chain_at(chain: Chain, q: Sequence[float]) -> PosedChain:
    """Return an arm in one pose, q in [rad] or [m], one value a coordinate."""
    values = tuple(float(value) for value in q)
    return PosedChain(chain, values, forward(chain, values), points_over_log(chain, np.array([values]))[0])


def print_robots(robots: Sequence[Chain]) -> None:
    """Print the catalogue."""
    table = new_table("Name", "Joints", "Length [m]", "Description", title=f"{len(robots)} robots")
    for chain in robots:
        ways = np.diff(chain_at(chain, chain.start).skeleton, axis=0)
        length = float(np.linalg.norm(ways, axis=1).sum())
        table.add_row(chain.name, str(len(chain.coordinates)), f"{length:.3f}", chain.description)
    new_console().print(table)


def print_chain(posed: PosedChain) -> None:
    """Print an arm's parameters, joints, masses and drives, and where its points are."""
    console, chain = new_console(), posed.chain
    console.print(posed.title, soft_wrap=True)
    if chain.source:
        console.print(f"Source: {chain.source}", soft_wrap=True)
    console.print(f"Inverse: {format_method(posed.inverse)}", soft_wrap=True)
    if chain.gravity != GRAVITY:
        console.print(f"Gravity: {_figures(chain.gravity)} m/s²", soft_wrap=True)
    console.print(_parameters(chain))
    console.print(_joints(posed))
    if chain.inertials:
        console.print(_masses(chain))
    if chain.drives:
        console.print(_drives(chain))
    console.print(_points(posed))


def _parameters(chain: Chain) -> Table:
    zeros = sum(not one.value for one in chain.parameters)
    table = new_table(
        "Parameter", "Value", "Motion", "Frame", "Source",
        title=f"Parameters; {zeros} of value 0 not shown",
    )  # fmt: skip
    for k, (name, frame) in enumerate(zip(chain.frame_names, chain.frames, strict=True)):
        for one in chain.parameters:
            if one.frame_index == k and one.value:
                table.add_row(one.name, _value(one), f"{one.kind} {one.axis}", name, one.source)
        for part in frame_to_steps(frame):
            if isinstance(part, Transform) and part != Transform():
                turn = _figures(math.degrees(angle) for angle in matrix_to_rpy(part.rotation))
                table.add_row("", f"{turn} deg", "about x, y, z", name, "constant")
    return table


def _value(one: Parameter) -> str:
    return f"{_figure(one.value)} m" if one.kind == "along" else f"{_figure(math.degrees(one.value))} deg"


def _joints(posed: PosedChain) -> Table:
    joints = posed.chain.joints
    shown = [
        key for key in COLUMNS if key == "velocity" or any(math.isfinite(getattr(one, key)) for one in joints)
    ]
    columns = (COLUMNS[key] for key in shown)
    table = new_table("Joint", "Kind", "Axis", "Limits", *columns, "q", title="Joints")
    values = dict(zip(posed.chain.coordinates, posed.q, strict=True))
    for joint in joints:
        table.add_row(joint.name, _kind(joint), *_motion(joint, values, shown))
    return table


def _masses(chain: Chain) -> Table:
    total = sum(float(one.mass) for one in chain.inertials)
    table = new_table(
        "Joint", "Mass [kg]", "Centre x, y, z [m]", "Principal moments [kg.m²]", "Source",
        title=f"Masses; {_figure(total)} kg in all",
    )  # fmt: skip
    for one in chain.inertials:
        principal = ", ".join(f"{moment + 0.0:.4g}" for moment in one.principal_moments)
        table.add_row(one.joint or "base", _figure(one.mass), _figures(one.centre), principal, one.source)
    return table


def _drives(chain: Chain) -> Table:
    table = new_table("Joint", "Kind", "Constants", title="Drives; constants in SI")
    for one in chain.drives:
        constants = ", ".join(f"{key} = {value:.6g}" for key, value in drive_to_dict(one).items())
        table.add_row(one.joint, "held" if isinstance(one, PassiveJoint) else "driven", constants)
    return table


def _points(posed: PosedChain) -> Table:
    table = new_table("Point", "x, y, z [m]", "rz, ry, rx [deg]", title="Points in this pose")
    for name, pose in zip(posed.chain.point_names, posed.poses, strict=True):
        angles = (math.degrees(angle) for angle in euler_zyx(pose.rotation)[:3])
        table.add_row(name, _figures(pose.translation), _figures(angles))
    return table


def _kind(joint: Joint) -> str:
    if joint.mimic is None:
        return joint.kind
    return f"{joint.kind}, {_figure(joint.mimic.multiplier)} x {joint.mimic.joint}"


def _motion(joint: Joint, values: dict[str, float], rates: Sequence[str]) -> tuple[str, ...]:
    """Return axis, limits, the largest of some rates and efforts, and coordinate of a moving joint."""
    if joint.kind == "fixed":
        return ()
    unit, factor = ("m", 1.0) if joint.kind == "prismatic" else ("deg", 180.0 / math.pi)
    value = f"{_figure(values[joint.name] * factor)} {unit}" if joint.name in values else ""
    largest = (_largest(joint, key, unit, factor) for key in rates)
    return _figures(joint.axis), _limits(joint, unit, factor), *largest, value


def _largest(joint: Joint, key: str, unit: str, factor: float) -> str:
    """Return the largest speed, acceleration or effort of a joint in words.

    Args:
        joint: It moves.
        key: Which of `COLUMNS`.
        unit: Unit that its position is shown in, deg or m.
        factor: From [rad] or [m] to that unit.
    """
    most = getattr(joint, key)
    if not math.isfinite(most):
        return "no limit"
    if key == "effort":
        return f"{_figure(most)} {'N' if joint.kind == 'prismatic' else 'N.m'}"
    return f"{_figure(most * factor)} {unit}/{PER[key]}"


def _limits(joint: Joint, unit: str, factor: float) -> str:
    lower, upper = joint.lower * factor, joint.upper * factor
    if not math.isfinite(lower) and not math.isfinite(upper):
        return "no limit"
    if lower == upper:
        return f"only {_figure(upper)} {unit}"
    return f"+-{_figure(upper)} {unit}" if lower == -upper else f"{_figure(lower)} .. {_figure(upper)} {unit}"


def _figures(values: Any) -> str:
    return ", ".join(_figure(value) for value in values)


def _figure(value: float) -> str:
    """Return a number for people: a nanometre is nothing, and nothing has no sign."""
    return f"{round(float(value), 9) + 0.0:.6g}"
