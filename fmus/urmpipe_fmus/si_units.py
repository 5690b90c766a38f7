"""Units as FMI spells them: what `N.m.s/rad` is in the base units of SI, and how one unit turns into another.

A spelling is a product of powers, `kg.m2`, over one factor or a product in parentheses: `V.s/rad`,
`J/(kg.K)`, `1/s` (the form of Modelica's language specification, chapter 19, which FMI 2.0 refers to).
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from functools import cache

from urmpipe_models.errors import UnitError

SAME_FACTOR = 1e-9
"""Relative: tools write pi/180 with ten digits or more, and no two units that people use are that close."""

BASE_NAMES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True, slots=True)
class BaseUnit:
    """A unit by the base units of SI: value in base units = factor * value in the unit + offset.

    The attributes are those of FMI's element BaseUnit (FMI 2.0.4, section 2.2.2).

    Attributes:
        kg: Exponent of the kilogram; the other exponents likewise.
        factor: From the unit to the base units.
        offset: In base units, added after the factor: 273.15 for degC.
    """

    kg: int = 0
    m: int = 0
    s: int = 0
    A: int = 0
    K: int = 0
    mol: int = 0
    cd: int = 0
    rad: int = 0
    factor: float = 1.0
    offset: float = 0.0

    @property
    def exponents(self) -> tuple[int, ...]:
        """The exponents, in the order of `BASE_NAMES`."""
        return tuple(getattr(self, name) for name in BASE_NAMES)


_SYMBOLS = {
    "1": BaseUnit(),
    "m": BaseUnit(m=1),
    "g": BaseUnit(kg=1),
    "s": BaseUnit(s=1),
    "A": BaseUnit(A=1),
    "K": BaseUnit(K=1),
    "mol": BaseUnit(mol=1),
    "cd": BaseUnit(cd=1),
    "rad": BaseUnit(rad=1),
    "Hz": BaseUnit(s=-1),
    "N": BaseUnit(kg=1, m=1, s=-2),
    "Pa": BaseUnit(kg=1, m=-1, s=-2),
    "J": BaseUnit(kg=1, m=2, s=-2),
    "W": BaseUnit(kg=1, m=2, s=-3),
    "C": BaseUnit(s=1, A=1),
    "V": BaseUnit(kg=1, m=2, s=-3, A=-1),
    "F": BaseUnit(kg=-1, m=-2, s=4, A=2),
    "Ohm": BaseUnit(kg=1, m=2, s=-3, A=-2),
    "S": BaseUnit(kg=-1, m=-2, s=3, A=2),
    "Wb": BaseUnit(kg=1, m=2, s=-2, A=-1),
    "T": BaseUnit(kg=1, s=-2, A=-1),
    "H": BaseUnit(kg=1, m=2, s=-2, A=-2),
    "bar": BaseUnit(kg=1, m=-1, s=-2, factor=1e5),
}
"""Those that take a prefix (all but 1)."""

_PLAIN = {
    "kg": BaseUnit(kg=1),
    "deg": BaseUnit(rad=1, factor=math.pi / 180.0),
    "rev": BaseUnit(rad=1, factor=2.0 * math.pi),
    "min": BaseUnit(s=1, factor=60.0),
    "h": BaseUnit(s=1, factor=3600.0),
    "d": BaseUnit(s=1, factor=86400.0),
}
"""Those that take none."""

_ALONE = {"": BaseUnit(), "degC": BaseUnit(K=1, offset=273.15)}
"""Those that stand in no product: a temperature with an offset has no multiple."""

_COHERENT = {"g": "kg", "bar": "Pa", "deg": "rad", "rev": "rad", "min": "s", "h": "s", "d": "s"}
"""What stands in SI itself for a symbol with a factor."""

GRAM = -3
"""The gram is the base unit times this power of ten."""

_PREFIXES = {"": 0, "G": 9, "M": 6, "k": 3, "h": 2, "d": -1, "c": -2, "m": -3, "u": -6, "n": -9, "p": -12}
_ELSEWHERE = str.maketrans(
    {
        "*": ".",
        "·": ".",
        " ": ".",
        "^": "",
        "²": "2",
        "³": "3",
        "°": "deg",
        "Ω": "Ohm",
        "µ": "u",
        "\u03bc": "u",
    }
)
"""How others write what FMI writes in ASCII."""

_POWER = re.compile(r"(1|[A-Za-z]+)([+-]?[1-9])?")
_PARTS = re.compile(r"([^/()]+)(?:/(?:([^/.()]+)|\(([^/()]+)\)))?")


@cache
def parse_unit(spelling: str) -> BaseUnit:
    """Return what a unit is in the base units of SI; an empty spelling is a number without a unit.

    Raises:
        UnitError: If the spelling is none of a unit.
    """
    if spelling in _ALONE:
        return _ALONE[spelling]
    parts = _PARTS.fullmatch(spelling)
    if parts is None:
        raise _unknown(spelling)
    above, one_below, more_below = parts.groups()
    below = one_below or more_below
    powers = _powers(above, spelling)
    powers += [(symbol, -power) for symbol, power in _powers(below, spelling)] if below else []
    return _product(powers, spelling)


def is_same_unit(one: str | BaseUnit, other: str | BaseUnit) -> bool:
    """Return whether values in one unit are values in the other: exponents, factor and offset are equal."""
    a, b = _base(one), _base(other)
    return (
        a.exponents == b.exponents
        and math.isclose(a.factor, b.factor, rel_tol=SAME_FACTOR)
        and math.isclose(a.offset, b.offset, rel_tol=SAME_FACTOR)
    )


def display_conversion(unit: str, display_unit: str) -> tuple[float, float]:
    """Return factor and offset of a unit to display: shown value = factor * value + offset.

    Raises:
        UnitError: If a spelling is unknown, or the two are units of different quantities.
    """
    held, shown = parse_unit(unit), parse_unit(display_unit)
    if held.exponents != shown.exponents:
        raise UnitError(
            f"display unit {display_unit!r}: found for values in {unit!r}, allowed: one of the same quantity"
        )
    return held.factor / shown.factor, (held.offset - shown.offset) / shown.factor


def coherent_unit(spelling: str) -> str:
    """Return the unit of SI itself, without a factor or an offset, of the same quantity: of deg/s rad/s.

    Raises:
        UnitError: If the spelling is none of a unit.
    """
    parse_unit(spelling)
    return (
        "K" if spelling == "degC" else re.sub(r"[A-Za-z]+", lambda word: _without_factor(word[0]), spelling)
    )


def _without_factor(symbol: str) -> str:
    """Return a symbol without its prefix; of one that is no unit of SI itself, what stands for it there."""
    plain = symbol if symbol in (*_SYMBOLS, *_PLAIN) else symbol[1:]
    return _COHERENT.get(plain, plain)


def _base(unit: str | BaseUnit) -> BaseUnit:
    return parse_unit(unit) if isinstance(unit, str) else unit


def _powers(product: str, spelling: str) -> list[tuple[str, int]]:
    """Return the symbols of a product, `kg.m2`, with their exponents."""
    matches = [_POWER.fullmatch(one) for one in product.split(".")]
    if None in matches:
        raise _unknown(spelling)
    return [(match[1], int(match[2] or 1)) for match in matches if match]


def _product(powers: list[tuple[str, int]], spelling: str) -> BaseUnit:
    """Return the product of powers of symbols; tens are counted, so that mm2 is 1e-6 and mm/ms is m/s."""
    exponents, factor, tens = [0] * 8, 1.0, 0
    for symbol, power in powers:
        ten, one = _symbol(symbol, spelling)
        exponents = [so_far + power * each for so_far, each in zip(exponents, one.exponents, strict=True)]
        factor *= one.factor**power
        tens += power * ten
    scale = factor * float(f"1e{tens}")
    return BaseUnit(**dict(zip(BASE_NAMES, exponents, strict=True)), factor=scale)


def _symbol(symbol: str, spelling: str) -> tuple[int, BaseUnit]:
    """Return a symbol's power of ten and its unit without it."""
    if symbol in _PLAIN:
        return 0, _PLAIN[symbol]
    prefix, rest = ("", symbol) if symbol in _SYMBOLS else (symbol[:1], symbol[1:])
    if prefix not in _PREFIXES or rest not in _SYMBOLS or (prefix and rest == "1"):
        raise _unknown(spelling)
    return _PREFIXES[prefix] + (GRAM if rest == "g" else 0), _SYMBOLS[rest]


def _unknown(spelling: str) -> UnitError:
    if meant := _meant(spelling):
        how = "FMI's spelling, a dot between factors and powers as digits, such as N.m, kg.m2, rad/s2"
        return UnitError(f"unit {spelling!r}: found (did you mean {meant}?), allowed: {how}")
    symbols = ", ".join(one for one in (*_SYMBOLS, *_PLAIN) if one != "1")
    return UnitError(
        f"unit {spelling!r}: found, allowed: powers of {symbols} (the SI ones also with a prefix such as k or"
        " m) as a product over one factor or a product in parentheses, such as N.m, kg.m2, rad/s2,"
        " N.m.s/rad, J/(kg.K), 1/s; degC alone; empty for a number without a unit"
    )


def _meant(spelling: str) -> str:
    """Return how FMI spells a unit that people write as Nm, kg*m^2 or N·m; empty if that is no unit."""
    if "degC" in (celsius := spelling.strip().replace("°", "deg")):
        # a temperature that has no multiple, and no degree times a coulomb
        return "degC" if celsius == "degC" != spelling else ""
    text = re.sub(r" */ *", "/", spelling.replace("**", "").replace("rpm", "rev/min").strip())
    text = text.translate(_ELSEWHERE)
    text = re.sub(r"[A-Za-z]+", lambda word: ".".join(_factors(word[0])) or word[0], text)
    try:
        return text if text != spelling and parse_unit(text) else ""
    except UnitError:
        return ""


def _factors(word: str, prefixes: Collection[str] = _PREFIXES) -> list[str]:
    """Return the symbols that letters are written of, as few as can be; none if there is no such way.

    Only the first may have a prefix: Nms is N.m.s, not N.ms; and mpa is MPa, not m.Pa.
    """
    known = {*_PLAIN, *_SYMBOLS}
    if word in known or (word[:1] in prefixes and word[1:] in _SYMBOLS):
        return [word]
    if word[:1] in prefixes and word[1:] in _PLAIN:
        return []  # mdeg is no metre times a degree
    if named := [one for one in known if len(one) > 1 and one.lower() == word.lower()]:
        return named[:1]
    if in_capitals := _capitals(word, prefixes):
        return [in_capitals]
    for k in range(len(word) - 1, 0, -1):
        first = _factors(word[:k], prefixes)
        if len(first) == 1 and (rest := _factors(word[k:], ())):
            return [*first, *rest]
    return []


def _capitals(word: str, prefixes: Collection[str]) -> str:
    """Return the symbol with a prefix that was written without its capitals, as mpa, khz; empty for none."""
    for prefix in (word[:1].upper(), word[:1]):
        for symbol in _SYMBOLS if prefix in prefixes else ():
            if len(symbol) > 1 and symbol != word[1:] and symbol.lower() == word[1:].lower():
                return prefix + symbol
    return ""
