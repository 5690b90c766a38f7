"""Pairs of places that share lines."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent

import pytest

from measured_tree import faults, measured

BLOCK = """
    def {name}(q: float) -> float:
        # {name}
        first = cos({x}) + 1.0
        second = sin({x})

        third = first * {x} - second
        fourth = [third, {x}]
        fifth = max(fourth)
        {y} = fifth.real
        return {end}
    """


def block(name: str, x: str = "q", y: str = "sixth", end: str = "0.0") -> str:
    """Return a function of six lines that may be shared, and its last one."""
    return dedent(BLOCK.format(name=name, x=x, y=y, end=end)).replace("->", "->", 1)


@pytest.mark.parametrize(
    ("x", "y", "alike"), [("q", "sixth", "the same"), ("p", "last", "the same but for names of variables")]
)
def test_six_shared_lines_are_a_pair(tmp_path: Path, x: str, y: str, alike: str) -> None:
    house = measured(tmp_path, tests__a=block("one"), tests__b="\n\n" + block("two", x, y, end="1.0"))
    assert house.duplicates.faults == (f"tests/a.py:5-11 ~ tests/b.py:7-13 (one ~ two): 6 lines {alike}",)
    assert faults(house).keys() == {"duplicates of 6 lines and more without a reason"}


@pytest.mark.parametrize(
    "changed", [("fifth.real", "fifth.imag"), ("cos(", "tan("), ("1.0", "2.0"), ("third, q", "q, third")]
)
def test_what_differs_in_more_than_names_of_variables_is_no_pair(
    tmp_path: Path, changed: tuple[str, str]
) -> None:
    other = block("two", end="1.0").replace(*changed)
    assert not faults(measured(tmp_path, tests__a=block("one"), tests__b=other))


def test_a_pair_is_excused_by_its_two_functions_and_found_within_a_file(tmp_path: Path) -> None:
    reasons = '[duplicates]\n"tests/a.py:one ~ tests/a.py:two" = "the paper writes both"\n'
    text = block("one") + block("two", end="1.0")
    assert len(measured(tmp_path, tests__a=text).duplicates.faults) == 1
    assert not faults(measured(tmp_path, reasons, tests__a=text))


def test_imports_docstrings_and_signatures_make_no_pair(tmp_path: Path) -> None:
    text = """
        import a1
        import a2
        import a3
        import a4
        def {name}(
            a: int,
            b: int,
            c: int,
            d: int,
        ) -> None:
            '''Do it.

            Args:
                a: One.
                b: Two.
            '''
            {name}(a)
        """
    house = measured(tmp_path, tests__a=text.format(name="one"), tests__b=text.format(name="two"))
    assert not house.duplicates.faults


def pairs(tmp_path: Path, one: str, other: str) -> list[str]:
    """Return the pairs of two files."""
    return list(measured(tmp_path, tests__a=one, tests__b=other).duplicates.faults)


def lines(*texts: str) -> str:
    """Return six lines of a module, those given and others that are the same in each."""
    return "\n".join([*texts, *(f"same({i}, a, b)" for i in range(6 - len(texts)))]) + "\n"


def test_a_pair_is_as_long_as_it_goes_and_told_once(tmp_path: Path) -> None:
    text = "".join(f"same({i}, a, b)\n" for i in range(9))
    assert pairs(tmp_path, text, text) == [
        "tests/a.py:2-10 ~ tests/b.py:2-10 (<module> ~ <module>): 9 lines the same"
    ]


@pytest.mark.parametrize("between", ["# said\n", "import it\n", "\n", "'Said.'\n"])
def test_lines_that_do_not_count_part_no_pair(tmp_path: Path, between: str) -> None:
    assert len(pairs(tmp_path, lines(), lines().replace("same(3", f"{between}same(3"))) == 1


def test_lone_brackets_do_not_count(tmp_path: Path) -> None:
    wrapped = lines().replace("same(3, a, b)\n", "(\nsame(3, a, b)\n)\n")
    assert len(pairs(tmp_path, lines(), wrapped)) == 1
    five = wrapped.replace("same(5, a, b)\n", "")
    assert not pairs(tmp_path, five, five)


def test_five_lines_are_no_pair_with_comments_between(tmp_path: Path) -> None:
    text = "".join(f"same({i}, a, b)\n# {i}\n" for i in range(5))
    assert not pairs(tmp_path, text, text)


@pytest.mark.parametrize(
    ("one", "other", "alike"),
    [
        ("x = a", "y = a", True),
        ("x = len", "x = sum", False),  # what is built in
        ("f(x=a)", "f(y=a)", False),  # what a function calls its argument
        ("f(a.x)", "f(a.y)", False),  # an attribute
        ("x: int", "y: int", False),  # a field
        ("f('x')", "f('y')", False),
        ("x = a + b", "x = b + a", False),  # named otherwise, but not throughout
        ("x = Arm", "x = Leg", False),
    ],
)
def test_only_names_of_variables_may_differ(tmp_path: Path, one: str, other: str, alike: bool) -> None:
    assert bool(pairs(tmp_path, lines(one), lines(other))) == alike


def test_a_run_that_goes_on_repeating_itself_is_no_pair_with_its_own_lines(tmp_path: Path) -> None:
    text = "same(1, a, b)\n" * 11
    assert not measured(tmp_path, tests__a=text).duplicates.faults
    assert measured(tmp_path, tests__a=text + "same(1, a, b)\n").duplicates.faults


def test_a_run_that_stands_everywhere_is_a_form_and_no_pair(tmp_path: Path) -> None:
    twelve = {f"tests__a{i}": lines() for i in range(12)}
    assert measured(tmp_path, **twelve).duplicates.faults
    assert not measured(tmp_path, **twelve, tests__one_more=lines()).duplicates.faults


def test_two_runs_of_the_same_functions_are_told_together(tmp_path: Path) -> None:
    one = lines() + "f(1)\n" + lines().replace("same", "more")
    (told,) = pairs(tmp_path, one, one.replace("f(1)", "f(2)"))
    assert told.count(" ~ tests/b.py:") == 2


def test_a_place_is_named_by_the_innermost_function(tmp_path: Path) -> None:
    inner = "".join(f"        same({i}, a, b)\n" for i in range(6))
    one = f"class _Arm:\n    def turn(self) -> None:\n{inner}"
    (told,) = pairs(tmp_path, one, one.replace("turn", "bend"))
    assert "(_Arm.turn ~ _Arm.bend)" in told
