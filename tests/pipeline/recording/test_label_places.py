"""Where words stand at arms in the 3D view: apart from each other, where the arms differ."""

from __future__ import annotations

import numpy as np
import pytest

from urmpipe_pipeline.recording.views.camera import FIELD_OF_VIEW, eye_distance, in_the_picture, seen
from urmpipe_pipeline.recording.views.label_places import NAME_SIZE, extent_of, placed_names


@pytest.mark.parametrize(("view", "count"), [(0.0, 8), (30.0, 3)])
def test_names_do_not_lie_on_each_other_in_the_view(view: float, count: int) -> None:
    """Where much else is in view, the arms are small beside their names."""
    arms = np.random.default_rng(3).normal(size=(count, 5, 24, 3))
    arms[0, 2] = np.nan  # there the arm has no pose, and its name no place
    named = placed_names(arms, view)
    picture, box = in_the_picture(arms), np.array(NAME_SIZE) * (view or extent_of(arms))
    for pose in range(5):
        at = picture[np.arange(count), pose, named[:, pose]]
        gaps = np.abs(at[:, None] - at[None]) / box
        np.fill_diagonal(gaps[..., 0], np.inf)
        there = np.isfinite(at).all(axis=1)
        assert there.sum() == (count - 1 if pose == 2 else count)
        assert (gaps.max(axis=2)[np.ix_(there, there)] >= 1.0).all()


def test_what_is_nearer_is_larger_in_the_picture() -> None:
    """Held against the angles at which the eye sees points, from where it is."""
    points = np.random.default_rng(4).normal(size=(50, 3))
    points[7] = np.nan
    found = seen(points)
    found -= (np.nanmin(found, axis=0) + np.nanmax(found, axis=0)) / 2
    distance = eye_distance(found)
    angles = np.arctan2(found[:, :2], (distance - found[:, 2])[:, None])
    picture = in_the_picture(points)
    np.testing.assert_allclose(picture, distance * np.tan(angles), rtol=0, atol=1e-13)  # rounding over 10 m
    assert np.nanmax(np.abs(angles[:, 1])) < FIELD_OF_VIEW / 2
    np.testing.assert_array_equal(in_the_picture(points[:1]), [[0.0, 0.0]])
