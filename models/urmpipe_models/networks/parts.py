"""Parts of a kinematic network, valid or not, and the expressions that drive them.

1. `Body`, `Joint`, `ConstraintElement`, `Control`: the parts, and `Parts`, all those of a network. The kinds
   of joints and elements are those of [KinematicSystems]_ chapter 3, with gears, racks and cams.
2. Functions of a part: its axes' frame, the bodies of a pair, limits that values exceed, the range of a
   control.
3. `Expression`: a function of controls as text, such as `2 * s + 0.1`. It is parsed to a tree of arithmetic,
   never executed, and evaluated with its exact derivatives.

`faults` validates parts, `file` reads them.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache, cached_property
from itertools import accumulate
from typing import Any, Literal, TypeAlias

import numpy as np

from urmpipe_models.elementwise import ZERO, Element, Vector, cross, minus, plus, times
from urmpipe_models.errors import Finding, OptionError, format_unknown_name, format_value
from urmpipe_models.math3d import Transform
from urmpipe_models.measure_units import DEGREE, NAMES, WRITTEN, quantity_to_si

JointKind = Literal["revolute", "prismatic", "cylindrical", "helical", "global", "user"]
ElementKind = Literal["gg", "eg", "crc", "gc", "gear", "rack", "cam"]

# the unit of each variable of a joint: theta, s, theta and s, theta, the rotation vector q
JOINT_UNITS: dict[JointKind, tuple[str, ...]] = {
    "revolute": ("rad",),
    "prismatic": ("m",),
    "cylindrical": ("rad", "m"),
    "helical": ("rad",),
    "global": ("rad", "rad", "rad"),
    "user": (),
}
POSE_UNITS = ("m", "m", "m", "rad", "rad", "rad")  # a body without a joint: x, y, z, rotation vector

_ROTARY: tuple[JointKind, ...] = ("revolute", "cylindrical", "helical")

# the kinds of the first joint of a pair, whose angle counts, and of its second: a rack moves s of it
PAIR_JOINTS: dict[ElementKind, tuple[tuple[JointKind, ...], tuple[JointKind, ...]]] = {
    "gear": (_ROTARY, _ROTARY),
    "rack": (_ROTARY, ("prismatic", "cylindrical")),
    "cam": (_ROTARY, ("prismatic", "revolute")),
}

DEFAULT_GROUND = "ground"
AXES_TOLERANCE = 1e-9  # |m| - 1, |n| - 1, m . n [-]: rounding, not a forgotten normalisation
LIMIT_TOLERANCE = 1e-6  # [m], [rad]: assemblies that differ by less are the same

MAX_LETTERS = 1000  # of an expression; nobody writes longer formulas
MAX_DEPTH = 50  # of brackets and operators within each other
ALLOWED_ARITHMETIC = (
    "numbers, names of controls, pi, + - * / ** and brackets, sin, cos, tan, atan2, sqrt, exp"
)

MIN_POINTS, MAX_POINTS = 4, 1000  # of a profile: a third of a degree apart; each costs a comparison

_Numbers: TypeAlias = tuple[float, float, float]
Profile: TypeAlias = tuple[tuple[float, float], ...]  # points of a cam
Gradient: TypeAlias = dict[str, Element]  # derivatives by the names on which a value depends
_Dual: TypeAlias = tuple[Element, Gradient]


# --- parts


@dataclass(frozen=True, slots=True)
class Body:
    """A rigid body.

    Attributes:
        name: Its name.
        start: Of a body that no joint connects to the ground: x, y, z in [m] and its rotation vector in
            [rad], from where assembly starts; empty if it is not given.
    """

    name: str
    start: tuple[float, ...] = ()


@dataclass(frozen=True)
class Joint:
    """A joint between two bodies: R = A_1 T(q) A_2^-1 is the second body in the first.

    Attributes:
        name: Its name.
        kind: revolute: T rotates by theta about n; prismatic: it translates by s along n; cylindrical: both;
            helical: it rotates by theta and translates by pitch theta; global: it rotates by the rotation
            vector q; user: T is any function of controls.
        bodies: The first and the second body.
        frames: A_1 and A_2: the columns of their rotations are m, n and m x n, their translations are a.
        start: The variables from where assembly starts, in [rad] and [m] by `JOINT_UNITS`.
        values: The function that drives each variable, in [rad] and [m]; None if it is free; empty: all are.
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
        """The function that drives each of its variables; None if it is free."""
        return self.values or (None,) * len(self.units)


@dataclass(frozen=True)
class ConstraintElement:
    """One constraint between two bodies, or between the variables of two joints: a higher pair.

    Attributes:
        name: Its name.
        kind: gg: the two points are at a distance d; eg: the second point is in a plane of the first body
            with normal n, at h from its origin; crc: two lines, through the points along n, are at a distance
            d; gc: the second point is at a distance d from a line of the first body; gear, rack, cam: the
            variable of the second joint is a function of the first's angle, see `joint_motion.transmission`.
        bodies: The first and the second body; of a pair `pair_bodies` of its joints.
        length: d or h in [m]; of a pair the offset of its second variable in [m] or [rad].
        points: a of each in [m]; unused: of eg that of the first, of a pair both.
        normals: n of each, unit vectors [-]; unused: of gg and of a pair both, of eg and gc the second.
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
        default=(ZERO, ZERO), metadata={"stored": tuple[_Numbers, _Numbers]}
    )
    normals: tuple[Vector, Vector] = field(
        default=((0.0, 1.0, 0.0), (0.0, 1.0, 0.0)), metadata={"stored": tuple[_Numbers, _Numbers]}
    )
    joints: tuple[str, ...] = ()
    teeth: tuple[float, ...] = ()
    radius: float = 0.0
    profile: Profile = ()

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
        start: Its value if none is set, in the units that the expressions mean.
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


PlacedExpression: TypeAlias = tuple[str, "Expression"]  # with its place in a file, such as joints.A.value


@dataclass(frozen=True, repr=False)
class Parts:
    """Bodies, and the joints, elements and controls that constrain them, valid or not.

    Attributes:
        name: The name of the network.
        bodies: The bodies except the ground.
        joints: The joints.
        elements: The constraint elements.
        controls: The controls.
        ground: The name of the body that is fixed.
    """

    name: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...] = ()
    elements: tuple[ConstraintElement, ...] = ()
    controls: tuple[Control, ...] = ()
    ground: str = DEFAULT_GROUND

    def as_parts(self) -> Parts:
        """Return the parts of a network alone: their replacements need not be valid."""
        return Parts(self.name, self.bodies, self.joints, self.elements, self.controls, self.ground)

    @cached_property
    def body_names(self) -> tuple[str, ...]:
        """The names of all bodies, the ground first."""
        return (self.ground, *(body.name for body in self.bodies))

    @cached_property
    def constraints(self) -> tuple[tuple[str, Joint | ConstraintElement], ...]:
        """The joints and elements, each with its place, such as joints.A."""
        joints = ((f"joints.{joint.name}", joint) for joint in self.joints)
        return (*joints, *((f"elements.{element.name}", element) for element in self.elements))

    @cached_property
    def joint_functions(self) -> tuple[PlacedExpression, ...]:
        """The functions of joints."""
        functions: list[PlacedExpression] = []
        for joint in self.joints:
            place = f"joints.{joint.name}"
            functions += [(f"{place}.value", drive) for drive in joint.values if drive is not None]
            functions += [(f"{place}.{'mna'[k // 3]}", entry) for k, entry in enumerate(joint.motion[:9])]
        return tuple(functions)

    @cached_property
    def length_functions(self) -> tuple[PlacedExpression, ...]:
        """The lengths of elements: h of eg, the offset of a pair, d of the others."""
        return tuple(
            (f"elements.{element.name}.{element.length_key}", element.length) for element in self.elements
        )

    @cached_property
    def control_functions(self) -> tuple[PlacedExpression, ...]:
        """The controls that are functions of others."""
        return tuple(
            (f"controls.{control.name}.value", control.value)
            for control in self.controls
            if control.value is not None
        )

    def pair_variables(self, element: ConstraintElement) -> tuple[tuple[Joint, int], ...]:
        """Return the known joints of a pair, each with the index of its variable."""
        joints = {joint.name: joint for joint in self.joints}
        known = [joints[name] for name in element.joints if name in joints]
        return tuple(
            (joint, len(joint.units) - 1 if k == 1 and element.kind == "rack" else 0)
            for k, joint in enumerate(known)
        )

    @cached_property
    def coupled_joints(self) -> frozenset[str]:
        """The names of joints in pairs: a full turn of these is another configuration."""
        return frozenset(name for element in self.elements for name in element.joints)

    @cached_property
    def element_units(self) -> tuple[str, ...]:
        """The unit of each element's length: m, or rad of a pair whose second joint rotates."""
        seconds = (self.pair_variables(element)[1:] for element in self.elements)
        return tuple(second[0][0].units[second[0][1]] if second else "m" for second in seconds)

    def control_unit(self, control: str) -> tuple[str, Decimal] | None:
        """Return the unit of a control, m or rad, and the value in it of a control of 1.

        None if the control alone drives neither a joint nor a length, or both, or in several units.
        """
        drives = [pair for joint in self.joints for pair in zip(joint.units, joint.drives, strict=True)]
        drives += zip(self.element_units, (element.length for element in self.elements), strict=True)
        factors = spellings(control)
        texts = ((unit, drive.text) for unit, drive in drives if drive is not None)
        units = {(unit, factors[text]) for unit, text in texts if text in factors}
        return units.pop() if len(units) == 1 else None

    def sole_control(self, text: str) -> str | None:
        """Return the control that a function consists of, whatever the units of its file; None of others."""
        names = (control.name for control in self.controls)
        return next((name for name in names if text in spellings(name)), None)

    def control_value(self, control: str, value: float | str) -> float:
        """Return the value of a control from a number or a text with a unit.

        Args:
            control: Its name.
            value: A number in the units of the network, or a text such as "40deg".

        Raises:
            OptionError: If a text is no number, or its unit is not that of what the control alone drives.
        """
        if not isinstance(value, str):
            return value
        si, factor = self.control_unit(control) or ("", Decimal(1))
        units = {unit: in_si / factor for unit, in_si in WRITTEN.get(si, {}).items()} | {"": Decimal(1)}
        number = quantity_to_si(value, units)
        if not math.isfinite(number):
            allowed = f"a number, or {NAMES[si].partition(' in ')[0]} with its unit" if si else "a number"
            text = f"{control} = {value}"
            raise OptionError(Finding(parameter="controls", found=text, allowed=allowed))  # plain: ok
        return number


# --- functions of parts


def frame_from_axes(m: Vector, n: Vector, a: Vector) -> Transform:
    """Return A, whose rotation has the columns m, n and m x n [-], and whose translation is a in [m].

    Source: [KinematicSystems]_ section 3.2.2.
    """
    return Transform(Transform((m, n, cross(m, n))).columns, a)


def pair_bodies(first: Joint, second: Joint) -> tuple[str, str]:
    """Return the bodies that a pair of two joints connects in the graph: the second of each, if they differ.

    Else the first of each; if these are the same, too, both bodies of the first joint.
    """
    candidates = [*zip(first.bodies[::-1], second.bodies[::-1], strict=True), first.bodies]
    return next((ends for ends in candidates if ends[0] != ends[1]), first.bodies)


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


def sort_controls(controls: Sequence[Control]) -> list[Control]:
    """Return controls, each after those that it is a function of; those of a cycle are omitted."""
    ordered: list[Control] = []
    known: set[str] = set()
    rest = list(controls)
    while ready := [control for control in rest if control.value is None or control.value.names <= known]:
        ordered += ready
        known |= {control.name for control in ready}
        rest = [control for control in rest if control.name not in known]
    return ordered


def sample_range(control: Control) -> tuple[float, float]:
    """Return the range in which a control is sampled: its limits; if open, at most 1 from its start."""
    if math.isfinite(control.upper - control.lower):
        return control.lower, control.upper
    return max(control.lower, control.start - 1.0), min(control.upper, control.start + 1.0)


def spellings(control: str) -> dict[str, Decimal]:
    """Return the functions that are a control alone, in files in m and rad, mm, deg, each with its factor."""
    return {
        control: Decimal(1),
        f"({control}) * 0.001": Decimal("0.001"),
        f"({control}) * pi / 180": DEGREE,
    }


# --- expressions


@dataclass(frozen=True)
class Expression:
    """A formula of names.

    Attributes:
        text: As it is written; a `ValueError` lists what is allowed if it is not arithmetic.

    """

    text: str

    def __post_init__(self) -> None:
        _ = self._tree

    @cached_property
    def names(self) -> frozenset[str]:
        """The names in it except pi."""
        names = {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name)}
        return frozenset(names - {"pi", *_ARGUMENTS})

    def value(self, values: Mapping[str, Element]) -> Element:
        """Return its value at values of its names, any elements."""
        return self.value_and_gradient(values)[0]

    def value_and_gradient(self, values: Mapping[str, Element]) -> tuple[Element, Gradient]:
        """Return its value and its partial derivatives at values of its names, any elements.

        By the rules of differentiation along its tree, so that they are exact to rounding.
        """
        with np.errstate(all="ignore"):  # the caller checks for values that are not finite
            return _evaluate(self._tree, values)

    @cached_property
    def _tree(self) -> ast.expr:
        return _parse(self.text)


def is_control_name(text: str) -> bool:
    """Return whether an expression can have a text as the name of a control."""
    try:
        return text.isidentifier() and Expression(text).names == {text}
    except ValueError:
        return False


_ARGUMENTS = {"sin": 1, "cos": 1, "tan": 1, "atan2": 2, "sqrt": 1, "exp": 1}  # of each function


@cache
def _parse(text: str) -> ast.expr:
    """Return the tree of an expression, of arithmetic alone; raise a `ValueError` otherwise."""
    if len(text) > MAX_LETTERS:
        raise ValueError(f"found {format_value(text)} of {len(text)} letters, allowed: {MAX_LETTERS} at most")
    depth = max(accumulate((letter == "(") - (letter == ")") for letter in text), default=0)
    if depth > MAX_DEPTH:
        raise ValueError(f"found {format_value(text)}, nested {depth} deep; allowed: {MAX_DEPTH}")
    try:
        if "#" in text:  # the rest would be a comment
            raise SyntaxError("a remark")
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ValueError(
            f"found {format_value(text)}, no arithmetic; allowed: {ALLOWED_ARITHMETIC}"
        ) from error
    _check_arithmetic(tree, text, 0)
    return tree


def _check_arithmetic(node: ast.expr, text: str, depth: int) -> None:
    if depth > MAX_DEPTH:
        raise ValueError(f"found {format_value(text)}, nested {depth} deep; allowed: {MAX_DEPTH}")
    operands: list[ast.expr] = []
    match node:
        case ast.Constant(value=value) if _is_finite(value):
            pass
        case ast.Name(id=name) if name not in _ARGUMENTS:
            pass
        case ast.BinOp(left, ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow(), right):
            operands = [left, right]
        case ast.UnaryOp(ast.UAdd() | ast.USub(), operand):
            operands = [operand]
        case ast.Call(ast.Name(id=name), operands, []):
            if name not in _ARGUMENTS:
                raise ValueError(f"function {format_unknown_name(name, _ARGUMENTS)}")
            if len(operands) != _ARGUMENTS[name]:
                raise ValueError(f"found {len(operands)} arguments of {name}, allowed: {_ARGUMENTS[name]}")
        case _:
            part = ast.get_source_segment(text.strip(), node) or text
            is_xor = isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitXor)
            hint = "; a power is **" if is_xor else ""
            raise ValueError(
                f"found {format_value(part)}, no arithmetic; allowed: {ALLOWED_ARITHMETIC}{hint}"
            )
    for operand in operands:
        _check_arithmetic(operand, text, depth + 1)


def _is_finite(constant: Any) -> bool:
    try:
        is_number = isinstance(constant, (int, float)) and not isinstance(constant, bool)
        return is_number and math.isfinite(float(constant))
    except OverflowError:  # an integer beyond the floats
        return False


def _evaluate(node: ast.expr, values: Mapping[str, Element]) -> _Dual:
    match node:
        case ast.Constant(value=value):
            return float(value), {}  # type: ignore[arg-type]
        case ast.Name(id="pi"):
            return math.pi, {}
        case ast.Name(id=name):
            return values[name], {name: 1.0}
        case ast.UnaryOp(operator, operand):
            value, gradient = _evaluate(operand, values)
            is_plus = isinstance(operator, ast.UAdd)
            return (value, gradient) if is_plus else (minus(0.0, value), _scale(gradient, -1.0))
        case ast.BinOp(left, operator, right):
            return _apply_operator(operator, _evaluate(left, values), _evaluate(right, values))
        case ast.Call(ast.Name(id=name), arguments):
            return _apply_function(name, *(_evaluate(argument, values) for argument in arguments))
    raise TypeError(f"{ast.dump(node)} was let through")


def _apply_operator(operator: ast.operator, a: _Dual, b: _Dual) -> _Dual:
    """Return a + b, a - b, a b, a / b or a^b.

    (a / b)' = a' / b - a b' / b^2. (a^b)' = b a^(b - 1) a' + a^b ln(a) b', the last only if b varies: else a
    may be negative.
    """
    (u, du), (v, dv) = a, b
    match operator:
        case ast.Add():
            return plus(u, v), _add(du, dv)
        case ast.Sub():
            return minus(u, v), _add(du, _scale(dv, -1.0))
        case ast.Mult():
            return times(u, v), _add(_scale(du, v), _scale(dv, u))
        case ast.Div():
            inverse = np.divide(1.0, v)
            value = u * inverse
            return value, _add(_scale(du, inverse), _scale(dv, -value * inverse))
    value = np.power(u, v)
    gradient = _scale(du, times(v, np.power(u, minus(v, 1.0)))) if du else {}
    return value, _add(gradient, _scale(dv, value * np.log(u))) if dv else gradient


def _apply_function(name: str, *arguments: _Dual) -> _Dual:
    """Return a function of one argument u, or atan2(y, x)' = (x y' - y x') / (x^2 + y^2)."""
    u, du = arguments[0]
    match name:
        case "sin":
            return np.sin(u), _scale(du, np.cos(u))
        case "cos":
            return np.cos(u), _scale(du, -np.sin(u))
        case "tan":
            value = np.tan(u)
            return value, _scale(du, 1.0 + value * value)
        case "sqrt":
            value = np.sqrt(u)
            return value, _scale(du, np.divide(0.5, value)) if du else {}
        case "atan2":
            (y, dy), (x, dx) = arguments
            inverse = np.divide(1.0, y * y + x * x)
            return np.arctan2(y, x), _add(_scale(dy, x * inverse), _scale(dx, -y * inverse))
    value = np.exp(u)
    return value, _scale(du, value)


def _scale(gradient: Gradient, factor: Element) -> Gradient:
    return {name: times(factor, slope) for name, slope in gradient.items()}


def _add(first: Gradient, second: Gradient) -> Gradient:
    return {name: plus(first.get(name, 0.0), second.get(name, 0.0)) for name in {**first, **second}}
