"""Compute the figures of docs/drives.md, and draw its picture.

    python docs/drive_figures.py

What `urmpipe simulate one-drive` does is done here by a loop of a few lines, so that many starts can run
side by side: a start at each unit vector gives the map of a step, whose spectral radius says if it is stable.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from urmpipe_fmus.blocks.drives import dc_drive, drive_controller, inertia, set_point
from urmpipe_fmus.instance import Instance
from urmpipe_models.elementwise import Element, FloatArray

PICTURE = Path(__file__).resolve().parent / "pictures" / "drives.svg"
PERIOD = 5e-3
STEPS = (5e-3, 2.5e-3, 1e-3, 5e-4)
INERTIAS = (2.0, 1.6, 1.2, 0.8, 0.4, 0.2)
STATES = ("drive.theta1", "drive.omega1", "drive.i_a", "load.theta", "load.omega", "controller.last")
WIRES = (
    ("drive.theta2", "load.theta"),
    ("drive.omega2", "load.omega"),
    ("load.tau", "drive.Mk"),
    ("controller.set_theta", "set_point.theta"),
    ("controller.set_omega", "set_point.omega"),
    ("controller.set_alpha", "set_point.alpha"),
    ("controller.real_theta", "load.theta"),
    ("controller.real_omega", "load.omega"),
    ("controller.real_alpha", "load.alpha"),
    ("drive.u", "controller.u"),
)
"""Destination and source of every connection, each after what its source depends on."""


class OneDrive:
    """Set point, controller, drive and load, coupled at communication points."""

    def __init__(self, **starts: Element) -> None:
        """Start the four units; `drive__k=2500.0` sets a parameter or a state."""
        self.units = {
            "set_point": Instance(set_point()),
            "controller": Instance(drive_controller()),
            "drive": Instance(dc_drive()),
            "load": Instance(inertia()),
        }
        for name, value in starts.items():
            self.put(name.replace("__", "."), value)

    def put(self, name: str, value: Element) -> None:
        """Set a variable, `block.variable`."""
        block, variable = name.split(".")
        self.units[block].set([self.units[block].reference(variable)], [value])

    def read(self, *names: str) -> list[Element]:
        """Return variables, each `block.variable`."""
        places = [(self.units[block], variable) for block, variable in (name.split(".") for name in names)]
        return [unit.get([unit.reference(variable)])[0] for unit, variable in places]

    def exchange(self) -> None:
        """Carry the values over every connection."""
        for destination, source in WIRES:
            self.put(destination, self.read(source)[0])

    def step(self, time: float, step: float) -> None:
        """Go from a communication point to the next, whose values are exchanged then."""
        for unit in self.units.values():
            unit.do_step(time, step)
        self.exchange()


def simulated(system: OneDrive, step: float, duration: float, *names: str) -> FloatArray:
    """Return variables at the communication points, shape (points, len(names)), or (.., runs) with many."""
    system.exchange()
    found = [system.read(*names)]
    for k in range(round(duration / step)):
        system.step(k * step, step)
        found.append(system.read(*names))
    return np.array(found, dtype=np.float64)


def step_map(step: float, **starts: float) -> FloatArray:
    """Return the matrix that takes the states over a period of the controller, its set point at rest in 0.

    Args:
        step: Communication step in [s], a whole part of the controller's period.
        starts: Parameters, as `OneDrive` takes them.
    """
    quiet = {"set_point__target": 0.0, "controller__u_max": 1e12}
    units = {name.replace(".", "__"): one for name, one in zip(STATES, np.eye(len(STATES)), strict=True)}
    system = OneDrive(**quiet, **units, **starts)
    return np.asarray(simulated(system, step, PERIOD, *STATES)[-1])


def spectral_radius(step: float, **starts: float) -> float:
    """Return the largest magnitude of an eigenvalue of `step_map`: stable below 1."""
    return float(np.abs(np.linalg.eigvals(step_map(step, **starts))).max())


def least_inertia(step: float, low: float = 1e-4, high: float = 1.0) -> float:
    """Return the load's inertia in [kg.m2] below which a communication step is not stable, by bisection."""
    while high - low > 1e-5:
        middle = 0.5 * (low + high)
        stable = spectral_radius(step, load__J=middle) < 1.0
        low, high = (low, middle) if stable else (middle, high)
    return high


def table() -> list[str]:
    """Return the page's table of stability, a line a communication step."""
    lines = []
    for step in STEPS:
        radii = " | ".join(f"{spectral_radius(step, load__J=load):.3f}" for load in INERTIAS)
        lines.append(f"| {step * 1e3:g} ms | {radii} | {least_inertia(step):#.2g} |")
    return lines


def curve(x: FloatArray, y: FloatArray, style: str) -> str:
    """Return a line of the picture, of x in [s] and y in [rad]."""
    points = " ".join(f"{60 + 360 * a:.1f},{230 - 150 * b:.1f}" for a, b in zip(x, y, strict=True))
    return f'<polyline points="{points}" fill="none" {style}/>'


def picture() -> str:
    """Return the picture: set point, and what the joint does with eq. 20's plus and with its minus."""
    step, duration = 1e-3, 1.5
    t = np.arange(0.0, duration + step / 2, step)
    wanted, real = simulated(OneDrive(), step, duration, "set_point.theta", "load.theta").T
    minus = {"controller__Kphi": -7.5, "controller__Kw": -0.75, "controller__Keps": -0.01}
    away = simulated(OneDrive(**minus), step, duration, "load.theta")[:, 0]
    seen = away > -0.35
    text = 'font-family="sans-serif" font-size="12" fill="#333"'
    marks = [
        f'<text x="{60 + 360 * at:.0f}" y="305" text-anchor="middle" {text}>{at:g} s</text>'
        for at in (0.0, 0.5, 1.0, 1.5)
    ] + [
        f'<text x="52" y="{234 - 150 * at:.0f}" text-anchor="end" {text}>{at:g} rad</text>'
        for at in (0.0, 0.5, 1.0)
    ]
    named = [
        f'<text x="310" y="110" {text}>set point (dashed) and joint: plus</text>',
        f'<text x="165" y="275" {text}>joint: minus, as printed</text>',
    ]
    return "\n".join(
        [
            '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 320" width="640" height="320">',
            '<rect width="640" height="320" fill="#fff"/>',
            '<path d="M60 60V290H600" fill="none" stroke="#888"/>',
            curve(t[::5], wanted[::5], 'stroke="#888" stroke-dasharray="5 4" stroke-width="1.5"'),
            curve(t[::5], real[::5], 'stroke="#1f77b4" stroke-width="2"'),
            curve(t[seen][::5], away[seen][::5], 'stroke="#d62728" stroke-width="2"'),
            *marks,
            *named,
            "</svg>\n",
        ]
    )


if __name__ == "__main__":
    sys.stdout.write("\n".join(table()) + "\n")
    PICTURE.write_text(picture(), encoding="utf-8")
