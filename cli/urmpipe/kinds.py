"""What each keyword of the public functions takes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np


class Kind(NamedTuple):
    """What a keyword takes.

    Attributes:
        fits: Tells whether a value is of the kind.
        allowed: What to say if it is not.
    """

    fits: Callable[[Any], bool]
    allowed: str


def kind_of(function: str, keyword: str) -> Kind | None:
    """Return what a keyword of a function takes; None if only its meaning is checked."""
    return KINDS.get(f"{function}.{keyword}", KINDS.get(keyword))


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and value != ""


def _is_path(value: Any) -> bool:
    """Return whether a value names a file: the empty text is the working folder, which nobody means."""
    return isinstance(value, Path) or _is_text(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_count(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= 0


def _is_limit(value: Any) -> bool:
    return _is_number(value) or isinstance(value, Mapping)


def _are_arguments(value: Any) -> bool:
    return isinstance(value, Mapping) and all(_is_text(name) for name in value) and all(
        isinstance(one, (str, Path)) or _is_number(one) for one in value.values()
    )  # fmt: skip


def _are_sides(value: Any) -> bool:
    return isinstance(value, (tuple, list)) and len(value) == 2 and all(map(_is_text, value))


def _is_robot(value: Any) -> bool:
    from urmpipe_models.arm.chain import Chain

    return isinstance(value, Chain) or _is_path(value)


def _is_map(value: Any) -> bool:
    from urmpipe_pipeline.sources import LogMap

    return isinstance(value, LogMap) or _is_path(value)


def _is_run(value: Any) -> bool:
    from urmpipe_pipeline.runs.run import Run

    return isinstance(value, Run)


def _is_baseline(value: Any) -> bool:
    from urmpipe_pipeline.comparison.comparison import Comparison

    return isinstance(value, Comparison) or _is_path(value)


def _is_unit(value: Any) -> bool:
    from urmpipe_fmus.block import BlockModel

    return isinstance(value, BlockModel) or _is_path(value)


def _is_network(value: Any) -> bool:
    from urmpipe_models.networks.file import Network

    return isinstance(value, (Network, Mapping)) or _is_path(value)


def _is_tables(value: Any) -> bool:
    return isinstance(value, Mapping) or _is_path(value)


def _are_controls(value: Any) -> bool:
    return isinstance(value, Mapping) and all(
        _is_text(name) and (_is_number(one) or _is_text(one)) for name, one in value.items()
    )


def _is_table(value: Any) -> bool:
    from urmpipe.systems.logs import LogTable

    return isinstance(value, LogTable) or _is_path(value)


def _is_log(value: Any) -> bool:
    from urmpipe_pipeline.sources import is_table

    return _is_run(value) or _is_path(value) or is_table(value)


def _is_point(value: Any) -> bool:
    return _is_text(value) or (isinstance(value, (list, tuple)) and len(value) == 2)


def _are_wrenches(value: Any) -> bool:
    from urmpipe_models.networks.forces import Wrench

    return isinstance(value, (list, tuple)) and all(isinstance(one, Wrench) or _is_text(one) for one in value)


def _one_or_many(fits: Callable[[Any], bool]) -> Callable[[Any], bool]:
    """Return a check that accepts one value of a kind or a list of them; tables and mappings are no lists."""

    def fit(value: Any) -> bool:
        return fits(value) or (isinstance(value, (list, tuple, set)) and all(map(fits, value)))

    return fit


def _are_numbers(value: Any) -> bool:
    return isinstance(value, (list, tuple, np.ndarray)) and all(map(_is_number, value))


def _is_planned(value: Any) -> bool:
    from urmpipe_models.planning.path import PathRows

    return isinstance(value, PathRows) or _is_path(value)


def _are_cycles(value: Any) -> bool:
    pairs = isinstance(value, (list, tuple)) and len(value) > 0
    return _is_text(value) or (
        pairs
        and all(
            isinstance(one, (list, tuple)) and len(one) == 2 and all(map(_is_count, one)) for one in value
        )
    )


def _one_of(*names: str) -> Kind:
    return Kind(lambda value: isinstance(value, str) and value in names, ", ".join(names))


PATH = Kind(_is_path, "a path: text or a Path, not empty")
PATHS = Kind(_one_or_many(_is_path), "a path or a list of paths: text or a Path, not empty")
SECONDS = Kind(_is_number, "a number, in s")
COUNT = Kind(_is_count, "a whole number, 0 or more")
FLAG = Kind(lambda value: isinstance(value, (bool, np.bool_)), "True or False")
KIND_OF_TOLERANCE = Kind(
    lambda value: _is_text(value) or _is_limit(value),
    'a number in m, a text such as "axis=3.5mm,angle=0.5deg", or a mapping of kinds to m or rad, such as'
    ' {"axis": 0.0035, "angle": 0.01}',
)
PROGRESS = Kind(callable, "a function of the completed share, 0 to 1, such as print")
PLANNED = Kind(_is_planned, 'a file, a test cube ("cube:..."), or PathRows')
NUMBERS = Kind(_are_numbers, "a list of numbers")
LINK = Kind(_is_text, "the name of a link of the URDF")
ROBOT_FILE = Kind(_is_path, "a name, or a TOML or URDF file")

KINDS = {
    "accuracy.path": PLANNED,
    "acceleration": Kind(_is_number, "a number, in m/s2"),
    "align": _one_of("none", "start", "rigid", "tool", "base+tool"),
    "arguments": Kind(_are_arguments, 'a mapping of names to texts or numbers, such as {"log": "log.csv"}'),
    "arcs": _one_of("tangential", "total"),
    "audit": PATH,
    "backend": _one_of("native", "python"),
    "base_link": LINK,
    "block": Kind(
        lambda value: _is_text(value) or (_one_or_many(_is_text)(value) and len(value) > 0),
        "a block, or one for each simulation",
    ),
    "band": Kind(_is_number, "a number, in m"),
    "controls": Kind(
        _are_controls, 'a mapping of names to numbers or texts, such as {"crank": 0.9} or {"crank": "40deg"}'
    ),
    "csv": PATH,
    "cycles": Kind(_are_cycles, 'a text such as "1:1477,1478:2955", or pairs of rows, such as [(1, 1477)]'),
    "baseline": Kind(_is_baseline, "a recording, or what `compare` returned"),
    "build_fmu.log": Kind(_is_table, "a log: CSV, or a folder of plots"),
    "defaults": Kind(
        lambda value: isinstance(value, (list, tuple)) and all(map(_is_text, value)),
        'a list of texts, such as ["sync=auto from urmpipe.toml"]',
    ),
    "derivative": _one_of("central", "savgol"),
    "diagnose": FLAG,
    "draw": PATH,
    "duration": SECONDS,
    "error": _one_of("time", "path"),
    "every": FLAG,
    "figures": PATH,
    "force": NUMBERS,
    "form": _one_of("text", "c"),
    "formats": Kind(_one_or_many(_is_text), "pdf, svg, png or a list of them"),
    "figure_dpi": Kind(_is_count, "a whole number, 0 or more"),
    "figure_font": Kind(_is_number, "a number, in pt"),
    "figure_names": Kind(_one_or_many(_is_text), 'a title or a list of titles, such as "Deviation*"'),
    "figure_width": Kind(
        lambda value: _is_text(value) or _is_number(value),
        'column, page, a text such as "85mm", or a number in m',
    ),
    "ingest.name": Kind(_is_text, "a non-empty text"),
    "ik.tolerance": Kind(_is_number, "a number, in m"),
    "inputs": PATHS,
    "iso": FLAG,
    "jerk": Kind(_is_number, "a number, in m/s3"),
    "junit": PATH,
    "keep_going": FLAG,
    "law": _one_of("trapezoid", "jerk", "limits"),
    "lazy": FLAG,
    "limit": Kind(_is_number, "a number, in m"),
    "log_map": Kind(_is_map, "a map (TOML), or what `read_map` returned"),
    "branch": COUNT,
    "drives": Kind(
        lambda value: isinstance(value, Mapping),
        'a mapping of names to pairs of numbers or texts, such as {"crank": (0, "360deg")}',
    ),
    "load_network.network": Kind(_is_tables, "a name, a TOML file, or the tables of one"),
    "method": _one_of("auto", "closed", "iterative"),
    "name_or_path": ROBOT_FILE,
    "network_drive.law": _one_of("uniform", "trapezoid", "quintic"),
    **dict.fromkeys(
        ("network_check.start", "network_drive.start", "network_solve.start"),
        Kind(
            lambda value: isinstance(value, Mapping),
            'a mapping of joints to numbers or texts, such as {"theta4": "85deg"}',
        ),
    ),
    "network_drive.log": Kind(_is_log, "a log: a file, a table with columns, or a Run"),
    "network": Kind(_is_network, "a name, a TOML file, the tables of one, or a Network"),
    "noise": KIND_OF_TOLERANCE,
    "options": Kind(lambda value: isinstance(value, Mapping), 'a mapping, such as {"joints": 6}'),
    "output": PATH,
    "path": PATH,
    "plan.path": PLANNED,
    "planes": Kind(lambda value: _is_count(value) and value > 0, "a whole number, 1 or more"),
    "platforms": Kind(_one_or_many(_is_text), "linux64, win64 or a list of both"),
    "point": Kind(_is_point, 'a text such as "coupler:0.45,0.2,0", or a body and three numbers'),
    "progress": PROGRESS,
    "restarts": COUNT,
    "robot": Kind(_is_robot, "a name, a TOML or URDF file, or a Chain, such as urmpipe.load_robot(NAME)"),
    "rows": _one_of("grid", "file", "velocities", "samples", "criteria"),
    "run": Kind(_is_run, "a Run, such as urmpipe.ingest(LOG)"),
    "seed": COUNT,
    "sides": Kind(_are_sides, 'two words in the names of columns, such as ("target", "actual")'),
    "step": SECONDS,
    "steps": COUNT,
    "torques": Kind(lambda value: isinstance(value, Mapping), "a mapping of joints to numbers in N.m or N"),
    "strict": FLAG,
    "sync": Kind(
        lambda value: _is_number(value) or (isinstance(value, str) and value in ("stamps", "start", "auto")),
        "stamps, start, auto, or t_reference - t_log as a number, in s",
    ),
    "system": Kind(_is_path, "the name of a system, or a system file (TOML)"),
    "targets": Kind(lambda value: _is_text(value) or not isinstance(value, str), "a file, or an array"),
    "tcp": _one_of("fk", "recorded"),
    "timeout": SECONDS,
    "tip_link": LINK,
    "term": _one_of("all", "inertia", "centrifugal", "coriolis", "gravity", "tool"),
    "to": _one_of("csv", "parquet", "mat", "tum"),
    "told": Kind(callable, "a function of a text, such as print"),
    "tolerance": KIND_OF_TOLERANCE,
    "tsp": SECONDS,
    "build_fmu.unit": Kind(_is_unit, "the name of a unit, a Python file with one, or a BlockModel"),
    "velocities": NUMBERS,
    "velocity": Kind(_is_number, "a number, in m/s"),
    "within_pi": FLAG,
    "wrenches": Kind(_are_wrenches, 'a list of texts such as "coupler:0.45,0,0:0,-50,0"'),
    "write_map": PATH,
    "write_map.robot": ROBOT_FILE,
}
"""What each keyword takes, anywhere or in one function; the others are checked by what they mean."""
