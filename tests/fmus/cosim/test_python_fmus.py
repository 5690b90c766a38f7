"""FMUs of pythonfmu, made as its documentation has it: outputs computed in do_step."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest

from asserting import there
from urmpipe_fmus.cosim import Block, Connection, Port, System, prepare, simulate
from urmpipe_models.errors import CosimulationError

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


def python_fmu(folder: Path, name: str, formula: str) -> Path:
    from pythonfmu.builder import FmuBuilder

    script = folder / f"{name.lower()}.py"
    script.write_text(SCRIPT.format(name=name, formula=formula))
    return Path(FmuBuilder.build_FMU(script, dest=folder, canGetAndSetFMUstate=True))


def system(fmus: dict[str, Path], connections: dict[str, str], **options: object) -> System:
    return System(
        name="python",
        path=Path("python.toml"),
        step=0.1,
        duration=0.5,
        blocks=tuple(Block(name=name, fmu=path, start={"u": 0.0}) for name, path in fmus.items()),
        connections=tuple(
            Connection(Port(*to.split(".")), Port(*source.split("."))) for to, source in connections.items()
        ),
        **options,  # type: ignore[arg-type]
    )


def fmu_of(block: Block) -> Path:
    return there(block.fmu)


def test_their_loops_are_solved_by_going_back(tmp_path: Path) -> None:
    """a = -3 b + 1, b = 4 a + 2: a = -5/13, from the first step on."""
    fmus = {
        "a": python_fmu(tmp_path, "First", "-3.0 * self.u + 1.0"),
        "b": python_fmu(tmp_path, "Second", "4.0 * self.u + 2.0"),
    }
    ring = system(fmus, {"a.u": "b.y", "b.u": "a.y"}, iterate=True)
    recorded = simulate(prepare(ring, fmu_of))
    assert recorded.failed is None
    assert np.allclose(
        recorded.column("a", "y")[1:], -5.0 / 13.0, rtol=0.0, atol=1e-7
    )  # the loop's 1e-9, magnified
    assert np.allclose(recorded.column("b", "y")[1:], 6.0 / 13.0, rtol=0.0, atol=1e-7)


def test_an_exception_is_told_with_its_words(tmp_path: Path) -> None:
    fmus = {"a": python_fmu(tmp_path, "Rising", "self.u + 4.0"), "b": python_fmu(tmp_path, "Same", "self.u")}
    ring = system(fmus, {"a.u": "b.y", "b.u": "a.y"}, iterate=False)
    with pytest.raises(Exception, match=r"algebraic loop: a\.y -> b\.u -> b\.y -> a\.u: "):
        prepare(ring, fmu_of)
    line = system({"a": fmus["a"], "b": fmus["b"]}, {"b.u": "a.y"})
    started = System(
        **{**vars(line), "blocks": (Block(name="a", fmu=fmus["a"], start={"u": 7.0}), line.blocks[1])}
    )
    recorded = simulate(prepare(started, fmu_of))
    assert recorded.failed is not None
    assert recorded.failed.startswith(
        "block b: fmi2DoStep at t = 0.1 s: returned fmi2Fatal; its last lines: "
    )
    assert "u is too large" in recorded.failed
    assert len(recorded.t_ns) == 2


def test_a_folder_that_pythonfmu_cannot_read_is_told_before_it_crashes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fmus = {"a": python_fmu(tmp_path, "First", "self.u"), "b": python_fmu(tmp_path, "Second", "self.u")}
    (tmp_path / "größer").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "größer"))
    with pytest.raises(CosimulationError, match=r"First\.fmu: a Python FMU cannot run in .*größer/urmpipe-"):
        simulate(prepare(system(fmus, {"b.u": "a.y"}), fmu_of))
