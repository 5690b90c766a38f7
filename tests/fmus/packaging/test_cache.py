"""FMUs that were built before: found again, told apart, mended."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from urmpipe_fmus.cache import cache_folder, cached_fmu
from urmpipe_fmus.table import Table
from urmpipe_fmus.unit import Recipe, Unit
from urmpipe_models.errors import FmuError

Make = Callable[..., Unit]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("URMPIPE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def marked(path: Path) -> int:
    """When the file was written: the same if it was not built again."""
    return path.stat().st_mtime_ns


def test_a_unit_is_built_once(make: Make, folder: Path) -> None:
    path = cached_fmu(make("arm"), "python")
    built = marked(path)
    assert path.parent.parent == folder / "fmus"
    assert path.name == "arm.fmu"
    assert cached_fmu(make("arm"), "python") == path
    assert marked(path) == built


def test_other_tables_arguments_sources_variables_and_backends_are_other_fmus(make: Make) -> None:
    unit = make("playback")
    assert unit.table is not None
    other_table = replace(unit, table=Table(unit.table.t_ns, unit.table.values + 1e-15))
    shifted = replace(unit, table=Table(unit.table.t_ns + np.int64(1), unit.table.values))
    other_source = replace(unit, recipe=replace(unit.recipe, source=unit.recipe.source + "\n# changed\n"))
    units = [unit, other_table, shifted, other_source, make("playback", gain=2.0)]
    paths = [cached_fmu(one, "python") for one in units] + [cached_fmu(unit, "native")]
    assert len(set(paths)) == len(paths)


@pytest.mark.parametrize("damage", [b"", b"PK", None])
def test_a_damaged_entry_is_built_again(make: Make, damage: bytes | None) -> None:
    path = cached_fmu(make("arm"), "python")
    whole = path.read_bytes()
    path.write_bytes(whole[:-100] if damage is None else damage)
    assert cached_fmu(make("arm"), "python") == path
    assert path.read_bytes() == whole


def test_an_entry_without_its_hash_is_built_again(make: Make) -> None:
    path = cached_fmu(make("arm"), "python")
    path.with_suffix(".sha256").unlink()
    before = marked(path)
    assert cached_fmu(make("arm"), "python") == path
    assert marked(path) > before
    assert sorted(one.name for one in path.parent.iterdir()) == ["arm.fmu", "arm.sha256"]


def test_a_unit_without_a_recipe_is_never_taken_for_another(make: Make, folder: Path) -> None:
    spring = make("spring")
    one = replace(spring, recipe=Recipe())
    other = replace(one, derivatives=lambda v: {"x": v.v, "v": -v.x})
    paths = [cached_fmu(unit, "native") for unit in (one, other, one)]
    assert paths[0] == paths[2] != paths[1]
    assert len(list((folder / "fmus").iterdir())) == 2


def test_a_hit_imports_nothing_that_traces_and_runs_no_function(make: Make) -> None:
    cached_fmu(make("spring"))
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from conftest import unit_of\n"
        "from urmpipe_fmus.cache import cached_fmu\n"
        "print(cached_fmu(unit_of('spring')))\n"
        "print(*sorted({'casadi', 'fmpy', 'pythonfmu', 'jinja2', 'lxml', 'scipy'} & set(sys.modules)))\n"
    )
    said = subprocess.run(
        [sys.executable, "-c", code, str(Path(__file__).parent)], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert said == [str(cached_fmu(make("spring"))), ""]


def test_the_folder_is_the_users_and_can_be_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert cache_folder() == tmp_path / "cache"
    monkeypatch.delenv("URMPIPE_CACHE")
    monkeypatch.setenv("LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME", str(tmp_path / "x"))
    assert cache_folder() == tmp_path / "x" / "urmpipe"
    monkeypatch.delenv("LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME")
    assert cache_folder() == Path.home() / ".cache" / "urmpipe"


def test_a_cache_that_cannot_be_written_is_an_error_that_names_the_variable(
    make: Make, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("URMPIPE_CACHE", str(tmp_path / "file"))
    with pytest.raises(FmuError) as caught:
        cached_fmu(make("arm"), "python")
    assert str(caught.value) == (
        f"{tmp_path / 'file' / 'fmus'}: cannot be written: Not a directory; the variable URMPIPE_CACHE names"
        " another place"
    )
