"""A user's own unit: the documented examples, and every way in which a file can be wrong."""

from __future__ import annotations

import math
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

from random_units import PATIENT, random_unit_sources
from urmpipe_fmus.blocks.user import block_from_source, load_block_file
from urmpipe_fmus.run import run
from urmpipe_models.errors import UnitError

DOCS = Path(__file__).resolve().parents[3] / "docs"

UNIT = """import numpy as np
from urmpipe_fmus.block import BlockModel, Input, Output
unit = BlockModel(
    name="own",
    description="Own",
    variables=(Input(name="u", description="u"), Output(name="y", description="y")),
    outputs=lambda v: {"y": OUT},
)
"""


def written(folder: Path, text: str, name: str = "own.py") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def said(path: Path) -> list[str]:
    """What is wrong with a file, its folder left out."""
    with pytest.raises(UnitError) as error:
        load_block_file(path)
    return [line.replace(str(path), path.name) for line in str(error.value).splitlines()]


def test_the_backlash_of_the_documentation_holds_a_joint_until_the_slack_is_taken_up() -> None:
    model = load_block_file(DOCS / "examples" / "backlash.py")
    t = np.linspace(0.0, 2.0, 401, dtype=np.float64)
    motor = np.sin(np.pi * t)[:, np.newaxis] * np.ones(6)
    play = 0.2
    joint = run(model, t, {"motor": motor}, {"play": play})["joint"]
    assert np.abs(joint - motor).max() <= play / 2 + 1e-15  # rounding of motor +- play / 2
    rising = (t > 0.1) & (t < 0.5)  # the slack of play / 2 = 0.1 is taken up at asin(0.1) / pi = 0.03 s
    np.testing.assert_allclose(joint[rising], motor[rising] - play / 2, rtol=0.0, atol=1e-15)
    turning = (t > 0.5) & (motor[:, 0] > 1.0 - play) & (t < 1.0)
    assert turning.sum() > 20
    assert len(np.unique(joint[turning])) == 1  # at rest while the motor goes from one flank to the other


def test_the_low_pass_of_the_documentation_follows_as_its_solution_does() -> None:
    model = load_block_file(DOCS / "examples" / "low_pass.py")
    t = np.linspace(0.0, 0.2, 41, dtype=np.float64)
    y = run(model, t, {"u": np.ones_like(t)}, {"T": 0.05})["y"]
    # RK4 with h = 1 ms: the error is about t h^4 / (120 T^5) = 5e-9 at 0.2 s
    np.testing.assert_allclose(y, 1.0 - np.exp(-t / 0.05), rtol=0.0, atol=1e-8)


def test_the_page_shows_the_examples_as_they_are() -> None:
    page = (DOCS / "units.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    for example in sorted((DOCS / "examples").glob("*.py")):
        assert example.read_text(encoding="utf-8") in blocks, example.name


def test_a_unit_carries_the_text_of_its_file_from_which_it_is_made_again(tmp_path: Path) -> None:
    path = written(tmp_path, UNIT.replace("OUT", "2.0 * v.u"))
    model = load_block_file(path)
    assert (model.recipe.module, model.recipe.function, model.recipe.arguments) == ("own.py", "", {})
    assert model.recipe.source == path.read_text(encoding="utf-8")
    again = block_from_source(model.recipe.source, "own.py")
    assert again.variables == model.variables
    assert run(again, np.array([0.0]), {"u": np.array([3.0])})["y"].tolist() == [6.0]


@pytest.mark.slow
@settings(max_examples=30, **PATIENT)
@given(random_unit_sources())
def test_any_file_with_a_sound_unit_is_taken(source: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        model = load_block_file(written(Path(folder), source))
    assert model.recipe.source == source
    assert model.variables == block_from_source(source, "own.py").variables


def test_two_files_of_one_name_keep_their_own_functions(tmp_path: Path) -> None:
    paths = []
    for folder, factor in (("a", "2.0"), ("b", "3.0")):
        (tmp_path / folder).mkdir()
        text = UNIT.replace("OUT", "scaled(v.u)") + f"def scaled(u):\n    return {factor} * u\n"
        paths.append(written(tmp_path / folder, text))
    units = [load_block_file(path) for path in paths]
    t, u = np.array([0.0]), {"u": np.array([1.0])}
    assert [run(model, t, u)["y"].tolist() for model in units] == [[2.0], [3.0]]


def test_a_file_may_hold_dataclasses_and_private_units(tmp_path: Path) -> None:
    text = (
        "from __future__ import annotations\nfrom dataclasses import dataclass\n"
        + UNIT.replace("OUT", "GAIN.value * v.u").replace("unit = BlockModel", "_unit = BlockModel")
        + "@dataclass\nclass Gain:\n    value: float\nGAIN = Gain(4.0)\nmine = yours = _unit\n"
    )
    assert load_block_file(written(tmp_path, text)).name == "own"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ["own.py: found no BlockModel, allowed: one, such as unit = BlockModel(name=..., ...)"]),
        (
            "x = (1,\n",
            ["own.py:1: not valid Python: '(' was never closed; allowed: Python with a BlockModel in it"],
        ),
        (
            "x = 1\ny = 1 / 0\n",
            [
                "own.py:2: cannot be run: ZeroDivisionError: division by zero;"
                " allowed: Python with a BlockModel in it"
            ],
        ),
        (
            "import sys\nsys.exit(3)\n",
            ["own.py:2: cannot be run: SystemExit: 3; allowed: Python with a BlockModel in it"],
        ),
        (
            "import no_such_package\n",
            [
                "own.py:1: cannot be run: ModuleNotFoundError: No module named 'no_such_package';"
                " allowed: Python with a BlockModel in it"
            ],
        ),
        (
            UNIT.replace("OUT", "v.u") + UNIT.replace("OUT", "v.u").replace("unit = ", "other = "),
            ["own.py: found 2 units: unit, other; allowed: one (a name with _ before it does not count)"],
        ),
        (
            UNIT.replace('"own"', '"my own"').replace('name="u"', 'name="1u"'),
            [
                "own.py:3: unit my own: found 'my own' as its name, allowed: a letter, then letters, digits"
                " and _",
                "own.py:3: unit my own: '1u': found as a name, allowed: a letter, then letters, digits and _",
            ],
        ),
        (
            UNIT.replace("OUT", "1.0 if v.u > 0.0 else 0.0"),
            [
                "own.py:7: unit own: outputs: a branch on u: found in a unit's function (if, and, or, not,"
                " min, max, in), allowed: np.where, np.logical_and, np.minimum and their like"
            ],
        ),
        (
            UNIT.replace("OUT", "v.w"),
            ["own.py:7: unit own: outputs: v.w: found in a unit's function, allowed: table, time, u"],
        ),
        (
            UNIT.replace("OUT", "(v.u, v.u)"),
            ["own.py:7: unit own: outputs: y: found tuple, allowed: one element"],
        ),
        (
            UNIT.replace('{"y": OUT}', "None"),
            ["own.py:7: unit own: outputs: returns nothing (None), allowed: a dict of y"],
        ),
        (
            UNIT.replace("OUT", "np.random.default_rng().uniform() + v.u"),
            [
                "own.py: unit own: outputs: gives other results for the same values, allowed: a function that"
                " keeps and draws nothing; what is remembered is a State or a Memory"
            ],
        ),
    ],
)
def test_a_file_that_is_wrong_is_told_with_its_line(tmp_path: Path, text: str, expected: list[str]) -> None:
    assert said(written(tmp_path, text)) == expected


THREE_FUNCTIONS = """from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.block import Input, Memory, Output, State

def state(v):
    \"\"\"The derivative.\"\"\"
    return {"x": v.w}

unit = BlockModel(
    name="own",
    description="Own",
    variables=(
        Input(name="u", description="u"),
        Output(name="y", description="y"),
        State(name="x", description="x"),
        Memory(name="m", description="m"),
    ),
    outputs=lambda v: {"z": v.u},
    derivatives=state,
    update=lambda v: {"m": 1.0 if v.u else 0.0},
)
"""


def test_what_is_wrong_with_each_function_is_told_at_once_with_its_line(tmp_path: Path) -> None:
    found = said(written(tmp_path, THREE_FUNCTIONS))
    assert [one.partition(", allowed: ")[0].partition(" (if")[0] for one in found] == [
        "own.py:17: unit own: outputs: z: found in what it returns",
        "own.py:17: unit own: outputs: y: not found in what it returns",
        "own.py:6: unit own: derivatives: v.w: found in a unit's function",
        "own.py:19: unit own: update: a branch on u: found in a unit's function",
    ]


def test_a_function_that_keeps_the_last_value_in_python_is_refused(tmp_path: Path) -> None:
    text = "last = [0.0]\ndef change(u):\n    d = u - last[0]\n    last[0] = u\n    return d\n"
    path = written(tmp_path, UNIT.replace("OUT", "change(v.u) if isinstance(v.u, float) else v.u") + text)
    assert said(path) == [
        "own.py: unit own: outputs: gives other results for the same values, allowed: a function that keeps"
        " and draws nothing; what is remembered is a State or a Memory"
    ]


def test_an_import_from_beside_the_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gains.py").write_text("GAIN = 2.0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)  # as `python -m` does with the working folder
    why = (
        "a neighbouring file, which the FMU does not contain: move its code into the block's file, or install"
        " it as a package"
    )
    assert said(written(tmp_path, "import gains\n" + UNIT.replace("OUT", "gains.GAIN * v.u"))) == [
        f"own.py:1: imports gains, {why}"
    ]
    assert said(written(tmp_path, "\nfrom .gains import GAIN\nimport gains\n")) == [
        f"own.py:2: imports .gains, {why}",
        f"own.py:3: imports gains, {why}",
    ]


def test_a_file_may_bear_a_name_of_the_standard_library(tmp_path: Path) -> None:
    path = tmp_path / "random.py"
    path.write_text("import random\n" + UNIT.replace("OUT", "v.u"), encoding="utf-8")
    assert load_block_file(path).name == "own"


def test_a_file_that_is_nested_too_deeply_is_told(tmp_path: Path) -> None:
    [fault] = said(written(tmp_path, f"x = {'-' * 100_000}1\n"))
    assert fault.startswith("own.py: cannot be run: ")


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    assert said(tmp_path / "own.py") == ["own.py: cannot be read: No such file or directory"]
    (tmp_path / "own.py").write_bytes(b"# \xff\n")
    assert said(tmp_path / "own.py") == ["own.py: byte 2 is not UTF-8; allowed: Python in UTF-8"]


def test_the_play_of_the_example_is_a_twentieth_of_a_degree() -> None:
    model = load_block_file(DOCS / "examples" / "backlash.py")
    assert model.parameters[0].starts == (math.radians(0.05),)
