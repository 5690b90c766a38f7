"""Robots as data: TOML files that users write, and the JSON object that a recording stores.

Reading collects the errors of all keys and raises them together; only then the chain is built:

    read_robot_file, chain_from_dict
      _read_chain           kind, units, base, tool, the keys of the kind, attachments
        _READERS            the keys of each kind (urm, dh, modified_dh, articulated6r, joints, urdf)
        _read_frame         a frame by translation and rpy, by a matrix, or by elementary motions
        _read_attachments   visuals, inertials, drives, gravity

Writing is the exact inverse: `chain_to_dict` (JSON), `robot_toml` (a file). All floats keep their bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias, cast

from urmpipe_models.arm.chain import (
    GRAVITY,
    Box,
    Capsule,
    Chain,
    Colour,
    Cylinder,
    Inertial,
    Joint,
    JointKind,
    Mesh,
    Mimic,
    Shape,
    Sphere,
    Visual,
)
from urmpipe_models.arm.denavit_hartenberg import (
    DHRow,
    articulated_6r,
    dh_chain,
    modified_dh_chain,
    urm_chain,
)
from urmpipe_models.drives import (
    DRIVE_KEYS,
    GAIN_KEYS,
    NO_SPRING,
    SPRING_KEYS,
    CounterbalanceSpring,
    Drive,
    DrivenJoint,
    Gains,
    JointDrive,
    PassiveJoint,
)
from urmpipe_models.elementwise import ZERO, cross, dot
from urmpipe_models.errors import Finding, RobotError
from urmpipe_models.files import EXPORT_MARK
from urmpipe_models.math3d import Step, Transform, compose_steps, from_xyz_rpy
from urmpipe_models.robots.urdf import read_urdf
from urmpipe_models.robots.urdf_tree import MAX_LINKS
from urmpipe_models.toml_tables import CheckedTable, format_toml, quote_toml, read_toml

ORTHONORMAL_TOLERANCE = 1e-9  # deviation of R R^T from the identity: rounding of a rotation matrix
MAX_LENGTH = 100.0  # [m], sum of the links of an arm, above which a file without unit is in mm
PASSIVE_KEYS = DRIVE_KEYS[:2]  # of a passive joint; a drive needs all keys
SHAPES = ("box", "cylinder", "capsule", "sphere", "mesh")  # a visual has one of them

Build: TypeAlias = Callable[[str], Chain]  # builds the chain of a given name from keys without errors


@dataclass(frozen=True, slots=True)
class Units:
    """The units of a robot file, converted to SI where the file is read and nowhere else."""

    millimetres: bool = False
    degrees: bool = False

    def length(self, value: float) -> float:
        """Return a length of the file in [m], by decimals: 243.215 mm is the same double as 0.243215."""
        return float(Decimal(repr(value)).scaleb(-3)) if self.millimetres else value

    def angle(self, value: float) -> float:
        """Return an angle of the file in [rad]."""
        return math.radians(value) if self.degrees else value

    def of_joint(self, kind: str, value: float) -> float:
        """Return a joint's value in [m] if it is prismatic, else in [rad]."""
        return self.length(value) if kind == "prismatic" else self.angle(value)


def read_robot_file(path: str | Path) -> Chain:
    """Return the arm that a TOML file describes.

    Common keys: `kind` (urm, dh, modified_dh, articulated6r, joints or urdf), `name` (the file's stem by
    default), `description`, `source`, `length_unit` (m, mm), `angle_unit` (rad, deg), `start`, and the
    tables `[base]` and `[tool]` with `translation` and `rpy` (or `rotation`, three rows). By kind:

    - urm: `lengths`, `tilts`, `directions`; `[limits]` with `lower`, `upper`, `velocity`, `acceleration`,
      `effort`, each one number or one per moving joint.
    - dh, modified_dh: `[[joints]]` with `name`, `kind` (fixed: a frame without a coordinate), `theta`, `d`,
      `a`, `alpha`; `[limits]`.
    - articulated6r: `lengths` l0..l4 (see `articulated_6r`); `[limits]`.
    - joints: `[[joints]]` with `name`, `kind`, `origin`, `axis`, `lower`, `upper`, `velocity`,
      `acceleration`, `effort`, `mimic`; `[tip]`. A mimic has `joint`, `offset` and `multiplier`, the last in
      rad and m always.
    - urdf: `file` (relative to this one), `base_link`, `tip_link`.

    Shapes (they replace those of a URDF): `[[visuals]]` with `joint` (none: the base),
    `origin`, `colour` (r, g, b, opacity) and one of `box` (x, y, z), `cylinder` and `capsule` (radius,
    length), `sphere` (radius), `mesh` (a file, relative to this one) with `scale`.

    Masses (they replace those of a URDF): `[[inertials]]` with `joint` (none: the base), `mass`,
    `centre`, `inertia` and `source`; `gravity`; `left_out`. Drives: `[drives.JOINT]` with `k` and `l` of a
    passive joint, or all keys of a drive. Masses, inertias, gravity, efforts and drives are
    SI whatever the units of the file.

    Args:
        path: The file.

    Raises:
        RobotError: With all errors: the key, the value found and the values allowed.
    """
    path = Path(path)
    data = read_toml(path, RobotError)
    chain = _read_chain(data, tuple(_READERS), file=str(path), stem=path.stem, folder=path.parent)
    if faults := [*_unit_faults(data, chain)]:
        raise RobotError(*(Finding(fault, str(path)) for fault in faults))
    return replace(chain, visuals=tuple(visual.with_resolved_mesh(path.parent) for visual in chain.visuals))


def chain_from_dict(data: Mapping[str, Any], file: str | None = None) -> Chain:
    """Return the chain of a dictionary: `chain_to_dict`'s exact inverse.

    Args:
        data: The result of `chain_to_dict`; no other kind, so that untrusted data open no file.
        file: Its file, for the errors.

    Raises:
        RobotError: With all errors.
    """
    return _read_chain(data, ("joints",), file=file)


def _read_chain(
    data: Mapping[str, Any], kinds: Sequence[str], *, file: str | None, stem: str = "", folder: Path = Path()
) -> Chain:
    faults: list[Finding] = []
    table = CheckedTable(data, faults, file)
    kind = table.choice("kind", kinds)
    if faults:  # without a kind every other key would be called unknown
        raise RobotError(*faults)
    units = Units(
        table.choice("length_unit", ("m", "mm"), "m") == "mm",
        table.choice("angle_unit", ("rad", "deg"), "rad") == "deg",
    )
    name, description, source = (
        table.text(key, default) for key, default in (("name", stem), ("description", ""), ("source", ""))
    )
    start = table.numbers("start", None, ())
    base, tool = (
        _read_frame(table.table(key), units) if table.has(key) else None for key in ("base", "tool")
    )
    build = _READERS[kind](table, units, folder)
    attachments = _read_attachments(table, units)
    table.report_unknown_keys()
    if faults:
        raise RobotError(*faults)
    try:
        chain = build(name)
    except RobotError as error:
        parts = (part for key in ("visuals", "inertials", "drives") for part in attachments.get(key, ()))
        further = (Finding(f"robot {name}: {fault}") for part in parts for fault in part.faults())
        raise RobotError(*_in_file(file, (*error.findings, *further))) from error
    if len(chain.joints) > MAX_LINKS:
        raise RobotError(Finding(f"found {len(chain.joints)} joints, allowed: {MAX_LINKS} at most", file))
    if len(start) == len(chain.moving):  # else the chain reports the wrong count
        moving = zip(chain.moving, start, strict=True)
        start = tuple(units.of_joint(joint.kind, value) for joint, value in moving)
    try:
        return replace(
            chain.placed(base, tool),
            name=name or chain.name,
            start=start or chain.start,
            description=description or chain.description,
            source=source or chain.source,
            **attachments,
        )
    except RobotError as error:
        raise RobotError(*_in_file(file, error.findings)) from error


def _in_file(file: str | None, findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield findings as those of a file, unless they name one."""
    return (replace(finding, file=finding.file or file) for finding in findings)


def _unit_faults(data: Mapping[str, Any], chain: Chain) -> Iterator[str]:
    """Yield the units that a file must state, because its numbers are no plausible arm in m and rad."""
    if data["kind"] in {"joints", "urdf"}:
        return
    frames = [*(joint.origin for joint in chain.joints), chain.tip]
    length = sum(math.hypot(*frame.translation) for frame in frames)
    if "length_unit" not in data and length > MAX_LENGTH:
        yield f'key length_unit: found none, and links of {length:.4g} m, allowed: "mm", or "m" if intended'
    twists = [row.get(key, 0.0) for row in data.get("joints", ()) for key in ("theta", "alpha")]
    angle = max(map(abs, (*data.get("tilts", ()), *twists)), default=0.0)
    if "angle_unit" not in data and angle > 2.0 * math.pi:
        yield f'key angle_unit: found none, and {angle:.4g} rad, allowed: "deg", or "rad" if intended'


class _Limits(NamedTuple):
    """Limits of a joint in [rad] or [m], their derivatives per [s] and [s2], its effort in [N.m] or [N]."""

    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf


def _read_limits(table: CheckedTable, kinds: Sequence[JointKind], units: Units) -> list[_Limits]:
    """Return the limits of moving joints of these kinds."""
    columns = {
        key: table.spread(key, len(kinds), default) for key, default in _Limits._field_defaults.items()
    }
    table.report_unknown_keys()
    return [
        _Limits(**{key: _limit_in_si(key, kind, values[k], units) for key, values in columns.items()})
        for k, kind in enumerate(kinds)
    ]


def _limit_in_si(key: str, kind: str, value: float, units: Units) -> float:
    return value if key == "effort" else units.of_joint(kind, value)


def _with_limits(chain: Chain, limits: Sequence[_Limits]) -> Chain:
    remaining = iter(limits)
    joints = (
        joint if joint.kind == "fixed" else replace(joint, **next(remaining)._asdict())
        for joint in chain.joints
    )
    return replace(chain, joints=tuple(joints))


def _read_urm(table: CheckedTable, units: Units, folder: Path) -> Build:
    lengths = tuple(units.length(value) for value in table.numbers("lengths", None))
    tilts = tuple(units.angle(value) for value in table.numbers("tilts", None))
    directions = table.numbers("directions", None, ())
    limits = _read_limits(table.table("limits"), ["revolute"] * len(tilts), units)
    return lambda name: _with_limits(urm_chain(name, lengths, tilts, directions=directions), limits)


def _read_dh(table: CheckedTable, units: Units, folder: Path, *, modified: bool = False) -> Build:
    rows = [_read_dh_row(row, units) for row in table.tables("joints")]
    moving = [row.kind for row in rows if row.kind != "fixed"]
    limits = iter(_read_limits(table.table("limits"), moving, units))
    limited = [row if row.kind == "fixed" else replace(row, **next(limits)._asdict()) for row in rows]
    return partial(modified_dh_chain if modified else dh_chain, rows=limited)


def _read_dh_row(table: CheckedTable, units: Units) -> DHRow:
    row = DHRow(
        theta=units.angle(table.number("theta", 0.0)),
        d=units.length(table.number("d", 0.0)),
        a=units.length(table.number("a", 0.0)),
        alpha=units.angle(table.number("alpha", 0.0)),
        name=table.text("name", ""),
        kind=cast("JointKind", table.choice("kind", ("revolute", "prismatic", "fixed"), "revolute")),
    )
    table.report_unknown_keys()
    return row


def _read_articulated6r(table: CheckedTable, units: Units, folder: Path) -> Build:
    lengths = tuple(units.length(value) for value in table.numbers("lengths", 5))
    limits = _read_limits(table.table("limits"), ["revolute"] * 6, units)
    return lambda name: _with_limits(articulated_6r(*lengths, name=name), limits)


def _read_joints(table: CheckedTable, units: Units, folder: Path) -> Build:
    joints = tuple(_read_joint(row, units) for row in table.tables("joints"))
    return partial(Chain, joints=joints, tip=_read_frame(table.table("tip"), units))


def _read_joint(table: CheckedTable, units: Units) -> Joint:
    kind = table.choice("kind", ("revolute", "prismatic", "fixed"), "revolute")
    joint = Joint(
        table.text("name"),
        cast("JointKind", kind),
        _read_frame(table.table("origin"), units),
        cast("tuple[float, float, float]", table.numbers("axis", 3, (0.0, 0.0, 1.0))),
        **{
            key: _limit_in_si(key, kind, table.number(key, default, infinite=True), units)
            for key, default in _Limits._field_defaults.items()
        },
        mimic=_read_mimic(table.table("mimic"), kind, units) if table.has("mimic") else None,
    )
    table.report_unknown_keys()
    return joint


def _read_mimic(table: CheckedTable, kind: str, units: Units) -> Mimic:
    mimic = Mimic(
        table.text("joint"),
        table.number("multiplier", 1.0),
        units.of_joint(kind, table.number("offset", 0.0)),
    )
    table.report_unknown_keys()
    return mimic


def _read_urdf(table: CheckedTable, units: Units, folder: Path) -> Build:
    file = table.text("file")
    base_link, tip_link = (table.text(key, "") or None for key in ("base_link", "tip_link"))
    return lambda name: read_urdf(folder / file, base_link=base_link, tip_link=tip_link)


_READERS: dict[str, Callable[[CheckedTable, Units, Path], Build]] = {
    "urm": _read_urm,
    "dh": _read_dh,
    "modified_dh": partial(_read_dh, modified=True),
    "articulated6r": _read_articulated6r,
    "joints": _read_joints,
    "urdf": _read_urdf,
}


def _read_frame(table: CheckedTable, units: Units) -> Transform:
    """Return the frame of `translation` and `rpy` or `rotation`, or of `steps`."""
    frame = _read_rigid(table, units)
    if table.has("steps"):
        product = compose_steps(*(_read_step(row, units) for row in table.tables("steps")))
        keys = [key for key in ("translation", "rpy", "rotation") if table.has(key)]
        if keys and not _is_same(frame, product):
            names = " and ".join(keys)
            table.add_error(
                "steps", f"found beside {names} of another frame; allowed: steps alone"
            )  # plain: ok
        frame = product
    table.report_unknown_keys()
    return frame


def _read_rigid(table: CheckedTable, units: Units) -> Transform:
    """Return the frame of `translation` and `rpy` or `rotation`."""
    x, y, z = (units.length(value) for value in table.numbers("translation", 3, (0.0, 0.0, 0.0)))
    rx, ry, rz = (units.angle(value) for value in table.numbers("rpy", 3, (0.0, 0.0, 0.0)))
    if not table.has("rotation"):
        return from_xyz_rpy((x, y, z), (rx, ry, rz), "robot file")
    frame = Transform(cast("Any", table.rows("rotation")), (x, y, z))
    if table.has("rpy"):
        table.add_error("rotation", "found beside rpy; allowed: one of the two")  # plain: ok
    elif not _is_rotation(frame):
        table.add_error("rotation", "is not a rotation matrix; allowed: orthonormal rows, right-handed")
    return frame


def _read_step(table: CheckedTable, units: Units) -> Transform | Step:
    """Return an elementary motion, or a constant frame between two."""
    step: Transform | Step
    if table.has("along") or table.has("about"):
        kind: Literal["along", "about"] = "along" if table.has("along") else "about"
        axis = cast("Any", table.choice(kind, ("x", "y", "z")))
        value = (units.length if kind == "along" else units.angle)(table.number("value", 0.0))
        step = Step(kind, axis, value, table.text("name", ""), table.text("source", ""))
    else:
        step = replace(_read_rigid(table, units), steps=None)
    table.report_unknown_keys()
    return step


def _is_same(frame: Transform, other: Transform) -> bool:
    """Return whether two frames are equal except for rounding."""
    pairs = zip((*frame.rotation, frame.translation), (*other.rotation, other.translation), strict=True)
    return all(abs(a - b) <= ORTHONORMAL_TOLERANCE for rows in pairs for a, b in zip(*rows, strict=True))


def _is_rotation(frame: Transform) -> bool:
    x, y, z = frame.rotation
    product = (frame @ Transform(frame.columns)).rotation
    deviations = (abs(product[i][j] - float(i == j)) for i in range(3) for j in range(3))
    return all(deviation <= ORTHONORMAL_TOLERANCE for deviation in deviations) and bool(
        dot(x, cross(y, z)) > 0.0
    )


def _read_attachments(table: CheckedTable, units: Units) -> dict[str, Any]:
    """Return the fields of a chain for shapes, masses and drives.

    Fields that the file does not have keep the values of a URDF. Masses of the file replace those of a URDF,
    whether or not those have errors.
    """
    rows = {key: table.tables(key) if table.has(key) else [] for key in ("visuals", "inertials")}
    drives = table.named_tables("drives").items()
    parts = {
        "visuals": tuple(_read_visual(row, units) for row in rows["visuals"]),
        "inertials": tuple(_read_inertial(row, units) for row in rows["inertials"]),
        "drives": tuple(_read_drive(joint, row) for joint, row in drives),
    }
    attachments: dict[str, Any] = {key: part for key, part in parts.items() if part}
    for key in ("left_out", "mass_faults"):
        texts = table.texts(key) if table.has(key) else ()
        if texts or "inertials" in attachments:
            attachments[key] = texts
    return {**attachments, "gravity": table.numbers("gravity", 3, GRAVITY)}


def _read_visual(table: CheckedTable, units: Units) -> Visual:
    visual = Visual(
        table.text("joint", "") if table.has("joint") else None,
        _read_shape(table, units),
        replace(_read_frame(table.table("origin"), units), steps=None),
        cast("Colour", table.numbers("colour", 4)) if table.has("colour") else None,
    )
    table.report_unknown_keys()
    return visual


def _read_shape(table: CheckedTable, units: Units) -> Shape:
    keys = [key for key in SHAPES if table.has(key)]
    if len(keys) != 1:
        names = " and ".join(keys) or "no shape"
        table.add_error("box", f"found {names}, allowed: one of {', '.join(SHAPES)}")
        return Sphere(0.0)
    (key,) = keys
    if key == "mesh":
        scale = table.numbers("scale", 3, (1.0, 1.0, 1.0))
        return Mesh(table.text("mesh"), cast("tuple[float, float, float]", scale))
    if key == "sphere":
        return Sphere(units.length(table.number("sphere")))
    sizes = tuple(units.length(size) for size in table.numbers(key, 3 if key == "box" else 2))
    if key == "box":
        return Box(cast("tuple[float, float, float]", sizes))
    return Cylinder(*sizes) if key == "cylinder" else Capsule(*sizes)


def _read_inertial(table: CheckedTable, units: Units) -> Inertial:
    """Return an inertial; masses and inertias are SI in any file, `centre` is in its unit of length."""
    x, y, z = (units.length(value) for value in table.numbers("centre", 3, ZERO))
    inertial = Inertial(
        table.text("joint", "") if table.has("joint") else None,
        table.number("mass"),
        (x, y, z),
        cast("Any", table.numbers("inertia", 6, (0.0,) * 6)),
        table.text("source", ""),
    )
    table.report_unknown_keys()
    return inertial


def _read_drive(joint: str, table: CheckedTable) -> JointDrive:
    """Return a drive, in SI in any file."""
    drive_keys = (*DRIVE_KEYS[2:], "period", *GAIN_KEYS, "u_max")
    is_driven = any(map(table.has, (*drive_keys, *SPRING_KEYS)))
    spring_keys = SPRING_KEYS if any(map(table.has, SPRING_KEYS)) else ()
    keys = (*PASSIVE_KEYS, *(drive_keys if is_driven else ()), *spring_keys)
    values = {key: table.number(key) for key in keys}
    table.report_unknown_keys()
    if not is_driven:
        return PassiveJoint(joint, *values.values())
    drive, gains = Drive(*map(values.get, DRIVE_KEYS)), Gains(*map(values.get, GAIN_KEYS))
    spring = CounterbalanceSpring(*map(values.get, SPRING_KEYS)) if spring_keys else NO_SPRING
    return DrivenJoint(joint, drive, values["period"], gains, values["u_max"], spring)


def chain_to_dict(chain: Chain) -> dict[str, Any]:
    """Return a chain as a JSON object of kind `joints`: SI, floats bit by bit, infinities as None."""
    attachments: dict[str, Any] = {
        "gravity": [float(value) for value in chain.gravity] if chain.gravity != GRAVITY else [],
        "left_out": list(chain.left_out),
        "mass_faults": list(chain.mass_faults),
        "visuals": [_visual_to_dict(visual) for visual in chain.visuals],
        "inertials": [_inertial_to_dict(inertial) for inertial in chain.inertials],
        "drives": {drive.joint: drive_to_dict(drive) for drive in chain.drives},
    }
    return {
        "kind": "joints",
        "name": chain.name,
        "description": chain.description,
        "source": chain.source,
        "start": [float(value) for value in chain.start],
        "base": _frame_to_dict(chain.base),
        "tip": _frame_to_dict(chain.tip),
        "tool": _frame_to_dict(chain.tool),
        "joints": [_joint_to_dict(joint) for joint in chain.joints],
        **{key: value for key, value in attachments.items() if value},
    }


def robot_toml(chain: Chain) -> str:
    """Return a chain as a TOML robot file of kind `joints`; read back it is the same chain, bit by bit."""
    data = chain_to_dict(chain)
    frames = {key: _steps_only(data.pop(key)) for key in ("base", "tip", "tool")}
    for joint in data["joints"]:
        joint["origin"] = _steps_only(joint["origin"])
    lists = {key: data.pop(key, []) for key in ("joints", "visuals", "inertials")}
    drives = data.pop("drives", {})
    lines = [f"# {EXPORT_MARK}: lengths in m, angles in rad", *format_toml(data)]
    for key, frame in frames.items():
        lines += ["", f"[{key}]", *format_toml(frame)]
    for key, items in lists.items():
        for item in items:
            lines += ["", f"[[{key}]]", *format_toml(item)]
    for joint, drive in drives.items():
        lines += ["", f"[drives.{quote_toml(joint)}]", *format_toml(drive)]
    return "\n".join(lines) + "\n"


def _steps_only(frame: dict[str, Any]) -> dict[str, Any]:
    """Return the steps of a frame alone, if it has steps: the rest is their product."""
    return {"steps": frame["steps"]} if "steps" in frame else frame


def _joint_to_dict(joint: Joint) -> dict[str, Any]:
    """Return a joint as a JSON object, without an effort that is not known."""
    values = {key: float(getattr(joint, key)) for key in _Limits._fields}
    limits = {key: value if math.isfinite(value) else None for key, value in values.items()}
    if limits["effort"] is None:
        del limits["effort"]
    mimic = joint.mimic
    return {
        "name": joint.name,
        "kind": joint.kind,
        "origin": _frame_to_dict(joint.origin),
        "axis": [float(value) for value in joint.axis],
        **limits,
        "mimic": mimic
        and {"joint": mimic.joint, "multiplier": float(mimic.multiplier), "offset": float(mimic.offset)},
    }


def _frame_to_dict(frame: Transform) -> dict[str, Any]:
    """Return a frame as a JSON object, with the steps whose product it is."""
    numbers = {
        "translation": [float(value) for value in frame.translation],
        "rotation": [[float(value) for value in row] for row in frame.rotation],
    }
    if frame.steps is None:
        return numbers
    return {**numbers, "steps": [_step_to_dict(step) for step in frame.steps]}


def _step_to_dict(step: Transform | Step) -> dict[str, Any]:
    if isinstance(step, Transform):
        return _frame_to_dict(step)
    return {"name": step.name, step.kind: step.axis, "value": float(step.value), "source": step.source}


def _visual_to_dict(visual: Visual) -> dict[str, Any]:
    shape = visual.shape
    sizes: dict[str, Any]
    if isinstance(shape, Mesh):
        sizes = {"mesh": shape.file, "scale": [float(factor) for factor in shape.scale]}
    elif isinstance(shape, Box):
        sizes = {"box": [float(size) for size in shape.size]}
    elif isinstance(shape, Sphere):
        sizes = {"sphere": float(shape.radius)}
    else:
        sizes = {type(shape).__name__.lower(): [float(shape.radius), float(shape.length)]}
    values = {
        "joint": visual.joint,
        "origin": _frame_to_dict(visual.origin),
        "colour": None if visual.colour is None else [float(share) for share in visual.colour],
        **sizes,
    }
    return {key: value for key, value in values.items() if value is not None}


def _inertial_to_dict(inertial: Inertial) -> dict[str, Any]:
    values = {
        "joint": inertial.joint,
        "mass": float(inertial.mass),
        "centre": [float(value) for value in inertial.centre],
        "inertia": [float(value) for value in inertial.inertia],
        "source": inertial.source or None,
    }
    return {key: value for key, value in values.items() if value is not None}


def drive_to_dict(drive: JointDrive) -> dict[str, float]:
    """Return the constants of a drive as a JSON object, in SI, by the keys of robot files."""
    if isinstance(drive, PassiveJoint):
        return {"k": float(drive.stiffness), "l": float(drive.damping)}
    values = {
        **dict(zip(DRIVE_KEYS, drive.drive, strict=True)),
        "period": drive.period,
        **dict(zip(GAIN_KEYS, drive.gains, strict=True)),
        "u_max": drive.largest_voltage,
        **(dict(zip(SPRING_KEYS, drive.spring, strict=True)) if drive.spring != NO_SPRING else {}),
    }
    return {key: float(value) for key, value in values.items()}
