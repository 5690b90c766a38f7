"""Files of strangers: what such a file holds, and how people write it."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from asking import Truth, Verdict, judge
from motion import Motion
from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.logs import LogMap

DEG = np.pi / 180

Column = FloatArray | IntArray | list[str]
Text = Callable[[Sequence[str] | None, Sequence[Column]], str]


@dataclass(frozen=True)
class Writer:
    """How people write a table.

    Attributes:
        name: Its name, for the tests.
        text: Makes a table of names, or None, and columns.
        decimals: Decimals that are written; None for all digits.
        sign: What stands between cells.
    """

    name: str
    text: Text
    decimals: int | None = None
    sign: str = ","

    def within(self, unit: float = 1.0) -> float:
        """How far a number may be off, in SI, for columns in such a unit."""
        return unit * (0.5 * 10.0**-self.decimals if self.decimals else 0.0) + 1e-9


def _csv(**dialect: Any) -> Text:
    def text(names: Sequence[str] | None, columns: Sequence[Column]) -> str:
        out = io.StringIO()
        rows = zip(*([v.item() if hasattr(v, "item") else v for v in c] for c in columns), strict=True)
        csv.writer(out, **dialect).writerows([*([names] if names else []), *rows])
        return out.getvalue()

    return text


def _pandas(**options: Any) -> Text:
    def text(names: Sequence[str] | None, columns: Sequence[Column]) -> str:
        table = pd.DataFrame(dict(enumerate(columns)))
        table.columns = list(names or map(str, table.columns))
        return str(table.to_csv(index=False, header=names is not None, **options))

    return text


def _savetxt(form: str, sign: str, comments: str) -> Text:
    def text(names: Sequence[str] | None, columns: Sequence[Column]) -> str:
        out = io.BytesIO()
        header = sign.join(names or [])
        np.savetxt(out, np.column_stack(columns), fmt=form, delimiter=sign, header=header, comments=comments)
        return out.getvalue().decode()

    return text


def _fstrings(form: str, sign: str, end: str = "\n") -> Text:
    def cell(value: Any) -> str:
        return format(float(value), form) if isinstance(value, (float, np.floating)) else str(value)

    def text(names: Sequence[str] | None, columns: Sequence[Column]) -> str:
        rows = [sign.join(map(cell, row)) + end for row in zip(*columns, strict=True)]
        return "".join([*([sign.join(names) + end] if names else []), *rows])

    return text


CSV = Writer("csv", _csv())
TABS = Writer("excel-tab", _csv(dialect="excel-tab"), sign="\t")
QUOTED = Writer("quoted", _csv(quoting=csv.QUOTE_ALL))
PANDAS = Writer("pandas", _pandas())
GERMAN = Writer("german", _pandas(sep=";", decimal=",", float_format="%.6f"), 6, ";")
SEMICOLON = Writer("semicolon", _pandas(sep=";"), sign=";")
SAVETXT = Writer("savetxt", _savetxt("%.18e", " ", "# "), sign=" ")
SIX = Writer("savetxt-6", _savetxt("%.6f", ",", ""), 6)
COMMA = Writer("f-string", _fstrings(".5f", ", "), 5)
FIXED = Writer("fixed", _fstrings("14.6f", " "), 6, " ")
COARSE = Writer("f-string-3", _fstrings(".3f", ","), 3)
WRITERS = (CSV, TABS, QUOTED, PANDAS, GERMAN, SEMICOLON, SAVETXT, SIX, COMMA, FIXED, COARSE)


@dataclass(frozen=True, repr=False)
class Stranger:
    """A file of a stranger.

    Attributes:
        files: Bytes by name; the first is read, with the others that are not beside it.
        truth: What it holds.
        robot: Name of the robot that is given with it.
        arm: How many joints an unknown robot has that is given with it.
        options: What is given with it; {folder} in a text is the folder of the files.
        beside: Files that are there and not read by themselves.
        kind: Its class, and its number there.
    """

    files: Mapping[str, bytes]
    truth: Truth
    robot: str = ""
    arm: int = 0
    options: Mapping[str, Any] = field(default_factory=dict)
    beside: tuple[str, ...] = ()
    kind: str = ""

    def __repr__(self) -> str:
        begin = {name: content[:200] for name, content in self.files.items()}
        return f"Stranger({begin}, robot={self.robot!r}, arm={self.arm})"

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        printer.text(repr(self))  # else Hypothesis prints whole files

    def write(self, folder: Path) -> list[Path]:
        """Write its files, and return those to read."""
        for name, content in self.files.items():
            (folder / name).write_bytes(content)
        return [folder / name for name in self.files if name not in self.beside]


Clock = Callable[[FloatArray], tuple[list[Column], float, FloatArray | None]]
"""Makes the columns of a clock; with how far they are off in [s], and the times if they differ."""


def unit_clock(unit: float = 1.0, start: float = 0.0, whole: bool = False) -> Clock:
    """Return a clock of one column in a unit in [s], from a start in [s], in whole numbers or not."""

    def clock(t: FloatArray) -> tuple[list[Column], float, FloatArray | None]:
        ns = np.rint((t + start % 1) * 1e9).astype(np.int64) + int(start) * 10**9
        off = start * 2**-52  # writers of floats hold 1.6e9 s to 3.7e-7 s
        if whole:
            return [ns // round(unit * 1e9)], unit + off, None
        return [ns / (unit * 1e9)], 1e-8 + off, None

    return clock


def table(
    motion: Motion,
    blocks: str,
    names: Mapping[str, str | Sequence[str]] | None = None,
    *,
    writer: Writer = CSV,
    unit: str = "rad",
    clock: Clock | None = None,
    file: str = "log.csv",
    edit: Callable[[str], str] | None = None,
    **own: Any,
) -> Stranger:
    """Return a table of blocks of columns.

    Args:
        motion: What happened.
        blocks: What stands in it, such as "t q tau": attributes of a motion; "t" is the clock.
        names: Name of each block's columns, with {} where they are numbered from 1; no header without.
        writer: How it is written.
        unit: Unit of the angles.
        clock: Makes the clock; seconds by default.
        file: Name of the file.
        edit: Changes the text that was written.
        own: Fields of the stranger or of its truth that differ.
    """
    scale = DEG if unit == "deg" else 1.0
    columns: list[Column] = []
    header: list[str] = []
    times, off, spread = (clock or unit_clock())(motion.t)
    for block in blocks.split():
        own_columns = times if block == "t" else _columns(motion, block, scale)
        columns += own_columns
        header += _names(names[block], len(own_columns)) if names else []
    if writer.sign == " ":
        header = [name.replace(" ", "") for name in header]
    truth = Truth(
        q=motion.q,
        t=(motion.t if spread is None else spread) if "t" in blocks.split() else None,
        q_within=writer.within(scale),
        t_within=off + writer.within(),
        qd=motion.qd,
        period=told_by_rates(motion.t) if "qd" in blocks.split() else None,
    )
    of_truth = {name: own.pop(name) for name in list(own) if name in Truth.__dataclass_fields__}
    text = writer.text(header if names else None, columns)
    files = {file: (edit(text) if edit else text).encode(), **own.pop("more", {})}
    return Stranger(files, replace(truth, **of_truth), **own)


def told_by_rates(t: FloatArray) -> tuple[float, float]:
    """Return the bounds in [s] of the time between rows that rates tell: 2 %, and what uneven steps leave."""
    steps = np.diff(t)
    steps = steps[steps > 0]  # rows of padding have none
    off = 0.02 * steps.mean() + 3 * steps.std() / np.sqrt(len(steps))
    return float(steps.mean() - off), float(steps.mean() + off)


def _columns(motion: Motion, block: str, scale: float) -> list[Column]:
    values = np.arange(len(motion.t)) if block == "index" else getattr(motion, block)
    values = np.round(values / scale, 12) if block in ("q", "qd") else values
    return list(values.T) if values.ndim == 2 else [values]


def _names(pattern: str | Sequence[str], count: int) -> list[str]:
    if not isinstance(pattern, str):
        return list(pattern)
    return [pattern.format(k + 1) for k in range(count)]


def judged(one: Stranger, folder: Path) -> Verdict:
    """Read the files of a stranger with what is given with them."""
    told: dict[str, Any] = {
        name: value.format(folder=folder) if isinstance(value, str) else value
        for name, value in one.options.items()
    }
    robot = load_robot(one.robot) if one.robot else None
    if one.arm:
        robot = Chain("arm", tuple(Joint(f"phi{k + 1}", kind="revolute") for k in range(one.arm)))
    return judge(one.write(folder), one.truth, LogMap(**told), robot)


STRANGERS: dict[str, Stranger] = {}
"""All of them by class and number: filled by the functions under `strangers`."""

Make = Callable[[], Iterator[Stranger]]


def strangers(make: Make) -> Make:
    """Put the files that a function yields on the list, as its class."""
    for k, one in enumerate(make()):
        kind = make.__name__
        STRANGERS[f"{kind}-{k + 1}"] = replace(one, kind=kind)
    return make
