"""Each decision about a log has an alternative, and the option named for it makes it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.runs.explain import otherwise
from urmpipe_pipeline.sources import ReadOptions, read_log

TEXT = "t;q1;q2;x;y;z\n" + "".join(f"{k * 5};{k / 10};0.5;0.1;0.2;{k / 100}\n" for k in range(8))


def inferences(tmp_path: Path, **options: object) -> dict[str, Inference]:
    path = tmp_path / "log.csv"
    path.write_text(TEXT)
    return {one.what: one for one in read_log([path], ReadOptions(**options)).inferences}  # type: ignore[arg-type]


def test_every_decision_that_could_be_another_names_its_option(tmp_path: Path) -> None:
    found = {what: otherwise(one) for what, one in inferences(tmp_path).items()}
    assert found == {
        "encoding": "save the file as UTF-8",
        "source": "--source NAME",
        "delimiter": "--delimiter CHAR",
        "decimal sign": "--decimal CHAR",
        "header": "",
        "time column": "--time COLUMN, or --time none",
        "unit of the time": "s with --unit COLUMN=s",
        "joint columns": "--joints A,B,C in the robot's order",
        "recorded TCP": "position in a --map",
        "unit of q1, q2": "deg with --unit deg",
        "unit of x, y, z": "mm with --unit x=mm",
    }


@pytest.mark.parametrize(
    ("what", "option"),
    [("unit of q1", {"": "deg"}), ("unit of x", {"x": "mm"}), ("unit of the time", {"t": "s"})],
)
def test_the_option_named_decides_otherwise(what: str, option: dict[str, str], tmp_path: Path) -> None:
    before = next(one for name, one in inferences(tmp_path).items() if name.startswith(what))
    wanted = re.match(r"(\w+) with --unit", otherwise(before))
    assert wanted
    assert [wanted[1]] == list(option.values())
    after = next(one for name, one in inferences(tmp_path, units=option).items() if name.startswith(what))
    assert (after.value, after.evidence) == (wanted[1], "given as an option")
