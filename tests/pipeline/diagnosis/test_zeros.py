"""Zeros that alone break the tolerance are in the sentence: 100 random sets of five."""

from __future__ import annotations

import numpy as np
import pytest

import urmpipe
from altered_arm import rich_motion
from urmpipe_models import DEFAULT_TOLERANCE
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.diagnosis.causes import Cause
from urmpipe_pipeline.diagnosis.result import Diagnosis, select_causes

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


def is_of(cause: Cause, name: str) -> bool:
    """Return whether a cause is the zero of a joint, or moves the tool centre point in the very same way."""
    return (cause.kind == "joint_offset" and cause.name == name) or f"offset of {name}" in cause.equivalents


def missing(found: Diagnosis, names: list[str]) -> list[str]:
    """Return the joints whose zeros the sentence lacks."""
    either = [cause for one in found.undecided[:2] for cause in one.causes]
    said = [*select_causes(found.causes), *either]
    return [name for name in names if not any(is_of(cause, name) for cause in said)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_of_joints_on_both_sides(seed: int) -> None:
    rng, t, q, off = drawn(seed)
    reference = q + off + rng.normal(0.0, np.radians(0.01), q.shape)
    asked, log = (urmpipe.ingest(q=values, t=t, unit="rad", names=NAMES) for values in (reference, q))
    found = urmpipe.diagnose(asked, log, tolerance={"joint": float(np.radians(0.5))})
    large = [name for name, size in zip(NAMES, off, strict=True) if abs(size) > np.radians(0.5)]
    assert [name for name in large if name not in found.summary] == [], found.summary


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50, 100))
def test_of_a_path_against_joints(seed: int) -> None:
    rng, t, q, off = drawn(seed)
    path = poses_over_log(ARM, q + off)[0] + rng.normal(0.0, 1e-4, (len(t), 3))
    reference = urmpipe.ingest(name="reference", recorded_tcp=path, t=t)
    found = urmpipe.diagnose(reference, urmpipe.ingest(name="log", q=q, t=t, robot=ARM, unit="rad"))
    before = poses_over_log(ARM, q)[0]
    moved = [np.abs(poses_over_log(ARM, q + one)[0] - before).max() for one in np.diag(off)]
    large = [name for name, size in zip(NAMES, moved, strict=True) if size > DEFAULT_TOLERANCE]
    assert missing(found, large) == [], found.summary
