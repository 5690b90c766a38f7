"""Docstrings, units, shapes and annotations."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent

import pytest
from survey.docstrings import open_questions

from measured_tree import faults, measured


def test_docstrings_are_missed_where_something_is_public(tmp_path: Path) -> None:
    text = '''
        class Arm:
            @property
            def rate(self) -> float: ...
            @rate.setter
            def rate(self, rate: float) -> None: ...
            def _bend(self) -> None: ...
            def __len__(self) -> int: ...
        def turn() -> None:
            def inner() -> None: ...
        @overload
        def told(a: int) -> int: ...
        def told(a: int) -> int:
            """Tell."""
        def _turn() -> None: ...
        class _Hidden:
            def seen(self) -> None: ...
        '''
    (tmp_path / "fmus").mkdir()
    (tmp_path / "fmus/empty.py").write_text("", encoding="utf-8")
    house = measured(tmp_path, models__arm=text, models___own="def turn() -> None: ...", tests__test_a=text)
    assert faults(house) == {
        "public definitions without a docstring": (
            "models/arm.py:3 Arm",
            "models/arm.py:5 Arm.rate",
            "models/arm.py:10 turn",
            "fmus/empty.py:1 the module",
        )
    }


ARRAYS = """
    from numpy.typing import NDArray
    FloatArray = NDArray[np.float64]
    Line = tuple[FloatArray, FloatArray]
    """


@pytest.mark.parametrize(
    ("signature", "docstring", "lacking"),
    [
        ("(q: FloatArray) -> None", "Joint values.", "no unit and no shape"),
        ("(q: FloatArray) -> None", "Joint values in [rad].", "no shape"),
        ("(q: FloatArray) -> None", "Joint values, shape (n, 6).", "no unit"),
        ("(q: FloatArray) -> None", "Joint values in [rad], shape (n, 6).", None),
        ("() -> dict[str, Line] | None", "Lines.", "no unit and no shape"),
        ("(*, q: 'NDArray[np.float32]') -> None", "Joint values.", "no unit and no shape"),
        ("(rows: NDArray[np.intp]) -> None", "Rows.", "no shape"),
        ("(rows: NDArray[np.intp]) -> None", "Rows, shape (m,).", None),
        ("(f: Callable[[FloatArray], FloatArray]) -> None", "A function.", None),
        ("(name: str) -> int", "No arrays.", None),
    ],
)
def test_units_and_shapes_are_asked_where_arrays_pass(
    tmp_path: Path, signature: str, docstring: str, lacking: str | None
) -> None:
    text = dedent(ARRAYS) + f'def turn{signature}:\n    """{docstring}"""\n'
    place = "models/arm.py:6 turn"
    expected = (f"{place}: {lacking}",) if lacking else ()
    assert faults(measured(tmp_path, models__arm=text)) == (
        {"docstrings of arrays without unit or shape": expected} if expected else {}
    )


def test_an_alias_is_followed_through_imports_and_into_the_fields_of_a_class(tmp_path: Path) -> None:
    user = '''
        from urmpipe_models.arm import Line
        class Track:
            """A track."""
            line: Line
            _kept: int
        '''
    house = measured(tmp_path, models__urmpipe_models__arm=ARRAYS, cli__urmpipe__track=user)
    assert faults(house) == {
        "docstrings of arrays without unit or shape": ("cli/urmpipe/track.py:4 Track: no unit and no shape",)
    }


@pytest.mark.parametrize(
    "unit",
    ["in [m]", "in [rad] or [m]", "[m/s2]", "[-]", "in rad", "[kg m2]", "in the unit of q", "its own unit"],
)
def test_a_unit_may_be_written(unit: str) -> None:
    assert open_questions(f"Values {unit}, shape (n,).", measured=True) == []


@pytest.mark.parametrize("text", ["Values of unity [Pieper1968]_.", "Values [0] of a radius.", "A [float]."])
def test_what_is_no_unit(text: str) -> None:
    assert open_questions(text + " shape (n,)", measured=True) == ["unit"]


@pytest.mark.parametrize(
    "shape", ["shape (n, 6)", "shape (n,)", "(n, 3)", "(..., 3)", "one array a coordinate", "the same\nshape"]
)
def test_a_shape_may_be_written(shape: str) -> None:
    assert open_questions(f"Values in [m], {shape}.", measured=True) == []


@pytest.mark.parametrize(
    "text", ["Values (see above) in [m].", "Values f(x, y) of what shape can be in [m]."]
)
def test_what_is_no_shape(text: str) -> None:
    assert open_questions(text, measured=True) == ["shape"]


def test_annotations_are_asked_of_private_and_nested_functions_and_of_tests(tmp_path: Path) -> None:
    text = """
        class _Arm:
            def whole(self, a: int, *rest: int, **named: int) -> None: ...
            @staticmethod
            def alone(a) -> None: ...
        def _turn(a: int):
            def inner(*rest) -> None: ...
        """
    assert faults(measured(tmp_path, tests__test_arm=text)) == {
        "functions without all annotations": (
            "tests/test_arm.py:6 _Arm.alone",
            "tests/test_arm.py:7 _turn",
            "tests/test_arm.py:8 _turn.inner",
        )
    }


def test_a_private_module_and_a_private_field_ask_nothing(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    (tmp_path / "models/_own.py").write_text("def turn() -> None: ...\n", encoding="utf-8")
    text = dedent(ARRAYS) + 'class Track:\n    """A track."""\n    _kept: Line\n'
    assert not faults(measured(tmp_path, models__arm=text))


def test_an_alias_for_type_checkers_is_followed(tmp_path: Path) -> None:
    text = """
        if TYPE_CHECKING:
            Row: TypeAlias = NDArray[np.float64] | None
        def turn(row: Row) -> None:
            '''Turn.'''
        """
    assert faults(measured(tmp_path, models__arm=text)) == {
        "docstrings of arrays without unit or shape": ("models/arm.py:5 turn: no unit and no shape",)
    }


def test_a_function_named_as_a_test_is_asked_outside_of_tests(tmp_path: Path) -> None:
    text = "def test_drive() -> None: ...\n"
    house = measured(tmp_path, cli__arm=text, tests__arm=text)
    assert faults(house) == {"public definitions without a docstring": ("cli/arm.py:2 test_drive",)}
    tests = house.areas[-1]
    assert (tests.name, tests.documented.public, tests.documented.bare) == ("tests", 1, ())


def test_units_are_asked_of_the_packages_only(tmp_path: Path) -> None:
    text = dedent(ARRAYS) + 'def turn(q: FloatArray) -> None:\n    """Turn."""\n'
    assert not faults(measured(tmp_path, benchmarks__arm=text, docs__arm=text, tests__arm=text))
