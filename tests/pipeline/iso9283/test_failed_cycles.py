"""Cycles that do not follow the command are counted and fail the test; only parts of cycles are left out."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import urmpipe
from asserting import there
from made_runs import path_run
from repeated import along, logs, written
from urmpipe.main import run
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.compare import CompareOptions, compare_runs
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.iso9283.evaluate import IsoOptions
from urmpipe_pipeline.results import present, read_recording

TICK = 0.02  # s
START = np.array([0.1, 0.1, 0.4])  # m
SQUARE = START + np.array([[0, 0, 0], [0.2, 0, 0], [0.2, 0.2, 0], [0, 0.2, 0], [0, 0, 0]])
TRIANGLE = START + np.array([[0, 0, 0], [0.1, 0.1, 0.2], [0, 0.15, 0.1], [0, 0, 0]])
AWAY = ((0.3, 0.0, 0.2), (-0.2, 0.1, 0.1), (0.0, 0.25, 0.25), (0.1, -0.2, 0.0))  # m, from the start
OFF = np.array([0.06, 0.0, 0.0])  # m
TOLERANCE = {"AP": 4e-4, "AT": 1e-3}  # m
RESTS = round(1.0 / TICK)  # rows of the rests about a boundary between two cycles


def once(speed: float = 0.25) -> FloatArray:
    """Return one cycle: it rests for 0.5 s at both ends and in its middle."""
    return along(SQUARE, speed, rests=[2], tick=TICK)


def stopped(cycle: FloatArray) -> FloatArray:
    """Return a cycle that stops in the middle of the second leg until the next one begins."""
    row = int(np.argmin(np.linalg.norm(cycle - (SQUARE[1] + SQUARE[2]) / 2.0, axis=1)))
    return np.where(np.arange(len(cycle))[:, np.newaxis] < row, cycle, cycle[row])


DISTURBANCES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "offset in x": lambda cycle: cycle + OFF,
    "offset to the other side": lambda cycle: cycle - (0.05, 0.05, 0.0),
    "mirrored": lambda cycle: 2.0 * START - cycle,
    "stopped": stopped,
    "another path": lambda cycle: along(TRIANGLE, 0.25, tick=TICK),
}


def compared(log: FloatArray, tolerance: dict[str, float] = TOLERANCE, **options: object) -> Comparison:
    chosen = CompareOptions(tolerance, iso=IsoOptions(**options))  # type: ignore[arg-type]
    return compare_runs(path_run(once(), tsp=TICK), [path_run(log, name="log", tsp=TICK)], chosen)


def way(first: FloatArray, last: FloatArray, speed: float = 0.4) -> FloatArray:
    count = max(round(float(np.linalg.norm(last - first)) / speed / TICK), 1)
    return np.linspace(first, last, count, endpoint=False)


@pytest.mark.slow
@pytest.mark.hypothesis
@settings(max_examples=60, deadline=None)
@given(
    kinds=st.lists(st.sampled_from([None, None, *DISTURBANCES]), min_size=2, max_size=7).filter(
        lambda kinds: None in kinds
    ),
    around=st.tuples(*[st.one_of(st.none(), st.floats(0.2, 0.75), st.sampled_from(AWAY))] * 2),
    seed=st.integers(0, 999),
)
def test_no_disturbed_cycle_passes(
    kinds: list[str | None], around: tuple[float | tuple[float, ...] | None, ...], seed: int
) -> None:
    """A log begins and ends with nothing, with a part of a cycle, or far away, where it rests for long."""
    rng = np.random.default_rng(seed)
    parts: list[FloatArray] = []
    before, behind = around
    if isinstance(before, float):
        parts.append(once()[round(len(once()) * before) :])
    elif before is not None:
        parts += [np.repeat([START + before], 500, axis=0), way(START + before, START)]
    truth: list[tuple[int, int]] = []
    for kind in kinds:
        cycle = once(0.25 * rng.uniform(0.95, 1.05))
        parts.append(cycle if kind is None else DISTURBANCES[kind](cycle))
        rows = sum(map(len, parts))
        truth.append((rows - len(parts[-1]) + 1, rows))
    if isinstance(behind, float):
        parts.append(once()[: round(len(once()) * behind)])
    elif behind is not None:
        parts += [way(parts[-1][-1], START + behind), np.repeat([START + behind], 500, axis=0)]
    log = np.concatenate(parts)
    result = compared(log + rng.normal(0.0, 2e-5, log.shape))
    iso, failed = there(result.iso), len(kinds) - kinds.count(None)
    count = f"{len(kinds) - failed} of {len(kinds)} cycles" if failed else f"{len(kinds)} cycles"
    assert result.verdict == ("fail" if failed else "pass")
    assert present(result).headline.startswith(count)
    told = result.to_dict()["iso"]
    assert (len(told["cycles"]), len(told["failed_cycles"])) == (len(kinds) - failed, failed)
    disturbed = [rows for kind, rows in zip(kinds, truth, strict=True) if kind is not None]
    for failed_cycle, (first, last) in zip(iso.failed_cycles, disturbed, strict=True):
        assert abs(failed_cycle.row - first) <= RESTS and abs(failed_cycle.last_row - last) <= RESTS


def test_a_cycle_that_shows_too_little_of_the_command_fails() -> None:
    holed = once()
    leg = (
        (holed[:, 0] > SQUARE[0, 0] + 0.01)
        & (holed[:, 0] < SQUARE[1, 0] - 0.01)
        & (holed[:, 1] == SQUARE[0, 1])
    )
    holed[leg] = np.nan  # which is straight, so that every plane is crossed all the same
    log = np.concatenate([once(0.22), holed, once(0.28)])
    result = compared(log)
    (failed,) = there(result.iso).failed_cycles
    assert (result.verdict, failed.name) == ("fail", "cycle 2")
    assert failed.reason.startswith("coverage 8") and " of 90 % needed, longest unseen: 0." in failed.reason
    assert [one.shares["coverage"].value for one in result.runs] == [1.0, 1.0]
    assert compared(log, TOLERANCE | {"coverage": 0.8}).verdict == "pass"


def test_nine_of_ten_cycles_that_are_off_fail(
    shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cases = shared / "cases" / "verdict"
    if not cases.is_dir():
        pytest.skip("the folder shared has no cases of verdicts")
    out = {name: str(tmp_path / f"out.{name}") for name in ("rrd", "xml", "csv")}
    command = ["iso", str(cases / "sq.csv"), str(cases / "t10d.csv"), "-q", "-o", out["rrd"]]
    command += ["--tolerance", "AP=0.4mm,AT=1mm,RP=1mm", "--junit", out["xml"], "--csv", out["csv"]]
    assert run(command) == 1
    printed = capsys.readouterr().err
    assert (
        "FAIL  1 of 10 cycles of t10d followed sq; 9 cycles failed: cycle 1 (rows 1 to 620, up to 60"
        in printed
    )
    assert "not judged: RP" in printed and "allowed: RP of 2 cycles or more" in printed
    made = read_recording(Path(out["rrd"]))
    assert isinstance(made, Comparison)
    failed = there(made.iso).failed_cycles
    assert [cycle.name for cycle in failed] == [f"cycle {k}" for k in (1, 2, 3, 4, 6, 7, 8, 9, 10)]
    assert [cycle.distance for cycle in failed] == pytest.approx([0.06] * 9, abs=1e-4)
    cases_of = {case.get("name"): case for case in ET.parse(out["xml"]).iter("testcase")}
    failures = {name for name, case in cases_of.items() if case.find("failure") is not None}
    assert failures == {cycle.name for cycle in failed}
    assert [name for name, case in cases_of.items() if case.find("error") is not None] == [
        "can be compared (1)"
    ]
    assert Path(out["csv"]).read_text(encoding="utf-8").count(",fail\n") == 9


def test_chosen_cycles_fail_likewise() -> None:
    rows = len(once())
    log = np.concatenate((once() + OFF, once(), once(), stopped(once())))
    chosen = compared(log, cycles=((rows + 1, 2 * rows), (2 * rows + 1, 3 * rows)))
    assert chosen.verdict == "pass"  # the disturbed ones were left out on purpose
    wrong = compared(log, cycles=((1, rows), (rows + 1, 2 * rows)))
    assert wrong.verdict == "fail"
    (failed,) = there(wrong.iso).failed_cycles
    assert (failed.row, failed.last_row, failed.name) == (1, rows, "cycle 1")


def test_a_failed_log_among_the_cycles_is_exit_code_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    written(Path("square.csv"), once())
    files = [str(path) for path in logs(Path(), [once(), once() + OFF, once()])]
    command = ["iso", "square.csv", *files, "--json"]
    assert run([*command, "--tolerance", "AP=1mm"]) == 1
    told = json.loads(capsys.readouterr().out)
    (failed,) = told["iso"]["failed_cycles"]
    assert (failed["name"], failed["row"], failed["last_row"]) == ("cycle2", 1, len(once()))
    assert failed["distance"] == pytest.approx(0.06, abs=1e-9)  # the leg at x = 0.3 m is moved to 0.36 m
    assert told["verdict"] == "fail" and [one["name"] for one in told["runs"]] == ["cycle1", "cycle3"]
    assert run(command) == 0  # without a tolerance nothing is judged, and a warning names the cycle
    warnings = json.loads(capsys.readouterr().out)["warnings"]
    assert [one["about"] for one in warnings if one["kind"] == "failed-cycle"] == ["cycle2"]


def test_a_cycle_that_failed_since_the_baseline_is_worse(tmp_path: Path) -> None:
    reference = written(tmp_path / "square.csv", once())
    before = logs(tmp_path, [once()] * 3)
    written(tmp_path / "off.csv", once() + OFF)
    baseline = urmpipe.iso(reference, before)
    now = urmpipe.iso(reference, [*before[:2], tmp_path / "off.csv"], baseline=baseline)
    assert now.verdict == "fail"
    assert [str(one) for one in there(now.baseline).missing] == [f"off of {now.name}"]


@pytest.mark.parametrize(
    ("tolerance", "verdict", "code"),
    [("AP=1mm,RP=1mm", None, 2), ("AP=0.01mm,RP=1mm", "fail", 1), ("AP=1mm,dRP=1mm", None, 2)],
)
def test_a_criterion_that_needs_more_cycles_is_not_judged(
    tolerance: str, verdict: str | None, code: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reference = written(tmp_path / "square.csv", once())
    log = written(tmp_path / "log.csv", once() + OFF / 1000.0)
    output = ["-o", str(tmp_path / "out.rrd"), "--junit", str(tmp_path / "out.xml"), "--json"]
    assert run(["iso", str(reference), str(log), "--tolerance", tolerance, *output]) == code
    printed = capsys.readouterr()
    told = json.loads(printed.out)
    assert told["verdict"] == verdict
    by_name = {one["name"]: one["verdict"] for one in told["iso"]["criteria"] if one["at"] is None}
    name = tolerance.split(",")[1].removesuffix("=1mm")
    assert by_name[name] is None and by_name["AP"] == (verdict or "pass")
    assert (
        f"found {name} of 1 cycle: not judged, allowed: {name} of {11 if name == 'dRP' else 2} cycles"
        in printed.err
    )
    assert ET.parse(tmp_path / "out.xml").getroot().get("errors") == "1"
