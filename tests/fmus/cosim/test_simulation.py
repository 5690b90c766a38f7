"""The process that runs the FMUs, and FMUs in Python; what a run reports is in simulation.cases."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import refusal, there
from foreign_fmus import planned
from urmpipe_fmus.cosim import Plan, simulate
from urmpipe_models.errors import CosimulationError


def test_the_process_that_runs_the_fmus_imports_little() -> None:
    code = "import sys, urmpipe_fmus.cosim.worker; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert not {"pandas", "scipy", "casadi", "rerun", "pyarrow", "pythonfmu", "click"} & loaded
    assert not {"urmpipe_fmus.block", "urmpipe_fmus.cosim.plan"} & loaded


SCRIPT = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y = {formula}
        if self.u > 10.0:
            raise ValueError("u is too large")
        return True
"""


def python_plan(folder: Path, a: str, b: str, connections: dict[str, str], **options: Any) -> Plan:
    """Return the plan of two FMUs as pythonfmu documents them: outputs are computed in do_step."""
    from pythonfmu.builder import FmuBuilder

    blocks = {}
    for name, formula in (("a", a), ("b", b)):
        script = folder / f"{name}.py"
        script.write_text(SCRIPT.format(name=name.upper(), formula=formula))
        blocks[name] = Path(FmuBuilder.build_FMU(script, dest=folder, canGetAndSetFMUstate=True))
    return planned(blocks, connections, {"a": {"u": 7.0}, "b": {"u": 0.0}}, duration=0.5, **options)


def test_loops_of_python_fmus_are_solved_by_repeated_steps(tmp_path: Path) -> None:
    """a = -3 b + 1, b = 4 a + 2: a = -5/13, from the first step on."""
    ring = {"a.u": "b.y", "b.u": "a.y"}
    record = simulate(python_plan(tmp_path, "-3.0 * self.u + 1.0", "4.0 * self.u + 2.0", ring, iterate=True))
    assert record.failed is None
    # the loop's 1e-9, magnified
    assert np.allclose(record.column("a", "y")[1:], -5.0 / 13.0, rtol=0.0, atol=1e-7)
    assert np.allclose(record.column("b", "y")[1:], 6.0 / 13.0, rtol=0.0, atol=1e-7)


def test_failures_of_python_fmus_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the words of its exception; a folder that pythonfmu cannot read, before it crashes there."""
    plan = python_plan(tmp_path, "self.u + 4.0", "self.u", {"b.u": "a.y"})
    record = simulate(plan)
    failed = there(record.failed)
    assert failed.startswith("block b: fmi2DoStep at t = 0.1 s: returned fmi2Fatal; its last lines: ")
    assert "u is too large" in failed
    assert len(record.t_ns) == 2
    (tmp_path / "größer").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "größer"))
    message = refusal(CosimulationError, simulate, plan)
    assert "A.fmu: a Python FMU cannot run in" in message
    assert "größer/urmpipe-" in message
