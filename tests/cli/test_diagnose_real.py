"""Real logs whose causes are known from elsewhere: a calibration file, a library's rounded parameters."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

import urmpipe
from urmpipe_pipeline.diagnosis.causes import Cause
from urmpipe_pipeline.diagnosis.result import Diagnosis

LOGS = Path(__file__).resolve().parents[3] / "shared" / "logs"

pytestmark = [
    pytest.mark.skipif(not LOGS.is_dir(), reason="needs the logs of others, which are not bundled"),
    pytest.mark.filterwarnings("ignore::urmpipe.UrmpipeWarning"),
]


def by_name(found: Diagnosis) -> dict[str, Cause]:
    """Return the causes by what they are of."""
    return {one.name: one for one in found.causes}


@pytest.mark.slow
def test_the_tilts_of_a_ur5e_are_those_that_its_factory_measured() -> None:
    """The controller's own calibration.conf has them: delta_alpha, a value a joint in [rad]."""
    folder = LOGS / "ur5-factory-calibration"
    line = next(
        one for one in (folder / "calibration.conf").read_text("utf-8").splitlines() if "delta_alpha" in one
    )
    delta_alpha = tomllib.loads(line)["delta_alpha"]
    found = urmpipe.diagnose(folder / "joint-eef-data.csv", robot="ur5e")
    assert found.causes[0].name == "alpha_3"
    tilts = {one.name: one for one in found.causes if one.kind == "tilt"}
    for name, tilt in tilts.items():
        measured = delta_alpha[int(name.removeprefix("alpha_")) - 1]
        assert tilt.low[0] < measured < tilt.high[0], name


@pytest.mark.slow
def test_the_poses_of_a_library_that_rounds_a_ur10() -> None:
    """It has d_1 = 118, a_2 = -612.7 and a_3 = -571.6 mm; the data sheet 127.3, -612 and -572.3 mm."""
    path = LOGS / "pybotics-ur10-fk" / "ur10-joints-poses.csv"
    found = urmpipe.diagnose(path, robot="ur10")
    causes = by_name(found)
    assert set(causes) == {"base", "a_2", "a_3"}
    assert causes["base"].axis == (0.0, 0.0, 1.0)
    assert "d_1" in causes["base"].equivalents
    for name, rounded in (("base", -9.3e-3), ("a_2", -0.7e-3), ("a_3", 0.7e-3)):
        assert causes[name].value[0] == pytest.approx(rounded, abs=2e-5)
        assert causes[name].low[0] < rounded < causes[name].high[0]
    assert found.undecided == ()


@pytest.mark.slow
def test_poses_that_a_laser_tracker_measured_have_the_arms_own_geometry_and_no_cause() -> None:
    found = urmpipe.diagnose(LOGS / "ur10-laser-tracker" / "measurements_grid.csv", robot="ur10")
    assert (found.verdict, found.causes, found.undecided) == ("pass", (), ())
    assert found.unexplained.interpretation == "the arm's own geometry, as a calibration finds it"
