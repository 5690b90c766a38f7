"""--strict: a doubt about the motion fails the run, and nothing is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from urmpipe_models.arrays import FloatArray
from urmpipe_models.errors import LogError

Spoil = Callable[[FloatArray], FloatArray]


def outlier_first(q: FloatArray) -> FloatArray:
    return np.vstack((q[:1] + 0.4, q[1:]))


def outlier_last(q: FloatArray) -> FloatArray:
    return np.vstack((q[:-1], q[-1:] - 0.4))


def repeated_samples(q: FloatArray) -> FloatArray:
    return q[np.arange(len(q)) // 4 * 4]


def joint_limit(q: FloatArray) -> FloatArray:
    return q + 6.0  # of 2 pi


def speed_limit(q: FloatArray) -> FloatArray:
    return q + np.where(np.arange(len(q)) < 100, 0.0, 0.2)[:, None]  # in 5 ms


@pytest.mark.parametrize(
    ("spoil", "row"),
    [(outlier_first, 1), (outlier_last, 200), (repeated_samples, 2), (joint_limit, 1), (speed_limit, 101)],
)
def test_a_doubt_is_a_warning_and_with_strict_an_error(
    urmpipe: Callable[..., Any], tmp_path: Path, spoil: Spoil, row: int
) -> None:
    kind = spoil.__name__.replace("_", "-")
    t = 0.005 * np.arange(200)
    q = spoil(np.cos(np.outer(t, 0.5 + 0.1 * np.arange(6))))
    header = "t [s]," + ",".join(f"q{j} [rad]" for j in range(1, 7))
    log = tmp_path / "log.csv"
    np.savetxt(log, np.column_stack([t, q]), fmt="%.9f", delimiter=",", header=header, comments="")

    ran = urmpipe("ingest", log, "--robot", "ur5e", "--json", "-o", "run.rrd")
    assert ran.code == 0, ran.err
    warnings = json.loads(ran.out)["warnings"]
    assert {warning["kind"] for warning in warnings} == {kind}
    assert warnings[0]["row"] == row
    assert f"warning: row {row}: {warnings[0]['message']}" in ran.err.splitlines()

    (tmp_path / "run.rrd").unlink()
    strict = urmpipe("ingest", log, "--robot", "ur5e", "--strict", "-o", "run.rrd")
    assert strict.code == 2
    assert f"error: {kind}: row {row}: {warnings[0]['message']} (--strict)" in strict.err.splitlines()
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


def test_what_an_offset_leaves_out_is_no_doubt(tmp_path: Path) -> None:
    t = 0.005 * np.arange(400)
    q = np.cos(np.outer(t, 0.5 + 0.4 * np.arange(6)))
    header = "t [s]," + ",".join(f"q{j} [rad]" for j in range(1, 7))
    for name, rows in (("wanted", slice(300)), ("late", slice(100, 400))):
        table = np.column_stack([t[:300], q[rows]])
        np.savetxt(tmp_path / f"{name}.csv", table, fmt="%.9f", delimiter=",", header=header, comments="")
    wanted, late = tmp_path / "wanted.csv", tmp_path / "late.csv"
    result = urmpipe.compare(wanted, [late], robot="ur5e", sync="auto", strict=True)
    assert result.runs[0].sync.offset == pytest.approx(0.5, abs=1e-7)  # of values to 1e-9 rad
    assert [(one.kind, one.message) for one in result.warnings] == [
        (
            "sync-left-out",
            "late: the offset of 0.5 s leaves 100 of 300 samples and 100 of 300 samples of wanted without the"
            " other side",
        )
    ]
    with pytest.raises(LogError) as error:
        urmpipe.compare(wanted, [late], robot="ur5e", sync="auto", tsp=0.0051, strict=True)
    assert "resampled" in str(error.value)
