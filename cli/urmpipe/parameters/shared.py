"""Parameters of several commands: the arm, how tables and logs are read, warnings, outputs, what is printed.

The declarations do without `from __future__ import annotations`: annotations are what they consist of. Types
that are slow to import are in quotes.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias, TypedDict

from urmpipe.parameters import kinds
from urmpipe.parameters.param import Heading, Param

if TYPE_CHECKING:
    from urmpipe.arm_placing import Frame
    from urmpipe_pipeline.logs import LogMap

PathLike: TypeAlias = str | Path
Quantity: TypeAlias = float | str  # a number in SI, or a text with a unit: 0.005 or "5ms"
Interval: TypeAlias = str | tuple[float | str, float | str]

_robot = partial(Param, heading=Heading.ROBOT)
_reading = partial(Param, heading=Heading.READING)
_processing = partial(Param, heading=Heading.PROCESSING)
_output = partial(Param, heading=Heading.OUTPUT, each_call=True)

ROBOT = _robot(kinds.ROBOT, "Robot: a name of `urmpipe robot list`, a TOML file or a URDF.")
BACKEND = kinds.one_of("native", "python")
START = kinds.JOINT_VALUES


class Placing(TypedDict, total=False):
    """The place and the ends of an arm."""

    base: Annotated["str | Frame | None", _robot(kinds.FRAME, "Base of the arm in the world frame (m, rad).")]
    tool: Annotated[
        "str | Frame | None",
        _robot(
            kinds.FRAME, "Tool centre point (TCP) in the frame of the arm's tip (m, rad), such as 0,0,150mm."
        ),
    ]
    base_link: Annotated[str | None, _robot(kinds.LINK, "First link of a URDF [default: its root].")]
    tip_link: Annotated[
        str | None, _robot(kinds.LINK, "Last link of a URDF [default: its only end].", names=("--tip",))
    ]


class TextTable(TypedDict, total=False):
    """How the text of a table is read."""

    delimiter: Annotated[
        str | None,
        _reading(kinds.DELIMITER, "Column separator, by name or as the character itself in quotes."),
    ]
    decimal: Annotated[str | None, _reading(kinds.DECIMAL, "Decimal separator.")]
    position: Annotated[
        str | Sequence[str | int] | None,
        _reading(kinds.COLUMNS, "Columns of the recorded tool position or of the targets: x, y, z."),
    ]
    orientation: Annotated[
        str | Sequence[str | int] | None,
        _reading(kinds.COLUMNS, "Columns of the orientation, in the order of its form."),
    ]
    rotation: Annotated[
        str | None,
        _reading(kinds.ROTATION, "Form of the recorded orientation, where the column names leave it open."),
    ]
    map: Annotated[
        "PathLike | LogMap | None",
        _reading(kinds.MAP, "Map of the log, written by ingest; other options override it."),
    ]


class PathReading(TextTable, total=False):
    """How the rows of a path are read: as of a table, without time."""

    unit: Annotated[
        str | Mapping[str, str] | None,
        _reading(kinds.UNIT, "Unit of x, y, z and r (mm), of angles (deg), or of one column (COLUMN=mm)."),
    ]


class TableReading(TextTable, total=False):
    """How a table is read."""

    time: Annotated[str | int | None, _reading(kinds.TIME, "Time column; none if the log has none.")]
    unit: Annotated[
        str | Mapping[str, str] | None,
        _reading(
            kinds.UNIT,
            "Unit of angles (rad, deg, turn/4096) where the names give none, or unit of one column.",
        ),
    ]


class LogReading(TextTable, total=False):
    """How the rows of a log are read."""

    joints: Annotated[
        str | Sequence[str | int] | None,
        _reading(kinds.COLUMNS, "Joint columns in the robot's order: names, or column numbers such as 2-7."),
    ]
    time: Annotated[str | int | None, _reading(kinds.TIME_OF_FILE, "Time column; none if the log has none.")]
    unit: Annotated[
        str | Mapping[str, str] | None,
        _reading(
            kinds.UNIT,
            "Unit of angles (rad, deg, turn/4096) where the names give none, or unit of one column.",
        ),
    ]
    source: Annotated[
        str | None, _reading(kinds.SOURCE, "Program that wrote the log: coppeliasim, solidworks, ...")
    ]
    period: Annotated[
        Quantity | None,
        _reading(kinds.SECONDS, "Sample period of a log without a time column [default: 5ms]."),
    ]
    layout: Annotated[
        str | None,
        _reading(
            kinds.LAYOUT,
            "table: one sample per row; transposed: one joint per row; long: one joint per row in each"
            " sample; flat: a single list of numbers, N per sample [default: table].",
        ),
    ]
    sheet: Annotated[str | int | None, _reading(kinds.SHEET, "Sheet of a workbook: name, or number from 1.")]
    topic: Annotated[
        str | None, _reading(kinds.TOPIC, "Topic of a bag, or of a table with the columns of several.")
    ]
    side: Annotated[
        str | None,
        _reading(
            kinds.SIDE,
            "Read the columns with this word in their names, and not those of another side: actual, arm1,"
            " arm2_solved.",
        ),
    ]
    episode: Annotated[
        str | int | None,
        _reading(kinds.EPISODE, "Episode of a file of several: its number or name, or COLUMN=VALUE."),
    ]
    rows: Annotated[
        str | None,
        _reading(
            kinds.ROWS,
            "Rows to read, from 1, both ends included; negative ones count from the end: 2:-1 leaves out the"
            " first.",
        ),
    ]
    skip_bad: Annotated[
        bool, _reading(kinds.FLAG, "Skip unreadable rows, at most 1 %.", default=False, decides=True)
    ]


class Reading(LogReading, total=False):
    """How a log is read, and the intervals of its joints."""

    names: Annotated[
        str | Sequence[str] | None, _reading(kinds.JOINT_NAMES, "Names of the joints, in their order.")
    ]
    signs: Annotated[
        str | Sequence[int] | None,
        _reading(kinds.SIGNS, "1 or -1 for each joint: q = sign * value + offset."),
    ]
    offsets: Annotated[
        str | Sequence[float] | None,
        _reading(kinds.OFFSETS, "Offset of each joint, in the unit of its column."),
    ]
    poses: Annotated[bool | None, _reading(kinds.FLAG, "The rows are static poses without time.")]
    measured: Annotated[
        str | Sequence[str | int] | None,
        _reading(
            kinds.COLUMNS,
            "Columns of the tool position measured by an external device: x, y, z[, orientation].",
        ),
    ]
    interval: Annotated[
        Interval | Mapping[str, Interval] | None,
        _processing(
            kinds.INTERVAL,
            "Interval to which the program wraps the joint values, in their own unit or with units, such as"
            " -180deg:180deg [default: found from the wraps].",
        ),
    ]
    repair: Annotated[
        bool,
        _processing(
            kinds.FLAG, "Replace samples recorded in the middle of a wrap by interpolation.", default=False
        ),
    ]


class Processing(TypedDict, total=False):
    """How a log is resampled and differentiated."""

    tsp: Annotated[
        Quantity | None,
        _processing(kinds.SECONDS, "Sample period of the time grid [default: the log's own]."),
    ]
    derivative: Annotated[
        Literal["central", "savgol"] | None,
        _processing(
            kinds.one_of("central", "savgol"),
            "Method of differentiation: central differences or a Savitzky-Golay filter [default: by the"
            " resolution of the log].",
        ),
    ]


class Strict(TypedDict, total=False):
    """Whether warnings are errors."""

    strict: Annotated[
        bool,
        Param(
            kinds.FLAG,
            "Treat warnings as errors (exit code 2).",
            default=False,
            heading=Heading.JUDGING,
        ),
    ]


class Inputs(TypedDict, total=False):
    """Files that are never replaced."""

    inputs: Annotated[
        PathLike | Sequence[PathLike],
        Param(
            kinds.PATHS,
            "Files, in addition to the operands, that are never replaced.",
            default=(),
            shell=False,
        ),
    ]


class Progress(TypedDict, total=False):
    """Reports of long work."""

    progress: Annotated[
        Callable[[float], object] | None,
        Param(kinds.PROGRESS, "Called with the completed share, 0 to 1.", shell=False),
    ]


class OnMessage(TypedDict, total=False):
    """Messages during long work."""

    on_message: Annotated[
        Callable[[str], object] | None,
        Param(kinds.ON_MESSAGE, "Called with a line about work that takes its time.", shell=False),
    ]


class Messages(OnMessage, Progress, total=False):
    """Messages and progress of long work."""


class Printing(TypedDict, total=False):
    """What a command prints."""

    json: Annotated[
        bool, _output(kinds.FLAG, "Print one JSON object on standard output.", default=False, python=False)
    ]
    quiet: Annotated[
        bool,
        Param(
            kinds.FLAG,
            "Print errors only.",
            default=False,
            heading=Heading.OUTPUT,
            names=("-q",),
            python=False,
        ),
    ]


class Debugging(TypedDict, total=False):
    """What a command prints of an error."""

    debug: Annotated[
        bool,
        Param(kinds.FLAG, "Show the traceback of an error.", default=False, each_call=True, python=False),
    ]
