"""`urmpipe simulate` with FMUs that end its process or give values that are not finite: nothing passes."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import urmpipe as package
from foreign_fmus import HANGS, Foreign, Scalar, fmu, gain
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.simulations.simulation import Simulation

RunCommand = Callable[..., Any]

ENDS = Foreign(name="ends", scalars=(Scalar("y", 0, unit="m"),))
STOPS = replace(ENDS, name="stops", step="if (t > 0.25) { m->terminated = 1; return fmi2Discard; }")
GLITCH = Foreign(
    name="glitch",
    scalars=(
        *(Scalar(f"y[{i}]", i, unit="m") for i in (1, 2)),
        Scalar("z", 3, unit="m", extra=' displayUnit="mm"'),
    ),
    compute="v->r[1] = v->time > 0.15 && v->time < 0.35 ? NAN : 0.001; v->r[2] = v->r[1]; v->r[3] = 0.001;",
)
"""y is nan at 0.2 s and 0.3 s."""

CLIP = gain("clip", formula="fmin(u, 0.0)", unit="m")
"""Of nan it makes 0, as fmin of C does."""

ENDED_EARLY = "the run ended at t = 0.3 s instead of 1 s"
ACTUAL = '"m.actual[1]"'


def write(
    folder: Path, blocks: Mapping[str, Foreign], connections: Mapping[str, str], every: int = 1
) -> list[str]:
    """Write a system with a meter m of which what no connection feeds is 0; return its arguments."""
    lines = ["[system]", "duration = 1.0", "step = 0.1", f"record_every = {every}"]
    for name, one in blocks.items():
        shutil.copy(fmu(one), folder / f"{one.name}.fmu")
        lines += [f"[blocks.{name}]", f'fmu = "{one.name}.fmu"']
    actual = [f'"actual[{i}]" = 0.0' for i in (1, 2, 3) if f'"m.actual[{i}]"' not in connections]
    start = ", ".join(['"reference" = 0.0', *actual])
    lines += ["[blocks.m]", 'unit = "delta_meter"', f"start = {{ {start} }}", "[connections]"]
    lines += [f'{into} = "{source}"' for into, source in connections.items()]
    (folder / "system.toml").write_text("\n".join(lines), encoding="utf-8")
    return ["simulate", "system.toml"]


def errors(err: str) -> list[str]:
    """Return the lines of errors and warnings."""
    return [line for line in err.splitlines() if line.startswith(("error", "warning"))]


def recorded(folder: Path) -> Simulation:
    """Return what the command recorded."""
    result = package.read_recording(folder / "system.rrd")
    assert isinstance(result, Simulation)
    return result


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "code", "samples", "where"),
    [
        ("start", "exit(0);", 0, "fmi2Instantiate at t = 0 s"),
        ("step", "if (t > 0.25) exit(0);", 4, "fmi2DoStep at t = 0.3 s"),
        ("step", "if (t > 0.25) _exit(0);", 4, "fmi2DoStep at t = 0.3 s"),
        ("terminate", "exit(0);", 11, "fmi2Terminate at t = 1 s"),
        ("free", "exit(0);", 11, "fmi2FreeInstance at t = 1 s"),
    ],
)
def test_an_fmu_that_ends_the_process_fails_the_run(
    urmpipe: RunCommand, tmp_path: Path, place: str, code: str, samples: int, where: str
) -> None:
    given: dict[str, Any] = {place: code}
    ends = replace(ENDS, **given)
    ran = urmpipe(*write(tmp_path, {"bad": ends}, {ACTUAL: "bad.y"}), "--json")
    failed = f"block bad: {where}: ended the process with the exit code 0; it logged nothing"
    assert ran.code == 2
    assert errors(ran.err) == [f"error: {failed}; the samples until then are in system.rrd"]
    told = json.loads(ran.out)
    assert (told["failed"], told["samples"], told["verdict"]) == (failed, samples, "fail")
    if samples == 4:
        assert [one["caveats"] for one in told["verdicts"]] == [[ENDED_EARLY]]
    assert recorded(tmp_path).failed == failed


@pytest.mark.slow
def test_a_meter_of_a_run_that_ended_early_does_not_pass(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe(*write(tmp_path, {"bad": STOPS}, {ACTUAL: "bad.y"}), "--json")
    (verdict,) = json.loads(ran.out)["verdicts"]
    assert (verdict["verdict"], verdict["out_of_tolerance"]) == ("fail", 0)
    assert verdict["caveats"] == [ENDED_EARLY]
    assert ran.code == 1


@pytest.mark.slow
def test_a_call_that_does_not_return_fails_the_run(urmpipe: RunCommand, tmp_path: Path) -> None:
    hangs = replace(ENDS, name="hangs", step=f"if (t > 0.25) {HANGS}")
    ran = urmpipe(*write(tmp_path, {"bad": hangs}, {ACTUAL: "bad.y"}), "--timeout", "2s", "--json")
    failed = "block bad: fmi2DoStep at t = 0.3 s: did not return within 2 s; it logged nothing"
    assert ran.code == 2
    assert errors(ran.err) == [f"error: {failed}; the samples until then are in system.rrd"]
    assert json.loads(ran.out)["samples"] == 4
    assert recorded(tmp_path).failed == failed


@pytest.mark.slow
def test_the_time_that_is_printed_is_that_of_the_steps(urmpipe: RunCommand, tmp_path: Path) -> None:
    """Ten of them of 30 ms each, after a second in which the FMU is made."""
    slow = replace(ENDS, name="slow", start="usleep(1000000);", step="usleep(30000);")
    ran = urmpipe(*write(tmp_path, {"slow": slow}, {ACTUAL: "slow.y"}))
    (line,) = (line for line in ran.out.splitlines() if line.startswith("Simulated in "))
    wall, factor = (float(one.split()[0]) for one in line.removeprefix("Simulated in ").split(" s, "))
    assert 0.3 <= wall < 1.0
    assert factor == pytest.approx(1.0 / wall, rel=0.03)  # 1 s in a time of two digits


def test_the_time_that_a_call_may_take_is_above_0(urmpipe: RunCommand, tmp_path: Path) -> None:
    line = write(tmp_path, {"a": ENDS}, {ACTUAL: "a.y"})
    assert errors(urmpipe(*line, "--timeout", "0").err) == [
        "error: timeout (--timeout): found '0', allowed: a positive time in s, such as 0.005 or 5ms"
    ]
    with pytest.raises(OptionError, match=r"timeout \(--timeout\): found -1\.0, allowed: a positive time"):
        package.simulate(tmp_path / "system.toml", timeout=-1.0)


@pytest.mark.slow
def test_an_fmu_that_ends_the_run_with_its_last_step_is_judged_as_a_whole(
    urmpipe: RunCommand, tmp_path: Path
) -> None:
    step = "if (t > 0.85) { m->last = t + h; m->terminated = 1; return fmi2Discard; }"
    whole = replace(ENDS, name="whole", step=step)
    ran = urmpipe(*write(tmp_path, {"bad": whole}, {ACTUAL: "bad.y"}), "--json")
    (verdict,) = json.loads(ran.out)["verdicts"]
    assert (verdict["verdict"], verdict["samples"], verdict["caveats"]) == ("pass", 11, [])


TOLD = "a: y: found nan at t = 0.2 s; values that are not finite: 4"  # y[1] and y[2] at two points


@pytest.mark.slow
@pytest.mark.parametrize(
    ("connections", "every"),
    [
        ({'"c.u"': "a.y[1]", ACTUAL: "c.y"}, 1),
        ({'"c.u"': "a.y[1]", ACTUAL: "c.y"}, 5),  # it stands between two judged samples alone
        ({'"c.u"': "a.z", ACTUAL: "c.y"}, 1),  # what is not finite may be in the block behind z, too
    ],
)
def test_a_meter_that_depends_on_what_is_not_finite_does_not_pass(
    urmpipe: RunCommand, tmp_path: Path, connections: dict[str, str], every: int
) -> None:
    ran = urmpipe(*write(tmp_path, {"a": GLITCH, "c": CLIP}, connections, every))
    assert ran.code == 1
    assert f"warning: {TOLD}" in errors(ran.err)
    lines = ran.out.splitlines()
    samples = 10 // every + 1
    assert lines[0] == "FAIL  m of system within tolerance, but in doubt"
    assert lines[2].strip() == (
        "Decided by: |Δx| = 0.0 mm of 3.5 mm allowed (0 % of the tolerance) at t = 0.000 s; out of"
        f" tolerance: 0 of {samples} samples (0 %); a.y was nan at t = 0.2 s, and m depends on a"
    )
    assert recorded(tmp_path).verdict == "fail"


@pytest.mark.slow
def test_a_meter_that_is_given_what_is_not_finite_fails_the_run(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe(*write(tmp_path, {"a": GLITCH}, {ACTUAL: "a.y[2]"}, every=10))
    assert ran.code == 2
    assert errors(ran.err) == [
        "warning: block m: the verdict covers one communication point in 10 (system.record_every)",
        "warning: a: y: found nan at t = 0.2 s; values that are not finite: 2",
        "error: block m: fmi2SetReal at t = 0.2 s: returned fmi2Error; its last lines: fmi2Error: unit"
        " delta_meter: actual[1]: found nan, allowed: a finite number; the samples until then are in"
        " system.rrd",
    ]


@pytest.mark.slow
def test_a_meter_that_depends_on_other_blocks_alone_passes_and_strict_does_not(
    urmpipe: RunCommand, tmp_path: Path
) -> None:
    line = write(tmp_path, {"a": GLITCH, "b": ENDS}, {ACTUAL: "b.y"})
    ran = urmpipe(*line)
    assert (ran.code, errors(ran.err)) == (0, [f"warning: {TOLD}"])
    (tmp_path / "system.rrd").unlink()
    strict = urmpipe(*line, "--strict", "--draw", "system.svg")
    assert (strict.code, strict.out) == (2, "")
    assert errors(strict.err) == [
        "error: strict (--strict): found 1 warning, allowed: none",
        "error: a: column y: found nan at t = 0.2 s; values that are not finite: 4",
    ]
    assert not {"system.rrd", "system.svg"} & {one.name for one in tmp_path.iterdir()}
    with pytest.raises(LogError):
        package.simulate(tmp_path / "system.toml", strict=True)


def test_strict_keeps_what_a_failed_run_recorded(urmpipe: RunCommand, tmp_path: Path) -> None:
    ran = urmpipe(*write(tmp_path, {"a": GLITCH}, {ACTUAL: "a.y[1]"}), "--strict", "--json")
    assert ran.code == 2
    assert json.loads(ran.out)["samples"] == 2
    found = recorded(tmp_path)
    assert found.verdict == "fail"
    shown = {one.name: one.display_unit for one in found.signals if one.block == "a"}
    assert shown == {"a.y": "", "a.z": "mm"}


def test_the_meter_that_is_in_doubt_decides_before_one_that_passes(tmp_path: Path) -> None:
    blocks = {"a": GLITCH, "c": CLIP, "b": ENDS}
    write(tmp_path, blocks, {'"c.u"': "a.y[1]", ACTUAL: "c.y"})
    path = tmp_path / "system.toml"
    other = '[blocks.near]\nunit = "delta_meter"\nstart = { reference = 0.0, actual = 0.003 }\n'
    path.write_text(path.read_text().replace("[connections]", f"{other}[connections]"), encoding="utf-8")
    result = package.simulate(path)
    assert {one.block: one.verdict for one in result.verdicts} == {"m": "fail", "near": "pass"}
    assert result.judged_worst is not None
    assert (result.judged_worst.block, result.verdict) == ("m", "fail")


@pytest.mark.slow
def test_compare_passes_no_motion_to_which_leads_what_is_not_finite(
    urmpipe: RunCommand, tmp_path: Path
) -> None:
    point = tuple(Scalar(f"p[{i}]", i, unit="m") for i in (1, 2, 3))
    tip = Foreign("tip", (*point, Scalar("u", 4, "input", unit="m")), compute="v->r[1] = fmin(v->r[4], 0.0);")
    write(tmp_path, {"a": GLITCH, "tip": tip}, {ACTUAL: "tip.p[1]", '"tip.u"': "a.y[1]"})
    assert urmpipe("simulate", "system.toml").code == 1
    (tmp_path / "path.csv").write_text("t,x [m],y [m],z [m]\n0,0,0,0\n1,0,0,0\n", encoding="utf-8")
    ran = urmpipe("compare", "path.csv", "system.rrd", "--block", "tip")
    assert (ran.code, ran.out) == (2, "")
    assert errors(ran.err) == [
        "error: system.rrd: a.y: found nan at t = 0.2 s; values that are not finite: 4; allowed: none where"
        " block tip is judged"
    ]
