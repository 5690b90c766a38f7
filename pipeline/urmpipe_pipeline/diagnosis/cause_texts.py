"""A cause as text: clause, value, interval, short name, and remedy, from the table of kinds at the end."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_pipeline import text
from urmpipe_pipeline.diagnosis.causes import Cause

MODULE = re.compile(r"phi([1-9]\d*)")  # joints of URM arms, one per module
DEGREES = 57.29577951308232
UNITS = {
    "m": ("mm", 1e3), "rad": ("deg", DEGREES), "s": ("ms", 1e3), "s/s": ("ms/s", 1e3),
    "rad/(N m)": ("deg/(N m)", DEGREES), "rad/kg": ("deg/kg", DEGREES),
    "m/N": ("mm/N", 1e3), "m/kg": ("mm/kg", 1e3),
}  # fmt: skip  # displayed unit and its number per SI unit
MAX_DECIMALS = 4  # 0.1 micrometres, 2 microradians, as of lengths and angles elsewhere
ROUNDING = 1e-9  # mm or deg: less is the rounding of the numbers that were subtracted


def format_change(before: float, after: float, unit: str) -> str:
    """Return two rms in m or rad: "rms 416.57 mm -> 0.0001 mm"."""
    return f"rms {format_amount(before, unit)} -> {format_amount(after, unit)}"


def format_amount(value: float, unit: str) -> str:
    """Return a length in [m] or an angle in [rad] with the displayed unit: "416.57 mm"."""
    displayed, factor = UNITS[unit]
    return f"{_format_number(value * factor)} {displayed}"


def _format_number(value: float) -> str:
    """Return five digits, at most four of them decimals; of less than that two."""
    value = value if abs(value) >= ROUNDING else 0.0
    rounded = float(f"{round(value, MAX_DECIMALS):.5g}")
    return f"{rounded if rounded or not value else float(f'{value:.1e}'):.10g}"


def format_cause(cause: Cause) -> str:
    """Return a cause as a clause: what of robot or reading differs by how much, and from which row on."""
    from_row = f" from row {cause.from_sample + 1} on" if cause.from_sample else ""
    return f"{KIND_TEXTS[cause.kind].clause(cause)}{from_row}"


def short_name(cause: Cause) -> str:
    """Return the name of a cause in lists: "offset of q3", "tool shift x", "segment 4 sideways y"."""
    return KIND_TEXTS[cause.kind].short(cause)


def format_value(cause: Cause) -> str:
    """Return the value of a cause as its clause has it: "0.5 deg too high", "+1.2 mm"; empty without one."""
    if not cause.value:
        return ""
    return f"{_format_numbers(cause, cause.value)} {_displayed_unit(cause)[0]}".strip() + _direction(cause)


def format_interval(cause: Cause) -> str:
    """Return the 95 % interval with the sign of the clause: "0.48 to 0.52 deg too high"."""
    if not cause.low:
        return ""
    unit = _displayed_unit(cause)[0]
    if len(cause.low) == 1:
        ends = sorted((cause.low[0], cause.high[0]), key=lambda end: end * _sign(cause))
        low, high = (_format_numbers(cause, (end,)) for end in ends)
        return f"{low} to {high} {unit}".replace("  ", " ").strip() + _direction(cause)
    return "; ".join(
        f"{axis} not determined by this motion ({reach})" if reach
        else f"{axis} {_format_signed(cause, low)} to {_format_signed(cause, high)} {unit}"
        for axis, low, high, reach in zip("xyz", cause.low, cause.high, _undetermined(cause), strict=True)
    )  # fmt: skip


def _undetermined(cause: Cause) -> list[str]:
    """Return per direction of a base or tool the half width "±12 mm" if that hides its value."""
    if len(cause.value) < 3 or not cause.low:
        return [""] * len(cause.value)
    unit, factor = _displayed_unit(cause)
    half_widths = (np.array(cause.high) - np.array(cause.low)) / 2.0
    largest = np.abs(cause.value).max()
    return [f"±{half * factor:.2g} {unit}" if half > largest else "" for half in half_widths.tolist()]


DIRECTIONS = {  # text of a value above and below 0 in a clause; others keep their sign
    "joint_offset": ("too low", "too high"),  # the value is what has to be added
    "time_lag": ("early", "late"),
    "joint_lag": ("early", "late"),
    "clock_drift": ("slow", "fast"),
}
UNSIGNED = ("servo_lag", "backlash", "sag", "outliers")


def _sign(cause: Cause) -> float:
    """Return what turns the value of a cause into the number of its clause."""
    return -1.0 if cause.kind in (*DIRECTIONS, *UNSIGNED) and cause.value[0] < 0.0 else 1.0


def _direction(cause: Cause) -> str:
    words = DIRECTIONS.get(cause.kind)
    return f" {words[cause.value[0] < 0.0]}" if words else ""


def _displayed_unit(cause: Cause) -> tuple[str, float]:
    """Return the displayed unit of a cause, and its number per SI unit: seconds from one second on."""
    if cause.unit == "s" and cause.value and abs(cause.value[0]) >= 1.0:
        return "s", 1.0
    if cause.unit == "turns" and cause.value and abs(cause.value[0]) == 1.0:
        return "turn", 1.0
    return UNITS.get(cause.unit, (cause.unit, 1.0))


def _format_numbers(cause: Cause, numbers: Sequence[float]) -> str:
    """Return numbers in the displayed unit of a cause, without it."""
    if cause.kind == "outliers":
        return " to ".join(_format_number(number * _displayed_unit(cause)[1]) for number in numbers)
    if len(numbers) > 1:
        negligible = 1e-4 * max(map(abs, numbers))  # below the digits of the largest
        shown = [number if abs(number) > negligible else 0.0 for number in numbers]
        return f"({', '.join(_format_signed(cause, number) for number in shown)})"
    number = numbers[0] * _sign(cause)
    plain = cause.kind in (*DIRECTIONS, *UNSIGNED) or not cause.unit
    return _format_signed(cause, number).removeprefix("+") if plain else _format_signed(cause, number)


def _format_signed(cause: Cause, value: float) -> str:
    scaled = value * _displayed_unit(cause)[1]
    number = f"{scaled:.6g}" if cause.unit in ("", "s2") else _format_number(scaled)
    return f"+{number}" if scaled > 0.0 else number.removeprefix("-") if number in ("0", "-0") else number


def joint_names(cause: Cause) -> tuple[str, ...]:
    """Return the joints of a cause as the arm calls them; empty for other causes."""
    return tuple(cause.name.split(" and ")) if cause.joints else ()


def format_joints(names: Sequence[str]) -> str:
    """Return "module 3 (phi3)" of a URM arm, "joints q1 and q2" or "elbow_joint"."""
    modules = [match for match in map(MODULE.fullmatch, names) if match]
    is_urm = len(modules) == len(names)
    listed = text.join_list([f"{match[1]} ({match[0]})" for match in modules] if is_urm else list(names))
    if not is_urm and all("joint" in name.lower() for name in names):
        return listed  # a name says it already
    return f"{'module' if is_urm else 'joint'}{'s' if len(names) > 1 else ''} {listed}"


def format_rows(samples: Sequence[int]) -> str:
    """Return rows of a log, given from 0, as they are counted from 1: "rows 2, 3 and 120 to 190"."""
    rows = np.unique(samples) + 1
    ranges = np.split(rows, np.flatnonzero(np.diff(rows) != 1) + 1)
    parts = [
        word
        for run in ranges
        for word in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(row) for row in run])
    ]
    more = len(parts) - text.MAX_NAMED_ROWS
    parts = [*parts[: text.MAX_NAMED_ROWS], f"{format_count(more, 'more range')}"] if more > 0 else parts
    return f"row{'s' if len(rows) > 1 else ''} {text.join_list(parts)}"


class Remedy(NamedTuple):
    """What removes a cause: the parts of a sentence.

    Attributes:
        verb: In the imperative.
        subject: What it is done to.
        change: How, or empty.
        place: Where it can be done, or empty.
    """

    verb: str
    subject: str
    change: str = ""
    place: str = ""

    def imperative(self) -> str:
        """Return "correct joint q1 by +0.11 deg (offset in a map of the log)"."""
        return " ".join(filter(None, (self.verb, self.subject, self.change, self.place)))

    def conditional(self) -> str:
        """Return "joint q1 were corrected by +0.11 deg"."""
        regular = f"{self.verb}{'d' if self.verb.endswith('e') else 'ed'}"
        return " ".join(filter(None, (self.subject, "were", IRREGULAR.get(self.verb, regular), self.change)))


IRREGULAR = {
    "leave out": "left out",
    "make": "made",
    "read": "read",
    "take": "taken",
    "multiply": "multiplied",
}


def build_remedy(cause: Cause) -> Remedy:
    """Return what removes a cause."""
    remedy = KIND_TEXTS[cause.kind].remedy(cause)
    from_row = f"from row {cause.from_sample + 1} on" if cause.from_sample else ""
    return remedy._replace(change=" ".join(filter(None, (remedy.change, from_row))))


class KindText(NamedTuple):
    """The texts about causes of one kind.

    Attributes:
        label: What the kind is called.
        short: Returns the name of a cause in lists.
        clause: Returns a cause as a clause.
        remedy: Returns what removes it.
    """

    label: str
    short: Callable[[Cause], str]
    clause: Callable[[Cause], str]
    remedy: Callable[[Cause], Remedy]


def _joints(cause: Cause) -> str:
    return format_joints(joint_names(cause))


def _joint_kind(label: str, short: str, clause: str, verb: str, change: str, place: str = "") -> KindText:
    """Return the texts of a kind about joints; {} stands for the value, in short for the name."""
    return KindText(
        label,
        lambda cause: short.format(cause.name),
        lambda cause: f"{_joints(cause)} {clause.format(format_value(cause))}",
        lambda cause: Remedy(verb, _joints(cause), change.format(format_value(cause)), place),
    )


def _offset_remedy(cause: Cause) -> Remedy:
    added = f"{_format_signed(cause, cause.value[0])} {_displayed_unit(cause)[0]}"
    place = "(as its offset in a map of the log, or as its zero in the robot file)"
    return Remedy("correct", _joints(cause), f"by {added}", place)


def _axis_name(axis: Sequence[float]) -> str:
    """Return x, -z, or the components of another direction."""
    for sign, prefix in ((1.0, ""), (-1.0, "-")):
        for letter, unit in zip("xyz", np.eye(3), strict=True):
            if np.abs(sign * unit - np.array(axis)).max() < 1e-9:
                return f"{prefix}{letter}"
    return f"({', '.join(f'{component:.3g}' for component in axis)})"


def _format_motion(cause: Cause) -> str:
    """Return how a base or tool differs: "+0.3 mm in y", "a turn of 180 deg about z", "(+1, 0, -2) mm"."""
    is_turn = cause.unit == "rad"
    preposition, prefix = ("about", "a turn of ") if is_turn else ("in", "")
    if cause.axis is not None:
        value = format_value(cause)
        value = value.removeprefix("+") if value == "+180 deg" else value
        return f"{prefix}{value} {preposition} {_axis_name(cause.axis)}"
    open_axes = _undetermined(cause)
    if all(open_axes) or not any(open_axes):
        return f"{prefix}{format_value(cause)}"
    unit = _displayed_unit(cause)[0]
    numbers = [
        f"{_format_signed(cause, value)} {unit} {preposition} {axis}"
        for axis, value, half in zip("xyz", cause.value, open_axes, strict=True)
        if not half
    ]
    notes = [
        f"{axis} is not determined by this motion, {half}"
        for axis, half in zip("xyz", open_axes, strict=True)
        if half
    ]
    return f"{prefix}{text.join_list(numbers)} ({'; '.join(notes)})"


def _frame_kind(label: str, short: str, subject: str, verb: str) -> KindText:
    """Return the texts of a kind about base or tool."""

    def name(cause: Cause) -> str:
        return short if cause.axis is None else f"{short} {_axis_name(cause.axis)}"

    def remedy(cause: Cause) -> Remedy:
        return Remedy(verb, subject, f"by {_format_motion(cause).removeprefix('a turn of ')}")

    return KindText(label, name, lambda cause: f"{subject} needs {_format_motion(cause)}", remedy)


def _parameter_kind(label: str) -> KindText:
    """Return the texts of a kind about a named parameter of the arm."""
    return KindText(
        label,
        lambda cause: cause.name,
        lambda cause: f"{cause.name} needs {format_value(cause)}",
        lambda cause: Remedy("change", cause.name, f"by {format_value(cause)}", "in the robot file"),
    )


def _segment(cause: Cause) -> tuple[str, str, str]:
    """Return the segment of a sideways shift, its value and its axis: segment 4, +3 mm, y."""
    segment, _, axis = cause.name.partition(" sideways ")
    return segment, format_value(cause), axis


def _mirrored_base(cause: Cause) -> str:
    """Return which axes a mirrored base has: "z has the opposite sign", "x and y are exchanged"."""
    axes = cause.name.strip("()").split(", ")
    flipped = [axis for axis, source in zip("xyz", axes, strict=False) if source == f"-{axis}"]
    moved = [axis for axis, source in zip("xyz", axes, strict=False) if source.removeprefix("-") != axis]
    if len(flipped) == 1 and not moved:
        return f"the base is mirrored: {flipped[0]} has the opposite sign"
    if len(moved) == 2 and "-" not in cause.name:
        return f"the base is mirrored: {text.join_list(moved)} are exchanged"
    return f"the base is mirrored: its x, y, z are {cause.name}"


def _units(cause: Cause) -> tuple[str, str]:
    """Return the unit that the values of a joint are in, and the one that they were read in."""
    return ("deg", "rad") if cause.value[0] < 1.0 else ("rad", "deg")


def _coupled(cause: Cause) -> str:
    including, included = joint_names(cause)
    negative = "the negative of " if cause.value[0] > 0.0 else ""
    return f"{format_joints([including])} includes {negative}{format_joints([included])}"


def _coupling_remedy(cause: Cause) -> Remedy:
    including, included = (format_joints([name]) for name in joint_names(cause))
    verb, to = ("add", "to") if cause.value[0] > 0.0 else ("subtract", "from")
    return Remedy(verb, included, f"{to} {including}")


def _time_shift(cause: Cause) -> str:
    way = "earlier" if cause.value[0] < 0.0 else "later"
    return f"{format_value(cause).rpartition(' ')[0]} {way}"


def _clock(cause: Cause) -> str:
    size, _, way = format_value(cause).rpartition(" ")
    return f"the clocks differ by {size} (the log is {way})"


def _half_turn(cause: Cause) -> str:
    value = format_value(cause)
    return f"{_joints(cause)} needs half a turn{f' ({value})' if value else ''}"


def _outliers(cause: Cause) -> str:
    return f"{format_rows(cause.rows)} {'are' if len(cause.rows) > 1 else 'is'} off by {format_value(cause)}"


def _sag(cause: Cause) -> str:
    like = ", like gravity" if cause.unit.endswith("/kg") else ""
    return f"{_joints(cause)} sags by {format_value(cause)}{like}"


def _path_unit(cause: Cause) -> tuple[str, str]:
    """Return the side whose positions are in another unit, and that unit."""
    side, unit = cause.name.split(" in ")
    return f"the positions of the {side}", unit


def _sign_kind() -> KindText:
    place = "(in the log or in the robot: positions do not show which)"
    return KindText(
        "reversed sign of a joint",
        lambda cause: f"sign of {cause.name}",
        lambda cause: f"{_joints(cause)} has a reversed sign",
        lambda cause: Remedy("reverse", f"the sign of {_joints(cause)}", "", place),
    )


KIND_TEXTS: Mapping[str, KindText] = {
    "joint_sign": _sign_kind(),
    "joints_swapped": _joint_kind(
        "exchanged joints", "exchange of {}", "are exchanged", "exchange", "with each other"
    ),
    "half_turn": _joint_kind(
        "half a turn", "half a turn of {}", "needs half a turn", "turn", "by half a turn"
    )._replace(clause=_half_turn),
    "mirrored": _joint_kind(
        "mirrored joint", "mirrored {}", "is mirrored", "count", "the other way"
    ),
    "turns": _joint_kind("whole turns", "turns of {}", "needs {}", "turn", "by {}"),
    "joint_offset": _joint_kind("zero of a joint", "offset of {}", "reads {}", "", "")._replace(
        remedy=_offset_remedy
    ),
    "joint_scale": _joint_kind(
        "scale of a joint", "scale of {}", "needs a factor of {}", "multiply", "by {}"
    ),
    "joint_unit": KindText(
        "unit of a joint",
        lambda cause: f"unit of {cause.name}",
        lambda cause: "{} {} in {}, read as {}".format(
            _joints(cause), "are" if len(joint_names(cause)) > 1 else "is", *_units(cause)
        ),
        lambda cause: Remedy("read", _joints(cause), f"in {_units(cause)[0]}"),
    ),
    "joint_coupled": KindText(
        "coupled joints", lambda cause: f"coupling of {cause.name}", _coupled, _coupling_remedy
    ),
    "joint_lag": _joint_kind("lag of a joint", "lag of {}", "is {}", "", "")._replace(
        remedy=lambda cause: Remedy("make", f"the times of {_joints(cause)}", _time_shift(cause))
    ),
    "compliance": _joint_kind(
        "compliance of a joint", "compliance of {}", "is compliant: {} of its acceleration",
        "correct", "by {} of its acceleration",
    ),
    "backlash": _joint_kind(
        "backlash of a joint", "backlash of {}", "has a backlash of {}", "correct", "for a backlash of {}"
    ),
    "sag": _joint_kind("sag of a joint", "sag of {}", "", "correct", "for a sag of {}")._replace(clause=_sag),
    "link_length": _parameter_kind("length of a link"),
    "tilt": _parameter_kind("tilt of a link"),
    "link_shift": KindText(
        "sideways shift of a segment",
        lambda cause: cause.name,
        lambda cause: "{} needs {} sideways ({})".format(*_segment(cause)),
        lambda cause: Remedy("move", _segment(cause)[0], "by {} sideways ({})".format(*_segment(cause)[1:])),
    ),
    "own_geometry": KindText(
        "the arm's own geometry",
        lambda _: "own geometry",
        lambda _: "the arm's geometry differs from its model",
        lambda _: Remedy("calibrate", "the arm"),
    ),
    "base_shift": _frame_kind("place of the base", "base shift", "the base", "move"),
    "base_rotation": _frame_kind("orientation of the base", "base rotation", "the base", "turn"),
    "base_mirrored": KindText(
        "mirrored base",
        lambda cause: f"mirrored base {cause.name}",
        _mirrored_base,
        lambda cause: Remedy("take", "x, y, z of the base", f"as {cause.name}"),
    ),
    "tool_shift": _frame_kind("tool centre point", "tool shift", "the tool centre point", "move"),
    "tool_rotation": _frame_kind("orientation of the tool", "tool rotation", "the tool", "turn"),
    "path_unit": KindText(
        "unit of the path",
        lambda cause: cause.name,
        lambda cause: "{} are in {}, read as m".format(*_path_unit(cause)),
        lambda cause: Remedy("read", _path_unit(cause)[0], f"in {_path_unit(cause)[1]}"),
    ),
    "time_lag": KindText(
        "offset of the clock",
        lambda _: "clock offset",
        _clock,
        lambda cause: Remedy("make", "the times of the log", _time_shift(cause)),
    ),
    "clock_drift": KindText(
        "drift of the clock",
        lambda _: "clock drift",
        lambda cause: f"the log's clock runs {format_value(cause)}",
        lambda cause: Remedy(
            "correct", "the clock of the log", f"for running {format_value(cause)}"
        ),
    ),
    "servo_lag": KindText(
        "lag of all joints",
        lambda _: "servo lag",
        lambda cause: (
            f"all joints lag by {format_value(cause)} (servo lag)"
            if cause.value[0] > 0.0
            else f"all joints are ahead by {format_value(cause)}"
        ),
        lambda cause: (
            Remedy("compensate", f"the servo lag of {format_value(cause)}")
            if cause.value[0] > 0.0
            else Remedy("delay", "all joints", f"by {format_value(cause)}")
        ),
    ),
    "other_robot": KindText(
        "another robot",
        lambda cause: cause.name,
        lambda cause: f"another arm fits: {cause.name}",
        lambda cause: Remedy("use", cause.name, "as the robot"),
    ),
    "outliers": KindText(
        "outliers",
        lambda _: "outliers",
        _outliers,
        lambda cause: Remedy("leave out", format_rows(cause.rows)),
    ),
}  # fmt: skip
