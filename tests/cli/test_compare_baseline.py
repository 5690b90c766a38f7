"""compare on the command line against an earlier comparison: what got worse, what is gone."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from four_logs import NOISE, Captured, compare, lay_logs, names, read_lines, recorded, said
from urmpipe.main import run
from urmpipe_pipeline.comparison.baseline import format_worse_count


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a reference and three logs: within tolerance, a little worse, and out of it."""
    return lay_logs(tmp_path, monkeypatch)


@pytest.mark.slow
def test_a_log_of_the_baseline_that_is_missing_is_exit_code_1() -> None:
    assert compare("good.csv", "-q", "-o", "before.rrd") == 0
    assert compare("good.csv", "slack.csv", "--baseline", "before.rrd", "-q", "-o", "now.rrd") == 0
    assert compare("slack.csv", "--baseline", "before.rrd", "-q", "-o", "now.rrd") == 1
    assert names() == {"before.rrd", "now.rrd"}


@pytest.mark.slow
def test_a_comparison_is_held_against_another(folder: Path, capsys: Captured) -> None:
    assert compare("good.csv", "-q", "-o", "before.rrd") == 0
    (folder / "good.csv").write_bytes((folder / "slack.csv").read_bytes())
    assert compare("good.csv", "-q", "-o", "now.rrd") == 0
    capsys.readouterr()
    assert run(["compare", "now.rrd", "--baseline", "before.rrd", "--json", "--junit", "v.xml"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert (told["verdict"], told["recording"], told["baseline"]["verdict"]) == ("fail", "now.rrd", "fail")
    assert told["baseline"]["recording"] == "before.rrd"
    x = next(one for one in told["baseline"]["changes"] if one["quantity"] == "x")
    before, now = (recorded(name).runs[0] for name in ("before.rrd", "now.rrd"))
    assert x["max"] == {"before": before.statistics["x"].max, "now": now.statistics["x"].max}
    assert x["largest_change"] == np.abs(now.delta[:, 0] - before.delta[:, 0]).max()
    types = {one.get("type") for one in ET.parse("v.xml").iter("failure")}
    assert types == {"worse-than-baseline"}
    assert names() == {"before.rrd", "now.rrd", "v.xml"}

    noise = ["--noise", "1mm,angle=1deg,joint=1deg"]
    assert run(["compare", "now.rrd", "--baseline", "before.rrd", "-q", *noise]) == 0
    assert run(["compare", "before.rrd", "--baseline", "now.rrd", "-q"]) == 0
    none = ["--noise", "0,angle=0,joint=0"]
    assert run(["compare", "before.rrd", "--baseline", "before.rrd", "-q", *none]) == 0
    assert compare("good.csv", "--baseline", "before.rrd", "-q") == 1
    assert recorded("now.rrd").baseline is None
    kept = recorded("good-against-wanted.rrd").baseline
    assert kept is not None and (kept.verdict, kept.recording) == ("fail", Path("before.rrd"))


@pytest.mark.slow
def test_what_changed_is_printed(folder: Path, capsys: Captured) -> None:
    assert compare("good.csv", "bad.csv", "-q", "-o", "before.rrd") == 1
    (folder / "good.csv").write_bytes((folder / "slack.csv").read_bytes())
    assert compare("good.csv", "slack.csv", "-q", "-o", "now.rrd", "--tolerance", "4mm") == 0
    capsys.readouterr()
    assert run(["compare", "now.rrd", "--baseline", "before.rrd"]) == 1
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert "Since the baseline: 12 quantities worse, 1 gone" in lines
    title = "Against the baseline against-wanted: Changed since against-wanted by more than the noise"
    begin = lines.index(title)
    before, now = (recorded(name).runs[0].statistics["x"] for name in ("before.rrd", "now.rrd"))
    row = next(line for line in lines[begin:] if line.startswith("good") and "Δx" in line)
    shown = [f"{one * 1e3:.4f} mm" for one in (before.max, now.max, before.rms, now.rms)]
    assert " ".join(shown) in " ".join(row.split())
    assert {
        "Noise: axis 0.001 mm, norm 0.001 mm, path 0.001 mm, angle 5.72958e-05 deg, joint 5.72958e-05 deg",
        "New: slack",
        "Gone: bad",
        'tolerance  {"axis": "3.5 mm"}  {"axis": "4 mm"}',
    } <= set(lines)


@pytest.mark.slow
def test_the_report_of_a_recording_says_what_the_exit_code_said(folder: Path) -> None:
    assert compare("good.csv", "-q", "-o", "before.rrd") == 0
    noise = ["--noise", "50um,angle=1deg,joint=1deg"]
    assert compare("slack.csv", "--baseline", "before.rrd", "-q", "-o", "now.rrd", *noise) == 1
    assert run(["report", "now.rrd", "-q"]) == 0
    page = Path("now.html").read_text(encoding="utf-8")
    assert "<title>FAIL: slack-against-wanted" in page
    assert ", by the joints on both sides, but worse than the baseline good-against-wanted" in page
    assert "Against the baseline good-against-wanted" in page
    held = recorded("now.rrd").baseline
    assert held is not None and format_worse_count(held) in page


@pytest.mark.slow
def test_a_noise_that_reaches_the_tolerance_is_told(capsys: Captured) -> None:
    assert compare("good.csv", "-q", "-o", "before.rrd") == 0
    capsys.readouterr()
    noise = ["--baseline", "before.rrd", "--noise", "0.5m", "-o", "now.rrd"]
    assert compare("slack.csv", *noise) == 1  # by its angles: a length is for lengths alone
    told = [line for line in capsys.readouterr().err.splitlines() if "noise" in line]
    assert told == [
        "warning: a noise of 500 mm (axis) reaches the tolerance of 3.5 mm: nothing within it can be worse"
        " than the baseline; a number without a unit is in m"
    ]
    again = ["compare", "now.rrd", "--baseline", "before.rrd"]
    assert run([*again, "--noise", "0.5m"]) == 1
    assert [line for line in capsys.readouterr().err.splitlines() if "noise" in line] == told
    assert run([*again, "--noise", "0.5mm", "--strict"]) == 1  # the doubt about another noise is gone
    assert "noise" not in capsys.readouterr().err
    assert compare("slack.csv", *noise, "--strict", "-q") == 2
    assert compare("slack.csv", "-q", "-o", "now.rrd") == 0


def test_how_a_comparison_is_made_is_refused_for_one_that_is(capsys: Captured) -> None:
    assert compare("good.csv", "-q", "-o", "a.rrd") == 0
    given = ["--tolerance", "1mm", "--align", "none", "-o", "b.rrd"]
    assert run(["compare", "a.rrd", "--baseline", "a.rrd", *given]) == 2
    assert said(capsys) == (
        "error: --tolerance, --output, --align: found with the recording of a comparison (a.rrd), which"
        " stands as it was made, allowed: with the logs themselves"
    )
    assert run(["compare", "a.rrd"]) == 2
    assert said(capsys) == (
        "error: a.rrd: found the recording of a comparison, allowed: one that ingest wrote; --baseline"
        " RUN.rrd compares it, alone, with an earlier one"
    )


def test_a_baseline_is_the_recording_of_a_comparison(capsys: Captured) -> None:
    assert run(["ingest", "good.csv", "--robot", "ur5e", "-q"]) == 0
    for baseline, found in (
        ("good.rrd", "baseline (--baseline): found a recording (run), allowed: that of a comparison"),
        ("good.csv", "found no recording of urmpipe, allowed: a .rrd that ingest, compare or simulate wrote"),
        (
            "missing.rrd",
            "baseline (--baseline): found no such file, allowed: the recording of an earlier comparison",
        ),
    ):
        assert compare("good.csv", "--baseline", baseline, "-q") == 2
        assert said(capsys) == f"error: {baseline}: {found}"
    assert compare("good.csv", "--noise", "1um", "-q") == 2
    assert said(capsys) == (
        "error: noise (--noise): found no baseline, allowed: with an earlier comparison; --baseline"
        " RUN.rrd sets one"
    )
    assert compare("good.csv", "--baseline", "good.rrd", "--noise", "-1", "-q") == 2
    assert said(capsys) == f"error: noise (--noise): found '-1', {NOISE}"


@pytest.mark.slow
def test_a_quiet_failure_against_a_baseline_says_what_is_worse(capsys: Captured) -> None:
    assert compare("good.csv", "bad.csv", "-q", "-o", "before.rrd") == 1
    capsys.readouterr()
    noise = ["--noise", "50um,angle=1deg,joint=1deg"]
    assert compare("slack.csv", "good.csv", "-q", "-o", "now.rrd", "--baseline", "before.rrd", *noise) == 1
    verdict, *facts = capsys.readouterr().err.splitlines()
    assert verdict.endswith("by the joints on both sides, but worse than the baseline against-wanted")
    assert facts[0] == "      Closest to the limit: slack"
    assert facts[-2:] == ["      Since the baseline: 1 gone", "      Gone: bad"]
    good = read_lines("good.csv")
    Path("good.csv").write_text("".join(good[:120]))
    assert compare("good.csv", "bad.csv", "-q", "-o", "now.rrd", "--baseline", "before.rrd", *noise) == 1
    *_, since, worse = capsys.readouterr().err.splitlines()
    assert since == "      Since the baseline: 12 quantities worse"
    assert worse.startswith("      Worse: Δx of good (samples), Δy of good (samples), ")


def test_a_baseline_is_never_replaced(capsys: Captured) -> None:
    assert compare("good.csv", "-q") == 0
    assert compare("good.csv", "--baseline", "good-against-wanted.rrd", "-q") == 2
    assert said(capsys) == (
        "error: good-against-wanted.rrd: found an input of this command,"
        " allowed: any other name for the recording"
    )
