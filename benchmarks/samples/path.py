"""The sample path A_s: four curves in space round the arm's first axis, with a corner between each two.

The number of samples, their period and the point where it starts are those of [UrmArm2021]_, eq. 22 and
section 2.4; its shape is ours.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray

Curve: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Radius [m], azimuth [turns] and height [m] about the arm's first axis, of a parameter 0..1."""

SAMPLES, PERIOD = 7383, 0.005
TIMES: FloatArray = PERIOD * np.arange(SAMPLES, dtype=np.float64)
"""t = 0.005 (s - 1) in [s], s = 1..7383."""
BEGIN = (0.167397124, 0.0, 1.102644902)
"""p7([0, pi, 0, pi, 0, pi]) in [m]."""


def ease(u: FloatArray | float) -> FloatArray:
    """Return the step 10 u^3 - 15 u^4 + 6 u^5 from 0 to 1, with two continuous derivatives."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u**3 * (10.0 + u * (6.0 * u - 15.0)), dtype=np.float64)


def eased_time(u: FloatArray) -> FloatArray:
    """Return the integral of `ease`: u^4 (5/2 - 3 u + u^2), and u - 1/2 from 1 on."""
    u = np.maximum(u, 0.0)
    return np.where(u < 1.0, u**4 * (2.5 + u * (u - 3.0)), u - 0.5)


def helix(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Leave the calibration pose along y, the one direction it can move in, and wind down and outward."""
    way = u * u * (3.0 - 2.0 * u)
    x, _, z = BEGIN
    return x + (0.48 - x) * way, 1.4 * u, z + (0.48 - z) * way


def crown(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run back round a cylinder, up and down in four waves."""
    return np.full_like(u, 0.48), 1.4 - 1.1 * u, 0.48 + 0.1 * np.sin(8.0 * np.pi * u)


def petals(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Draw three petals round the axis, sinking."""
    return 0.48 - 0.05 * (1.0 - np.cos(6.0 * np.pi * u)), 0.3 + u, 0.48 - 0.14 * u


def climb(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rise straight up, and lean into a spiral."""
    return 0.48 - 0.13 * u, 1.3 + 0.6 * u * u * (3.0 - u), 0.34 + 0.2 * u * (3.0 - u)


STRETCHES: tuple[tuple[Curve, float], ...] = ((helix, 0.50), (crown, 0.59), (petals, 0.52), (climb, 0.57))
"""The curves between the path's corners, each with the speed in [m/s] that it is run at."""


class SamplePath:
    """The path A_s as a function of time: it rests at its start, at each corner and at its end.

    A stretch of length L takes L / V + ramp: its speed eases from 0 to V over one ramp and back over
    another. The ramp is the time that the last sample at 36.910 s leaves.
    """

    def __init__(self) -> None:
        self.u = np.linspace(0.0, 1.0, 20001)
        self.arcs = [arc_length(on_curve(curve, self.u)) for curve, _ in STRETCHES]
        cruise = np.array([arc[-1] / speed for arc, (_, speed) in zip(self.arcs, STRETCHES, strict=True)])
        self.ramp = float((TIMES[-1] - cruise.sum()) / len(STRETCHES))
        self.durations = cruise + self.ramp
        self.corners = np.cumsum(self.durations)[:-1]

    def at(self, t: FloatArray) -> FloatArray:
        """Return the positions in [m], shape (n, 3), at times in [s]."""
        position = np.empty((len(t), 3))
        stretch = np.searchsorted(self.corners, t, side="right")
        for k, (curve, speed) in enumerate(STRETCHES):
            on = stretch == k
            since = t[on] - self.durations[:k].sum()
            brake = since - self.durations[k] + self.ramp
            run = speed * self.ramp * (eased_time(since / self.ramp) - eased_time(brake / self.ramp))
            position[on] = on_curve(curve, np.interp(run, self.arcs[k], self.u))
        return position


def on_curve(curve: Curve, u: FloatArray) -> FloatArray:
    """Return the positions in [m], shape (n, 3), at the parameters u."""
    radius, turns, height = curve(u)
    return np.stack(
        [radius * np.cos(2.0 * np.pi * turns), radius * np.sin(2.0 * np.pi * turns), height], axis=1
    )


def arc_length(position: FloatArray) -> FloatArray:
    """Return the way in [m] from the first point to each, shape (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
