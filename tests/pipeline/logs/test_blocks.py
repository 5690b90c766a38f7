"""Blocks of columns without names: joints and rates proved by their numbers, or asked about."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError
from urmpipe_pipeline.joint_log import ASSUMED_PERIOD, JointLog
from urmpipe_pipeline.logs import LogMap, read_log
from urmpipe_pipeline.logs.rates import period_of, proved_blocks

Arm = Callable[..., Chain]

STEP = 0.004


class Motion:
    """Joints that turn by sums of two sines, with their exact derivatives, over 6 s."""

    def __init__(self, joints: int, seed: int = 7, rows: int = 1500) -> None:
        self.joints = joints
        rng = np.random.default_rng(seed)
        self.t = STEP * np.arange(rows)
        width, rate, phase = (
            rng.uniform(*ends, (2, joints)) for ends in ((0.2, 0.9), (0.7, 4.0), (0.0, 6.0))
        )
        angle = rate * self.t[:, np.newaxis, np.newaxis] + phase
        self.q = (width * np.sin(angle)).sum(axis=1)
        self.qd = (width * rate * np.cos(angle)).sum(axis=1)
        self.qdd = (-width * rate**2 * np.sin(angle)).sum(axis=1)
        self.temp = np.empty_like(self.q)
        self.tau = 9.0 * np.cos(self.q) + np.linspace(0.5, 4.0, joints) * self.qd

    def table(self, blocks: str) -> FloatArray:
        """Return blocks side by side, as "tau q qd"."""
        return np.hstack([getattr(self, name) for name in blocks.split()])


def written(path: Path, values: FloatArray, sign: str = ",") -> Path:
    np.savetxt(path, values, fmt="%.9g", delimiter=sign)
    return path


def read(path: Path, robot: Chain | None = None, **options: object) -> JointLog:
    return read_log([path], LogMap(**options), robot)  # type: ignore[arg-type]


def columns_of(log: JointLog, role: str) -> list[int]:
    return [column.number for column in log.columns if column.role == role]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("blocks", "first", "sign"),
    [("q qd", 1, ","), ("q qd tau", 1, ";"), ("tau q qd", 7, " "), ("q qd qdd", 1, ","), ("qd q", 7, ";")],
)
@pytest.mark.parametrize("known", [True, False])
def test_rates_prove_which_block_holds_the_joints(
    blocks: str, first: int, known: bool, sign: str, arm: Arm, tmp_path: Path
) -> None:
    motion = Motion(6)
    log = read(
        written(tmp_path / "log.txt", motion.table(blocks), sign), arm(6) if known else None, time="none"
    )
    assert columns_of(log, "joint") == list(range(first, first + 6))
    np.testing.assert_allclose(log.q, motion.q, atol=1e-8)  # nine digits
    assert log.qd is not None
    np.testing.assert_allclose(log.qd, motion.qd, atol=1e-7)
    assert log.period == STEP  # told by the rates
    assert ASSUMED_PERIOD not in [warning.kind for warning in log.warnings]


def test_joints_and_rates_in_turns(arm: Arm, tmp_path: Path) -> None:
    motion = Motion(3)
    turns = np.stack([motion.q, motion.qd], axis=2).reshape(len(motion.q), -1)
    log = read(written(tmp_path / "log.csv", np.degrees(turns)), arm(3), time="none", unit={"": "deg"})
    assert columns_of(log, "joint") == [1, 3, 5]
    assert columns_of(log, "rate") == [2, 4, 6]
    np.testing.assert_allclose(log.q, motion.q, atol=1e-7)


def test_a_joint_that_rests_belongs_to_its_block(tmp_path: Path) -> None:
    motion = Motion(6)
    motion.q[:, [0, 4]], motion.qd[:, [0, 4]] = 0.3, 0.0
    log = read(written(tmp_path / "log.csv", motion.table("q qd")), time="none")
    assert columns_of(log, "joint") == [1, 2, 3, 4, 5, 6]


@pytest.mark.slow
@pytest.mark.parametrize(("blocks", "answer"), [("q tau", 0), ("tau q", 1)])
@pytest.mark.parametrize("joints", [2, 6, 7])
def test_blocks_that_nothing_proves_are_asked_about(
    blocks: str, answer: int, joints: int, arm: Arm, tmp_path: Path
) -> None:
    motion = Motion(joints)
    path = written(tmp_path / "log.csv", motion.table(blocks))
    with pytest.raises(LogError, match=f"found {2 * joints} columns that no header names") as asked:
        read(path, arm(joints), time="none")
    columns = [f"{answer * joints + 1}-{(answer + 1) * joints}"]
    assert columns in [hint.value for hint in asked.value.findings[0].hints]
    log = read(path, arm(joints), time="none", joints=columns)
    np.testing.assert_allclose(log.q, motion.q, atol=1e-8)


@pytest.mark.parametrize("far", [1000.0, 1e9])
def test_columns_that_turn_too_far_for_an_arm_are_asked_about_before_units(
    far: float, tmp_path: Path
) -> None:
    motion = Motion(5)
    path = written(tmp_path / "log.csv", np.hstack([motion.q, far * (1.5 + motion.q[:, :1])]))
    with pytest.raises(
        LogError, match="6 columns that no header names, of which 6 may be no joints"
    ) as asked:
        read(path, time="none")
    assert asked.value.findings[0].hints[0].value == ["1-5"]


@pytest.mark.slow
@given(seed=st.integers(0, 10_000), joints=st.integers(3, 7), order=st.permutations(["q", "tau", "temp"]))
def test_what_are_no_rates_proves_nothing(seed: int, joints: int, order: Sequence[str]) -> None:
    """Torques hold a part that goes with the rate, of another size for each joint: the periods differ."""
    motion = Motion(joints, seed)
    motion.temp = 40.0 + np.outer(1.0 - np.exp(-motion.t / 3.0), 1.0 + np.arange(joints))
    assert not proved_blocks(motion.table(" ".join(order)), joints)


@pytest.mark.slow
@given(seed=st.integers(0, 10_000), noise=st.floats(0.0, 0.1))
def test_the_period_that_measured_rates_tell(seed: int, noise: float) -> None:
    """Noise of a tenth of the rates moves the least squares by its square, a percent, and by chance."""
    motion = Motion(6, seed)
    rates = motion.qd + noise * motion.qd.std(axis=0) * np.random.default_rng(seed).normal(
        size=motion.qd.shape
    )
    found = period_of(motion.q, rates)
    assert found is not None
    assert found[0] == pytest.approx(STEP, rel=0.02)


def test_rates_in_other_units_tell_the_same_period(tmp_path: Path) -> None:
    motion = Motion(2)
    names = "q1 [deg],q2 [deg],qd1 [rad/s],qd2 [rad/s]"
    values = np.hstack([np.degrees(motion.q), motion.qd])
    np.savetxt(tmp_path / "log.csv", values, delimiter=",", header=names, comments="")
    assert read(tmp_path / "log.csv").period == STEP


def test_rates_that_do_not_fit_tell_no_period(tmp_path: Path) -> None:
    motion = Motion(2)
    values = np.hstack([motion.q, motion.qd * (1.0, 3.0)])
    np.savetxt(tmp_path / "log.csv", values, delimiter=",", header="q1,q2,qd1,qd2", comments="")
    assert ASSUMED_PERIOD in [warning.kind for warning in read(tmp_path / "log.csv").warnings]
