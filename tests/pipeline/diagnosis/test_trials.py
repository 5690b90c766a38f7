"""Causes on motions of real robots: the clear single ones of benchmarks/diagnosis_trials.py, two of poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import urmpipe

BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"


@pytest.mark.slow
@pytest.mark.usefixtures("shared")
def test_a_clear_cause_of_each_kind_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of each kind one that moves the tool centre point by 4 mm, or has no size, in noise of 0.05 mm."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from diagnosis_trials import GOOD, run
    from faulty_logs import plan

    clear = {
        kinds: number
        for number, (group, kinds, size, noise) in enumerate(plan())
        if group == "single" and size in (0.0, 4e-3) and noise == 5e-5
    }
    assert len(clear) == 32
    results = [run(number) for number in clear.values()]
    assert [one for one in results if one["answer"] not in GOOD] == []


@pytest.mark.slow
def test_a_sign_and_a_zero_of_a_real_arm_are_found_by_a_laser_tracker(shared: Path, tmp_path: Path) -> None:
    tracker, log = shared / "logs/ur10-laser-tracker/measurements_grid.csv", tmp_path / "log.csv"
    some = pd.read_csv(tracker, sep=";", decimal=",").sample(300, random_state=0).sort_index()
    expected = {"": [], "elbow_joint": ["joint_sign"], "wrist_1_joint": ["joint_offset"]}
    for name, kinds in expected.items():
        wrong = some.assign(
            elbow_joint=some.elbow_joint * (-1.0 if name == "elbow_joint" else 1.0),
            wrist_1_joint=some.wrist_1_joint + np.radians(0.5) * (name == "wrist_1_joint"),
        )
        wrong.to_csv(log, sep=";", decimal=",", index=False)
        found = urmpipe.diagnose(log, robot="ur10")
        # the arm's own geometry is fitted with each cause, and named with it
        named = [*((kind, (name,)) for kind in kinds), *[("own_geometry", ())] * len(kinds)]
        assert ([(one.kind, one.joints) for one in found.causes], found.undecided) == (named, ())
