"""The page of many logs stays small enough to be sent."""

from __future__ import annotations

import pytest

import urmpipe
from urmpipe_datasets import LOGS
from urmpipe_pipeline.report import render_report
from urmpipe_pipeline.results import present


@pytest.mark.slow
def test_ten_logs_of_7383_samples_stay_under_25_megabytes() -> None:
    run = urmpipe.ingest(LOGS / "coppeliasim.csv", robot="urm6")
    comparison = urmpipe.compare(LOGS / "path.csv", [run] * 10)
    assert len(run.t_ns) == 7383
    page = render_report([present(comparison)])
    assert page.count('class="plot') > 50  # with all figures of each log
    assert len(page.encode("utf-8")) < 25e6
