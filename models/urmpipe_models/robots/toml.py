"""Frames of robot files and recordings, and the units of robot files.

What drives or holds the joints of an arm, as robot files and recordings tell it.

The masses of an arm, as robot files and recordings tell them.

What an arm looks like, as robot files and recordings tell it.

What an arm has besides its joints, as robot files and recordings tell it: looks, masses and drives.

Robots as data: TOML files for people, and the dictionary that a recording stores.
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
from urmpipe_models.arm.geometric_models import DHRow, articulated_6r, dh_chain, modified_dh_chain, urm_chain
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

ORTHONORMAL = 1e-9
"""R R^T may differ from the identity by this: rounding, not a matrix that is no rotation."""


@dataclass(frozen=True, slots=True)
class Units:
    """The units of a robot file, made SI where the file is read and nowhere else."""

    millimetres: bool = False
    degrees: bool = False

    def length(self, value: float) -> float:
        """Return a length of the file in [m]; by decimals: 243.215 mm is the very double that 0.243215 is."""
        return float(Decimal(repr(value)).scaleb(-3)) if self.millimetres else value

    def angle(self, value: float) -> float:
        """Return an angle of the file in [rad]."""
        return math.radians(value) if self.degrees else value

    def of_joint(self, kind: str, value: float) -> float:
        """Return a joint's value in [m] if it slides, else in [rad]."""
        return self.length(value) if kind == "prismatic" else self.angle(value)


def read_frame(table: CheckedTable, units: Units) -> Transform:
    """Return the frame that a table tells by `translation` and `rpy` or `rotation`, or by `steps`.

    What is wrong is noted as a fault.
    """
    frame = _rigid(table, units)
    if table.has("steps"):
        made = compose_steps(*(_part(row, units) for row in table.tables("steps")))
        others = [key for key in ("translation", "rpy", "rotation") if table.has(key)]
        if others and not _same(frame, made):
            found = f"found beside {' and '.join(others)} of another frame"
            table.add_error("steps", f"{found}; allowed: steps alone")
        frame = made
    table.report_unknown_keys()
    return frame


def _rigid(table: CheckedTable, units: Units) -> Transform:
    """Return the frame of `translation` and `rpy` or `rotation`."""
    x, y, z = (units.length(value) for value in table.numbers("translation", 3, (0.0, 0.0, 0.0)))
    rx, ry, rz = (units.angle(value) for value in table.numbers("rpy", 3, (0.0, 0.0, 0.0)))
    if not table.has("rotation"):
        return from_xyz_rpy((x, y, z), (rx, ry, rz), "robot file")
    frame = Transform(cast("Any", table.rows("rotation")), (x, y, z))
    if table.has("rpy"):
        table.add_error("rotation", "found beside rpy; allowed: one of the two")
    elif not _is_rotation(frame):
        table.add_error("rotation", "is not a rotation matrix; allowed: orthonormal rows, right-handed")
    return frame


def _part(table: CheckedTable, units: Units) -> Transform | Step:
    """Read an elementary motion, or a constant frame between two."""
    part: Transform | Step
    if table.has("along") or table.has("about"):
        kind: Literal["along", "about"] = "along" if table.has("along") else "about"
        axis = cast("Any", table.choice(kind, ("x", "y", "z")))
        value = (units.length if kind == "along" else units.angle)(table.number("value", 0.0))
        part = Step(kind, axis, value, table.text("name", ""), table.text("source", ""))
    else:
        part = replace(_rigid(table, units), made_of=None)
    table.report_unknown_keys()
    return part


def _same(frame: Transform, other: Transform) -> bool:
    """Tell whether two frames are the same but for rounding."""
    pairs = zip((*frame.rotation, frame.translation), (*other.rotation, other.translation), strict=True)
    return all(abs(a - b) <= ORTHONORMAL for rows in pairs for a, b in zip(*rows, strict=True))


def _is_rotation(frame: Transform) -> bool:
    """Tell whether the rows of a frame are a rotation."""
    x, y, z = frame.rotation
    product = (frame @ Transform(frame.columns)).rotation
    orthonormal = all(abs(product[i][j] - float(i == j)) <= ORTHONORMAL for i in range(3) for j in range(3))
    return orthonormal and bool(dot(x, cross(y, z)) > 0.0)


def frame_to_dict(frame: Transform) -> dict[str, Any]:
    """Return a frame as a JSON object, floats bit by bit, with the steps that it is made of."""
    told = {
        "translation": [float(value) for value in frame.translation],
        "rotation": [[float(value) for value in row] for row in frame.rotation],
    }
    return told if frame.made_of is None else {**told, "steps": [_part_to_dict(one) for one in frame.made_of]}


def _part_to_dict(part: Transform | Step) -> dict[str, Any]:
    """Return an elementary motion, or a constant frame, as a JSON object: `_part`'s exact inverse."""
    if isinstance(part, Transform):
        return frame_to_dict(part)
    return {"name": part.name, part.kind: part.axis, "value": float(part.value), "source": part.source}


HELD_KEYS = DRIVE_KEYS[:2]
"""The keys of a joint that is only held; any other key makes it a driven one, which needs them all."""


def read_drive(joint: str, table: CheckedTable) -> JointDrive:
    """Return the drive of a table, in SI whatever the units of the file; faults are noted in the table."""
    further = (*DRIVE_KEYS[2:], "period", *GAIN_KEYS, "u_max")
    driven = [key for key in (*further, *SPRING_KEYS) if table.has(key)]
    sprung = SPRING_KEYS if any(map(table.has, SPRING_KEYS)) else ()
    values = {key: table.number(key) for key in (*HELD_KEYS, *(further if driven else ()), *sprung)}
    table.report_unknown_keys()
    if not driven:
        return PassiveJoint(joint, *values.values())
    drive, gains = Drive(*map(values.get, DRIVE_KEYS)), Gains(*map(values.get, GAIN_KEYS))
    spring = CounterbalanceSpring(*map(values.get, SPRING_KEYS)) if sprung else NO_SPRING
    return DrivenJoint(joint, drive, values["period"], gains, values["u_max"], spring)


def drive_to_dict(drive: JointDrive) -> dict[str, float]:
    """Return the constants of a drive as a JSON object: `read_drive`'s exact inverse."""
    if isinstance(drive, PassiveJoint):
        return {"k": float(drive.stiffness), "l": float(drive.damping)}
    given = {
        **dict(zip(DRIVE_KEYS, drive.drive, strict=True)),
        "period": drive.period,
        **dict(zip(GAIN_KEYS, drive.gains, strict=True)),
        "u_max": drive.largest_voltage,
        **(dict(zip(SPRING_KEYS, drive.spring, strict=True)) if drive.spring != NO_SPRING else {}),
    }
    return {key: float(value) for key, value in given.items()}


def read_inertial(table: CheckedTable, units: Units) -> Inertial:
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
    table.report_unknown_keys()
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


SHAPES = ("box", "cylinder", "capsule", "sphere", "mesh")
"""The keys of which a visual has one."""


def read_visual(table: CheckedTable, units: Units) -> Visual:
    """Return the visual of a table; faults are noted in the table."""
    visual = Visual(
        table.text("joint", "") if table.has("joint") else None,
        _shape(table, units),
        replace(read_frame(table.table("origin"), units), made_of=None),
        cast("Colour", table.numbers("colour", 4)) if table.has("colour") else None,
    )
    table.report_unknown_keys()
    return visual


def visual_to_dict(visual: Visual) -> dict[str, Any]:
    """Return a visual as a JSON object: `read_visual`'s exact inverse."""
    given = {
        "joint": visual.joint,
        "origin": frame_to_dict(visual.origin),
        "colour": None if visual.colour is None else [float(share) for share in visual.colour],
        **_shape_to_dict(visual.shape),
    }
    return {key: value for key, value in given.items() if value is not None}


def _shape(table: CheckedTable, units: Units) -> Shape:
    """Return the one shape of the table, in [m]."""
    keys = [key for key in SHAPES if table.has(key)]
    if len(keys) != 1:
        table.add_error(
            "box", f"found {' and '.join(keys) or 'no shape'}, allowed: one of {', '.join(SHAPES)}"
        )
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


def _shape_to_dict(shape: Shape) -> dict[str, Any]:
    """Return a shape as keys of a JSON object."""
    if isinstance(shape, Mesh):
        return {"mesh": shape.file, "scale": [float(factor) for factor in shape.scale]}
    if isinstance(shape, Box):
        return {"box": [float(size) for size in shape.size]}
    if isinstance(shape, Sphere):
        return {"sphere": float(shape.radius)}
    return {type(shape).__name__.lower(): [float(shape.radius), float(shape.length)]}


PARTS = ("visuals", "inertials", "drives")
"""Fields of a chain whose items know their own faults."""


def read_carried(table: CheckedTable, units: Units) -> dict[str, Any]:
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


LONGEST = 100.0
"""An arm whose links add up to more than this, in [m], was meant in mm, unless its file says m."""

Build: TypeAlias = Callable[[str], Chain]
"""Makes the chain of a given name, once all keys are read and found right."""


class _Limits(NamedTuple):
    """Limits of a joint in [rad] or [m], its rates in these a second or s2, its effort in [N.m] or [N]."""

    lower: float = -math.inf
    upper: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    effort: float = math.inf


def read_robot_file(path: str | Path) -> Chain:
    """Return the arm that a TOML file describes.

    Common keys: `kind` (urm, dh, modified_dh, articulated6r, joints or urdf), `name` (the file's stem by
    default), `description`, `source`, `length_unit` (m, mm), `angle_unit` (rad, deg), `start`, and the
    tables `[base]` and `[tool]` with `translation` and `rpy` (or `rotation`, three rows). By kind:

    - urm: `lengths`, `tilts`, `directions`; `[limits]` with `lower`, `upper`, `velocity`, `acceleration`,
      `effort`, each one number or one a moving joint.
    - dh, modified_dh: `[[joints]]` with `name`, `kind` (fixed: a frame without a coordinate), `theta`, `d`,
      `a`, `alpha`; `[limits]`.
    - articulated6r: `lengths` l0..l4 (see `articulated_6r`); `[limits]`.
    - joints: `[[joints]]` with `name`, `kind`, `origin`, `axis`, `lower`, `upper`, `velocity`,
      `acceleration`, `effort`, `mimic`; `[tip]`. A mimic has `joint`, `offset` and `multiplier`, the last in
      rad and m always.
    - urdf: `file` (relative to this one), `base_link`, `tip_link`.

    What the arm looks like (instead of what a URDF says): `[[visuals]]` with `joint` (none: the base),
    `origin`, `colour` (r, g, b, opacity) and one of `box` (x, y, z), `cylinder` and `capsule` (radius,
    length), `sphere` (radius), `mesh` (a file, relative to this one) with `scale`.

    What it weighs (instead of what a URDF says): `[[inertials]]` with `joint` (none: the base), `mass`,
    `centre`, `inertia` and `source`; `gravity`; `left_out`. What drives its joints: `[drives.JOINT]` with `k`
    and `l` of a joint that is held, or all keys of a drive. Masses, inertias, gravity, efforts and drives are
    SI whatever the units of the file.

    Args:
        path: The file.

    Raises:
        RobotError: With everything that is wrong: the key, what was found and what is allowed.
    """
    path = Path(path)
    data = read_toml(path, RobotError)
    chain = _read(data, tuple(_READERS), file=str(path), stem=path.stem, folder=path.parent)
    if faults := [*_unsaid_units(data, chain)]:
        raise RobotError(*(Finding(fault, str(path)) for fault in faults))
    return replace(chain, visuals=tuple(visual.with_resolved_mesh(path.parent) for visual in chain.visuals))


def chain_to_dict(chain: Chain) -> dict[str, Any]:
    """Return a chain as a JSON object of kind `joints`: SI, floats bit by bit, infinities as None."""
    return {
        "kind": "joints",
        "name": chain.name,
        "description": chain.description,
        "source": chain.source,
        "start": [float(value) for value in chain.start],
        "base": frame_to_dict(chain.base),
        "tip": frame_to_dict(chain.tip),
        "tool": frame_to_dict(chain.tool),
        "joints": [_joint_to_dict(joint) for joint in chain.joints],
        **carried_to_dict(chain),
    }


def chain_from_dict(data: Mapping[str, Any], file: str | None = None) -> Chain:
    """Return the chain of a dictionary: `chain_to_dict`'s exact inverse.

    Args:
        data: What `chain_to_dict` returned; no other kind, so that a stranger's data open no file.
        file: Where it came from, for the errors.

    Raises:
        RobotError: With everything that is wrong.
    """
    return _read(data, ("joints",), file=file)


def robot_toml(chain: Chain) -> str:
    """Return a chain as a TOML robot file of kind `joints`; read back it is the same chain, bit by bit."""
    data = chain_to_dict(chain)
    frames = {key: _shortest(data.pop(key)) for key in ("base", "tip", "tool")}
    for joint in data["joints"]:
        joint["origin"] = _shortest(joint["origin"])
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


def _shortest(frame: dict[str, Any]) -> dict[str, Any]:
    """Return the steps of a frame alone where it tells them: their product is all the rest."""
    return {"steps": frame["steps"]} if "steps" in frame else frame


def _read(
    data: Mapping[str, Any],
    kinds: Sequence[str],
    *,
    file: str | None,
    stem: str = "",
    folder: Path = Path(),
) -> Chain:
    """Read every key, raise what is wrong, and only then build."""
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
    base, tool = (read_frame(table.table(key), units) if table.has(key) else None for key in ("base", "tool"))
    build = _READERS[kind](table, units, folder)
    carried = read_carried(table, units)
    table.report_unknown_keys()
    if faults:
        raise RobotError(*faults)
    try:
        chain = build(name)
    except RobotError as error:
        further = (Finding(f"robot {name}: {fault}") for fault in own_faults(carried))
        raise RobotError(*_in_file(file, (*error.findings, *further))) from error
    if len(chain.joints) > MAX_LINKS:
        raise RobotError(Finding(f"found {len(chain.joints)} joints, allowed: {MAX_LINKS} at most", file))
    try:
        return replace(
            chain.placed(base, tool),
            name=name or chain.name,
            start=_start(chain, start, units) or chain.start,
            description=description or chain.description,
            source=source or chain.source,
            **carried,
        )
    except RobotError as error:
        raise RobotError(*_in_file(file, error.findings)) from error


def _in_file(file: str | None, findings: Iterable[Finding]) -> Iterator[Finding]:
    """Yield findings as those of a file, unless they name one."""
    return (replace(one, file=one.file or file) for one in findings)


def _unsaid_units(data: Mapping[str, Any], chain: Chain) -> Iterator[str]:
    """Yield which units rows of numbers should tell: as they stand they make no arm in m and rad."""
    if data["kind"] in {"joints", "urdf"}:
        return
    frames = [*(joint.origin for joint in chain.joints), chain.tip]
    length = sum(math.hypot(*frame.translation) for frame in frames)
    if "length_unit" not in data and length > LONGEST:
        yield f'key length_unit: found none, and links of {length:.4g} m, allowed: "mm", or "m" if intended'
    twists = [row.get(key, 0.0) for row in data.get("joints", ()) for key in ("theta", "alpha")]
    angle = max(map(abs, (*data.get("tilts", ()), *twists)), default=0.0)
    if "angle_unit" not in data and angle > 2.0 * math.pi:
        yield f'key angle_unit: found none, and {angle:.4g} rad, allowed: "deg", or "rad" if intended'


def _read_urm(table: CheckedTable, units: Units, folder: Path) -> Build:
    """Read the keys of an arm of modules."""
    lengths = tuple(units.length(value) for value in table.numbers("lengths", None))
    tilts = tuple(units.angle(value) for value in table.numbers("tilts", None))
    directions = table.numbers("directions", None, ())
    limits = _limits(table.table("limits"), ["revolute"] * len(tilts), units)

    def build(name: str) -> Chain:
        """Return the arm; its last joint, the effector, is fixed and has no limits."""
        chain = urm_chain(name, lengths, tilts, directions=directions)
        *modules, effector = chain.joints
        limited = [replace(joint, **limit._asdict()) for joint, limit in zip(modules, limits, strict=True)]
        return replace(chain, joints=(*limited, effector))

    return build


def _read_dh(table: CheckedTable, units: Units, folder: Path, *, modified: bool = False) -> Build:
    """Read the keys of an arm by Denavit-Hartenberg parameters."""
    rows = [_dh_row(row, units) for row in table.tables("joints")]
    moving = [row.kind for row in rows if row.kind != "fixed"]
    limits = iter(_limits(table.table("limits"), moving, units))
    limited = [row if row.kind == "fixed" else replace(row, **next(limits)._asdict()) for row in rows]
    return partial(modified_dh_chain if modified else dh_chain, rows=limited)


def _read_articulated6r(table: CheckedTable, units: Units, folder: Path) -> Build:
    """Read the keys of an articulated 6R arm."""
    lengths = tuple(units.length(value) for value in table.numbers("lengths", 5))
    limits = _limits(table.table("limits"), ["revolute"] * 6, units)

    def build(name: str) -> Chain:
        """Return the arm with its limits."""
        chain = articulated_6r(*lengths, name=name)
        limited = [
            replace(joint, **limit._asdict()) for joint, limit in zip(chain.joints, limits, strict=True)
        ]
        return replace(chain, joints=tuple(limited))

    return build


def _read_joints(table: CheckedTable, units: Units, folder: Path) -> Build:
    """Read the keys of an arm joint by joint."""
    joints = tuple(_joint(row, units) for row in table.tables("joints"))
    return partial(Chain, joints=joints, tip=read_frame(table.table("tip"), units))


def _read_urdf(table: CheckedTable, units: Units, folder: Path) -> Build:
    """Read the keys of an arm that a URDF describes."""
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


def _dh_row(table: CheckedTable, units: Units) -> DHRow:
    """Read a row of parameters."""
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


def _joint(table: CheckedTable, units: Units) -> Joint:
    """Read a joint with its frame, axis, limits and mimic."""
    kind = table.choice("kind", ("revolute", "prismatic", "fixed"), "revolute")
    joint = Joint(
        table.text("name"),
        cast("JointKind", kind),
        read_frame(table.table("origin"), units),
        cast("tuple[float, float, float]", table.numbers("axis", 3, (0.0, 0.0, 1.0))),
        **{
            key: _limit(key, kind, table.number(key, default, infinite=True), units)
            for key, default in _Limits._field_defaults.items()
        },
        mimic=_mimic(table.table("mimic"), kind, units) if table.has("mimic") else None,
    )
    table.report_unknown_keys()
    return joint


def _mimic(table: CheckedTable, kind: str, units: Units) -> Mimic:
    """Read which joint another follows."""
    mimic = Mimic(
        table.text("joint"),
        table.number("multiplier", 1.0),
        units.of_joint(kind, table.number("offset", 0.0)),
    )
    table.report_unknown_keys()
    return mimic


def _limits(table: CheckedTable, kinds: Sequence[JointKind], units: Units) -> list[_Limits]:
    """Return the limits of every joint, in SI."""
    given = {key: table.spread(key, len(kinds), default) for key, default in _Limits._field_defaults.items()}
    table.report_unknown_keys()
    return [
        _Limits(**{key: _limit(key, kind, values[k], units) for key, values in given.items()})
        for k, kind in enumerate(kinds)
    ]


def _limit(key: str, kind: str, value: float, units: Units) -> float:
    """Return a limit of a joint in SI, which an effort is already."""
    return value if key == "effort" else units.of_joint(kind, value)


def _start(chain: Chain, values: tuple[float, ...], units: Units) -> tuple[float, ...]:
    """Return the calibration pose in SI; a wrong count is left to the chain to refuse."""
    if len(values) != len(chain.moving):  # Chain says what is wrong
        return values
    return tuple(units.of_joint(joint.kind, value) for joint, value in zip(chain.moving, values, strict=True))


def _joint_to_dict(joint: Joint) -> dict[str, Any]:
    """Return a joint as a JSON object; an effort that is not known is left out."""
    limits = {key: _finite_or_none(getattr(joint, key)) for key in _Limits._fields}
    if limits["effort"] is None:
        del limits["effort"]
    return {
        "name": joint.name,
        "kind": joint.kind,
        "origin": frame_to_dict(joint.origin),
        "axis": [float(value) for value in joint.axis],
        **limits,
        "mimic": joint.mimic and _mimic_to_dict(joint.mimic),
    }


def _mimic_to_dict(mimic: Mimic) -> dict[str, Any]:
    """Return a mimic as a JSON object."""
    return {"joint": mimic.joint, "multiplier": float(mimic.multiplier), "offset": float(mimic.offset)}


def _finite_or_none(value: float) -> float | None:
    """Return a number, None of an infinite one."""
    return float(value) if math.isfinite(value) else None
