"""The cycles of a test with noise and disturbances; whole answers are in cycles.cases."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asserting import there
from made_runs import path_run
from repeated import along, curve, eight, evaluated, judged, logs, repeated, still, told, value, written
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.iso import IsoOptions, measure_iso
from urmpipe_pipeline.results import present, read_recording

START = np.array([0.1, 0.1, 0.4])  # m
SQUARE = START + np.array([[0, 0, 0], [0.2, 0, 0], [0.2, 0.2, 0], [0, 0.2, 0], [0, 0, 0]])
TRIANGLE = START + np.array([[0, 0, 0], [0.1, 0.1, 0.2], [0, 0.15, 0.1], [0, 0, 0]])
REST = 100  # rows of a rest of 0.5 s


def moving(corners: FloatArray | Sequence[Sequence[float]], rests: Sequence[int] = ()) -> FloatArray:
    """A motion without the rests at its ends."""
    return along(corners, 0.25, rests=rests)[REST:-REST]


WAYS: dict[str, tuple[Callable[[], FloatArray], FloatArray | None, int]] = {
    "square from a corner": (lambda: moving(SQUARE), None, 29),
    "pose to pose": (lambda: moving(TRIANGLE, [1, 2]), None, 9),
    "figure eight from its crossing": (lambda: curve(eight(0.2), 0.25, rest=0.0), None, 9),
    "open, with a return": (lambda: moving(SQUARE[:3]), moving(SQUARE[[2, 0]]), 9),
}


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_all_are_found_with_noise_but_a_cut_one(way: str, tmp_path: Path) -> None:
    make, back, whole = WAYS[way]
    path = make()
    log, rests = repeated(path, whole + 1, [*WAYS].index(way), back=back)
    cut = REST + len(path) // 3
    resting = np.concatenate((np.repeat(path[:1], REST, axis=0), path, np.repeat(path[-1:], REST, axis=0)))
    reference = written(tmp_path / "command.csv", resting)
    result = evaluated(reference, written(tmp_path / "log.csv", log[cut:]))
    assert len(judged(result).cycles) == len(result.runs) == whole
    step = 1 if back is None else 2  # rests at both ends of each cycle
    begins, ends = rests[step::step], rests[step + 1 :: step]
    for cycle, begin, end in zip(judged(result).cycles, begins, ends, strict=False):
        assert begin[0] <= cycle.row - 1 + cut <= begin[1]
        assert end[0] <= cycle.last_row - 1 + cut <= end[1]
    of_noise = ("few-cycles", "noise-beyond-band", "noisy-speed")  # 0.1 mm from row to row
    kinds = [warning.kind for warning in result.warnings if warning.kind not in of_noise]
    assert kinds == ["cut-cycle"] + ([] if back is None else ["return-path"])
    # RP of means of 50 rows or more of noise of 0.1 mm: 3.616 . 0.1 mm/7; twice that is chance of 1e-9
    assert value(judged(result), "RP") < 2.0 * 3.616 * 1e-4 / np.sqrt(50.0)
    assert value(judged(result), "AP") < 1e-4 * 6.0 / np.sqrt(50.0 * whole)  # chi with 3 degrees: 1e-7
    # RT of crossings between two rows: 3.616 . 0.1 mm in space, less in a plane; the largest of 50
    assert 2e-4 < value(judged(result), "RT") < 5e-4


@pytest.mark.slow
@pytest.mark.parametrize(("tick", "speed", "size"), [(0.001, 0.1, 0.1), (0.005, 0.02, 0.01)])
def test_noise_beyond_a_step_hides_no_motion(tick: float, speed: float, size: float, tmp_path: Path) -> None:
    # A step from row to row is as large as the noise; 50 ms, over which speed is averaged, are 1 mm or more.
    path = along(((0, 0, 0.4), (size, 0, 0.4), (size, size, 0.4)), speed, tick=tick)
    t, rng = tick * np.arange(len(path)), np.random.default_rng(1)
    reference = written(tmp_path / "command.csv", path, t)
    cycles = [written(tmp_path / f"{k}.csv", path + rng.normal(0.0, 1e-4, path.shape), t) for k in range(3)]
    assert len(told(reference, cycles).cycles) == 3


POSES = np.array([[0.1 * k, 0.05 * k * k, 0.3] for k in range(5)])


@pytest.mark.slow
def test_30_visits_of_5_static_poses_in_one_log_and_in_30(tmp_path: Path) -> None:
    visits = np.tile(POSES, (30, 1)) + np.random.default_rng(1).normal(0.0, 1e-4, (150, 3))
    reference = still(tmp_path / "poses.csv", POSES)
    iso = told(reference, still(tmp_path / "visits.csv", visits), poses=True)
    assert [(cycle.row, cycle.last_row) for cycle in iso.cycles] == [
        (5 * k + 1, 5 * k + 5) for k in range(30)
    ]
    assert 0.0 < value(iso, "AP") < 6e-4 / np.sqrt(30.0)  # of 30: chi with 3 degrees beyond 6 is 1e-7
    files = [still(tmp_path / f"visit{k}.csv", visits[5 * k : 5 * k + 5]) for k in range(30)]
    assert told(reference, files, poses=True).criteria == iso.criteria
    assert not any(one.name in ("AT", "PSt", "AV") and one.value for one in iso.criteria)


def test_a_missing_pose_moves_no_other_and_has_no_value(tmp_path: Path) -> None:
    visits = np.tile(POSES, (6, 1))
    visits[7] = np.nan  # pose 3 of the second visit, which is a failed cycle
    wanted = np.where(np.arange(5)[:, np.newaxis] == 2, np.nan, POSES)
    log = still(tmp_path / "visits.csv", visits)
    iso = told(still(tmp_path / "poses.csv", POSES), log, poses=True)
    assert (value(iso, "AP"), value(iso, "RP")) == pytest.approx((0.0, 0.0), abs=1e-12)
    iso = told(still(tmp_path / "fewer.csv", wanted), log, poses=True)
    assert not any(one.value is not None and np.isnan(one.value) for one in iso.criteria)


def test_a_table_of_criteria_replaces_an_earlier_one(tmp_path: Path) -> None:
    path = written(tmp_path / "path.csv", along(SQUARE, 0.25))
    for planes in (1, 2):
        iso = told(path, logs(tmp_path, [along(SQUARE, 0.25)]), csv=tmp_path / "iso.csv", planes=planes)
        lines = (tmp_path / "iso.csv").read_text(encoding="utf-8").splitlines()
        assert [line.split(",")[0] for line in lines[1:]] == [criterion.name for criterion in iso.criteria]


# --- cycles that do not follow the command ----------------------------------------------------------

TICK = 0.02  # s, from row to row
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
    chosen = IsoOptions(tolerance, **options)  # type: ignore[arg-type]
    return measure_iso(path_run(once(), tsp=TICK), [path_run(log, name="log", tsp=TICK)], chosen)


def way(first: FloatArray, last: FloatArray) -> FloatArray:
    count = max(round(float(np.linalg.norm(last - first)) / 0.4 / TICK), 1)
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
    assert result.verdict == ("fail" if failed else "pass")
    count = f"{len(kinds) - failed} of {len(kinds)} cycles" if failed else f"{len(kinds)} cycles"
    assert present(result).headline.startswith(count)
    assert (len(iso.cycles), len(iso.failed_cycles)) == (len(kinds) - failed, failed)
    disturbed = [rows for kind, rows in zip(kinds, truth, strict=True) if kind is not None]
    for failed_cycle, (first, last) in zip(iso.failed_cycles, disturbed, strict=True):
        assert abs(failed_cycle.row - first) <= RESTS and abs(failed_cycle.last_row - last) <= RESTS


def test_a_cycle_that_shows_too_little_of_the_command_fails() -> None:
    holed = once()
    on_leg = (holed[:, 1] == SQUARE[0, 1]) & (np.abs(holed[:, 0] - SQUARE[0, 0] - 0.1) < 0.09)
    holed[on_leg] = np.nan  # which is straight, so that every plane is crossed all the same
    log = np.concatenate([once(0.22), holed, once(0.28)])
    result = compared(log)
    (failed,) = there(result.iso).failed_cycles
    assert (result.verdict, failed.name) == ("fail", "cycle 2")
    assert failed.reason.startswith("coverage 8") and " of 90 % needed, longest unseen: 0." in failed.reason
    assert [run.shares["coverage"].value for run in result.runs] == [1.0, 1.0]
    assert compared(log, TOLERANCE | {"coverage": 0.8}).verdict == "pass"


def test_chosen_cycles_fail_likewise() -> None:
    rows = len(once())
    log = np.concatenate((once() + OFF, once(), once(), stopped(once())))
    chosen = compared(log, cycles=((rows + 1, 2 * rows), (2 * rows + 1, 3 * rows)))
    assert chosen.verdict == "pass"  # the disturbed ones were left out on purpose
    wrong = compared(log, cycles=((1, rows), (rows + 1, 2 * rows)))
    assert wrong.verdict == "fail"
    (failed,) = there(wrong.iso).failed_cycles
    assert (failed.row, failed.last_row, failed.name) == (1, rows, "cycle 1")


def test_nine_of_ten_cycles_that_are_off_fail(shared: Path, tmp_path: Path) -> None:
    cases = shared / "cases" / "verdict"
    if not cases.is_dir():
        pytest.skip("the folder shared has no cases of verdicts")
    out = {name: tmp_path / f"out.{name}" for name in ("rrd", "xml", "csv")}
    result = evaluated(
        cases / "sq.csv", cases / "t10d.csv", tolerance="AP=0.4mm,AT=1mm,RP=1mm",
        output=out["rrd"], junit=out["xml"], csv=out["csv"],
    )  # fmt: skip
    headline = present(result).headline
    assert headline.startswith(
        "1 of 10 cycles of t10d followed sq; 9 cycles failed: cycle 1 (rows 1 to 620, up to 60"
    )
    assert "not judged: RP" in headline
    recording = read_recording(out["rrd"])
    assert isinstance(recording, Comparison)
    failed = judged(recording).failed_cycles
    assert [cycle.name for cycle in failed] == [f"cycle {k}" for k in (1, 2, 3, 4, 6, 7, 8, 9, 10)]
    assert [cycle.distance for cycle in failed] == pytest.approx([0.06] * 9, abs=1e-4)
    found = {case.get("name"): {part.tag for part in case} for case in ET.parse(out["xml"]).iter("testcase")}
    assert {name for name, tags in found.items() if "failure" in tags} == {cycle.name for cycle in failed}
    assert [name for name, tags in found.items() if "error" in tags] == ["can be compared (1)"]
    assert out["csv"].read_text(encoding="utf-8").count(",fail\n") == 9


def test_a_cycle_that_failed_since_the_baseline_is_worse(tmp_path: Path) -> None:
    reference = written(tmp_path / "square.csv", once())
    before = logs(tmp_path, [once()] * 3)
    off = written(tmp_path / "off.csv", once() + OFF)
    now = evaluated(reference, [*before[:2], off], baseline=evaluated(reference, before))
    assert now.verdict == "fail"
    assert [str(change) for change in there(now.baseline).missing] == [f"off of {now.name}"]


@pytest.mark.parametrize(
    ("tolerance", "verdict", "name", "cycles"),
    [
        ("AP=1mm,RP=1mm", None, "RP", 2),
        ("AP=0.01mm,RP=1mm", "fail", "RP", 2),
        ("AP=1mm,dRP=1mm", None, "dRP", 11),
    ],
)
def test_a_criterion_that_needs_more_cycles_is_not_judged(
    tolerance: str, verdict: str | None, name: str, cycles: int, tmp_path: Path
) -> None:
    reference = written(tmp_path / "square.csv", once())
    result = evaluated(reference, logs(tmp_path, [once() + OFF / 1000.0]), tolerance=tolerance)
    verdicts = {criterion.name: criterion.verdict for criterion in judged(result).overall}
    assert (result.verdict, verdicts[name], verdicts["AP"]) == (verdict, None, verdict or "pass")
    (section,) = (one for one in present(result).body.sections if one.errors)
    assert [(error.found, error.allowed) for error in section.errors] == [
        (f"{name} of 1 cycle: not judged", f"{name} of {cycles} cycles or more")
    ]
