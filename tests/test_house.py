"""What benchmarks/house.py measures holds its bounds, and it measures what it says."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent

import pytest
from survey.contributing import BEGIN, END, show, shown
from survey.docstrings import open_questions
from survey.house import House, survey
from survey.imports import rings
from survey.reasons import read_reasons
from survey.tables import full, summary

ROOT = Path(__file__).resolve().parents[1]

NO_REASONS = ""


@pytest.fixture(scope="module")
def house() -> House:
    return survey(ROOT)


BOUNDS = [
    "files over 400 lines without a reason",
    "functions over 60 lines without a reason",
    "medians over their bounds",
    "public definitions without a docstring",
    "docstrings of arrays without unit or shape",
    "functions without all annotations",
    "imports the wrong way",
    "rings of modules",
    "rings of folders",
    "duplicates of 6 lines and more without a reason",
    "reasons for nothing",
]


@pytest.mark.parametrize("bound", BOUNDS)
def test_the_house_holds_its_bounds(house: House, bound: str) -> None:
    places = house.faults()[bound]
    assert not places, f"{len(places)} {bound}:\n" + "\n".join(places)


def test_every_bound_is_tested(house: House) -> None:
    assert list(house.faults()) == BOUNDS


def test_contributing_shows_the_table_of_this_tree(house: House) -> None:
    page = ROOT / "CONTRIBUTING.md"
    assert shown(page) == summary(house), "renew it: python benchmarks/house.py --write"


def measured(tmp_path: Path, reasons: str = NO_REASONS, **files: str) -> House:
    """Measure files given as `models__urmpipe_models__arm="..."`, each below a docstring of its own."""
    for name, text in files.items():
        path = tmp_path / (name.replace("__", "/") + ".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('"""A module."""\n' + dedent(text), encoding="utf-8")
    allowed = tmp_path / "reasons.toml"
    allowed.write_text(reasons, encoding="utf-8")
    return survey(tmp_path, allowed)


def faults(house: House) -> dict[str, tuple[str, ...]]:
    """Return the bounds that are missed, and by what."""
    return {what: places for what, places in house.faults().items() if places}


def function(lines: int, name: str = "turn") -> str:
    """Return the source of a function of so many lines."""
    body = [f"    {name}({i})" for i in range(lines - 2)]
    return "\n".join([f"def {name}() -> None:", '    """Turn."""', *body]) + "\n"


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


def test_an_empty_reason_and_an_unknown_kind_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "reasons.toml"
    file.write_text('[functions]\n"a.py:f" = " "\n[classes]\n', encoding="utf-8")
    with pytest.raises(ValueError, match=r"^reasons.toml: classes, a.py:f; allowed: files, functions, dup"):
        read_reasons(file)


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


def test_imports_the_wrong_way_are_told_wherever_they_stand(tmp_path: Path) -> None:
    house = measured(
        tmp_path,
        models__urmpipe_models__arm="def _f() -> None:\n    from urmpipe import main\n",
        pipeline__urmpipe_pipeline__log="import urmpipe_models.arm\n",
    )
    assert faults(house) == {"imports the wrong way": ("models/urmpipe_models/arm.py imports cli",)}
    assert house.imports == {("models", "cli"): 1, ("pipeline", "models"): 1}


def test_a_ring_counts_when_modules_are_loaded_and_not_in_functions_or_for_type_checkers(
    tmp_path: Path,
) -> None:
    house = measured(
        tmp_path,
        models__urmpipe_models__a="from urmpipe_models import b\n",
        models__urmpipe_models__b="try:\n    import urmpipe_models.c\nfinally:\n    pass\n",
        models__urmpipe_models__c="from urmpipe_models.a import X\n",
        models__urmpipe_models__d="def _f() -> None:\n    import urmpipe_models.e\n",
        models__urmpipe_models__e="import urmpipe_models.f\nimport urmpipe_models.d\n",
        models__urmpipe_models__f="if TYPE_CHECKING:\n    import urmpipe_models.e\n",
    )
    ring = "urmpipe_models.a ~ urmpipe_models.b ~ urmpipe_models.c"
    assert faults(house) == {
        "rings of modules": (ring,),
        "rings of folders": (
            f"{ring}: urmpipe_models.a -> urmpipe_models.b, urmpipe_models.b -> urmpipe_models.c,"
            " urmpipe_models.c -> urmpipe_models.a",
        ),
    }


def test_a_ring_of_folders_needs_no_ring_of_modules(tmp_path: Path) -> None:
    house = measured(
        tmp_path,
        cli__urmpipe__one__a="import urmpipe.two.a\n",
        cli__urmpipe__two__a="",
        cli__urmpipe__two__b="import urmpipe.one.b\n",
        cli__urmpipe__one__b="",
    )
    assert faults(house) == {
        "rings of folders": (
            "urmpipe.one ~ urmpipe.two: urmpipe.one.a -> urmpipe.two.a, urmpipe.two.b -> urmpipe.one.b",
        )
    }


def test_rings_are_the_strongly_connected_components() -> None:
    graph = {"a": {"b"}, "b": {"c", "d"}, "c": {"a"}, "d": {"e"}, "e": {"d"}, "f": {"a", "f"}}
    assert rings(graph) == [("d", "e"), ("a", "b", "c")]


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


def test_the_same_tree_gives_the_same_page(tmp_path: Path) -> None:
    def page() -> list[str]:
        return full(measured(tmp_path, models__a=function(61), tests__a=block("one")))

    assert page() == page()


def test_the_table_is_put_between_its_markers_and_nothing_else_changes(tmp_path: Path) -> None:
    page = tmp_path / "PAGE.md"
    page.write_text(f"# Page\n\n{BEGIN}\nold\n{END}\n\nlast\n", encoding="utf-8")
    show(page, ["| a |", "|---|"])
    assert page.read_text(encoding="utf-8") == f"# Page\n\n{BEGIN}\n| a |\n|---|\n{END}\n\nlast\n"
    assert shown(page) == ["| a |", "|---|"]


def test_a_page_without_markers_is_refused(tmp_path: Path) -> None:
    page = tmp_path / "PAGE.md"
    page.write_text("# Page\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"^PAGE.md lacks the lines"):
        show(page, [])
