"""What the viewer opens with: which views stand where, what is open, and at which time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.blueprint import Container
from rerun.chunk import RrdReader

from recordable import build_comparison
from recorded import columns, entities, views
from toys import Toy, figure, laid_out, panel, recorded, root_of, shown, toy
from urmpipe_pipeline.presentation.figure import Drawing, Figure, Text, View
from urmpipe_pipeline.presentation.scene import Path as Way
from urmpipe_pipeline.presentation.scene import Scene
from urmpipe_pipeline.presentation.section import Column, Event, Presentation, Section, Table
from urmpipe_pipeline.recording.layout import Opening
from urmpipe_pipeline.recording.viewer import openings
from urmpipe_pipeline.recording.views.blueprint import EVENTS_SHARE, LINE_SHARE, PEEK, SEEN_AT_ONCE
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.simulations.simulation import Simulation

MakeSimulation = Callable[..., Simulation]
EVENT = Event(5_000_000, "it happened")


def tree(view: Any) -> Any:
    """Return a layout as lists of names: of containers their kind, what is open, and what stands in them."""
    if not isinstance(view, Container):
        return view.name
    opened = {} if view.active_tab is None else {"open": view.active_tab}
    return [type(view).__name__, *([view.name] if view.name else []), opened, *map(tree, view.contents)]


def layout(one: Presentation) -> Any:
    """Return the layout of a presentation as lists of names."""
    return tree(root_of(one))


def plain(*names: str, **more: Any) -> Figure:
    """Return a figure with a view of each name."""
    views = tuple(View(name, (panel(toy()),)) for name in names)
    return replace(figure(name=names[0]), views=views, **more)


def scene() -> Scene:
    one = toy(columns=3)
    return Scene("Paths [m]", paths=(Way("one", one.values, one.t_ns, "#c25000"),))


def test_a_figure_is_a_row_of_tabs_and_events_share_the_last() -> None:
    figures = plain("a", "b", opened=1, share=3.0), plain("c", "d", opened=None, share=2.0), plain("e", "f")
    one = shown(*figures, scene=scene(), events=lambda: [EVENT])
    assert layout(one) == [
        "Horizontal", {},
        ["Vertical", {}, "Summary", "Paths [m]"],
        [
            "Vertical", {},
            ["Tabs", {"open": 1}, "a [rad]", "b [rad]"],
            "c [rad]", "d [rad]",
            ["Tabs", {"open": 0}, "Events, at t [s]", "e [rad]", "f [rad]"],
        ],
    ]  # fmt: skip
    _, plots = root_of(one).contents
    assert plots.row_shares == [3.0, 2.0, 2.0, EVENTS_SHARE]


def test_the_events_of_a_single_plot_stand_below_it() -> None:
    one = shown(plain("a"), events=lambda: [EVENT])
    assert layout(one) == ["Vertical", {}, "Summary", ["Vertical", {}, "a [rad]", "Events, at t [s]"]]


def sections(count: int, views: int, opened: int) -> tuple[Section, ...]:
    names = [f"v{k}" for k in range(views)]
    return tuple(
        Section(f"s{k}", "fail" if k == opened else "pass", figures=lambda: [plain(*names, opened=None)],
                opened=k == opened, events=lambda: [EVENT])
        for k in range(count)
    )  # fmt: skip


def test_plots_of_several_sections_are_tabs_with_their_verdict_and_one_is_open() -> None:
    one = shown(scene=scene(), sections=sections(3, 4, opened=1))
    _, plots = root_of(one).contents
    assert plots.active_tab == 1
    assert [tab.name for tab in plots.contents] == ["PASS s0", "FAIL s1", "PASS s2"]


def test_few_plots_of_several_sections_stand_beside_each_other_with_their_section() -> None:
    one = shown(sections=sections(SEEN_AT_ONCE, 1, opened=1))
    _, grid = layout(one)[2:]
    assert grid[:3] == ["Grid", {}, "s0: v0 [rad]"]
    _, plots = root_of(one).contents
    assert plots.grid_columns == 2


def test_texts_and_events_without_a_plot_are_tabs_behind_the_summary(tmp_path: Path) -> None:
    body = Section(
        "body",
        figures=lambda: [Drawing("Drawing", "alt", "<svg/>"), Text("File", "line\n  two"), Text("File", "b")],
        events=lambda: [EVENT],
        sections=(Section("s", figures=lambda: [plain("a")]),),
    )
    one = replace(shown(), body=body)
    assert layout(one)[2] == ["Tabs", {"open": 0}, "Summary", "File", "File", "Events, at t [s]"]
    path = recorded(one, tmp_path)
    assert columns(path, "/shown/text/File", "TextDocument:text") == [["line\n  two"]]
    assert columns(path, "/shown/text/File-2", "TextDocument:text") == [["b"]]


def test_a_long_summary_stands_beside_the_plots_where_there_is_no_scene() -> None:
    short = shown(plain("a"))
    long = replace(short, headline="word " * 1000)
    assert layout(short)[0] == "Vertical"
    assert layout(long) == ["Horizontal", {}, "Summary", ["Vertical", {}, "a [rad]"]]
    with_arm = replace(long, scene=scene)
    assert layout(with_arm)[2] == ["Vertical", {}, "Summary", "Paths [m]"]


def test_tables_that_are_read_later_leave_the_room_to_the_arm() -> None:
    table = Table("Signals", (Column("name", "Name", [f"signal {k}" for k in range(12)]),))
    shares = []
    for tables in ((), (table,)):
        left, _ = root_of(shown(plain("a"), scene=scene(), tables=tables)).contents
        shares.append(left.row_shares[0])
    assert shares[1] - shares[0] == pytest.approx(PEEK * LINE_SHARE)
    assert layout(shown(plain("a"), tables=(table,)))[0] == "Horizontal"


def test_without_plots_and_scene_the_summary_stands_alone() -> None:
    assert layout(shown()) == ["Tabs", {}, "Summary"]


@pytest.mark.parametrize("timed", [True, False])
def test_it_opens_at_its_time_or_its_row(timed: bool, tmp_path: Path) -> None:
    one = toy()
    plot = panel(one) if timed else replace(panel(one), t_ns=None)
    told = replace(shown(figure(plot)), opens_at_ns=30_000_000, opens_at_row=None if timed else 6)
    path = recorded(told, tmp_path, one)
    wanted = Opening("t", 30_000_000) if timed else Opening("row", 7)
    assert openings([path]) == {path: wanted}
    assert laid_out(told)[0].time_panel.timeline == wanted.timeline
    assert laid_out(replace(told, opens_at_row=None))[1].timeline == wanted.timeline


def test_results_open_where_their_verdict_was_decided(
    make_simulation: MakeSimulation, tmp_path: Path
) -> None:
    comparison = build_comparison(("solidworks", "coppeliasim"))
    path = write_recording(comparison, tmp_path / "both.rrd")
    assert openings([path])[path].at / 1e9 == comparison.worst.worst_statistics.t_max > 0
    path = write_recording(make_simulation(), tmp_path / "simulation.rrd")
    assert openings([path])[path].at == 1_250_000_000


def test_the_layout_of_a_comparison_is_in_the_file(tmp_path: Path) -> None:
    found = views(write_recording(build_comparison(("a b", "reference")), tmp_path / "both.rrd"))
    names = found["ViewBlueprint:display_name"]
    assert {
        "Arm of reference and paths [m], in crimson the deviation x50",
        "Distance from the path [mm]",
        "Angle between the orientations [deg]",
        "Joints, reference - log [deg]",
        "Joints in the file [rad]",
        "Joints repolarized (2 marked) [rad]",
        "Speed of the tool centre point [m/s]",
    } <= set(names)
    assert all("[" in name for name in names if name != "Summary")
    assert {"PASS a b", "PASS reference"} <= set(found["ContainerBlueprint:display_name"])


def test_what_is_drawn_stands_below_one_root_and_on_no_clock_of_the_writer(tmp_path: Path) -> None:
    """The other entities are the arrays of the result, at the paths of their fields."""
    path = write_recording(build_comparison(rows=50), tmp_path / "both.rrd")
    roots = {entity.split("/")[1] for entity in entities(path)}
    assert roots == {"shown", "reference", "runs"}
    timelines = {name for chunk in RrdReader(path).store().stream() for name in chunk.timeline_names}
    assert timelines == {"t", "row"}


def test_names_that_no_viewer_can_show_are_shown_as_far_as_they_can(tmp_path: Path) -> None:
    one = toy()
    odd = ("a\udc80b", "a/b", "a/b", "", "a\\ ", "**")
    parts = tuple(
        Section(name, figures=lambda: [plain(*odd)], events=lambda: [Event(0, "\udcff?")]) for name in odd
    )
    told = replace(shown(sections=parts), name="\udcff", headline="\udcff|*")
    path = recorded(told, tmp_path, Toy(one.t_ns, np.asarray(one.values)))
    assert len(entities(path, "/shown/events")) == len(odd)
    assert "a?b [rad]" in views(path)["ViewBlueprint:display_name"]
