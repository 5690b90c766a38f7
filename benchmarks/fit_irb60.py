"""One set of parameters for Fig. 7 of the paper: fits what irb60.toml calls fitted, within its ranges.

python benchmarks/fit_irb60.py [--rounds 69] [--seed 1]

No term depends on the velocity. It prints the numbers that irb60.toml is to hold, then the figures that they
give. What the file holds is measured by benchmarks/accuracy.py.

Source: [Iso9283] section 5, Fig. 7.
"""

from __future__ import annotations

import argparse
import copy
import math
import sys
import time
import tomllib
from dataclasses import replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from bare_fmu import BareFmu
from scipy.optimize import Bounds, OptimizeResult, differential_evolution

import urmpipe
from urmpipe.driven_runs import ArmUnit
from urmpipe_datasets import ROBOTS
from urmpipe_fmus.block import Memory, Parameter, State
from urmpipe_fmus.blocks.driven_arm import driven_arm
from urmpipe_fmus.build.fmu import cached_fmu
from urmpipe_models.arm.chain import Chain
from urmpipe_models.dynamics.driven_arm import spectral_radius
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import RobotError
from urmpipe_models.robots.toml import chain_from_dict
from urmpipe_pipeline.accuracy.published import FIG7, fig7_rows
from urmpipe_pipeline.planned_paths.result import PlannedPath

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "shared"))

from assumed_ranges import Place, assumed

FILE = ROBOTS / "irb60.toml"
COUNTERWEIGHT = "crank3"
DRIVEN = ("theta1", "theta2", "theta3")
SHARED = ("Kphi", "Kw", "Keps", "u_max", "C", "I1", "k", "l")
"""The same of all three drives."""

FREE: tuple[Place, ...] = (
    *(("drives.theta1", key, None) for key in SHARED),
    ("drives.theta4", "l", None),
    ("inertials.theta4", "mass", None),
    ("inertials.theta4", "centre", 0),
    ("inertials.theta4", "centre", 2),
    (f"inertials.{COUNTERWEIGHT}", "mass", None),
)
BY_DECADES = len(SHARED) + 1
"""So many of them, the first, are searched by their logarithms."""

DIGITS = 3
"""Of what is printed."""

SLOW = 0.3
"""Up to this velocity in [m/s] no drive may be at its voltage limit."""

STABLE = 0.993
"""Spectral radius of the sampled loop that is asked for: disturbances fall to a half within 0.5 s."""

AIMED = 1.35
"""Within this factor of each point; it has to be 1.5."""

RUNNING = (0.34e-3, 0.50e-3)
"""Error at 0.1 m/s in [m] that puts the running speed for 0.4 mm between 0.08 and 0.12 m/s."""

RISING = (17.5e-3, 25e-3)
"""Error at 0.5 m/s in [m], of which is printed that it is more than 17 mm."""

POSES = 6
"""Poses along the contour at which the sampled loop is looked at."""


@cache
def base() -> dict[str, Any]:
    """Return the file as a dictionary, drives and wrist as they stand."""
    return tomllib.loads(FILE.read_text(encoding="utf-8"))


def bounds() -> FloatArray:
    """Return least and largest of what is fitted, shape (free, 2)."""
    known = assumed(FILE)
    return np.array([known[place][1:] for place in FREE])


def values_at(share: FloatArray) -> FloatArray:
    """Return what is fitted by its place within the ranges, 0..1; as many digits as are printed."""
    low, high = bounds().T
    found = low + (high - low) * share
    n = BY_DECADES
    found[:n] = low[:n] * (high[:n] / low[:n]) ** share[:n]
    return np.array([float(f"{one:.{DIGITS}g}") for one in found])


def arm_of(values: FloatArray) -> Chain:
    """Return irb60 with other values of what is fitted, at rest where the contour begins."""
    data = copy.deepcopy(base())
    for (table, key, element), value in zip(FREE, values.tolist(), strict=True):
        kind, joint = table.split(".")
        owner = data["drives"][joint] if kind == "drives" else inertial_of(data, joint)
        if element is None:
            owner[key] = value
        else:
            owner[key][element] = value
    for joint in DRIVEN[1:]:
        data["drives"][joint] |= {key: data["drives"][DRIVEN[0]][key] for key in SHARED}
    return chain_from_dict({**data, "start": start()})


def inertial_of(data: dict[str, Any], joint: str) -> dict[str, Any]:
    """Return the mass of a joint."""
    found: dict[str, Any] = next(one for one in data["inertials"] if one["joint"] == joint)
    return found


@cache
def start() -> list[float]:
    """Return where the contour begins in [rad]."""
    joints = urmpipe.plan(fig7_rows(), robot="irb60", velocity=1.0).joints
    assert joints is not None
    found: list[float] = joints.q[0].tolist()
    return found


@cache
def plan(velocity: float) -> PlannedPath:
    """Return the contour at a velocity."""
    return urmpipe.plan(fig7_rows(), robot="irb60", velocity=velocity)


@cache
def unpacked() -> tuple[Path, str, str, dict[str, int]]:
    """Return the FMU of the arm: folder, identifier, GUID, references; what is fitted are its parameters."""
    from fmpy import extract, read_model_description

    folder = extract(str(cached_fmu(driven_arm(chain_from_dict({**base(), "start": start()})), "native")))
    model = read_model_description(folder)
    references = {one.name: one.valueReference for one in model.modelVariables}
    return Path(folder), model.coSimulation.modelIdentifier, model.guid, references


def error_at(arm: ArmUnit, velocity: float) -> tuple[float, float]:
    """Return the largest error in [m] at a velocity, and the share of samples at a voltage limit."""
    folder, identifier, guid, references = unpacked()
    kept = (one for one in arm.unit.variables if isinstance(one, (Parameter, State, Memory)))
    pairs = (pair for one in kept for pair in zip(one.names, one.starts, strict=True))
    starts = {references[name]: start for name, start in pairs}
    instance = BareFmu(folder, identifier, guid, starts)
    path = plan(velocity)
    given, values = arm.set_points(path), np.empty((len(path), len(arm.outputs)))
    row_in, row_out = np.empty(given.shape[1]), np.empty(values.shape[1])
    feed = instance.exchange("fmi2SetReal", [references[one] for one in arm.inputs], row_in)
    read = instance.exchange("fmi2GetReal", [references[one] for one in arm.outputs], row_out)
    failed: object = 0
    for k in range(len(path)):
        row_in[:] = given[k]
        failed = feed() or read() or instance.do_step(k * path.tsp, path.tsp, 1)
        if failed:
            break
        values[k] = row_out
    instance.close()
    found = arm.motion(path, velocity, values, failed=False).errors
    return (math.inf, 1.0) if failed or found.error is None else (found.error, found.saturated_share)


def figures(values: FloatArray) -> tuple[float, list[tuple[float, float]]] | None:
    """Return the largest spectral radius along the contour, and what each velocity gives; None without.

    The loop is to be stable without the counterweight, too: irb60-spring has none.
    """
    robot = arm_of(values)
    arm = ArmUnit(robot, (0.0, 0.0, 0.0))
    joints = plan(FIG7[0].velocity).joints
    assert joints is not None
    poses = np.linspace(0, len(joints.q) - 1, POSES).astype(int)
    lighter = replace(robot, inertials=tuple(one for one in robot.inertials if one.joint != COUNTERWEIGHT))
    radius = max(spectral_radius(one, joints.q[k]) for one in (robot, lighter) for k in poses)
    try:
        return radius, [error_at(arm, one.velocity) for one in FIG7]
    except RobotError:
        return None


def cost(share: FloatArray) -> float:
    """Return how far a set is from what is asked for: squares of logarithms, and of what is out of bounds."""
    found = figures(values_at(share))
    if found is None:
        return 1e3
    radius, each = found
    errors = np.clip([error for error, _ in each], 1e-9, 1e3)
    off = np.log(errors / [one.error for one in FIG7])
    off[LEAST] = 0.0
    wide = np.maximum(np.abs(off) - math.log(AIMED), 0.0).sum()
    at_limit = sum(share for one, (_, share) in zip(FIG7, each, strict=True) if one.velocity <= SLOW)
    bounds = (
        beyond(errors[0], RUNNING)
        + beyond(errors[LEAST], RISING)
        + at_limit
        + 10.0 * max(0.0, radius - STABLE)
    )
    return float((off**2).sum() + 5.0 * wide + 20.0 * bounds)


def beyond(value: float, span: tuple[float, float]) -> float:
    """Return by how much, as a logarithm, a value is outside of a span."""
    return max(0.0, math.log(span[0] / value), math.log(value / span[1]))


LEAST = next(k for k, one in enumerate(FIG7) if one.least)


def main() -> None:
    """Fit, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=69)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    began, known = time.monotonic(), figures(values_at(np.full(len(FREE), 0.5)))  # builds what all share
    print(f"in the middle of all ranges: {known}")

    def told(intermediate_result: OptimizeResult) -> None:
        """Tell how far it is."""
        print(f"{time.monotonic() - began:6.0f} s: {intermediate_result.fun:.4f}", flush=True)

    box = Bounds(np.zeros(len(FREE)), np.ones(len(FREE)))
    with get_context("fork").Pool() as pool:
        found = differential_evolution(
            cost, box, popsize=3, maxiter=options.rounds, seed=options.seed, workers=pool.map,
            updating="deferred", polish=False, tol=0.0, mutation=(0.4, 0.9), recombination=0.8, callback=told,
        )  # fmt: skip
    values = values_at(found.x)
    for (table, key, element), value in zip(FREE, values.tolist(), strict=True):
        print(f"[{table}] {key}{'' if element is None else f'[{element}]'} = {value:g}")
    result = figures(values)
    assert result is not None
    print(f"spectral radius {result[0]:.6f}")
    for one, (error, share) in zip(FIG7, result[1], strict=True):
        ratio = error / one.error
        print(f"{one.velocity:g} m/s: {1e3 * error:.4g} mm, {ratio:.3f} of Fig. 7, {share:.1%} at a limit")


if __name__ == "__main__":
    main()
