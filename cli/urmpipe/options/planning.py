"""Options of how an arm runs along a path: the law of its time, and where it begins."""

from __future__ import annotations

from urmpipe.headings import Heading, option
from urmpipe.options.completion import files
from urmpipe.options.grouped import Command, with_options
from urmpipe.options.types import JOINT_VALUES, OneOf, quantity_type

LAW = (
    option(
        Heading.PLANNING,
        "--acceleration",
        type=quantity_type("m/s2", positive=False),
        help="Largest acceleration along the path, such as 500mm/s2 [default: 6m/s2; none with --law"
        " limits].",
    ),
    option(
        Heading.PLANNING,
        "--law",
        type=OneOf(["trapezoid", "jerk", "limits"]),
        default="trapezoid",
        show_default=True,
        help="Law of motion: trapezoid limits speed and acceleration, jerk also the jerk; limits uses all"
        " that the joint limits allow.",
    ),
    option(
        Heading.PLANNING,
        "--jerk",
        type=quantity_type("m/s3", positive=False),
        help="Largest jerk along the path, for --law jerk, such as 60m/s3.",
    ),
    option(
        Heading.PLANNING,
        "--arcs",
        type=OneOf(["tangential", "total"]),
        default="tangential",
        show_default=True,
        help="Acceleration that is limited on arcs: tangential, or total with v^2 / r.",
    ),
)

path_completion = files(names=lambda: ("cube:wall,", "cube:diagonal,"))
"""A table of lines and arcs, or a test cube."""

start_option = option(
    Heading.PLANNING,
    "--start",
    type=JOINT_VALUES,
    help="Prefer joint values near these at the first sample, in rad and m or with units, such as"
    " 0,-90deg,500mm [default: the robot's start pose].",
)


def law_options(command: Command) -> Command:
    """Add the law of time along a path, and its limits but for the speed."""
    return with_options(command, *LAW)
