"""Networks, and their TOML files: read, made SI, and all errors reported at once, by file and line.

1. `load_network`: a network by the name of a shipped one, a file, or its tables; docs/networks.md has the
   keys.
2. `_Reader`: tables to parts, by `file_values` and `elements`. A valid part replaces each that cannot be
   read.
3. Errors of the parts (`faults`) at their places in the file, except those that may follow from a
   replacement.
4. `Network`: parts without errors.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast, get_args

from urmpipe_datasets import NETWORKS
from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.elementwise import ZERO
from urmpipe_models.errors import Finding, NetworkError, escape_html, format_suggestion, format_value
from urmpipe_models.files import add_line_numbers
from urmpipe_models.networks.elements import read_chain, read_dh, read_pair
from urmpipe_models.networks.faults import validate_parts
from urmpipe_models.networks.file_values import (
    DEFAULT_N,
    IDENTITY_MOTION,
    VectorCount,
    read_drives,
    read_expression,
    read_frames,
    read_limits,
    read_motion,
    read_points,
    read_start,
    read_vectors,
    to_si,
)
from urmpipe_models.networks.parts import (
    DEFAULT_GROUND,
    JOINT_UNITS,
    PAIR_JOINTS,
    POSE_UNITS,
    Body,
    ConstraintElement,
    Control,
    ElementKind,
    Expression,
    Joint,
    JointKind,
    Parts,
    exceeded_limits,
)
from urmpipe_models.robots.toml import Units
from urmpipe_models.toml_tables import CheckedTable, read_toml

# the keys that cause each kind of error of the parts if they cannot be read: a body seems to have no joint, a
# control to drive nothing, lines to be parallel, a joint of a pair to be missing or of another kind
CAUSES = {
    "untied": {"bodies", "body", "robot"},
    "idle": {"driven", "value", "m", "n", "a", "d", "h", "kind"},
    "parallel": {"bodies", "body", "kind", "driven", "value", "m", "n", "a", "start", "pitch", "s", "theta"},
    "coupled": {"robot", "kind"},
}

# the bodies that have points in an element
POINTS: dict[ElementKind, VectorCount] = {"gg": "one or two", "eg": "one", "crc": "one or two", "gc": "two"}


@dataclass(frozen=True, repr=False)
class Network(Parts, Displayable):
    """Bodies, and the joints, constraint elements and controls that constrain them.

    `urmpipe.load_network` reads one from a file, or makes one of such tables.

    Attributes:
        description: One line of description.
        source: The source of the numbers.
        length_unit: m or mm: the unit of lengths in its file, and of those that users enter.
        angle_unit: rad or deg: that of angles.

    Raises:
        NetworkError: With all errors.
    """

    description: str = ""
    source: str = ""
    length_unit: str = field(default="m", compare=False)
    angle_unit: str = field(default="rad", compare=False)

    def __post_init__(self) -> None:
        if faults := tuple(dict.fromkeys(validate_parts(self))):
            raise NetworkError(*faults)

    def _headline(self) -> str:
        """Return its name, its description, and the number of its parts."""
        parts = {"body": len(self.bodies) + 1, "joint": len(self.joints), "element": len(self.elements)}
        counts = (
            f"{count} bodies" if part == "body" else format_count(count, part)
            for part, count in parts.items()
            if count
        )
        return format_headline(self.name, self.description, ", ".join(counts))

    def _table(self) -> str:
        """Return one row per joint or element: its name, kind and bodies."""
        rows = "".join(
            f"<tr><td>{escape_html(part.name)}</td><td>{part.kind}</td><td>{escape_html(part.bodies[0])}</td>"
            f"<td>{escape_html(part.bodies[1])}</td></tr>"
            for _, part in self.constraints
        )
        return f"<table><tr><th>name</th><th>kind</th><th>body</th><th>body</th></tr>{rows}</table>"


def network_names() -> tuple[str, ...]:
    """Return the names of the shipped networks."""
    return tuple(sorted(path.stem for path in NETWORKS.glob("*.toml")))


def load_network(network: str | Path | Mapping[str, Any]) -> Network:
    """Return a shipped network, that of a .toml file, or of its tables; docs/networks.md has their keys.

    Args:
        network: The name of the network, in capitals or not, its words joined by - or _; a file; or tables,
            such as {"joints": {"A": {"kind": "revolute", "bodies": ["ground", "crank"]}}, ...}.

    Raises:
        NetworkError: If there is no such network, or with all errors of its tables. A finding's `about` is
            the table or key, such as joints.A.n.
    """
    if isinstance(network, Mapping):
        return _read_network(network, "network", Path())
    path = _find_file(network)
    tables = read_toml(path, NetworkError)
    try:
        return _read_network(tables, path.stem, path.parent)
    except NetworkError as error:
        faults = add_line_numbers(path, str(network), error.findings)
        raise NetworkError(*sorted(faults, key=lambda fault: fault.line or 0)) from error


def _find_file(name_or_path: str | Path) -> Path:
    path, names = Path(name_or_path), network_names()
    if path.suffix.lower() == ".toml":
        return path
    name = str(name_or_path).casefold().replace("_", "-")
    if name in names:
        return NETWORKS / f"{name}.toml"
    unknown = f"{format_value(str(name_or_path))}{format_suggestion(str(name_or_path), names)}"
    raise NetworkError(f"unknown network {unknown}; allowed: {', '.join(names)}, or a .toml file")


def _read_network(tables: Mapping[str, Any], default_name: str, folder: Path) -> Network:
    """Return the network of tables; files of robots and profiles are relative to the folder."""
    reader = _Reader(tables, folder)
    defaults = {"name": default_name, "description": "", "source": ""}
    texts = {key: reader.table.text(key, default) for key, default in defaults.items()}
    parts = reader.read_parts()
    if faults := [*dict.fromkeys((*reader.faults, *reader.validate(parts)))]:
        raise NetworkError(*faults)
    return Network(
        bodies=parts.bodies,
        joints=parts.joints,
        elements=parts.elements,
        controls=parts.controls,
        ground=parts.ground,
        length_unit="mm" if reader.units.millimetres else "m",
        angle_unit="deg" if reader.units.degrees else "rad",
        **texts,
    )


class _Reader:
    """The reader of the tables of a network.

    Attributes:
        faults: The errors of the tables, `about` a table or key each.
        places: The places in the file of parts that are not under their names.
    """

    def __init__(self, tables: Mapping[str, Any], folder: Path) -> None:
        self.faults: list[Finding] = []
        self.places: dict[str, str] = {}
        self.table = CheckedTable(tables, self.faults, None, key_in_about=True)
        self.folder = folder
        self.units = Units(
            self.table.choice("length_unit", ("m", "mm"), "m") == "mm",
            self.table.choice("angle_unit", ("rad", "deg"), "rad") == "deg",
        )
        self.ground = self.table.text("ground", DEFAULT_GROUND)

    def read_parts(self) -> Parts:
        """Return the parts of the tables; their errors are in `faults`."""
        bodies = [*self._read_bodies()]
        controls = [self._read_control(*row) for row in self._rows("controls")]
        joints = [self._read_joint(*row) for row in self._rows("joints")]
        element_rows = [*self._rows("elements")]
        for joint, body in read_dh(self.table.table("dh"), self.units, self.ground, self.places):
            joints.append(joint)
            bodies += [] if body is None else [body]
        unread: list[str] = []
        chains = dict(self._rows("chains"))
        for name, table in chains.items():
            chain = read_chain(name, table, self.units, self.folder, self.ground, self.places)
            is_circular = _carries_itself(name, chains)
            if is_circular:
                table.add_error("body", f"found a body that {name} carries itself; allowed: another")
            if chain is None or is_circular:
                unread.append(f"{name}.")
            else:
                bodies += chain.bodies
                joints += chain.joints
                controls += chain.controls
        joints_by_name = {joint.name: joint for joint in joints}
        elements = [self._read_element(*row, joints_by_name) for row in element_rows]
        self.table.report_unknown_keys()
        # replace the bodies of unread chains that have joints or elements
        constraints: list[Joint | ConstraintElement] = [*joints, *elements]
        ends = dict.fromkeys(name for constraint in constraints for name in constraint.bodies)
        bodies += [Body(name) for name in ends if name.startswith(tuple(unread))]
        return Parts("", tuple(bodies), tuple(joints), tuple(elements), tuple(controls), self.ground)

    def validate(self, parts: Parts) -> Iterator[Finding]:
        """Yield the errors of the parts, except those that may follow from errors of the tables."""
        unread = {re.sub(r"\[\d+\]$", "", fault.about or "") for fault in self.faults}
        unread_keys = {place.rpartition(".")[2] for place in unread if place.count(".") > 1}
        for fault in validate_parts(parts):
            name = about = fault.about or ""
            while name not in self.places and "." in name:
                name = name.rpartition(".")[0]
            where = self.places.get(name, about)
            if where not in unread and not unread_keys & CAUSES.get(fault.kind, set()):
                yield replace(fault, about=where)

    def _rows(self, key: str) -> Iterator[tuple[str, CheckedTable]]:
        """Yield the tables in a table by their names; values that are no table are noted and omitted."""
        values = self.table.value(key)
        for name, table in self.table.named_tables(key).items():
            if isinstance(values[name], Mapping):
                yield name, table

    def _read_bodies(self) -> Iterator[Body]:
        """Yield the bodies except the ground, which may have a table without keys."""
        for name, table in self._rows("bodies"):
            if name == self.ground:
                if table.has("start"):
                    table.add_error("start", "found a start of the body that stands still, allowed: none")
            else:
                numbers = table.numbers("start", len(POSE_UNITS)) if table.has("start") else ()
                pairs = zip(numbers, POSE_UNITS, strict=False)
                yield Body(name, tuple(to_si(number, unit, self.units) for number, unit in pairs))
            table.report_unknown_keys()

    def _read_control(self, name: str, table: CheckedTable) -> Control:
        faults = len(self.faults)
        if table.has("value"):
            control = Control(name, value=read_expression(table, "value", "", self.units))
        else:
            lower = table.number("lower", -math.inf, infinite=True)
            upper = table.number("upper", math.inf, infinite=True)
            control = Control(name, table.number("start", 0.0), lower, upper)
        if len(self.faults) > faults:  # NaN: functions of it are not validated
            control = Control(name, math.nan)
        table.report_unknown_keys()
        return control

    def _read_joint(self, name: str, table: CheckedTable) -> Joint:
        """Return a joint; one that cannot move if its kind is unknown."""
        ends = _read_ends(table)
        kind = cast("JointKind", self._read_kind(table, tuple(JOINT_UNITS)))
        if not kind:
            return Joint(name, "user", ends, motion=IDENTITY_MOTION)
        if kind == "user":
            joint = Joint(name, kind, ends, motion=read_motion(table, self.units))
        else:
            variables = JOINT_UNITS[kind]
            frames, start = read_frames(table, self.units), read_start(table, variables, self.units)
            values = read_drives(table, variables, self.units)
            pitch = self.units.length(table.number("pitch")) if kind == "helical" else 0.0
            limits = () if kind == "global" else read_limits(table, variables, self.units)
            joint = Joint(name, kind, ends, frames, start, values, pitch, limits=limits)
            self._check_start(table, joint)
            if table.has("driven"):
                self.places[f"joints.{name}.value"] = f"joints.{name}.driven"
        table.report_unknown_keys()
        return joint

    def _check_start(self, table: CheckedTable, joint: Joint) -> None:
        """Note a start of a free variable beyond its limits."""
        starts = zip(joint.start or (0.0,) * len(joint.units), joint.drives, strict=False)
        free = [start if drive is None else math.nan for start, drive in starts]  # NaN is beyond no limit
        if any(lower > upper for lower, upper in joint.limits):
            return
        for unit, value, end, limit in exceeded_limits(joint, free, is_coupled=False):
            size = to_si(1.0, unit, self.units)
            allowed = "at least lower" if end == "lower" else "at most upper"
            table.add_error("start", f"found {value / size:.6g}, allowed: {allowed}, {limit / size:.6g}")

    def _read_kind(self, table: CheckedTable, kinds: tuple[str, ...]) -> str:
        """Return the kind of a joint or an element; "" if it is unknown, and so are its keys."""
        faults = len(self.faults)
        kind = table.choice("kind", kinds)
        return kind if len(self.faults) == faults else ""

    def _read_element(self, name: str, table: CheckedTable, joints: Mapping[str, Joint]) -> ConstraintElement:
        if table.value("kind") in [*PAIR_JOINTS]:
            return read_pair(name, table.value("kind"), table, joints, self.units, self.folder)
        ends = _read_ends(table)
        kind = cast("ElementKind", self._read_kind(table, get_args(ElementKind)))
        if not kind:
            return ConstraintElement(name, "gg", ends, Expression("1.0"))
        normals = (DEFAULT_N, DEFAULT_N)
        if kind != "gg":
            first, second = read_vectors(table, "n", "one or two" if kind == "crc" else "one")
            normals = (first, second if kind == "crc" else DEFAULT_N)
        points = read_points(table, self.units, POINTS[kind])
        points = (ZERO, points[1]) if kind == "eg" else points
        length = read_expression(table, "h" if kind == "eg" else "d", "m", self.units)
        table.report_unknown_keys()
        return ConstraintElement(name, kind, ends, length, points, normals)


def _read_ends(table: CheckedTable) -> tuple[str, str]:
    """Return the two bodies of a joint or an element."""
    faults = len(table.faults)
    names = table.texts("bodies")
    if len(names) == 2:
        return names[0], names[1]
    if len(table.faults) == faults:
        table.add_error("bodies", f"found {len(names)}, allowed: the names of two bodies")
    return "", ""


def _carries_itself(name: str, chains: Mapping[str, CheckedTable]) -> bool:
    """Return whether a chain is carried by one of its bodies, directly or through other chains."""
    chain = name
    for _ in chains:
        carrier = str(chains[chain].value("body"))
        chain = next((other for other in chains if carrier.startswith(f"{other}.")), "")
        if chain in ("", name):
            return chain == name
    return False
