"""The motion of a driven network: its data, what it shows, its tables and its JSON.

- `NetworkMotion`: the variables over time with their rates; joints, points and poses follow from them.
- `motion_run`: the same as a run, whose tool centre point is the traced point, for compare and export.
- `present`: headline, facts, tables of singular poses, transmission and forces, plots, scene, drawings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from urmpipe_models.display import format_count, format_headline
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.math3d import to_quaternions
from urmpipe_models.networks.closure import iter_chunks
from urmpipe_models.networks.continuation import Passage
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.rates import Taylor, point_motion
from urmpipe_pipeline import text
from urmpipe_pipeline.joint_log import NETWORK, JointLog, LogColumn, LogWarning, ns_to_seconds
from urmpipe_pipeline.networks.motion_drawing import (
    MovingNetwork,
    motion_space_figure,
    motion_svg,
    moving_scene,
)
from urmpipe_pipeline.presentation.exports import Exports
from urmpipe_pipeline.presentation.figure import Drawing, Figure, Line, Panel, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, joint_colour
from urmpipe_pipeline.presentation.parts import (
    Heads,
    columns_of,
    inputs_table,
    provenance_table,
    recording_fact,
    table_of,
)
from urmpipe_pipeline.presentation.scene import Scene
from urmpipe_pipeline.presentation.section import (
    Block,
    Cell,
    Check,
    Event,
    Fact,
    Judged,
    Presentation,
    Ref,
    Section,
    Table,
    Value,
)
from urmpipe_pipeline.provenance import Provenance
from urmpipe_pipeline.runs import exports as run_exports
from urmpipe_pipeline.runs.figures import joint_panels
from urmpipe_pipeline.runs.run import SCHEMA, Run, RunLike

if TYPE_CHECKING:
    import pandas as pd

MAX_SHOWN = 4000  # instants of the viewer's scene; a network of ten bodies then takes about 10 MB
SHOWN_NS = 20_000_000  # ns between instants of the scene at least: 50 Hz, as of arms
DRAWN = 400  # instants of a curve in a drawing
NAMED = 4  # variables of a direction that are named in a sentence
FORCE_UNITS = {"rad": "N.m", "m": "N"}  # of what drives an angle or a length


@dataclass(frozen=True, slots=True)
class DriveRange:
    """A prescribed variable.

    Attributes:
        name: Its name: a control, a joint, or JOINT[k].
        unit: rad, m, or "" of a control that is neither.
        begin: Its value at the first row, in `unit`.
        end: Its value at the last row that was requested, likewise.
    """

    name: str
    unit: str
    begin: float
    end: float


@dataclass(frozen=True, slots=True)
class MotionEvent:
    """A singular pose, or a limit that ends a motion.

    Attributes:
        kind: turns back, branches, goes through, or limit.
        row: Its row, from 0, with a fraction.
        t: Its time in [s].
        values: The prescribed variables there in their units, by name.
        direction: Variables that become free to move, by name: their share of it, the largest 1 [-].
        message: What happens there.
    """

    kind: Passage | Literal["limit"]
    row: float
    t: float
    values: dict[str, float]
    direction: dict[str, float]
    message: str


@dataclass(frozen=True, slots=True)
class Transmission:
    """Rate of a variable per rate of a drive, dy/dd.

    Attributes:
        variable: Name of the variable.
        drive: Name of the drive.
        unit: Its unit, such as rad/rad.
        smallest: The smallest ratio.
        smallest_at: The drive's value there.
        largest: The largest ratio.
        largest_at: The drive's value there.
        dead_points: Values of the drive at which the ratio changes its sign: there the variable cannot drive.
    """

    variable: str
    drive: str
    unit: str
    smallest: float
    smallest_at: float
    largest: float
    largest_at: float
    dead_points: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MotionForces:
    """Static forces along a motion.

    Attributes:
        drives: Of the drives in [N.m], [N], or per unit of the control, shape (n, drives).
        names: Names of the columns of `reactions`, such as "A force m" and "leg1".
        reactions: Of joints on their second body along m, n, m x n of their frames in [N] and [N.m], of
            elements in [N], shape (n, columns); NaN where redundant constraints leave them undetermined.
    """

    drives: FloatArray
    names: tuple[str, ...]
    reactions: FloatArray


@dataclass(frozen=True, eq=False, repr=False)
class NetworkMotion(RunLike):
    """The motion of a driven network on one branch.

    Attributes:
        name: Name of the network.
        network: The network.
        drives: The prescribed variables.
        law: How the drives move over time: uniform, trapezoid, quintic, or log.
        tsp: Time from row to row in [s].
        requested: How many rows were requested; fewer if the motion ends early.
        t_ns: Times in integer [ns], shape (n,).
        x: The variables in [m], [rad] and as controls are given, shape (n, variables).
        xd: Their rates per [s], likewise.
        xdd: Their second derivatives per [s2], likewise.
        distance: Smallest singular value of the scaled Jacobian of the variables that follow [-], shape
            (n,): 0 at a singular pose.
        body: The body of the traced point; empty without one.
        point: The traced point in the frame of its body in [m].
        events: Singular poses, and the limit that ends the motion, in their order.
        transmission: Of each joint that follows, by each drive.
        forces: Static forces; None without loads.
        warnings: What a person should know.
        provenance: How to repeat it.
        recording: Where it was written.
        log: The log (CSV) that was written.
    """

    name: str
    network: Network
    drives: tuple[DriveRange, ...]
    law: str
    tsp: float
    requested: int
    t_ns: IntArray
    x: FloatArray
    xd: FloatArray
    xdd: FloatArray
    distance: FloatArray
    body: str
    point: tuple[float, float, float]
    events: tuple[MotionEvent, ...]
    transmission: tuple[Transmission, ...]
    forces: MotionForces | None
    warnings: tuple[LogWarning, ...]
    provenance: Provenance
    recording: Path | None = field(default=None, metadata={"stored": False})
    log: Path | None = field(default=None, metadata={"stored": False})

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def t(self) -> FloatArray:
        """Times in [s], shape (n,)."""
        return ns_to_seconds(self.t_ns)

    @property
    def complete(self) -> bool:
        """Whether the drives reach their end."""
        return len(self) == self.requested

    @property
    def verdict(self) -> Literal["pass", "fail"]:
        """Pass if the drives reach their end."""
        return "pass" if self.complete else "fail"

    @property
    def output(self) -> Path | None:
        """The recording or the log that was written."""
        return self.recording or self.log

    @cached_property
    def mechanism(self) -> Mechanism:
        """The network in numbers."""
        return build_mechanism(self.network)

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of the joint variables, and of controls that drive only lengths, such as legs."""
        return tuple(name for name, _, _ in _joint_columns(self.mechanism))

    @cached_property
    def joint_units(self) -> list[str]:
        """The SI unit of each of them, rad or m."""
        return [unit for _, unit, _ in _joint_columns(self.mechanism)]

    @cached_property
    def joint_motion(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Their values in [rad] or [m], and two derivatives by time, shape (n, joints) each."""
        columns = list(_joint_columns(self.mechanism))
        parts = np.zeros((3, len(self), len(columns)))
        for rows in iter_chunks(len(self)):
            variables = [
                Taylor(*terms)
                for terms in zip(self.x[rows].T, self.xd[rows].T, self.xdd[rows].T, strict=True)
            ]
            for k, (_, _, value) in enumerate(columns):
                element = value(variables)
                terms = (
                    (element.value, element.first, element.second)
                    if isinstance(element, Taylor)
                    else (element, 0, 0)
                )
                for part, term in zip(parts, terms, strict=True):
                    part[rows, k] = term
        return parts[0], parts[1], parts[2]

    @cached_property
    def point_motion(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Position [m], velocity [m/s] and acceleration [m/s2] of the traced point, shape (n, 3) each."""
        if not self.body:
            return None
        return point_motion(self.mechanism, self.x.T, self.xd.T, self.xdd.T, self.body, self.point)

    def poses(self, rows: IntArray | slice = slice(None)) -> FloatArray:
        """Return poses of the bodies, the ground first, [-] and [m], shape (n, bodies, 4, 4)."""
        x = self.x[rows].T
        poses = np.zeros((x.shape[1], len(self.network.body_names), 4, 4))
        poses[:, :, 3, 3] = 1.0
        frames = self.mechanism.poses(x)
        for k, name in enumerate(self.network.body_names):
            frame = frames[name]
            for i, row in enumerate(frame.rotation):
                for j, entry in enumerate((*row, frame.translation[i])):
                    poses[:, k, i, j] = entry
        return poses

    def element_lengths(self, rows: IntArray | slice = slice(None)) -> FloatArray:
        """Return the lengths of the elements in [m], shape (n, elements)."""
        x = self.x[rows].T
        lengths = [np.broadcast_to(length.value, x.shape[1]) for length in self.mechanism.lengths(x)]
        return np.array(lengths, dtype=np.float64).reshape(-1, x.shape[1]).T

    @cached_property
    def quat_xyzw(self) -> FloatArray | None:
        """Orientation of the traced point's body as x, y, z, w [-], shape (n, 4); None without one."""
        if not self.body:
            return None
        frame = self.mechanism.poses(self.x.T)[self.body]
        rows = np.empty((9, len(self)))
        for k, entry in enumerate(entry for row in frame.rotation for entry in row):
            rows[k] = entry
        return to_quaternions(rows.T, "matrix")

    def as_run(self) -> Run:
        """Return the motion as a run: its joints, and the traced point as the recorded tool centre point."""
        return motion_run(self)

    def _headline(self) -> str:
        """Return its verdict, its drives and its duration."""
        rows = f"{len(self)} of {self.requested} rows" if not self.complete else f"{len(self)} rows"
        return format_headline(self.name, self.verdict, ", ".join(drive.name for drive in self.drives), rows)

    def to_frame(self) -> pd.DataFrame:
        """Return one row per sample.

        Columns: t [s]; the joints in [rad] or [m], their rates (d_) and second derivatives (dd_); with a
        traced point x, y, z, vx, vy, vz, ax, ay, az; distance [-]; with loads the forces of the drives
        (f_NAME) and the reactions.
        """
        import pandas as pd

        columns: dict[str, Any] = {"t": self.t}
        for prefix, values in zip(("", "d_", "dd_"), self.joint_motion, strict=True):
            columns |= {f"{prefix}{name}": values[:, k] for k, name in enumerate(self.joints)}
        for prefix, values in zip(("", "v", "a"), self.point_motion or (), strict=False):
            columns |= {f"{prefix}{axis}": values[:, k] for k, axis in enumerate("xyz")}
        columns["distance"] = self.distance
        if self.forces is not None:
            columns |= {f"f_{item.name}": self.forces.drives[:, k] for k, item in enumerate(self.drives)}
            columns |= {name: self.forces.reactions[:, k] for k, name in enumerate(self.forces.names)}
        return pd.DataFrame(columns)

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe network drive --json` prints."""
        nearest = int(np.argmin(self.distance))
        known = bool(np.isfinite(self.distance).any())
        return {
            "schema": SCHEMA,
            "name": self.name,
            "verdict": self.verdict,
            "drives": [asdict(drive) for drive in self.drives],
            "law": self.law,
            "rows": len(self),
            "requested": self.requested,
            "duration": float(self.t[-1]),
            "tsp": self.tsp,
            "joints": list(self.joints),
            "events": [asdict(event) for event in self.events],
            "transmission": [
                asdict(ratio) | {"dead_points": list(ratio.dead_points)} for ratio in self.transmission
            ],
            "distance": {"smallest": float(self.distance[nearest]), "t": float(self.t[nearest])}
            if known
            else None,
            "point": {"body": self.body, "point": list(self.point)} if self.body else None,
            "forces": self._forces_dict(),
            "warnings": [warning.to_dict() for warning in self.warnings],
            "output": str(self.output) if self.output else None,
        }

    def _forces_dict(self) -> dict[str, Any] | None:
        if self.forces is None:
            return None
        largest = np.nanmax(np.abs(self.forces.drives), axis=0)
        unknown = np.flatnonzero(np.isnan(self.forces.reactions).all(axis=0)).tolist()
        return {
            "drives": {item.name: float(largest[k]) for k, item in enumerate(self.drives)},
            "reactions": {
                name: None if k in unknown else float(np.nanmax(np.abs(self.forces.reactions[:, k])))
                for k, name in enumerate(self.forces.names)
            },
        }


def _joint_columns(mechanism: Mechanism) -> Iterator[tuple[str, str, Any]]:
    """Yield name, unit and value, a function of the variables, of joint variables and controls of lengths."""
    network = mechanism.network
    drives = [drive for joint in network.joints for drive in joint.drives if drive is not None]
    shown = {network.sole_control(drive.text) for drive in drives}
    for joint in network.joints:
        for k, unit in enumerate(joint.units):
            name = joint.name if len(joint.units) == 1 else f"{joint.name}_{k + 1}"
            yield name, unit, partial(_joint_value, mechanism, joint, k)
    for control in network.controls:
        unit_factor = network.control_unit(control.name)
        if unit_factor is not None and control.name not in shown:
            value = partial(_control_value, mechanism, control.name, float(unit_factor[1]))
            yield control.name, unit_factor[0], value


def _joint_value(mechanism: Mechanism, joint: Any, k: int, x: Any) -> Any:
    return mechanism.joint_values(joint, x)[k].value


def _control_value(mechanism: Mechanism, name: str, factor: float, x: Any) -> Any:
    return mechanism.control_values(x)[name].value * factor


def motion_run(motion: NetworkMotion) -> Run:
    """Return the motion of a network as a run, with rates and accelerations as they were computed."""
    q, qd, qdd = motion.joint_motion
    names = motion.joints
    columns = [LogColumn("t", "t [s]", "time", 0, "s", number=1)]
    for k, (name, unit) in enumerate(zip(names, motion.joint_units, strict=True)):
        columns.append(LogColumn(name, f"{name} [{unit}]", "joint", k, unit, number=k + 2))
    position = None if motion.point_motion is None else motion.point_motion[0]
    for k, axis in enumerate("xyz" if position is not None else ""):
        columns.append(LogColumn(axis, f"{axis} [m]", "position", k, "m", number=len(names) + 2 + k))
    for k, component in enumerate(("qx", "qy", "qz", "qw") if position is not None else ()):
        columns.append(LogColumn(component, component, "rotation", k, "", number=len(names) + 5 + k))
    log = JointLog(
        name=motion.name, source=NETWORK, files=motion.provenance.inputs, t_ns=motion.t_ns, joints=names, q=q,
        tcp_position=position, tcp_rotation=motion.quat_xyzw,
        rotation_form=None if position is None else "quat_xyzw", columns=tuple(columns),
        warnings=motion.warnings,
    )  # fmt: skip
    return Run(
        name=motion.name, log=log, robot=None, tsp=motion.tsp, t_ns=motion.t_ns, q=q, qd=qd, qdd=qdd,
        tcp=None, tcp_recorded=position, audit=(), warnings=motion.warnings, provenance=motion.provenance,
        derivative="planned",
    )  # fmt: skip


def exports(motion: NetworkMotion) -> Exports:
    """Return what can leave of a motion: that of its run."""
    return run_exports.exports(motion.as_run())


# ---------------------------------------------------------------------------------------- what is shown


def present(motion: NetworkMotion) -> Presentation:
    """Return what the motion of a network shows."""
    body = Section(
        f"Motion of {motion.name}",
        motion.verdict,
        (*_facts(motion), recording_fact(motion.recording)),
        tuple(_tables(motion)),
        partial(_figures, motion),
        partial(_page, motion),
        (_check(motion),),
        {"rows": len(motion), "requested": motion.requested, "law": motion.law},
        partial(_events, motion),
        motion.warnings,
    )
    return Presentation(
        name=motion.name,
        headline=headline(motion),
        verdict=motion.verdict,
        facts=tuple(fact for fact in _facts(motion) if fact.brief),
        body=body,
        scene=partial(_scene, motion),
        lines=(
            {
                "Network": Ref(body.title),
                "Verdict": Judged(motion.verdict),
                "Drives": ", ".join(drive.name for drive in motion.drives),
                "Duration": Value(float(motion.t[-1]), "s"),
                "Singular poses": Value(sum(event.kind != "limit" for event in motion.events)),
                "Warnings": Value(len(motion.warnings)),
            },
        ),
        created=motion.provenance.created,
    )


def headline(motion: NetworkMotion) -> str:
    """Return what drives the network, how far it moves, and what ends the motion."""
    ranges = ", ".join(_range_words(motion, drive) for drive in motion.drives[:NAMED])
    ranges += f" and {len(motion.drives) - NAMED} more" if len(motion.drives) > NAMED else ""
    rows, duration = format_count(len(motion), "row"), text.format_seconds(float(motion.t[-1]))
    if motion.complete:
        passed = [event for event in motion.events if event.kind != "limit"]
        through = f", through {format_count(len(passed), 'singular pose')}" if passed else ""
        return f"{motion.name}: {ranges}, {rows} in {duration} s{through}"
    why = motion.events[-1].message if motion.events else "no step of the continuation succeeds"
    return f"{motion.name}: {ranges}, {rows} of {motion.requested} in {duration} s: {why}"


def _range_words(motion: NetworkMotion, drive: DriveRange) -> str:
    """Return how far a drive moves; by a log not where it begins and ends, as it may swing."""
    if motion.law == "log":
        return f"{drive.name} by a log"
    return f"{drive.name} {_value_words(drive.begin, drive.unit)} to {_value_words(drive.end, drive.unit)}"


def _facts(motion: NetworkMotion) -> Iterator[Fact]:
    yield Fact("Drives", ", ".join(drive.name for drive in motion.drives))
    if not motion.complete and motion.events:
        yield Fact("Ends at", motion.events[-1].message, leads=True)
    if np.isfinite(motion.distance).any():
        nearest = int(np.argmin(motion.distance))
        words = f"{motion.distance[nearest]:.4g} at t = {motion.t[nearest]:.4g} s"
        help_text = (
            "Smallest singular value of the Jacobian in lengths of the mechanism and rad; 0 is singular."
        )
        yield Fact("Distance to a singular pose", words, help_text)
    yield Fact("Law", motion.law, brief=False)
    yield Fact("Period", Value(motion.tsp, "s"), brief=False)
    if motion.body:
        yield Fact("Traced point", f"{motion.body}: {text.format_point(motion.point)} m", brief=False)


def _tables(motion: NetworkMotion) -> Iterator[Table]:
    units = {drive.name: drive.unit for drive in motion.drives}
    if motion.events:
        heads: Heads[MotionEvent] = {
            "kind": ("What", lambda event: event.kind),
            "t": ("t", lambda event: Value(event.t, "s")),
            **{name: (name, partial(_drive_cell, name, unit)) for name, unit in [*units.items()][:NAMED]},
            "direction": ("Becomes free", lambda event: _direction_words(event.direction)),
        }
        yield Table("Singular poses and limits", columns_of(motion.events, heads))
    if motion.transmission:
        cells: Heads[Transmission] = {
            "variable": ("Variable", lambda ratio: ratio.variable),
            "drive": ("Drive", lambda ratio: ratio.drive),
            "unit": ("Unit", lambda ratio: ratio.unit),
            "smallest": ("Smallest", lambda ratio: _number_words(ratio.smallest)),
            "smallest_at": ("at", lambda ratio: Value(ratio.smallest_at, units[ratio.drive])),
            "largest": ("Largest", lambda ratio: _number_words(ratio.largest)),
            "largest_at": ("at ", lambda ratio: Value(ratio.largest_at, units[ratio.drive])),
            "dead_points": (
                "Dead points at",
                lambda ratio: _values_words(ratio.dead_points, units[ratio.drive]),
            ),
        }
        note = (
            "Rate of the variable per rate of the drive. At a dead point it is 0: the variable cannot drive."
        )
        yield Table(
            "Transmission", columns_of(motion.transmission, cells), note, brief=len(motion.transmission) < 13
        )
    if motion.forces is not None:
        yield from _force_tables(motion, motion.forces)


def _drive_cell(name: str, unit: str, event: MotionEvent) -> Value:
    return Value(event.values[name], unit)


def _number_words(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-9 else value:.4g}"


def _value_words(value: float, unit: str) -> str:
    return text.format_rounded(value, unit) if unit else f"{value:.6g}"


def _values_words(values: tuple[float, ...], unit: str) -> str:
    return ", ".join(_value_words(value, unit) for value in values[:NAMED]) + (
        " ..." if len(values) > NAMED else ""
    )


def _direction_words(direction: dict[str, float]) -> str:
    ranked = sorted(direction.items(), key=lambda pair: -abs(pair[1]))
    return ", ".join(f"{name} {share:+.3g}" for name, share in ranked[:NAMED])


def _force_tables(motion: NetworkMotion, forces: MotionForces) -> Iterator[Table]:
    """Yield the largest force of each drive, and of each reaction; "not determined" where it is not."""
    heads = {"name": "Force", "value": "Largest", "t": "At t"}
    drives = [
        _force_row(motion, drive.name, FORCE_UNITS.get(drive.unit, ""), forces.drives[:, k])
        for k, drive in enumerate(motion.drives)
    ]
    yield table_of("Static forces of the drives", heads, drives, brief=True)
    known = np.abs(np.nan_to_num(forces.reactions))
    reactions = np.where(known < 1e-9 * known.max(initial=0.0), 0.0 * forces.reactions, forces.reactions)
    rows = [
        _force_row(motion, name, "N.m" if " moment " in name else "N", reactions[:, k])
        for k, name in enumerate(forces.names)
    ]
    yield table_of("Reactions of joints and elements", heads, rows, folded=True)


def _force_row(motion: NetworkMotion, name: str, unit: str, values: FloatArray) -> tuple[Cell, ...]:
    if np.isnan(values).all():
        return name, "not determined: constraints are redundant", None
    at = int(np.nanargmax(np.abs(values)))
    return name, Value(float(values[at]) + 0.0, unit), Value(float(motion.t[at]), "s")


def _check(motion: NetworkMotion) -> Check:
    words = motion.events[-1].message if motion.events and not motion.complete else ""
    return Check("the drives reach their end", motion.verdict, words, kind="motion-ends")


def _figures(motion: NetworkMotion) -> Iterator[Figure]:
    """Yield joints with two derivatives, the distance to a singular pose, and forces of drives."""
    instants: dict[int, str] = {round(event.t * 1e9): event.kind for event in motion.events[:6]}
    names, units = motion.joints, motion.joint_units
    titles = {"Joints": "", "Rates": "/s", "Accelerations": "/s2"}
    views = tuple(
        View(title, joint_panels(names, units, title.lower(), values, motion.t_ns, per=per))
        for (title, per), values in zip(titles.items(), motion.joint_motion, strict=True)
    )
    caption = "Joint values of one branch, and their derivatives by time."
    yield Figure(
        "Joints",
        caption,
        f"Joint values of {motion.name} over time: {', '.join(names)}.",
        tuple(views),
        instants,
    )
    if np.isfinite(motion.distance).any():
        line = Line(motion.distance, ("distance",), (AXIS_COLOURS["norm"],))
        panel = Panel("smallest singular value", "", (line,), motion.t_ns, signed=False)
        caption = "Smallest singular value of the scaled Jacobian: 0 where the motion turns back or branches."
        alt = f"Distance of {motion.name} to a singular pose over time."
        yield Figure("Distance to a singular pose", caption, alt, (View("Distance", (panel,)),), instants)
    if motion.forces is not None:
        panels = tuple(
            Panel(drive.name, FORCE_UNITS.get(drive.unit, ""), (line,), motion.t_ns)
            for k, drive in enumerate(motion.drives)
            for line in (Line(motion.forces.drives[:, k], (drive.name,), (joint_colour(k),)),)
        )
        caption = "Static force of each drive that holds the loads."
        yield Figure(
            "Forces of the drives",
            caption,
            f"Forces of the drives of {motion.name}.",
            (View("Forces", panels),),
        )


def _shown_rows(motion: NetworkMotion, most: int) -> IntArray:
    """Return rows at most so many, at least 20 ms apart; the first and the last among them."""
    rows = np.unique(np.searchsorted(motion.t_ns, np.arange(motion.t_ns[0], motion.t_ns[-1] + 1, SHOWN_NS)))
    rows = np.append(rows[rows < len(motion) - 1], len(motion) - 1)
    if len(rows) > most:
        rows = rows[np.unique(np.round(np.linspace(0, len(rows) - 1, most)).astype(np.intp))]
    return np.asarray(rows, dtype=np.int64)


def _moving(motion: NetworkMotion, most: int) -> MovingNetwork:
    """Return what is drawn of a motion at so many instants at most."""
    rows, curves = _shown_rows(motion, most), []
    if motion.point_motion is not None:
        curves = [(f"point of {motion.body}", motion.point_motion[0][rows])]
    poses, lengths, t_ns = motion.poses(rows), motion.element_lengths(rows), motion.t_ns[rows]
    return MovingNetwork(motion.network, poses, lengths, t_ns, curves, f"{motion.name} [m]")


def _scene(motion: NetworkMotion) -> Scene:
    return moving_scene(_moving(motion, MAX_SHOWN))


def motion_drawing(motion: NetworkMotion) -> str:
    """Return the drawing of a motion as SVG."""
    return motion_svg(_moving(motion, DRAWN))


def _page(motion: NetworkMotion) -> Iterator[Block]:
    """Yield what only a page shows."""
    moving = _moving(motion, DRAWN)
    alt = f"{motion.name} at several instants, with the paths of its points."
    yield Drawing("Mechanism in motion", alt, motion_svg(moving))
    yield motion_space_figure(moving)
    if motion.provenance.inputs:
        yield inputs_table("Input files", motion.provenance.inputs)
    yield provenance_table(motion.provenance)


def _events(motion: NetworkMotion) -> Iterator[Event]:
    for event in motion.events:
        ends = event.kind in ("turns back", "limit")
        yield Event(round(event.t * 1e9), event.message, "error" if ends else "warning")
    yield from (Event(None, warning, "warning") for warning in motion.warnings)
