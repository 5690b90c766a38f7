"""The mutation score: which module is a model, what an exit code says, and how sure a share is."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from mutants.modules import PACKAGE, is_model, modules
from mutants.results import Known, Score, equivalent, function, known_mutants, outcome, stale
from mutants.runner import prepare, said
from mutants.tables import interval, share, table, total, unclear
from mutants.workspace import BUDGET, codes, codes_file, draw, suited

ROOT = Path(__file__).parents[2]


def score(module: str, mutants: int, killed: int, survived: int, **codes: int | None) -> Score:
    tried = {f"k{i}": 1 for i in range(killed)} | {f"s{i}": 0 for i in range(survived)}
    return Score(f"{PACKAGE}.{module}", mutants, {**tried, **codes})


def test_modules_are_found_by_folder_by_dotted_name_and_by_their_last_part() -> None:
    folder = ROOT / "models"
    assert modules(folder, ["forward"]) == [f"{PACKAGE}.kinematics.forward"]
    assert modules(folder, ["kinematics.forward"]) == modules(folder, ["forward"])
    assert set(modules(folder, ["drives.*"])) >= {
        f"{PACKAGE}.drives.{one}" for one in ("controller", "drive")
    }
    everything = modules(folder, ["*"])
    assert not any(name.endswith("__init__") for name in everything)
    models = {name.removeprefix(f"{PACKAGE}.") for name in everything if is_model(name)}
    assert {"repolarizer", "kinematics.motion", "chains.dh", "drives.set_point"} <= models
    assert not any(name.startswith(("inverse.", "robots.", "files.")) for name in models)


def test_only_what_a_test_told_is_killed() -> None:
    assert [outcome(code) for code in (1, 0, -24, 33, 5)] == [
        *("killed", "survived", "timeout"),
        *("no tests", "no tests"),
    ]
    segmentation_fault, killed_by_the_system, internal_error, could_not_be_run = -11, -9, 3, 255
    for code in (segmentation_fault, killed_by_the_system, internal_error, could_not_be_run, 2, 4):
        assert outcome(code) == "broken"
    assert outcome(None) == "untried"


def test_what_broke_counts_as_not_found_and_what_was_not_tried_as_nothing() -> None:
    mixed = score("chains.dh", 12, 6, 2, fault=-11, later=None)
    assert (mixed.found, mixed.tried, mixed.meaningful) == (6, 9, 9)
    assert unclear([mixed])[-2:] == ["- fault: exit code -11", "- later: not tried"]
    assert unclear([score("chains.dh", 3, 3, 0)]) == []


def test_a_mutant_is_known_by_its_function_and_its_lines() -> None:
    name = f"{PACKAGE}.chains.chain.xǁChainǁplaced__mutmut_3"
    assert function(name) == "chains.chain.Chain.placed"
    assert function(f"{PACKAGE}.delta.x__solve__mutmut_1") == "delta._solve"
    changes = {name: "-    return a + b\n+    return b + a"}
    known = Known("chains.chain.Chain.placed", "return a + b", "return b + a", "sums commute")
    assert equivalent(changes, [known]) == {name}
    assert equivalent(changes, [Known("chains.chain.Chain.moved", known.was, known.becomes, "")]) == set()
    assert equivalent({name: "-    return a + b\n+    return b - a"}, [known]) == set()


def test_a_known_mutant_that_is_none_any_more_is_told_where_all_were_tried() -> None:
    known = [Known("chains.chain.Chain.placed", "return a + b", "return b + a", "sums commute")]
    assert stale({}, known, [score("chains.chain", 4, 4, 0)]) == known
    assert stale({}, known, [score("chains.chain", 40, 4, 0), score("chains.dh", 4, 4, 0)]) == []


def test_each_known_mutant_has_a_reason_and_is_of_a_module() -> None:
    names = {name.removeprefix(f"{PACKAGE}.") for name in modules(ROOT / "models", ["*"])}
    for one in known_mutants():
        assert one.why.endswith(".")
        assert any(one.of.startswith(f"{name}.") for name in names), one.of


def test_the_interval_of_a_sample_is_wilson_s() -> None:
    # Printed in Newcombe 1998, Statistics in Medicine 17, table I: 81/263, 15/148, 0/20, 1/29 by method 3.
    for found, tried, low, high in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
    ):
        assert interval(found, tried) == pytest.approx((low, high), abs=5e-5)  # four digits are printed
    assert interval(1, 29) == pytest.approx((0.0061, 0.1718), abs=5e-5)


def test_a_module_that_was_tried_whole_has_no_interval() -> None:
    assert str(share(9, 10, whole=True)) == "90.0 %"
    assert str(share(9, 10, whole=False)) == "90.0 % (60 to 98 %)"
    assert str(total([score("chains.dh", 10, 9, 1), score("delta", 30, 30, 0)])) == "97.5 %"


def test_a_total_weighs_modules_by_their_mutants_and_is_unsure_by_what_was_not_tried() -> None:
    whole, sampled = score("chains.dh", 100, 90, 10), score("delta", 300, 15, 5)
    found = total([whole, sampled])
    assert found.found == pytest.approx(0.25 * 0.9 + 0.75 * 0.75)
    # 1.96 * 0.75 * sqrt(p (1 - p) / 20 * (1 - 20 / 300)) with p = 16 / 22
    assert found.high - found.found == pytest.approx(0.141427, abs=1e-6)
    assert found.found - found.low == pytest.approx(0.141427, abs=1e-6)


def test_equivalent_mutants_are_left_out_of_the_score_and_stay_in_the_raw_one() -> None:
    one = score("chains.dh", 10, 8, 2)
    known = Score(one.module, one.mutants, one.codes, frozenset({"s0"}))
    assert known.left == ["s1"]
    assert table("Models", [known])[1:] == [
        "## Models: 88.9 %, with the equivalent ones 80.0 %",
        "",
        "| module | mutants | tried | killed | timeout | survived | of these equivalent | no tests | broken"
        " | raw | score |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
        "| chains.dh | 10 | all | 8 | 0 | 2 | 1 | 0 | 0 | 80.0 % | 88.9 % |",
    ]


def test_a_draw_leaves_the_same_random_mutants_for_a_seed(tmp_path: Path) -> None:
    file = codes_file(tmp_path, f"{PACKAGE}.chains.dh")
    file.parent.mkdir(parents=True)

    def drawn(sample: int | None, seed: int) -> list[str]:
        file.write_text(json.dumps({"exit_code_by_key": {f"m{i}": 0 for i in range(50)}}))
        assert draw(tmp_path, f"{PACKAGE}.chains.dh", sample, seed) == 50
        left = codes(tmp_path, f"{PACKAGE}.chains.dh")
        assert set(left.values()) == {None}
        return list(left)

    assert len(drawn(7, 1)) == 7
    assert drawn(7, 1) == drawn(7, 1) != drawn(7, 2)
    assert len(drawn(None, 1)) == len(drawn(60, 1)) == 50


def test_tests_of_own_files_run_first_and_the_quickest_as_long_as_they_fit() -> None:
    seconds = {"own.py::a": 1.0, "own.py::b": BUDGET, "other.py::c": 0.1, "other.py::d": BUDGET - 1.5}
    assert suited(sorted(seconds), seconds, {"own.py"}) == ["own.py::a"]
    assert suited(sorted(seconds), seconds, set()) == ["other.py::c", "own.py::a", "other.py::d"]
    assert suited(["own.py::b"], seconds, set()) == ["own.py::b"]  # one at least


def test_mutmut_is_asked_for_where_it_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    python = tmp_path / "bin" / "python"
    monkeypatch.setattr("sys.executable", str(python))
    with pytest.raises(SystemExit) as caught:
        prepare(tmp_path, 1)
    assert str(caught.value) == f"found no mutmut beside {python}: pip install -e '.[bench]'"


def test_what_mutmut_said_comes_without_the_wheel_that_it_turns(tmp_path: Path) -> None:
    (tmp_path / "mutmut.log").write_text(
        "E   assert 1 == 2\n" + "\u2819 Running stats\n\u2839 Running stats\n" * 500 + "failed\n",
        encoding="utf-8",
    )
    assert said(tmp_path) == "E   assert 1 == 2\nfailed\n"
