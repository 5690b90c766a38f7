"""`urmpipe network list|check|solve`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.options.grouped import Command, with_options
from urmpipe.options.named import NamedType, control_names, named_values
from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import STRICT_OPTION
from urmpipe.options.types import DRAWING, NETWORK, WholeType
from urmpipe.usage import Group

if TYPE_CHECKING:
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
    from urmpipe.printing.network import networks_dict, print_networks
    from urmpipe_models.networks.network_file import load_network, network_names

    networks = [load_network(name) for name in network_names()]
    terminal.answer(lambda: networks_dict(networks), lambda: print_networks(networks))
    return 0


def _search_options(command: Command) -> Command:
    """Add how a network is assembled, and what is written of it."""
    return with_options(
        command,
        click.option(
            "--controls",
            "--set",
            type=NamedType(control_names),
            multiple=True,
            callback=named_values,
            metavar="CONTROL=VALUE",
            help="Value of a control, such as crank=40deg; a number alone is in the units of the network's"
            " file [default: its start value].",
        ),
        click.option(
            "--restarts",
            type=WholeType(),
            default=2000,
            show_default=True,
            help="End the search after this many random starts without a new assembly.",
        ),
        click.option(
            "--seed", type=WholeType(), default=0, show_default=True, help="Seed of the random starts."
        ),
        click.option(
            "--draw",
            metavar="FILE.svg",
            type=DRAWING,
            help="Draw the graph and the mechanism.",
        ),
        output_option("RUN.rrd", "Recording to write."),
        STRICT_OPTION,
    )


@network.command(short_help="Assemble a network and compute its mobility.")
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


@network.command(short_help="Find configurations in which a network closes.")
@click.argument("name", metavar="NAME|FILE", type=NETWORK)
@click.option("--every", "--all", is_flag=True, help="Find all assemblies, and record each as a ghost.")
@_search_options
@output_options
def solve(name: str, output: Path | None, terminal: Terminal, **options: Any) -> int:
    """Find the configuration nearest to the start in which a network closes, or with --all every one.

    Controls keep their values. The search begins at the start, and goes on at random places nearer to the
    start than what it found; if the start does not close, anywhere. With --all it ends after --restarts
    random starts without a new assembly. Away from the start of a control, the nearest assembly may be of
    another branch than a motion from the start reaches.

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


def _answered(result: NetworkResult, terminal: Terminal, replaces: bool) -> int:
    """Print what was found, and return the exit code."""
    terminal.warn(result.warnings)
    terminal.answer(lambda: result.to_dict("command line"), lambda: _print(result, replaces))
    return 0 if result.verdict == "pass" else 1


def _print(result: NetworkResult, replaces: bool) -> None:
    """Print what was found, and what was written."""
    from urmpipe.printing.presentation import print_presentation
    from urmpipe.printing.terminal import print_recording
    from urmpipe_pipeline.results import present

    print_presentation(present(result))
    if result.recording is not None:
        print_recording(result.recording, replaced=replaces)
