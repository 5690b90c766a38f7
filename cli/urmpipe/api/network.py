"""`urmpipe.load_network`, `network_check` and `network_solve`: kinematic networks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from urmpipe.keyword_checks import PathLike, public, refuse_warnings
from urmpipe.output_files import guarded_outputs, write_drawing
from urmpipe_models.networks import network_file
from urmpipe_models.networks.assembly import RESTARTS
from urmpipe_models.networks.network import Network
from urmpipe_pipeline.networks.drawing import network_svg
from urmpipe_pipeline.networks.finding import Search, find_network
from urmpipe_pipeline.networks.result import Command, NetworkResult
from urmpipe_pipeline.sources.tables.text import fingerprint

NetworkLike: TypeAlias = PathLike | Mapping[str, Any] | Network
"""A name, a file, the tables of one, or a network."""

SEARCHING = 0.9
"""Share of the work that assembly is where something is written, too."""


@public
def load_network(network: PathLike | Mapping[str, Any]) -> Network:
    """Return a network that urmpipe brings along, of a .toml file, or of such tables. See docs/networks.md.

    Args:
        network: The network's name, its file, or the tables of one, such as {"joints": {"A": {"kind":
            "revolute", "bodies": ["ground", "crank"]}}, "bodies": {"crank": {}}}.

    Raises:
        NetworkError: If there is no such network, or with everything that is wrong with its tables.
    """
    return network_file.load_network(network)


@public
def network_check(
    network: NetworkLike,
    *,
    controls: Mapping[str, float | str] | None = None,
    restarts: int = RESTARTS,
    seed: int = 0,
    strict: bool = False,
    draw: PathLike | None = None,
    output: PathLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> NetworkResult:
    """Assemble a network and find how it moves: its graph, its mobility, and which constraints are redundant.

    Args:
        network: A name, a file, the tables of one, or a `Network`.
        controls: Values of controls instead of their starts, by name: numbers in the units of the network,
            or texts with units, such as "40deg".
        restarts: Random starts that are tried in vain where the network's own start does not close.
        seed: Of the random starts.
        strict: Whether a warning is an error.
        draw: An SVG file to draw the graph and the mechanism to.
        output: The recording (.rrd) to write.
        progress: Called with the share that is done, 0..1.

    Returns:
        `mobility` (None if it does not close: then `gaps`), `assemblies`, `loops`, `clusters`, `warnings`.

    Raises:
        UrmpipeError: With everything that is wrong with the network, an option or an output.

    Source: [KinematicSystems]_ section 3.
    """
    search = Search(controls or {}, False, restarts, seed)
    return _found(network, "check", search, strict, draw, output, progress)


@public
def network_solve(
    network: NetworkLike,
    *,
    controls: Mapping[str, float | str] | None = None,
    every: bool = False,
    restarts: int = RESTARTS,
    seed: int = 0,
    strict: bool = False,
    draw: PathLike | None = None,
    output: PathLike | None = None,
    progress: Callable[[float], None] | None = None,
) -> NetworkResult:
    """Assemble a network with its controls held: nearest to its start, or in every way there is.

    A warning says if controls are away from their start: the nearest assembly may then be of another branch
    than a motion from the start reaches.

    Args:
        network: A name, a file, the tables of one, or a `Network`.
        controls: Values of controls instead of their starts, by name: numbers in the units of the network,
            or texts with units, such as "40deg".
        every: Find all assemblies, by random starts.
        restarts: Random starts in a row without anything new that end the search.
        seed: Of the random starts: the same seed, the same assemblies.
        strict: Whether a warning is an error.
        draw: An SVG file to draw the graph and the assemblies to.
        output: The recording (.rrd) to write; further assemblies are ghosts in it.
        progress: Called with the share that is done, 0..1.

    Returns:
        `assemblies`, each with its `values` by name in [m] and [rad], `residual` and `mobility`; `reason`;
        `gaps` where nothing closes.

    Raises:
        UrmpipeError: With everything that is wrong with the network, an option or an output.

    Source: [KinematicSystems]_ section 3.
    """
    search = Search(controls or {}, every, restarts, seed)
    return _found(network, "solve", search, strict, draw, output, progress)


def _found(
    network: NetworkLike,
    command: Command,
    search: Search,
    strict: bool,
    draw: PathLike | None,
    output: PathLike | None,
    progress: Callable[[float], None] | None,
) -> NetworkResult:
    """Return what is found of a network, and write what was requested."""
    loaded = network if isinstance(network, Network) else network_file.load_network(network)
    named = [Path(network)] if isinstance(network, (str, Path)) else []
    files = [path for path in named if path.suffix.lower() == ".toml"]
    tell = progress or (lambda share: None)
    with guarded_outputs({"recording": output, "drawing": draw}, files) as written:
        inputs = [fingerprint(path) for path in files]
        found = find_network(loaded, command, search, inputs, lambda share: tell(SEARCHING * share))
        refuse_warnings(strict, found.warnings)
        written.write("drawing", lambda part, path: write_drawing(part, network_svg(found)))
        return written.recorded(found, lambda share: tell(SEARCHING + (1.0 - SEARCHING) * share))
