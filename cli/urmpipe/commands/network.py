"""Assemble kinematic networks and compute their mobility."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import Group, operand
from urmpipe.parameters import kinds
from urmpipe.parameters.systems import DRIVES, NetworkCheck, NetworkDrive, NetworkSolve


@click.group(cls=Group, short_help="Assemble kinematic networks and compute their mobility.")
def network() -> None:
    """Assemble kinematic networks of joints, constraint elements and controls, and compute their mobility.

    A network is a name of `urmpipe network list`, or a TOML file of bodies, joints, elements and controls;
    docs/networks.md lists its keys.
    """


@network.add_command
@command(name="list", short_help="List the built-in networks.")
def list_(call: Call) -> Answer:
    """List the built-in networks.

    \b
    Examples:
      urmpipe network list
      urmpipe network list --json
    """
    from urmpipe.printing.mechanisms import networks_dict, print_networks
    from urmpipe_models.networks.file import load_network, network_names

    networks = [load_network(name) for name in network_names()]
    return Answer(to_dict=lambda: networks_dict(networks), print_text=lambda: print_networks(networks))


@network.add_command
@command(NetworkCheck, short_help="Assemble a network and compute its mobility.")
@operand("name", kinds.NETWORK, metavar="NAME|FILE")
def check(call: Call, name: str, **options: Any) -> Answer:
    """Assemble a network from its start values, and compute its mobility.

    Prints its loops and clusters, its mobility by the rank of the Jacobian and by Kutzbach's formula, and
    the redundant constraints that explain a difference. It names passive rotations and special
    configurations. If a loop does not close, it names the loop and its gap.

    \b
    Examples:
      urmpipe network check four-bar
      urmpipe network check bennett --set turn=40deg --json
      urmpipe network check my-linkage.toml --draw my-linkage.svg

    Exit codes: 0 assembled, 1 not assembled, 2 bad file or usage.
    """
    return _answer(call, f"Assembling {name}", urmpipe.network_check, name, **options)


@network.add_command
@command(NetworkSolve, short_help="Find configurations in which a network closes.")
@operand("name", kinds.NETWORK, metavar="NAME|FILE")
def solve(call: Call, name: str, **options: Any) -> Answer:
    """Find the configuration in which a network closes, or with --all every one.

    It is the one nearest to the start of the network's file. Controls that --set moves away from there are
    moved by continuation, on the branch of the start. With --start it is the one nearest to these joint
    values, and the distances of the others are printed. If nothing closes there, the search continues from
    random starts. With --all it ends after --restarts random starts without a new assembly.

    \b
    Examples:
      urmpipe network solve four-bar --set crank=70deg
      urmpipe network solve four-bar --all --json
      urmpipe network solve stewart-gough --all --draw sg.svg -o sg.rrd

    Exit codes: 0 assembly found, 1 no assembly found, 2 bad file or usage.
    """
    return _answer(call, f"Assembling {name}", urmpipe.network_solve, name, **options)


@network.add_command
@command(NetworkDrive, short_help="Move a network by its controls.")
@operand("name", kinds.NETWORK, metavar="NAME|FILE")
@operand("drives", DRIVES, metavar="[CONTROL=FROM:TO]...", nargs=-1)
def drive(call: Call, name: str, drives: dict[str, str], **options: Any) -> Answer:
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
    return _answer(call, f"Driving {name}", urmpipe.network_drive, name, drives=drives, **options)


def _answer(
    call: Call, title: str, function: Callable[..., Any], name: str, output: Path | None, **options: Any
) -> Answer:
    """Answer a command with what its function returns."""
    is_replaced = output is not None and output.exists()
    with call.progress(title) as progress:
        result = function(name, output=output, progress=progress, **options)
    return Answer(result, _iter_lines(result, is_replaced))


def _iter_lines(result: Any, is_replaced: bool) -> Iterator[str]:
    from urmpipe.printing.terminal import recording_line
    from urmpipe_models.errors import shell_quote
    from urmpipe_pipeline.networks.network_motion import NetworkMotion

    if result.recording is not None:
        yield recording_line(result.recording, is_replaced)
    elif isinstance(result, NetworkMotion) and result.log is not None:
        replaced = "; it replaced an earlier one" if is_replaced else ""
        yield f"Log: {result.log}  (read it: urmpipe ingest {shell_quote(result.log)}{replaced})"
