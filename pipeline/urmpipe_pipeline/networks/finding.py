"""From a network to what is found of it: assembled, its mobility, and what a person should know."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import Any

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, OptionError, format_value, map_collecting_errors
from urmpipe_models.networks.assembly import (
    DEFAULT_RESTARTS,
    MAX_STARTS,
    Assembly,
    AssemblyResult,
    assemble,
    single_assembly,
    start_configuration,
)
from urmpipe_models.networks.continuation import Trace
from urmpipe_models.networks.driving import move_to
from urmpipe_models.networks.file import Network
from urmpipe_models.networks.mechanism import Mechanism, build_mechanism
from urmpipe_models.networks.mobility import Mobility, analyse_mobility, find_blocked_controls
from urmpipe_models.networks.parts import exceeded_limits
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.networks.given_values import parse_start
from urmpipe_pipeline.networks.result import Command, NetworkResult
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.text import format_rounded, format_stated

ROUNDED = 1e-4
"""A gap of less, in lengths of the mechanism and [rad], may come of figures with few digits."""


@dataclass(frozen=True, slots=True)
class Search:
    """How a network is assembled.

    Attributes:
        controls: Values of controls instead of their starts, in the units of the network; texts with
            their own.
        start: Values of joints by name to be near to instead of the network's start, in [rad] and [m];
            texts with their own units, or those of the file.
        every: Whether all assemblies are sought.
        restarts: Random starts in a row without anything new that end the search.
        seed: Of the random starts.
    """

    controls: Mapping[str, float | str]
    start: Mapping[str, Any] = field(default_factory=dict)
    every: bool = False
    restarts: int = DEFAULT_RESTARTS
    seed: int = 0

    def __post_init__(self) -> None:
        faults = [*self._faults()]
        if faults:
            raise OptionError(*faults)

    def _faults(self) -> Iterator[Finding]:
        """Yield which of the values make no sense."""
        for name, value in self.controls.items():
            if isinstance(value, str):  # whose unit the network knows
                continue
            if isinstance(value, bool) or not isinstance(value, Real) or not abs(float(value)) < float("inf"):
                yield Finding(
                    parameter="controls", found=f"{name} = {format_value(value)}", allowed="a finite number"
                )
        for key, count in (("restarts", self.restarts), ("seed", self.seed)):
            if not isinstance(count, Integral) or count < 0:
                yield Finding(parameter=key, found=format_value(count), allowed="a whole number, 0 or more")
            elif key == "restarts" and count > MAX_STARTS:
                yield Finding(parameter=key, found=format_value(count), allowed=f"{MAX_STARTS} at most")


def find_network(
    network: Network,
    command: Command,
    search: Search,
    inputs: Sequence[SourceFile] = (),
    progress: Callable[[float], None] | None = None,
) -> NetworkResult:
    """Return what is found of a network.

    Args:
        network: The network.
        command: check or solve.
        search: How it is assembled.
        inputs: The files that it is from.
        progress: Called with the share that is done, 0..1.

    Raises:
        NetworkError: If a control is not of the network, or its value out of its range.
    """
    mechanism = build_mechanism(network)
    parts: tuple[Callable[[], Any], ...] = (
        lambda: map_collecting_errors(lambda pair: network.control_value(*pair), search.controls.items()),
        lambda: parse_start(network, search.start),
    )
    values, start = map_collecting_errors(lambda make: make(), parts)
    controls = dict(zip(search.controls, values, strict=True))
    found, unreached = _assemble(mechanism, controls, start, search, progress)
    mobility = analyse_mobility(mechanism, found.x_nearest) if found.assemblies else None
    graph = mechanism.graph
    options = {
        "network": network.name, "controls": controls, "start": start or None, "every": search.every,
        "restarts": search.restarts, "seed": search.seed,
    }  # fmt: skip
    return NetworkResult(
        name=network.name,
        network=network,
        command=command,
        structure=graph.structure,
        loops=graph.loops,
        clusters=graph.clusters,
        assemblies=found.assemblies,
        distances=found.distances,
        nearest=found.nearest,
        closure_errors=found.closure_errors,
        mobility=mobility,
        all_solutions=search.every,
        start_count=found.start_count,
        reason=found.reason,
        warnings=(
            *_warnings(mechanism, found, mobility, every=search.every),
            *_limit_warnings(network, found.assemblies),
            *unreached,
        ),
        provenance=build_provenance(f"network {command}", options, inputs),
    )


def _warnings(
    mechanism: Mechanism, found: AssemblyResult, mobility: Mobility | None, *, every: bool
) -> Iterator[LogWarning]:
    """Yield what a person should know of an assembly."""
    if found.elsewhere:
        said = "the start does not close; the assembly nearest to it was found from a random start"
        yield LogWarning("assembled-elsewhere", said)
    if found.closure_errors and all(
        max(gap.metres / mechanism.length, gap.radians) < ROUNDED for gap in found.closure_errors
    ):
        said = "the gap is so small that the network may close if its lengths and directions have more digits"
        yield LogWarning("rounded-figures", said)
    if every and found.continuum:
        said = (
            f"with its controls held the network still moves, with mobility {found.continuum}: its assemblies"
            f" cannot be listed; {format_count(found.continuum, 'more control')} would hold it"
        )
        yield LogWarning("continuum", said)
    if mobility is None:
        return
    if mobility.special:
        said = (
            f"a special configuration: the mobility is {mobility.mobility} here, and {mobility.nearby} at"
            " configurations nearby"
        )
        yield LogWarning("special-configuration", said)
    for name in find_blocked_controls(mechanism, found.x_nearest):
        said = f"control {name} cannot move: there are too many controls, or it is at a dead point"
        yield LogWarning("stuck-control", said)


def _limit_warnings(network: Network, assemblies: Sequence[Assembly]) -> Iterator[LogWarning]:
    """Yield the joints that the first assembly has beyond their limits."""
    for joint in network.joints if assemblies else ():
        values = assemblies[0].values.get(joint.name, ())
        is_coupled = joint.name in network.coupled_joints
        for unit, value, end, limit in exceeded_limits(joint, values, is_coupled=is_coupled):
            words = f"joint {joint.name} is at {format_rounded(value, unit)}, beyond its {end} limit"
            yield LogWarning("beyond-limit", f"{words}, {format_stated(limit, unit)}")


def _assemble(
    mechanism: Mechanism,
    controls: Mapping[str, float],
    start: Mapping[str, tuple[float, ...]],
    search: Search,
    progress: Callable[[float], None] | None,
) -> tuple[AssemblyResult, list[LogWarning]]:
    """Return assemblies, and a warning if the first is of another branch than the start of the network.

    Controls that are away from their start are moved there by continuation, from the assembly at the start.
    Only if no motion leads there, or with start values, the assembly nearest to the start is searched for.
    """
    settings: dict[str, Any] = {"restarts": search.restarts, "seed": search.seed}
    moved = {
        control.name: controls[control.name]
        for control in mechanism.network.controls
        if control.name in controls and controls[control.name] != control.start
    }
    x = start_configuration(mechanism, controls)
    if not (moved and mechanism.rows) or search.every or start:
        found = assemble(
            mechanism, controls, start=start, find_all=search.every, progress=progress, **settings
        )
        return found, []
    first = assemble(mechanism, progress=progress, **settings)
    branch: Trace | None = Trace()
    if first.assemblies and not first.continuum:
        unlimited = np.tile((-np.inf, np.inf), (len(x), 1))
        own = mechanism.controls
        x, branch = move_to(mechanism, first.x_nearest, own, x[own], mechanism.free, unlimited)
    if branch is None or branch.complete:
        return single_assembly(mechanism, x, "a motion from the start leads there"), []
    found = assemble(mechanism, controls, progress=progress, **settings)
    if not found.assemblies or found.continuum:
        return found, []
    at = ", ".join(f"{name} = {value:.6g}" for name, value in moved.items())
    ends = [pose for pose, _ in branch.singular if pose.passage == "turns back"]
    why = ""
    if ends:
        places = [f"{name} = {ends[0].x[mechanism.variable_index[name, 0]]:.6g}" for name in moved]
        why = f": it turns back at {', '.join(places)}"
    message = (
        f"no motion from the start of the network leads to {at}{why}; the assembly is the nearest to the"
        " start, of another branch"
    )
    return found, [LogWarning("other-branch", message, hints=(Hint("every", True, "lists the assemblies"),))]
