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


def pytest_configure(config: pytest.Config) -> None:
    """Keep what results warn of out of pytest's summary: the tests of warnings ask for them."""
    config.addinivalue_line("filterwarnings", "ignore::urmpipe.UrmpipeWarning")
