"""How a simulation shows itself: how it ended, its verdicts, then what each block did."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby

from urmpipe_models.display import format_count
from urmpipe_pipeline import text
from urmpipe_pipeline.comparison.deviation import Verdict
from urmpipe_pipeline.comparison.verdict import (
    DeltaMeterResult,
    absolute_symbol,
    format_delta_meter,
    format_out_of_tolerance,
    format_utilisation,
)
from urmpipe_pipeline.presentation.figure import Drawing, Text
from urmpipe_pipeline.presentation.parts import inputs_table, provenance_table, recording_fact
from urmpipe_pipeline.presentation.section import (
    Block,
    Check,
    Event,
    Fact,
    Judged,
    Level,
    Presentation,
    Ref,
    Section,
    Value,
)
from urmpipe_pipeline.provenance import format_assumptions
from urmpipe_pipeline.simulations.energy import EnergyBalance
from urmpipe_pipeline.simulations.figures import RESIDUAL_CAUSES, energy_figure, path_figure, signal_figures
from urmpipe_pipeline.simulations.scene import simulation_scene
from urmpipe_pipeline.simulations.signal_groups import ANSWERS, Group, answers_of, groups_of
from urmpipe_pipeline.simulations.simulation import Simulation
from urmpipe_pipeline.simulations.tables import (
    blocks_table,
    connections_table,
    first_signals_table,
    meters_table,
    settings_table,
    signals_table,
)

ENERGY = "Energy balance"


def present(simulation: Simulation) -> Presentation:
    """Return what a simulation shows."""
    body = _body(simulation)
    return Presentation(
        name=simulation.name,
        headline=outcome_words(simulation),
        verdict=simulation.verdict,
        facts=tuple(_decisive(simulation)),
        body=body,
        word="simulated",
        opens_at_ns=_opening_time(simulation),
        scene=partial(simulation_scene, simulation),
        lines=(
            {
                "System": Ref(body.title),
                "Verdict": Judged(simulation.verdict),
                "Assuming": "; ".join(simulation.assumptions),
                "Blocks": Value(len(simulation.blocks)),
                "Signals": Value(sum(one.columns.shape[1] for one in simulation.signals)),
                "Samples": Value(len(simulation.t_ns)),
                "Duration": Value(simulation.duration, "s"),
                "Communication step": Value(simulation.step, "s"),
                "Warnings": Value(len(simulation.warnings)),
            },
        ),
        created=simulation.provenance.created,
    )


def outcome_words(simulation: Simulation) -> str:
    """Return how a simulation ended: "delta of log-to-delta out of tolerance", "one-drive: 401 samples"."""
    if simulation.failed is not None:
        return f"{simulation.name} did not reach its end"
    worst = simulation.judged_worst
    if worst is None:
        return f"{simulation.name}: {format_count(len(simulation.t_ns), 'sample')}"
    within = "out of" if worst.out_of_tolerance else "within"
    doubted = ", but in doubt" if worst.caveats and not worst.out_of_tolerance else ""
    assumptions = format_assumptions(simulation.assumptions)
    return f"{worst.block} of {simulation.name} {within} tolerance{doubted}{assumptions}"


def _decisive(simulation: Simulation) -> Iterator[Fact]:
    """Yield why it failed and when, or which delta meter decided."""
    if simulation.failed is not None:
        yield Fact("Why", simulation.failed)
        end = f"t = {text.format_seconds(float(simulation.t[-1]))} s" if len(simulation.t_ns) else "its start"
        yield Fact("Recorded until", end)
    elif (worst := simulation.judged_worst) is not None:
        yield Fact("Decisive block", Ref(worst.block))
        yield Fact("Decided by", format_delta_meter(worst), page=False)
        yield Fact(
            "Decided by",
            ", ".join(filter(None, (absolute_symbol(worst), format_utilisation(worst)))),
            brief=False,
        )


def _opening_time(simulation: Simulation) -> int:
    """Return where the viewer opens in [ns]: at the worst sample; at the end of what failed."""
    worst = simulation.judged_worst
    shown = -1 if simulation.failed is not None else 0 if worst is None else worst.sample
    return int(simulation.t_ns[shown]) if len(simulation.t_ns) else 0


def _body(simulation: Simulation) -> Section:
    failed = simulation.failed
    ended: Verdict = "pass" if failed is None else "fail"
    end = Check("reaches its end", ended, failed or "", kind="simulation-failed")
    return Section(
        f"Simulation {simulation.name}",
        simulation.verdict,
        tuple(_facts(simulation)),
        (*meters_table(simulation), *first_signals_table(simulation)),
        partial(_system, simulation),
        blocks=partial(_page, simulation),
        checks=(end,),
        events=partial(_events, simulation),
        warnings=simulation.warnings,
        notice="" if failed is None else f"Failed: {failed}",
        sections=tuple(_sections(simulation)),
    )


def _meter_facts(one: DeltaMeterResult) -> Iterator[Fact]:
    """Yield what a delta meter found: how much, when, how often it was too much; what is to be doubted.

    A page has the numbers in its table of the delta meters.
    """
    value = Value(one.worst, "m", one.allowed, one.verdict, one.utilisation)
    yield Fact(absolute_symbol(one), value, format_utilisation(one), page=False)
    yield Fact("Time", Value(one.t, "s"), page=False)
    yield Fact("Out of tolerance", format_out_of_tolerance(one.out_of_tolerance, one.samples), page=False)
    yield Fact("In doubt", "; ".join(one.caveats))


def _facts(simulation: Simulation) -> Iterator[Fact]:
    """Yield what decided (a failure, or the worst delta meter), then description, samples and step."""
    if simulation.failed is not None:
        yield Fact("Failed after", Value(simulation.duration, "s"), simulation.failed)
    elif (worst := simulation.judged_worst) is not None:
        yield from (replace(one, brief=False) for one in _meter_facts(worst))
    count = len(simulation.t_ns)
    yield Fact("Description", simulation.description)
    yield Fact("Samples", Value(count))
    yield Fact("Duration", Value(simulation.duration, "s"))
    yield Fact("Communication step", Value(simulation.step, "s"))
    if count > 1 and (period := simulation.duration / (count - 1)) > 1.5 * simulation.step:
        yield Fact("Sample every", Value(period, "s"))
    yield Fact("Blocks", Value(len(simulation.blocks)), brief=False)
    if simulation.energy is not None:
        yield _energy_fact(simulation, simulation.energy)
    yield recording_fact(simulation.recording)


def _energy_fact(simulation: Simulation, balance: EnergyBalance) -> Fact:
    """Return the largest residual of the energy balance; without a value nothing is shown."""
    worst = balance.worst
    if worst is None:
        return Fact(ENERGY, None)
    residual = abs(float(balance.residual[worst]))
    blocks = format_count(len({one.block for one in simulation.signals if one.is_energy}), "block")
    at, share = text.format_seconds(float(simulation.t[worst])), text.format_percent(balance.share(residual))
    words = f"not accounted for: at most {residual:.4g} J at t = {at} s, {share} of the largest energy"
    return Fact(ENERGY, f"{blocks}; {words} supplied, dissipated or stored ({RESIDUAL_CAUSES})")


def _sections(simulation: Simulation) -> Iterator[Section]:
    """Yield set points and answers, the energy balance, then each block; judged blocks rank first."""
    answers, balance = answers_of(simulation), simulation.energy
    by_block = [(block, list(some)) for block, some in groupby(groups_of(simulation), lambda one: one.block)]
    worst = simulation.judged_worst
    opened = worst.block if worst else by_block[0][0] if by_block and not answers else ANSWERS
    if answers:
        yield _section(simulation, ANSWERS, answers, None, opened=opened == ANSWERS)
    if balance is not None:
        yield Section(ENERGY, figures=partial(energy_figure, simulation, balance), rank=1)
    judged = {one.block: one for one in simulation.verdicts}
    by_block += [(block, []) for block in judged if block not in dict(by_block)]
    for block, own in by_block:
        yield _section(simulation, block, own, judged.get(block), opened=block == opened)


def _section(
    simulation: Simulation,
    block: str,
    groups: Sequence[Group],
    meter: DeltaMeterResult | None,
    *,
    opened: bool,
) -> Section:
    """Return what a block, or several like ones, did."""
    figures = partial(signal_figures, simulation, groups)
    if meter is None:
        return Section(block, figures=figures, rank=1, opened=opened)
    fail = meter.verdict == "fail"
    check = Check("within tolerance", meter.verdict, format_delta_meter(meter) if fail else "", block)
    return Section(
        block, meter.verdict, tuple(_meter_facts(meter)), figures=figures, checks=(check,), opened=opened
    )


def _system(simulation: Simulation) -> Iterator[Drawing | Text]:
    """Yield the system as a drawing and as its file."""
    if simulation.system_svg:
        yield Drawing("System", _system_words(simulation), simulation.system_svg)
    if simulation.system_text:
        yield Text("System file", simulation.system_text)


def _page(simulation: Simulation) -> Iterator[Block]:
    """Yield what only a page shows of a simulation: its blocks, its paths, its values."""
    yield blocks_table(simulation)
    yield connections_table(simulation)
    yield from path_figure(simulation)
    yield signals_table(simulation)
    yield settings_table(simulation)
    yield inputs_table("Input files", simulation.provenance.inputs)
    yield provenance_table(simulation.provenance)


def _system_words(simulation: Simulation) -> str:
    """Say what the drawing of a system shows."""
    joined = "; ".join(f"{source} to {into}" for into, source in simulation.connections.items())
    blocks = ", ".join(one.name for one in simulation.blocks)
    return f"The blocks {blocks}" + (f", connected: {joined}." if joined else ".")


def _events(simulation: Simulation) -> Iterator[Event]:
    """Yield what decided each delta meter, what a person should know, and why it failed."""
    for one in simulation.verdicts:
        level: Level = "error" if one.verdict == "fail" else "info"
        yield Event(
            int(simulation.t_ns[one.sample]), f"{one.block} decides: {format_delta_meter(one)}", level
        )
    for warning in simulation.warnings:
        yield Event(None, warning, "warning")
    if simulation.failed is not None:
        at = int(simulation.t_ns[-1]) if len(simulation.t_ns) else None
        yield Event(at, f"failed: {simulation.failed}", "error")
