"""Which robot of the catalogue a log is of: by the names of its columns, or by the recorded TCP."""

from __future__ import annotations

from collections.abc import Sequence

from urmpipe_models.chains.chain import Chain
from urmpipe_models.messages import Hint
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_pipeline.joint_log import Inference, JointLog
from urmpipe_pipeline.sources.units.evidence import Fit, fit, single_out, spread
from urmpipe_pipeline.sources.vocabulary import key


def infer_robot(log: JointLog) -> tuple[Chain, Inference] | None:
    """Return the only robot of the catalogue that fits a log, and why; None if none or several do.

    A robot's name in the name of every joint column singles it out (as in /ur5e/elbow_joint/position); so
    do its kinematics, if they come out at the recorded tool centre point and those of no other robot do.
    """
    words = _shared_words(log.joints)
    if not log.joints or (log.tcp_position is None and not words & set(robot_names())):
        return None
    robots = [robot for robot in map(load_robot, robot_names()) if len(robot.moving) == len(log.joints)]
    named = [robot for robot in robots if robot.name in words]
    if len(named) == 1:
        why = "its name in the names of the joint columns"
        return named[0], Inference("robot", named[0].name, why, hints=(Hint("robot"),))
    return _by_kinematics(log, named or robots)


def _shared_words(names: Sequence[str]) -> frozenset[str]:
    """Return the words that stand in every name."""
    words = [frozenset(key(name).split("_")) for name in names]
    return frozenset.intersection(*words) if words else frozenset()


def _by_kinematics(log: JointLog, robots: Sequence[Chain]) -> tuple[Chain, Inference] | None:
    """Return the robot whose forward kinematics come out at the recorded points."""
    if log.tcp_position is None or log.measured:
        return None
    rows = spread(log.rows)
    found = {robot.name: fit(robot, log.q[rows], log.tcp_position[rows]) for robot in robots}
    fits = {name: one for name, one in found.items() if one is not None}
    best = single_out(fits) if fits else None
    if best is None:
        return None
    name, needs_tool = best
    return next(robot for robot in robots if robot.name == name), _said(name, fits, needs_tool)


def _said(name: str, fits: dict[str, Fit], needs_tool: bool) -> Inference:
    """Say by how much a robot beats the next one."""
    distance = {robot: one.with_tool if needs_tool else one.distance for robot, one in fits.items()}
    others = {robot: value for robot, value in distance.items() if robot != name}
    said = f"its kinematics come within {distance[name] * 1e3:.2f} mm (rms) of the recorded TCP"
    hints = [Hint("robot")]
    if needs_tool:
        x, y, z = tool = [round(value, 4) + 0.0 for value in fits[name].tool]  # + 0.0: no -0.0
        said += f" with the tool {x:.4f},{y:.4f},{z:.4f}, which is not applied"
        hints.append(Hint("tool", tool, "applies it", robot=name))
    if others:
        second = min(others, key=others.__getitem__)
        said += f", those of {second} within {others[second] * 1e3:.2f} mm"
    return Inference("robot", name, said, hints=tuple(hints))
