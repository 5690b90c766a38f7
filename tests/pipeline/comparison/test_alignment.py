"""Laws of alignments, and the log of a laser tracker; `alignment.cases` has what they take out and leave."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from made_runs import path_run, run_of
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs, compare_with_recorded_tcp

TRACKER = Path(__file__).resolve().parents[4] / "shared/logs/ur10-laser-tracker/measurements_grid.csv"


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_small_motion_more_makes_a_rigid_alignment_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wanted, done = rng.normal(size=(2, 30, 3))
    log = path_run(done, name="log")
    found = compare_runs(path_run(wanted), [log], CompareOptions(align="rigid")).runs[0]
    best = float((found.delta[:, 3] ** 2).sum())
    for _ in range(20):
        turn, shift = Rotation.from_rotvec(rng.normal(0, 0.01, 3)), rng.normal(0, 0.01, 3)
        assert ((turn.apply(found.actual) + shift - wanted) ** 2).sum() >= best - 1e-12  # rounding


@pytest.mark.slow
@pytest.mark.skipif(not TRACKER.is_file(), reason="no logs of others beside the checkout")
def test_a_probe_at_the_flange_of_a_real_arm_is_found_by_a_laser_tracker() -> None:
    """A fit of base and tool leaves 0.75 to 1.1 mm of a nominal UR10, as its README says."""
    text = TRACKER.read_text().replace(",", ".").splitlines()
    names, values = text[0].split(";"), np.array([row.split(";") for row in text[1:]], dtype=np.float64)
    first, probe = names.index("shoulder_pan_joint"), names.index("measurement_x")
    q, position = values[:, first : first + 6], values[:, probe : probe + 3] / 1e3
    angles = np.radians(values[:, probe + 3 : probe + 6])
    for rotation in (angles, None):
        run = run_of(q, load_robot("ur10"), position, rotation, "xyz")
        result = compare_with_recorded_tcp(run, CompareOptions(align="base+tool"))
        found = result.runs[0]
        assert len(found.sample) == 11911
        assert result.warnings == ()
        assert 0.75e-3 < found.statistics["norm"].rms < 1.1e-3
        if rotation is not None:
            assert found.statistics["angle"].rms < np.radians(0.2)
