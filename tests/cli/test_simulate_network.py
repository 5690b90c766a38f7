"""Systems in which a log or a set point moves a kinematic network: closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import urmpipe
from pages import files_of_pages

LIFT = """
[system]
step = "10ms"
[blocks.log]
unit = "log_source"
log = "stroke.csv"
columns = ["stroke"]
interpolate = true
[blocks.boom]
unit = "network_motion"
network = "parts/boom.toml"
controls = { stroke = "0.8m" }
[connections]
"boom.stroke" = "log.stroke"
"""


@pytest.mark.slow
def test_a_log_moves_a_network_of_a_file_in_the_folder_of_the_system(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "boom.toml").write_text(files_of_pages()["boom.toml"], encoding="utf-8")
    (tmp_path / "lift.toml").write_text(LIFT, encoding="utf-8")
    rows = [f"{k / 100:.2f},{0.8 + 0.3 * math.sin(k / 100):.17g}\n" for k in range(101)]
    (tmp_path / "stroke.csv").write_text("t (s),stroke (m)\n" + "".join(rows), encoding="utf-8")
    result = urmpipe.simulate(tmp_path / "lift.toml", output=tmp_path / "lift.rrd")
    assert "boom.toml" in {one.name for one in result.provenance.inputs}
    stroke, pivot = (result.signal(name).values for name in ("log.stroke", "boom.pivot"))
    assert (len(stroke), float(stroke[0])) == (101, 0.8)
    length = np.abs(0.8 * np.exp(1j * pivot) - (0.6 - 0.3j))
    np.testing.assert_allclose(length, stroke, rtol=0.0, atol=1e-11)
    assert np.ptp(pivot) > 0.3
    urmpipe.report(tmp_path / "lift.rrd", output=tmp_path / "lift.html")
    assert "boom.pivot" in (tmp_path / "lift.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_shipped_four_bar_keeps_the_lengths_of_its_links_over_two_turns() -> None:
    result = urmpipe.simulate("crank-rocker")
    crank, rocker = (result.signal(f"linkage.{name}").values for name in ("theta2", "theta4"))
    np.testing.assert_array_equal(crank, result.signal("set_point.theta").values)
    assert crank[-1] == pytest.approx(4.0 * math.pi, abs=1e-12)
    pin = 0.4 * np.exp(1j * crank)
    # the coupler is 0.9 m long from the pin to the end of the rocker, which is 0.7 m from (1, 0) m
    assert np.abs(np.abs(1.0 + 0.7 * np.exp(1j * rocker) - pin) - 0.9).max() < 1e-11
    tracer = result.signal("linkage.tracer").values
    assert np.abs(np.hypot(*(tracer[:, :2].T - [pin.real, pin.imag])) - math.hypot(0.45, 0.3)).max() < 1e-12
