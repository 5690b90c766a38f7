"""What a simulation says of itself, and what it refuses to be."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from asserting import refusal
from urmpipe_models.errors import CosimulationError
from urmpipe_pipeline.simulations.simulation import Signal, SimulatedArm, Simulation, extremes

MakeSimulation = Callable[..., Simulation]


def test_a_frame_has_a_column_a_scalar(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(5)
    frame = simulation.to_frame()
    assert list(frame.columns) == [
        "t", *(f"log.q[{k}]" for k in range(1, 7)), *(f"chain.p7[{k}]" for k in (1, 2, 3)),
        *(f"meter.delta[{k}]" for k in (1, 2, 3)), "meter.norm", "meter.out_of_tolerance",
    ]  # fmt: skip
    assert frame["t"].tolist() == [0.0, 0.005, 0.01, 0.015, 0.02]
    assert frame["log.q[2]"].tolist() == simulation.signals[0].values[:, 1].tolist()
    assert frame["meter.norm"].tolist() == simulation.signals[3].values.tolist()


def test_its_json_has_the_extremes_of_every_scalar_and_when_they_stand(
    make_simulation: MakeSimulation,
) -> None:
    simulation = make_simulation(600)
    said = simulation.to_dict()
    assert json.loads(json.dumps(said, allow_nan=False)) == said
    assert (said["samples"], said["step"], said["duration"]) == (600, 0.005, 2.995)
    y = next(one for one in said["signals"] if one["name"] == "meter.delta[2]")
    values = simulation.signal("meter.delta").values[:, 1]
    assert y == {
        "name": "meter.delta[2]", "unit": "m", "type": "Real", "first": 0.0, "last": values[-1],
        "min": values.min(), "t_min": 2.995, "max": 4e-3, "t_max": 1.25,
    }  # fmt: skip
    assert said["verdicts"][0] == {
        "block": "meter", "tolerance": {"axis": 0.0035}, "quantity": "y", "worst": 4e-3, "t": 1.25,
        "sample": 250, "samples": 600, "missing": 0, "coverage": 1.0, "verdict": "fail", "caveats": [],
        "out_of_tolerance": np.count_nonzero(np.abs(values) > 0.0035),
    }  # fmt: skip
    assert (said["verdict"], said["failed"], said["recording"]) == ("fail", None, None)
    assert said["blocks"][2] == {"name": "meter", "kind": "fmu", "source": "meter.fmu", "content": "{c}"}


def test_what_is_not_finite_is_no_extreme() -> None:
    found = extremes(np.array([np.nan, 2.0, -1.0, np.inf]), np.array([0.0, 1.0, 2.0, 3.0]))
    assert found == {"first": None, "last": None, "min": -1.0, "t_min": 2.0, "max": 2.0, "t_max": 1.0}
    assert set(extremes(np.array([np.nan]), np.zeros(1)).values()) == {None}


def test_the_verdict_is_of_the_end_and_of_the_meters(make_simulation: MakeSimulation) -> None:
    assert make_simulation(tolerance=0.004).verdict == "pass"
    assert make_simulation(tolerance=0.0039).verdict == "fail"
    assert make_simulation(tolerance=0.004, failed="drive: error").verdict == "fail"
    assert replace(make_simulation(), verdicts=()).verdict is None


def test_one_that_failed_at_once_has_no_sample(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(0, failed="chain: fmi2DoStep returned fmi2Error")
    assert (simulation.duration, simulation.verdicts, simulation.judged_worst) == (0.0, (), None)
    assert {one["min"] for one in simulation.to_dict()["signals"]} == {None}
    assert len(simulation.to_frame()) == 0


def test_a_signal_is_found_by_its_name(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(3)
    assert simulation.signal("chain.p7") is simulation.signals[1]
    assert refusal(CosimulationError, simulation.signal, "chain.p8") == (
        "found no signal chain.p8, allowed: log.q, chain.p7, meter.delta, meter.norm, meter.out_of_tolerance"
    )


def test_what_does_not_fit_together_is_refused_all_at_once(make_simulation: MakeSimulation) -> None:
    simulation = make_simulation(3)
    signals = (
        Signal("a", "x", np.zeros(2)), Signal("a", "y", np.zeros((3, 1, 1))),
        Signal("b", "z", np.zeros((3, 2))),
        Signal("b", "z[2]", np.zeros(3)),
    )  # fmt: skip
    late = replace(simulation.verdicts[0], sample=3)
    with pytest.raises(CosimulationError) as caught:
        replace(
            simulation, verdicts=(late,), t_ns=np.array([0, 5, 5]), signals=signals,
            arms=(SimulatedArm("chain", simulation.arms[0].chain, np.zeros((3, 5))),),
        )  # fmt: skip
    assert str(caught.value).splitlines() == [
        "simulation log-to-delta: found times that do not rise, allowed: rising times",
        "simulation log-to-delta: a.x: found values of shape (2,), allowed: (3,) or (3, size)",
        "simulation log-to-delta: a.y: found values of shape (3, 1, 1), allowed: (3,) or (3, size)",
        "simulation log-to-delta: b.z[2]: found 2 signals of this name, allowed: one",
        "simulation log-to-delta: verdict of meter: found sample 3, allowed: 0 to 2",
        "simulation log-to-delta: arm of chain: found joints of shape (3, 5), allowed: (3, 6)",
    ]
