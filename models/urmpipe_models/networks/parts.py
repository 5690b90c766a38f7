"""Arithmetic in a text, such as `2 * s + 0.1`: parsed to a tree, never executed, with exact derivatives.

The parts of a network: bodies, joints, constraint elements and controls, right or wrong.

What is wrong with the controls of a network, and with the names in functions of them.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache, cached_property
from itertools import accumulate
from typing import Literal, TypeAlias

import numpy as np

from urmpipe_models.elementwise import ZERO, Element, Vector, cross, minus, plus, times
from urmpipe_models.errors import Finding, OptionError, closest_name, format_unknown_name, format_value
from urmpipe_models.math3d import Transform
from urmpipe_models.measure_units import DEGREE, NAMES, WRITTEN, quantity_to_si

MAX_LETTERS = 1000
"""Letters of an expression: more are no formula that a person wrote."""

MAX_DEPTH = 50
"""Brackets and operators within each other."""

ALLOWED_ARITHMETIC = (
    "numbers, names of controls, pi, + - * / ** and brackets, sin, cos, tan, atan2, sqrt, exp"
)

Gradient: TypeAlias = dict[str, Element]
"""The partial derivative by each name that there is one of, in the expression's unit a unit of the name."""

Valued: TypeAlias = tuple[Element, Gradient]


@dataclass(frozen=True)
class Expression:
    """A formula of names.

    Attributes:
        text: As it is written; what is no arithmetic raises a `ValueError` that says what is allowed.

    """

    text: str

    def __post_init__(self) -> None:
        _ = self._tree

    @cached_property
    def names(self) -> frozenset[str]:
        """The names in it but for pi."""
        found = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(found - {"pi", *_FUNCTIONS})

    def value(self, values: Mapping[str, Element]) -> Element:
        """Return its value at values of its names, any elements."""
        return self.value_and_gradient(values)[0]

    def value_and_gradient(self, values: Mapping[str, Element]) -> Valued:
        """Return its value and its partial derivatives at values of its names, any elements.

        By the rules of differentiation along its tree, so that they are exact to rounding.
        """
        with np.errstate(all="ignore"):  # what is no number is found by who uses it
            return _valued(self._tree, values)

    @cached_property
    def _tree(self) -> ast.expr:
        return _parsed(self.text)


@cache
def _parsed(text: str) -> ast.expr:
    """Return the tree of an expression whose parts are all arithmetic; raise a `ValueError` of any other."""
    if len(text) > MAX_LETTERS:
        raise ValueError(f"found {format_value(text)} of {len(text)} letters, allowed: {MAX_LETTERS} at most")
    if (nested := _nested(text)) > MAX_DEPTH:
        raise ValueError(f"found {format_value(text)}, nested {nested} deep; allowed: {MAX_DEPTH}")
    try:
        if "#" in text:  # the rest would be a remark
            raise SyntaxError("a remark")
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(
            f"found {format_value(text)}, no arithmetic; allowed: {ALLOWED_ARITHMETIC}"
        ) from error
    _refuse(tree, text, 0)
    return tree


def _nested(text: str) -> int:
    """Return how many brackets of a text are open at most."""
    open_ones = accumulate((sign == "(") - (sign == ")") for sign in text)
    return max(open_ones, default=0)


def _refuse(node: ast.expr, text: str, depth: int) -> None:
    """Raise a `ValueError` if a tree holds anything but arithmetic, or is nested too deep."""
    if depth > MAX_DEPTH:
        raise ValueError(f"found {format_value(text)}, nested {depth} deep; allowed: {MAX_DEPTH}")
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool) and _finite(value):
            parts: list[ast.expr] = []
        case ast.Name(id=name) if name not in _FUNCTIONS:
            parts = []
        case ast.BinOp(left, ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow(), right):
            parts = [left, right]
        case ast.UnaryOp(ast.UAdd() | ast.USub(), operand):
            parts = [operand]
        case ast.Call(ast.Name(id=name), args, []):
            if name not in _FUNCTIONS:
                raise ValueError(f"function {format_unknown_name(name, _FUNCTIONS)}")
            if len(args) != _arguments(name):
                allowed = f"{_arguments(name)}"
                raise ValueError(f"found {len(args)} arguments of {name}, allowed: {allowed}")
            parts = args
        case _:
            found = ast.get_source_segment(text.strip(), node) or text
            hint = (
                "; a power is **" if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor) else ""
            )
            raise ValueError(
                f"found {format_value(found)}, no arithmetic; allowed: {ALLOWED_ARITHMETIC}{hint}"
            )
    for part in parts:
        _refuse(part, text, depth + 1)


def _finite(value: float) -> bool:
    """Return whether a constant is a number that a float holds."""
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _arguments(name: str) -> int:
    return 2 if name == "atan2" else 1


def _valued(node: ast.expr, values: Mapping[str, Element]) -> Valued:
    """Return the value of a part of a tree, and its derivatives."""
    match node:
        case ast.Constant(value=value):
            return float(value), {}  # type: ignore[arg-type]
        case ast.Name(id="pi"):
            return math.pi, {}
        case ast.Name(id=name):
            return values[name], {name: 1.0}
        case ast.UnaryOp(op, operand):
            value, slopes = _valued(operand, values)
            return (value, slopes) if isinstance(op, ast.UAdd) else (minus(0.0, value), _by(slopes, -1.0))
        case ast.BinOp(left, op, right):
            return _OPERATORS[type(op)](_valued(left, values), _valued(right, values))
        case ast.Call(ast.Name(id=name), args):
            return _FUNCTIONS[name](*(_valued(one, values) for one in args))
    raise TypeError(f"{ast.dump(node)} was let through")


def _by(slopes: Gradient, factor: Element) -> Gradient:
    """Return derivatives times a factor."""
    return {name: times(factor, slope) for name, slope in slopes.items()}


def _sum(first: Gradient, second: Gradient) -> Gradient:
    """Return the sums of derivatives."""
    return {name: plus(first.get(name, 0.0), second.get(name, 0.0)) for name in {**first, **second}}


def _add(a: Valued, b: Valued) -> Valued:
    return plus(a[0], b[0]), _sum(a[1], b[1])


def _subtract(a: Valued, b: Valued) -> Valued:
    return minus(a[0], b[0]), _sum(a[1], _by(b[1], -1.0))


def _multiply(a: Valued, b: Valued) -> Valued:
    return times(a[0], b[0]), _sum(_by(a[1], b[0]), _by(b[1], a[0]))


def _divide(a: Valued, b: Valued) -> Valued:
    """(a / b)' = a' / b - a b' / b^2."""
    inverse = np.divide(1.0, b[0])
    value = a[0] * inverse
    return value, _sum(_by(a[1], inverse), _by(b[1], -value * inverse))


def _power(a: Valued, b: Valued) -> Valued:
    """(a^b)' = b a^(b - 1) a' + a^b ln(a) b', the last only where b varies: a may be negative else."""
    value = np.power(a[0], b[0])
    slopes = _by(a[1], times(b[0], np.power(a[0], minus(b[0], 1.0)))) if a[1] else {}
    return value, _sum(slopes, _by(b[1], value * np.log(a[0]))) if b[1] else slopes


_OPERATORS: dict[type[ast.operator], Callable[[Valued, Valued], Valued]] = {
    ast.Add: _add,
    ast.Sub: _subtract,
    ast.Mult: _multiply,
    ast.Div: _divide,
    ast.Pow: _power,
}


def _sin(a: Valued) -> Valued:
    return np.sin(a[0]), _by(a[1], np.cos(a[0]))


def _cos(a: Valued) -> Valued:
    return np.cos(a[0]), _by(a[1], -np.sin(a[0]))


def _tan(a: Valued) -> Valued:
    value = np.tan(a[0])
    return value, _by(a[1], 1.0 + value * value)


def _sqrt(a: Valued) -> Valued:
    value = np.sqrt(a[0])
    return value, _by(a[1], np.divide(0.5, value)) if a[1] else {}


def _exp(a: Valued) -> Valued:
    value = np.exp(a[0])
    return value, _by(a[1], value)


def _atan2(y: Valued, x: Valued) -> Valued:
    """atan2(y, x)' = (x y' - y x') / (x^2 + y^2)."""
    square = np.divide(1.0, y[0] * y[0] + x[0] * x[0])
    return np.arctan2(y[0], x[0]), _sum(_by(y[1], x[0] * square), _by(x[1], -y[0] * square))


_FUNCTIONS: dict[str, Callable[..., Valued]] = {
    "sin": _sin,
    "cos": _cos,
    "tan": _tan,
    "atan2": _atan2,
    "sqrt": _sqrt,
    "exp": _exp,
}


DEFAULT_GROUND = "ground"
"""What the body that stands still is called by default."""

JointKind = Literal["revolute", "prismatic", "cylindrical", "helical", "global", "user"]
ElementKind = Literal["gg", "eg", "crc", "gc", "gear", "rack", "cam"]

JOINT_UNITS: dict[JointKind, tuple[str, ...]] = {
    "revolute": ("rad",),
    "prismatic": ("m",),
    "cylindrical": ("rad", "m"),
    "helical": ("rad",),
    "global": ("rad", "rad", "rad"),
    "user": (),
}
"""The unit of each variable of a joint of a kind: theta, s, theta and s, theta, the rotation vector q."""

POSE_UNITS = ("m", "m", "m", "rad", "rad", "rad")
"""Those of a body that no joint ties to the ground: x, y, z and a rotation vector."""

_ANGLES: tuple[JointKind, ...] = ("revolute", "cylindrical", "helical")

PAIR_JOINTS: dict[ElementKind, tuple[tuple[JointKind, ...], tuple[JointKind, ...]]] = {
    "gear": (_ANGLES, _ANGLES),
    "rack": (_ANGLES, ("prismatic", "cylindrical")),
    "cam": (_ANGLES, ("prismatic", "revolute")),
}  # of a pair, the kinds of its first joint, whose angle counts, and of its second: a rack moves s of it

AXES_TOLERANCE = 1e-9  # of lengths and products of unit vectors: rounding, not a forgotten normalisation

LIMIT_TOLERANCE = 1e-6  # [m], [rad]: assemblies that differ by less are the same

_NUMBERS = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body.

    Attributes:
        name: Its name.
        start: Of a body that no joint ties to the ground: x, y, z in [m] and its rotation vector in [rad],
            from where assembly starts; empty where that is not given.
    """

    name: str
    start: tuple[float, ...] = ()


@dataclass(frozen=True)
class Joint:
    """A joint between two bodies: R = A_1 T(q) A_2^-1 is the second body seen from the first.

    Attributes:
        name: Its name.
        kind: revolute: T turns by theta about n; prismatic: it slides by s along n; cylindrical: both;
            helical: it turns by theta and slides by pitch theta; global: it turns by the rotation vector q;
            user: T is any function of controls.
        bodies: The first and the second body.
        frames: A_1 and A_2: the columns of their rotations are m, n and m x n, their translations are a.
        start: The variables from where assembly starts, in [rad] and [m] by `JOINT_UNITS`.
        values: What drives each variable, in [rad] and [m]; None where it is free; empty: all are.
        pitch: Of a helical joint in [m/rad].
        motion: Of a user joint: m, n (unit vectors) and a in [m], each three functions of controls.
        limits: The least and the largest value of each variable, in [rad] and [m]; empty: no limits.

    Source: [KinematicSystems]_ eq. 3-2 to 3-4 and section 3.2.2, with its errata.
    """

    name: str
    kind: JointKind
    bodies: tuple[str, str]
    frames: tuple[Transform, Transform] = (Transform(), Transform())
    start: tuple[float, ...] = ()
    values: tuple[Expression | None, ...] = ()
    pitch: float = 0.0
    motion: tuple[Expression, ...] = ()
    limits: tuple[tuple[float, float], ...] = ()

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of each of its variables, rad or m."""
        return JOINT_UNITS[self.kind]

    @property
    def drives(self) -> tuple[Expression | None, ...]:
        """What drives each of its variables; None where it is free."""
        return self.values or (None,) * len(self.units)


@dataclass(frozen=True)
class ConstraintElement:
    """One constraint between two bodies, or between the variables of two joints: a higher pair.

    Attributes:
        name: Its name.
        kind: gg: the two points are at a distance d; eg: the second point is in a plane of the first body
            with normal n, at h from its origin; crc: two lines, through the points along n, are at a distance
            d; gc: the second point is at a distance d from a line of the first body; gear, rack, cam: the
            variable of the second joint is a function of the angle of the first, see `higher_pairs`.
        bodies: The first and the second body; of a pair `pair_bodies` of its joints.
        length: d or h in [m]; of a pair the offset of its second variable in [m] or [rad].
        points: a of each in [m]; of eg that of the first means nothing; of a pair both mean nothing.
        normals: n of each, unit vectors [-]; of gg and of a pair both, of eg and gc the second mean nothing.
        joints: Of a pair the names of the first and the second joint; else empty.
        teeth: Of a gear those of both wheels, negative of an internal one.
        radius: Of a rack that of its pinion in [m], with a sign.
        profile: Of a cam its points: the angle in [rad] and the follower's variable in [m] or [rad].

    Source: [KinematicSystems]_ section 3.2.3, with its errata.
    """

    name: str
    kind: ElementKind
    bodies: tuple[str, str]
    length: Expression
    points: tuple[Vector, Vector] = field(
        default=(ZERO, ZERO), metadata={"stored": tuple[_NUMBERS, _NUMBERS]}
    )
    normals: tuple[Vector, Vector] = field(
        default=((0.0, 1.0, 0.0), (0.0, 1.0, 0.0)), metadata={"stored": tuple[_NUMBERS, _NUMBERS]}
    )
    joints: tuple[str, ...] = ()
    teeth: tuple[float, ...] = ()
    radius: float = 0.0
    profile: tuple[tuple[float, float], ...] = ()

    @property
    def is_pair(self) -> bool:
        """Whether it relates the variables of two joints."""
        return self.kind in PAIR_JOINTS

    @property
    def length_key(self) -> str:
        """The key of its length in a file."""
        return "offset" if self.is_pair else "h" if self.kind == "eg" else "d"

    @cached_property
    def has_zero_length(self) -> bool:
        """Whether its length is the constant 0: two lines that meet have a distance with a sign."""
        return not self.length.names and float(self.length.value({})) == 0.0


@dataclass(frozen=True)
class Control:
    """A common parameter that drives joints and lengths through functions.

    Attributes:
        name: Its name in expressions.
        start: Its value where none is set, in the units that the expressions mean.
        lower: Its least value.
        upper: Its largest value.
        value: Its function of other controls; None if it can be set.

    Source: [KinematicSystems]_ section 3.2.4.
    """

    name: str
    start: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf
    value: Expression | None = None


PlacedExpression: TypeAlias = tuple[str, Expression]
"""A function of controls with its place in a file, such as joints.A.value."""


@dataclass(frozen=True, repr=False)
class Parts:
    """Bodies, and what ties them, right or wrong.

    Attributes:
        name: What they make is called.
        bodies: The bodies but for the ground.
        joints: The joints.
        elements: The constraint elements.
        controls: The controls.
        ground: The name of the body that stands still.
    """

    name: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...] = ()
    elements: tuple[ConstraintElement, ...] = ()
    controls: tuple[Control, ...] = ()
    ground: str = DEFAULT_GROUND

    def as_parts(self) -> Parts:
        """Return the parts of a network alone: others may take their places, right or wrong."""
        return Parts(self.name, self.bodies, self.joints, self.elements, self.controls, self.ground)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """The names of all bodies, the ground first."""
        return (self.ground, *(one.name for one in self.bodies))

    @cached_property
    def constraints(self) -> tuple[tuple[str, Joint | ConstraintElement], ...]:
        """The joints and elements, each with its place, such as joints.A."""
        joints = ((f"joints.{one.name}", one) for one in self.joints)
        return (*joints, *((f"elements.{one.name}", one) for one in self.elements))

    @cached_property
    def joint_functions(self) -> tuple[PlacedExpression, ...]:
        """The functions of joints."""
        found: list[PlacedExpression] = []
        for joint in self.joints:
            found += [(f"joints.{joint.name}.value", one) for one in joint.values if one is not None]
            found += [(f"joints.{joint.name}.{'mna'[k // 3]}", one) for k, one in enumerate(joint.motion[:9])]
        return tuple(found)

    @cached_property
    def length_functions(self) -> tuple[PlacedExpression, ...]:
        """The lengths of elements: h of eg, the offset of a pair, d of the others."""
        return tuple((f"elements.{one.name}.{one.length_key}", one.length) for one in self.elements)

    def pair_variables(self, element: ConstraintElement) -> tuple[tuple[Joint, int], ...]:
        """Return the joints of a pair that there are, each with the number of its variable."""
        joints = {joint.name: joint for joint in self.joints}
        known = [joints[name] for name in element.joints if name in joints]
        return tuple(
            (joint, len(joint.units) - 1 if k == 1 and element.kind == "rack" else 0)
            for k, joint in enumerate(known)
        )

    @cached_property
    def coupled_joints(self) -> frozenset[str]:
        """The names of joints in pairs: a full turn of these is another configuration."""
        return frozenset(name for one in self.elements for name in one.joints)

    @cached_property
    def element_units(self) -> tuple[str, ...]:
        """The unit of each element's length: m, or rad of a pair whose second joint turns."""
        seconds = (self.pair_variables(one)[1:] for one in self.elements)
        return tuple(some[0][0].units[some[0][1]] if some else "m" for some in seconds)

    def control_unit(self, control: str) -> tuple[str, Decimal] | None:
        """Return what a control is, m or rad, and how many of these one of it is.

        None where it drives neither a joint nor a length by itself, or both, or in several units.
        """
        driven = [pair for one in self.joints for pair in zip(one.units, one.drives, strict=True)]
        driven += zip(self.element_units, (one.length for one in self.elements), strict=True)
        alone = spellings(control)
        found = {(unit, alone[one.text]) for unit, one in driven if one is not None and one.text in alone}
        return found.pop() if len(found) == 1 else None

    def sole_control(self, text: str) -> str | None:
        """Return the control that a function consists of, whatever the units of its file; None of others."""
        names = (control.name for control in self.controls)
        return next((name for name in names if text in spellings(name)), None)

    def control_value(self, control: str, value: float | str) -> float:
        """Return the value of a control as it is given, of a number or a text with a unit.

        Args:
            control: Its name.
            value: A number in the units of the network, or a text such as "40deg".

        Raises:
            OptionError: If a text is no number, or its unit is not that of what the control drives by itself.
        """
        if not isinstance(value, str):
            return value
        si, factor = self.control_unit(control) or ("", Decimal(1))
        units = {unit: in_si / factor for unit, in_si in WRITTEN.get(si, {}).items()} | {"": Decimal(1)}
        number = quantity_to_si(value, units)
        if not math.isfinite(number):
            allowed = f"a number, or {NAMES[si].partition(' in ')[0]} with its unit" if si else "a number"
            raise OptionError(Finding(parameter="controls", found=f"{control} = {value}", allowed=allowed))
        return number

    @cached_property
    def control_functions(self) -> tuple[PlacedExpression, ...]:
        """The controls that are functions of others."""
        return tuple(
            (f"controls.{one.name}.value", one.value) for one in self.controls if one.value is not None
        )


def spellings(control: str) -> dict[str, Decimal]:
    """Return the functions that are a control alone, in files in m and rad, mm, deg, each with its factor."""
    return {
        control: Decimal(1),
        f"({control}) * 0.001": Decimal("0.001"),
        f"({control}) * pi / 180": DEGREE,
    }


def frame_from_axes(m: Vector, n: Vector, a: Vector) -> Transform:
    """Return A, whose rotation has the columns m, n and m x n [-], and whose translation is a in [m].

    Source: [KinematicSystems]_ section 3.2.2.
    """
    return Transform(Transform((m, n, cross(m, n))).columns, a)


def sort_controls(controls: Sequence[Control]) -> list[Control]:
    """Return controls, each after those that it is a function of; those of a cycle are left out."""
    ordered: list[Control] = []
    known: set[str] = set()
    left = list(controls)
    while ready := [one for one in left if one.value is None or one.value.names <= known]:
        ordered += ready
        known |= {one.name for one in ready}
        left = [one for one in left if one.name not in known]
    return ordered


def sample_range(control: Control) -> tuple[float, float]:
    """Return where a control is looked at: its range, where that is open at most 1 from its start."""
    if math.isfinite(control.upper - control.lower):
        return control.lower, control.upper
    return max(control.lower, control.start - 1.0), min(control.upper, control.start + 1.0)


def pair_bodies(first: Joint, second: Joint) -> tuple[str, str]:
    """Return the bodies that a pair of two joints connects in the graph: the second of each, if they differ.

    Else the first of each; if these are the same, too, both bodies of the first joint.
    """
    ends = [*zip(first.bodies[::-1], second.bodies[::-1], strict=True), first.bodies]
    return next((one for one in ends if one[0] != one[1]), first.bodies)


def exceeded_limits(
    joint: Joint, values: Sequence[float], *, is_coupled: bool
) -> Iterator[tuple[str, float, str, float]]:
    """Yield each variable beyond its limits: its unit, its value, `lower` or `upper`, and that limit.

    The angle of a revolute or cylindrical joint with two finite limits is within them if it is so after any
    number of full turns, unless the joint is in a pair, where full turns count.

    Args:
        joint: The joint.
        values: Its variables in [rad] and [m].
        is_coupled: Whether it is in a pair.
    """
    is_periodic = joint.kind in ("revolute", "cylindrical") and not is_coupled
    for unit, value, (lower, upper) in zip(joint.units, values, joint.limits, strict=False):
        nearest = value
        if is_periodic and unit == "rad" and math.isfinite(upper - lower + value):
            nearest -= 2.0 * math.pi * round((value - 0.5 * (lower + upper)) / (2.0 * math.pi))
        if nearest < lower - LIMIT_TOLERANCE or nearest > upper + LIMIT_TOLERANCE:
            end, limit = ("lower", lower) if value < lower else ("upper", upper)
            yield unit, value, end, limit


def control_faults(parts: Parts) -> Iterator[Finding]:
    """Yield what is wrong with controls, and names in functions of them that none of them has."""
    for one in parts.controls:
        yield from _own_faults(f"controls.{one.name}", one)
    names = sorted({one.name for one in parts.controls})
    driving = (*parts.joint_functions, *parts.length_functions)
    unknown: set[str] = set()
    for where, function in (*parts.control_functions, *driving):
        for name in sorted(function.names.difference(names)):
            unknown.add(name)
            yield Finding(f"control {format_unknown_name(name, names)}", about=where)
    for cycle in _cycles(parts.controls):
        way = " -> ".join((*cycle, cycle[0]))
        message = f"is a function of itself: {way}; allowed: functions of other controls"
        yield Finding(message, about=f"controls.{cycle[0]}.value")
    yield from _idle(parts.controls, driving, unknown)


def _own_faults(where: str, control: Control) -> Iterator[Finding]:
    """Yield what is wrong with the name, the limits and the start of a control."""
    if not is_control_name(control.name):
        allowed = "a letter, then letters, digits, _; not pi, a function or a word of Python"
        yield Finding(f"found {format_value(control.name)} as a name, allowed: {allowed}", about=where)
    if control.value is not None:
        return
    lower, start, upper = control.lower, control.start, control.upper
    if not lower <= upper:
        message = f"found {lower:g}, above upper, {upper:g}; allowed: at most upper"
        yield Finding(message, about=f"{where}.lower")
    elif not math.isfinite(start):
        yield Finding(f"found {start:g}, allowed: a finite number", about=f"{where}.start")
    elif not lower <= start <= upper:
        yield Finding(f"found {start:g}, allowed: {lower:g} to {upper:g}", about=f"{where}.start")


def is_control_name(text: str) -> bool:
    """Return whether an expression can have a text as the name of a control."""
    try:
        return text.isidentifier() and Expression(text).names == {text}
    except ValueError:
        return False


def _cycles(controls: tuple[Control, ...]) -> Iterator[list[str]]:
    """Yield the names of controls that are functions of each other, in a ring."""
    names = {one.name for one in controls}
    needs = {one.name: one.value.names & names if one.value else frozenset() for one in controls}
    while needs:
        while ready := [name for name, needed in needs.items() if not needed & needs.keys()]:
            for name in ready:
                del needs[name]
        if needs:  # each of these needs another of these
            way = [next(iter(needs))]
            while (following := min(needs[way[-1]] & needs.keys())) not in way:
                way.append(following)
            yield way[way.index(following) :]
            for name in way[way.index(following) :]:
                del needs[name]


def _idle(
    controls: tuple[Control, ...], driving: Sequence[PlacedExpression], unknown: set[str]
) -> Iterator[Finding]:
    """Yield controls that drive nothing, but for those that a name which is none may have meant."""
    names = [one.name for one in controls]
    found = {name for _, function in driving for name in function.names}
    found |= {closest_name(name, names) or "" for name in unknown}
    functions = {one.name: one.value.names for one in controls if one.value is not None}
    used: set[str] = set()
    while found:
        used |= found
        found = {name for one in found for name in functions.get(one, ())} - used
    for name in names:
        if name not in used:
            message = "drives nothing; allowed: controls that drive a joint or an element"
            yield Finding(message, about=f"controls.{name}", kind="idle")
