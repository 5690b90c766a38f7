"""The host in C, compiled for this platform."""

from __future__ import annotations

import shutil

import pytest

from c_host import host


@pytest.fixture(scope="session")
def c_host(tmp_path_factory: pytest.TempPathFactory) -> str:
    if shutil.which("cc") is None:
        pytest.skip("needs a C compiler: cc")
    return host(tmp_path_factory.mktemp("host"), ["cc", "-O1"])
