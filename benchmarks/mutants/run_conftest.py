"""The conftest.py of a run of mutants: no caches from test to test, quick tests first."""

from __future__ import annotations

import functools
import gc
import json
from pathlib import Path

import pytest
from hypothesis import Phase, settings

# What fails need not be made small: one failing case kills.
settings.register_profile(
    "mutants", settings.get_profile("ci"), phases=(Phase.explicit, Phase.generate), report_multiple_bugs=False
)
settings.load_profile("mutants")


@pytest.fixture(autouse=True)
def without_caches() -> None:
    """Let each test reach what it depends on, though a test before it has computed it."""
    for cache in _caches():
        cache.cache_clear()


@functools.cache
def _caches() -> list[functools._lru_cache_wrapper[object]]:
    """Return the caches of the package's functions."""
    found = [one for one in gc.get_objects() if isinstance(one, functools._lru_cache_wrapper)]
    return [one for one in found if (one.__module__ or "").startswith("urmpipe_models")]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run what took least when mutmut ran all tests on the original."""
    stats = Path("mutmut-stats.json")
    if stats.exists():
        seconds = json.loads(stats.read_text())["duration_by_test"]
        items.sort(key=lambda item: seconds.get(item.nodeid, 0.0))
