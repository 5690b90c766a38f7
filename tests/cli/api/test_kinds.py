"""Each keyword of each public function refuses what is not of its kind, by its name."""

from __future__ import annotations

from collections.abc import Iterator
from inspect import Parameter, isfunction, signature
from pathlib import Path
from typing import Any, get_args

import pandas as pd
import pytest

import urmpipe
from urmpipe.api.equations import FormName
from urmpipe.kinds import KINDS, kind_of
from urmpipe.systems.units import Backend
from urmpipe_models.ik.solve import METHODS
from urmpipe_models.lagrange.derivation import TERMS
from urmpipe_models.planning.laws import ARCS
from urmpipe_pipeline.accuracy.result import DECIDES
from urmpipe_pipeline.comparison.compare import Tcp
from urmpipe_pipeline.planned_paths.request import LAWS
from urmpipe_pipeline.runs.derivatives import Method
from urmpipe_pipeline.tables.export import Format
from urmpipe_pipeline.tables.export import RowNames as Rows
from urmpipe_pipeline.trajectories import AlignMode

FUNCTIONS = {name: getattr(urmpipe, name) for name in urmpipe.__all__ if isfunction(getattr(urmpipe, name))}

ODD: dict[str, Any] = {
    "nothing": None,
    "a number": 3,
    "an empty text": "",
    "a list": [],
    "a mapping": {},
    "an object": object(),
    "a table": pd.DataFrame({"t": [0.0], "q1": [1.0]}),
}

RIGHT = {
    "a number": {
        "tsp",
        "tolerance",
        "noise",
        "sync",
        "step",
        "duration",
        "timeout",
        "restarts",
        "seed",
        "steps",
        "branch",
        "period",
        "time",
        "velocity",
        "acceleration",
        "limit",
        "band",
        "planes",
        "figure_width",
        "figure_font",
        "figure_dpi",
    },
    "a list": {
        "logs",
        "inputs",
        "defaults",
        "platforms",
        "formats",
        "joints",
        "measured",
        "names",
        "figure_names",
        "wrenches",
    },
    "a mapping": {
        "arguments",
        "controls",
        "drives",
        "network",
        "options",
        "torques",
        "unit",
        "interval",
        "network_check.start",
        "network_drive.start",
        "network_solve.start",
    },
    "a table": {
        "ingest.log",
        "compare.reference",
        "compare.logs",
        "diagnose.reference",
        "diagnose.log",
        "network_drive.log",
    },
}
"""Which keywords, of one function or of all, take what is odd elsewhere; each takes its default."""


def keywords() -> Iterator[object]:
    """Yield each public function with each of its keywords."""
    for name, function in FUNCTIONS.items():
        for keyword in signature(function).parameters:
            yield pytest.param(name, keyword, id=f"{name}-{keyword}")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> urmpipe.Run:
    """A run of one joint."""
    log = tmp_path_factory.mktemp("run") / "log.csv"
    log.write_text("t [s],q1 [rad]\n" + "".join(f"{i / 10},{i / 20}\n" for i in range(9)), encoding="utf-8")
    return urmpipe.ingest(log)


def given(function: str, run: urmpipe.Run, folder: Path) -> dict[str, Any]:
    """Return what a function cannot do without."""
    one_of_each = {
        "log": "log.csv", "logs": "log.csv", "reference": "path.csv", "targets": [[0.3, 0.1, 0.4]],
        "results": run, "result": run, "run": run, "recordings": "run.rrd", "output": folder / "out",
        "system": "one-drive", "unit": "kinematic_chain", "name_or_path": "urm6", "path": "lab.toml",
        "robot": "ur5e", "network": "four-bar",
    }  # fmt: skip
    parameters = signature(FUNCTIONS[function]).parameters
    if function == "plan":
        one_of_each["path"] = "cube:wall,a=0.2,r=0.02,x=0.5,y=0,z=0.3"
    needed = {name: one_of_each[name] for name, one in parameters.items() if one.default is Parameter.empty}
    if function == "accuracy":
        return needed | {"robot": "irb60", "path": "cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1"}
    if function == "network_drive":
        return needed | {"drives": {"crank": (0.9, 1.0)}}
    return needed | ({"robot": "ur5e"} if "robot" in parameters else {})


@pytest.mark.slow
@pytest.mark.parametrize(("function", "keyword"), [*keywords()])
def test_what_is_of_a_wrong_kind_is_refused_by_its_keyword(
    function: str, keyword: str, run: urmpipe.Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    default = signature(FUNCTIONS[function]).parameters[keyword].default
    for what, odd in ODD.items():
        if odd is default or {keyword, f"{function}.{keyword}"} & RIGHT.get(what, set()):
            continue
        with pytest.raises(urmpipe.OptionError) as error:
            FUNCTIONS[function](**{**given(function, run, tmp_path), keyword: odd})
        told = [str(one) for one in error.value.findings if one.parameter == keyword]
        assert len(told) == 1, f"{what}: {error.value}"
        found, _, allowed = told[0].partition(", allowed: ")
        assert len(found) < len(keyword) + 80, what
        assert allowed, what
    assert list(tmp_path.iterdir()) == []


def test_each_kind_is_of_a_keyword() -> None:
    known = {name: set(signature(function).parameters) for name, function in FUNCTIONS.items()}
    every = {f"{name}.{one}" for name, parameters in known.items() for one in parameters}
    assert set(KINDS) <= every | set().union(*known.values())


@pytest.mark.parametrize(
    ("keyword", "names"),
    [
        ("align", get_args(AlignMode)),
        ("arcs", ARCS),
        ("backend", get_args(Backend)),
        ("derivative", get_args(Method)),
        ("error", DECIDES),
        ("form", get_args(FormName)),
        ("law", LAWS),
        ("method", METHODS),
        ("rows", get_args(Rows)),
        ("tcp", get_args(Tcp)),
        ("term", ("all", *TERMS)),
        ("to", get_args(Format)),
    ],
)
def test_each_name_that_a_keyword_takes_is_told(keyword: str, names: tuple[str, ...]) -> None:
    kind = KINDS[keyword]
    assert kind.allowed == ", ".join(names)
    assert all(kind.fits(name) for name in names)


def test_a_keyword_may_take_something_else_in_one_function() -> None:
    tolerance, elsewhere = kind_of("ik", "tolerance"), kind_of("compare", "tolerance")
    assert tolerance is not None
    assert elsewhere is not None
    assert not tolerance.fits({"axis": 0.01})
    assert elsewhere.fits({"axis": 0.01})
    assert kind_of("compare", "reference") is None


@pytest.mark.slow
def test_arguments_of_a_system_may_be_paths_and_numbers() -> None:
    kind = KINDS["arguments"]
    assert kind.fits({"log": Path("log.csv"), "gain": 3, "name": "text"})
    assert not kind.fits({"log": True})
    assert not kind.fits({3: "log.csv"})
    given = {"log": Path("missing.csv"), "reference": Path("path.csv")}
    with pytest.raises(
        urmpipe.UrmpipeError, match=r"^log-to-delta\.toml:\d+: blocks\.log: missing\.csv: found no"
    ):
        urmpipe.simulate("log-to-delta", arguments=given, backend="python")
