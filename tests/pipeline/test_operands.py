"""Several operands: what is said of their logs holds for those that it fits, and never kills a path."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.chains.urm import urm_chain
from urmpipe_models.errors import LogError, UrmpipeError
from urmpipe_pipeline.operands import load_runs
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.sources import ReadOptions, read_map

TIMES = np.arange(6) / 100
TURN = np.arange(6) / 10  # as they are read: the nearest to 0.1, 0.2, ...
ROBOT = urm_chain("urm2", (0.2, 0.2, 0.2), [0.5, 0.5])

Load = Callable[..., list[Run]]


def table(*columns: tuple[str, np.ndarray], delimiter: str = ",", decimal: str = ".") -> str:
    """Return a table as text."""
    rows = zip(*(values for _, values in columns), strict=True)
    lines = [delimiter.join(f"{value:.6g}".replace(".", decimal) for value in row) for row in rows]
    return "\n".join([delimiter.join(name for name, _ in columns), *lines, ""])


PATH = table(("t [s]", TIMES), ("x", TURN), ("y", TURN), ("z", TURN))
LOG = table(("t [s]", TIMES), ("a [rad]", TURN), ("b [rad]", -TURN))


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Write some texts as files of their own, and load them as runs."""

    def load(*texts: str, robot: bool = True, **options: object) -> list[Run]:
        files = [tmp_path / f"log{k}.csv" for k in range(len(texts))]
        for file, text in zip(files, texts, strict=True):
            file.write_text(text)
        read = ReadOptions(**options)  # type: ignore[arg-type]
        return load_runs(files, robot=ROBOT if robot else None, read=read)

    return load


@pytest.mark.parametrize("joints", [("b", "a"), ("b [rad]", "a"), ("3", "2")])
def test_joints_are_those_of_the_log_and_leave_a_path(joints: tuple[str, ...], load: Load) -> None:
    path, log = load(PATH, LOG, joints=joints)
    assert (path.log.joints, path.log.tcp_position is not None) == ((), True)
    np.testing.assert_array_equal(log.log.q, np.column_stack((-TURN, TURN)))


def test_each_unit_holds_for_the_log_that_has_its_column(load: Load) -> None:
    path, log = load(PATH, LOG, units={"x": "mm", "a": "deg", "b": "deg"})
    assert path.log.units == {"t": "s", "x": "mm", "y": "mm", "z": "mm"}
    assert log.log.units == {"t": "s", "a": "deg", "b": "deg"}


def test_an_option_holds_for_every_log_that_has_its_columns(load: Load) -> None:
    runs = load(LOG, LOG, joints=("b", "a"))
    assert [run.log.joints for run in runs] == [("b", "a"), ("b", "a")]


def test_a_unit_of_all_joints_fills_what_the_logs_leave_unsaid(load: Load) -> None:
    unsaid = table(("t [s]", TIMES), ("q1", TURN), ("q2", TURN))
    named, filled = load(LOG, unsaid, units={"": "deg"})
    assert (named.log.units["a"], filled.log.units["q1"]) == ("rad", "deg")


def test_a_map_of_one_maker_leaves_the_logs_of_others_as_they_are(load: Load, tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(
        'delimiter = "semicolon"\ndecimal = "comma"\n\n[clock]\ncolumn = "Zeit"\nunit = "ms"\n\n'
        '[[joints]]\ncolumn = "A2"\nname = "one"\nunit = "deg"\nsign = -1\ninterval = [-180, 180]\n\n'
        '[[joints]]\ncolumn = "A1"\nname = "two"\nunit = "deg"\n'
    )
    german = table(("Zeit", 1e3 * TIMES), ("A1", TURN), ("A2", TURN), delimiter=";", decimal=",")
    read = read_map(tmp_path / "map.toml").read
    given = {name: getattr(read, name) for name in read.__dataclass_fields__}
    path, log, mapped = load(PATH, LOG, german, **given)
    assert [run.log.joints for run in (path, log, mapped)] == [(), ("a", "b"), ("one", "two")]
    np.testing.assert_allclose(mapped.log.q, np.radians(np.column_stack((-TURN, TURN))), rtol=1e-15)
    assert mapped.log.t_ns.tolist() == path.log.t_ns.tolist()


def test_a_form_of_orientation_holds_for_the_log_that_has_one(load: Load) -> None:
    quaternion = [
        (name, np.full(6, value)) for name, value in (("qx", 0.0), ("qy", 0.0), ("qz", 0.0), ("qw", 1.0))
    ]
    pose = [("x", TURN), ("y", TURN), ("z", TURN)]
    turned = table(("t [s]", TIMES), *pose, ("rx", TURN), ("ry", TURN), ("rz", TURN))
    runs = load(table(("t [s]", TIMES), *pose, *quaternion), turned, LOG, rotation="vector")
    assert [run.log.rotation_form for run in runs] == ["quat_xyzw", "vector", None]
    assert "rotation-not-used" not in {warning.kind for run in runs for warning in run.warnings}
    none = load(PATH, LOG, rotation="vector")
    assert [("rotation-not-used" in {one.kind for one in run.warnings}) for run in none] == [True, True]


def test_a_source_holds_for_the_log_that_it_wrote(load: Load) -> None:
    plots = [(f"Angular Displacement{k}", np.degrees(TURN)) for k in (1, 2)]
    path, log = load(PATH, table(("Time (s)", TIMES), *plots), source="solidworks")
    assert path.log.units == {"t": "s", "x": "m", "y": "m", "z": "m"}  # not mm, as SolidWorks writes
    assert (path.log.source, log.log.source) == ("path", "solidworks")
    assert log.log.units["Angular Displacement1"] == "deg"
    foreign = load(PATH, table(("t [s]", TIMES), ("q1", TURN), ("q2", TURN)), source="solidworks")
    assert [run.log.units.get("x", run.log.units.get("q1")) for run in foreign] == ["mm", "deg"]


def test_a_period_for_a_log_without_times_is_no_doubt_about_the_others(load: Load) -> None:
    unclocked = table(("a [rad]", TURN), ("b [rad]", TURN))
    path, log = load(PATH, unclocked, period=0.02)
    assert log.log.period == 0.02
    assert [warning.kind for run in (path, log) for warning in run.warnings] == ["assumed-unit"]
    assert "period-not-used" in [
        warning.kind for run in load(PATH, LOG, period=0.02) for warning in run.warnings
    ]


def test_numbers_of_columns_are_those_of_the_log_without_a_header(load: Load, tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(
        '[clock]\ncolumn = "1"\nunit = "ms"\n\n'
        '[[joints]]\ncolumn = "3"\nname = "one"\nunit = "deg"\nsign = -1\n\n'
        '[[joints]]\ncolumn = "2"\nname = "two"\nunit = "deg"\n'
    )
    read = read_map(tmp_path / "map.toml").read
    given = {name: getattr(read, name) for name in read.__dataclass_fields__}
    nameless = table(("t", 1e3 * TIMES), ("a", TURN), ("b", TURN)).split("\n", 1)[1]
    path, log, mapped = load(PATH, LOG, nameless, **given)
    assert path.log.units == {"t": "s", "x": "m", "y": "m", "z": "m"}
    assert log.log.units == {"t": "s", "a": "rad", "b": "rad"}
    np.testing.assert_array_equal(log.log.q, np.column_stack((TURN, -TURN)))
    np.testing.assert_allclose(mapped.log.q, np.radians(np.column_stack((-TURN, TURN))), rtol=1e-15)
    assert path.log.t_ns.tolist() == log.log.t_ns.tolist() == mapped.log.t_ns.tolist()


def test_units_by_number_are_of_the_log_whose_joints_have_these_numbers(load: Load) -> None:
    path, log = load(PATH, LOG, joints=("3", "2"), units={"2": "deg", "3": "deg"})
    assert path.log.units == {"t": "s", "x": "m", "y": "m", "z": "m"}
    assert log.log.units == {"t": "s", "a": "deg", "b": "deg"}


def test_that_there_is_no_time_holds_for_the_log_without_one(load: Load) -> None:
    unclocked = table(("a [rad]", TURN), ("b [rad]", TURN))
    path, log = load(PATH, unclocked, time="none", period=0.02)
    assert (path.log.period, log.log.period) == (0.01, 0.02)
    uneven = table(("t [s]", TIMES**2), ("a [rad]", TURN), ("b [rad]", TURN))
    assert [run.log.period for run in load(LOG, uneven, time="none", period=0.02)] == [0.02, 0.02]


def test_how_a_table_is_written_is_an_error_if_none_is(load: Load, tmp_path: Path) -> None:
    with pytest.raises(UrmpipeError) as caught:
        load(PATH, LOG, delimiter="semicolon")
    given = "with delimiter semicolon"
    allowed = f"and no row of numbers below it {given}, allowed: a table with a row a sample"
    assert str(caught.value).replace(f"{tmp_path}/", "").split("\n") == [
        f"log0.csv:1: found 't [s],x,y,z' {allowed}",
        f"log1.csv:1: found 't [s],a [rad],b [rad]' {allowed}",
    ]


def test_what_no_log_has_is_an_error(load: Load, tmp_path: Path) -> None:
    with pytest.raises(LogError) as caught:
        load(PATH, LOG, joints=("A1", "A2"), units={"c": "deg"})
    allowed = "allowed: t [s], x, y, z of log0.csv; t [s], a [rad], b [rad] of log1.csv"
    assert str(caught.value).replace(f"{tmp_path}/", "").split("\n") == [
        f"joints: found no column 'A1', 'A2' in any log, {allowed}",
        f"unit: found no column 'c' in any log, {allowed}",
    ]


def test_a_log_that_has_some_of_the_joints_only_is_an_error(load: Load) -> None:
    with pytest.raises(LogError) as caught:
        load(PATH, LOG, joints=("a", "c"))
    assert str(caught.value) == "joints: found no column 'c', allowed: a [rad], b [rad]"


def test_a_log_that_cannot_be_read_is_told_with_the_others(load: Load, tmp_path: Path) -> None:
    with pytest.raises(UrmpipeError) as caught:
        load(LOG.replace("0.01,", "0,"), "", joints=("b", "a"))
    assert str(caught.value).replace(f"{tmp_path}/", "").split("\n") == [
        "log0.csv:3, column t [s]: found 0 s again, allowed: times that increase from row to row",
        "log1.csv: found an empty file, allowed: a table with a row a sample",
    ]
