"""Options of how an arm runs along a path: the law of its time, and where it begins."""

from __future__ import annotations

import click

from urmpipe.options.grouped import Command, with_options
from urmpipe.options.types import JOINT_VALUES, NumberType, OneOf

LAW = (
    click.option(
        "--acceleration",
        type=NumberType("M/S2", "m/s2"),
        help="Largest acceleration along the path [default: 6; with --law limits none].",
    ),
    click.option(
        "--law",
        type=OneOf(["trapezoid", "jerk", "limits"]),
        default="trapezoid",
        show_default=True,
        help="Within speed and acceleration; within --jerk, too; or as fast as the joints' limits allow.",
    ),
    click.option(
        "--jerk", type=NumberType("M/S3", "m/s3"), help="Largest jerk along the path, of --law jerk."
    ),
    click.option(
        "--arcs",
        type=OneOf(["tangential", "total"]),
        default="tangential",
        show_default=True,
        help="What the acceleration limits on arcs; total: v^2 / r counts, too.",
    ),
)

start_option = click.option(
    "--start",
    type=JOINT_VALUES,
    help="Joint values to be near to at the first sample, in rad and m [default: the robot's own].",
)


def law_options(command: Command) -> Command:
    """Add the law of time along a path, and its limits but for the speed."""
    return with_options(command, *LAW)
