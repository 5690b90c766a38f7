"""The result of a co-simulation: what was recorded, with names, units, robots and verdicts.

1. Check: delta meters need a tolerance, and logs without open questions, before the first step.
2. Signals: scalars, and arrays whose elements were all recorded.
3. Blocks: the values of parameters, states and unconnected inputs before the first step.
4. Robots: the joints of each block of kinematics over time.
5. Verdicts: of each delta meter; values that are not finite in blocks before it make it uncertain.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

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
from urmpipe_pipeline.comparison.verdict import DeltaMeterResult, judge_delta_meter
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.logs.formats.text import fingerprint
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.simulations.coupling import coupling_warnings
from urmpipe_pipeline.simulations.simulation import Setting, Signal, SimulatedArm, SimulatedBlock, Simulation

TOLERANCE = "tolerance"  # parameter of a delta meter that its verdict depends on


def check_meters(plan: Plan, blocks: Blocks) -> None:
    """Raise an error if delta meters cannot judge, before the first step.

    Raises:
        OptionError: If one has no tolerance, or one whose unit is unclear.
        LogError: With each reading of a log that must be stated before a verdict depends on it.
    """
    meters = _meter_names(plan.system)
    faults = [
        f"block {name}: tolerance: found 0, allowed: above 0, in m"
        for name in meters
        if not _start_value(plan, Port(name, TOLERANCE)) > 0.0
    ]
    for block in plan.system.blocks:
        start = str(block.start.get(TOLERANCE, ""))
        if block.name in meters and (both := readings(start, "m")):
            allowed = f"a unit: {' or '.join(map(quote_toml, both))}"
            faults.append(f"block {block.name}: tolerance: found {start}, allowed: {allowed}")
    if faults:
        raise OptionError(*faults)
    questions = [warning.as_finding() for warning in blocks.warnings if warning.blocks_verdict]
    if meters and questions:
        raise LogError(*questions)


def _meter_names(system: System) -> list[str]:
    return [block.name for block in system.blocks if block.unit == METER]


def simulation_of(plan: Plan, recorded: CosimulationRecord, blocks: Blocks, svg: str) -> Simulation:
    """Return a recorded co-simulation as a result.

    Args:
        plan: The system as it was run.
        recorded: Its arrays.
        blocks: Its units, robots and logs.
        svg: The system as a drawing.
    """
    system = plan.system
    non_finite = _merge_arrays(plan, recorded)
    options = {
        "system": system.name,
        "arguments": dict(system.arguments),
        "step": plan.step,
        "duration": plan.count * plan.step,
    }
    files = dict.fromkeys([system.path, *blocks.files])
    result = Simulation(
        name=system.name,
        description=system.description,
        t_ns=recorded.t_ns,
        step=plan.step,
        signals=tuple(_iter_signals(plan, recorded)),
        system_svg=svg,
        system_text=system.path.read_text(encoding="utf-8-sig"),
        blocks=tuple(_describe_block(plan, block) for block in system.blocks),
        failed=recorded.failed,
        warnings=(
            *blocks.warnings,
            *blocks.hold_warnings(plan.step, plan.count),
            *(LogWarning("co-simulation", note) for note in recorded.notes),
            *_coverage_warnings(system),
            *_non_finite_warnings(non_finite),
        ),
        provenance=build_provenance("simulate", options, [fingerprint(path) for path in files]),
        connections={str(link.connection.destination): str(link.connection.source) for link in plan.links},
        arms=tuple(_iter_robots(plan, recorded, blocks)),
        verdicts=tuple(_iter_verdicts(plan, recorded, non_finite)),
        loop_seconds=recorded.loop_seconds,
    )
    return replace(result, warnings=(*result.warnings, *coupling_warnings(result)))


def _coverage_warnings(system: System) -> Iterator[LogWarning]:
    """Yield a warning for each delta meter of which not every communication point is recorded."""
    if system.record_every > 1:
        every = f"one communication point in {system.record_every} (system.record_every)"
        for name in _meter_names(system):
            yield LogWarning("co-simulation", f"block {name}: the verdict covers {every}")


def _non_finite_warnings(non_finite: Mapping[Port, NonFiniteValues]) -> Iterator[LogWarning]:
    for port, values in non_finite.items():
        message = (
            f"found {values.value:g} at t = {values.t:.9g} s; values that are not finite: {values.count}"
        )
        yield LogWarning("not-finite", message, about=port.block, column=port.variable)


def _merge_arrays(plan: Plan, recorded: CosimulationRecord) -> dict[Port, NonFiniteValues]:
    """Return the variables with values that are not finite; of an array the first value and the sum."""
    columns = {port: i for i, port in enumerate(recorded.names)}
    elements: dict[Port, list[NonFiniteValues]] = {}
    for port, values in recorded.not_finite.items():
        _, variable = _find_array(plan.interfaces[port.block], port, columns)
        elements.setdefault(Port(port.block, variable), []).append(values)
    return {
        port: replace(min(parts, key=lambda part: part.t), count=sum(part.count for part in parts))
        for port, parts in elements.items()
    }


def _iter_signals(plan: Plan, recorded: CosimulationRecord) -> Iterator[Signal]:
    """Yield the signals: scalars, and arrays whose elements were all recorded."""
    columns = {port: i for i, port in enumerate(recorded.names)}
    done: set[Port] = set()
    for port in recorded.names:
        if port in done:
            continue
        interface = plan.interfaces[port.block]
        ports, name = _find_array(interface, port, columns)
        done.update(ports)
        values = recorded.values[:, [columns[element] for element in ports]]
        first = interface.elements(name)[0]
        yield Signal(
            block=port.block,
            variable=name,
            values=values if name != port.variable else values[:, 0],
            unit=recorded.units[columns[port]],
            type=recorded.types[columns[port]],  # type: ignore[arg-type]
            description=first.description,
            display_unit=first.display_unit,
        )


def _find_array(interface: Interface, port: Port, columns: Mapping[Port, int]) -> tuple[list[Port], str]:
    """Return the elements and the name of the array that a recorded scalar belongs to; else the scalar."""
    match = ELEMENT.fullmatch(port.variable)
    elements = interface.arrays.get(match[1], ()) if match else ()
    ports = [Port(port.block, element.name) for element in elements]
    if match is None or [element.variable for element in ports] != [
        f"{match[1]}[{i + 1}]" for i in range(len(ports))
    ]:
        return [port], port.variable
    kinds = {(element.type, element.unit) for element in elements}
    if len(kinds) != 1 or any(element not in columns for element in ports):
        return [port], port.variable
    return ports, match[1]


def _describe_block(plan: Plan, block: Block) -> SimulatedBlock:
    interface = plan.interfaces[block.name]
    return SimulatedBlock(
        name=block.name,
        kind="fmu" if block.fmu else "file" if block.file else "unit",
        source=block.kind,
        content=interface.guid,
        settings=tuple(_iter_settings(plan, block.name, interface)),
        description=interface.description,
    )


def _iter_settings(plan: Plan, block: str, interface: Interface) -> Iterator[Setting]:
    """Yield the values of parameters, states and unconnected inputs of a block before the first step."""
    starts = {start.variable.name: start.value for start in plan.starts[block]}
    connected = {*plan.sources, *plan.logged}
    for variable in interface.variables.values():
        value = starts.get(variable.name, variable.start)
        is_free = variable.is_settable and Port(block, variable.name) not in connected
        if is_free and value is not None and variable.type != "String":
            is_set = variable.name in starts
            yield Setting(variable.name, _parse_number(value), variable.unit, variable.causality, is_set)


def _parse_number(value: float | str) -> float:
    """Return a start value, as an FMU spells it or as a number."""
    return float({"true": 1.0, "false": 0.0}.get(value, value) if isinstance(value, str) else value)


def _start_value(plan: Plan, port: Port) -> float:
    """Return the value of a scalar before the first step."""
    starts = {start.variable.name: start.value for start in plan.starts[port.block]}
    default = plan.variable(port).start
    return _parse_number(starts.get(port.variable, 0.0 if default is None else default))


def _iter_robots(plan: Plan, recorded: CosimulationRecord, blocks: Blocks) -> Iterator[SimulatedArm]:
    """Yield the robot of each block of kinematics with its joints: of a unit, or of an FMU of that unit."""
    for block in plan.system.blocks:
        chain = read_robot_entry(block.fmu) if block.fmu else blocks.chains.get(block.name)
        if chain is None or not (block.fmu or block.unit == CHAIN):
            continue
        ports = [Port(block.name, variable) for variable in _iter_joint_inputs(chain)]
        inputs = {variable.name for variable in plan.interfaces[block.name].inputs}
        if {port.variable for port in ports} <= inputs:  # an FMU of another unit computes its joints
            columns = [_input_values(plan, recorded, port) for port in ports]
            yield SimulatedArm(block.name, chain, np.column_stack(columns))


def _iter_joint_inputs(chain: Chain) -> Iterator[str]:
    """Yield the input of `kinematic_chain` for each joint."""
    counts = {"revolute": 0, "prismatic": 0}
    for joint in chain.moving:
        counts[joint.kind] += 1
        yield f"{'phi' if joint.kind == 'revolute' else 's'}[{counts[joint.kind]}]"


def _input_values(plan: Plan, recorded: CosimulationRecord, destination: Port) -> FloatArray:
    """Return the values of an input, shape (n,): of its source, its log, or its start value."""
    port = plan.sources.get(destination, destination)
    if port in recorded.names:
        return recorded.values[:, recorded.names.index(port)]
    return np.full(len(recorded.t_ns), _start_value(plan, destination))


def _iter_verdicts(
    plan: Plan, recorded: CosimulationRecord, non_finite: Mapping[Port, NonFiniteValues]
) -> Iterator[DeltaMeterResult]:
    for name in _meter_names(plan.system) if len(recorded.t_ns) else ():
        columns = [recorded.column(name, f"delta[{i}]") for i in (1, 2, 3)]
        tolerance = {"axis": _start_value(plan, Port(name, TOLERANCE))}
        reasons = tuple(_iter_uncertainties(plan, recorded, non_finite, name))
        verdict = judge_delta_meter(name, recorded.t_ns, np.column_stack(columns), tolerance, reasons)
        if verdict is not None:
            yield verdict


def _iter_uncertainties(
    plan: Plan, recorded: CosimulationRecord, non_finite: Mapping[Port, NonFiniteValues], meter: str
) -> Iterator[str]:
    """Yield the reasons why a delta meter does not pass even if no sample is out of tolerance.

    Values that are not finite may have reached it through any block before it, which need not show them: an
    FMU may clip them, or keep them as a state.
    """
    every = plan.system.record_every
    last, end = float(recorded.t_ns[-1]) * 1e-9, plan.count // every * every * plan.step
    if end - last > NANOSECOND:
        yield f"the run ended at t = {last:.9g} s instead of {end:.9g} s"
    upstream: set[str] = set()
    new = {meter}
    while new:
        upstream |= new
        new = {source.block for into, source in plan.sources.items() if into.block in new} - upstream
    for port, values in non_finite.items():
        if port.block in upstream:
            yield f"{port} was {values.value:g} at t = {values.t:.9g} s, and {meter} depends on {port.block}"
