"""What the tests of FMUs share: a Windows to run their binaries on."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def wine(session_folder: Path) -> dict[str, str]:
    """The environment of a wine of the session's own: nothing of the user's is in it, and no window opens."""
    if sys.platform != "linux" or not shutil.which("wine"):
        pytest.skip("needs wine (Debian: wine, wine64)")
    kept = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "SHELL")}
    return kept | {"WINEPREFIX": str(session_folder / "wine"), "WINEDEBUG": "-all"}
