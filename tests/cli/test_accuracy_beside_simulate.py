"""`accuracy` beside `simulate` and `compare`: the same motion as one block, and as a system of blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import urmpipe
from driven_paths import CONTOUR, PERIOD, begun, joint_log, planned, set_points_log, written
from flat_arm import ARM, MASSES, drive
from urmpipe_fmus.native import native_unavailable_reason
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import DRIVE_KEYS, GAIN_KEYS, DrivenJoint
from urmpipe_models.dynamics.driven_arm import find_equilibrium
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.robots.toml import robot_toml
from urmpipe_pipeline.planned_paths.result import PlannedPath

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(native_unavailable_reason(())), reason=f"runs native FMUs: {native_unavailable_reason(())}"
    ),
]

SET_POINTS = {"theta": "set_phi", "omega": "set_phid", "alpha": "set_phidd"}
"""Columns of a table of set points, and the inputs of `driven_arm` that follow them."""

ROUNDED = 1e-11
"""The planner solves the joints for the tool to within 1e-12 m of the path, of whose points there are two."""


def one_block(folder: Path, arm: Chain, plan: PlannedPath, driven: list[int]) -> FloatArray:
    """Return the joints of `driven_arm` in a system that plays set points from a table."""
    (folder / "arm.toml").write_text(robot_toml(begun(arm, plan)), encoding="utf-8")
    set_points_log(folder / "points.csv", plan, driven)
    inputs = "".join(
        f'"arm.{name}[{k}]" = {{ log = "points.csv", column = "{column}{k}" }}\n'
        for k in range(1, len(driven) + 1)
        for column, name in SET_POINTS.items()
    )
    (folder / "one.toml").write_text(
        f'[system]\nname = "one"\nstep = {PERIOD}\n[blocks.arm]\nunit = "driven_arm"\nrobot = "arm.toml"\n'
        "start = { force = [0.0, 0.0, 0.0], moment = [0.0, 0.0, 0.0] }\n"
        f"[inputs]\n{inputs}",
        encoding="utf-8",
    )
    found = urmpipe.simulate(folder / "one.toml")
    assert found.failed is None
    return found.signal("arm.phi").values


def test_one_block_from_a_log_compared_with_the_plan_has_the_errors_of_accuracy(tmp_path: Path) -> None:
    velocity = 1.0  # m/s: on the way voltages are at their limits and below
    arm = load_robot("irb60")
    plan = planned(CONTOUR, arm, velocity, tmp_path / "plan.csv")
    log = joint_log(tmp_path / "log.csv", arm, one_block(tmp_path, arm, plan, [0, 1, 2]))
    (run,) = urmpipe.compare(tmp_path / "plan.csv", log, robot="irb60").runs
    (errors,) = urmpipe.accuracy(CONTOUR, arm, velocities=[velocity]).errors
    assert run.start == pytest.approx([0.0] * 4, abs=ROUNDED)  # at rest it is where the path begins
    assert errors.error is not None
    assert errors.path_error is not None
    assert errors.path_error > 1e-4  # m: there is something to compare
    assert run.statistics["norm"].max == pytest.approx(errors.error, rel=0, abs=ROUNDED)
    assert run.statistics["path"].max == pytest.approx(errors.path_error, rel=0, abs=ROUNDED)


def system_of_blocks(arm: Chain, steps: int) -> str:
    """Return a system of the arm's dynamics, drives and controllers; so many steps a sample."""
    start = ", ".join(map(repr, arm.start))
    blocks = [
        f'[system]\nname = "blocks"\nstep = {PERIOD / steps!r}\nrecord_every = {steps}\n'
        f'[blocks.arm]\nunit = "chain_dynamics"\nrobot = "arm.toml"\n'
        f"start = {{ phi = [{start}], force = [0.0, 0.0, 0.0], moment = [0.0, 0.0, 0.0] }}\n"
    ]
    inputs, connections = ["[inputs]\n"], ["[connections]\n"]
    for k, (one, rest) in enumerate(zip(arm.drives, find_equilibrium(arm), strict=True), start=1):
        assert isinstance(one, DrivenJoint)
        gains = dict(zip(GAIN_KEYS, one.gains, strict=True))
        keys = gains | {"period": one.period, "u_max": one.largest_voltage, "last": rest.voltage}
        own = dict(zip(DRIVE_KEYS, one.drive, strict=True)) | {"theta1": rest.rest, "i_a": rest.current}
        for name, unit, values in (("controller", "drive_controller", keys), ("drive", "dc_drive", own)):
            told = ", ".join(f"{key} = {float(value)!r}" for key, value in values.items())
            blocks.append(f'[blocks.{name}{k}]\nunit = "{unit}"\nstart = {{ {told} }}\n')
        for column, output in (("theta", "phi"), ("omega", "phid"), ("alpha", "phidd")):
            log = f'{{ log = "points.csv", column = "{column}{k}" }}'
            inputs.append(f'"controller{k}.set_{column}" = {log}\n')
            connections.append(f'"controller{k}.real_{column}" = "arm.{output}[{k}]"\n')
        connections.append(
            f'"drive{k}.u" = "controller{k}.u"\n"arm.tau[{k}]" = "drive{k}.Mk"\n'
            f'"drive{k}.theta2" = "arm.phi[{k}]"\n"drive{k}.omega2" = "arm.phid[{k}]"\n'
        )
    return "".join((*blocks, *connections, *inputs))


def test_blocks_near_accuracy_with_the_first_order_of_the_communication_step(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text(ARM + MASSES + drive("a") + drive("b"), encoding="utf-8")
    arm = load_robot(tmp_path / "arm.toml")
    tip = np.array(forward(arm, list(arm.start))[-1].translation)
    ends = np.array([tip, np.add(tip, (-0.04, -0.03, 0.0))])
    path = written(tmp_path / "path.csv", {**dict(zip("xyz", ends.T, strict=True)), "r": np.zeros(2)})
    plan = planned(path, arm, 0.2, tmp_path / "plan.csv")
    begins = begun(arm, plan)
    (tmp_path / "arm.toml").write_text(robot_toml(begins), encoding="utf-8")
    set_points_log(tmp_path / "points.csv", plan, [0, 1])
    (motion,) = urmpipe.accuracy(path, arm, velocities=[0.2]).motions
    distances, errors = [], []
    for steps in (5, 10):  # and a third step: test_driven_arm.py
        (tmp_path / "blocks.toml").write_text(system_of_blocks(begins, steps), encoding="utf-8")
        found = urmpipe.simulate(tmp_path / "blocks.toml")
        assert found.failed is None
        log = joint_log(tmp_path / "log.csv", arm, found.signal("arm.phi").values)
        (run,) = urmpipe.compare(tmp_path / "plan.csv", log, robot=arm).runs
        distances.append(float(np.abs(run.delta[:, :3] - motion.delta[:, :3]).max()))
        errors.append(abs(run.statistics["norm"].max - float(motion.delta[:, 3].max())))
    assert distances[0] < 0.5 * motion.delta[:, 3].max()  # it is about the same motion
    # Values held over a step are off by its length, so half of it by half; measured: order 0.996.
    # What is left is the term of its square, which halves, too.
    assert -np.diff(np.log2(distances)) == pytest.approx(1.0, abs=0.02), distances
    assert errors[1] < errors[0]
