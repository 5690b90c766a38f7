"""What all tests share: files of cases, a cache of FMUs, a wine, and the files beside the repository."""

from __future__ import annotations

import difflib
import gc
import os
import shutil
import sys
import tempfile
import traceback
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

settings.register_profile("any-load", settings.default, deadline=None)  # a busy machine is no fault
settings.load_profile("any-load")

# Before numpy starts: the threads of BLAS wait for each other where two processes share two cores, which
# took three times the time of the processor. The commands that tests start inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from cases import Case, CaseFile, answers  # noqa: E402 - it imports numpy

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
    """Keep built FMUs in a cache of the session; leave warnings of results out of pytest's summary."""
    if not hasattr(config, "workerinput"):  # processes of pytest-xdist and those that tests start inherit it
        cache = tempfile.TemporaryDirectory(prefix="urmpipe-cache-")
        config.add_cleanup(cache.cleanup)
        os.environ["URMPIPE_CACHE"] = cache.name
    config.addinivalue_line("filterwarnings", "ignore::urmpipe.UrmpipeWarning")
    if config.getoption("--accept") and getattr(config.option, "numprocesses", None):
        raise pytest.UsageError("--accept: found -n, allowed: one process, which writes the files of cases")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--accept", action="store_true", help="write into the .cases files what their calls answer now"
    )


def pytest_collect_file(parent: pytest.Collector, file_path: Path) -> pytest.Collector | None:
    return Cases.from_parent(parent, path=file_path) if file_path.suffix == ".cases" else None


class Cases(pytest.File):
    """A file of cases, of which each is a test."""

    def collect(self) -> Iterator[pytest.Item]:
        self.file = CaseFile(self.path)
        for case in self.file.cases:
            item = CaseItem.from_parent(self, name=case.title, case=case)
            if case.title.endswith("(slow)"):
                item.add_marker(pytest.mark.slow)
            yield item


class CaseItem(pytest.Item):
    """A case: compares the answers of its calls with the file; --accept writes them into the file."""

    def __init__(self, *, case: Case, **rest: Any) -> None:
        super().__init__(**rest)
        self.case = case

    def runtest(self) -> None:
        assert isinstance(self.parent, Cases)
        with tempfile.TemporaryDirectory() as folder:
            now = answers(self.parent.file, self.case, Path(folder))
        if self.config.getoption("--accept"):
            self.case.calls = [(call, answer) for (call, _), answer in zip(self.case.calls, now, strict=True)]
            self.path.write_text(self.parent.file.text(), encoding="utf-8")
            return
        for (call, before), answer in zip(self.case.calls, now, strict=True):
            if answer != before:
                lines = difflib.unified_diff(before, answer, "in the file", "now", n=99, lineterm="")
                raise AssertionError("\n".join((f"$ {call}", *lines)))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> str:
        if isinstance(excinfo.value, AssertionError):
            return str(excinfo.value)
        return "".join(traceback.format_exception(excinfo.value)[-6:])  # without pytest's own frames

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, self.name
