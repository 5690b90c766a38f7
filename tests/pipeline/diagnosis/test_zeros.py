"""Zeros that alone break the tolerance are in the sentence: 26 random sets of five."""

from __future__ import annotations

import numpy as np
import pytest

import urmpipe
from altered_arm import rich_motion
from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis.result import select_causes

ARM = load_robot("urm6")
NAMES = ARM.coordinates
LOWEST, HIGHEST = np.radians([0.05, 90.0])


def drawn(seed: int) -> tuple[np.random.Generator, FloatArray, FloatArray, FloatArray]:
    """Return times in [s], joints in [rad] and the zeros of the joints in [rad], of which one is 0."""
    rng = np.random.default_rng([44, seed])
    t = np.linspace(0.0, 20.0, int(rng.integers(300, 501)))
    off = np.zeros(6)
    joints = rng.permutation(6)[:5]
    off[joints] = LOWEST * (HIGHEST / LOWEST) ** rng.random(5) * rng.choice([-1.0, 1.0], 5)
    return rng, t, np.asarray(rich_motion(ARM, seed + 1)(t)), off


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(0, 50, 4))
def test_of_joints_on_both_sides(seed: int) -> None:
    rng, t, q, off = drawn(seed)
    reference = q + off + rng.normal(0.0, np.radians(0.01), q.shape)
    wanted, log = (urmpipe.ingest(q=values, t=t, unit="rad", names=NAMES) for values in (reference, q))
    found = urmpipe.diagnose(wanted, log, tolerance={"joint": float(np.radians(0.5))})
    large = [name for name, size in zip(NAMES, off, strict=True) if abs(size) > np.radians(0.5)]
    assert [name for name in large if name not in found.summary] == [], found.summary


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50, 100, 4))
def test_of_a_path_against_joints(seed: int) -> None:
    rng, t, q, off = drawn(seed)
    path = poses_over_log(ARM, q + off)[0] + rng.normal(0.0, 1e-4, (len(t), 3))
    reference = urmpipe.ingest(name="reference", recorded_tcp=path, t=t)
    found = urmpipe.diagnose(reference, urmpipe.ingest(name="log", q=q, t=t, robot=ARM, unit="rad"))
    before = poses_over_log(ARM, q)[0]
    moved = [np.abs(poses_over_log(ARM, q + one)[0] - before).max() for one in np.diag(off)]
    large = [name for name, size in zip(NAMES, moved, strict=True) if size > DEFAULT_TOLERANCE]
    either = [cause for one in found.undecided[:2] for cause in one.causes]
    shown = [*select_causes(found.causes), *either]
    named = {f"offset of {cause.name}" for cause in shown if cause.kind == "joint_offset"}
    named |= {name for cause in shown for name in cause.equivalents}  # move the tool centre point likewise
    assert [name for name in large if f"offset of {name}" not in named] == [], found.summary
