"""A path with values is drawn as lines in their colours."""

from __future__ import annotations

from pathlib import Path as File

import numpy as np
import pytest
from numpy.typing import NDArray

from made_plans import CONTOUR, planned
from recorded import static
from urmpipe_models.elementwise import FloatArray
from urmpipe_pipeline.presentation.palette import VALUE_SCALE, rgb, value_colours
from urmpipe_pipeline.presentation.scene import Path
from urmpipe_pipeline.recording.views.geometry import drawn_path
from urmpipe_pipeline.recording.views.tracks import COLOURED, LEVELS, MOST, SEEN
from urmpipe_pipeline.results import write_recording

SMALLEST, LARGEST = rgb(VALUE_SCALE[0][1]), rgb(VALUE_SCALE[-1][1])


def line(rows: int) -> FloatArray:
    """Return places along x, a metre apart."""
    return np.arange(rows)[:, None] * [1.0, 0.0, 0.0]


def colours_of(shares: list[float]) -> NDArray[np.uint8]:
    """Return the colours of shares of the largest value, on the part of the scale that is seen."""
    return value_colours(np.array([*shares, 1.0 / SEEN]))[:-1]


def test_values_are_on_the_scale_from_zero_to_the_largest() -> None:
    stops = np.array([stop for stop, _ in VALUE_SCALE])
    wanted = [rgb(colour) for _, colour in VALUE_SCALE]
    for largest in (1.0, 0.5, 1e3):
        assert [tuple(one) for one in value_colours(largest * stops).tolist()] == wanted
    between = 0.5 * (stops[0] + stops[1])
    mixed = np.array([wanted[0], wanted[1]]).mean(axis=0)
    found = value_colours(np.array([between, 1.0]))[0]
    assert (np.abs(found - mixed) < 1.0).all()  # whole numbers of 0 to 255


@pytest.mark.parametrize("values", [[0.0, 0.0], [np.nan, np.nan], []])
def test_values_without_a_largest_are_the_smallest(values: list[float]) -> None:
    assert [tuple(one) for one in value_colours(np.array(values)).tolist()] == [SMALLEST] * len(values)
    (first, _) = value_colours(np.array([np.nan, 1.0])).tolist()
    assert tuple(first) == SMALLEST


def test_a_line_goes_as_far_as_its_values_are_on_one_level() -> None:
    values = np.array([0.0, 0.0, 1.0, 3.0, 3.0, 3.0])
    drawn = drawn_path(Path("speed", line(6), None, "#000000", values=values, unit="m/s"))
    assert [strip[:, 0].tolist() for strip in drawn.strips] == [[0, 1, 2], [2, 3], [3, 4, 5]]
    assert drawn.colours.dtype == np.uint8
    np.testing.assert_array_equal(drawn.colours, colours_of([0.0, 1.0 / 3.0, 1.0]))
    assert tuple(drawn.colours[0].tolist()) == SMALLEST


def test_no_colour_is_as_dark_as_the_end_of_the_scale() -> None:
    """The viewer's ground is dark."""
    drawn = drawn_path(Path("speed", line(3), None, "#000000", values=np.ones(3)))
    assert int(drawn.colours.sum()) > 2 * sum(LARGEST)


def test_it_breaks_where_there_is_no_place() -> None:
    position = line(8)
    position[[3, 4]] = np.nan
    drawn = drawn_path(Path("speed", position, None, "#000000", values=np.ones(8)))
    assert [strip[:, 0].tolist() for strip in drawn.strips] == [[0, 1, 2], [5, 6, 7]]
    one_alone = drawn_path(Path("speed", position[2:4], None, "#000000", values=np.ones(2)))
    assert one_alone.strips == ()


def test_values_that_change_all_the_time_have_fewer_levels_not_fewer_places() -> None:
    rows = 50 * COLOURED
    values = np.abs(np.sin(np.arange(rows) / 300.0))
    drawn = drawn_path(Path("speed", line(rows), None, "#000000", values=values))
    assert COLOURED / LEVELS[0] < len(drawn.strips) == len(drawn.colours) <= COLOURED
    begins, ends = (np.array([strip[k, 0] for strip in drawn.strips]) for k in (0, -1))
    assert (begins[0], ends[-1]) == (0, rows - 1)
    np.testing.assert_array_equal(begins[1:], ends[:-1])  # one line without a gap
    assert sum(map(len, drawn.strips)) - len(drawn.strips) + 1 >= MOST / 2


def test_kept_rows_are_vertices_of_a_long_path() -> None:
    rows, kept = 20 * MOST + 7, (3, 5_555, 11_111)
    drawn = drawn_path(Path("speed", line(rows), None, "#000000", values=np.ones(rows), kept=kept))
    (strip,) = drawn.strips
    assert {*kept, 0, rows - 1} <= {*strip[:, 0].astype(int).tolist()}
    assert len(strip) <= MOST + 1 + len(kept)


def test_without_values_or_without_a_line_it_has_one_colour() -> None:
    position, values = line(5), np.arange(5.0)
    for path in (
        Path("way", position, None, "#102030"),
        Path("way", position, None, "#102030", values=values, line=False),
    ):
        assert drawn_path(path).colours.tolist() == [[0x10, 0x20, 0x30]]
    assert drawn_path(Path("way", position, None, "#102030", values=values, line=False)).strips == ()


def test_the_recording_has_as_many_colours_as_lines(tmp_path: File) -> None:
    plan = planned(None, CONTOUR)
    file = write_recording(plan, tmp_path / "plan.rrd")
    entity = "/shown/scene/path/speed"
    strips = static(file, entity, "LineStrips3D:strips")
    packed = np.array(static(file, entity, "LineStrips3D:colors"), dtype=np.uint32)
    assert len(strips) == len(packed)
    colours = np.stack([packed >> shift & 0xFF for shift in (24, 16, 8)], axis=1)
    longest = max(range(len(strips)), key=lambda k: len(strips[k]))  # at the largest speed
    np.testing.assert_array_equal(colours[longest], colours_of([1.0])[0])
    np.testing.assert_array_equal(colours[0], SMALLEST)
