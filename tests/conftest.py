"""What all tests share: a cache of FMUs of the session's own, beside the user's."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def fmu_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Let this process and those it starts keep built FMUs in a folder that goes with the session."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("URMPIPE_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield
