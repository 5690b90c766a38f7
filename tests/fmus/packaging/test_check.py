"""A check of an FMU of urmpipe finds nothing, and gives the values of an instance."""

from __future__ import annotations

import pytest

from urmpipe_fmus.build.description import Backend
from urmpipe_fmus.check import check_fmu
from urmpipe_fmus.instance import Instance
from written_units import NAMES, fmu_of, unit_of


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["python", "native"])
@pytest.mark.parametrize("name", NAMES)
def test_a_good_fmu_has_no_problems_and_the_values_of_an_instance(name: str, backend: Backend) -> None:
    model, found = unit_of(name), check_fmu(fmu_of(name, backend))
    instance, everything = Instance(model), range(len(model.scalars))
    before = [float(one) for one in instance.get(everything)]
    for k in range(found.steps):
        instance.do_step(k * found.step, found.step)
    assert (found.problems, found.ran, found.name) == ((), True, name)
    assert [one.name for one in found.variables] == [scalar for scalar, _ in model.scalars]
    # Native code may round the last bit of a function of the C library otherwise than NumPy.
    assert [one.before for one in found.variables] == pytest.approx(before, rel=1e-14, abs=1e-15)
    after = [float(one) for one in instance.get(everything)]
    assert [one.after for one in found.variables] == pytest.approx(after, rel=1e-13, abs=1e-15)
