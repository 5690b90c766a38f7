"""What results show of themselves at a prompt and in a notebook."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import urmpipe
from diagnoses import diagnosis_of
from flat_arm import lay_flat_arm
from urmpipe_datasets import LOGS
from urmpipe_models.arm.chain import Chain, Inertial, Joint
from urmpipe_models.display import Displayable
from urmpipe_pipeline.comparison.comparison import BaselineComparison, UnmatchedQuantity
from urmpipe_pipeline.presentation.result import Result
from urmpipe_pipeline.simulations.simulation import Signal, Simulation

OTHERS = {
    "LogMap",
    "LogReading",
    "PathRows",
    "Reading",
    "TableReading",
    "Targets",
    "Transform",
}  # fmt: skip - public classes that are no results


def pendulum() -> Chain:
    """An arm of one joint with a mass."""
    return Chain("rod", (Joint("turn"),), inertials=(Inertial("turn", 1.0, (0.5, 0.0, 0.0)),))


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """One of each public result class, by its name."""
    folder = tmp_path_factory.mktemp("results")
    for name in ("matlab", "path"):
        head = (LOGS / f"{name}.csv").read_text(encoding="utf-8").splitlines()[:101]
        (folder / f"{name}.csv").write_text("\n".join(head) + "\n", encoding="utf-8")
    lay_flat_arm(folder)
    run = replace(urmpipe.ingest(folder / "matlab.csv", "urm6"), name="<b>&log")
    comparison = urmpipe.compare(folder / "path.csv", run)
    simulation = Simulation(
        name="system", description="", t_ns=np.arange(2), step=0.005, system_svg="", system_text="",
        signals=(Signal("meter", "norm", np.zeros(2)),), blocks=(), failed=None, warnings=(),
        provenance=run.provenance,
    )  # fmt: skip
    made = [
        run, run.log, comparison, comparison.runs[0], diagnosis_of(comparison.runs[0]),
        urmpipe.load_robot("urm6"), urmpipe.ik([[0.4, 0.1, 0.4]], "ur5e"), simulation,
        urmpipe.equations(pendulum()),
        urmpipe.build_fmu("dc_drive", backend="python", output=folder),
        urmpipe.plan("cube:wall,a=0.2,r=0.02,x=0.5,y=0,z=0.3", "ur5e"),
        urmpipe.accuracy(folder / "short.csv", folder / "arm.toml", velocities=[0.05], backend="python"),
        urmpipe.load_network("four-bar"), urmpipe.network_check("four-bar"),
        urmpipe.network_drive("four-bar", {"crank": (0.9, 1.0)}, steps=2),
        urmpipe.export(run, folder / "log.csv"), urmpipe.report([run], folder / "report.html"),
    ]  # fmt: skip
    return {type(one).__name__: one for one in made}


@pytest.mark.slow
def test_each_public_class_is_a_result_or_named_as_another(results: dict[str, Any]) -> None:
    public = {name for name in urmpipe.__all__ if isinstance(getattr(urmpipe, name), type)}
    errors = {name for name in public if issubclass(getattr(urmpipe, name), Exception)}
    assert public - errors - OTHERS == set(results)
    assert all(isinstance(one, Displayable) for one in results.values())


@pytest.mark.slow
def test_each_result_is_a_line_a_page_a_dictionary_and_a_frame(results: dict[str, Any]) -> None:
    for name, one in results.items():
        line, html = repr(one), one._repr_html_()
        assert line.startswith(f"<{name} ") and line.endswith(">") and line.isprintable() and len(line) <= 120
        assert html.startswith(f"<p><b>{name}</b> ") and "<table" in html and "<b>&log" not in html
        if name not in ("Chain", "Network"):  # which are described
            assert one.to_dict()
            assert len(one.to_frame().columns) > 1 or name == "Report"
    assert "&lt;b&gt;&amp;log: 100 rows" in results["Run"]._repr_html_()
    assert repr(results["Run"]) == "<Run <b>&log: urm6, 100 rows in 0.495 s, grid of 100 samples>"
    line = "<Comparison <b>&log-against-path: pass, on 1 assumption: <b>&log pass (4.56e-05 m), 1 warning>"
    assert repr(results["Comparison"]) == line
    assert repr(results["IkResult"]) == "<IkResult targets: pass, ur5e, 1 of 1 target reached, iterative>"


@pytest.mark.slow
def test_of_many_logs_the_worst_is_shown_first(results: dict[str, Any]) -> None:
    one = results["Comparison"]
    (good,) = one.runs
    largest = replace(good.statistics["x"], max=0.0758, tolerance=0.0035, verdict="fail")
    bad = replace(good, name="<run 7>", verdict="fail", statistics={**good.statistics, "x": largest})
    every = replace(one, name="ten", runs=(*(replace(good, name=f"run {k}") for k in range(9)), bad))
    assert repr(every).startswith(
        "<Comparison ten: fail (1 of 10 logs), on 1 assumption: <run 7> fail (0.0758 m), run "
    )
    html = every._repr_html_()
    ranking = html.split("<table>")[2].split("</table>")[0]
    cells = [row.split("<td>")[1:3] for row in ranking.split("<tr>")[2:]]
    assert len(cells) == 8
    assert cells[-1] == ["&lt;run 7&gt;</td>", "FAIL</td>"]
    assert "75.80" in html
    assert "<p>8 of 10 rows</p>" in html
    worse = replace(
        one, baseline=BaselineComparison("before", None, {}, (), (), (UnmatchedQuantity("old"),), ())
    )
    assert repr(worse).startswith(
        "<Comparison <b>&log-against-path: fail, worse than the baseline, on 1 assumption: <b>&log pass"
    )


@pytest.mark.slow
def test_a_deviation_has_every_quantity_over_time(results: dict[str, Any]) -> None:
    deviation = results["Deviation"]
    frame = deviation.to_frame()
    assert list(frame.columns) == ["t", *(one.quantity for one in deviation.all_statistics)]
    assert (frame["norm"].to_numpy() == deviation.delta[:, 3]).all()
    assert frame["x"].abs().max() == deviation.statistics["x"].max


def test_warnings_are_counted_in_the_line_and_listed_in_the_notebook(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,q1\n0,0.1\n0.005,0.2\n0.01,0.3\n", encoding="utf-8")
    with pytest.warns(urmpipe.UrmpipeWarning):
        run = urmpipe.ingest(log)
    assert repr(run).endswith(f", {len(run.warnings)} warning{'s' if len(run.warnings) > 1 else ''}>")
    assert all(escape(str(warning)) in run._repr_html_() for warning in run.warnings)


@pytest.mark.slow
def test_each_result_plots_its_main_figure_and_names_those_there_are(results: dict[str, Any]) -> None:
    whole = replace(results["Diagnosis"], comparison=results["Comparison"])  # as urmpipe.diagnose returns it
    plotted = [one for one in (results | {"Diagnosis": whole}).values() if isinstance(one, Result)]
    assert len(plotted) == 9
    for one in plotted:
        made = one.plot(width="column", font=7.0)
        assert isinstance(made, Figure)
        assert made.get_figwidth() == pytest.approx(0.088 / 0.0254)
        assert made.axes
        with pytest.raises(urmpipe.OptionError, match=r"^title: found 'nothing such'.*, allowed: "):
            one.plot("nothing such")


@pytest.mark.slow
def test_a_frame_plots_itself_with_the_extra_as_docs_say(results: dict[str, Any]) -> None:
    axes = results["Deviation"].to_frame().set_index("t").plot()
    assert {"x", "y", "z", "norm"} <= {line.get_label() for line in axes.lines}
