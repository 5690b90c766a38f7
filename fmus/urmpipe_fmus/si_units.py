"""Units as FMI spells them: what `N.m.s/rad` is in the base units of SI, and conversions between units.

A spelling is a product of powers, `kg.m2`, over one factor or a product in parentheses: `V.s/rad`,
`J/(kg.K)`, `1/s` (the form of Modelica's language specification, chapter 19, which FMI 2.0 refers to).

`parse_unit` reads a spelling as a `BaseUnit`; `is_same_unit` compares two, `display_conversion` converts
values, and `coherent_unit` finds the unit without a factor. Other spellings (Nm, kg*m^2, rpm) are errors that
suggest FMI's.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from functools import cache

from urmpipe_models.errors import UnitError

FACTOR_TOLERANCE = 1e-9  # relative; tools write pi/180 with ten digits or more, units differ by more

BASE_NAMES = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True, slots=True)
class BaseUnit:
    """A unit in the base units of SI: value in base units = factor * value in the unit + offset.

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


# Symbols with a prefix or without; 1 takes none.
_PREFIXABLE = {
    "1": BaseUnit(),
    "m": BaseUnit(m=1),
    "g": BaseUnit(kg=1),  # times 10^_GRAM
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
# Symbols without a prefix.
_PLAIN = {
    "kg": BaseUnit(kg=1),
    "deg": BaseUnit(rad=1, factor=math.pi / 180.0),
    "rev": BaseUnit(rad=1, factor=2.0 * math.pi),
    "min": BaseUnit(s=1, factor=60.0),
    "h": BaseUnit(s=1, factor=3600.0),
    "d": BaseUnit(s=1, factor=86400.0),
}
# Spellings that are no factor of a product: a temperature with an offset has no multiple.
_WHOLE_SPELLINGS = {"": BaseUnit(), "degC": BaseUnit(K=1, offset=273.15)}

_COHERENT = {"g": "kg", "bar": "Pa", "deg": "rad", "rev": "rad", "min": "s", "h": "s", "d": "s"}
_GRAM = -3  # power of ten of the gram in kg

_PREFIXES = {"": 0, "G": 9, "M": 6, "k": 3, "h": 2, "d": -1, "c": -2, "m": -3, "u": -6, "n": -9, "p": -12}
# FMI's ASCII for characters of other spellings.
_TO_ASCII = str.maketrans(
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

_POWER = re.compile(r"(1|[A-Za-z]+)([+-]?[1-9])?")
_FRACTION = re.compile(r"([^/()]+)(?:/(?:([^/.()]+)|\(([^/()]+)\)))?")


@cache
def parse_unit(spelling: str) -> BaseUnit:
    """Return a unit in the base units of SI; an empty spelling is a number without a unit.

    Powers of ten are counted, not multiplied, so that mm2 is exactly 1e-6 m2 and mm/ms is m/s.

    Raises:
        UnitError: If it is no spelling of a unit.
    """
    if spelling in _WHOLE_SPELLINGS:
        return _WHOLE_SPELLINGS[spelling]
    fraction = _FRACTION.fullmatch(spelling)
    if fraction is None:
        raise _unknown_unit(spelling)
    numerator, one_factor, more_factors = fraction.groups()
    denominator = one_factor or more_factors
    exponents, factor, tens = [0] * 8, 1.0, 0
    for product, sign in ((numerator, 1), (denominator, -1)):
        powers = [_POWER.fullmatch(text) for text in product.split(".")] if product else []
        for match in powers:
            if match is None:
                raise _unknown_unit(spelling)
            power = sign * int(match[2] or 1)
            ten, unit = _parse_symbol(match[1], spelling)
            exponents = [total + power * each for total, each in zip(exponents, unit.exponents, strict=True)]
            factor *= unit.factor**power
            tens += power * ten
    scale = factor * float(f"1e{tens}")
    return BaseUnit(**dict(zip(BASE_NAMES, exponents, strict=True)), factor=scale)


def _parse_symbol(symbol: str, spelling: str) -> tuple[int, BaseUnit]:
    """Return the power of ten of a symbol, and its unit without it."""
    if symbol in _PLAIN:
        return 0, _PLAIN[symbol]
    prefix, rest = ("", symbol) if symbol in _PREFIXABLE else (symbol[:1], symbol[1:])
    if prefix not in _PREFIXES or rest not in _PREFIXABLE or (prefix and rest == "1"):
        raise _unknown_unit(spelling)
    return _PREFIXES[prefix] + (_GRAM if rest == "g" else 0), _PREFIXABLE[rest]


def is_same_unit(first: str | BaseUnit, second: str | BaseUnit) -> bool:
    """Return whether values in one unit are values in the other: exponents, factor and offset are equal."""
    a, b = (parse_unit(unit) if isinstance(unit, str) else unit for unit in (first, second))
    return (
        a.exponents == b.exponents
        and math.isclose(a.factor, b.factor, rel_tol=FACTOR_TOLERANCE)
        and math.isclose(a.offset, b.offset, rel_tol=FACTOR_TOLERANCE)
    )


def display_conversion(unit: str, display_unit: str) -> tuple[float, float]:
    """Return factor and offset of a unit to display: displayed value = factor * value + offset.

    Raises:
        UnitError: If a spelling is unknown, or the two are units of different quantities.
    """
    stored, displayed = parse_unit(unit), parse_unit(display_unit)
    if stored.exponents != displayed.exponents:
        raise UnitError(
            f"display unit {display_unit!r}: found for values in {unit!r}, allowed: one of the same quantity"
        )
    return stored.factor / displayed.factor, (stored.offset - displayed.offset) / displayed.factor


def coherent_unit(spelling: str) -> str:
    """Return the SI unit of the same quantity without a factor or an offset: rad/s for deg/s.

    Raises:
        UnitError: If it is no spelling of a unit.
    """
    parse_unit(spelling)
    if spelling == "degC":
        return "K"

    def to_coherent(match: re.Match[str]) -> str:
        symbol = match[0]
        without_prefix = symbol if symbol in (*_PREFIXABLE, *_PLAIN) else symbol[1:]
        return _COHERENT.get(without_prefix, without_prefix)

    return re.sub(r"[A-Za-z]+", to_coherent, spelling)


def _unknown_unit(spelling: str) -> UnitError:
    if suggestion := _suggest_spelling(spelling):
        how = "FMI's spelling, a dot between factors and powers as digits, such as N.m, kg.m2, rad/s2"
        return UnitError(f"unit {spelling!r}: found (did you mean {suggestion}?), allowed: {how}")
    symbols = ", ".join(symbol for symbol in (*_PREFIXABLE, *_PLAIN) if symbol != "1")
    return UnitError(
        f"unit {spelling!r}: found, allowed: powers of {symbols} (the SI ones also with a prefix such as k or"
        " m) as a product over one factor or a product in parentheses, such as N.m, kg.m2, rad/s2,"
        " N.m.s/rad, J/(kg.K), 1/s; degC alone; empty for a number without a unit"
    )


def _suggest_spelling(spelling: str) -> str:
    """Return FMI's spelling of a unit written as Nm, kg*m^2 or N·m; empty if it is no unit."""
    if "degC" in (celsius := spelling.strip().replace("°", "deg")):
        # a temperature, which has no multiple, and no degree times a coulomb
        return "degC" if celsius == "degC" != spelling else ""
    text = re.sub(r" */ *", "/", spelling.replace("**", "").replace("rpm", "rev/min").strip())
    text = text.translate(_TO_ASCII)
    text = re.sub(r"[A-Za-z]+", lambda word: ".".join(_split_symbols(word[0])) or word[0], text)
    try:
        return text if text != spelling and parse_unit(text) else ""
    except UnitError:
        return ""


def _split_symbols(word: str, prefixes: Collection[str] = _PREFIXES) -> list[str]:
    """Return the fewest symbols that letters can be split into; empty if they cannot.

    Only the first may have a prefix: Nms is N.m.s, not N.ms; and mpa is MPa, not m.Pa.
    """
    known = {*_PLAIN, *_PREFIXABLE}
    if word in known or (word[:1] in prefixes and word[1:] in _PREFIXABLE):
        return [word]
    if word[:1] in prefixes and word[1:] in _PLAIN:
        return []  # mdeg is no metre times a degree
    if symbols := [symbol for symbol in known if len(symbol) > 1 and symbol.lower() == word.lower()]:
        return symbols[:1]
    for prefix in (word[:1].upper(), word[:1]):  # mpa, khz: a symbol with a prefix, without its capitals
        for symbol in _PREFIXABLE if prefix in prefixes else ():
            if len(symbol) > 1 and symbol != word[1:] and symbol.lower() == word[1:].lower():
                return [prefix + symbol]
    for k in range(len(word) - 1, 0, -1):
        first = _split_symbols(word[:k], prefixes)
        if len(first) == 1 and (rest := _split_symbols(word[k:], ())):
            return [*first, *rest]
    return []
