"""Files of the rows of a path, written and read; plans."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from made_plans import CONTOUR, SMALL, limited, planned
from urmpipe_models.errors import UrmpipeError
from urmpipe_models.planning.path import PathRows
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.logs import LogMap
from urmpipe_pipeline.planned_paths.path_file import GivenPath, read_path
from urmpipe_pipeline.planned_paths.result import PlannedPath

Read = Callable[..., GivenPath]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Write a file and read its rows."""

    def read(text: str, **options: Any) -> GivenPath:
        path = tmp_path / "path.csv"
        path.write_text(text, encoding="utf-8")
        return read_path(path, LogMap(**options))

    return read


@pytest.fixture
def wrong(read: Read, tmp_path: Path) -> Callable[..., list[str]]:
    """Write a file that is refused, and return what is said of it, without its folder."""

    def wrong(text: str, **options: Any) -> list[str]:
        with pytest.raises(UrmpipeError) as caught:
            read(text, **options)
        return [str(finding).replace(f"{tmp_path}/", "") for finding in caught.value.findings]

    return wrong


@pytest.fixture(scope="session")
def contour() -> PlannedPath:
    """The paper's contour by its arm."""
    return planned(load_robot("irb60"), CONTOUR)


@pytest.fixture(scope="session")
def slowed() -> PlannedPath:
    """A contour that a joint's rate slows down, with a jerk; some joints have limits, the tool is turned."""
    arm = limited(
        "ur5e", velocity=[0.5, 3.0, *[np.inf] * 4], acceleration=[*[np.inf] * 3, 50.0, np.inf, np.inf]
    )
    return planned(arm, SMALL, law="jerk", jerk=100.0)


@pytest.fixture(scope="session")
def ring() -> PlannedPath:
    """A hundred rows round a circle, whose corners are rounded."""
    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    points = np.stack([1.7 + 0.3 * np.cos(turn), 0.3 * np.sin(turn), np.ones(100)], axis=1)
    points[-1] = points[0]
    return planned(load_robot("irb60"), PathRows(points, 0.05, corner=True))


@pytest.fixture(scope="session")
def alone() -> PlannedPath:
    """Path and time alone, of corners in planes of their own, one of which is a stop."""
    points = np.array(
        [[0, 0, 0], [0.4, 0, 0], [0.4, 0.4, 0.1], [0.8, 0.4, 0.5], [0.8, 0.9, 0.3]], dtype=float
    )
    return planned(None, PathRows(points, np.array([0, 0.05, 0.08, 0, 0.0]), corner=True))
