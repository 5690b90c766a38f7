"""The words and tables of a result: facts, tables, checks, events, in sections."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from urmpipe_models.errors import Finding, Hint
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.presentation.figure import Drawing, Figure, SpaceFigure, Text
from urmpipe_pipeline.presentation.scene import Scene

Verdict: TypeAlias = Literal["pass", "fail"] | None
Level: TypeAlias = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Value:
    """A number; how many digits of it are shown, and in which unit, is decided where it is rendered.

    Attributes:
        number: In `unit`; None where there is no value.
        unit: SI ("m", "rad", "s", "m/s"), "%" of a share 0..1, "1" of a ratio, "" of a count.
        limit: What it is held against, in `unit`.
        verdict: How it came out.
        used: Share of the limit that is used up, 0 or more.
        signed: Whether a plus sign is shown.
        given: True for what was given, not measured: it is written with no more digits than it has.
        most: Whether it stands out of its column.
        least: Whether `limit` is the least that is needed, else the most that is allowed.
    """

    number: float | int | None
    unit: str = ""
    limit: float | None = None
    verdict: Verdict = None
    used: float | None = None
    signed: bool = False
    given: bool = False
    most: bool = False
    least: bool = False


@dataclass(frozen=True, slots=True)
class Place:
    """A point x, y, z in [m]."""

    position: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Judged:
    """A verdict as the cell of a table."""

    verdict: Verdict


@dataclass(frozen=True, slots=True)
class Ref:
    """The title of a section: where links are possible, it leads there.

    Attributes:
        title: That of the section.
        colour: As #rrggbb, in which the section's subject is drawn everywhere; empty if it has none.
    """

    title: str
    colour: str = ""


@dataclass(frozen=True, slots=True)
class Advice:
    """Words and what the reader may give, spelled for who reads it: as options, as keywords.

    Attributes:
        words: What stands before; empty for nothing.
        hints: The parameters with their values.
    """

    words: str = ""
    hints: tuple[Hint, ...] = ()


Cell: TypeAlias = Value | Place | Judged | Ref | Advice | str | None


@dataclass(frozen=True, slots=True)
class Fact:
    """A name and a value.

    Attributes:
        name: What it is of.
        value: What it is; nothing is shown of None and of an empty text.
        help: What that means, for who meets it for the first time.
        brief: Whether it is shown where there is little room: terminal, notebook.
        page: False for what a page shows in another place: no number stands twice on it.
        leads: Whether a page shows it before the others.
    """

    name: str
    value: Cell
    help: str = ""
    brief: bool = True
    page: bool = True
    leads: bool = False


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    Attributes:
        key: Its name in CSV.
        title: Its head, without a unit: that comes from its values; where they differ, each cell has its own.
        cells: One a row.
        brief: Whether it is shown where there is little room.
        page: False for what a page shows in another place.
    """

    key: str
    title: str
    cells: Sequence[Cell]
    brief: bool = True
    page: bool = True


@dataclass(frozen=True, slots=True)
class Table:
    """Columns of equal length; the first names the rows. A column without any value is not shown.

    Attributes:
        title: Its heading.
        columns: From the left.
        note: A line under it.
        brief: Whether it is shown where there is little room.
        folded: Whether a page opens it only on request.
        worst_first: Whether it ranks verdicts from worst to best; else from best to worst, if it has some.
        page: False for what a page shows in another place.
        page_title: Its heading on a page that shows its rows from the worst; empty where that is `title`.
    """

    title: str
    columns: tuple[Column, ...]
    note: str = ""
    brief: bool = True
    folded: bool = False
    worst_first: bool = False
    page: bool = True
    page_title: str = ""


@dataclass(frozen=True, slots=True)
class Check:
    """One judgement: a test case of JUnit.

    Attributes:
        name: What is judged, unique within `about` and its section.
        verdict: pass or fail.
        words: Why it fails; one line.
        about: Its class in JUnit; by default the title of its section.
        kind: What fails, such as "out-of-tolerance".
    """

    name: str
    verdict: Literal["pass", "fail"]
    words: str = ""
    about: str = ""
    kind: str = "out-of-tolerance"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened at a time, or (`t_ns` None) that holds for all of it.

    Attributes:
        t_ns: Its time in [ns].
        words: What happened; a warning is put into words for who reads it.
        level: How serious it is.
    """

    t_ns: int | None
    words: str | LogWarning
    level: Level = "info"


Block: TypeAlias = Table | Figure | SpaceFigure | Drawing | Text


def nothing() -> tuple[()]:
    """Return nothing: the default of what is made only where it is shown."""
    return ()


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """A part of a result under a heading.

    Attributes:
        title: The heading.
        verdict: pass, fail or None.
        facts: What it is about; of a judged section the first is what decided.
        tables: What is read first.
        figures: Returns its plots, drawings, and texts that the viewer has room for, too, in order; called
            only where they are shown. The viewer shows no drawings.
        blocks: Returns what only a page has room for, in order behind the figures: paths in space, what
            takes long to compute, long tables, texts; called only there.
        checks: What was judged. With checks or properties a section is a test suite of JUnit.
        properties: Of that suite: names and plain values.
        events: Returns them in any order; called only where they are shown.
        warnings: What a person should know.
        errors: Why it could not be judged; then it is a test suite of JUnit, too.
        notice: What must not be overseen.
        sections: The parts below it.
        rank: Its place among its neighbours where they are read from best to worst, or by importance, 0 the
            first; JUnit and the viewer's tabs keep the order given.
        opened: Whether the viewer shows it first among its neighbours.
    """

    title: str
    verdict: Verdict = None
    facts: tuple[Fact, ...] = ()
    tables: tuple[Table, ...] = ()
    figures: Callable[[], Iterable[Figure | Drawing | Text]] = nothing
    blocks: Callable[[], Iterable[Block]] = nothing
    checks: tuple[Check, ...] = ()
    properties: Mapping[str, Any] = field(default_factory=dict)
    events: Callable[[], Iterable[Event]] = nothing
    warnings: tuple[LogWarning, ...] = ()
    errors: tuple[Finding, ...] = ()
    notice: str = ""
    sections: tuple[Section, ...] = ()
    rank: int = 0
    opened: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Presentation:
    """All that a result shows.

    Attributes:
        name: Of the result.
        headline: How it came out, one sentence without the verdict's word.
        verdict: pass, fail or None.
        word: What stands for the verdict where there is none, such as "ingested".
        facts: The few facts that explain the headline.
        body: Everything else.
        opens_at_ns: Where the viewer opens in [ns].
        opens_at_row: The row, from 0, at which it opens instead where the result has no times; else None.
        scene: Returns the 3D view; called only where it is drawn.
        lines: Its rows among those of several results, by their heads; the first cell names a row, and rows
            of one name stand below each other.
        rows: Returns what `--csv` writes.
        created: When it was made (ISO 8601), for JUnit; empty where that is not known.
        recording: The name of its recording; empty where there is none.
    """

    name: str
    headline: str
    verdict: Verdict
    facts: tuple[Fact, ...]
    body: Section
    word: str = ""
    opens_at_ns: int = 0
    opens_at_row: int | None = None
    scene: Callable[[], Scene | None] | None = None
    lines: tuple[Mapping[str, Cell], ...] = ()
    rows: Callable[[], Table] | None = None
    created: str = ""
    recording: str = ""
