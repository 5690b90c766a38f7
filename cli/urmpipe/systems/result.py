"""A co-simulation's arrays with their names: signals, settings, arms and verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from urmpipe.systems.blocks import CHAIN, METER, Blocks
from urmpipe_fmus.build.fmu import read_robot_entry
from urmpipe_fmus.cosim.checks import ELEMENT, Interface
from urmpipe_fmus.cosim.plan import NANOSECOND, Plan
from urmpipe_fmus.cosim.simulation import CosimulationRecord, NonFiniteValues
from urmpipe_fmus.cosim.system import Block, Port, System
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_models.measure_units import readings
from urmpipe_models.toml_tables import quote_toml
from urmpipe_pipeline.comparison.verdict import DeltaVerdict, delta_verdict
from urmpipe_pipeline.joint_log import LogWarning, SourceFile
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.simulations.coupling import coupling_warnings
from urmpipe_pipeline.simulations.simulation import Arm, Setting, Signal, SimulatedBlock, Simulation
from urmpipe_pipeline.sources.tables.text import fingerprint

TOLERANCE = "tolerance"
"""The parameter of a delta meter that its verdict rests on."""


def check_meters(plan: Plan, blocks: Blocks) -> None:
    """Refuse what delta meters cannot judge by, before the first step.

    Raises:
        OptionError: If one has no tolerance, or one whose unit is unclear.
        LogError: With each reading of a log that has to be told before a verdict rests on it.
    """
    meters = list(_meters(plan.system))
    wrong = [name for name in meters if not _value(plan, Port(name, TOLERANCE)) > 0.0]
    faults = [f"block {name}: tolerance: found 0, allowed: above 0, in m" for name in wrong]
    for block in plan.system.blocks:
        given = str(block.start.get(TOLERANCE, ""))
        if block.name in meters and (both := readings(given, "m")):
            allowed = f"a unit: {' or '.join(map(quote_toml, both))}"
            faults.append(f"block {block.name}: tolerance: found {given}, allowed: {allowed}")
    if faults:
        raise OptionError(*faults)
    asked = [one.as_finding() for one in blocks.warnings if one.asks]
    if meters and asked:
        raise LogError(*asked)


def simulation_of(plan: Plan, recorded: CosimulationRecord, blocks: Blocks, svg: str) -> Simulation:
    """Return what was recorded as a simulation.

    Args:
        plan: The system as it was run.
        recorded: Its arrays.
        blocks: What the blocks were made of.
        svg: The system as a drawing.
    """
    system = plan.system
    odd = _not_finite(plan, recorded)
    notes = (LogWarning("co-simulation", note) for note in (*recorded.notes, *_unjudged(system)))
    given = {
        "system": system.name,
        "arguments": dict(system.arguments),
        "step": plan.step,
        "duration": plan.count * plan.step,
    }
    made = Simulation(
        name=system.name,
        description=system.description,
        t_ns=recorded.t_ns,
        step=plan.step,
        signals=tuple(_signals(plan, recorded)),
        system_svg=svg,
        system_text=system.path.read_text(encoding="utf-8-sig"),
        blocks=tuple(_block(plan, one) for one in system.blocks),
        failed=recorded.failed,
        warnings=(*blocks.warnings, *blocks.between_samples(plan.step, plan.count), *notes, *_told(odd)),
        provenance=build_provenance("simulate", given, _inputs([system.path, *blocks.files])),
        connections={str(one.connection.destination): str(one.connection.source) for one in plan.links},
        arms=tuple(_arms(plan, recorded, blocks)),
        verdicts=tuple(_verdicts(plan, recorded, odd)),
        loop_seconds=recorded.loop_seconds,
    )
    return replace(made, warnings=(*made.warnings, *coupling_warnings(made)))


def _unjudged(system: System) -> Iterator[str]:
    """Yield what a verdict does not see: a delta meter is judged by what is recorded of it."""
    if system.record_every > 1:
        every = f"one communication point in {system.record_every} (system.record_every)"
        yield from (f"block {name}: the verdict covers {every}" for name in _meters(system))


def _inputs(paths: list[Path]) -> list[SourceFile]:
    """Return the files that a simulation came from, each once."""
    return [fingerprint(path) for path in dict.fromkeys(paths)]


def _not_finite(plan: Plan, recorded: CosimulationRecord) -> dict[Port, NonFiniteValues]:
    """Return the variables that had values which are not finite: of an array the first and all of them."""
    places = {port: i for i, port in enumerate(recorded.names)}
    found: dict[Port, list[NonFiniteValues]] = {}
    for port, one in recorded.not_finite.items():
        _, variable = _array(plan.interfaces[port.block], port, places)
        found.setdefault(Port(port.block, variable), []).append(one)
    return {
        port: replace(min(those, key=lambda one: one.t), count=sum(one.count for one in those))
        for port, those in found.items()
    }


def _told(odd: Mapping[Port, NonFiniteValues]) -> Iterator[LogWarning]:
    """Yield which outputs were not finite, a line each."""
    for port, one in odd.items():
        said = f"found {one.value:g} at t = {one.t:.9g} s; values that are not finite: {one.count}"
        yield LogWarning("not-finite", said, about=port.block, column=port.variable)


def _signals(plan: Plan, recorded: CosimulationRecord) -> Iterator[Signal]:
    """Yield the signals: scalars, and arrays whose elements were all recorded."""
    places = {port: i for i, port in enumerate(recorded.names)}
    done: set[Port] = set()
    for port in recorded.names:
        if port in done:
            continue
        ports, name = _array(plan.interfaces[port.block], port, places)
        done.update(ports)
        columns = recorded.values[:, [places[one] for one in ports]]
        yield Signal(
            block=port.block,
            variable=name,
            values=columns if name != port.variable else columns[:, 0],
            unit=recorded.units[places[port]],
            type=recorded.types[places[port]],  # type: ignore[arg-type]
            **_described(plan.interfaces[port.block], name),
        )


def _array(shown: Interface, port: Port, places: Mapping[Port, int]) -> tuple[list[Port], str]:
    """Return the elements of the array that a recorded scalar is of, and its name; else the scalar."""
    match = ELEMENT.fullmatch(port.variable)
    elements = shown.arrays.get(match[1], ()) if match else ()
    ports = [Port(port.block, one.name) for one in elements]
    whole = match is not None and [f"{match[1]}[{i + 1}]" for i in range(len(ports))] == [
        one.variable for one in ports
    ]
    if match is None or not whole or any(one not in places for one in ports):
        return [port], port.variable
    kinds = {(one.type, one.unit) for one in elements}
    return (ports, match[1]) if len(kinds) == 1 else ([port], port.variable)


def _described(shown: Interface, variable: str) -> dict[str, str]:
    """Return description and display unit of a variable, or of an array by its first element."""
    found = shown.elements(variable)[0]
    return {"description": found.description, "display_unit": found.display_unit}


def _block(plan: Plan, block: Block) -> SimulatedBlock:
    """Return what is to be known of a block."""
    shown = plan.interfaces[block.name]
    return SimulatedBlock(
        name=block.name,
        kind="fmu" if block.fmu else "file" if block.file else "unit",
        source=block.kind,
        content=shown.guid,
        settings=tuple(_settings(plan, block.name, shown)),
        description=shown.description,
    )


def _settings(plan: Plan, block: str, shown: Interface) -> Iterator[Setting]:
    """Yield what the parameters, states and unconnected inputs of a block had before the first step."""
    given = {one.variable.name: one.value for one in plan.starts[block]}
    fed = {*plan.sources, *plan.logged}
    for one in shown.variables.values():
        value = given.get(one.name, one.start)
        if (
            one.is_settable
            and value is not None
            and one.type != "String"
            and Port(block, one.name) not in fed
        ):
            yield Setting(one.name, _number(value), one.unit, one.causality, one.name in given)


def _number(value: float | str) -> float:
    """Return a start value, as an FMU spells it or as it was given, as a number."""
    return float({"true": 1.0, "false": 0.0}.get(value, value) if isinstance(value, str) else value)


def _value(plan: Plan, port: Port) -> float:
    """Return what a scalar has before the first step."""
    given = {one.variable.name: one.value for one in plan.starts[port.block]}
    start = plan.variable(port).start
    return _number(given.get(port.variable, 0.0 if start is None else start))


def _arms(plan: Plan, recorded: CosimulationRecord, blocks: Blocks) -> Iterator[Arm]:
    """Yield the arm of each block of kinematics, as its joints were: of a unit, or of an FMU of that unit."""
    for block in plan.system.blocks:
        chain = read_robot_entry(block.fmu) if block.fmu else blocks.chains.get(block.name)
        if chain is None or not (block.fmu or block.unit == CHAIN):
            continue
        ports = [Port(block.name, one) for one in _joint_inputs(chain)]
        inputs = {one.name for one in plan.interfaces[block.name].inputs}
        if {one.variable for one in ports} <= inputs:  # an FMU of another unit computes its joints
            yield Arm(block.name, chain, np.column_stack([_over_time(plan, recorded, one) for one in ports]))


def _joint_inputs(chain: Chain) -> Iterator[str]:
    """Yield the input of `kinematic_chain` for each joint of an arm."""
    counts = {"revolute": 0, "prismatic": 0}
    for joint in chain.moving:
        counts[joint.kind] += 1
        yield f"{'phi' if joint.kind == 'revolute' else 's'}[{counts[joint.kind]}]"


def _over_time(plan: Plan, recorded: CosimulationRecord, destination: Port) -> FloatArray:
    """Return what an input had at each sample, shape (n,): its source, its log, or its start value."""
    port = plan.sources.get(destination, destination)
    if port in recorded.names:
        return recorded.values[:, recorded.names.index(port)]
    return np.full(len(recorded.t_ns), _value(plan, destination))


def _meters(system: System) -> list[str]:
    """Return the names of the delta meters."""
    return [block.name for block in system.blocks if block.unit == METER]


def _verdicts(
    plan: Plan, recorded: CosimulationRecord, odd: Mapping[Port, NonFiniteValues]
) -> Iterator[DeltaVerdict]:
    """Yield the verdict of each delta meter."""
    for name in _meters(plan.system) if len(recorded.t_ns) else ():
        columns = [recorded.column(name, f"delta[{i}]") for i in (1, 2, 3)]
        tolerance = {"axis": _value(plan, Port(name, TOLERANCE))}
        doubts = tuple(_doubts(plan, recorded, odd, name))
        found = delta_verdict(name, recorded.t_ns, np.column_stack(columns), tolerance, doubts)
        if found is not None:
            yield found


def _doubts(
    plan: Plan, recorded: CosimulationRecord, odd: Mapping[Port, NonFiniteValues], meter: str
) -> Iterator[str]:
    """Yield why a delta meter does not pass even where no sample is out of tolerance.

    What is not finite may have reached it through any block before it, which need not show it: an FMU may
    clip it, or keep it as a state of its own.
    """
    every = plan.system.record_every
    last, end = float(recorded.t_ns[-1]) * 1e-9, plan.count // every * every * plan.step
    if end - last > NANOSECOND:
        yield f"the run ended at t = {last:.9g} s instead of {end:.9g} s"
    before = _before(plan, meter)
    for port, one in odd.items():
        if port.block in before:
            yield f"{port} was {one.value:g} at t = {one.t:.9g} s, and {meter} depends on {port.block}"


def _before(plan: Plan, block: str) -> set[str]:
    """Return the blocks on whose outputs a block depends, directly or through others, and itself."""
    found: set[str] = set()
    new = {block}
    while new:
        found |= new
        new = {source.block for into, source in plan.sources.items() if into.block in new} - found
    return found
