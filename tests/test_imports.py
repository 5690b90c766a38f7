"""Imports run one way: cli -> pipeline, fmus -> models -> datasets; libraries keep their place."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from survey.imports import top_level, wrong_ways
from survey.source import PACKAGES, Source, read_sources

ROOT = Path(__file__).resolve().parents[1]
SOURCES = read_sources(ROOT, PACKAGES)
ONLY = {  # who alone may import a distribution
    "rerun": "pipeline/urmpipe_pipeline/recording/",
    "click": "cli/",
    "plotly": "pipeline/urmpipe_pipeline/report/",
    "rich": "cli/",
}
MODELS_MAY_IMPORT = {"numpy", "scipy"}


def test_imports_run_one_way() -> None:
    assert {source.area for source in SOURCES} == set(PACKAGES)
    assert wrong_ways(SOURCES) == []


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.path)
def test_libraries_keep_their_place(source: Source) -> None:
    names = top_level([source])
    for name, home in ONLY.items():
        assert name not in names or source.path.startswith(home), f"{name} belongs to {home}"
    if source.area == "models":
        known = set(sys.stdlib_module_names) | {"urmpipe_models", "urmpipe_datasets"} | MODELS_MAY_IMPORT
        assert names <= known


def loaded_by(code: str) -> set[str]:
    """The modules that a fresh Python has loaded after some code."""
    said = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}\nprint(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(said.stdout.split())


def test_help_loads_nothing_heavy() -> None:
    code = "from urmpipe.main import cli\ntry: cli.main(['--help'])\nexcept SystemExit: pass"
    heavy = {"numpy", "pandas", "scipy", "rerun", "pyarrow", "plotly", "rich", "jinja2"}
    assert not loaded_by(code) & heavy


def test_importing_the_package_loads_nothing_heavy_and_knows_its_names() -> None:
    assert not loaded_by("import urmpipe") & {"numpy", "pandas", "rerun", "click"}
    import urmpipe

    for name in urmpipe.__all__:
        assert getattr(urmpipe, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = urmpipe.nonsense
