"""FMUs that were built before: found again, distinguished, repaired."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from loaded_fmu import Loaded
from urmpipe_fmus.block import Recipe, Table
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.blocks.user import load_block_file
from urmpipe_fmus.build.fmu import cache_key, cached_fmu
from written_units import unit_of


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("URMPIPE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_a_unit_is_built_once(folder: Path) -> None:
    path = cached_fmu(unit_of("arm"), "python")
    built = path.stat().st_mtime_ns
    assert (path.parent.parent, path.name) == (folder / "fmus", "arm.fmu")
    assert cached_fmu(unit_of("arm"), "python") == path
    assert path.stat().st_mtime_ns == built


@pytest.mark.slow
def test_other_tables_arguments_sources_variables_and_backends_are_other_fmus() -> None:
    model = unit_of("playback")
    assert model.table is not None
    other_table = replace(model, table=Table(model.table.t_ns, model.table.values + 1e-15))
    shifted = replace(model, table=Table(model.table.t_ns + np.int64(1), model.table.values))
    other_source = replace(model, recipe=replace(model.recipe, source=model.recipe.source + "\n# changed\n"))
    units = [model, other_table, shifted, other_source, unit_of("playback", gain=2.0)]
    keys = [cache_key(one, "python", "linux64") for one in units] + [cache_key(model, "native", "linux64")]
    assert len(set(keys)) == len(keys)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "damage"),
    [(".fmu", b""), (".fmu", b"PK"), (".fmu", None), (".sha256", None), (".sha256", b"\xff")],
)
def test_an_entry_is_built_again_that_is_damaged_or_has_no_hash(suffix: str, damage: bytes | None) -> None:
    path = cached_fmu(unit_of("arm"), "python")
    whole, built, damaged = path.read_bytes(), path.stat().st_mtime_ns, path.with_suffix(suffix)
    damaged.unlink() if damage is None else damaged.write_bytes(damage)
    assert cached_fmu(unit_of("arm"), "python") == path
    assert path.read_bytes() == whole
    assert path.stat().st_mtime_ns > built
    assert sorted(one.name for one in path.parent.iterdir()) == ["arm.fmu", "arm.sha256"]


@pytest.mark.slow
def test_a_unit_without_a_recipe_or_with_a_foreign_one_is_built_each_time(folder: Path) -> None:
    unknown = replace(unit_of("spring"), recipe=Recipe())
    foreign = replace(unknown, recipe=Recipe("somebody.elses", "spring"))
    other = replace(foreign, derivatives=lambda v: {"x": v.v, "v": -v.x})
    paths = [cached_fmu(model, "native") for model in (foreign, other, unknown)]
    assert paths[0] == paths[2] != paths[1]  # their places are named by what was built
    assert len(list((folder / "fmus").iterdir())) == 2


READING = """from pathlib import Path
from urmpipe_fmus.block import BlockModel, Input, Output
gain = float(Path(__file__).with_name("gain.txt").read_text())
unit = BlockModel(name="reading", description="", outputs=lambda v: {"y": gain * v.u},
    variables=(Input(name="u", description="", start=1.0), Output(name="y", description="")))
"""


@pytest.mark.slow
def test_a_file_that_reads_another_is_built_again_when_that_one_changed(tmp_path: Path) -> None:
    (tmp_path / "reading.py").write_text(READING, encoding="utf-8")
    starts = []
    for gain in ("2.0", "3.0", "2.0"):
        (tmp_path / "gain.txt").write_text(gain, encoding="ascii")
        path = cached_fmu(load_block_file(tmp_path / "reading.py"), "native")
        fmu = Loaded(path)
        starts.append((path, fmu.get(["y"])))
        fmu.free()
    assert [value for _, value in starts] == [[2.0], [3.0], [2.0]]
    assert starts[0] == starts[2]


def test_a_changed_compiler_makes_another_fmu(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    compiler = tmp_path / "compiler"
    keys = []
    for text in ("one", "another"):
        compiler.write_text(text, encoding="ascii")
        compiler.chmod(0o755)
        monkeypatch.setenv("CC", f"env {compiler}")
        keys.append(cache_key(make_block("inertia"), "native", "linux64"))
    assert keys[0] != keys[1]


@pytest.mark.slow
def test_a_hit_imports_nothing_that_traces_and_runs_no_function() -> None:
    built = cached_fmu(make_block("inertia"))
    code = (
        "from urmpipe_fmus.build.fmu import cached_fmu\n"
        "from urmpipe_fmus.blocks import make_block\n"
        "import sys; print(cached_fmu(make_block('inertia')))\n"
        "print(*sorted({'casadi', 'fmpy', 'pythonfmu', 'jinja2', 'lxml', 'scipy'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [str(built), ""]
