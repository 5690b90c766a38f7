"""All logs of a comparison in one figure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.report.figures_overview import overview_figure


def test_a_logarithmic_overview_reaches_the_tolerance(comparison: Comparison) -> None:
    reference, off = comparison.runs[0].run, comparison.runs[1].run
    assert reference.tcp is not None
    near = replace(reference, name="near", tcp=replace(reference.tcp, position=reference.tcp.position + 1e-6))
    logs = [near, off]
    figure = overview_figure(compare_runs(reference, logs, CompareOptions({"norm": 2.0})))
    assert figure is not None
    axis = figure.spec["layout"]["yaxis"]
    (line,) = figure.spec["layout"]["shapes"]
    assert axis["type"] == "log"
    assert line["y0"] == 2000.0
    assert axis["range"][1] > np.log10(line["y0"])
