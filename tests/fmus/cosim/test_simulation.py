"""Failures, warnings, early ends and values that are not finite are reported; the recorded values stay."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import refusal, there
from foreign_fmus import STAIR, TROUBLE, Foreign, Scalar, copy_changed, fmu, gain, ran, system
from urmpipe_fmus.cosim import Block, Connection, CosimulationRecord, Port, System, prepare, simulate
from urmpipe_models.errors import CosimulationError

WELL = "fmi2OK: trouble: all is well at 0.05 s"
LINES = f"its last lines: {WELL}"
FAILURES = {
    1: f"ended the process: Segmentation fault (SIGSEGV); {LINES} | fmi2Warning: about to break",
    2: f"ended the process: Aborted (SIGABRT); {LINES}",
    3: f"ended the process with the exit code 7; {LINES}",
    4: f"returned fmi2Error; {LINES} | fmi2Error: the motor is hot",
    5: f"returned fmi2Discard, it cannot step by 0.01 s from there: a smaller system.step may help; {LINES}",
    8: f"returned fmi2Fatal; {LINES}",
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", sorted(FAILURES))
def test_a_failing_block_is_reported_and_the_recorded_values_stay(kind: int) -> None:
    record = ran({"good": gain(), "bad": TROUBLE}, {"good.u": "bad.y"}, {"bad": {"kind": kind}}, step=0.01)
    assert record.failed == f"block bad: fmi2DoStep at t = 0.05 s: {FAILURES[kind]}"
    assert record.t_ns.tolist() == [k * 10**7 for k in range(6)]
    assert np.array_equal(record.column("good", "y"), 0.01 * np.arange(6))


Y = (Scalar("y", 0),)
LAST_WORDS = {
    "prints": (
        {"step": 'write(2, "assertion failed: x > 0\\n", 24); abort();'},
        "fmi2DoStep at t = 0 s: ended the process: Aborted (SIGABRT); its last lines: assertion failed:"
        " x > 0",
        1,
    ),
    "gives no instance": (
        {"start": "free(m); return NULL;"},
        "fmi2Instantiate at t = 0 s: gave no instance; it logged nothing",
        0,
    ),
    "logs": (
        {"step": 'if (t > 0.15) { LOG(m, fmi2Error, "u = %g is too much", t); return fmi2Error; }'},
        "fmi2DoStep at t = 0.2 s: returned fmi2Error; its last lines: fmi2Error: u = 0.2 is too much",
        3,
    ),
    "logs and crashes when freed": (
        {
            "step": 'if (t > 0.25) { LOG(m, fmi2Error, "enough"); return fmi2Error; }',
            "free": "raise(SIGSEGV);",
        },
        "fmi2DoStep at t = 0.3 s: returned fmi2Error; its last lines: fmi2Error: enough",
        4,
    ),
}


@pytest.mark.parametrize("how", LAST_WORDS)
def test_a_failure_has_the_last_words_of_its_block(how: str) -> None:
    code, failed, rows = LAST_WORDS[how]
    record = ran({"a": Foreign(name="words", scalars=Y, **code)})  # type: ignore[arg-type]
    assert (record.failed, record.values.shape) == (f"block a: {failed}", (rows, 1))


@pytest.mark.slow
def test_only_the_last_lines_are_kept_of_a_long_log() -> None:
    talker = Foreign(
        name="talker",
        scalars=Y,
        step="""
        for (int i = 0; i < 200; i++) LOG(m, fmi2OK, "%0200d", i);
        if (t > 4.95) { LOG(m, fmi2Error, "last one\\nin two lines"); return fmi2Error; }
        """,
    )
    words = [f"fmi2OK: {i:0200d}" for i in range(196, 200)] + ["fmi2Error: last one in two lines"]
    assert ran({"talker": talker}, duration=10.0).failed == (
        f"block talker: fmi2DoStep at t = 5 s: returned fmi2Error; its last lines: {' | '.join(words)}"
    )


def test_warnings_are_counted() -> None:
    record = ran({"bad": TROUBLE}, None, {"bad": {"kind": 7}}, step=0.01)
    assert record.failed is None
    assert record.notes == (
        "block bad: fmi2DoStep returned fmi2Warning 95 times, first at t = 0.05 s, the last: warm",
    )
    assert len(record.t_ns) == 101
    warns = Foreign(
        name="warns", scalars=Y, step="if (t > 0.25) abort(); if (t > 0.15) { return fmi2Warning; }"
    )
    record = ran({"bad": warns})
    assert record.failed is not None
    assert record.notes == ("block bad: fmi2DoStep returned fmi2Warning once, at t = 0.2 s",)


def test_a_library_that_is_none_is_reported(tmp_path: Path) -> None:
    broken = copy_changed(fmu(gain()), tmp_path / "broken.fmu", "binaries", lambda _: b"no library")
    record = simulate(prepare(system({"a": gain()}, None, {"a": {"u": 0.0}}), lambda block: broken))
    assert there(record.failed).startswith(
        "block a: loading at t = 0 s: cannot be loaded: Failed to load shared library"
    )


def test_a_crash_after_the_end_is_a_failure_but_a_state_that_cannot_be_freed_is_not() -> None:
    rude = Foreign(name="rude", scalars=Y, free="raise(SIGSEGV);")
    record = ran({"a": rude}, duration=0.2)
    assert len(record.t_ns) == 3
    assert record.failed == (
        "block a: fmi2FreeInstance at t = 0.2 s: ended the process: Segmentation fault (SIGSEGV); it logged"
        " nothing"
    )
    stingy = Foreign(
        name="stingy",
        scalars=(Scalar("u", 0, "input"), Scalar("y", 1, on=("u",))),
        compute="v->r[1] = cos(v->r[0]);",
        step="v->i[15] = 1;",
        fresh=False,
    )
    record = ran({"a": stingy}, {"a.u": "a.y"}, iterate=True)
    assert (record.failed, len(record.t_ns)) == (None, 11)


def test_the_process_that_runs_the_fmus_imports_little() -> None:
    code = "import sys, urmpipe_fmus.cosim.worker; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"pandas", "scipy", "casadi", "rerun", "pyarrow", "pythonfmu", "click"} & set(loaded)
    assert not {"urmpipe_fmus.block", "urmpipe_fmus.cosim.plan"} & set(loaded)


STRICT = replace(
    STAIR,
    name="strict",
    scalars=(*STAIR.scalars, Scalar("u", 2, "input")),
    set="if (m->terminated) return fmi2Error;",
)
"""Ends at `at`, and lets nothing be set from then on, as FMI has it."""


def ended(at: float, **options: Any) -> CosimulationRecord:
    """Run a block that ends the run at a time in [s], and a gain that follows it."""
    blocks = {"end": STRICT, "gain": gain(), "before": gain()}
    connections = {"gain.u": "end.y", "end.u": "before.y"}
    return ran(blocks, connections, {"end": {"at": at}, "before": {"u": 0.0}}, step=0.2, **options)


def test_a_block_that_ends_the_run_at_a_communication_point_is_read_there_with_all_others() -> None:
    record = ended(0.8)
    assert record.failed is None
    assert record.t_ns.tolist() == [0, 200_000_000, 400_000_000, 600_000_000, 800_000_000]
    assert record.column("end", "y")[-1] == 0.8
    assert np.array_equal(record.column("gain", "y"), record.column("end", "y"))
    assert record.notes == ("block end ended the simulation at t = 0.8 s",)


def test_a_block_that_ends_the_run_between_two_is_read_there_alone() -> None:
    record = ended(0.9)
    assert record.failed is None
    assert record.t_ns[-2:].tolist() == [800_000_000, 900_000_000]
    assert np.array_equal(record.column("end", "y")[-2:], [0.8, 0.9])
    assert np.array_equal(record.column("gain", "y")[-2:], [0.8, 0.8])
    assert record.notes == (
        "block end ended the simulation at t = 0.9 s",
        "at t = 0.9 s the other blocks have their values of t = 0.8 s",
    )


@pytest.mark.slow
def test_the_end_is_recorded_where_only_some_points_are() -> None:
    assert ended(0.9, record_every=3).t_ns.tolist() == [0, 600_000_000, 900_000_000]
    assert ended(1.0, record_every=3).t_ns.tolist() == [0, 600_000_000, 1_000_000_000]


def test_several_blocks_may_end_the_run_in_one_step() -> None:
    record = ran({"a": STAIR, "b": STAIR}, None, {name: {"at": 0.8} for name in "ab"}, step=0.2)
    assert record.t_ns[-1] == 800_000_000
    assert [record.column(name, "y")[-1] for name in "ab"] == [0.8, 0.8]
    assert record.notes == tuple(f"block {name} ended the simulation at t = 0.8 s" for name in "ab")
    record = ran({"bad": TROUBLE}, None, {"bad": {"kind": 6}}, step=0.01)  # states no time
    assert (record.failed, len(record.t_ns)) == (None, 6)
    assert record.notes == ("block bad ended the simulation at t = 0.05 s",)


GLITCH = Foreign(
    name="glitch",
    scalars=(Scalar("y", 0), Scalar("high", 1), Scalar("well", 2)),
    compute="""
    v->r[0] = v->time > 0.15 && v->time < 0.35 ? NAN : v->time;
    v->r[1] = v->time > 0.65 ? -INFINITY : 0;
    v->r[2] = 1;
    """,
)
"""y is nan at 0.2 s and 0.3 s, high is infinite from 0.7 s on."""

CLIP = gain("clip", formula="fmin(u, 0.0)")
"""Of nan it makes 0, as fmin of C does."""


def test_the_first_value_that_is_not_finite_its_time_and_their_number() -> None:
    found = ran({"a": GLITCH, "b": CLIP}, {"b.u": "a.y"}, record_every=5)
    assert np.isfinite(found.column("a", "y")).all()  # those that are not are between recorded points
    assert list(found.not_finite) == [Port("a", "y"), Port("a", "high")]
    y, high = found.not_finite.values()
    assert (math.isnan(y.value), y.t, y.count) == (True, 0.2, 2)
    assert (high.value, high.t, high.count) == (-math.inf, 7 * 0.1, 4)
    assert ran({"a": gain()}, None, {"a": {"u": 1.0}}).not_finite == {}


def test_a_value_that_is_not_finite_in_the_initialization_alone_is_noted() -> None:
    unset = Foreign(name="unset", scalars=Y, compute="v->r[0] = 1;", start="m->v.r[0] = NAN;", fresh=False)
    record = ran({"a": unset, "b": CLIP}, {"b.u": "a.y"})
    assert np.isfinite(record.column("a", "y")).all()
    noted = record.not_finite[Port("a", "y")]
    assert (noted.t, noted.count) == (0.0, 1)


def test_a_value_that_is_not_finite_is_noted_where_the_run_fails_later() -> None:
    picky = Foreign(
        name="picky",
        scalars=(Scalar("u", 0, "input"), Scalar("y", 1)),
        step='if (isnan(v->r[0])) { write(2, "nan\\n", 4); exit(0); }',
    )
    record = ran({"a": GLITCH, "b": picky}, {"b.u": "a.y"})
    assert record.failed == (
        "block b: fmi2DoStep at t = 0.2 s: ended the process with the exit code 0; its last lines: nan"
    )
    assert [(port, noted.t, noted.count) for port, noted in record.not_finite.items()] == [
        (Port("a", "y"), 0.2, 1)
    ]


SCRIPT = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 0.0
        self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = {formula}
        if self.u > 10.0:
            raise ValueError("u is too large")
        return True
"""


def python_plan(folder: Path, first: str, second: str, connections: dict[str, str], **options: Any) -> Any:
    """Return the plan of two FMUs as pythonfmu documents them: outputs are computed in do_step."""
    from pythonfmu.builder import FmuBuilder

    blocks = []
    for name, formula in (("a", first), ("b", second)):
        script = folder / f"{name}.py"
        script.write_text(SCRIPT.format(name=name.upper(), formula=formula))
        path = Path(FmuBuilder.build_FMU(script, dest=folder, canGetAndSetFMUstate=True))
        blocks.append(Block(name=name, fmu=path, start={"u": 7.0 * (name == "a")}))
    python_system = System(
        name="python",
        path=Path("python.toml"),
        step=0.1,
        duration=0.5,
        blocks=tuple(blocks),
        connections=tuple(
            Connection(Port(*to.split(".")), Port(*source.split("."))) for to, source in connections.items()
        ),
        **options,
    )
    return prepare(python_system, lambda block: there(block.fmu))


def test_loops_of_python_fmus_are_solved_by_repeated_steps(tmp_path: Path) -> None:
    """a = -3 b + 1, b = 4 a + 2: a = -5/13, from the first step on."""
    ring = {"a.u": "b.y", "b.u": "a.y"}
    plan = python_plan(tmp_path, "-3.0 * self.u + 1.0", "4.0 * self.u + 2.0", ring, iterate=True)
    record = simulate(plan)
    assert record.failed is None
    # the loop's 1e-9, magnified
    assert np.allclose(record.column("a", "y")[1:], -5.0 / 13.0, rtol=0.0, atol=1e-7)
    assert np.allclose(record.column("b", "y")[1:], 6.0 / 13.0, rtol=0.0, atol=1e-7)


def test_an_exception_of_a_python_fmu_is_reported_with_its_words(tmp_path: Path) -> None:
    record = simulate(python_plan(tmp_path, "self.u + 4.0", "self.u", {"b.u": "a.y"}))
    failed = there(record.failed)
    assert failed.startswith("block b: fmi2DoStep at t = 0.1 s: returned fmi2Fatal; its last lines: ")
    assert "u is too large" in failed
    assert len(record.t_ns) == 2


def test_a_folder_that_pythonfmu_cannot_read_is_reported_before_it_crashes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = python_plan(tmp_path, "self.u", "self.u", {"b.u": "a.y"})
    (tmp_path / "größer").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "größer"))
    message = refusal(CosimulationError, simulate, plan)
    assert "A.fmu: a Python FMU cannot run in" in message
    assert "größer/urmpipe-" in message
