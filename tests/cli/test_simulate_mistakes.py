"""A system file with mistakes of every kind: all of them are told at once, each with its line."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from pages import DOCS
from urmpipe.api.simulate import simulate
from urmpipe_models.errors import UrmpipeError

SYSTEM = """
[system]
stepp = 1
duration = 1

[blocks.lag]
file = "low_pass.py"
start = { TT = 2.0 }

[blocks.second]
file = "low_pass.py"

[blocks.third]
unit = "no_such_unit"

[blocks.fourth]
file = "missing.py"

[blocks.arm]
unit = "kinematic_chain"
robot = "urm7"

[connections]
"second.u" = "lag.yy"
"third.a" = "lagg.y"
"fourth.a" = "lag.yyy"

[inputs]
"lag.u" = { log = "missing.csv", column = "u" }
"lag.v" = { log = "voltage.csv" }
"lagg.u" = { log = "missing.csv", column = "u" }
"lag.w" = { log = "$voltage", column = "u" }
"""

TOLD = [
    "3: system.stepp: unknown (did you mean step?)",
    "8: blocks.lag.start.TT: found 'TT' (did you mean T?)",
    "13: blocks.third: unit: found 'no_such_unit'",
    "17: blocks.fourth.file: found 'missing.py'",
    "19: blocks.arm: unknown robot 'urm7' (did you mean urm8?)",
    "24: connections.second.u: output of lag: found 'yy' (did you mean y?)",
    "25: connections.third.a: block found 'lagg' (did you mean lag?)",
    "26: connections.fourth.a: output of lag: found 'yyy'",
    "29: inputs.lag.u: missing.csv: found no such file",
    "30: inputs.lag.v.column: found nothing",
    "30: inputs.lag.v: input of lag: found 'v'",
    "31: inputs.lagg.u: block found 'lagg' (did you mean lag?)",
    "32: inputs.lag.w.log: found '$voltage'",
    "32: inputs.lag.w: input of lag: found 'w'",
]


def test_mistakes_of_the_file_its_parts_and_its_connections_are_told_at_once_by_line(tmp_path: Path) -> None:
    shutil.copy(DOCS / "examples" / "low_pass.py", tmp_path)
    system = tmp_path / "wrong.toml"
    system.write_text(SYSTEM, encoding="utf-8")
    with pytest.raises(UrmpipeError) as error:
        simulate(system, backend="python")
    found = [str(one).removeprefix(f"{system}:") for one in error.value.findings]
    assert [one.partition(", allowed: ")[0].partition("; allowed: ")[0] for one in found] == TOLD
