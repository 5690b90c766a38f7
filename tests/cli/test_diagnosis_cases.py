"""Small logs whose diagnosis was absurd, or none at all: the first line of each now."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

REMOVED = "would be removed if"
TOOL, BASE = "the tool centre point were moved by", "the base were moved by"
FOUR = r"\+4\.0\d+ mm in"

CASES = {
    "t0069/ ur5e": rf"PASS  0\.22\d+ mm of 0\.31\d+ mm rms {REMOVED} {TOOL} \+0\.(29|30)\d* mm in y",
    "t0071/ irb120.toml": rf"PASS  only 0\.10\d+ mm of 0\.46\d* mm .* {TOOL} \+0\.(29|30)\d* mm in y",
    # joint 3 is late by 16.5 ms
    "t0219/ irb120.toml": r"PASS  only 0\.05\d+ mm of 0\.89\d+ mm .* joint j3 were made 16\.\d+ ms earlier",
    "t0301/ iiwa14": rf"PASS  3\.5\d+ mm of 3\.59\d+ mm rms {REMOVED} {TOOL} {FOUR} x and {BASE} {FOUR} z",
    "t0279/ ur5e": r"FAIL  the base is mirrored: z has the opposite sign: rms 1297\.6 mm -> 0\.8\d+ mm",
    "base-180 ur5e": r"FAIL  the base needs a turn of 180 deg about z: rms 1146\.9 mm -> 0\.000\d mm",
    "scale-collapse scale-collapse.toml":
        r"FAIL  joint q2 reads 1\.7[1-3]\d* deg too low: rms 11\.417 mm -> 0\.43\d* mm",
    "coupled ur5e":
        r"FAIL  elbow_joint includes shoulder_lift_joint: rms 550\.32 mm -> 0\.00\d+ mm",
    "two-wrong-rows ur5e":
        r"FAIL  rows 2 and 3 are off by 245 mm; the other 38 agree within 0\.00\d+ mm rms",
    "small-share": r"FAIL  joint shoulder_lift\.pos reads 91 deg too low:"
        r" .* elbow_flex\.pos reads 90 deg too high:"
        r" .* wrist_roll\.pos reads 4 deg too low: .* wrist_flex\.pos reads 3 deg too high:"
        r" .* shoulder_pan\.pos reads 2\.5 deg too high: 2\.5 -> \S+ deg",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_right_cause_is_named(urmpipe: Callable[..., Any], shared: Path, case: str) -> None:
    folder = shared / "cases"
    if not folder.is_dir():
        pytest.skip("the folder shared has no cases")
    name, _, robot = case.partition(" ")
    files = sorted(folder.glob(f"*/{name}*.csv"), reverse=True)  # path.csv before log.csv
    arm = next(folder.glob(f"*/{robot}")) if robot.endswith(".toml") else robot
    joints = ("--unit", "deg", "--tolerance", "joint=0.5deg")
    ran = urmpipe("diagnose", *files, *(("--robot", arm, "--unit", "rad") if robot else joints))
    first = ran.out.partition("\n")[0]
    assert re.fullmatch(CASES[case], first), first + ran.err
    assert ran.code == first.startswith("FAIL")
