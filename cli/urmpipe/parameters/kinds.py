"""Kinds of values: texts, files, numbers with units, lists, and values by name.

1. Readers: each takes a text, a value of TOML or a value of Python, and returns one value for all three. A
   text has units (5ms, 0,0,150mm) and is split at commas where a list is meant; a number is in SI.
2. How a log is read: the reader only splits texts; `LogMap` checks the value, so that a map, an option
   and a keyword have one rule.
3. Limits of deviations: with the unit that a text states, or in SI.
4. Names, files and objects of Python that stand for one.
5. The kinds.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from numbers import Integral, Real
from pathlib import Path
from typing import Any, NamedTuple

from urmpipe.parameters.completion import (
    Complete,
    columns,
    comma_separated,
    files,
    folders,
    list_names,
    networks,
    robots,
    tolerances,
    units,
    words,
)
from urmpipe.parameters.param import Kind
from urmpipe_models.errors import Finding, OptionError, format_unknown_name, format_value
from urmpipe_models.measure_units import NAMES, WRITTEN, quantity_to_si, read_quantity

FORMS = ("vector", "rpy", "zyx", "xyz", "zyz", "zxz", "quat_xyzw", "quat_wxyz", "matrix")
SOURCES = (
    "coppeliasim", "urmpipe", "network", "ur-rtde", "libfranka", "ros", "ros2", "fri", "kuka-rsi", "abb",
    "plotjuggler", "solidworks", "matlab", "path", "table",
)  # fmt: skip
DELIMITERS = ("comma", "semicolon", "tab", "spaces", "bar")
SYNC_WORDS = ("stamps", "start", "auto")
PLATFORMS = ("linux64", "win64")
A_PATH, A_NAME = "a path: text or a Path, not empty", "the name of a file"  # in Python; in a shell


# 1. Readers


def _read_text(value: Any) -> str:
    if isinstance(value, str) and value:
        return value
    raise TypeError


def _read_path(value: Any) -> Path:
    """Read the name of a file; an empty text would be the working folder, which is never meant."""
    return value if isinstance(value, Path) else Path(_read_text(value))


def _read_flag(value: Any) -> bool:
    if type(value).__name__ in ("bool", "bool_"):  # of Python or NumPy
        return bool(value)
    raise TypeError


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _read_number(value: Any, si: str, *, positive: bool = False, deviation: bool = False) -> float:
    if isinstance(value, str):
        return read_quantity(value, si, positive=positive, deviation=deviation)
    if not _is_number(value) or not math.isfinite(value) or (positive and value <= 0.0):
        raise TypeError
    return float(value)


def _read_count(value: Any, minimum: int = 0) -> int:
    if isinstance(value, str) and re.fullmatch("[0-9]+", value):
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, Integral) or value < minimum:
        raise TypeError
    return int(value)


def _read_word(value: Any, names: tuple[str, ...]) -> str:
    if isinstance(value, str) and value not in names:
        raise OptionError(format_unknown_name(value, names))
    if not isinstance(value, str):
        raise TypeError
    return value


def _read_choices(value: Any, names: tuple[str, ...]) -> tuple[str, ...]:
    listed = (value,) if isinstance(value, str) else value
    words = [word for text in _read_texts(listed) for word in _read_list(text)]
    if unknown := [word for word in words if word not in names]:
        raise OptionError(Finding(found=", ".join(unknown), allowed=", ".join(names)))
    return tuple(dict.fromkeys(words))


def _read_list(value: Any, *, split: bool = True) -> tuple[Any, ...]:
    """Read a list; of a text its parts between commas, or the text alone."""
    if isinstance(value, str) and value:
        return tuple(part.strip() for part in value.split(",")) if split else (value,)
    if isinstance(value, (str, Mapping)) or hasattr(value, "columns") or not isinstance(value, Iterable):
        raise TypeError
    return tuple(value)


def _read_texts(value: Any, *, split: bool = False, empty: bool = True) -> tuple[str, ...]:
    texts = _read_list(value, split=split)
    if not all(isinstance(text, str) and text for text in texts) or not (texts or empty):
        raise TypeError
    return texts


def _read_numbers(value: Any, si: str, length: int = 0) -> tuple[float, ...]:
    from urmpipe_models.errors import map_collecting_errors

    numbers = tuple(map_collecting_errors(partial(_read_number, si=si), _read_list(value)))
    if not numbers or (length and len(numbers) != length):
        raise TypeError
    return numbers


def _read_joint_values(value: Any) -> Any:
    """Read joint values; texts stay texts, as their joints decide whether they are angles or lengths."""
    if not isinstance(value, str):
        if hasattr(value, "__array__"):
            return value
        values = _read_list(value)
        if not all(isinstance(item, str) or _is_number(item) for item in values):
            raise TypeError
        return values
    parts = tuple(value.split(","))
    if any(all(math.isnan(quantity_to_si(part, WRITTEN[si])) for si in ("rad", "m")) for part in parts):
        raise ValueError
    return parts


def _read_frame(value: Any) -> Any:
    """Read X,Y,Z[,RX,RY,RZ] with units, or in [m] and [rad]; a matrix of shape (4, 4); or a Transform."""
    if isinstance(value, (list, tuple)) and value and all(isinstance(part, str) for part in value):
        value = ",".join(value)
    if not isinstance(value, str):
        from urmpipe.arm_placing import parse_frame

        return parse_frame("", value)
    from urmpipe_models.math3d import from_offset

    parts = value.split(",")
    offset = [quantity_to_si(part, WRITTEN["m"]) for part in parts[:3]]
    offset += [quantity_to_si(part, WRITTEN["rad"]) for part in parts[3:]]
    if len(offset) not in (3, 6) or not all(map(math.isfinite, offset)):
        raise ValueError
    return from_offset(offset)


def _read_named(value: Any, form: str, *, flags: bool = False) -> dict[str, Any]:
    """Read values by name: a mapping, or texts of a form such as NAME=VALUE."""
    if isinstance(value, Mapping):
        has_names = all(isinstance(name, str) and name for name in value)
        if not has_names or (not flags and any(map(_is_flag, value.values()))):
            raise TypeError
        return dict(value)
    result: dict[str, str] = {}
    for text in _read_texts(value):
        name, sign, content = text.partition("=")
        if not sign or not name.strip() or name.strip() in result:
            raise OptionError(Finding(found=format_value(text), allowed=f"{form}, each name once"))
        result[name.strip()] = content
    return result


def _read_function(value: Any) -> Any:
    if callable(value):
        return value
    raise TypeError


def _read_object(value: Any) -> Any:
    if value is None:
        raise TypeError
    return value


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool) or value is None


# 2. How a log is read


def _reader(name: str, split: Callable[[Any], Any] = lambda value: value) -> Callable[[Any], Any]:
    """Return the reader of a field of `LogMap`, which checks the value after texts are split."""

    def read(value: Any) -> Any:
        from urmpipe_pipeline.logs.log_map import read_options

        if value is None:
            raise TypeError
        return getattr(read_options({name: split(value)}), name)

    return read


def _split_columns(value: Any) -> Any:
    return _read_list(value) if isinstance(value, str) and value else value


def _split_numbers(value: Any) -> Any:
    if not isinstance(value, (str, list, tuple)) or not value:
        return value
    return [float(part) if isinstance(part, str) else part for part in _read_list(value)]


def _split_units(value: Any) -> Any:
    """Split UNIT, COLUMN=UNIT and lists of them by column; "" is all angles."""
    texts = [value] if isinstance(value, str) and value else value
    if not isinstance(texts, (list, tuple)) or not texts or not all(isinstance(text, str) for text in texts):
        return value
    result: dict[str, str] = {}
    for text in chain.from_iterable(map(_split_assignments, texts)):
        column, unit = (part.strip() for part in text.rpartition("=")[::2])
        if result.setdefault(column, unit) != unit:
            both = f"{result[column]} and {unit} {f'for {column}' if column else 'without a column'}"
            raise OptionError(Finding(found=both, allowed="one unit, or that of a column as COLUMN=UNIT"))
    return result


def _split_assignments(text: str) -> list[str]:
    """Split A=1,B=2 at its commas; a text in which a part has no name stays one."""
    parts = text.split(",")
    return parts if all("=" in part for part in parts) else [text]


def _split_intervals(value: Any) -> Any:
    """Split LOW:HIGH, JOINT=LOW:HIGH and lists of them by joint; "" is all joints that turn."""
    from urmpipe_pipeline.logs.log_map import is_interval

    texts = [value] if isinstance(value, str) else value
    if isinstance(value, Mapping):
        return {name: _split_ends(ends) for name, ends in value.items()}
    if not isinstance(texts, (list, tuple)) or not texts or not all(isinstance(text, str) for text in texts):
        return value
    if not any(":" in text for text in texts):  # two ends, as a list of texts
        texts = [":".join(texts)]
    intervals = {}
    for text in chain.from_iterable(map(_split_assignments, texts)):
        joint, _, ends = text.rpartition("=")
        intervals[joint.strip()] = _split_ends(ends)
        if not is_interval(intervals[joint.strip()]):
            allowed = "LOW:HIGH or JOINT=LOW:HIGH, in the file's unit or with units, such as -180deg:180deg"
            raise OptionError(Finding(found=format_value(text), allowed=allowed))
    return intervals


def _split_ends(ends: Any) -> Any:
    parts = ends.split(":") if isinstance(ends, str) else ends
    return tuple(map(_to_end, parts)) if isinstance(parts, (list, tuple)) else parts


def _to_end(end: Any) -> Any:
    try:
        return float(end) if isinstance(end, str) else end
    except ValueError:
        return end


# 3. Limits of deviations


class Limits(NamedTuple):
    """Limits of deviations.

    Attributes:
        by_kind: The limit in [m], [rad] or [-] by kind.
        from_text: Whether a text stated them, in which a large value needs its unit.
    """

    by_kind: Mapping[str, float]
    from_text: bool


def _to_limits_text(value: Any) -> Any:
    """Return KIND=VALUE,... of a list of texts, or of a mapping with texts among its values."""
    if isinstance(value, (list, tuple)) and value and all(isinstance(part, str) for part in value):
        return ",".join(value)
    if isinstance(value, Mapping) and any(isinstance(limit, str) for limit in value.values()):
        return ",".join(f"{kind}={limit}" for kind, limit in value.items())
    return value


def _read_tolerance(value: Any, *, iso: bool = False) -> Limits:
    from urmpipe_pipeline.comparison.verdict import check_tolerance, parse_tolerance

    value = value if isinstance(value, Limits) else _to_limits_text(value)
    if isinstance(value, Limits):
        limits = value
    elif isinstance(value, str) and value:
        limits = Limits(parse_tolerance(value, iso=iso), from_text=True)
    elif isinstance(value, Mapping):
        limits = Limits(dict(value), from_text=False)
    else:
        limits = Limits({"axis": _read_number(value, "m")}, from_text=False)
    check_tolerance(limits.by_kind, iso=iso)
    return limits


def _read_noise(value: Any) -> Mapping[str, float]:
    from urmpipe_pipeline.comparison.baseline import complete_noise

    value = _to_limits_text(value)
    if not isinstance(value, (str, Mapping)) and not _is_number(value):
        raise TypeError
    if value == "":
        raise ValueError
    return complete_noise(value)


def _read_axis_tolerance(value: Any) -> float | None:
    """Read a tolerance on each axis in [m]; of several kinds, as urmpipe.toml has them, that on an axis."""
    if isinstance(value, Mapping):
        return _read_tolerance(value).by_kind.get("axis")
    text = value.removeprefix("axis=") if isinstance(value, str) else value
    if isinstance(text, str) and "=" in text:
        from urmpipe_pipeline.comparison.verdict import parse_tolerance

        limits = parse_tolerance(value)
        if "axis" not in limits:
            raise ValueError
        return limits["axis"]
    return _read_number(text, "m", positive=True, deviation=True)


def _read_sync(value: Any) -> str | float:
    if isinstance(value, str) and value in SYNC_WORDS:
        return value
    try:
        return _read_number(value, "s", positive=False)
    except OptionError:
        raise ValueError from None


def _read_cycles(value: Any) -> tuple[tuple[int, int], ...]:
    from urmpipe_pipeline.iso9283.cycles import parse_cycles

    if isinstance(value, (list, tuple)) and value and all(isinstance(part, str) for part in value):
        value = ",".join(value)
    if isinstance(value, str):
        return parse_cycles(value)
    cycles = tuple((_read_count(first), _read_count(last)) for first, last in _read_list(value))
    if not cycles:
        raise ValueError
    return cycles


def _read_sides(value: Any) -> tuple[str, ...]:
    sides = _read_texts(value, split=True)
    if len(sides) != 2:
        raise ValueError
    return sides


# 4. Names, files and objects of Python


def _is_instance(value: Any, names: Sequence[str]) -> bool:
    """Return whether a value is of a class with one of some names: the classes are slow to import."""
    return any(parent.__name__ in names for parent in type(value).__mro__)


def _read_file_or(value: Any, classes: Sequence[str]) -> Any:
    if _is_instance(value, classes):
        return value
    _read_path(value)
    return value


def _is_run_or_table(value: Any) -> bool:
    if isinstance(value, (str, Path)) or value is None:
        return False
    from urmpipe_pipeline.logs import is_table

    return _is_instance(value, ("Run",)) or is_table(value)


def _read_wrench(value: Any) -> Any:
    return value if _is_instance(value, ("Wrench",)) else _read_text(value)


def _read_instance(value: Any, classes: Sequence[str]) -> Any:
    if _is_instance(value, classes):
        return value
    raise TypeError


# 5. The kinds


def text(metavar: str, allowed: str = "a non-empty text", complete: Complete | None = None) -> Kind:
    """Return the kind of a text that is not empty."""
    return Kind(metavar, allowed, _read_text, complete)


def one_of(*names: str) -> Kind:
    """Return the kind of a word among some."""
    return Kind(f"[{'|'.join(names)}]", ", ".join(names), partial(_read_word, names=names), words(*names))


def file(metavar: str, *suffixes: str) -> Kind:
    """Return the kind of a file; the shell completes those with one of some suffixes."""
    return Kind(metavar, A_PATH, _read_path, files(*suffixes), is_file=True, typed=A_NAME)


def file_or(metavar: str, typed: str, further: str, classes: Sequence[str], complete: Complete) -> Kind:
    """Return the kind of a name or a file, or an object of Python of some classes.

    Args:
        metavar: The value in the help.
        typed: The names and files.
        further: The objects of Python, in the sentence after those.
        classes: Their classes.
        complete: The completion.
    """
    read = partial(_read_file_or, classes=classes)
    return Kind(metavar, f"{typed}{further}", read, complete, is_file=True, typed=typed)


def number(si: str, *, positive: bool = False, deviation: bool = False) -> Kind:
    """Return the kind of a quantity: a text with its unit, or a number in SI.

    Args:
        si: The SI unit.
        positive: Whether it must be above 0.
        deviation: Whether it is the limit of a deviation: a large one needs its unit in a text.
    """
    allowed = f"a positive {NAMES[si].partition(' ')[2]}" if positive else NAMES[si]
    metavar = f"NUMBER[{'|'.join(filter(None, WRITTEN[si]))}]"
    return Kind(metavar, allowed, partial(_read_number, si=si, positive=positive, deviation=deviation))


def numbers(metavar: str, si: str, allowed: str, length: int = 0) -> Kind:
    """Return the kind of a list of quantities, of some length if not 0."""
    return Kind(metavar, allowed, partial(_read_numbers, si=si, length=length))


def named(form: str, allowed: str, complete: Complete | None = None, *, flags: bool = False) -> Kind:
    """Return the kind of values by name, True and False if `flags`: a mapping, or a form for each.

    Args:
        form: What a text is, such as NAME=VALUE.
        allowed: What else Python takes.
        complete: The completion.
        flags: Whether True and False are values.
    """
    read = partial(_read_named, form=form, flags=flags)
    return Kind(form, allowed, read, complete, repeats=True, typed=f"{form}, each name once")


def texts(
    metavar: str, allowed: str, complete: Complete | None = None, *, split: bool = False, empty: bool = True
) -> Kind:
    """Return the kind of several texts; an option may be given for each."""
    return Kind(metavar, allowed, partial(_read_texts, split=split, empty=empty), complete, repeats=not split)


def words_of(metavar: str, *names: str) -> Kind:
    """Return the kind of words among some: a list, or a text of them between commas."""
    read = partial(_read_choices, names=names)
    return Kind(metavar, f"{', '.join(names)} or a list of them", read, comma_separated(*names), repeats=True)


FLAG = Kind("", "true or false", _read_flag)
COUNT = Kind("N", "a whole number, 0 or more", _read_count)
POSITIVE_COUNT = Kind("N", "a whole number, 1 or more", partial(_read_count, minimum=1))
SECONDS = number("s", positive=True)
DEVIATION = number("m", positive=True, deviation=True)

ANY_FILE = file("FILE")
TABLE_FILE = file("FILE.csv", ".csv")
MAP_FILE = file("FILE.toml", ".toml")
DRAWING = file("FILE.svg", ".svg")
RECORDING = file("RUN.rrd", ".rrd")
FOLDER = Kind("DIR", A_PATH, _read_path, folders, is_file=True, typed="the name of a folder")
PATHS = Kind(
    "FILE",
    "a path or a list of paths: text or a Path, not empty",
    lambda value: tuple(map(_read_path, [value] if isinstance(value, (str, Path)) else _read_list(value))),
    files(),
    repeats=True,
    typed=A_NAME,
)

ROBOT = file_or(
    "NAME|FILE",
    "a name, or a TOML or URDF file",
    ", or a Chain, such as urmpipe.load_robot(NAME)",
    ("Chain",),
    files(".toml", ".urdf", names=robots),
)
ROBOT_FILE = ROBOT._replace(allowed=ROBOT.typed, read=partial(_read_file_or, classes=()))
FRAME = Kind(
    "X,Y,Z[,RX,RY,RZ]",
    "X,Y,Z or X,Y,Z,RX,RY,RZ in m and rad, such as 0,0,0.15 or 0,0,150mm,0,0,90deg",
    _read_frame,
)
LINK = text("LINK", "the name of a link of the URDF")
JOINT_VALUES = Kind(
    "Q1,Q2,...", "joint values in rad and m, or with units, such as 0,180deg,500mm", _read_joint_values
)

MAP = file_or("FILE.toml", "a map (TOML)", ", or what `read_map` returned", ("LogMap",), files(".toml"))
DELIMITER = Kind("|".join(DELIMITERS), "a non-empty text", _reader("delimiter"), words(*DELIMITERS))
DECIMAL = one_of("point", "comma", ".", ",")
ROTATION = one_of(*FORMS)
SOURCE = Kind("NAME", "a non-empty text", _reader("source"), words(*SOURCES))
TIME = Kind("COLUMN", "a column by name or number", _reader("time"), columns("none"))
TIME_OF_FILE = TIME._replace(metavar="[FILE:]COLUMN")
COLUMNS = Kind(
    "A,B,C",
    "columns by name or number, such as q1,q2 or 2,3",
    _reader("joints", _split_columns),
    columns(several=True),
)
JOINT_NAMES = Kind("NAME,...", "names, such as q1,q2", _reader("names", _split_columns))
SIGNS = Kind("1|-1,...", "1 or -1 for each joint, such as 1,-1", _reader("signs", _split_numbers))
OFFSETS = Kind(
    "OFFSET,...", "numbers in the units of the columns, such as 0,90", _reader("offsets", _split_numbers)
)
LAYOUT = Kind(
    "table|transposed|long|flat:N|flat-by-joint:N",
    "table, transposed, long, flat:N or flat-by-joint:N, with N numbers a sample",
    _reader("layout"),
    words("table", "transposed", "long", "flat:", "flat-by-joint:"),
)
SHEET = Kind("SHEET", "a sheet by name or number", _reader("sheet"))
TOPIC = Kind("TOPIC", "a non-empty text", _reader("topic"))
SIDE = Kind(
    "WORD",
    "a word in the names of columns, such as actual, or several, such as arm2_solved",
    _reader("side"),
)
EPISODE = Kind("N|[COLUMN=]NAME", "an episode by number or name, or COLUMN=VALUE", _reader("episode"))
ROWS = Kind(
    "FIRST:LAST[,...]",
    "rows from 1, both ends included, such as 2:-1 or 1:99,101:-1; -1 is the last",
    _reader("rows"),
)
UNIT = Kind(
    "[COLUMN=]UNIT",
    "a unit of every angle, such as deg, or units by column, such as q1=deg",
    _reader("unit", _split_units),
    units,
    repeats=True,
)
INTERVAL = Kind(
    "[JOINT=]LOW:HIGH",
    "two ends for all revolute joints, or ends by joint, such as q1=-180:180",
    _reader("interval", _split_intervals),
    columns(sign="="),
    repeats=True,
)

TOLERANCE = Kind(
    "LENGTH|KIND=VALUE,...",
    'a number in m, a text such as "axis=3.5mm,angle=0.5deg", or a mapping of kinds to m or rad, such as'
    ' {"axis": 0.0035, "angle": 0.01}',
    _read_tolerance,
    tolerances(),
    repeats=True,
    typed="a length, such as 3.5mm, or KIND=VALUE,..., such as axis=3.5mm,angle=0.5deg",
)
CRITERIA = Kind(
    "CRITERION=VALUE,...",
    'criteria with their values: a text such as "AP=0.4mm,AV=5%", or a mapping in m, rad, s, m/s or shares',
    partial(_read_tolerance, iso=True),
    tolerances(iso=True),
    repeats=True,
    typed="CRITERION=VALUE,..., such as AP=0.4mm,AV=5%",
)
NOISE = TOLERANCE._replace(read=_read_noise, complete=tolerances(shares=False))
AXIS_TOLERANCE = DEVIATION._replace(read=_read_axis_tolerance)
SYNC = Kind(
    "stamps|start|auto|TIME",
    "stamps, start, auto, or a time in s, such as -0.2 or 200ms",
    _read_sync,
    words(*SYNC_WORDS),
)
SIDES = Kind(
    "REFERENCE,LOG",
    "two words, such as target,actual",
    _read_sides,
    words("target,actual", "desired,actual", "commanded,measured"),
)
BLOCK = texts("NAME", "a block, or one for each simulation", empty=False)
CYCLES = Kind(
    "FIRST:LAST,...",
    'a text such as "1:1477,1478:2955", or pairs of rows, such as [(1, 1477)]',
    _read_cycles,
    typed="FIRST:LAST,..., such as 1:1477,1478:2955",
)
BASELINE = file_or(
    "RUN.rrd",
    "the recording of an earlier comparison",
    ", or what `compare` returned",
    ("Comparison",),
    files(".rrd"),
)

TARGETS = Kind(
    "TARGETS",
    "a file, or an array",
    lambda value: _read_path(value) if isinstance(value, str) else _read_object(value),
    files(),
    is_file=True,
    typed=A_NAME,
)
PLANNED = file_or(
    "PATH.csv|cube:...",
    'a file, or a test cube ("cube:...")',
    ", or PathRows",
    ("PathRows",),
    files(names=lambda: ("cube:wall,", "cube:diagonal,")),
)
NETWORK = file_or(
    "NAME|FILE",
    "a name, or a TOML file",
    ", the tables of one, or a Network",
    ("Network", "dict"),
    files(".toml", names=networks),
)
NETWORK_TABLES = NETWORK._replace(
    allowed="a name, a TOML file, or the tables of one", read=partial(_read_file_or, classes=("dict",))
)
RUN = Kind("RUN", "a Run, such as urmpipe.ingest(LOG)", lambda value: _read_instance(value, ("Run",)))
SYSTEM = file_or(
    "SYSTEM|FILE.toml",
    "the name of a system, or a system file (TOML)",
    "",
    (),
    files(".toml", names=list_names("urmpipe_fmus.cosim:system_names")),
)
UNIT_MODEL = file_or(
    "UNIT|FILE.py",
    "the name of a unit, or a Python file with one",
    ", or a BlockModel",
    ("BlockModel",),
    files(".py", names=list_names("urmpipe_fmus.blocks:block_names")),
)
LOG = Kind(
    "LOG.csv",
    "a log: a file, a table with columns, or a Run",
    lambda value: value if _is_run_or_table(value) else _read_path(value),
    files(),
    is_file=True,
    typed=A_NAME,
)
POINT = Kind(
    "BODY:X,Y,Z",
    'a text such as "coupler:0.45,0.2,0", or a body and three numbers',
    lambda value: value if isinstance(value, (list, tuple)) and len(value) == 2 else _read_text(value),
    typed="BODY:X,Y,Z, such as coupler:0.45,0.2,0",
)
WRENCHES = Kind(
    "BODY:X,Y,Z:FX,FY,FZ[,MX,MY,MZ]",
    'a list of texts such as "coupler:0.45,0,0:0,-50,0"',
    lambda value: tuple(map(_read_wrench, _read_list(value, split=False))),
    repeats=True,
    typed="BODY:X,Y,Z:FX,FY,FZ[,MX,MY,MZ], such as coupler:0.45,0,0:0,-50,0",
)
WIDTH = Kind(
    "WIDTH",
    'column, page, a text such as "85mm", or a number in m',
    lambda value: float(value) if _is_number(value) else _read_text(value),
    words("column", "page"),
    typed="column, page, or a length such as 85mm",
)
PROGRESS = Kind("", "a function of the completed share, 0 to 1, such as print", _read_function)
ON_MESSAGE = PROGRESS._replace(allowed="a function of a text, such as print")
DEFAULTS = texts("", 'a list of texts, such as ["sync=auto from urmpipe.toml"]')
