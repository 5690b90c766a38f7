"""How often the intervals of a cause cover the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

import urmpipe
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot

PERIOD = 0.02  # [s]
ARM = "joints = [{d = 0.12, alpha = 1.4}, {a = 0.22, alpha = 0.3}, {a = 0.19, d = 0.05}]"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "rows", "every"), [("white", 400, 1), ("correlated", 800, 1), ("sparse", 400, 4)]
)
def test_intervals_cover_the_truth_in_95_of_100_logs(
    kind: str, rows: int, every: int, tmp_path: Path
) -> None:
    """With a true share of 90 % at least 50 of 60 do (54 - 2 * 2.3, binomial).

    No more than all can: that intervals are not too wide is seen by the error in their standard deviations,
    whose rms is 0.84 at 98 % and 1.19 at 90 %, each +-0.2 (2 / sqrt(2 * 60)).
    """
    (tmp_path / "small.toml").write_text(f'kind = "dh"\nname = "small"\n{ARM}\n', "utf-8")
    arm, t, inside, errors = load_robot(tmp_path / "small.toml"), PERIOD * np.arange(rows), 0, []
    for seed in range(60):
        rng, rates = np.random.default_rng([7, seed]), np.random.default_rng(seed).uniform(0.5, 1.5, 3)
        q = [0.2, 0.9, -0.8] + np.array([0.8, 0.5, 0.7]) * np.sin(np.outer(t, rates) + np.arange(3.0))
        off = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.03))
        noise = rng.normal(0.0, 2e-4, (500 + rows, 3))
        if kind == "correlated":  # 0.1 s
            a = np.exp(-PERIOD / 0.1)
            noise = np.sqrt(1.0 - a * a) * lfilter([1.0], [1.0, -a], noise, axis=0)
        path = poses_over_log(arm, q + off * np.eye(3)[1])[0] + noise[500:]
        reference = urmpipe.ingest(name="reference", recorded_tcp=path[::every], t=t[::every])
        found = urmpipe.diagnose(reference, urmpipe.ingest(q=q, t=t, robot=arm, unit="rad"))
        (cause,) = found.causes
        assert (cause.kind, cause.name, found.undecided) == ("joint_offset", "q2", ())
        inside += cause.low[0] <= off <= cause.high[0]
        errors.append((cause.value[0] - off) / ((cause.high[0] - cause.low[0]) / (2.0 * 1.96)))
    assert inside >= 50
    assert 0.64 < np.sqrt(np.mean(np.square(errors))) < 1.39
