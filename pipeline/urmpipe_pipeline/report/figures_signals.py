"""What a co-simulation recorded over time: a figure for the signals of each block in each unit."""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline.report.spec import Figure, Panel, Spec, stacked
from urmpipe_pipeline.report.traces import DASHES, band, instant, label, level, line, stroke
from urmpipe_pipeline.simulations.signal_groups import MOST, Group
from urmpipe_pipeline.simulations.simulation import Signal, Simulation, extremes

SIGNALS_PX = 260
"""Height of the plot of some signals."""

DIGITS = 6
"""Digits after the point of a value in SI under the pointer."""

ENDS_TOLD = 8
"""Scalars whose extremes are told to who does not see the figure; of more, the first."""


def signals_figure(simulation: Simulation, group: Group) -> Figure | None:
    """Return the signals of a group over time, with what is allowed of them; None without a sample."""
    if not len(simulation.t_ns):
        return None
    unit, factor = group.shown
    lines = [one for k in range(len(group.signals)) for one in _lines(simulation, group, k, factor)]
    panel = Panel(label(f"{group.variables} [{unit or '-'}]"), lines, _allowed(group, factor))
    start, end = float(simulation.t[0]), float(simulation.t[-1])
    shapes = [] if simulation.failed is None else [instant(end, "failed", end)]
    spec = stacked([panel], end, shapes)
    spec["layout"]["xaxis"]["range"] = [start, end if end > start else start + 1.0]
    if all(one.type == "Boolean" for one in group.signals):
        spec["layout"]["yaxis"] |= {"range": [-0.1, 1.1], "tickvals": [0, 1]}
    return Figure(
        group.variables,
        " ".join(dict.fromkeys(map(_described, group.signals[group.wanted :]))) + _shading(group),
        f"{group.variables} of {group.block} over time. {_ends(simulation, group)}",
        spec,
        SIGNALS_PX,
    )


def _lines(simulation: Simulation, group: Group, number: int, factor: float) -> list[Spec]:
    """Return a line a scalar of one of a group's signals: stairs of what changes only between steps."""
    signal, unit = group.signals[number], group.shown[0]
    wanted = number < group.wanted
    before = 0 if wanted else sum(one.columns.shape[1] for one in group.signals[group.wanted : number])
    lines = []
    for k, (name, values) in enumerate(zip(group.names[number], signal.columns.T, strict=True)):
        colour = group.colours[number][k]
        look = stroke(colour, DASHES[1] if wanted else DASHES[(before + k) // MOST % len(DASHES)])
        if signal.type != "Real":
            look |= {"shape": "hv"}
        digits = DIGITS if factor == 1.0 else 4
        with np.errstate(over="ignore"):
            drawn = factor * values
        lines.append(
            line(
                simulation.t, drawn, name, colour, label(unit),
                digits=digits, line=look, showlegend=True,
            )
        )  # fmt: skip
    return lines


def _allowed(group: Group, factor: float) -> list[Spec]:
    """Return what the delta meter allows: the inside tinted, its ends as lines."""
    shapes: list[Spec] = []
    for kind, allowed in group.verdict.tolerance.items() if group.verdict is not None else ():
        limit = allowed * factor
        shapes.append(level(limit, f"{limit:.6g}", above=True))
        if kind != "norm":
            shapes += [band(-limit, limit), level(-limit, f"{-limit:.6g}")]
    return shapes


def _shading(group: Group) -> str:
    if group.wanted:
        return " Grey, dashed: the set point."
    return "" if group.verdict is None else " Dashed: what is allowed."


def _described(one: Signal) -> str:
    """Return the description of a signal as a sentence; nothing without one."""
    return f"{one.variable}: {one.description.rstrip('.')}." if one.description else ""


def _ends(simulation: Simulation, group: Group) -> str:
    """Say between which values the first of the scalars stay."""
    unit, factor = group.shown
    scalars = [
        (name, values)
        for one, names in zip(group.signals, group.names, strict=True)
        for name, values in zip(names, one.columns.T, strict=True)
    ]
    said = []
    for name, values in scalars[:ENDS_TOLD]:
        found = extremes(values, simulation.t)
        low, high = found["min"], found["max"]
        if low is not None and high is not None:
            said.append(f"{name} stays within {low * factor:.6g} and {high * factor:.6g} {unit}".rstrip())
    more = len(scalars) - ENDS_TOLD
    return "; ".join(said) + (f"; and {more} more." if more > 0 else ".")
