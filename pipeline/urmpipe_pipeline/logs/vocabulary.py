"""The words of log files: patterns for column names, units, known sources (from vocabulary.toml)."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any, Literal, NamedTuple, cast

from urmpipe_models.math3d import RotationForm

Quantity = Literal["angle", "length", "time", "date", "ratio", "other"]  # other: torque, force, current, ...
Patterns = tuple[re.Pattern[str], ...]

SURELY_SECONDS = 0.05  # a time between samples of this or less is in s: in ms it would be 20 kHz or more

_BRACKETS = re.compile(r"^(?P<label>.*?\S)\s*[\[(](?P<inside>[^\[\]()]*)[\])]\s*$")
_INSIDE = re.compile(
    r"(?<=[\s_./])(?P<unit>rad(?:ian)?s?|deg(?:ree)?s?|(?:m|mm|cm)(?=[\s_.]per[\s_.]s))"
    r"(?P<rate>[\s_./]?(?:per[\s_.])?s(?:ec(?:ond)?)?(?P<power>\^?2|_2(?=[\s_./]\w))?)?(?=[\s_./]\w|$)",
    re.IGNORECASE,
)
"""A unit among the words of a name, or after them, perhaps one per second."""

_CAPITAL = re.compile(r"(?<=[a-z\d])(?=[A-Z])")
_BEGINS, _ENDS = r"(?<![^\W\d_])", r"(?![^\W\d_])"  # of a word of letters
_TURN = re.compile(r"turn/(?P<counts>[1-9][0-9]{0,8})")  # counts of an encoder
_PER_SECOND = re.compile(r"\s*(?:/|per\s+)\s*(?:s|sec|second|sek)\s*(?:\^|\*\*)?\s*(?P<power>[2²]?)$")


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of a column.

    Attributes:
        name: How urmpipe spells it: rad, deg/s, mm, turn/4096, ...
        quantity: What it measures.
        factor: To SI: value in SI = factor * value in this unit.
        order: How often time divides it: 0 for deg, 1 for deg/s, 2 for deg/s2.
    """

    name: str
    quantity: Quantity
    factor: float
    order: int = 0

    def per_second(self, order: int) -> Unit:
        """Return the unit of the derivative of this order."""
        suffix = ("", "/s", "/s2")[order]
        return Unit(self.name + suffix, self.quantity, self.factor, order)


@dataclass(frozen=True, slots=True)
class KnownSource:
    """A source that its columns give away.

    Attributes:
        name: Its name.
        columns: Patterns that must each match a column's name; none if nothing gives it away.
        units: Unit of a quantity where a column's name does not say its own.
        own: Whether urmpipe itself writes it: what it states of its columns is certain.
    """

    name: str
    columns: Patterns
    units: Mapping[str, Unit]
    own: bool = False

    def wrote(self, names: Sequence[str]) -> bool:
        """Return whether a file with these column names comes from this source."""
        return bool(self.columns) and all(any(p.search(n) for n in names) for p in self.columns)


class Container(NamedTuple):
    """A kind of file that is no text, and how it becomes a CSV file."""

    what: str
    suffixes: tuple[str, ...]
    magic: tuple[bytes, ...]
    advice: str
    parameters: Mapping[str, str]


class RotationWords(NamedTuple):
    """Names of the columns of an orientation, and the forms that such names are used for."""

    patterns: Patterns
    forms: tuple[RotationForm, ...]


class Vocabulary:
    """All words, as vocabulary.toml has them."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        time, joint, tcp = data["time"], data["joint"], data["tcp"]
        self.time = _compiled(time["patterns"])
        self.dates = _compiled(time["dates"])
        self.period = _compiled(time["period"])
        self.long_times = frozenset[str](time["long"])
        self.months = {word: k for k, words in enumerate(time["months"], start=1) for word in words}
        self.time_seconds = re.compile(time["seconds"])
        self.time_rests = {rest["unit"]: re.compile(rest["pattern"]) for rest in time["rests"]}
        self.durations = _compiled(time["durations"])
        self.index = _compiled(data["index"]["patterns"])
        self.episode = tuple[str, ...](data["episode"]["names"])
        roles = ("position", "rate", "acceleration")
        self.joint = {role: _compiled(joint[role]) for role in roles}
        self.joint_terms = {role: frozenset[str](joint[f"{role}_words"]) for role in roles}
        self.joint_of_row = _compiled(joint["of_row"])
        self.marks = frozenset[str](joint["marks"])
        self.orders = tuple(tuple[str, ...](order) for order in joint["orders"])
        self.per_cent = _compiled(joint["per_cent"])
        self.part_motions = frozenset[str](joint["part_motions"])
        self.parts = _compiled(joint["parts"])
        self.other = frozenset[str]((*joint["other"], *joint["grippers"]))
        self.grippers = frozenset[str](joint["grippers"])
        self.tool = frozenset[str](joint["tool"])
        self.measured_markers = frozenset[str](joint["measured"])
        self.commanded = frozenset[str](joint["commanded"])
        self.goals = frozenset[str](joint["goals"])
        self.arms = re.compile(joint["arms"])
        self.stems = frozenset[str](joint["stems"])
        self.present = re.compile(joint["present"])
        words = sorted(self.measured_markers | self.commanded, key=len, reverse=True)
        marks, longer = "|".join(words), "|".join(word for word in words if len(word) > 1)  # dq is a rate
        stems = "|".join(joint["stems"])
        self.marked = re.compile(rf"{_BEGINS}({marks}){_ENDS}")
        glued = rf"{_BEGINS}(({stems})(?=({longer}){_ENDS})|({longer})(?=({stems}){_ENDS}))"
        self.glued = re.compile(glued)
        self.tcp_position = _compiled(tcp["position"])
        self.measured = _compiled(tcp["measured"])
        self.outside = frozenset[str](tcp["outside"])
        self.tcp_counted = _compiled(tcp["counted"])
        self.tcp_pose_vector = _compiled(tcp["pose_vector"])
        self.tcp_matrix = _compiled(tcp["matrix"])
        self.tcp_rotations = tuple(
            RotationWords(_compiled(words["patterns"]), tuple(words["forms"])) for words in tcp["rotation"]
        )
        self.path = {name: _compiled(patterns) for name, patterns in data["path"].items()}
        self.units = {
            word: Unit(name, cast("Quantity", quantity), entry["factor"])
            for quantity, of_quantity in data["units"].items()
            for name, entry in of_quantity.items()
            for word in entry["words"]
        }
        self.missing = frozenset[str](data["missing"]["words"])
        self.sources = tuple(
            KnownSource(
                source["name"],
                _compiled(source["columns"]),
                {quantity: self.units[unit] for quantity, unit in source["units"].items()},
                source.get("own", False),
            )
            for source in data["source"]
        )
        self.containers = tuple(
            Container(
                kind["what"],
                tuple(kind["suffixes"]),
                tuple(magic.encode("latin-1") for magic in kind["magic"]),
                kind["advice"],
                kind.get("parameters", {}),
            )
            for kind in data["container"]
        )

    def unit(self, text: str) -> Unit | None:
        """Return the unit that a text means, such as deg, "°", turn/4096, rad/s^2; None if there is none."""
        words = text.strip().lower()
        rate = _PER_SECOND.search(words)
        word = words[: rate.start()] if rate else words
        counts = _TURN.fullmatch(word)
        base = Unit(word, "angle", math.tau / int(counts["counts"])) if counts else self.units.get(word)
        if base is None or rate is None:
            return base
        return base.per_second(2 if rate["power"] else 1)

    def is_column(self, name: str) -> bool:
        """Return whether the `key` of a name is that of a column: of a time, a joint, the tool, an arm."""
        patterns = (*self.time, *self.durations, *self.index, *self.tcp_position)
        patterns += tuple(pattern for of_role in self.joint.values() for pattern in of_role)
        patterns += tuple(pattern for words in self.tcp_rotations for pattern in words.patterns)
        words = self.other.union(*self.joint_terms.values(), *self.orders)
        words |= self.measured_markers | self.commanded
        return name in words or bool(self.arms.fullmatch(name)) or any(p.search(name) for p in patterns)

    def spelled(self, quantity: Quantity) -> list[str]:
        """Return the names of the units of a quantity."""
        names = dict.fromkeys(unit.name for unit in self.units.values() if unit.quantity == quantity)
        return [*names, "turn/N"] if quantity == "angle" else [*names]

    def source(self, name: str | None) -> KnownSource | None:
        """Return the known source of this name."""
        return next((source for source in self.sources if source.name == name), None)


def _compiled(patterns: Sequence[str]) -> Patterns:
    return tuple(re.compile(pattern) for pattern in patterns)


@lru_cache
def vocabulary() -> Vocabulary:
    """Return the words that are shipped with urmpipe."""
    text = files(__package__).joinpath("vocabulary.toml").read_text(encoding="utf-8")
    return Vocabulary(tomllib.loads(text))


def split_unit(name: str) -> tuple[str, str | None]:
    """Return a column's name without its unit, and the unit's text: "q1 [deg]" is q1 and deg.

    An index such as in state.q[0] and joint(1) stays part of the name. A unit as the last word
    (c_arm_wigwag_deg) or inside of it (joint_rad_1, qd_deg_s_1) is returned, and stays in the name.
    """
    match = _BRACKETS.match(name)
    if match and match["inside"].strip() == "t":  # q_1(t), a function
        return match["label"].strip(), None
    if match and not match["inside"].strip().isdigit():
        return match["label"].strip(), match["inside"].strip()
    inside = _INSIDE.search(name.strip())
    if inside:
        return name.strip(), f"{inside['unit'].lower()}/s{'2' * bool(inside['power'])}" if inside[
            "rate"
        ] else inside["unit"]
    word = re.split(r"[\s_./]+", name.strip())[-1]
    unit = vocabulary().units.get(word.lower()) if word != name.strip() else None
    is_unit = unit is not None and (unit.quantity != "other" or len(word) > 1)  # J1_A, J1_v
    return name.strip(), word if is_unit else None


@lru_cache(maxsize=1 << 14)
def key(label: str) -> str:
    """Return a column's name for comparison: lower case, every run of other signs an underscore."""
    return re.sub(r"[\W_]+", "_", label.lower()).strip("_")


class MarkedName(NamedTuple):
    """A column's name for comparison, and what it says of its values: measured or commanded.

    Attributes:
        key: The name with every word for measured or commanded as a separate word.
        bare: The same without these words, which columns of one quantity share.
        measured: The words for measured.
        commanded: Those for commanded.
    """

    key: str
    bare: str
    measured: frozenset[str]
    commanded: frozenset[str]


@lru_cache(maxsize=1 << 14)
def mark_name(label: str) -> MarkedName:
    """Return a column's name, without its unit, with the words for measured and commanded found in it.

    A change of case parts words only where one of these comes out: q1Measured is q1_measured, jointPos is
    jointpos.
    """
    words = vocabulary()
    plain, parted = (
        words.glued.sub(r"\1_", key(words.present.sub("present_", key(text))))
        for text in (label, _CAPITAL.sub("_", label))
    )
    text = max(plain, parted, key=lambda name: len(words.marked.findall(name)))  # the first of equals
    marks = frozenset(match.group() for match in words.marked.finditer(text))
    bare = key(words.marked.sub("_", text))
    return MarkedName(text, bare, marks & words.measured_markers, marks & words.commanded)
