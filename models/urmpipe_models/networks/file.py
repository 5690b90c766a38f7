"""A network: parts with which nothing is wrong.

Networks as TOML files: read, made SI, and everything that is wrong reported at once, by file and line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
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


@dataclass(frozen=True, repr=False)
class Network(Parts, Displayable):
    """Bodies, and what ties them: joints, constraint elements, controls.

    `urmpipe.load_network` reads one from a file, or makes one of such tables.

    Attributes:
        description: One line for people.
        source: Where the numbers come from.
        length_unit: m or mm: the unit in which its file has lengths, and people give them.
        angle_unit: rad or deg, likewise of angles.

    Raises:
        NetworkError: With everything that is wrong.
    """

    description: str = ""
    source: str = ""
    length_unit: str = field(default="m", compare=False)
    angle_unit: str = field(default="rad", compare=False)

    def __post_init__(self) -> None:
        if found := tuple(dict.fromkeys(validate_parts(self))):
            raise NetworkError(*found)

    def _headline(self) -> str:
        """Return its name, what it is, and how much there is of it."""
        parts = {"body": len(self.bodies) + 1, "joint": len(self.joints), "element": len(self.elements)}
        counts = (
            f"{count} bodies" if what == "body" else format_count(count, what)
            for what, count in parts.items()
            if count
        )
        return format_headline(self.name, self.description, ", ".join(counts))

    def _table(self) -> str:
        """Return a row a joint or element: its name, kind and bodies."""
        rows = "".join(
            f"<tr><td>{escape_html(one.name)}</td><td>{one.kind}</td><td>{escape_html(one.bodies[0])}</td>"
            f"<td>{escape_html(one.bodies[1])}</td></tr>"
            for _, one in self.constraints
        )
        return f"<table><tr><th>name</th><th>kind</th><th>body</th><th>body</th></tr>{rows}</table>"


READ_BY = {
    "untied": {"bodies", "body", "robot"},
    "idle": {"driven", "value", "m", "n", "a", "d", "h", "kind"},
    "parallel": {"bodies", "body", "kind", "driven", "value", "m", "n", "a", "start", "pitch", "s", "theta"},
    "coupled": {"robot", "kind"},
}
"""The keys without which a body seems to be untied, a control to drive nothing, lines to be parallel, and a
joint of a pair to be missing or of another kind."""


def network_names() -> tuple[str, ...]:
    """Return the names of the shipped networks."""
    return tuple(sorted(path.stem for path in NETWORKS.glob("*.toml")))


def load_network(network: str | Path | Mapping[str, Any]) -> Network:
    """Return a shipped network, that of a .toml file, or of its tables; docs/networks.md has their keys.

    Args:
        network: The name of the network, in capitals or not, its words joined by - or _; a file; or tables,
            such as {"joints": {"A": {"kind": "revolute", "bodies": ["ground", "crank"]}}, ...}.

    Raises:
        NetworkError: If there is no such network, or with everything that is wrong with its tables. A
            finding's `about` is the table or key, such as joints.A.n.
    """
    if isinstance(network, Mapping):
        return _network(network, "network", Path())
    path = _path_of(network)
    data = read_toml(path, NetworkError)
    try:
        return _network(data, path.stem, path.parent)
    except NetworkError as error:
        faults = add_line_numbers(path, str(network), error.findings)
        raise NetworkError(*sorted(faults, key=lambda one: one.line or 0)) from error


def _network(tables: Mapping[str, Any], name: str, folder: Path) -> Network:
    """Return the network of tables.

    Args:
        tables: The tables.
        name: Its name where the tables have none.
        folder: Where files of robots are relative to.

    Raises:
        NetworkError: With everything that is wrong.
    """
    read = _Reader(tables, folder)
    texts = {key: read.table.text(key, default) for key, default in _texts(name).items()}
    parts = read.parts()
    if faults := [*dict.fromkeys((*read.faults, *read.further(parts)))]:
        raise NetworkError(*faults)
    return Network(
        bodies=parts.bodies,
        joints=parts.joints,
        elements=parts.elements,
        controls=parts.controls,
        ground=parts.ground,
        length_unit="mm" if read.units.millimetres else "m",
        angle_unit="deg" if read.units.degrees else "rad",
        **texts,
    )


def _texts(name: str) -> dict[str, str]:
    return {"name": name, "description": "", "source": ""}


def _path_of(name_or_path: str | Path) -> Path:
    """Return the path of a network's file."""
    path, names = Path(name_or_path), network_names()
    if path.suffix.lower() == ".toml":
        return path
    name = str(name_or_path).casefold().replace("_", "-")
    if name in names:
        return NETWORKS / f"{name}.toml"
    found = f"{format_value(str(name_or_path))}{format_suggestion(str(name_or_path), names)}"
    raise NetworkError(f"unknown network {found}; allowed: {', '.join(names)}, or a .toml file")


class _Reader:
    """The tables of a network on their way to its parts.

    Attributes:
        faults: What is wrong with the tables, `about` a table or key each.
        places: Where parts stand in the file that do not stand under their own names.
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

    def parts(self) -> Parts:
        """Return what the tables describe; what is wrong is in `faults`."""
        bodies = [*self._bodies()]
        controls = [self._control(*row) for row in self._rows("controls")]
        joints = [self._joint(*row) for row in self._rows("joints")]
        element_rows = [*self._rows("elements")]
        for joint, body in read_dh(self.table.table("dh"), self.units, self.ground, self.places):
            joints.append(joint)
            bodies += [] if body is None else [body]
        unread = []
        rows = dict(self._rows("chains"))
        for name, table in rows.items():
            chain = read_chain(name, table, self.units, self.folder, self.ground, self.places)
            if _stands_on_itself(name, rows):
                table.add_error("body", f"found a body that {name} carries itself; allowed: another")
            if chain is None or _stands_on_itself(name, rows):
                unread.append(f"{name}.")
            else:
                bodies, joints = bodies + chain.bodies, joints + chain.joints
                controls += chain.controls
        named = {one.name: one for one in joints}
        elements = [self._element(*row, named) for row in element_rows]
        self.table.report_unknown_keys()
        bodies += _standing_in(unread, (*joints, *elements))
        return Parts("", tuple(bodies), tuple(joints), tuple(elements), tuple(controls), self.ground)

    def further(self, parts: Parts) -> Iterator[Finding]:
        """Yield what is wrong with the parts, unless it follows from what is wrong with the tables."""
        unread = {re.sub(r"\[\d+\]$", "", one.about or "") for one in self.faults}
        for one in validate_parts(parts):
            fault = replace(one, about=self._place(one.about or ""))
            if not _follows(fault, unread):
                yield fault

    def _place(self, about: str) -> str:
        """Return where in the file a part stands."""
        name = about
        while name not in self.places and "." in name:
            name = name.rpartition(".")[0]
        return self.places.get(name, about)

    def _rows(self, key: str) -> Iterator[tuple[str, CheckedTable]]:
        """Yield the tables in a table by their names; what is no table is noted and left out."""
        given = self.table.value(key)
        for name, table in self.table.named_tables(key).items():
            if isinstance(given[name], Mapping):
                yield name, table

    def _bodies(self) -> Iterator[Body]:
        """Yield the bodies but for the ground, which may have a table without keys."""
        for name, table in self._rows("bodies"):
            if name == self.ground:
                if table.has("start"):
                    table.add_error("start", "found a start of the body that stands still, allowed: none")
            else:
                numbers = table.numbers("start", len(POSE_UNITS)) if table.has("start") else ()
                pairs = zip(numbers, POSE_UNITS, strict=False)
                yield Body(name, tuple(to_si(one, unit, self.units) for one, unit in pairs))
            table.report_unknown_keys()

    def _control(self, name: str, table: CheckedTable) -> Control:
        """Read a control: its start and limits, or its function of others."""
        many = len(self.faults)
        if table.has("value"):
            control = Control(name, value=read_expression(table, "value", "", self.units))
        else:
            lower, upper = (
                table.number(key, default, infinite=True)
                for key, default in (("lower", -math.inf), ("upper", math.inf))
            )
            control = Control(name, table.number("start", 0.0), lower, upper)
        if len(self.faults) > many:  # nothing is found of values that no number stands for
            control = Control(name, math.nan)
        table.report_unknown_keys()
        return control

    def _joint(self, name: str, table: CheckedTable) -> Joint:
        """Read a joint; one whose kind is none holds its bodies together."""
        ends = _ends(table)
        kind = cast("JointKind", self._kind(table, tuple(JOINT_UNITS)))
        if not kind:
            return Joint(name, "user", ends, motion=IDENTITY_MOTION)
        if kind == "user":
            joint = Joint(name, kind, ends, motion=read_motion(table, self.units))
        else:
            frames, start = read_frames(table, self.units), read_start(table, JOINT_UNITS[kind], self.units)
            values = read_drives(table, JOINT_UNITS[kind], self.units)
            pitch = self.units.length(table.number("pitch")) if kind == "helical" else 0.0
            limits = () if kind == "global" else read_limits(table, JOINT_UNITS[kind], self.units)
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

    def _kind(self, table: CheckedTable, kinds: tuple[str, ...]) -> str:
        """Return the kind of a joint or an element; "" where it has none, and so no known keys."""
        many = len(self.faults)
        kind = table.choice("kind", kinds)
        return kind if len(self.faults) == many else ""

    def _element(self, name: str, table: CheckedTable, joints: Mapping[str, Joint]) -> ConstraintElement:
        """Read an element."""
        if table.value("kind") in [*PAIR_JOINTS]:
            return read_pair(name, table.value("kind"), table, joints, self.units, self.folder)
        ends = _ends(table)
        kind = cast("ElementKind", self._kind(table, get_args(ElementKind)))
        if not kind:
            return ConstraintElement(name, "gg", ends, Expression("1.0"))
        normals = (DEFAULT_N, DEFAULT_N)
        if kind != "gg":
            first, second = read_vectors(table, "n", "one or two" if kind == "crc" else "one")
            normals = (first, second if kind == "crc" else DEFAULT_N)
        points = read_points(table, self.units, POINTS[kind])
        length = read_expression(table, "h" if kind == "eg" else "d", "m", self.units)
        table.report_unknown_keys()
        return ConstraintElement(
            name, kind, ends, length, (ZERO, points[1]) if kind == "eg" else points, normals
        )


POINTS: dict[ElementKind, VectorCount] = {"gg": "one or two", "eg": "one", "crc": "one or two", "gc": "two"}
"""Of which bodies an element has points."""


def _ends(table: CheckedTable) -> tuple[str, str]:
    """Return the two bodies of a joint or an element."""
    many = len(table.faults)
    names = table.texts("bodies")
    if len(names) == 2:
        return names[0], names[1]
    if len(table.faults) == many:
        table.add_error("bodies", f"found {len(names)}, allowed: the names of two bodies")
    return "", ""


def _stands_on_itself(name: str, chains: Mapping[str, CheckedTable]) -> bool:
    """Return whether a chain is carried by its own bodies, be it through other chains."""
    on, passed = name, 0
    while passed < len(chains):
        carrier = str(chains[on].value("body"))
        on = next((other for other in chains if carrier.startswith(f"{other}.")), "")
        passed += 1
        if on in ("", name):
            return on == name
    return False


def _standing_in(unread: list[str], ties: Iterable[Joint | ConstraintElement]) -> Iterator[Body]:
    """Yield the bodies of chains that could not be read, as far as something is tied to them."""
    names = {name: None for tie in ties for name in tie.bodies if name.startswith(tuple(unread))}
    yield from map(Body, names)


def _follows(fault: Finding, unread: set[str]) -> bool:
    """Return whether a fault of the parts may come of what stands in for tables and keys that are wrong."""
    keys = {one.rpartition(".")[2] for one in unread if one.count(".") > 1}
    return fault.about in unread or bool(keys & READ_BY.get(fault.kind, set()))
