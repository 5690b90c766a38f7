"""`urmpipe simulate` and `urmpipe.simulate`: systems of blocks, run, judged and recorded."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe
from thinned_logs import lay_thinned_logs
from urmpipe.api.recordings import read_recording
from urmpipe.api.simulate import simulate
from urmpipe_datasets import LOGS
from urmpipe_models.errors import shell_quote
from urmpipe_pipeline.simulations.simulation import Simulation

RunCommand = Callable[..., Any]

FOLLOWER = """
from urmpipe_fmus.block import BlockModel, Input, Output, Parameter, State

unit = BlockModel(
    name="follower",
    description="A lag of the first order",
    variables=(
        Parameter(name="T", description="Time constant", unit="s", start=0.1, minimum=1e-3),
        Parameter(name="gain", description="Gain of the rate", start=1.0),
        Input(name="u", description="What is followed", unit="V"),
        State(name="x", description="What follows", unit="V", output=True),
        Output(name="error", description="What is left", unit="V"),
    ),
    outputs=lambda v: {"error": v.u - v.x},
    derivatives=lambda v: {"x": v.gain * (v.u - v.x) / v.T},
)
"""

SWING = """
import numpy as np

from urmpipe_fmus.block import BlockModel, Output, Parameter, State


def force(v):
    return np.clip(10.0 * np.sin(3.0 * v.time), -v.F_max, v.F_max)


unit = BlockModel(
    name="swing",
    description="A mass of 1 kg on a spring with a damper",
    variables=(
        Parameter(name="F_max", description="Largest force", unit="N", start=6.0),
        State(name="x", description="Place", unit="m", start=0.1, output=True),
        State(name="v", description="Velocity", unit="m/s", output=True),
        State(name="energy_in", description="Work of the force", unit="J", output=True),
        State(name="energy_lost", description="Heat of the damper", unit="J", output=True),
        Output(name="energy_stored", description="Kinetic and elastic energy", unit="J"),
        Output(name="F", description="Force", unit="N"),
    ),
    outputs=lambda v: {"F": force(v), "energy_stored": 0.5 * v.v * v.v + 10.0 * v.x * v.x},
    derivatives=lambda v: {
        "x": v.v,
        "v": force(v) - 0.5 * v.v - 20.0 * v.x,
        "energy_in": force(v) * v.v,
        "energy_lost": 0.5 * v.v * v.v,
    },
)
"""

FOLLOWING = """
[system]
name = "following"
step = 0.01

[arguments]
log = "voltage.csv"
gain = 1.0

[blocks.lag]
file = "follower.py"
start = { gain = "$gain" }

[inputs]
"lag.u" = { log = "$log", column = "u" }
"""


@pytest.fixture
def following(tmp_path: Path) -> Path:
    """A system of a user's own unit, driven by a column of a table."""
    (tmp_path / "follower.py").write_text(FOLLOWER, encoding="utf-8")
    rows = "".join(f"{k / 100:.2f},{1.0 if k >= 10 else 0.0}\n" for k in range(101))
    (tmp_path / "voltage.csv").write_text(f"t,u (V)\n{rows}", encoding="utf-8")
    (tmp_path / "following.toml").write_text(FOLLOWING, encoding="utf-8")
    return tmp_path / "following.toml"


@pytest.mark.slow
def test_a_unit_of_ones_own_follows_a_column_of_a_table(following: Path) -> None:
    result = simulate(following)
    x, t = result.signal("lag.x").values, result.t
    expected = np.where(t > 0.1, 1.0 - np.exp(-(t - 0.1) / 0.1), 0.0)
    # RK4 in steps of 1 ms: (h / T)^5 / 120 = 1e-12 a step, 100 steps
    np.testing.assert_allclose(x, expected, rtol=0.0, atol=1e-10)
    assert result.signal("lag.x").unit == "V"
    assert result.signal("lag.error").description == "What is left"
    np.testing.assert_array_equal(result.signal("lag.u").values, (np.arange(101) >= 10).astype(float))
    assert (result.duration, result.verdict, result.failed) == (1.0, None, None)


@pytest.mark.slow
def test_a_unit_of_ones_own_shows_its_energies_and_its_limit(urmpipe: RunCommand, tmp_path: Path) -> None:
    (tmp_path / "swing.py").write_text(SWING, encoding="utf-8")
    system = '[system]\nstep = 0.01\nduration = 10.0\n[blocks.swing]\nfile = "swing.py"\n'
    (tmp_path / "swinging.toml").write_text(system, encoding="utf-8")
    energy = json.loads(urmpipe("simulate", "swinging.toml", "--json").out)["energy"]
    # RK4 in steps of h = 1 ms: a corner of the force, of 30 N/s, is an impulse of 30 h^2 / 8 = 4e-6 N.s off
    # at most, at 3 m/s 1.2e-5 J; there are 19 of them
    assert abs(energy["residual"]) < 2.3e-4
    assert energy["supplied"] - energy["dissipated"] == pytest.approx(
        energy["stored"] + energy["residual"], rel=1e-12
    )
    urmpipe("report", "swinging.rrd")
    page = (tmp_path / "swinging.html").read_text(encoding="utf-8")
    assert "Sums over swing since the first sample: " in page
    assert "Dashed: the limit of |F|, 6 N; tinted: beyond it." in page


@pytest.mark.slow
def test_energy_that_the_coupling_takes_is_a_warning_everywhere(urmpipe: RunCommand, tmp_path: Path) -> None:
    free = """
        [system]
        step = 0.001
        duration = 0.1
        [blocks.drive]
        unit = "dc_drive"
        start = { u = 24.0 }
        [connections]
        "drive.theta2" = "drive.theta1"
        "drive.omega2" = "drive.omega1"
        """
    (tmp_path / "free.toml").write_text(free, encoding="utf-8")
    ran = urmpipe("simulate", "free.toml", "--backend", "python", "--json")
    (told,) = (one for one in json.loads(ran.out)["warnings"] if one["kind"] == "coarse-step")
    said = re.sub(r"[\d.]+ J, [\d.]+ %", "E, S", told["message"])
    assert said == (
        "blocks see each other's values held over 1 ms: residual of the energy balance: found E, S of the"
        " largest energy, allowed: 5 %; --step 0.0002 makes it smaller"
    )
    assert f"warning: {told['message']}\n" in ran.err
    kept = read_recording(tmp_path / "free.rrd")
    assert isinstance(kept, Simulation)
    assert [one.kind for one in kept.warnings] == ["coarse-step"]


@pytest.mark.slow
def test_the_recording_reads_back_as_the_simulation(following: Path, tmp_path: Path) -> None:
    (tmp_path / "system.svg").write_text("<!-- Generator: urmpipe 1 -->", encoding="utf-8")  # is replaced
    made = simulate(following, output=tmp_path / "run.rrd", draw=tmp_path / "system.svg")
    assert made.recording == tmp_path / "run.rrd"
    read = urmpipe.read_recording(tmp_path / "run.rrd")
    assert isinstance(read, Simulation)
    np.testing.assert_array_equal(read.signal("lag.x").values, made.signal("lag.x").values)
    assert read.system_svg == made.system_svg
    assert read.system_text == FOLLOWING
    drawn = (tmp_path / "system.svg").read_text(encoding="utf-8")
    assert drawn.startswith("<!-- Generator: urmpipe ")
    assert "follower.py" in drawn


@pytest.mark.slow
def test_an_fmu_that_fails_leaves_what_was_recorded(
    urmpipe: RunCommand, following: Path, tmp_path: Path
) -> None:
    ran = urmpipe("simulate", following, "--set", "gain=-1e306", "--json")
    result = json.loads(ran.out)
    assert ran.code == 2
    assert result["failed"].startswith("block lag: fmi2DoStep at t = 0.1 s: ")
    assert f"error: {result['failed']}; the samples until then are in following.rrd" in ran.err
    assert (result["samples"], result["verdict"]) == (11, "fail")
    assert (tmp_path / "following.rrd").exists()


@pytest.mark.slow
def test_the_command_prints_system_verdict_and_signals(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe("simulate", "log-to-delta", "--duration", "0.1")
    lines = ran.out.splitlines()
    assert ran.code == 0
    assumed = "assuming the positions are in m (path)"
    assert lines[0] == f"PASS  delta of log-to-delta within tolerance, {assumed}"
    assert lines[2].strip() == (
        "Decided by: |Δy| = 0.4174 mm of 3.5 mm allowed (11.9 % of the tolerance) at t = 0.085 s;"
        " out of tolerance: 0 of 21 samples (0 %)"
    )
    assert {"  Samples: 21", "  Duration: 0.100 s", "  Communication step: 0.005 s"} <= set(lines)
    begin = lines.index("Simulation log-to-delta: Signals") + 4
    table = [line.split(maxsplit=1)[0].split("[")[0] for line in lines[begin : begin + 12]]
    assert table == [
        *["delta.delta"] * 3, "delta.norm", *["log.q"] * 3, "reference.p", *["repolarizer.q"] * 2,
        *["chain.p7"] * 2,
    ]  # fmt: skip
    assert "4 more sections: --json, or the report" in lines
    assert lines[-1].startswith("Recording: log-to-delta.rrd")
    assert ran.err.splitlines()[-1].startswith("warning: path: no unit is given for x, y, z")


def test_signals_that_stand_still_come_last(urmpipe: RunCommand, tmp_path: Path) -> None:
    text = FOLLOWING.replace("step = 0.01", "step = 0.01\nrecord_every = 5\nduration = 0.1")
    extra = '[blocks.still]\nfile = "follower.py"\nstart = { u = 0.0 }\n[blocks.lag]'
    (tmp_path / "still.toml").write_text(text.replace("[blocks.lag]", extra), encoding="utf-8")
    (tmp_path / "follower.py").write_text(FOLLOWER, encoding="utf-8")
    (tmp_path / "voltage.csv").write_text("t,u (V)\n0,1\n1,1\n", encoding="utf-8")
    lines = urmpipe("simulate", "still.toml").out.splitlines()
    assert {"  Communication step: 0.010 s", "  Samples: 3"} <= set(lines)
    named = [line.split()[0] for line in lines if line.startswith(("lag.", "still."))]
    assert named == ["lag.x", "lag.error", "lag.u", "still.x", "still.error"]


@pytest.mark.slow
def test_out_of_tolerance_is_exit_code_1_and_json_tells(urmpipe: RunCommand, tmp_path: Path) -> None:
    lay_thinned_logs(tmp_path)
    logs = ("--set", "log=counter_rotating.csv", "--set", "reference=path.csv")
    ran = urmpipe("simulate", "log-to-delta", *logs, "--duration", "10s", "--json", "-q")
    result = json.loads(ran.out)
    assert ran.code == 1
    assert ran.err.startswith("FAIL  delta of log-to-delta out of tolerance, ")
    assert (result["verdict"], result["verdicts"][0]["block"]) == ("fail", "delta")


@pytest.mark.slow
def test_quiet_says_nothing(urmpipe: RunCommand) -> None:
    ran = urmpipe("simulate", "log-to-delta", "--duration", "0.01", "-q")
    assert (ran.code, ran.out, ran.err) == (0, "", "")


def test_the_list_has_the_shipped_systems_with_their_arguments(urmpipe: RunCommand) -> None:
    listed = json.loads(urmpipe("simulate", "--list", "--json").out)["systems"]
    names = ["crank-rocker", "driven-arm", "log-to-delta", "one-drive", "six-drives"]
    assert [one["name"] for one in listed] == names
    assert listed[2]["arguments"]["log"] == "coppeliasim.csv"
    assert "log=coppeliasim.csv" in urmpipe("simulate", "--list").out


@pytest.mark.slow
def test_a_shipped_system_is_written_to_be_changed(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe("simulate", "one-drive", "--write-system", "mine.toml")
    assert (ran.code, ran.err) == (0, "")
    assert ran.out == "System: mine.toml  (change it, then: urmpipe simulate mine.toml)\n"
    told = f"System: my drive.toml  (change it, then: urmpipe simulate {shell_quote('my drive.toml')})\n"
    assert urmpipe("simulate", "one-drive", "--write-system", "my drive.toml").out == told
    text = (tmp_path / "mine.toml").read_text(encoding="utf-8")
    changed = text.replace('unit = "dc_drive"', 'unit = "dc_drive"\nstart = { C = 0.1 }')
    (tmp_path / "mine.toml").write_text(changed, encoding="utf-8")
    result = simulate(tmp_path / "mine.toml", duration=0.01)
    drive = next(one for one in result.blocks if one.name == "drive")
    assert [(one.variable, one.value) for one in drive.settings if one.from_system] == [("C", 0.1)]
    ran = urmpipe("simulate", "one-drive", "--write-system", "mine.toml")
    assert (ran.code, ran.err) == (2, "error: mine.toml: found a file, allowed: a new name\n")
    assert (tmp_path / "mine.toml").read_text(encoding="utf-8") == changed


@pytest.mark.slow
def test_a_written_system_asks_for_the_logs_that_stay_with_the_shipped_one(
    urmpipe: RunCommand, tmp_path: Path
) -> None:
    ran = urmpipe("simulate", "log-to-delta", "--write-system", "mine.toml")
    told = "urmpipe simulate mine.toml --set log=FILE.csv --set reference=FILE.csv"
    assert ran.out == f"System: mine.toml  (change it, then: {told})\n"
    logs = {"log": str(LOGS / "coppeliasim.csv"), "reference": str(LOGS / "path.csv")}
    assert simulate(tmp_path / "mine.toml", arguments=logs, duration=0.02).verdict == "pass"


@pytest.mark.slow
def test_an_fmu_that_fails_at_once_leaves_an_empty_recording(following: Path, tmp_path: Path) -> None:
    unit = tmp_path / "follower.py"
    unit.write_text(FOLLOWER.replace("v.u - v.x}", "(v.u - v.x) / (v.gain - v.gain)}"), encoding="utf-8")
    result = simulate(following, output=tmp_path / "run.rrd")
    assert result.failed is not None
    assert result.failed.startswith("block lag: fmi2GetReal at t = 0 s: ")
    assert (len(result.t_ns), result.verdict) == (0, "fail")
    read = urmpipe.read_recording(tmp_path / "run.rrd")
    assert isinstance(read, Simulation)
    assert read.failed == result.failed


@pytest.mark.slow
def test_a_map_says_how_the_log_of_a_block_is_read(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("t,q1,q2\n0,180,90\n0.01,170,80\n", encoding="utf-8")
    run = urmpipe.ingest(tmp_path / "log.csv", unit={"": "deg"})
    urmpipe.write_map(run, tmp_path / "lab.toml")
    system = tmp_path / "system.toml"
    block = '[blocks.log]\nunit = "log_source"\nlog = "log.csv"\nmap = "lab.toml"\n'
    system.write_text(block, encoding="utf-8")
    q = simulate(system, step=0.01, backend="python").signal("log.q").values
    # one product of two doubles: a unit in the last place
    np.testing.assert_allclose(q, np.radians([[180.0, 90.0], [170.0, 80.0]]), rtol=2.3e-16)


@pytest.mark.slow
def test_a_cold_build_is_told(following: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URMPIPE_CACHE", str(tmp_path / "cache"))
    lines: list[str] = []
    simulate(following, on_message=lines.append, backend="python")
    assert lines == ["building follower for block lag ..."]
    simulate(following, on_message=lines.append, backend="python")
    assert lines == ["building follower for block lag ..."]


def test_progress_rises_to_1(following: Path, tmp_path: Path) -> None:
    shares: list[float] = []
    simulate(following, output=tmp_path / "run.rrd", progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
