"""Sizes of files and functions, and reasons for those over a bound."""

from __future__ import annotations

from pathlib import Path

import pytest
from survey.reasons import read_reasons
from survey.tables import full, summary

from measured_tree import faults, function, measured


def test_a_function_of_61_lines_is_over_and_one_of_60_is_not(tmp_path: Path) -> None:
    small = "\n".join(function(3, f"f{i}") for i in range(5))
    house = measured(tmp_path, models__arm=function(60) + function(61, "bend") + small)
    assert faults(house) == {"functions over 60 lines without a reason": ("models/arm.py:62 bend: 61 lines",)}


def test_a_nested_function_counts_as_one_and_in_its_outer_one(tmp_path: Path) -> None:
    inner = "def outer() -> None:\n    '''Out.'''\n" + "\n".join(
        f"    {line}" for line in function(61).splitlines()
    )
    small = "\n".join(function(3, f"f{i}") for i in range(5))
    house = measured(tmp_path, models__arm=f"{inner}\n{small}")
    assert house.functions.faults == (
        "models/arm.py:2 outer: 63 lines",
        "models/arm.py:4 outer.turn: 61 lines",
    )


def test_a_file_of_401_lines_is_over_and_one_of_400_is_not(tmp_path: Path) -> None:
    house = measured(tmp_path, tests__long="a = 1\n" * 400, tests__short="a = 1\n" * 399)
    assert house.files.faults == ("tests/long.py: 401 lines",)
    assert faults(house)["medians over their bounds"] == (
        "tests: the median file has 400.5 lines, allowed: 150",
    )


def test_a_median_function_over_ten_lines_is_told(tmp_path: Path) -> None:
    house = measured(tmp_path, cli__a=function(10), pipeline__a=function(11, "bend"))
    assert faults(house) == {
        "medians over their bounds": ("pipeline: the median function has 11 lines, allowed: 10",)
    }


def test_a_reason_excuses_and_one_for_nothing_is_told(tmp_path: Path) -> None:
    small = "\n".join(function(3, f"f{i}") for i in range(5))
    reasons = '[functions]\n"models/arm.py:turn" = "one table"\n"models/arm.py:gone" = "was long"\n'
    house = measured(tmp_path, reasons, models__arm=function(61) + small)
    assert faults(house) == {"reasons for nothing": ("models/arm.py:gone",)}
    assert "- models/arm.py:2 turn: 61 lines: one table" in full(house)
    assert summary(house)[-1] == (
        "Over a bound, with a reason in `benchmarks/survey/reasons.toml`: files 0, functions 1, duplicates 0."
    )


@pytest.mark.parametrize(
    ("text", "wrong"), [('[functions]\n"a.py:f" = " "\n', "a.py:f"), ("[classes]\n", "classes")]
)
def test_an_empty_reason_and_an_unknown_kind_are_refused(tmp_path: Path, text: str, wrong: str) -> None:
    file = tmp_path / "reasons.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=f"^reasons.toml: {wrong}; allowed: files, functions, dup"):
        read_reasons(file)


def test_arguments_are_those_a_caller_fills(tmp_path: Path) -> None:
    names = ", ".join(f"a{i}: int" for i in range(8))
    text = f"""
        class _Arm:
            @classmethod
            def eight(cls, {names}, *rest: int, **named: int) -> None: ...
            def nine(self, {names}, *, b: int) -> None: ...
        """
    assert measured(tmp_path, models__arm=text).many_arguments == ("models/arm.py:6 _Arm.nine: 9",)


def test_nesting_counts_blocks_inside_each_other_and_elif_as_its_if(tmp_path: Path) -> None:
    text = """
        def _flat() -> None:
            if a:
                b()
            elif c:
                b()
            elif d:
                b()
        def _deep() -> None:
            try:
                b()
            except E:
                for a in b:
                    def inner() -> None:
                        while c:
                            d()
        """
    assert measured(tmp_path, models__arm=text).deepest == (
        "models/arm.py:10 _deep: 2 blocks",
        "models/arm.py:15 _deep.inner: 1 blocks",
        "models/arm.py:3 _flat: 1 blocks",
    )


def test_functions_are_found_in_every_arm_of_a_statement(tmp_path: Path) -> None:
    text = """
        if a:
            b()
        else:
            def _one(a): ...
        try:
            b()
        except E:
            def _two(a): ...
        finally:
            def _three(a): ...
        match a:
            case 1:
                def _four(a): ...
        """
    found = faults(measured(tmp_path, models__arm=text))["functions without all annotations"]
    assert [place.split()[1] for place in found] == ["_one", "_two", "_three", "_four"]
