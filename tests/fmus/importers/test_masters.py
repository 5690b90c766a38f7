"""Shipped units, alone and in systems, run native by masters that nobody here wrote: right numbers."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from masters import MASTERS
from peers import fmu_of, need
from systems import (
    STEP,
    Block,
    Scalar,
    System,
    Trace,
    alone,
    columns,
    drawn_inputs,
    empty_trace,
    sample_times,
    shipped_unit,
)
from urmpipe_fmus.block import BlockModel, Table
from urmpipe_fmus.blocks import block_names, make_block
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.run import run
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_models.robots.catalogue import load_robot

STEPS, FEW, SYSTEM_STEPS = 61, 9, 300  # an arm with masses takes Python some tenths of a second each: FEW
Port = tuple[str, str]
# After a step libcosim reads the outputs before it passes them on to connected inputs, Ecos after.
READS_FRESH = {"libcosimpy": False, "ecospy": True}


@cache
def inputs_and_run(name: str) -> tuple[BlockModel, int, dict[str, FloatArray], dict[str, FloatArray]]:
    """Return a shipped unit, its number of steps, its inputs and its run over a log: it may take seconds."""
    unit, steps = shipped_unit(name), FEW if name in ("chain_dynamics", "driven_arm") else STEPS
    inputs = drawn_inputs(unit, steps + 1)
    return unit, steps, columns(unit, inputs), columns(unit, run(unit, sample_times(steps + 1), inputs))


@pytest.mark.slow
@pytest.mark.parametrize("name", block_names())
@pytest.mark.parametrize("master", MASTERS)
def test_a_native_unit_gives_the_numbers_of_its_run_over_a_log(master: str, name: str) -> None:
    need(master)
    unit, steps, inputs, expected = inputs_and_run(name)
    trace = MASTERS[master](alone(fmu_of(name), unit, inputs), STEP, steps)["it"]
    assert expected.keys() == trace.keys()
    # The inputs change every second sample: what is read after a step with the inputs of its beginning is at
    # every odd sample what the log's run gives there, for the inputs of that sample.
    # The masters' clocks add up, so that their times and steps differ from k h in the last digits: with
    # values up to 1e4 (torques of a drawn motion) and stiff shafts that is 1e-10 of a value, not 1e-12.
    for output, values in trace.items():
        np.testing.assert_allclose(values[1::2], expected[output][1::2], 1e-10, 1e-10, err_msg=output)


def elements(source: Port, target: Port) -> list[tuple[Port, Port]]:
    """Return the connections of all elements of two arrays of six."""
    return [((source[0], f"{source[1]}[{i}]"), (target[0], f"{target[1]}[{i}]")) for i in range(1, 7)]


def wrapped_joints() -> tuple[Table, FloatArray]:
    """Return a log of six joints that turn on and are wrapped to +-pi, and the angles before the wrap."""
    t = sample_times(SYSTEM_STEPS + 1)
    q = np.column_stack([3.0 * np.sin(2.0 * t + j) + (j - 2.5) * 4.0 * t for j in range(6)])
    q -= 2.0 * np.pi * np.round(q[0] / (2.0 * np.pi))  # the first sample lies within half a turn
    wrapped = q - 2.0 * np.pi * np.round(q / (2.0 * np.pi))
    assert (np.abs(np.diff(wrapped, axis=0)) > np.pi).sum() > 5
    return Table(np.rint(t * 1e9).astype(np.int64), wrapped), q


@pytest.mark.slow
@pytest.mark.parametrize("master", READS_FRESH)
def test_log_repolarizer_and_chain_give_the_tool_of_the_log(master: str) -> None:
    need(master)
    table, q = wrapped_joints()
    source = make_block("log_source", table=table, columns=[("q", "rad", 6)])
    blocks = {"log": Block(fmu_of(source), source)}
    for name in ("repolarizer", "kinematic_chain"):
        blocks[name] = Block(fmu_of(name), shipped_unit(name))
    connections = elements(("log", "q"), ("repolarizer", "raw"))
    connections += elements(("repolarizer", "q"), ("kinematic_chain", "phi"))
    trace = MASTERS[master](System(blocks, connections), STEP, SYSTEM_STEPS)
    late = 1 if READS_FRESH[master] else 2  # two connections, each a step; the last is read fresh
    p7 = positions_over_log(load_robot("urm6"), q)
    found = np.column_stack([trace["kinematic_chain"][f"p7[{i}]"] for i in (1, 2, 3)])
    # The same lines of kinematics, compiled and in NumPy, on angles of whole turns more or less.
    np.testing.assert_allclose(found[1 + late :], p7[1 : SYSTEM_STEPS + 1 - late], 0.0, 1e-12)
    unwrapped = np.column_stack([trace["repolarizer"][f"q[{i}]"] for i in range(1, 7)])
    np.testing.assert_allclose(unwrapped[late:], q[1 : SYSTEM_STEPS + 2 - late], 0.0, 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("master", READS_FRESH)
def test_a_drive_and_its_load_give_what_their_instances_in_python_give(master: str) -> None:
    need(master)
    volts = 24.0 * np.sign(np.sin(np.arange(SYSTEM_STEPS) * 0.1) + 0.1)
    blocks = {
        "dc_drive": Block(fmu_of("dc_drive"), shipped_unit("dc_drive"), {"u": volts}),
        "inertia": Block(fmu_of("inertia"), shipped_unit("inertia")),
    }
    connections = [
        (("dc_drive", "Mk"), ("inertia", "tau")),
        (("inertia", "theta"), ("dc_drive", "theta2")),
        (("inertia", "omega"), ("dc_drive", "omega2")),
    ]
    system, step = System(blocks, connections), 5e-4
    trace = MASTERS[master](system, step, SYSTEM_STEPS)
    expected = run_instances(system, step, SYSTEM_STEPS, fresh=READS_FRESH[master])
    for scalar in system.outputs():
        values, wanted = (result[scalar.block][scalar.name][1:] for result in (trace, expected))
        # 300 steps of a stiff shaft: the masters' clocks differ from k h in the last digits.
        scale = float(np.abs(wanted).max())
        np.testing.assert_allclose(values, wanted, 1e-9, 1e-9 * scale, err_msg=scalar.path)
    assert np.abs(trace["inertia"]["theta"][-1]) > 1e-3, "the load should have moved"


def run_instances(system: System, step: float, steps: int, *, fresh: bool) -> Trace:
    """Run the units in Python, all outputs passed on together after each step, and read then if `fresh`."""
    instances = {name: Instance(block.unit) for name, block in system.blocks.items()}
    connected = list(system.connected())
    trace = empty_trace(system, steps)
    for _ in range(len(instances)):
        pass_on(instances, connected)
    for k in range(steps):
        for scalar, value in system.inputs(k):
            instances[scalar.block].set([scalar.reference], [value])
        for instance in instances.values():
            instance.do_step(k * step, step)
        if fresh:
            pass_on(instances, connected)
        for scalar in system.outputs():
            trace[scalar.block][scalar.name][k + 1] = instances[scalar.block].get([scalar.reference])[0]
        if not fresh:
            pass_on(instances, connected)
    return trace


def pass_on(instances: dict[str, Instance], connected: Sequence[tuple[Scalar, Scalar]]) -> None:
    """Pass all outputs on to the inputs that they are connected to, at once."""
    values = [instances[source.block].get([source.reference]) for source, _ in connected]
    for (_, target), value in zip(connected, values, strict=True):
        instances[target.block].set([target.reference], value)
