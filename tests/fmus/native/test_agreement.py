"""An FMU does what an instance in Python does."""

from __future__ import annotations

import numpy as np
import pytest

from urmpipe_fmus.block import Input, Parameter
from urmpipe_fmus.build.description import Backend
from urmpipe_fmus.instance import Instance
from written_units import NAMES, loaded, unit_of


def random_value(one: Input | Parameter, random: np.random.Generator) -> float:
    """A value that the variable takes, near its start or in its range."""
    if one.type == "Boolean":
        return float(random.integers(2))
    value = float(random.uniform(max(one.minimum, 0.05), min(one.maximum, 8.0)))
    return float(round(value)) if one.type == "Integer" else value


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "backend"), [("oscillator", "native"), *((name, "python") for name in (*NAMES, "oscillator"))]
)
def test_every_value_is_that_of_the_instance_after_each_set_and_step(name: str, backend: Backend) -> None:
    model, random = unit_of(name), np.random.default_rng(5)
    fmu, instance = loaded(name, backend, start=0.02), Instance(model)
    instance.setup_experiment(0.02)
    names = [scalar for scalar, _ in model.scalars]

    def assert_same() -> None:
        values = zip(names, map(float, instance.get(range(len(names)))), strict=True)
        expected = [value if fmu.types[one] == "Real" else round(value) for one, value in values]
        # bit by bit, but for some units in the last place by which C's elementary functions differ
        tolerance = 1e-12 if backend == "native" else 0.0
        np.testing.assert_allclose(fmu.get(names), expected, rtol=tolerance, atol=tolerance)

    for k in range(200 if backend == "native" else 40):
        for reference, (scalar, one) in enumerate(model.scalars):
            if isinstance(one, Input) or (isinstance(one, Parameter) and one.tunable and k % 10 == 0):
                value = random_value(one, random)
                fmu.set(scalar, int(value) if one.type != "Real" else value)
                instance.set([reference], [value])
        assert_same()
        fmu.do_step(0.02 + k * 0.0073, 0.0073)
        instance.do_step(0.02 + k * 0.0073, 0.0073)
    assert_same()


def test_a_table_gives_the_rows_that_python_finds() -> None:
    model, fmu = unit_of("player"), loaded("player").fmu
    half = 10_000_000.5e-9
    times = [0.0, 4.999e-3, 0.01, np.nextafter(0.01, 0), 0.0175, 0.025, 0.03, half, -5e-9, -4.5e-9, -1.0]
    for time in times:
        fmu.reset()
        assert fmu.getReal([0]) == [2.0]  # at the start time that it has by default
        fmu.setupExperiment(startTime=time)
        assert fmu.getReal([0, 1, 2]) == [float(one) for one in Instance(model, time).get([0, 1, 2])]
