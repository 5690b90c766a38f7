"""The bundled logs: what each was made with is what a diagnosis names."""

from __future__ import annotations

import numpy as np
import pytest

import urmpipe
from urmpipe_datasets import LOGS
from urmpipe_pipeline.diagnosis.result import Diagnosis

pytestmark = pytest.mark.filterwarnings("ignore::urmpipe.UrmpipeWarning")


def diagnosed(name: str) -> Diagnosis:
    """Return the diagnosis of a bundled log against the bundled path."""
    return urmpipe.diagnose(LOGS / "path.csv", LOGS / name, robot="urm6")


@pytest.mark.slow
def test_a_module_that_turns_the_other_way() -> None:
    found = diagnosed("counter_rotating.csv")
    (cause,) = found.causes
    assert (cause.kind, cause.name, cause.joints) == ("joint_sign", "phi3", ("q3",))
    assert found.undecided == ()
    assert (found.verdict, round(1e3 * found.rms, 2)) == ("fail", 416.57)
    assert found.remainder.rms < 1e-6


@pytest.mark.slow
def test_a_log_that_starts_4_ms_late() -> None:
    found = diagnosed("matlab.csv")
    (cause,) = found.causes
    assert (cause.kind, found.undecided) == ("time_lag", ())
    assert cause.value[0] == pytest.approx(-4e-3, abs=2e-5)
    assert cause.low[0] < -4e-3 < cause.high[0]
    assert (found.verdict, round(1e3 * found.rms, 2)) == ("pass", 1.61)
    assert found.remainder.rms < 2e-5


@pytest.mark.slow
def test_a_base_that_stands_elsewhere_and_its_twin() -> None:
    found = diagnosed("solidworks")
    (cause,) = found.causes
    assert (cause.kind, found.undecided) == ("base_shift", ())
    np.testing.assert_allclose(cause.value, (1.5e-3, -1.2e-3, 1.6e-3), rtol=0, atol=1e-6)
    assert cause.twins == ("r1 (z)",)  # the first module stands on the base: its height is the base's
    assert found.remainder.rms < 1e-6


@pytest.mark.slow
def test_what_a_damped_inverse_leaves_has_no_cause_that_explains_much() -> None:
    found = diagnosed("coppeliasim.csv")
    told = [*found.causes, *(cause for one in found.undecided for cause in one.causes)]
    assert all(cause.share < 0.2 for cause in told)
    assert found.remainder.share > 0.8
