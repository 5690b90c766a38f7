"""Parameters of simulate, fmu and network."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict

from urmpipe.parameters import kinds
from urmpipe.parameters.completion import argument_names, control_names, option_names
from urmpipe.parameters.completion import values_by_name as complete_values
from urmpipe.parameters.param import Heading, Param
from urmpipe.parameters.shared import (
    BACKEND,
    LogReading,
    Messages,
    OnMessage,
    PathLike,
    Processing,
    Progress,
    Quantity,
    Reading,
    Strict,
)

if TYPE_CHECKING:
    from urmpipe_models.networks.forces import Wrench
    from urmpipe_pipeline.logs import LogMap, TableLike
    from urmpipe_pipeline.runs.run import Run

_running = partial(Param, heading=Heading.RUNNING)
_solving = partial(Param, heading=Heading.SOLVING)
_output = partial(Param, heading=Heading.OUTPUT, each_call=True)

JOINT_START = kinds.named(
    "JOINT=VALUE", 'a mapping of joints to numbers or texts, such as {"theta4": "85deg"}'
)


class Simulate(LogReading, Strict, Messages, total=False):
    """The parameters of `simulate`."""

    list: Annotated[bool, _output(kinds.FLAG, "List the built-in systems.", default=False, python=False)]
    output: Annotated[
        PathLike | None,
        _output(kinds.RECORDING, "Recording to write [default: SYSTEM.rrd or FILE.rrd].", names=("-o",)),
    ]
    arguments: Annotated[
        Mapping[str, str | Path | float] | Sequence[str] | None,
        _running(
            kinds.named(
                "NAME=VALUE",
                'a mapping of names to texts or numbers, such as {"log": "log.csv"}',
                complete_values(argument_names),
            ),
            "Argument of the system, such as log=log.csv or robot=urm6.",
            names=("--set",),
        ),
    ]
    step: Annotated[
        Quantity | None,
        _running(kinds.SECONDS, "Communication step [default: the system's own]."),
    ]
    duration: Annotated[
        Quantity | None,
        _running(
            kinds.SECONDS, "Simulated time [default: the system's own, else the length of its longest log]."
        ),
    ]
    write_system: Annotated[
        PathLike | None,
        _output(
            kinds.MAP_FILE,
            "Write the file of a built-in system for you to change, and do not run it.",
            python=False,
        ),
    ]
    draw: Annotated[PathLike | None, _output(kinds.DRAWING, "Also draw the system.")]
    backend: Annotated[
        Literal["native", "python"] | None,
        _running(
            BACKEND, "Run the units as compiled C or in Python [default: native if a compiler is found]."
        ),
    ]
    timeout: Annotated[
        Quantity,
        _running(kinds.SECONDS, "Longest time that a call of an FMU may take.", default="60s"),
    ]


class BuildFmu(OnMessage, total=False):
    """The parameters of `build_fmu`."""

    log: Annotated[
        Any,  # PathLike | LogTable | None
        Param(
            kinds.file_or("LOG", "a log: CSV, or a folder of plots", "", ("LogTable",), kinds.files()),
            "Log, for units that play one back.",
        ),
    ]
    map: Annotated[
        "PathLike | LogMap | None",
        Param(kinds.MAP, "Map of the log, written by ingest; other options override it."),
    ]
    options: Annotated[
        Mapping[str, Any] | Sequence[str] | None,
        Param(
            kinds.named(
                "NAME=VALUE", 'a mapping, such as {"joints": 6}', complete_values(option_names), flags=True
            ),
            "Another option of the unit, such as joints=6 or rates=true; see `urmpipe fmu list`.",
            names=("-s", "--option"),
        ),
    ]
    backend: Annotated[
        Literal["native", "python"] | None,
        Param(
            BACKEND,
            "native: compiled C, needs nothing on the target. python: needs Python with NumPy there"
            " [default: native if a compiler is found].",
        ),
    ]
    platforms: Annotated[
        str | Sequence[str],
        Param(
            kinds.words_of("A,B", *kinds.PLATFORMS),
            "linux64, win64, or both with the extra `cross` [default: this platform; python: all].",
            default=(),
        ),
    ]
    output: Annotated[
        PathLike,
        Param(
            kinds.file("DIR|FILE.fmu", ".fmu"),
            "Folder for UNIT.fmu, or the file to write.",
            default=".",
            names=("-o",),
            each_call=True,
        ),
    ]


class CheckFmu(TypedDict, total=False):
    """The parameters of `fmu check`."""

    timeout: Annotated[
        Quantity, Param(kinds.SECONDS, "Longest time that a call of the FMU may take.", default="60s")
    ]


class Search(TypedDict, total=False):
    """How assemblies are searched for."""

    restarts: Annotated[
        int | str,
        _solving(
            kinds.COUNT, "End a search after this many random starts without a new assembly.", default=2000
        ),
    ]
    seed: Annotated[int | str, _solving(kinds.COUNT, "Seed of the random starts.", default=0)]


class NetworkCheck(Search, Strict, Progress, total=False):
    """The parameters of `network_check`."""

    controls: Annotated[
        Mapping[str, Quantity] | Sequence[str] | None,
        _solving(
            kinds.named(
                "CONTROL=VALUE",
                'a mapping of names to numbers or texts, such as {"crank": 0.9} or {"crank": "40deg"}',
                complete_values(control_names),
            ),
            "Value of a control, such as crank=40deg; a number alone is in the units of the network's file"
            " [default: its start value].",
            names=("--set",),
        ),
    ]
    start: Annotated[
        Mapping[str, Any] | Sequence[str] | None,
        _solving(
            JOINT_START,
            "Assemble nearest to these joint values, such as theta4=85deg [default: where a motion from the"
            " network's start leads].",
        ),
    ]
    draw: Annotated[PathLike | None, _output(kinds.DRAWING, "Draw the graph and the mechanism.")]
    output: Annotated[PathLike | None, _output(kinds.RECORDING, "Recording to write.", names=("-o",))]


class NetworkSolve(NetworkCheck, total=False):
    """The parameters of `network_solve`."""

    every: Annotated[
        bool,
        _solving(
            kinds.FLAG, "Find all assemblies, and record each as a ghost.", default=False, names=("--all",)
        ),
    ]


class NetworkDrive(Reading, Processing, Search, Strict, Progress, total=False):
    """The parameters of `network_drive`."""

    steps: Annotated[
        int | str | None,
        _running(kinds.COUNT, "Equal steps of the drives, one per sample period [default: 200]."),
    ]
    duration: Annotated[Quantity | None, _running(kinds.SECONDS, "Duration of the motion instead of steps.")]
    law: Annotated[
        Literal["uniform", "trapezoid", "quintic"],
        _running(
            kinds.one_of("uniform", "trapezoid", "quintic"),
            "Motion of the drives over the duration.",
            default="uniform",
        ),
    ]
    branch: Annotated[
        int | str | None,
        _running(kinds.COUNT, "Begin at this assembly of `network solve --all`, with the drives at FROM."),
    ]
    start: Annotated[
        Mapping[str, Any] | Sequence[str] | None,
        _running(
            JOINT_START,
            "Begin at the assembly nearest to these joint values, such as theta4=85deg, with the drives at"
            " FROM [default: the one that continues the network's start].",
        ),
    ]
    log: Annotated[
        "PathLike | TableLike | Run | None",
        _running(
            kinds.LOG,
            "Log whose joints drive the controls of the same names, or those that CONTROL=JOINT assigns.",
        ),
    ]
    point: Annotated[
        str | tuple[str, Sequence[float]] | None,
        _running(kinds.POINT, "Trace a point of a body (m): the tool centre point of the recording."),
    ]
    wrenches: Annotated[
        "Sequence[str | Wrench]",
        _running(
            kinds.WRENCHES,
            "Load at a point of a body (m), force (N) and moment (N.m) along the axes of the ground.",
            default=(),
            names=("--wrench",),
        ),
    ]
    torques: Annotated[
        Mapping[str, Quantity] | Sequence[str] | None,
        _running(
            kinds.named("JOINT=VALUE", "a mapping of joints to numbers in N.m or N"),
            "Load at a joint, in N.m or N.",
            names=("--torque",),
        ),
    ]
    draw: Annotated[PathLike | None, _output(kinds.DRAWING, "Draw the motion.")]
    output: Annotated[
        PathLike | None,
        _output(kinds.file("RUN.rrd|RUN.csv", ".rrd", ".csv"), "Recording, or log, to write.", names=("-o",)),
    ]


DRIVES = kinds.named(
    "CONTROL=FROM:TO or CONTROL=VALUE",
    'a mapping of names to pairs of numbers or texts, such as {"crank": (0, "360deg")}',
)
