"""The plots of a simulation: the signals of each block in each unit, set points with their answers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.delta_verdict import DeltaVerdict
from urmpipe_pipeline.comparison.deviation import AXES, KINDS
from urmpipe_pipeline.comparison.tolerance import allowed_for
from urmpipe_pipeline.comparison.wording import SYMBOLS
from urmpipe_pipeline.palette import AXIS_COLOURS, run_colour
from urmpipe_pipeline.presentation.figure import Figure, Line, Panel, SpaceFigure, View
from urmpipe_pipeline.presentation.parts import ends, within_words
from urmpipe_pipeline.presentation.scene import Path
from urmpipe_pipeline.simulations.signal_groups import Group
from urmpipe_pipeline.simulations.simulation import Signal, Simulation, extremes

DESCRIBED = 8
"""Scalars whose extremes are told to who does not see the figure; of more, the first."""


def signal_figures(simulation: Simulation, groups: Sequence[Group]) -> Iterator[Figure]:
    """Yield a figure a group of signals; nothing without a sample."""
    if not len(simulation.t_ns):
        return
    for group in groups:
        panels = _judged(simulation, group, group.verdict) if group.verdict else _plain(simulation, group)
        described = (_described(one) for one in group.signals[group.wanted :])
        kind = " Grey, dashed: the set point." if group.wanted else ""
        kind = " Dashed: the tolerance; tinted: out of it." if group.verdict else kind
        yield Figure(
            group.variables,
            " ".join(dict.fromkeys(filter(None, described))) + kind,
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


def _plain(simulation: Simulation, group: Group) -> tuple[Panel, ...]:
    """Return the panel of signals that are not judged."""
    lines = tuple(
        Line(signal.columns, names, colours, dashed=k < group.wanted, steps=signal.type != "Real")
        for k, (signal, names, colours) in enumerate(
            zip(group.signals, group.names, group.colours, strict=True)
        )
    )
    unit = group.display_unit
    return (Panel(group.variables, group.unit, lines, simulation.t_ns, share=2.3, display_unit=unit),)


def _judged(simulation: Simulation, group: Group, verdict: DeltaVerdict) -> tuple[Panel, ...]:
    """Return a panel a coordinate and one of the norm, each with what is allowed of it."""
    vectors = [one for one in group.signals if one.columns.shape[1] == 3]
    sizes = [one for one in group.signals if one.columns.shape[1] == 1]
    if len(vectors) + len(sizes) < len(group.signals) or len(vectors) != 1 or len(sizes) > 1:
        return _plain(simulation, group)
    columns = np.column_stack([one.columns for one in (*vectors, *sizes)])
    panels = []
    for axis, values in zip(AXES, columns.T, strict=False):
        kind, symbol = KINDS[axis], SYMBOLS[axis]
        line = Line(values, (symbol,), (AXIS_COLOURS[axis],))
        allowed = allowed_for(axis, kind, verdict.tolerance)
        peaks = (verdict.sample,) if verdict.quantity == axis else ()
        signed = kind == "axis"
        panels.append(Panel(symbol, group.unit, (line,), simulation.t_ns, allowed, signed, peaks, small=True))
    return tuple(panels)


def _instants(simulation: Simulation, verdict: DeltaVerdict | None) -> dict[int, str]:
    """Return when a delta meter decided, and when the simulation failed."""
    found = {} if simulation.failed is None else {int(simulation.t_ns[-1]): "failed"}
    if verdict is not None:
        found[int(simulation.t_ns[verdict.sample])] = f"decides at {text.seconds(verdict.t)} s"
    return found


def _described(one: Signal) -> str:
    """Return the description of a signal as a sentence; nothing without one."""
    return f"{one.variable}: {one.description.rstrip('.')}." if one.description else ""


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
