"""Imports run one way: cli -> pipeline, fmus -> models -> datasets; libraries keep their place."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
AREAS = {"models", "fmus", "pipeline", "cli", "datasets"}
ALLOWED: dict[str, set[str]] = {
    "datasets": set(),
    "models": {"datasets"},
    "fmus": {"models", "datasets"},
    "pipeline": {"models", "datasets"},
    "cli": {"models", "fmus", "pipeline", "datasets"},
}
ONLY = {  # who alone may import a distribution
    "rerun": "pipeline/urmpipe_pipeline/recording/",
    "click": "cli/",
    "plotly": "pipeline/urmpipe_pipeline/report/",
    "rich": "cli/",
}
MODELS_MAY_IMPORT = {"numpy", "scipy"}


def modules() -> list[Path]:
    return sorted(path for area in AREAS for path in (ROOT / area).rglob("*.py"))


def imported(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("path", modules(), ids=lambda path: path.relative_to(ROOT).as_posix())
def test_imports_run_one_way(path: Path) -> None:
    place = path.relative_to(ROOT).as_posix()
    area = place.split("/")[0]
    names = imported(path)
    areas = {other for other in AREAS if f"urmpipe_{other}" in names} | (
        {"cli"} if "urmpipe" in names else set()
    )
    assert areas - {area} <= ALLOWED[area]
    for name, home in ONLY.items():
        assert name not in names or place.startswith(home), f"{name} belongs to {home}"
    if area == "models":
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
