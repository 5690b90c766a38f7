"""docs/json.md against the code: it has every key of what the commands print."""

from __future__ import annotations

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

import urmpipe
from diagnoses import diagnosis_of
from flat_arm import lay_flat_arm
from pages import lay, repeated_files
from urmpipe.main import cli, find_commands, run
from urmpipe_datasets import LOGS
from urmpipe_models.ik.solutions import forward_targets
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.verdict import judge_delta_meter
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.provenance import build_provenance
from urmpipe_pipeline.simulations.simulation import Signal, SimulatedBlock, Simulation

PAGE = (Path(__file__).parents[2] / "docs" / "json.md").read_text(encoding="utf-8")
NAMED = set(re.findall(r"`(\w+)`", PAGE))
FREE = {
    "steps", "units", "tolerance", "noise", "before", "now", "delta", "start", "joints", "joint_turns",
    "arguments", "points", "value", "variables", "poses",
}  # fmt: skip
"""Objects whose keys are names of columns, axes, joints, kinds or options."""


def keys(value: Any) -> set[str]:
    """Return the keys of objects and of the objects in them."""
    if isinstance(value, list):
        return set().union(*map(keys, value))
    if not isinstance(value, dict):
        return set()
    inner = [keys(item) for key, item in value.items() if key not in FREE or isinstance(item, list)]
    return set(value).union(*inner)


@pytest.fixture(scope="module")
def printed() -> list[dict[str, Any]]:
    """What ingest and compare print of a log with wraps."""
    run = urmpipe.ingest(LOGS / "coppeliasim.csv", robot="urm6")
    before = urmpipe.compare(LOGS / "path.csv", [run], tolerance=0.001)
    result = urmpipe.compare(LOGS / "path.csv", [run], baseline=before)
    return [run.to_dict(), result.to_dict(), *(one["delta"]["x"] for one in result.to_dict()["runs"])]


def test_each_key_is_named(printed: list[dict[str, Any]]) -> None:
    assert keys(printed) - NAMED == set()
    assert {"turns_before", "time_uncertainty", "out_fraction", "sample_max"} <= keys(printed)


def test_each_key_of_inverse_kinematics_is_named() -> None:
    arm = load_robot("ur5e")
    narrow = [replace(one, lower=-3.0, upper=0.8) if one is arm.moving[0] else one for one in arm.joints]
    arm = replace(arm, joints=tuple(narrow))  # beyond 0.8 only the other arm goes on
    q = np.tile([0.1, -0.9, 1.2, -0.5, 0.7, 0.2], (20, 1))
    q[:, 0] += 0.6 + 0.01 * np.arange(20)
    poses = forward_targets(arm, q)
    path = urmpipe.ik(poses, arm, tsp=0.01, start=q[0])
    found = path.to_dict()
    assert found["jumps"]
    assert found["speed_violations"]
    assert keys(found) - NAMED == set()
    assert {"branch", "nearest", "singular", "last_row", "steps", "position_error", "smallest"} <= keys(found)
    assert keys(urmpipe.ik(poses, arm).to_dict()) <= keys(found)


def test_each_key_of_a_diagnosis_is_named() -> None:
    run = urmpipe.ingest(LOGS / "matlab.csv", robot="urm6")
    (one,) = urmpipe.compare(LOGS / "path.csv", run).runs
    found = keys(replace(one, diagnosis=diagnosis_of(one)).to_dict())
    assert found - NAMED == set()
    assert {"rms_before", "from_sample", "discriminating_joint", "reason", "interpretation"} <= found


@pytest.mark.slow
def test_each_key_of_a_test_after_iso_9283_is_named(tmp_path: Path) -> None:
    lay(tmp_path, repeated_files())
    before = urmpipe.iso(tmp_path / "square.csv", tmp_path / "test.csv")
    result = urmpipe.iso(tmp_path / "square.csv", tmp_path / "test.csv", baseline=before)
    found = result.to_dict()
    assert keys(found) - NAMED == set()
    assert {"cycles", "poses", "criteria", "at", "last_row"} <= keys(found["iso"])
    assert {"before", "now", "worse", "better"} <= keys(found["baseline"]["criteria"])


def test_each_key_of_a_simulation_is_named() -> None:
    t_ns, block = np.arange(2), SimulatedBlock("meter", "unit", "delta_meter", "")
    simulation = Simulation(
        name="system", description="", t_ns=t_ns, step=0.005,
        signals=(Signal("meter", "energy_in", np.zeros(2), "J"),),
        system_svg="", system_text="", blocks=(block,), failed=None, warnings=(LogWarning("gap", "a gap"),),
        provenance=build_provenance("simulate", {}, ()),
        verdicts=tuple(filter(None, [judge_delta_meter("meter", t_ns, np.zeros((2, 3)), {"axis": 1.0})])),
    )  # fmt: skip
    found = keys(simulation.to_dict())
    assert found - NAMED == set()
    assert {"t_min", "quantity", "content", "message", "residual"} <= found


CALLS = {
    "accuracy accuracy": "accuracy --path short.csv --robot arm.toml --velocities 0.05 --backend python",
    "compare compare": "compare path.csv log.csv --robot urm6",
    "iso iso": "iso path.csv path.csv",
    "diagnose diagnose": "diagnose path.csv log.csv --robot urm6",
    "export export": "export log.rrd -o log.parquet",
    "fmu build": "fmu build dc_drive --backend python",
    "fmu check": "fmu check dc_drive.fmu",
    "fmu list": "fmu list",
    "ik ik": "ik path.csv --robot urm6",
    "ingest ingest": "ingest log.csv --robot urm6 -o log.rrd",
    "network check": "network check four-bar",
    "network list": "network list",
    "network drive": "network drive four-bar crank=0:90deg --steps 9",
    "network solve": "network solve four-bar",
    "plan plan": "plan cube:wall,a=0.02,r=0.001,x=1.7,y=0,z=1 --robot irb60",
    "report report": "report log.rrd",
    "robot equations": "robot equations rod.toml",
    "robot export": "robot export urm6 -o urm6.toml",
    "robot list": "robot list",
    "robot show": "robot show urm6",
    "simulate simulate": "simulate --list",
}
"""A call of each command that has --json; demo prints what compare prints."""


@pytest.mark.slow
def test_each_key_of_each_command_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, source in (("log", "matlab"), ("path", "path")):
        head = (LOGS / f"{source}.csv").read_text(encoding="utf-8").splitlines()[:31]
        (tmp_path / f"{name}.csv").write_text("\n".join(head) + "\n", encoding="utf-8")
    lay_flat_arm(tmp_path)
    rod = 'kind = "joints"\njoints = [{ name = "a" }]\ninertials = [{ joint = "a", mass = 1 }]\n'
    (tmp_path / "rod.toml").write_text(rod, encoding="utf-8")
    for call in sorted(CALLS.values(), key=lambda one: not one.startswith(("ingest", "fmu build"))):
        assert run([*shlex.split(call), "--json"]) == 0, call
        assert keys(json.loads(capsys.readouterr().out)) - NAMED == set(), call
    assert run(["ingest", "missing.csv", "--json"]) == 2
    assert keys(json.loads(capsys.readouterr().out)) - NAMED == set()


def test_each_command_with_json_is_called_and_named() -> None:
    context = click.Context(cli)
    asked = {
        f"{name} {one.name}"
        for name in find_commands()
        for command in [cli.get_command(context, name)]
        for one in (command.commands.values() if isinstance(command, click.Group) else [command])
        if one is not None and any("--json" in param.opts for param in one.params)
    }
    assert asked - {"demo demo"} == set(CALLS)
    of_page = {one.removesuffix(" --list") for one in re.findall(r"^\| `([a-z -]+)` \|", PAGE, re.MULTILINE)}
    shown = {" ".join(dict.fromkeys(one.split())) for one in asked}
    assert shown - of_page == set()
