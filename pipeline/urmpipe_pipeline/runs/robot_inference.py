"""Which robot of the catalogue a log is of: by the names of its columns, or by the recorded TCP."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from urmpipe_models.arm.chain import Chain
from urmpipe_models.errors import Hint
from urmpipe_models.robots.catalogue import kinematically_distinct_names, load_robot
from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.sources.units.evidence import Fit, single_out
from urmpipe_pipeline.sources.units.kinematic_units import Recorded, fits
from urmpipe_pipeline.sources.vocabulary import key


def infer_robot(recorded: Recorded) -> tuple[Chain, Inference] | None:
    """Return the only robot of the catalogue that fits a log, and why; None if none or several do.

    A robot's name in the name of every joint column singles it out (as in /ur5e/elbow_joint/position); so
    do its kinematics, if they come out at the recorded tool centre point and those of no other robot do, in
    the units that are told or in others.
    """
    words = _shared_words(recorded.names)
    if not recorded.names or (not recorded.lengths and not words & set(kinematically_distinct_names())):
        return None
    robots = [
        robot
        for robot in map(load_robot, kinematically_distinct_names())
        if len(robot.moving) == len(recorded.names)
    ]
    named = [robot for robot in robots if robot.name in words]
    if len(named) == 1:
        why = "its name in the names of the joint columns"
        return named[0], Inference("robot", named[0].name, why, hints=(Hint("robot"),))
    return _by_kinematics(recorded, named or robots)


def _shared_words(names: Sequence[str]) -> frozenset[str]:
    """Return the words that stand in every name."""
    words = [frozenset(key(name).split("_")) for name in names]
    return frozenset.intersection(*words) if words else frozenset()


def _by_kinematics(recorded: Recorded, robots: Sequence[Chain]) -> tuple[Chain, Inference] | None:
    """Return the robot whose forward kinematics come out at the recorded points."""
    judged = [robot for robot in robots if recorded.judges(robot)]
    found = {
        (robot.name, reading): one
        for robot in judged
        for reading, one in fits(robot, recorded, recorded.usual).items()
    }
    told = {(robot.name, reading) for robot in judged for reading in recorded.told}
    best = single_out(found, told) if found else None
    if best is None:
        return None
    (name, reading), needs_tool = best
    nearest = {
        robot.name: min(
            (found[robot.name, one] for one in recorded.usual), key=lambda one: one.of(tool=needs_tool)
        )
        for robot in judged
    }
    said = _said(name, nearest | {name: found[name, reading]}, needs_tool)
    return next(robot for robot in robots if robot.name == name), said


def _said(name: str, near: Mapping[str, Fit], needs_tool: bool) -> Inference:
    """Say by how much a robot beats the next one."""
    distance = {robot: one.of(tool=needs_tool) for robot, one in near.items()}
    others = {robot: value for robot, value in distance.items() if robot != name}
    said = f"its kinematics come within {distance[name] * 1e3:.2f} mm (rms) of the recorded TCP"
    hints = [Hint("robot")]
    if needs_tool:
        x, y, z = tool = [round(value, 4) + 0.0 for value in near[name].tool]  # + 0.0: no -0.0
        said += f" with the tool {x:.4f},{y:.4f},{z:.4f}, which is not applied"
        hints.append(Hint("tool", tool, "applies it", robot=name))
    if others:
        second = min(others, key=others.__getitem__)
        said += f", those of {second} within {others[second] * 1e3:.2f} mm"
    return Inference("robot", name, said, hints=tuple(hints))
