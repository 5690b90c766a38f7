"""compare --keep-going: what can be judged is judged and written, and what cannot is an error beside it."""

from __future__ import annotations

import csv
import json
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path

import pytest

import urmpipe
from four_logs import Captured, compare, lay_logs, names, read_lines, recorded
from urmpipe.printing.results import print_presentation
from urmpipe_models.errors import LogError
from urmpipe_pipeline.results import present

WRONG = [
    "broken.csv:12, column q1 [rad]: found 'x', allowed: a number, or an empty, Null or NaN cell where a"
    " sample is missing",
    "broken.csv: 1 of 200 rows cannot be read; --skip-bad leaves them out",
]
MISSING = "missing.csv: found no such file"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of four logs, with one more that cannot be read."""
    folder = lay_logs(tmp_path, monkeypatch)
    lines = read_lines("good.csv")
    t, _, *others = lines[11].split(",")
    lines[11] = ",".join([t, "x", *others])
    Path("broken.csv").write_text("".join(lines), encoding="utf-8")
    return folder


def test_the_others_are_judged_and_all_outputs_name_the_log_that_is_not(capsys: Captured) -> None:
    logs = ("good.csv", "broken.csv", "missing.csv")
    files = ("-q", "--json", "--junit", "v.xml", "--csv", "v.csv", "-o", "v.rrd")
    assert compare(*logs, *files) == 2
    assert names() == {"broken.csv", "v.xml"}
    capsys.readouterr()
    assert compare(*logs, *files, "--keep-going") == 2
    out, err = capsys.readouterr()
    assert err.splitlines() == [f"error: {one}" for one in (*WRONG, MISSING)]
    told = json.loads(out)
    assert (told["verdict"], [(one["name"], one["verdict"]) for one in told["runs"]]) == (
        None, [("good", "pass")],
    )  # fmt: skip
    assert [one["name"] for one in told["failed_logs"]] == ["broken", "missing"]
    assert told["failed_logs"][0]["errors"][0]["line"] == 12
    cases = [
        (case.get("classname"), case.get("name"), [(one.tag, one.text) for one in case])
        for case in ET.parse("v.xml").iter("testcase")
    ]
    assert cases == [
        *(("good", name, []) for name in (*"xyz", "coverage", "judged")),
        *(("broken", f"can be compared ({k + 1})", [("error", WRONG[k])]) for k in range(2)),
        ("missing", "can be compared (1)", [("error", MISSING)]),
    ]
    with Path("v.csv").open(encoding="utf-8", newline="") as file:
        assert {row["run"] for row in csv.DictReader(file)} == {"good"}
    made = recorded("v.rrd")
    assert [(one.name, [str(error) for error in one.errors]) for one in made.failed_logs] == [
        ("broken", WRONG), ("missing", [MISSING]),
    ]  # fmt: skip
    said = (
        "1 of 3 logs (good) within tolerance against wanted, by the joints on both sides; not judged: broken"
    )
    assert (present(made).word, present(made).headline) == ("incomplete", f"{said} and missing")
    print_presentation(present(made))
    assert "more section" not in capsys.readouterr().out


def test_a_failure_stays_a_failure_beside_a_log_without_a_verdict(capsys: Captured) -> None:
    assert compare("bad.csv", "broken.csv", "-q", "--keep-going") == 2
    err = capsys.readouterr().err.splitlines()
    assert err[0] == (
        "FAIL  1 of 2 logs (bad) out of tolerance against wanted, by the joints on both sides;"
        " not judged: broken"
    )
    assert err[-2:] == [f"error: {one}" for one in WRONG]


def test_a_log_that_cannot_be_held_against_the_reference_is_not_judged() -> None:
    wanted, good = (urmpipe.ingest(name, robot="ur5e") for name in ("wanted.csv", "good.csv"))
    still = urmpipe.ingest("slack.csv", robot="ur5e", poses=True)
    result = urmpipe.compare(wanted, [still, good], keep_going=True)
    assert ([one.name for one in result.runs], [one.name for one in result.failed_logs]) == (
        ["good"],
        ["slack"],
    )
    assert str(result.failed_logs[0].errors[0]).startswith("slack.csv: found still poses beside a motion")
    earlier = urmpipe.compare(wanted, [good, urmpipe.ingest("slack.csv", robot="ur5e")])
    again = urmpipe.compare(wanted, [still, good], keep_going=True, baseline=earlier)
    assert again.baseline is not None
    assert (again.verdict, again.baseline.verdict, again.baseline.missing) == (None, "pass", ())


def test_with_strict_a_log_with_a_warning_is_not_judged() -> None:
    half = read_lines("good.csv")[:80]
    Path("half.csv").write_text("".join(half), encoding="utf-8")
    judge = partial(urmpipe.compare, "wanted.csv", robot="ur5e", keep_going=True, strict=True)
    result = judge(["half.csv", "good.csv"], tolerance="coverage=30%")
    (lost,) = result.failed_logs
    assert ([one.name for one in result.runs], lost.name) == (["good"], "half")
    assert [str(one) for one in lost.errors] == [
        "strict (--strict): found 1 warning, allowed: none",
        "half: it shows 79 of 200 samples of wanted (39.5 %), longest unseen: 0.600 s from t = 0.395 s"
        " of the reference",
    ]


def test_without_any_log_to_judge_it_is_an_error_as_ever(capsys: Captured) -> None:
    assert compare("broken.csv", "missing.csv", "-q", "--keep-going", "-o", "v.rrd") == 2
    assert capsys.readouterr().err == "".join(f"error: {one}\n" for one in (*WRONG, MISSING))
    with pytest.raises(LogError, match=r"^missing.csv: found no such file$"):
        urmpipe.compare("missing.csv", ["good.csv"], "ur5e", keep_going=True)
    assert names() == {"broken.csv"}


def test_a_lab_may_keep_going_by_default(folder: Path) -> None:
    (folder / "urmpipe.toml").write_text("[compare]\nkeep-going = true\n", encoding="utf-8")
    assert compare("good.csv", "broken.csv", "-q", "-o", "v.rrd") == 2
    assert [one.name for one in recorded("v.rrd").failed_logs] == ["broken"]
