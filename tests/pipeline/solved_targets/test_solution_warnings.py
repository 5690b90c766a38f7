"""What inverse kinematics says in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.ik.closed import format_method
from urmpipe_models.ik.solutions import SingularPoses, Solutions, Targets, forward_targets
from urmpipe_models.kinematics.singularity import singularity_over_log
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.solved_targets.solution_warnings import (
    far_warnings,
    longest,
    near_singular_warnings,
    shortfall_warnings,
    singular_warnings,
    start_warnings,
    within_pi_warnings,
)
from urmpipe_pipeline.text import MAX_NAMED_ROWS, format_rows


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
    assert format_rows(rows) == said


@given(st.sets(st.integers(1, 60), min_size=1))
def test_every_row_is_named_or_counted(rows: set[int]) -> None:
    said = format_rows(sorted(rows)).removeprefix("rows ").removeprefix("row ")
    named, _, more = said.partition(" and ")
    found: set[int] = set()
    for part in named.split(", "):
        low, _, high = part.partition("-")
        found |= set(range(int(low), int(high or low) + 1))
    assert len(named.split(", ")) <= MAX_NAMED_ROWS
    assert found <= rows
    assert len(rows) - len(found) == int(more.removesuffix(" more") or 0)


def test_what_solved_the_targets() -> None:
    assert format_method("spherical wrist") == "closed form: spherical wrist"
    assert format_method("iterative") == "iterative"


def solutions(*families: SingularPoses, shortfall: list[list[float]] | None = None) -> Solutions:
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
        SingularPoses("wrist aligned", aligned, "q4 and q6: only their sum is determined", "q4 = 0"),
        SingularPoses("arm stretched", stretched),
    )
    row, every = np.array([1, 4, 5]), np.ones((3, 2), dtype=bool)
    assert list(singular_warnings(found, row, every)) == [
        LogWarning(
            "singular", "rows 1, 4: wrist aligned: q4 and q6: only their sum is determined; chosen: q4 = 0"
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
            "row 4: out of reach, the nearest point within the tolerance is taken: up to 2.1 mm away,"
            " in row 4",
        )
    ]
    assert not list(shortfall_warnings(solutions(), np.array([1, 4, 5])))


def test_targets_in_mm_are_told_from_those_out_of_reach() -> None:
    arm = load_robot("arm6")
    position = np.array([[-69.0, 0.0, 112.0], [0.9, 0.0, 0.0], [np.nan, 0.0, 0.0], [-0.069, 0.0, 0.112]])
    reached = np.array([False, False, False, True])
    (found,) = far_warnings(arm, Targets(position), np.arange(1, 5), reached, of_file=True)
    assert (found.kind, found.allowed) == ("too-far", "m")
    assert found.message == (
        "row 1: up to 131.548 m from the base, while arm6 reaches no farther than 0.4001 m: they may be in mm"
    )
    (hint,) = found.hints
    assert (hint.parameter, hint.value) == ("unit", {"": "mm"})
    (of_arrays,) = far_warnings(arm, Targets(position), np.arange(1, 5), reached, of_file=False)
    assert of_arrays == replace(found, hints=())


@pytest.mark.parametrize("name", ["arm6", "articulated6r", "panda", "ur5e", "urm6"])
def test_no_pose_is_farther_than_the_longest_reach(name: str) -> None:
    arm = load_robot(name)
    q = np.random.default_rng(6).uniform(-np.pi, np.pi, (2000, len(arm.coordinates)))
    away = np.linalg.norm(forward_targets(arm, q).position, axis=1).max()
    assert 0.5 * longest(arm) < away <= longest(arm)


def test_a_wrist_that_is_aligned_but_for_the_digits_of_a_file_is_told_of() -> None:
    arm = load_robot("arm6")
    q = np.array([[0.3, 0.8, -0.6, 0.5, bend, 0.2] for bend in (1e-10, 0.7, 1e-5, 0.0, 1e-2)])
    flat = SingularPoses("wrist aligned", (q[:, 4] == 0.0)[:, None], "q4 and q6: only their sum", "q4 = 0")
    found = Solutions(q[:, None], ("1",), np.full((5, 1), "", dtype=object), (flat,))
    row, every = np.arange(1, 6), np.ones((5, 1), dtype=bool)
    (said,) = near_singular_warnings(arm, found, row, every, orientation=True)
    least = singularity_over_log(arm, q[:1]).smallest[0]
    assert said == LogWarning(
        "near-singular",
        f"rows 1, 3: singular or nearly so: smallest singular value {least:.2g} in row 1;"
        " the least change of the target may turn joints far",
    )
    assert 1e-13 < least < 1e-10
    shown = every & (row == 3)[:, None]
    (said,) = near_singular_warnings(arm, found, row, shown, orientation=True)
    assert said.message.startswith("row 3: singular or nearly so: smallest singular value ")
    assert " in row " not in said.message
    assert not list(near_singular_warnings(arm, found, row, every, orientation=False))
    approached = replace(found, position_residual=np.full((5, 1), 1e-3))
    assert not list(near_singular_warnings(arm, approached, row, every, orientation=True))


def test_a_start_in_degrees_is_told_of() -> None:
    arm = load_robot("urm6")
    assert not list(start_warnings(arm, None))
    assert not list(start_warnings(arm, np.full(6, -4.0 * np.pi)))
    assert list(start_warnings(arm, np.array([0.0, 45.0, -90.0, 3.0, 0.0, 0.0]))) == [
        LogWarning(
            "start-unit",
            "these values look like degrees",
            parameter="start",
            found="phi2 = 45 rad (2578.31 deg), phi3 = -90 rad (-5156.62 deg)",
            allowed="rad",
        )
    ]


def test_a_joint_with_limits_that_within_pi_leaves_beyond_pi_is_told_of() -> None:
    arm = load_robot("ur5e")
    limited = replace(arm, joints=(*arm.joints[:-1], replace(arm.joints[-1], lower=-7.0, upper=7.0)))
    q = np.zeros((3, 1, 6))
    q[1, 0, 5] = -3.5
    q[2] = np.nan
    assert list(within_pi_warnings(limited, q)) == [
        LogWarning(
            "beyond-pi",
            "wrist_3_joint goes to 200.535 deg: it is for joints without limits; a joint with limits stays",
            parameter="within_pi",
        )
    ]
    assert not list(within_pi_warnings(limited, np.clip(q, -np.pi, np.pi)))
