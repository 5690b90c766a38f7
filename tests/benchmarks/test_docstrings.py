"""Docstrings, units, shapes and annotations."""

from __future__ import annotations

import re
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


BOTH = "no unit and no shape"


@pytest.mark.parametrize(
    ("signature", "docstring", "lacking"),
    [
        ("(q: FloatArray) -> None", "Take joint values q.", {"q": BOTH}),
        ("(q: FloatArray) -> None", "Take joint values q in [rad].", {"q": "no shape"}),
        ("(q: FloatArray) -> None", "Take joint values q, shape (n, 6).", {"q": "no unit"}),
        ("(q: FloatArray) -> None", "Take joint values q in [rad], shape (n, 6).", {}),
        ("() -> dict[str, Line] | None", "Return lines.", {"the result": BOTH}),
        ("() -> dict[str, Line] | None", "Lines.\n\n    In [m], shape (n, 3).", {}),
        ("(*, q: 'NDArray[np.float32]') -> None", "Take q.", {"q": BOTH}),
        ("(*q: FloatArray) -> None", "Take them.", {"q": BOTH}),
        ("(rows: NDArray[np.intp]) -> None", "Take rows.", {"rows": "no shape"}),
        ("(rows: NDArray[np.intp]) -> None", "Take rows, shape (m,).", {}),
        ("(f: Callable[[FloatArray], FloatArray]) -> None", "Take a function.", {}),
        ("(name: str) -> int", "Return no arrays.", {}),
    ],
)
def test_units_and_shapes_are_asked_where_arrays_pass(
    tmp_path: Path, signature: str, docstring: str, lacking: dict[str, str]
) -> None:
    assert_lacking(tmp_path, f'def turn{signature}:\n    """{docstring}"""\n', lacking)


def assert_lacking(tmp_path: Path, text: str, lacking: dict[str, str]) -> None:
    """Assert what is open of the arrays of the one definition of a text, by name."""
    name = re.split(r"\W", text)[1]
    found = tuple(f"models/arm.py:6 {name}: {array}: {what}" for array, what in lacking.items())
    told = faults(measured(tmp_path, models__arm=dedent(ARRAYS) + text))
    assert told.get("arrays of which the docstring tells no unit or no shape", ()) == found


@pytest.mark.parametrize(
    ("docstring", "lacking"),
    [
        ("Return rates in [rad/s], shape (n, 6).", {"q": BOTH, "t": BOTH}),
        ("Return rates in [rad/s], shape (n, 6), of q at t in [s], shape (n,).", {}),
        ("Return rates of q.\n\n    All arrays in [rad], all of shape (n,).", {}),
        ("Return rates.\n\n    Arguments and rates are all of shape (n,), each in [rad].", {}),
        ("Turn an arm.\n\n    In [rad], shape (n,).", {"q": BOTH, "t": BOTH, "the result": BOTH}),
        (
            """Return rates.

            Args:
                q: Joint values in [rad], shape (n, 6).
                t: Times.

            Returns:
                In [rad/s].
            """,
            {"t": BOTH, "the result": "no shape"},
        ),
        (
            """Return rates.

            Args:
                q: Joint values in [rad],
                    shape (n, 6).
                t: Likewise.

            Returns:
                In [rad/s], shape (n, 6).
            """,
            {},
        ),
        (
            """Return rates in [rad/s], shape (n, 6). What q is at t follows.

            Args:
                q, t: In [rad] and [s], shape (n, 6) and (n,).
            """,
            {},
        ),
        (
            """Return rates in [rad/s], shape (n, 6).

            Args:
                q: Joint values in [rad], shape (n, 6).

            Raises:
                ValueError: If t is not in [s], shape (n,).
            """,
            {"t": BOTH},
        ),
    ],
)
def test_each_argument_and_the_result_is_told_by_itself(
    tmp_path: Path, docstring: str, lacking: dict[str, str]
) -> None:
    signature = "def turn(q: FloatArray, t: FloatArray) -> FloatArray:"
    assert_lacking(tmp_path, f'{signature}\n    """{dedent("            " + docstring)}"""\n', lacking)


@pytest.mark.parametrize(
    ("body", "lacking"),
    [
        ('"""A path, t in [s], shape (n,)."""\n    t: FloatArray\n    q: FloatArray', {"q": BOTH}),
        (
            '"""A path.\n\n    Attributes:\n        t: In [s], shape (n,).\n    """\n'
            "    t: FloatArray\n    q: FloatArray",
            {"q": BOTH},
        ),
        (
            '"""A path."""\n    t: FloatArray\n    """In [s], shape (n,)."""\n'
            '    q: FloatArray\n    """In [rad]."""',
            {"q": "no shape"},
        ),
        (
            '"""A path.\n\n    All of shape (n,), each in [rad].\n    """\n'
            "    t: FloatArray\n    q: FloatArray",
            {},
        ),
        (
            '"""A path.\n\n    Args:\n        t: In [s], shape (n,).\n    """\n'
            "    def __init__(self, t: FloatArray, q: FloatArray) -> None: ...",
            {"q": BOTH},
        ),
    ],
)
def test_each_field_of_a_class_is_told_by_itself(tmp_path: Path, body: str, lacking: dict[str, str]) -> None:
    assert_lacking(tmp_path, f"class Path:\n    {body}\n", lacking)


def test_the_docstring_of_a_property_tells_of_its_value(tmp_path: Path) -> None:
    text = """
        class Arm:
            \"\"\"An arm.\"\"\"
            @property
            def q(self) -> NDArray[np.float64]:
                \"\"\"Joint values in [rad], shape (n,).\"\"\"
            @property
            def t(self) -> NDArray[np.float64]:
                \"\"\"Times in [s].\"\"\"
        """
    assert faults(measured(tmp_path, models__arm=text)) == {
        "arrays of which the docstring tells no unit or no shape": (
            "models/arm.py:9 Arm.t: the result: no shape",
        )
    }


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
        "arrays of which the docstring tells no unit or no shape": (
            "cli/urmpipe/track.py:4 Track: line: no unit and no shape",
        )
    }


@pytest.mark.parametrize(
    "unit",
    [
        "in [m]",
        "in [rad] or [m]",
        "[m/s2]",
        "[-]",
        "in rad",
        "[kg m2]",
        "in the unit of q",
        "its own unit",
        "in `unit`",
    ],
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
        "arrays of which the docstring tells no unit or no shape": (
            "models/arm.py:5 turn: row: no unit and no shape",
        )
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
