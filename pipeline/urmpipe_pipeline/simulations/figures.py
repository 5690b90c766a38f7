"""The plots of a simulation: the signals of each block in each unit, set points with their answers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import AXES, KINDS
from urmpipe_pipeline.comparison.verdict import SYMBOLS, DeltaMeterResult, tolerance_for
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, SpaceFigure, View
from urmpipe_pipeline.presentation.palette import AXIS_COLOURS, JOINT_COLOURS, run_colour
from urmpipe_pipeline.presentation.parts import ends, within_words
from urmpipe_pipeline.presentation.scene import Path
from urmpipe_pipeline.simulations.energy import EnergyBalance
from urmpipe_pipeline.simulations.limits import limits_of
from urmpipe_pipeline.simulations.signal_groups import Group, array_name, shortened
from urmpipe_pipeline.simulations.simulation import Signal, Simulation, extremes

DESCRIBED = 8
"""Scalars whose extremes are told to who does not see the figure; of more, the first."""


RESIDUAL_CAUSES = "coupling of the blocks, or a block without energies"
"""Where energy that a balance does not account for comes from."""


def signal_figures(simulation: Simulation, groups: Sequence[Group]) -> Iterator[Figure]:
    """Yield a figure a group of signals; nothing without a sample."""
    if not len(simulation.t_ns):
        return
    known = limits_of(simulation)
    for group in groups:
        limits = {} if group.wanted or group.verdict else known
        judged = _judged(simulation, group, group.verdict) if group.verdict else ()
        panels = judged or _plain(simulation, group, limits)
        yield Figure(
            group.variables,
            _caption(group, limits),
            f"{group.variables} of {group.block} over time. {_extremes_words(simulation, group)}",
            (View(group.variables, panels),),
            _instants(simulation, group.verdict),
        )


def path_figure(simulation: Simulation) -> Iterator[SpaceFigure]:
    """Yield the path of the tip of each arm in space; nothing without an arm that moved."""
    paths = tip_paths(simulation)
    known = [path.position[np.isfinite(path.position).all(axis=1)] for path in paths]
    every = np.concatenate([np.empty((0, 3)), *known])
    if not len(every):
        return
    names = ", ".join(path.name for path in paths)
    yield SpaceFigure(
        "Path in space",
        "The tip of each arm, equal scale on all axes.",
        f"Path of {names} in three dimensions, {within_words(every)}.",
        paths,
        ends(known[0] if len(known[0]) else every),
    )


def energy_figure(simulation: Simulation, balance: EnergyBalance) -> Iterator[Figure]:
    """Yield the energies of all blocks together and their residual; nothing without a sample."""
    if not len(simulation.t_ns):
        return
    blocks = ", ".join(dict.fromkeys(one.block for one in simulation.signals if one.is_energy))
    names = ("supplied", "dissipated", "change of stored")
    energies = np.column_stack((balance.supplied, balance.dissipated, balance.stored))
    line = Line(energies, names, JOINT_COLOURS[:3])
    rest = Line(balance.residual, ("residual",), (JOINT_COLOURS[3],))
    peaks = () if balance.worst is None else (balance.worst,)
    ends = ", ".join(f"{name} {value:.6g} J" for name, value in zip(names, energies[-1], strict=True))
    yield Figure(
        "Energies and residual",
        f"Sums over {blocks} since the first sample: work done on the system from outside, losses, and change"
        " of the stored energy. Residual = supplied - dissipated - change of stored: what they do not account"
        f" ({RESIDUAL_CAUSES}). A diamond marks the largest.",
        f"Energies over time, at the end: {ends}, residual {balance.residual[-1]:.6g} J.",
        (
            View("Energies", (Panel("energy", "J", (line,), simulation.t_ns, share=2.0),)),
            View("Residual", (Panel("residual", "J", (rest,), simulation.t_ns, peaks=peaks),)),
        ),
        _instants(simulation, None),
        opened=None,
    )


def tip_paths(simulation: Simulation) -> tuple[Path, ...]:
    """Return where the tip of each arm was."""
    several = len(simulation.arms) > 1
    return tuple(
        Path(
            arm.block, positions_over_log(arm.chain, arm.q), simulation.t_ns, run_colour(i),
            label=arm.block if several else "", kept=kept_rows(simulation),
        )
        for i, arm in enumerate(simulation.arms)
    )  # fmt: skip


def kept_rows(simulation: Simulation) -> tuple[int, ...]:
    """Return the sample of the worst verdict, if there is one."""
    worst = simulation.judged_worst
    return () if worst is None else (worst.sample,)


def _plain(simulation: Simulation, group: Group, limits: Mapping[str, float]) -> tuple[Panel, ...]:
    """Return a panel a limit of signals that are not judged; those without a limit share one."""
    found: dict[float | None, list[Line]] = {}
    for k, (signal, names, colours) in enumerate(zip(group.signals, group.names, group.colours, strict=True)):
        for limit, own in _by_limit(signal, limits).items():
            columns = signal.columns if len(own) == len(names) else signal.columns[:, own]
            looks = tuple(names[i] for i in own), tuple(colours[i] for i in own)
            line = Line(columns, *looks, dashed=k < group.wanted, steps=signal.type != "Real")
            found.setdefault(limit, []).append(line)
    panels = []
    for limit, lines in found.items():
        drawn = shortened([name for line in lines for name in line.names])
        title, share = (group.variables, 2.3) if len(found) == 1 else (drawn, 1.0)
        panels.append(
            Panel(
                title, group.unit, tuple(lines), simulation.t_ns, limit, share=share,
                display_unit=group.display_unit, limit_name=f"limit of {title}",
            )
        )  # fmt: skip
    return tuple(panels)


def _by_limit(signal: Signal, limits: Mapping[str, float]) -> dict[float | None, list[int]]:
    """Return the columns of a signal that have the same limit, by it; None of those without."""
    found: dict[float | None, list[int]] = {}
    for i, name in enumerate(signal.names):
        found.setdefault(limits.get(name), []).append(i)
    return found


def _judged(simulation: Simulation, group: Group, verdict: DeltaMeterResult) -> tuple[Panel, ...]:
    """Return a panel a coordinate and one of the norm, each with its limit; none of another shape."""
    vectors = [one for one in group.signals if one.columns.shape[1] == 3]
    sizes = [one for one in group.signals if one.columns.shape[1] == 1]
    if len(vectors) + len(sizes) < len(group.signals) or len(vectors) != 1 or len(sizes) > 1:
        return ()
    columns = np.column_stack([one.columns for one in (*vectors, *sizes)])
    panels = []
    for axis, values in zip(AXES, columns.T, strict=False):
        kind, symbol = KINDS[axis], SYMBOLS[axis]
        line = Line(values, (symbol,), (AXIS_COLOURS[axis],))
        allowed = tolerance_for(axis, kind, verdict.tolerance)
        peaks = (verdict.sample,) if verdict.quantity == axis else ()
        signed = kind == "axis"
        panels.append(Panel(symbol, group.unit, (line,), simulation.t_ns, allowed, signed, peaks, small=True))
    return tuple(panels)


def _instants(simulation: Simulation, verdict: DeltaMeterResult | None) -> dict[int, str]:
    """Return when a delta meter decided, and when the simulation failed."""
    found = {} if simulation.failed is None else {int(simulation.t_ns[-1]): "failed"}
    if verdict is not None:
        found[int(simulation.t_ns[verdict.sample])] = f"decides at {text.format_seconds(verdict.t)} s"
    return found


def _caption(group: Group, limits: Mapping[str, float]) -> str:
    """Describe the signals of a group, and say what is drawn besides them."""
    words = [_described(one) for one in group.signals[group.wanted :]]
    words.append("Grey, dashed: the set point." if group.wanted else "")
    words.append("Dashed: the tolerance; tinted: out of it." if group.verdict else "")
    words.append(_limit_words(group, limits))
    return " ".join(dict.fromkeys(filter(None, words)))


def _limit_words(group: Group, limits: Mapping[str, float]) -> str:
    """Say which limits are drawn; nothing without one."""
    unit, factor = group.shown
    found: dict[str, dict[str, None]] = {}
    for signal in group.signals:
        own = {f"{limits[name] * factor:.6g}": None for name in signal.names if name in limits}
        found.setdefault(signal.variable, {}).update(own)
    words = [
        f"the limit of |{variable}|, {f'{text.join_list(list(values))} {unit}'.rstrip()}"
        for variable, values in found.items()
        if values
    ]
    return f"Dashed: {text.join_list(words)}; tinted: beyond it." if words else ""


def _described(one: Signal) -> str:
    """Return the description of a signal as a sentence; nothing without one."""
    return f"{array_name(one.variable)}: {one.description.rstrip('.')}." if one.description else ""


def _extremes_words(simulation: Simulation, group: Group) -> str:
    """Say between which values the first of the scalars stay."""
    unit, factor = group.shown
    scalars = [
        (name, values)
        for one, names in zip(group.signals, group.names, strict=True)
        for name, values in zip(names, one.columns.T, strict=True)
    ]
    said = []
    for name, values in scalars[:DESCRIBED]:
        found = extremes(values, simulation.t)
        low, high = found["min"], found["max"]
        if low is not None and high is not None:
            said.append(f"{name} stays within {low * factor:.6g} and {high * factor:.6g} {unit}".rstrip())
    more = len(scalars) - DESCRIBED
    return "; ".join(said) + (f"; and {more} more." if more > 0 else ".")
