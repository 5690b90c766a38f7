"""What starts urmpipe loads nothing heavy."""

from __future__ import annotations

import subprocess
import sys

import pytest


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
