"""What cannot run is told before the first step, all at once."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from asserting import refusal
from foreign_fmus import (
    COUNTER,
    INTEGRATOR,
    TROUBLE,
    ZEROS,
    Foreign,
    Scalar,
    copy_changed,
    fmu,
    fmu_of,
    follow,
    gain,
    planned,
    system,
)
from urmpipe_fmus.cosim import LogColumn, Port, prepare
from urmpipe_fmus.cosim.checks import read_interface
from urmpipe_models.errors import CosimulationError

ARM = Foreign(
    name="arm",
    scalars=(
        *(Scalar(f"phi[{i}]", i, "input", unit="rad") for i in range(1, 12)),
        *(
            Scalar(f"p[{i}]", 20 + i, unit="m", on=tuple(f"phi[{k}]" for k in range(1, 12)))
            for i in (3, 1, 2)
        ),
        Scalar("rate", 30, unit="rad/s"),
        Scalar("free", 31),
        Scalar("length", 32, "parameter", start="1", unit="m", extra=' min="0.1" max="2"'),
        Scalar("gain[1]", 33, "parameter", start="1"),
        Scalar("gain[2]", 34, "parameter", start="1"),
        Scalar("name", 0, "parameter", "String", start="arm"),
        Scalar("count", 0, "parameter", "Integer", start="1"),
        Scalar("strict", 0, "parameter", "Boolean", start="false"),
    ),
)


ALLOWED = "allowed: each in [connections], in [inputs], or with a value in start"


def told(*arguments: Any, **options: Any) -> list[str]:
    with pytest.raises(CosimulationError) as caught:
        planned(*arguments, **options)
    return [str(finding) for finding in caught.value.findings]


def test_elements_of_an_array_are_in_the_order_of_their_numbers() -> None:
    shown = read_interface(fmu(ARM))
    assert [one.name for one in shown.elements("phi")] == [f"phi[{i}]" for i in range(1, 12)]
    assert [one.name for one in shown.elements("p")] == ["p[1]", "p[2]", "p[3]"]
    assert [one.name for one in shown.elements("p[2]")] == ["p[2]"]
    assert shown.elements("q") == ()


def test_every_wrong_connection_is_told() -> None:
    every = {f"arm.phi[{i}]": "i.y" for i in range(2, 12)}
    assert told(
        {"arm": ARM, "i": INTEGRATOR, "n": COUNTER},
        {
            "arm.phi": "i.y",
            "arm.fi": "i.y",
            "i.u": "arm.rote",
            "i.y": "arm.free",
            "arm.length": "i.y",
            "n.by": "i.y",
            "n.on": "n.n",
            "arm.phi[1]": "i.u",
            **every,
        },
    ) == [
        "connections.arm.phi: found i.y of size 1, allowed: 11, as many as arm.phi",
        "connections.arm.fi: input of arm: found 'fi', allowed: phi",
        "connections.i.u: output of arm: found 'rote' (did you mean rate?), allowed: p, rate, free",
        "connections.i.y: found i.y, causality output, allowed: an input of i: u",
        "connections.arm.length: found arm.length, causality parameter, allowed: an input of arm: phi",
        "connections.n.by: found i.y, Real, allowed: Integer",
        "connections.n.on: found n.n, Integer, allowed: Boolean",
        "connections.arm.phi[1]: found i.u, causality input, allowed: an output of i: y",
    ]  # and no input is said to have no source as well


def test_texts_are_not_exchanged() -> None:
    texts = Foreign(name="texts", scalars=(Scalar("s", 0, type="String"), Scalar("u", 1, "input", "String")))
    said = "; allowed: numbers: texts are not exchanged, start sets one for the whole run"
    assert told({"a": texts, "b": texts}, {"b.u": "a.s"}, {"a": {"u": "x"}}) == [
        f"connections.b.u: found a.s, String, for u, String{said}"
    ]
    assert told({"a": gain(), "b": texts}, {"b.u": "a.y"}, {"a": {"u": 0.0}}) == [
        f"connections.b.u: found a.y, Real, for u, String{said}"
    ]


@pytest.mark.slow
def test_units_must_be_the_same_by_what_they_are_not_by_how_they_are_spelled() -> None:
    degrees = '<Unit name="Grad"><BaseUnit rad="1" factor="0.017453292519943295"/></Unit>'
    in_degrees = gain("in_degrees", unit="Grad", units=degrees)
    in_deg, in_rad = gain("in_deg", unit="deg"), gain("in_rad", unit="rad")
    in_newton_metres, in_joules = gain("in_nm", unit="N.m"), gain("in_j", unit="J")
    without = gain("without")
    first = {"source": {"u": 0.0}}
    assert planned({"source": in_degrees, "b": in_deg}, {"b.u": "source.y"}, first).notes == ()
    assert planned({"source": in_newton_metres, "b": in_joules}, {"b.u": "source.y"}, first).notes == ()
    assert planned({"source": in_rad, "b": without}, {"b.u": "source.y"}, first).notes == (
        "connections.b.u: source.y has rad, the input no unit: not compared",
    )
    assert told({"source": in_rad, "b": in_deg}, {"b.u": "source.y"}, first) == [
        "connections.b.u: source.y: found the unit rad, allowed: that of the input, deg"
    ]
    unknown = gain("in_turns", unit="turns", units='<Unit name="turns"/>')
    assert told({"source": unknown, "b": in_deg}, {"b.u": "source.y"}, first) == [
        "connections.b.u: source.y: found the unit turns, allowed: that of the input, deg"
    ]


def test_an_input_has_one_source() -> None:
    blocks, start, log = {"a": gain(), "b": gain()}, {"a": {"u": 1.0}}, [follow("b.u")]
    assert told(blocks, {"b.u": "a.y"}, start, log, column=lambda _: ZEROS) == [
        "b.u: found two sources, a.y and the log, allowed: one"
    ]
    assert told({"b": gain()}, {}, {}, log) == [
        "inputs.b.u: found the log run.csv, but nothing to read it with"
    ]
    every = {f"arm.phi[{i}]": "i.y" for i in range(1, 12)}
    arms = {"arm": ARM, "other": ARM, "i": INTEGRATOR}
    assert told(arms, {**every, "other.phi": "other.p", "i.u": "i.y"}) == [
        "connections.other.phi: found other.p of size 3, allowed: 11, as many as other.phi"
    ]


def test_start_values_that_are_refused_are_told() -> None:
    assert told(
        {"arm": ARM},
        None,
        {
            "arm": {
                "phi": [0.0] * 10,
                "lenght": 1.0,
                "length": 3.0,
                "gain": [1.0, float("nan")],
                "gain[1]": True,
                "name": 1,
                "count": 1.5,
                "strict": 1,
                "free": 1.0,
                "rate": "fast",
            }
        },
    ) == [
        "blocks.arm.start.phi: found 10 values, allowed: 11, or one for all",
        "blocks.arm.start.lenght: found 'lenght' (did you mean length?), allowed: length, gain, name, count,"
        " strict, phi, p, rate,"
        " free",
        "blocks.arm.start.length: found 3, allowed: 0.1 to 2",
        "blocks.arm.start.gain: found nan, allowed: a finite number",
        "blocks.arm.start.gain[1]: found true, allowed: a number",
        "blocks.arm.start.name: found 1, allowed: a text",
        "blocks.arm.start.count: found 1.5, allowed: an integer of 32 bits",
        "blocks.arm.start.strict: found 1, allowed: true, false",
        "blocks.arm.start.free: found free, continuous output, allowed: a parameter, input or state",
        "blocks.arm.start.rate: found rate, continuous output, allowed: a parameter, input or state",
        "blocks.arm: found inputs without a source: "
        + ", ".join(f"phi[{i}]" for i in range(1, 12))
        + "; allowed:"
        " each in [connections], in [inputs], or with a value in start",
    ]


def test_a_loop_is_told_by_its_members() -> None:
    blocks = {"a": gain(), "b": gain(), "c": INTEGRATOR}
    assert told(blocks, {"b.u": "a.y", "a.u": "b.y", "c.u": "b.y"}) == [
        "algebraic loop: a.y -> b.u -> b.y -> a.u: each depends on the one before at the same instant;"
        " allowed: none, or [loops] iterate = true"
    ]
    assert planned(blocks, {"b.u": "a.y", "a.u": "c.y", "c.u": "b.y"}).loops == ()


def test_an_output_that_does_not_say_depends_on_all_inputs() -> None:
    silent = gain("silent", on=None)
    assert told({"a": silent}, {"a.u": "a.y"}) == [
        "algebraic loop: a.y -> a.u: each depends on the one before at the same instant (a.y: on all inputs,"
        " as the FMU does not tell on which); allowed: none, or [loops] iterate = true"
    ]
    assert planned({"a": gain("deaf", on=())}, {"a.u": "a.y"}).loops == ()


def test_a_loop_of_integers_cannot_be_iterated() -> None:
    whole = Foreign(
        name="whole",
        scalars=(Scalar("u", 0, "input", "Integer"), Scalar("y", 1, "output", "Integer", on=("u",))),
    )
    assert told({"a": whole}, {"a.u": "a.y"}, iterate=True) == [
        "algebraic loop: a.y -> a.u: found a.u, an Integer; allowed: Reals alone"
    ]


def test_the_duration_is_told_by_the_system_or_by_the_caller_or_by_the_longest_log() -> None:
    column = LogColumn(np.array([0, 36_910_000_000]), np.zeros(2))
    blocks = system({"a": gain()}, inputs=[follow("a.u")], step=0.005, duration=None)
    assert prepare(blocks, fmu_of, column=lambda one: column).count == 7382
    assert prepare(blocks, fmu_of, column=lambda one: column, duration=1.0).count == 200
    assert told({"a": TROUBLE}, duration=None) == [
        "system.duration: not found, and no log tells it, allowed: a number above 0, in s;"
        " duration=SECONDS sets it"
    ]
    assert told({"a": TROUBLE}, step=1e-10) == [
        "system.step: found 1e-10 s, allowed: from 1e-09 s, as times are in ns"
    ]
    assert told({"a": TROUBLE}, duration=0.05) == [
        "system.step: found 0.1 s, allowed: no more than the duration, 0.05 s"
    ]
    for long in (1.001e7, 1e308):
        assert told({"a": TROUBLE}, duration=long) == [
            f"system.duration: found {long:g} s in steps of 0.1 s, allowed: 1e+08 steps at most;"
            " duration=SECONDS or step=SECONDS sets another"
        ]


@pytest.mark.parametrize("rate", [30, 60, 90, 300])
def test_the_last_row_of_a_log_whose_times_are_rounded_to_nanoseconds_is_reached(rate: int) -> None:
    k = np.arange(7383)
    column = LogColumn(np.round(k / rate * 1e9).astype(np.int64), k.astype(np.float64))
    blocks = system({"a": gain()}, inputs=[follow("a.u")], step=1.0 / rate, duration=None)
    plan = prepare(blocks, fmu_of, column=lambda one: column)
    assert plan.logged[Port("a", "u")].tolist() == k.tolist()


def test_a_duration_that_is_no_multiple_of_the_step_ends_with_the_last_whole_one_and_is_told() -> None:
    plan = planned({"a": TROUBLE}, step=0.3)
    assert plan.count == 3
    assert plan.notes == ("system.duration: found 1 s, no multiple of the step, 0.3 s: it ends at 0.9 s",)
    assert planned({"a": TROUBLE}, step=0.1, duration=0.3).notes == ()


@pytest.mark.parametrize(
    ("port", "told_as"),
    [("by", "found 1.5, allowed: an integer of 32 bits"), ("on", "found 0.5, allowed: true, false")],
)
def test_every_value_of_a_log_is_held_to_the_type_of_its_input(port: str, told_as: str) -> None:
    column = LogColumn(np.array([0, 1, 2]) * 10**8, np.array([0.0, 0.5, 1.0]) + (port == "by"))
    start = {"by": 1, "on": True}
    del start[port]
    assert told(
        {"n": COUNTER}, None, {"n": start}, [follow(f"n.{port}", "x")], column=lambda one: column
    ) == [f"inputs.n.{port}: run.csv, column x: {told_as}"]


def test_a_log_must_fit_its_input() -> None:
    log = [follow("a.u", interpolate=True), follow("n.by", "n", interpolate=True), follow("arm.phi")]
    columns = {
        "u": LogColumn(np.array([0, 10**9]), np.zeros(2), "deg"),
        "n": LogColumn(np.array([0, 10**9]), np.array([1.0, 2.5])),
    }
    blocks = {"a": gain("in_rad", unit="rad"), "n": COUNTER, "arm": ARM}
    lines = told(blocks, None, {"n": {"on": True}}, log, column=lambda follower: columns[follower.column])
    assert lines[:2] == [
        "inputs.a.u: found the unit deg, allowed: that of the input, rad",
        "inputs.arm.phi: found an array, allowed: one of " + ", ".join(f"phi[{i}]" for i in range(1, 12)),
    ]
    assert lines[3:] == [
        "inputs.n.by: interpolate: found for an Integer, allowed: for a Real",
        "inputs.n.by: run.csv, column n: found 2.5, allowed: an integer of 32 bits",
    ]


def test_what_is_no_fmu_for_cosimulation_is_told(tmp_path: Path) -> None:
    broken = tmp_path / "broken.fmu"
    broken.write_bytes(b"PK")
    blocks = system({"a": gain(), "b": gain()})
    assert refusal(
        CosimulationError, prepare, blocks, lambda block: broken if block.name == "a" else fmu(gain())
    ).splitlines() == [
        f"blocks.a: {broken}: found a zip that is cut off or damaged, allowed: an FMU, such as"
        " urmpipe fmu build makes of a unit",
        f"blocks.b: found inputs without a source: u; {ALLOWED}",
    ]


@pytest.mark.parametrize(
    ("found", "replaced", "told_as"),
    [
        (
            "CoSimulation",
            "ModelExchange",
            "found FMI 2.0 for modelExchange, allowed: FMI 2.0 for coSimulation",
        ),
        ('modelIdentifier="gain"', 'modelIdentifier="loss"', "found binaries for {here}, allowed: {binary}"),
        ("<Real", "<Imaginary", "modelDescription.xml cannot be read: "),
        ('start="1"', 'min="low"', "cannot be read as an FMU: could not convert string to float: 'low'"),
    ],
)
def test_an_fmu_of_another_kind_is_told(tmp_path: Path, found: str, replaced: str, told_as: str) -> None:
    import fmpy

    old, new = found.encode(), replaced.encode()
    other = tmp_path / "other.fmu"
    copy_changed(fmu(gain()), other, "modelDescription.xml", lambda data: data.replace(old, new))
    with pytest.raises(CosimulationError) as caught:
        prepare(system({"a": gain()}), lambda block: other)
    binary = f"binaries/{fmpy.platform}/loss{fmpy.sharedLibraryExtension}"
    assert str(caught.value).startswith(
        f"blocks.a: {other}: {told_as.format(here=fmpy.platform, binary=binary)}"
    )


def test_an_fmu_of_fmi_3_is_told(tmp_path: Path) -> None:
    other = tmp_path / "other.fmu"
    with zipfile.ZipFile(other, "w") as made:
        made.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="3.0" modelName="three" instantiationToken="3"><CoSimulation'
            ' modelIdentifier="three"/><ModelVariables><Float64 name="time" valueReference="0"'
            ' causality="independent" variability="continuous"/></ModelVariables><ModelStructure/>'
            "</fmiModelDescription>",
        )
    assert refusal(CosimulationError, prepare, system({"a": gain()}), lambda block: other) == (
        f"blocks.a: {other}: found FMI 3.0 for coSimulation, allowed: FMI 2.0 for coSimulation"
    )


def test_an_fmu_that_lives_alone_is_one_block() -> None:
    alone = gain("alone", once=True)
    assert told({"a": alone, "b": alone}, None, {"a": {"u": 0.0}, "b": {"u": 0.0}}) == [
        f"blocks.b: {fmu(alone)} can be instantiated only once in a system"
    ]
