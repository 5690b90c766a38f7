"""Numbers carry units: every option that takes a quantity, on the command line and in urmpipe.toml."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

import urmpipe as public
from urmpipe.main import cli, find_commands
from urmpipe_pipeline.presentation.section import Section, Table
from urmpipe_pipeline.results import present

CUBE = "cube:wall,a=600mm,r=30mm,x=1.7,y=0,z=1"

LINES = {
    "accuracy": f"accuracy --path {CUBE} --robot irb60",
    "compare": "compare path.csv log.csv --baseline before.rrd",
    "diagnose": "diagnose path.csv log.csv", "ik": "ik targets.csv --robot ur5e", "ingest": "ingest log.csv",
    "iso": "iso path.csv log.csv", "plan": f"plan {CUBE}",
    "report": "report run.rrd --figures figures", "simulate": "simulate one-drive",
}  # fmt: skip

TIMES = [("5ms", 0.005), ("0.02", 0.02), ("30us", 3e-5), ("20", 20.0)]
SPEEDS = [("250mm/s", 0.25), ("2", 2.0)]
DEVIATIONS = [("0.4mm", 4e-4), ("20µm", 2e-5), ("0.0199", 0.0199), ("0.02m", 0.02), ("1cm", 0.01)]
UNCLEAR = [("0.02", "0.02mm or 0.02m"), ("3.5", "3.5mm or 3.5m"), ("1e3", "1e3mm or 1e3m")]

TAKEN: dict[tuple[str, str], list[tuple[str, Any]]] = {
    ("accuracy", "acceleration"): [("500mm/s2", 0.5), ("6m/s^2", 6.0), ("6 m/s²", 6.0), ("30", 30.0)],
    ("accuracy", "force"): [("0,0,-50N", (0.0, 0.0, -50.0))],
    ("accuracy", "jerk"): [("60m/s3", 60.0), ("9000mm/s^3", 9.0)],
    ("accuracy", "limit"): DEVIATIONS,
    ("accuracy", "velocities"): [("100mm/s,0.2,3m/s", (0.1, 0.2, 3.0))],
    ("iso", "band"): DEVIATIONS,
    ("compare", "noise"): [("5um,angle=0.5deg,AV=1%", {"norm": 5e-6, "angle": np.pi / 360, "AV": 0.01})],
    ("compare", "period"): TIMES,
    ("compare", "sync"): [*TIMES, ("-200ms", -0.2)],
    ("compare", "tsp"): TIMES,
    ("diagnose", "period"): TIMES,
    ("diagnose", "tsp"): TIMES,
    ("ik", "tolerance"): DEVIATIONS,
    ("ik", "tsp"): TIMES,
    ("ingest", "period"): TIMES,
    ("ingest", "tsp"): TIMES,
    ("plan", "acceleration"): [("500mm/s2", 0.5)],
    ("plan", "jerk"): [("60m/s3", 60.0)],
    ("plan", "tsp"): TIMES,
    ("plan", "velocity"): SPEEDS,
    ("report", "figure-font"): [("8pt", 8.0), ("9", 9.0)],
    ("simulate", "duration"): TIMES,
    ("simulate", "period"): TIMES,
    ("simulate", "step"): TIMES,
    ("simulate", "timeout"): TIMES,
}
"""The texts that each option takes, and their values in SI."""

SHARES_AND_ANGLES = [
    ("axis=3.5", "axis=3.5mm or axis=3.5m"),
    ("angle=0.2001", "angle=0.2001deg or angle=0.2001rad"),
]
REFUSED = {
    ("accuracy", "limit"): UNCLEAR,
    ("iso", "band"): UNCLEAR,
    ("compare", "noise"): [*UNCLEAR, *SHARES_AND_ANGLES],
    ("compare", "tolerance"): [*UNCLEAR, *SHARES_AND_ANGLES],
    ("diagnose", "tolerance"): [*UNCLEAR, *SHARES_AND_ANGLES],
    ("ik", "tolerance"): UNCLEAR,
}
"""The texts without units that each option refuses, and both of their readings."""


def cases(table: dict[tuple[str, str], list[tuple[str, Any]]]) -> Iterator[Any]:
    """Yield each option of a table with each text."""
    for (command, option), texts in table.items():
        for text, value in texts:
            yield pytest.param(command, option, text, value, id=f"{command}-{option}-{text}")


@pytest.fixture(params=["the command line", "urmpipe.toml"])
def ran(request: pytest.FixtureRequest, urmpipe: Callable[..., Any], tmp_path: Path) -> Callable[..., Any]:
    """Run a command with the value of an option, given in either place."""

    def run(command: str, option: str, text: str) -> Any:
        if request.param == "the command line":
            return urmpipe(*LINES[command].split(), f"--{option}", text)
        number = text.replace(".", "").isdigit()  # in TOML a number, too
        line = f"{option} = {text if number else json.dumps(text)}"
        (tmp_path / "urmpipe.toml").write_text(f"[{command}]\n{line}\n", encoding="utf-8")
        return urmpipe(*LINES[command].split())

    return run


def options_of_quantities() -> Iterator[tuple[str, str]]:
    """Yield the options that are declared as a number with a unit."""
    for name in find_commands():
        command = cli.get_command(click.Context(cli), name)
        for param in command.params if command else ():
            if isinstance(param, click.Option) and param.type.name.startswith("NUMBER["):
                yield name, max(param.opts, key=len).removeprefix("--")


def test_the_table_has_every_option() -> None:
    assert set(options_of_quantities()) <= set(TAKEN)


@pytest.mark.parametrize(("command", "option", "text", "value"), [*cases(TAKEN)])
def test_a_quantity_arrives_in_si(
    command: str, option: str, text: str, value: Any, ran: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: dict[str, Any] = {}

    monkeypatch.setattr(public, command, lambda *_, **keywords: given.update(keywords))
    ran(command, option, text)
    found = given[option.replace("-", "_")]
    if isinstance(value, dict):
        found = {kind: found[kind] for kind in value}
    assert found == value


@pytest.mark.parametrize(("command", "option", "text", "both"), [*cases(REFUSED)])
def test_a_deviation_that_is_unclear_is_refused_with_both_readings(
    command: str, option: str, text: str, both: str, ran: Any
) -> None:
    done = ran(command, option, text)
    assert (done.code, done.out) == (2, "")
    (error,) = (line for line in done.err.splitlines() if not line.startswith("note: "))
    assert re.search(rf"(key {option}|\(--{option}\)): found {text}, allowed: a unit: {both}$", error)


BOOM = """
length_unit = "mm"
angle_unit = "deg"
controls = {turn = {start = 40}, stroke = {start = 900}}
bodies = {boom = {}, rod = {}}
joints.pivot = {kind = "revolute", bodies = ["ground", "boom"], driven = "turn"}
joints.slide = {kind = "prismatic", bodies = ["boom", "rod"], driven = "stroke"}
"""


@pytest.mark.parametrize(
    ("line", "with_units", "in_si"),
    [
        ("robot show ur5e --q {}", "90deg,0,1.57rad,0,500mrad,0", f"{np.pi / 2!r},0,1.57,0,0.5,0"),
        ("robot show ur5e --tool {}", "0,1cm,150mm,0,0,90deg", f"0,0.01,0.15,0,0,{np.pi / 2!r}"),
        ("plan cube:wall,a=0.1,r=0.01,x=0.4,y=0,z=0.4 --robot ur5e --start {}", "0,-90deg,90deg,0,90deg,0",
         f"0,{-np.pi / 2!r},{np.pi / 2!r},0,{np.pi / 2!r},0"),
        ("network check boom.toml --set turn={}", "0.5rad", "28.64788975654116"),
        ("network check boom.toml --set turn={}", "30°", "30"),
        ("network check boom.toml --set stroke={}", "1m", "1000"),
        ("ingest log.csv --unit deg --interval {} --explain", "-180deg:3.141592653589793rad", "-180:180"),
    ],
)  # fmt: skip
def test_a_text_with_units_does_what_its_numbers_do(
    line: str, with_units: str, in_si: str, urmpipe: Any, tmp_path: Path
) -> None:
    (tmp_path / "boom.toml").write_text(BOOM, encoding="utf-8")
    (tmp_path / "log.csv").write_text("t,q1\n0,170\n0.1,179\n0.2,-172\n0.3,-163\n", encoding="utf-8")
    done = [urmpipe(*line.format(value).split(), "--json") for value in (with_units, in_si)]
    assert [one.code for one in done] == [0, 0], done
    with_units, in_si = (re.sub(r"[-+0-9]*:..:[^,]*", "", one.out) for one in done)  # when each was made
    assert with_units == in_si


def parts(section: Section) -> Iterator[Section]:
    """Yield a section and all below it."""
    yield section
    for one in section.sections:
        yield from parts(one)


def test_what_is_printed_back_has_units(urmpipe: Any, tmp_path: Path) -> None:
    rows = "".join(f"{i / 100},{i / 1000},0,0\n" for i in range(50))
    for name in ("path.csv", "log.csv"):
        (tmp_path / name).write_text(f"t,x,y,z\n{rows}", encoding="utf-8")
    assert urmpipe("compare", "path.csv", "log.csv", "--tolerance", "0.01,norm=5mm", "-o", "a.rrd").code == 0
    results = public.read_recording(tmp_path / "a.rrd"), public.plan(CUBE, velocity=0.25, acceleration=6)
    blocks = [block for one in results for part in parts(present(one).body) for block in part.blocks()]
    made = [one for one in blocks if isinstance(one, Table) and one.title == "How it was made"]
    told = {
        name: words
        for one in made
        for name, words in zip(*(column.cells for column in one.columns), strict=True)
    }
    assert told["option tolerance"] == (
        '{"axis": "10 mm", "norm": "5 mm", "coverage": "90 %", "judged": "50 %"}'
    )
    options = {name: told[f"option {name}"] for name in ("velocity", "acceleration", "tsp", "law")}
    assert options == {"velocity": "0.25 m/s", "acceleration": "6 m/s2", "tsp": "0.005 s", "law": "trapezoid"}
