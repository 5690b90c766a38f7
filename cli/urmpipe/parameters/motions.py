"""Parameters of ik, plan and accuracy."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal, TypedDict

from urmpipe.parameters import kinds
from urmpipe.parameters.param import Heading, Param
from urmpipe.parameters.shared import (
    BACKEND,
    Inputs,
    Messages,
    PathLike,
    PathReading,
    Placing,
    Progress,
    Quantity,
    Strict,
    TableReading,
)

if TYPE_CHECKING:
    from urmpipe_pipeline.solved_targets.request import JointValues

_solving = partial(Param, heading=Heading.SOLVING)
_planning = partial(Param, heading=Heading.PLANNING)
_running = partial(Param, heading=Heading.RUNNING)
_judging = partial(Param, heading=Heading.JUDGING)
_output = partial(Param, heading=Heading.OUTPUT, each_call=True)


class Ik(TableReading, Placing, Strict, Inputs, Progress, total=False):
    """The parameters of `ik`."""

    output: Annotated[
        PathLike | None,
        _output(
            kinds.file("LOG.csv|RUN.rrd", ".csv", ".rrd"),
            "Write a joint log for ingest, or a recording.",
            names=("-o",),
        ),
    ]
    every: Annotated[
        bool,
        _solving(
            kinds.FLAG,
            "Find all solutions, and record each as a ghost arm; arms without a closed form use random"
            " starts.",
            default=False,
            names=("--all",),
        ),
    ]
    start: Annotated[
        "str | JointValues | None",
        _solving(
            kinds.JOINT_VALUES,
            "Prefer solutions near these joint values, in rad and m or with units, such as 0,-90deg,500mm"
            " [default: the robot's start pose].",
        ),
    ]
    tolerance: Annotated[
        Quantity | None,
        _solving(
            kinds.AXIS_TOLERANCE,
            "Allow the nearest reachable point within this distance on each axis, such as 3.5mm.",
        ),
    ]
    tsp: Annotated[
        Quantity | None,
        _solving(kinds.SECONDS, "Sample period of a table without time column; its rows are then a path."),
    ]
    within_pi: Annotated[
        bool,
        _solving(kinds.FLAG, "Wrap joints without limits to -pi..pi, as CoppeliaSim does.", default=False),
    ]
    method: Annotated[
        Literal["auto", "closed", "iterative"],
        _solving(
            kinds.one_of("auto", "closed", "iterative"),
            "Solver; auto: the closed form if the arm has one, else iterative.",
            default="auto",
        ),
    ]
    restarts: Annotated[
        int | str,
        _solving(kinds.COUNT, "Random starts of the iterative solver if the first one fails.", default=20),
    ]
    seed: Annotated[int | str, _solving(kinds.COUNT, "Seed of the random starts.", default=0)]


class Law(TypedDict, total=False):
    """The law of time along a path, and its limits."""

    acceleration: Annotated[
        Quantity | None,
        _planning(
            kinds.number("m/s2"),
            "Largest acceleration along the path, such as 500mm/s2 [default: 6m/s2; none with --law limits].",
        ),
    ]
    law: Annotated[
        Literal["trapezoid", "jerk", "limits"],
        _planning(
            kinds.one_of("trapezoid", "jerk", "limits"),
            "Law of motion: trapezoid limits speed and acceleration, jerk also the jerk; limits uses all that"
            " the joint limits allow.",
            default="trapezoid",
        ),
    ]
    jerk: Annotated[
        Quantity | None,
        _planning(kinds.number("m/s3"), "Largest jerk along the path, for --law jerk, such as 60m/s3."),
    ]
    arcs: Annotated[
        Literal["tangential", "total"],
        _planning(
            kinds.one_of("tangential", "total"),
            "Acceleration that is limited on arcs: tangential, or total with v^2 / r.",
            default="tangential",
        ),
    ]
    start: Annotated[
        "str | JointValues | None",
        _planning(
            kinds.JOINT_VALUES,
            "Prefer joint values near these at the first sample, in rad and m or with units, such as"
            " 0,-90deg,500mm [default: the robot's start pose].",
        ),
    ]


class Plan(Law, PathReading, Placing, Strict, Inputs, Progress, total=False):
    """The parameters of `plan`."""

    output: Annotated[
        PathLike | None,
        _output(
            kinds.file("PLAN.csv|PLAN.rrd", ".csv", ".rrd"),
            "Write a log for the other commands, or a recording.",
            names=("-o",),
        ),
    ]
    velocity: Annotated[
        Quantity | None,
        _planning(
            kinds.number("m/s"),
            "Largest speed along the path, such as 250mm/s [default: 0.5m/s; none with --law limits].",
        ),
    ]
    tsp: Annotated[Quantity, _planning(kinds.SECONDS, "Sample period, such as 8ms.", default="5ms")]


class Accuracy(Law, PathReading, Placing, Strict, Inputs, Messages, total=False):
    """The parameters of `accuracy`."""

    velocities: Annotated[
        str | Sequence[Quantity],
        _planning(
            kinds.numbers("V1,V2,...", "m/s", "a list of numbers of m/s, such as 0.1,0.2 or 100mm/s,0.2m/s"),
            "Speeds along the path to run, such as 100mm/s,0.2m/s; numbers alone are in m/s.",
            default="0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9,1.0",
        ),
    ]
    limit: Annotated[
        Quantity | None,
        _judging(
            kinds.DEVIATION,
            "Largest allowed error, such as 0.4mm: judge each velocity, and find the largest within it.",
        ),
    ]
    error: Annotated[
        Literal["time", "path"],
        _judging(
            kinds.one_of("time", "path"),
            "Judged error: distance from the set point at the same time, or from the path.",
            default="time",
        ),
    ]
    force: Annotated[
        str | Sequence[Quantity] | None,
        _running(
            kinds.numbers("FX,FY,FZ", "N", "three finite numbers of N, such as 0,0,-50", length=3),
            "External force on the tool in N, in the world frame [default: none].",
        ),
    ]
    backend: Annotated[
        Literal["native", "python"] | None,
        _running(BACKEND, "Run the arm as compiled C or in Python [default: native if a compiler is found]."),
    ]
    output: Annotated[PathLike | None, _output(kinds.RECORDING, "Recording to write.", names=("-o",))]


PATH = _planning(kinds.PLANNED, "Path of lines and arcs, or a test cube, as for plan.", required=True)
