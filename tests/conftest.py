"""What all tests share: a cache of FMUs and a wine of the session, and the files beside the repository."""

from __future__ import annotations

import gc
import os
import shutil
import sys
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("any-load", settings.default, deadline=None)  # a busy machine is no fault
settings.load_profile("any-load")

# Before numpy starts: the threads of BLAS wait for each other where two processes share two cores, which
# took three times the time of the processor. The commands that tests start inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

SHARED = Path(__file__).resolve().parents[1].parent / "shared"


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Let the garbage collector pass over thousands of tests: looking at them took a tenth of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def session_folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that goes with the session, the same for all processes of pytest-xdist."""
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if hasattr(request.config, "workerinput") else own) / "session"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session", autouse=True)
def fmu_cache(session_folder: Path) -> Iterator[None]:
    """Let the processes of this session and those they start keep built FMUs in one folder."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("URMPIPE_CACHE", str(session_folder / "cache"))
        yield


@pytest.fixture(scope="session")
def wine(session_folder: Path) -> dict[str, str]:
    """The environment of a wine of the session's own: nothing of the user's is in it, and no window opens."""
    if sys.platform != "linux" or not shutil.which("wine"):
        pytest.skip("needs wine (Debian: wine, wine64)")
    kept = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "SHELL")}
    return kept | {"WINEPREFIX": str(session_folder / "wine"), "WINEDEBUG": "-all"}


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of robots and logs of others, which lies beside the repository where there is one."""
    if not SHARED.is_dir():
        pytest.skip("the folder shared with robots and logs of others is not beside this repository")
    return SHARED


def pytest_configure(config: pytest.Config) -> None:
    """Keep what results warn of out of pytest's summary: the tests of warnings ask for them."""
    config.addinivalue_line("filterwarnings", "ignore::urmpipe.UrmpipeWarning")
