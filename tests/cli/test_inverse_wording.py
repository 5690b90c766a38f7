"""What inverse kinematics says in words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe.inverse_wording import (
    NAMED,
    far_warnings,
    longest,
    method_words,
    rows_text,
    shortfall_warnings,
    singular_warnings,
)
from urmpipe_models.catalogue import load_robot
from urmpipe_models.inverse.solutions import Singular, Solutions
from urmpipe_models.inverse.targets import Targets, targets_of
from urmpipe_pipeline.joint_log import LogWarning


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([3], "row 3"),
        ([3, 7], "rows 3, 7"),
        ([1, 2, 3], "rows 1-3"),
        ([1, 3, 4, 9], "rows 1, 3-4, 9"),
        ([1, 3, 5, 7, 9, 11], "rows 1, 3, 5, 7, 9, 11"),
        ([1, 3, 5, 7, 9, 11, 13, 14], "rows 1, 3, 5, 7, 9, 11 and 2 more"),
    ],
)
def test_rows_are_named_by_stretches_and_the_rest_is_counted(rows: list[int], said: str) -> None:
    assert rows_text(rows) == said


@given(st.sets(st.integers(1, 60), min_size=1))
def test_every_row_is_named_or_counted(rows: set[int]) -> None:
    said = rows_text(sorted(rows)).removeprefix("rows ").removeprefix("row ")
    named, _, more = said.partition(" and ")
    found: set[int] = set()
    for part in named.split(", "):
        low, _, high = part.partition("-")
        found |= set(range(int(low), int(high or low) + 1))
    assert len(named.split(", ")) <= NAMED
    assert found <= rows
    assert len(rows) - len(found) == int(more.removesuffix(" more") or 0)


def test_what_solved_the_targets() -> None:
    assert method_words("spherical wrist") == "closed form: spherical wrist"
    assert method_words("iterative") == "iterative"


def solutions(*families: Singular, shortfall: list[list[float]] | None = None) -> Solutions:
    """Three targets of two solutions each; the last target has none."""
    q = np.zeros((3, 2, 6))
    q[2] = np.nan
    reasons = np.array([["", ""], ["", ""], ["no", "no"]], dtype=object)
    short = np.zeros((3, 2)) if shortfall is None else np.array(shortfall)
    return Solutions(q, ("a", "b"), reasons, families, short)


def test_a_family_of_singular_poses_is_told_once_with_its_rows() -> None:
    aligned = np.array([[True, False], [False, True], [True, True]])
    stretched = np.array([[False, False], [True, True], [False, False]])
    found = solutions(
        Singular("wrist aligned", aligned, "q4 and q6: only their sum is determined", "q4 = 0"),
        Singular("arm stretched", stretched),
    )
    row, every = np.array([1, 4, 5]), np.ones((3, 2), dtype=bool)
    assert list(singular_warnings(found, row, every)) == [
        LogWarning(
            "singular",
            "rows 1, 4: wrist aligned: q4 and q6: only their sum is determined; chosen: q4 = 0",
        ),
        LogWarning("singular", "row 4: arm stretched: a direction of motion is lost there"),
    ]
    first = every & [True, False]
    assert [one.message.partition(":")[0] for one in singular_warnings(found, row, first)] == [
        "row 1",
        "row 4",
    ]


def test_the_nearest_point_tells_how_far_it_is_from_the_target() -> None:
    found = solutions(shortfall=[[0.0, 0.0], [0.0021, 0.0], [9.0, 9.0]])
    assert list(shortfall_warnings(found, np.array([1, 4, 5]))) == [
        LogWarning(
            "nearest-point",
            "row 4: out of reach, the nearest point is taken (--tolerance): up to 2.1 mm away, in row 4",
        )
    ]
    assert not list(shortfall_warnings(solutions(), np.array([1, 4, 5])))


def test_targets_in_mm_are_told_from_those_out_of_reach() -> None:
    arm = load_robot("arm6")
    position = np.array([[-69.0, 0.0, 112.0], [0.9, 0.0, 0.0], [np.nan, 0.0, 0.0], [-0.069, 0.0, 0.112]])
    reached = np.array([False, False, False, True])
    (found,) = far_warnings(arm, Targets(position), np.arange(1, 5), reached)
    assert found.kind == "too-far"
    assert found.message == (
        "row 1: up to 131.548 m from the base, while arm6 reaches no farther than 0.4001 m:"
        " in mm? Allowed: m, or of a file --unit x=mm"
    )


@pytest.mark.parametrize("name", ["arm6", "articulated6r", "panda", "ur5e", "urm6"])
def test_no_pose_is_farther_than_the_longest_reach(name: str) -> None:
    arm = load_robot(name)
    q = np.random.default_rng(6).uniform(-np.pi, np.pi, (2000, len(arm.coordinates)))
    away = np.linalg.norm(targets_of(arm, q).position, axis=1).max()
    assert 0.5 * longest(arm) < away <= longest(arm)
