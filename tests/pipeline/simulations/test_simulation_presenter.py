"""What a simulation shows: how it ended, its delta meters, its signals, and nothing computed too early."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from asserting import there
from presented import cells, facts, figures, scene_of
from urmpipe_models.kinematics.forward import positions_over_log
from urmpipe_pipeline.presentation.figure import Drawing, SpaceFigure, Text
from urmpipe_pipeline.presentation.section import Presentation, Section, Value
from urmpipe_pipeline.results import present
from urmpipe_pipeline.simulations.simulation import Signal, Simulation

MakeSimulation = Callable[..., Simulation]


def block(shown: Presentation, title: str) -> Section:
    return next(one for one in shown.body.sections if one.title == title)


def test_a_delta_meter_is_a_check_and_a_judged_section(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    shown = present(simulation)
    (meter,) = simulation.verdicts
    section = block(shown, "meter")
    (end,), (check,) = shown.body.checks, section.checks
    assert (end.name, end.verdict) == ("reaches its end", "pass")
    assert (check.name, check.verdict, check.about) == ("within tolerance", "fail", "meter")
    assert f"{meter.out_of_tolerance} of {meter.samples}" in check.words
    value = cast("Value", section.facts[0].value)
    assert (value.number, value.limit, value.used) == (meter.worst, meter.allowed, meter.utilisation)
    table = cells(shown.body.tables[0])
    for key in ("worst", "allowed", "t", "sample", "samples", "out_of_tolerance", "out_fraction"):
        assert table[key] == [getattr(meter, key)]
    assert (shown.verdict, shown.opens_at_ns) == ("fail", simulation.t_ns[meter.sample])


def test_a_meter_in_doubt_says_so_where_its_verdict_stands(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    (meter,) = simulation.verdicts
    doubted = replace(meter, worst=1e-3, out_of_tolerance=0, caveats=("log.q was nan", "it ended early"))
    shown = present(replace(simulation, verdicts=(doubted,)))
    assert shown.verdict == "fail"
    assert shown.headline == f"meter of {simulation.name} within tolerance, but in doubt"
    assert [one.name for one in shown.facts if one.brief] == ["Decisive block", "Decided by"]
    section = block(shown, "meter")
    assert facts(section)["In doubt"] == "log.q was nan; it ended early"
    assert section.checks[0].words.endswith("; log.q was nan; it ended early")
    assert "In doubt" not in {one.name for one in block(present(simulation), "meter").facts if one.value}


def test_the_judged_block_is_opened_and_ranks_first(make_simulation: MakeSimulation) -> None:
    shown = present(make_simulation())
    assert [one.title for one in shown.body.sections] == ["log", "chain", "meter"]
    assert [one.title for one in shown.body.sections if one.opened] == ["meter"]
    assert min(shown.body.sections, key=lambda one: one.rank).title == "meter"


def test_without_a_meter_the_first_block_is_opened(make_simulation: MakeSimulation) -> None:
    simulation = replace(make_simulation(), verdicts=())
    shown = present(simulation)
    assert (shown.verdict, shown.word) == (None, "simulated")
    assert [one.title for one in shown.body.sections if one.opened] == ["log"]
    assert all(one.verdict is None and not one.checks for one in shown.body.sections)
    answered = replace(
        simulation,
        connections={"drive.set_x": "meter.norm", "drive.real_x": "chain.d"},
        signals=(*simulation.signals, Signal("chain", "d", simulation.signals[3].values, "m")),
    )
    (opened,) = [one for one in present(answered).body.sections if one.opened]
    (figure,) = figures(opened)
    assert [line.dashed for line in figure.views[0].panels[0].lines] == [True, False]


def test_the_deviation_of_a_meter_is_plotted_with_its_tolerance(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    judged, tolerated = figures(block(present(simulation), "meter"))
    delta = simulation.signal("meter.delta").values
    *coordinates, norm = judged.views[0].panels
    for panel, values in zip(coordinates, delta.T, strict=True):
        np.testing.assert_array_equal(panel.lines[0].values, values)
        assert (panel.limit, panel.signed) == (0.0035, True)
    np.testing.assert_array_equal(norm.lines[0].values, simulation.signal("meter.norm").values)
    assert (norm.limit, norm.signed) == (None, False)
    assert [panel.peaks for panel in judged.views[0].panels] == [(), (250,), (), ()]
    assert list(judged.instants) == [simulation.t_ns[250]]
    assert tolerated.views[0].panels[0].lines[0].steps


def test_signals_keep_their_arrays_units_and_names(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    (figure,) = figures(block(present(simulation), "log"))
    (panel,) = figure.views[0].panels
    assert panel.lines[0].values is simulation.signals[0].values
    assert (panel.unit, panel.display_unit) == ("rad", "deg")
    assert panel.lines[0].names == simulation.signals[0].variables
    assert panel.t_ns is simulation.t_ns


def test_the_extremes_are_those_of_the_json(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    shown = present(simulation)
    every = {one["name"]: one for one in simulation.to_dict()["signals"]}
    whole = next(one for one in shown.body.blocks() if one.title == f"Signals ({len(every)})")
    for table in (whole, shown.body.tables[1]):
        found = cells(cast("Any", table))
        for i, name in enumerate(found["name"]):
            assert {key: found[key][i] for key in found if key not in ("name", "unit")} == {
                key: every[name][key] for key in ("first", "min", "t_min", "max", "t_max", "last")
            }
    assert cells(cast("Any", whole))["name"] == list(every)
    first = cells(shown.body.tables[1])["name"]
    assert len(first) == 12
    assert set(first) > {"meter.delta[1]", "meter.norm"}  # what no other block takes comes first


def test_a_page_shows_the_system_and_the_path_of_the_tip(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    body = present(simulation).body
    drawing, file = body.figures()
    assert isinstance(drawing, Drawing) and drawing.svg == simulation.system_svg
    assert file == Text("System file", simulation.system_text)
    space = next(one for one in body.blocks() if isinstance(one, SpaceFigure))
    arm = simulation.arms[0]
    np.testing.assert_array_equal(space.paths[0].position, positions_over_log(arm.chain, arm.q))


def test_the_scene_is_every_arm_the_first_as_solids_and_their_tips(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    other = replace(simulation.arms[0], block="other")
    scene = scene_of(present(replace(simulation, arms=(*simulation.arms, other))))
    assert [(arm.ghost, arm.q, arm.kept) for arm in scene.arms] == [
        (False, simulation.arms[0].q, (250,)),
        (True, other.q, (250,)),
    ]
    assert scene.title == "Arms of chain and other and paths [m]"
    assert [path.label for path in scene.paths] == ["chain", "other"]


@pytest.mark.parametrize("samples", [0, 1, 50])
def test_a_failed_simulation_tells_why_and_opens_at_its_end(
    make_simulation: MakeSimulation, samples: int
) -> None:
    simulation = make_simulation(samples, failed="the solver diverged")
    shown = present(simulation)
    assert shown.verdict == "fail"
    assert [one.words for one in shown.body.checks] == ["the solver diverged"]
    assert shown.facts[0].value == "the solver diverged"
    assert "the solver diverged" in shown.body.notice
    assert facts(shown.body)["Failed after"] == simulation.duration
    assert shown.opens_at_ns == (simulation.t_ns[-1] if samples else 0)
    assert list(shown.body.events())[-1].t_ns == (simulation.t_ns[-1] if samples else None)
    assert [bool(figures(section)) for section in shown.body.sections] == [bool(samples)] * 3
    list(shown.body.blocks())
    assert (there(shown.scene)() is None) == (not samples)


def test_the_tip_of_an_arm_is_read_first_and_each_block_has_a_signal(make_simulation: MakeSimulation) -> None:
    simulation = replace(make_simulation(), verdicts=(), connections={"arm.phi": "drive.Mk"})
    ramp = np.linspace(0.0, 1.0, len(simulation.t_ns))
    point, still = ramp[:, np.newaxis] * (1.0, 2.0, 3.0), np.zeros(len(ramp))
    points = [Signal("arm", f"p{k}", point, "m") for k in range(1, 13)]
    drive = [Signal("drive", name, ramp, "") for name in ("theta", "Mk")]
    angles = [Signal("arm", "rz12", ramp, "rad"), Signal("arm", "rx12", still, "rad")]
    shown = present(replace(simulation, signals=(*points, *angles, *drive)))
    assert cells(shown.body.tables[0])["name"] == [
        "arm.p12[1]", "arm.p12[2]", "arm.p12[3]", "arm.rz12", *(f"arm.p11[{i}]" for i in (1, 2, 3)),
        *(f"arm.p10[{i}]" for i in (1, 2, 3)), "drive.Mk", "drive.theta",
    ]  # fmt: skip


def test_no_signal_is_looked_into_before_it_is_shown(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation()
    log, tip, delta, *others = simulation.signals
    values = delta.values.copy()
    changing = replace(delta, values=values)
    shown = present(replace(simulation, signals=(log, tip, changing, *others)))
    values *= 10.0  # after the presentation was made, before it is shown
    table = cells(shown.body.tables[1])
    assert table["max"][table["name"].index("meter.delta[2]")] == values[:, 1].max()
