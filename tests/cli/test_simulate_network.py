"""A system in which a log, a set point or a drive moves a kinematic network."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import urmpipe as api

RunCommand = Callable[..., Any]

BOOM = """
name = "boom"
length_unit = "mm"
angle_unit = "deg"
[controls.stroke]
start = 900
lower = 700
upper = 1200
[bodies]
boom = {}
[joints.pivot]
kind = "revolute"
bodies = ["ground", "boom"]
n = [0, 0, 1]
start = 40
[elements.cylinder]
kind = "gg"
bodies = ["ground", "boom"]
a = [[600, -300, 0], [800, 0, 0]]
d = "stroke"
"""
SYSTEM = """
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
points = ["boom:1,0,0"]
[connections]
"boom.stroke" = "log.stroke"
"""


@pytest.mark.slow
def test_a_log_moves_a_network_of_a_file_beside_the_system(urmpipe: RunCommand, tmp_path: Path) -> None:
    folder = tmp_path / "systems"
    (folder / "parts").mkdir(parents=True)
    (folder / "parts" / "boom.toml").write_text(BOOM, encoding="utf-8")
    (folder / "lift.toml").write_text(SYSTEM, encoding="utf-8")
    t = np.arange(101) * 0.01
    rows = (f"{time:.2f},{0.8 + 0.3 * math.sin(time):.17g}" for time in t)
    (folder / "stroke.csv").write_text("\n".join(["t (s),stroke (m)", *rows]) + "\n", encoding="utf-8")
    result = api.simulate(folder / "lift.toml", output=tmp_path / "lift.rrd")
    assert "boom.toml" in {one.name for one in result.provenance.inputs}
    stroke, pivot = (result.signal(name).values for name in ("log.stroke", "boom.pivot"))
    assert (len(stroke), float(stroke[0])) == (101, 0.8)
    length = np.abs(0.8 * np.exp(1j * pivot) - (0.6 - 0.3j))
    np.testing.assert_allclose(length, stroke, rtol=0.0, atol=1e-11)
    assert np.ptp(pivot) > 0.3
    report = urmpipe("report", "lift.rrd", "-o", "lift.html")
    assert (report.code, "boom.pivot" in (tmp_path / "lift.html").read_text(encoding="utf-8")) == (0, True)


@pytest.mark.slow
def test_the_shipped_four_bar_keeps_the_lengths_of_its_links_over_two_turns() -> None:
    result = api.simulate("crank-rocker")
    crank, rocker = (result.signal(f"linkage.{name}").values for name in ("theta2", "theta4"))
    np.testing.assert_array_equal(crank, result.signal("set_point.theta").values)
    assert crank[-1] == pytest.approx(4.0 * math.pi, abs=1e-12)
    pin = 0.4 * np.exp(1j * crank)
    # the coupler is 0.9 m long from the pin to the end of the rocker, which is 0.7 m from (1, 0) m
    assert np.abs(np.abs(1.0 + 0.7 * np.exp(1j * rocker) - pin) - 0.9).max() < 1e-11
    tracer = result.signal("linkage.tracer").values
    assert np.abs(np.hypot(*(tracer[:, :2].T - [pin.real, pin.imag])) - math.hypot(0.45, 0.3)).max() < 1e-12
