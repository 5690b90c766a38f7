"""What must not change, in some quick cases of the snapshot: all of them are run by hand (CONTRIBUTING)."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import compare_snapshots
import contents
import numpy as np
import pytest

HERE = Path(__file__).parent
CASES = ("models", "robot.*", "network.*", "fmu.*", "mistakes")


@pytest.mark.slow
def test_functions_robots_networks_and_refusals_give_what_they_gave(tmp_path: Path) -> None:
    run = [
        sys.executable,
        str(HERE / "snapshot.py"),
        str(HERE.parents[1]),
        "-o",
        str(tmp_path / "after"),
        *CASES,
    ]
    subprocess.run(run, check=True, capture_output=True)
    compare = [
        sys.executable,
        *map(str, (HERE / "compare_snapshots.py", HERE / "net.json", tmp_path / "after")),
    ]
    compared = subprocess.run(compare, capture_output=True, text=True, check=False)
    assert compared.returncode == 0, compared.stdout


def test_rounding_is_no_change_but_one_wrong_value_or_place_is() -> None:
    values = np.sin(np.arange(7383.0))
    before = {"a.rrd|q Scalars:scalars": contents.array(values, np.arange(7383) * 5_000_000)}
    wrong, shifted = values.copy(), np.roll(values, 1)
    wrong[777] += 1e-6
    for after, found in ((values * (1 + 1e-13), set()), (wrong, {"arrays"}), (shifted, {"arrays"})):
        case = {"a.rrd|q Scalars:scalars": contents.array(after, np.arange(7383) * 5_000_000)}
        packed = compare_snapshots.unpack(json.loads(compare_snapshots.pack({"case": case})))["case"]
        for now in (case, packed):
            assert {kind for kind, _, _ in compare_snapshots.differences(before, now)} == found
    renamed = {"a.rrd|p Scalars:scalars": before["a.rrd|q Scalars:scalars"]}
    assert [kind for kind, _, _ in compare_snapshots.differences(before, renamed)] == ["entities"]
