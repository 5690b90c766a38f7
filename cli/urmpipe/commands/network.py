"""`urmpipe network list|check|solve|drive`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.headings import HeadedCommand, Heading, option
from urmpipe.options.grouped import Command, with_options
from urmpipe.options.named import NamedType, control_names, named_values
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import STRICT_OPTION, motion_log_options
from urmpipe.options.types import ANY_FILE, DRAWING, DURATION, NETWORK, OneOf, WholeType
from urmpipe.usage import Group

if TYPE_CHECKING:
    from urmpipe_pipeline.networks.network_motion import NetworkMotion
    from urmpipe_pipeline.networks.result import NetworkResult


@click.group(cls=Group, short_help="Assemble kinematic networks and compute their mobility.")
def network() -> None:
    """Assemble kinematic networks of joints, constraint elements and controls, and compute their mobility.

    A network is a name of `urmpipe network list`, or a TOML file of bodies, joints, elements and controls;
    docs/networks.md lists its keys.
    """


@network.command("list", short_help="List the built-in networks.")
@output_options
def list_(terminal: Terminal) -> int:
    """List the built-in networks.

    \b
    Examples:
      urmpipe network list
      urmpipe network list --json
    """
    from urmpipe.printing.mechanisms import networks_dict, print_networks
    from urmpipe_models.networks.file import load_network, network_names

    networks = [load_network(name) for name in network_names()]
    terminal.answer(lambda: networks_dict(networks), lambda: print_networks(networks))
    return 0


def _search_options(command: Command) -> Command:
    """Add how a network is assembled, and what is written of it."""
    return with_options(
        command,
        option(
            Heading.SOLVING,
            "--controls",
            "--set",
            type=NamedType(control_names),
            multiple=True,
            callback=named_values,
            metavar="CONTROL=VALUE",
            help="Value of a control, such as crank=40deg; a number alone is in the units of the network's"
            " file [default: its start value].",
        ),
        option(
            Heading.SOLVING,
            "--start",
            multiple=True,
            callback=named_values,
            metavar="JOINT=VALUE",
            help="Assemble nearest to these joint values, such as theta4=85deg [default: where a motion from"
            " the network's start leads].",
        ),
        *SEARCH,
        option(
            Heading.OUTPUT,
            "--draw",
            metavar="FILE.svg",
            type=DRAWING,
            help="Draw the graph and the mechanism.",
        ),
        output_option("RUN.rrd", "Recording to write."),
        STRICT_OPTION,
    )


def with_search(command: Command) -> Command:
    """Add how assemblies are searched for."""
    return with_options(command, *SEARCH)


SEARCH = (
    option(
        Heading.SOLVING,
        "--restarts",
        type=WholeType(),
        default=2000,
        show_default=True,
        help="End a search after this many random starts without a new assembly.",
    ),
    option(
        Heading.SOLVING,
        "--seed",
        type=WholeType(),
        default=0,
        show_default=True,
        help="Seed of the random starts.",
    ),
)
"""How assemblies are searched for."""


@network.command(cls=HeadedCommand, short_help="Assemble a network and compute its mobility.")
@click.argument("name", metavar="NAME|FILE", type=NETWORK)
@_search_options
@output_options
def check(name: str, output: Path | None, terminal: Terminal, **options: Any) -> int:
    """Assemble a network from its start values, and compute its mobility.

    Prints its loops and clusters, its mobility by the rank of the Jacobian and by Kutzbach's formula, and
    the redundant constraints that explain a difference. It names idle spins and special configurations. If
    a loop does not close, it names the loop and its gap.

    \b
    Examples:
      urmpipe network check four-bar
      urmpipe network check bennett --set turn=40deg --json
      urmpipe network check my-linkage.toml --draw my-linkage.svg

    Exit codes: 0 assembled, 1 not assembled, 2 bad file or usage.
    """
    replaces = output is not None and output.exists()
    with terminal.progress(f"Assembling {name}") as progress:
        result = urmpipe.network_check(name, output=output, progress=progress, **options)
    return _answered(result, terminal, replaces)


@network.command(cls=HeadedCommand, short_help="Find configurations in which a network closes.")
@click.argument("name", metavar="NAME|FILE", type=NETWORK)
@option(
    Heading.SOLVING,
    "--every",
    "--all",
    is_flag=True,
    help="Find all assemblies, and record each as a ghost.",
)
@_search_options
@output_options
def solve(name: str, output: Path | None, terminal: Terminal, **options: Any) -> int:
    """Find the configuration in which a network closes, or with --all every one.

    It is the one nearest to the start of the network's file. Controls that --set moves away from there are
    moved by continuation, on the branch of the start. With --start it is the one nearest to these joint
    values, and the distances of the others are told. If nothing closes there, the search goes on from random
    starts. With --all it ends after --restarts random starts without a new assembly.

    \b
    Examples:
      urmpipe network solve four-bar --set crank=70deg
      urmpipe network solve four-bar --all --json
      urmpipe network solve stewart-gough --all --draw sg.svg -o sg.rrd

    Exit codes: 0 assembly found, 1 no assembly found, 2 bad file or usage.
    """
    replaces = output is not None and output.exists()
    with terminal.progress(f"Assembling {name}") as progress:
        result = urmpipe.network_solve(name, output=output, progress=progress, **options)
    return _answered(result, terminal, replaces)


@network.command(cls=HeadedCommand, short_help="Move a network by its controls.")
@click.argument("name", metavar="NAME|FILE", type=NETWORK)
@click.argument("drives", metavar="[CONTROL=FROM:TO]...", nargs=-1, callback=named_values)
@option(
    Heading.RUNNING,
    "--steps",
    type=WholeType(),
    help="Equal steps of the drives, one per sample period [default: 200].",
)
@option(Heading.RUNNING, "--duration", type=DURATION, help="Duration of the motion instead of steps.")
@option(
    Heading.RUNNING,
    "--law",
    type=OneOf(["uniform", "trapezoid", "quintic"]),
    default="uniform",
    show_default=True,
    help="Motion of the drives over the duration.",
)
@option(
    Heading.RUNNING,
    "--branch",
    type=WholeType(),
    metavar="N",
    help="Begin at this assembly of `network solve --all`, with the drives at FROM.",
)
@option(
    Heading.RUNNING,
    "--start",
    multiple=True,
    callback=named_values,
    metavar="JOINT=VALUE",
    help="Begin at the assembly nearest to these joint values, such as theta4=85deg, with the drives at FROM"
    " [default: the one that continues the network's start].",
)
@option(
    Heading.RUNNING,
    "--log",
    metavar="LOG.csv",
    type=ANY_FILE,
    help="Log whose joints drive the controls of the same names, or those that CONTROL=JOINT assigns.",
)
@option(
    Heading.RUNNING,
    "--point",
    metavar="BODY:X,Y,Z",
    help="Trace a point of a body (m): the tool centre point of the recording.",
)
@option(
    Heading.RUNNING,
    "--wrenches",
    "--wrench",
    multiple=True,
    metavar="BODY:X,Y,Z:FX,FY,FZ[,MX,MY,MZ]",
    help="Load at a point of a body (m), force (N) and moment (N.m) along the axes of the ground.",
)
@option(
    Heading.RUNNING,
    "--torques",
    "--torque",
    multiple=True,
    callback=named_values,
    metavar="JOINT=VALUE",
    help="Load at a joint, in N.m or N.",
)
@with_search
@option(Heading.OUTPUT, "--draw", metavar="FILE.svg", type=DRAWING, help="Draw the motion.")
@output_option("RUN.rrd|RUN.csv", "Recording, or log, to write.")
@motion_log_options
@output_options
def drive(name: str, output: Path | None, terminal: Terminal, **options: Any) -> int:
    """Move a network by its controls, on the branch of one assembly.

    A joint can be driven by its name in place of a control; CONTROL=VALUE holds a control. Numbers are in
    the units of the network's file, or have a unit. Singular poses are named, with what becomes free there:
    the motion turns back, branches, or goes through. It ends where it turns back, or a joint or a control is
    at its limit. The CSV is a log that `urmpipe ingest` reads.

    \b
    Examples:
      urmpipe network drive four-bar crank=0:360deg -o run.rrd
      urmpipe network drive four-bar crank=0:6 --point coupler:1,0,0 -o run.csv
      urmpipe network drive four-bar crank=0:6 --duration 2s --law trapezoid
      urmpipe network drive four-bar theta4=85deg:120deg --json
      urmpipe network drive stewart-gough-driven --log legs.csv -o run.rrd
      urmpipe network drive slider-crank crank=0:6 --wrench slider:0,0,0:-100,0,0

    Exit codes: 0 the drives reach their end, 1 the motion ends before, 2 bad file or usage.
    """
    replaces = output is not None and output.exists()
    with terminal.progress(f"Driving {name}") as progress:
        result = urmpipe.network_drive(name, output=output, progress=progress, **options)
    return _answered(result, terminal, replaces)


def _answered(result: NetworkResult | NetworkMotion, terminal: Terminal, replaces: bool) -> int:
    """Print what was found, and return the exit code."""
    terminal.warn(result.warnings)
    terminal.answer(result.to_dict, lambda: _print(result, replaces))
    return 0 if result.verdict == "pass" else 1


def _print(result: NetworkResult | NetworkMotion, replaces: bool) -> None:
    """Print what was found, and what was written."""
    from urmpipe.printing.results import print_presentation
    from urmpipe.printing.terminal import print_recording, say
    from urmpipe_models.errors import shell_quote
    from urmpipe_pipeline.networks.network_motion import NetworkMotion
    from urmpipe_pipeline.results import present

    print_presentation(present(result))
    if result.recording is not None:
        print_recording(result.recording, replaced=replaces)
    elif isinstance(result, NetworkMotion) and result.log is not None:
        earlier = "; it replaced an earlier one" if replaces else ""
        say(f"Log: {result.log}  (read it: urmpipe ingest {shell_quote(result.log)}{earlier})")
