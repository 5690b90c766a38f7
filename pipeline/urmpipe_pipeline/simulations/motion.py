"""The motion of a block of a simulation as a run: the joints of an arm, or a path.

A block has a motion if it is an arm, or if its arrays are called as those of the units are: q or phi are
joints that turn, s joints that slide, with d and dd behind them their rates; p is a point, and so is the one
of p1, p2, ... that has angles of its own: rz7, ry7, rx7.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value
from urmpipe_pipeline.joint_log import Inference, JointLog, LogColumn, LogWarning, Role
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.runs.ingest import log_to_run
from urmpipe_pipeline.runs.run import Run
from urmpipe_pipeline.simulations.simulation import SLOW, Signal, Simulation

SIMULATED = "simulate"
"""The source of a log that is the motion of a block."""

NOT_FINITE = "not-finite"
"""The kind of the warning that an output of a block was not finite."""

_JOINTS = (("q", "rad"), ("phi", "rad"), ("s", "m"))
"""What joints are called, and the unit that tells that they turn, or slide."""

_ORDERS = (("", ""), ("d", "/s"), ("dd", "/s2"))

_ANGLES = ("rz", "ry", "rx")
"""What the angles of a point are called, in the order of their turns."""

_POSE: tuple[Role, ...] = ("position", "rotation", "rotation", "rotation")


def moving_blocks(simulation: Simulation) -> tuple[str, ...]:
    """Return the names of the blocks that have a motion: those that are arms, then the others."""
    arms = [one.block for one in simulation.arms]
    blocks = dict.fromkeys(one.block for one in simulation.signals)
    return tuple(dict.fromkeys((*arms, *(one for one in blocks if _moves(_signals_of(simulation, one))))))


def run_of_block(simulation: Simulation, block: str | None = None, robot: Chain | None = None) -> Run:
    """Return the motion of a block as a run: as a log, repolarized and differentiated.

    Args:
        simulation: What was simulated.
        block: Name of the block; None for the only one that has a motion.
        robot: The arm; default: that of the block, else the only one of the simulation with as many joints.

    Raises:
        LogError: If no block is named and none or several have a motion, if it has no sample, or the arm has
            other joints; if the simulation ended early, or a value that led to the motion was not finite.
        OptionError: If a block is named that has no motion.
    """
    chosen = _chosen(simulation, block)
    if not len(simulation.t_ns):
        raise LogError(Finding("found a simulation without a sample, allowed: a motion", _place(simulation)))
    doubts = tuple(_doubts(simulation, chosen))
    if doubts:
        raise LogError(*doubts)
    arm, because = (robot, None) if robot is not None else _arm_of(simulation, chosen)
    only = Inference("block", chosen, "it alone has a motion", hints=(Hint("block"),))
    told = (*(() if block else (only,)), *((because,) if because else ()))
    log = _log(simulation, chosen, arm, told)
    return log_to_run(log, arm, LogMap(), provenance=simulation.provenance)


def _chosen(simulation: Simulation, block: str | None) -> str:
    """Return the block whose motion is meant."""
    moving = moving_blocks(simulation)
    if block in moving:
        return str(block)
    if not moving:
        said = "found no block with joints (q or phi in rad, s in m) or a point (p in m), allowed: one"
        raise LogError(Finding(said, _place(simulation)))
    if block is not None:
        allowed = f"{', '.join(moving)}, which have a motion in {_place(simulation)}"
        raise OptionError(Finding(parameter="block", found=format_value(block), allowed=allowed))
    if len(moving) > 1:
        said = f"found {len(moving)} blocks with a motion, allowed: one"
        hints = tuple(Hint("block", one) for one in moving)
        raise LogError(Finding(said, _place(simulation), hints=hints))
    return moving[0]


def _place(simulation: Simulation) -> str:
    """Return what an error names: the recording, or the simulation where it has none."""
    return str(simulation.recording) if simulation.recording else simulation.name


def _signals_of(simulation: Simulation, block: str) -> dict[str, Signal]:
    """Return the signals of a block by their variables."""
    return {one.variable: one for one in simulation.signals if one.block == block}


def _moves(signals: Mapping[str, Signal]) -> bool:
    """Return whether a block has a motion by what its signals are called."""
    return bool(_joints(signals)) or bool(_pose(signals))


def _joints(signals: Mapping[str, Signal], order: int = 0) -> list[tuple[str, FloatArray]]:
    """Return unit and values, shape (n, size), of joints that turn and that slide, or of rates of them."""
    behind, per = _ORDERS[order]
    found = ((unit, signals.get(name + behind)) for name, unit in _JOINTS)
    arrays = [(unit, one.values) for unit, one in found if one is not None and _is_array(one, unit + per)]
    return arrays if len({unit for unit, _ in arrays}) == len(arrays) else []  # q and phi: which?


def _is_array(signal: Signal, unit: str) -> bool:
    return signal.unit == unit and signal.values.ndim == 2


def _pose(signals: Mapping[str, Signal]) -> tuple[Signal, ...]:
    """Return the signals of a point, and of its angles if it has some; none without a point."""
    angles = [name[2:] for name in signals if re.fullmatch(r"rz\d*", name)]
    for number in (*angles[-1:], ""):
        point = signals.get(f"p{number}")
        if point is not None and point.unit == "m" and point.values.shape[1:] == (3,):
            turned = [signals.get(f"{name}{number}") for name in _ANGLES]
            known = [one for one in turned if one is not None and one.unit == "rad" and one.values.ndim == 1]
            return (point, *known) if len(known) == len(turned) else (point,)
    return ()


def _arm_of(simulation: Simulation, block: str) -> tuple[Chain | None, Inference | None]:
    """Return the arm that a block is, else the only one of the simulation with its joints, and why it is."""
    own = next((one.chain for one in simulation.arms if one.block == block), None)
    if own is not None:
        return own, None
    units = sorted(unit for unit, values in _joints(_signals_of(simulation, block)) for _ in values.T)
    fitting = [one for one in simulation.arms if sorted(_units(one.chain)) == units]
    if len(fitting) != 1:
        return None, None
    (arm,) = fitting
    why = f"block {arm.block} is the only arm of the simulation with as many joints"
    return arm.chain, Inference("robot", arm.chain.name, why, hints=(Hint("robot"),))


def _units(chain: Chain) -> list[str]:
    """Return the SI unit of each joint of an arm."""
    return ["rad" if joint.kind == "revolute" else "m" for joint in chain.moving]


def _log(simulation: Simulation, block: str, arm: Chain | None, told: Sequence[Inference]) -> JointLog:
    """Return the motion of a block as the log that a file of it would be."""
    signals, t_ns = _signals_of(simulation, block), simulation.t_ns
    own = next((one for one in simulation.arms if one.block == block), None)
    units, q = (_units(own.chain), own.q) if own else _stacked(_joints(signals))
    order = _order(units, arm, _place(simulation)) if units else []
    rates = [_stacked(_joints(signals, one))[1] for one in (1, 2)]
    qd, qdd = (one[:, order] if not own and units and one.shape == q.shape else None for one in rates)
    pose = _pose(signals)
    joints = (arm.coordinates if arm else [f"q{j + 1}" for j in range(len(units))]) if units else ()
    return JointLog(
        name=f"{simulation.name} ({block})", source=SIMULATED, files=simulation.provenance.inputs,
        t_ns=t_ns - t_ns[0], clock_start_ns=int(t_ns[0]), joints=tuple(joints),
        q=q[:, order] if units else np.empty((len(t_ns), 0)), qd=qd, qdd=qdd,
        tcp_position=pose[0].values if pose else None,
        tcp_rotation=np.column_stack([one.values for one in pose[1:]]) if pose[1:] else None,
        rotation_form="zyx" if pose[1:] else None,
        columns=tuple(_columns(block, joints, [units[j] for j in order], pose)),
        inferences=tuple(told), warnings=tuple(_warnings(simulation)),
    )  # fmt: skip


def _stacked(arrays: Sequence[tuple[str, FloatArray]]) -> tuple[list[str], FloatArray]:
    """Return the unit of each joint, and the values of all, shape (n, joints); of no joint shape (0,)."""
    units = [unit for unit, values in arrays for _ in values.T]
    return units, np.column_stack([values for _, values in arrays]) if arrays else np.empty(0)


def _order(units: Sequence[str], arm: Chain | None, place: str) -> list[int]:
    """Return which joint, by its unit, is which of an arm: those that turn in order, and those that slide.

    Raises:
        LogError: If the arm has others, or there is none to tell the order of both kinds.
    """
    wanted = _units(arm) if arm else list(units)
    if arm is None and len(set(units)) > 1:
        said = "found revolute and prismatic joints without a robot, allowed: both with a robot"
        raise LogError(Finding(said, place, hints=(Hint("robot", None, "tells their order"),)))
    if arm is not None and sorted(wanted) != sorted(units):
        found, allowed = (
            f"{one.count('rad')} revolute and {one.count('m')} prismatic joints" for one in (units, wanted)
        )
        raise LogError(Finding(f"found {found}, allowed: {allowed}, as robot {arm.name} has", place))
    places = {unit: iter([j for j, one in enumerate(units) if one == unit]) for unit in set(units)}
    return [next(places[unit]) for unit in wanted]


def _columns(
    block: str, joints: Sequence[str], units: Sequence[str], pose: Sequence[Signal]
) -> Iterator[LogColumn]:
    """Yield the columns of a file with the motion, so that it can be exported."""
    yield LogColumn("t", "t [s]", "time", 0, "s", number=1)
    for j, (name, unit) in enumerate(zip(joints, units, strict=True)):
        yield LogColumn(name, f"{name} [{unit}]", "joint", j, unit, number=j + 2)
    names = [(role, name, one.unit) for role, one in zip(_POSE, pose, strict=False) for name in one.names]
    for i, (role, name, unit) in enumerate(names):
        yield LogColumn(name, f"{name} [{unit}]", role, i % 3, unit, number=len(joints) + 2 + i)


def _warnings(simulation: Simulation) -> Iterator[LogWarning]:
    """Yield what is to be known of the motion, without how else a log could have been read: it stands."""
    for one in simulation.warnings:
        if one.kind != SLOW:
            yield replace(one, hints=())


def _doubts(simulation: Simulation, block: str) -> Iterator[Finding]:
    """Yield why no verdict may rest on the motion of a block.

    What is not finite may have reached it through any block before it, which need not show it.
    """
    place = _place(simulation)
    if simulation.failed is not None:
        yield Finding(
            f"found a simulation that ended early, allowed: a whole one; {simulation.failed}", place
        )
    before = _before(simulation, block)
    for one in simulation.warnings:
        if one.kind == NOT_FINITE and one.about in before:
            said = f"{one.about}.{one.column}: {one.message}; allowed: none where block {block} is judged"
            yield Finding(said, place)


def _before(simulation: Simulation, block: str) -> set[str]:
    """Return the blocks on whose outputs a block depends, directly or through others, and itself."""
    into = [(to.partition(".")[0], source.partition(".")[0]) for to, source in simulation.connections.items()]
    found: set[str] = set()
    new = {block}
    while new:
        found |= new
        new = {source for to, source in into if to in new} - found
    return found
