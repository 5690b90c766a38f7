"""Measure how often a diagnosis names the cause that is there, and how often one that is not.

Every trial alters an arm or its log in a known way, adds noise and searches. Trials are seeded, and two
processes share them: set OMP_NUM_THREADS=1. `--only` runs some of the parts and keeps no results.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import combinations
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from pairs import Bound, machine, timed, write_results
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "shared"))

from altered_arm import (
    DURATION,
    PERIOD,
    Noise,
    Numbers,
    altered,
    demo_motion,
    drifting,
    fine,
    named,
    names_of,
    noisy,
    nominal,
    poses,
    rich_motion,
    rippled,
    search_of,
    slack,
    spoilt,
    times,
    uniform,
)
from altered_log import POSES, TRACKER, diagnosed, diagnosed_record, drawn, tracked
from made_runs import path_run, run_of
from rail_arm import rail_arm
from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_pipeline.comparison.compare import compare_runs, trajectory
from urmpipe_pipeline.comparison.matching import match
from urmpipe_pipeline.diagnosis.arm import ArmModel
from urmpipe_pipeline.diagnosis.diagnose import diagnose
from urmpipe_pipeline.diagnosis.explain import ExplanationBuilder as Explained
from urmpipe_pipeline.diagnosis.fit import Rows, normal_equations
from urmpipe_pipeline.diagnosis.hypotheses import Group
from urmpipe_pipeline.diagnosis.result import rms
from urmpipe_pipeline.diagnosis.search import Search
from urmpipe_pipeline.diagnosis.sides import Side
from urmpipe_pipeline.log_edits import Edit, Edits, sign_edits

LONG, SHORT = 7383, 50
"""Samples of a log: those of the bundled path, and few."""

SIZES: Mapping[str, float] = {
    "link_length": 1e-3, "tilt": np.radians(0.1), "joint_offset": np.radians(0.1), "joint_scale": 1e-3,
    "compliance": 2e-3, "base_shift": 2.5e-3 / np.sqrt(3), "base_rotation": np.radians(0.1) / np.sqrt(3),
    "tool_shift": 2e-3 / np.sqrt(3), "tool_rotation": np.radians(0.1) / np.sqrt(3), "time_lag": 5e-3,
    "clock_drift": 1e-3,
}  # fmt: skip
"""What is injected, a number, in SI."""

CLEAR = 5.0
"""A cause of so many of its standard deviations, beside whatever resembles it most, must be named."""

DEVIATION: Mapping[Noise, float] = {uniform: 3.5e-3 / np.sqrt(3), spoilt: 3.5e-3 / np.sqrt(3), fine: 1e-4}
"""Standard deviation of a coordinate in [m]."""

ORIENTATION = np.radians(0.1)
"""The same of an orientation about each axis in [rad]."""

NOISES: Mapping[Noise, str] = {uniform: "+-3.5 mm", spoilt: "+-3.5 mm, 1 % off by 0.3 m", fine: "0.1 mm"}

OTHERS = ("ur5e", "panda", "rail_arm")

FAULTS = {
    "ripple of 1 mrad": partial(rippled, size=1e-3),
    "ripple of 10 mrad": partial(rippled, size=1e-2),
    "backlash of 1 mrad": partial(slack, size=1e-3),
    "backlash of 5 mrad": partial(slack, size=5e-3),
}

WHOLE = ("base_shift", "base_rotation", "tool_shift", "tool_rotation")

LARGE = 0.25
"""So much of the mean square may causes take that are not there, where joints do what no hypothesis says."""

TIMES = {7383: 1.0, 1_000_000: 10.0}
"""Bounds in [s] by samples."""

SMALL = 2.0
"""So many standard deviations has a cause that is too small to be named."""


@dataclass(frozen=True)
class Arm:
    """An arm in motion: a robot by its name, along the bundled path or in sums of sines, seen so often."""

    robot: str = "urm6"
    motion: str = "rich"
    samples: int = LONG
    oriented: bool = False

    @property
    def chain(self) -> Chain:
        """The arm."""
        return rail_arm() if self.robot == "rail_arm" else load_robot(self.robot)

    @property
    def moved(self) -> CubicSpline:
        """Its joints over time."""
        return demo_motion() if self.motion == "demo" else _rich(self.robot)

    def __str__(self) -> str:
        """Return its row's words."""
        return f"{self.robot}, {self.motion}, {self.samples}{', orientations' if self.oriented else ''}"


@cache
def _rich(robot: str) -> CubicSpline:
    return rich_motion(Arm(robot).chain)


@cache
def _model(arm: Arm) -> ArmModel:
    """Return the log of an arm beside the poses that it has."""
    return nominal(arm.chain, arm.moved, times(arm.samples), oriented=arm.oriented)


def numbers_of(arm: Arm, causes: Sequence[str], rng: np.random.Generator, factor: float = 1.0) -> Numbers:
    """Return the sizes of causes, of either sign, by kind and name."""
    count = {f"{group.kind}:{group.name}": len(group.columns) for group in _model(arm).groups}
    return {one: SIZES[_kind(one)] * factor * rng.choice([-1.0, 1.0], count[one]) for one in causes}


def _kind(cause: str) -> str:
    return cause.partition(":")[0]


@dataclass(frozen=True)
class Edited:
    """Joints that count the other way, or are exchanged, in uniform noise."""

    arm: Arm
    edits: Edits
    seed: int

    def __call__(self) -> tuple[str, float]:
        """Return whether all explanations have them and nothing else; and the runner-up's share, of signs."""
        log = _model(self.arm)
        data = altered(log, self.arm.moved, {}, self.edits)
        log = noisy(log, np.random.default_rng(self.seed), uniform, data)
        search = search_of(log)
        found = search.find()
        said, wanted = named(search, found), names_of(search, found, (), self.edits)
        outcome = (
            "missed" if not wanted <= said.sure else "named" if said.best == wanted else "named, with more"
        )
        return outcome, runner_up(search, self.edits, telling_joints(self.arm))


def telling_joints(arm: Arm) -> int:
    """Return how many joints move the tool centre point: on the last axis of some arms it stands still."""
    return len(arm.chain.moving) - (arm.robot in ("ur5e", "panda"))


def runner_up(search: Search, edits: Edits, joints: int) -> float:
    """Return how many times the rms under some signs the next best pattern of signs leaves."""
    left = {
        one: rms(search.model.residual(replace(search.zero, edits=one), search.spread(500)).T)
        for one in ((), *sign_edits(joints, most=joints))
    }
    return (
        min(value for one, value in left.items() if one != edits) / left[edits] if edits in left else np.inf
    )


@dataclass(frozen=True)
class Caused:
    """Numbers that differ, in noise."""

    arm: Arm
    causes: tuple[str, ...]
    noise: Noise
    seed: int
    factor: float = 1.0

    def __call__(self) -> tuple[str, tuple[bool, ...]]:
        """Return what is named; and of each number of a single cause whether its interval holds it."""
        rng = np.random.default_rng(self.seed)
        nominal_log = _model(self.arm)
        numbers = numbers_of(self.arm, self.causes, rng, self.factor)
        log = noisy(nominal_log, rng, self.noise, altered(nominal_log, self.arm.moved, numbers))
        search = search_of(log)
        found = search.find()
        said, wanted = named(search, found), names_of(search, found, self.causes)
        outcome = said.outcome(wanted)
        if outcome != "named" or len(self.causes) > 1 or wanted != {*self.causes}:
            return outcome, ()
        ((cause,), _) = Explained(search, found, log.chain.coordinates, log.chain.coordinates).causes()
        true = np.array(numbers[self.causes[0]]) + (cause.kind == "joint_scale")
        return outcome, tuple(map(bool, (np.array(cause.low) <= true) & (true <= np.array(cause.high))))


@dataclass(frozen=True)
class Quiet:
    """No cause that is looked for: noise alone, or joints that do what no hypothesis says."""

    arm: Arm
    noise: Noise
    seed: int
    driven: Callable[[FloatArray, int], FloatArray] | None = None

    def __call__(self) -> tuple[str, float]:
        """Return whether anything is named or undecided, and the share of the mean square it takes."""
        rng = np.random.default_rng(self.seed)
        log = _model(self.arm)
        data = log.position, log.rotation
        if self.driven is not None:
            q = self.driven(self.arm.moved(times(self.arm.samples)), int(rng.integers(len(log.chain.moving))))
            data = poses(log.chain, q, oriented=self.arm.oriented)
        search = search_of(noisy(log, rng, self.noise, data))
        found = search.find()
        said = named(search, found)
        names = log.chain.coordinates
        causes, undecided = Explained(search, found, names, names).causes()
        told = [causes, *(one.causes for one in undecided)]
        share = max(sum(cause.share for cause in one) for one in told)
        return ("silent" if not said.best and not said.others else "alarm"), share


JointFault = Literal["none", "turns", "joint_sign", "joints_swapped", "joint_offset", "half_turn", "mirrored"]


@dataclass(frozen=True)
class JointsApart:
    """A log of urm6 whose joints differ, against the joints that were asked for, or against a path alone.

    Attributes:
        motion: See `Arm`.
        fault: What its joints have; turns and half turns begin at some row.
        seed: Of rows, joints and noise.
        path: Whether the reference is a path, +-3.5 mm; else joints, and the log's have 0.02 deg of noise.
    """

    motion: str
    fault: JointFault
    seed: int
    path: bool

    def __call__(self) -> tuple[str, float]:
        """Return whether that is named alone, and by how many samples its row is off."""
        rng = np.random.default_rng(self.seed)
        arm = Arm(motion=self.motion, samples=2000)
        q, tsp = arm.moved(times(arm.samples)), DURATION / (arm.samples - 1)
        first = int(rng.integers(arm.samples // 10, arm.samples * 9 // 10))
        j, k = (int(one) for one in rng.choice(6, 2, replace=False))
        sign, wrong = float(rng.choice([-1.0, 1.0])), q.copy()
        if self.fault == "turns":
            wrong[first:, j] += 2.0 * np.pi * sign
        elif self.fault == "half_turn":
            wrong[first:, j] += np.pi * sign
        elif self.fault == "mirrored":
            wrong[first:, j] *= -1.0
        elif self.fault == "joint_sign":
            wrong[:, j] *= -1.0
        elif self.fault == "joints_swapped":
            wrong[:, [j, k]] = wrong[:, [k, j]]
        elif self.fault == "joint_offset":
            wrong[:, j] += np.radians(0.1) * sign
        if self.path:
            position = poses(arm.chain, q, oriented=False)[0]
            reference = path_run(uniform(rng, position).T, tsp=tsp)
        else:
            reference = run_of(q, arm.chain, name="asked", tsp=tsp)
            wrong += rng.normal(0.0, np.radians(0.02), wrong.shape)
        found = diagnosed(reference, run_of(wrong, arm.chain, tsp=tsp))
        wanted = (
            () if self.fault == "none" else ((self.fault, {j, k} if self.fault == "joints_swapped" else {j}),)
        )
        named = tuple((one.kind, {int(name[1:]) - 1 for name in one.joints}) for one in found.causes)
        off = abs((found.causes[0].from_sample or first) - first) if found.causes else 0
        return ("named" if named == wanted and not found.undecided else "wrong"), float(off)


@dataclass(frozen=True)
class Placed:
    """A path of a tool centre point against another, without joints."""

    cause: str
    seed: int

    def __call__(self) -> tuple[str, float]:
        """Return whether the cause is named alone."""
        rng = np.random.default_rng(self.seed)
        arm = Arm()
        t = times(arm.samples)
        lag = 5e-3 if self.cause == "time_lag" else 0.0
        asked = _model(arm).position
        done = poses(arm.chain, arm.moved(t + lag), oriented=False)[0]
        if self.cause == "base_rotation":
            done = Rotation.from_euler("xyz", numbers_in(SIZES["base_rotation"], rng)).apply(done.T).T
        elif self.cause == "base_shift":
            done = done + numbers_in(SIZES["base_shift"], rng)[:, np.newaxis]
        found = diagnosed(
            path_run(asked.T, tsp=PERIOD), path_run(uniform(rng, done).T, name="log", tsp=PERIOD)
        )
        named = [one.kind for one in found.causes]
        wanted = [] if self.cause == "none" else [self.cause]
        return ("named" if named == wanted and not found.undecided else "wrong"), 0.0


def numbers_in(size: float, rng: np.random.Generator) -> FloatArray:
    """Return three numbers of a size, of either sign."""
    return size * rng.choice([-1.0, 1.0], 3)


TWINS = {"d_4": {"d_2", "d_3", "d_4"}}
"""Lengths of a UR10 along parallel axes: one stands for all."""


@dataclass(frozen=True)
class Tracked:
    """Poses of a UR10 that a laser tracker measured, with joints or an arm that are altered."""

    fault: str
    seed: int

    def __call__(self) -> tuple[str, float]:
        """Return whether the fault is named alone."""
        run, robot = tracked(), None
        assert run.robot is not None
        rows = np.sort(np.random.default_rng(self.seed).choice(len(run.q), POSES, replace=False))
        q, (kind, _, what) = run.q.copy(), self.fault.partition(" ")
        joints = (
            [int(one) for one in what.split(",")]
            if kind in ("joint_sign", "joints_swapped", "joint_offset")
            else []
        )
        names = " and ".join(run.robot.coordinates[j] for j in joints)
        if kind == "joint_sign":
            q[:, joints] *= -1.0
        elif kind == "joints_swapped":
            q[:, joints] = q[:, joints[::-1]]
        elif kind == "joint_offset":
            q[:, joints] += np.radians(0.5)
        elif kind == "link_length":
            value = next(one.value for one in run.robot.parameters if one.name == what)
            robot, names = run.robot.with_parameters({what: value + 5e-3}), what
        elif kind == "other_robot":
            robot, names = load_robot("ur10e"), "ur10"
        found = diagnosed_record(drawn(run, rows, q, robot))
        named = [(one.kind, one.name) for one in found.causes]
        wanted = [[]] if kind == "none" else [[(kind, one)] for one in TWINS.get(names, {names})]
        return ("named" if named in wanted and not found.undecided else "wrong"), 0.0


@dataclass(frozen=True)
class Row:
    """One line of the results: trials of one kind.

    Attributes:
        part: Of which part it is.
        what: What was altered, in words.
        trials: What to run.
        right: The outcomes that are as they should be.
        least: Share of them that must be right; None where it is only shown.
    """

    part: str
    what: str
    trials: Sequence[Callable[[], tuple[str, Any]]]
    right: tuple[str, ...]
    least: float | None


def ran(trial: Callable[[], tuple[str, Any]]) -> tuple[str, Any]:
    """Run a trial in a process of its own."""
    warnings.simplefilter("ignore")
    return trial()


@cache
def clear(arm: Arm, noise: Noise) -> Mapping[str, float]:
    """Return how many standard deviations each cause has beside the rival that resembles it most.

    With s = J x of its size x and the columns H of a rival that has no more: |s - H H^+ s| / sigma. A rival
    that leaves nothing is a twin, and does not count.
    """
    log = _model(arm)
    weight = np.full(len(log.blocks), 1.0 / DEVIATION[noise])
    weight[3:] = 1.0 / ORIENTATION
    gram = normal_equations(log, search_of(log).zero, Rows(np.arange(log.rows), weight)).gram
    return {f"{one.kind}:{one.name}": _beside_rivals(gram, one, log.groups) for one in log.groups}


def _beside_rivals(gram: FloatArray, cause: Group, groups: Sequence[Group]) -> float:
    own = list(cause.columns)
    moment = SIZES[cause.kind] * gram[:, own].sum(axis=1)
    whole = SIZES[cause.kind] * float(moment[own].sum())
    left = [whole]
    for rival in groups:
        at = list(rival.columns)
        if rival is cause or len(at) > len(own) or not gram[at, at].all():
            continue
        stays = whole - float(moment[at] @ np.linalg.pinv(gram[np.ix_(at, at)], hermitian=True) @ moment[at])
        if stays > 1e-6 * whole:
            left.append(stays)
    return float(np.sqrt(max(min(left), 0.0)))


def edited_rows(trials: int) -> Iterator[Row]:
    """Yield signs and exchanges of joints."""
    arms = [Arm(motion=motion, samples=count) for motion in ("demo", "rich") for count in (LONG, SHORT)]
    for arm in [*arms, *(Arm(robot) for robot in OTHERS)]:
        last = telling_joints(arm)
        signs = [
            tuple(Edit("joint_sign", (j,)) for j in js) for n in (1, 2) for js in combinations(range(last), n)
        ]
        swaps: list[Edits] = [(Edit("joints_swapped", js),) for js in combinations(range(last), 2)]
        for what, edits in (("signs of one joint or two", signs), ("two joints exchanged", swaps)):
            jobs = [Edited(arm, one, seed) for one in edits for seed in range(max(trials // 4, 1))]
            yield Row("signs", f"{arm}: {what}", jobs, ("named", "named, with more"), 1.0)


def cause_rows(trials: int) -> Iterator[Row]:
    """Yield single causes that are clear, pairs of them, and causes that are too small."""
    kinds = [(Arm(motion=motion), noise) for motion in ("demo", "rich") for noise in DEVIATION]
    kinds += [(Arm(oriented=True), uniform), *((Arm(robot), uniform) for robot in OTHERS)]
    for arm, noise in kinds:
        size = clear(arm, noise)
        named = [one for one, many in size.items() if many >= CLEAR]
        words = f"{arm}, {NOISES[noise]}"
        single = [Caused(arm, (one,), noise, seed) for one in named for seed in range(trials)]
        yield Row("causes", f"{words}: {len(named)} clear causes", single, ("named",), 0.9)
        rng = np.random.default_rng(5)
        alone = [
            one for one in named if _kind(one) not in WHOLE
        ]  # of base and tool there are twins among the others
        pairs = [tuple(str(one) for one in rng.choice(alone, 2, replace=False)) for _ in range(10 * trials)]
        double = [Caused(arm, pair, noise, seed) for seed, pair in enumerate(pairs)]
        yield Row("causes", f"{words}: pairs of them", double, ("named",), 0.85)
        small = [
            Caused(arm, (one,), noise, seed, SMALL / many)
            for one, many in size.items() if many > 0.0 for seed in range(max(trials // 4, 1))
        ]  # fmt: skip
        quiet = ("nothing", "named", "undecided", "undecided, without it")
        yield Row("causes", f"{words}: causes of {SMALL:g} standard deviations", small, quiet, 0.98)


def quiet_rows(trials: int) -> Iterator[Row]:
    """Yield logs without a cause."""
    for motion in ("demo", "rich"):
        for count, least in ((LONG, 0.99), (SHORT, 0.97)):
            arm = Arm(motion=motion, samples=count)
            jobs = [Quiet(arm, uniform, seed) for seed in range(10 * trials)]
            yield Row("silence", f"{arm}: white noise", jobs, ("silent",), least)
        for lasting in (0.05, 0.5, 2.0):
            arm, noise = Arm(motion=motion), partial(drifting, lasting=lasting)
            jobs = [Quiet(arm, noise, seed) for seed in range(5 * trials)]
            yield Row("silence", f"{arm}: noise correlated over {lasting:g} s", jobs, ("silent",), 0.95)
        for words, driven in FAULTS.items():
            jobs = [Quiet(Arm(motion=motion), uniform, seed, driven) for seed in range(2 * trials)]
            yield Row("remainder", f"{Arm(motion=motion)}: {words}", jobs, ("silent",), None)


def log_rows(trials: int) -> Iterator[Row]:
    """Yield whole logs: joints on both sides, paths on both sides, joints against a path."""
    for motion in ("demo", "rich"):
        for path in (False, True):
            faults = ("half_turn", "mirrored") if path else get_args(JointFault)
            sides = "joints against a path" if path else "joints on both sides"
            for fault in faults:
                jobs = [
                    JointsApart(motion, fault, seed, path)
                    for seed in range(5 * trials if not path else 3 * trials)
                ]
                least = 1.0 if fault != "none" else 0.99
                yield Row("logs", f"urm6, {motion}, {sides}: {fault}", jobs, ("named",), least)
    for cause in ("none", "base_shift", "base_rotation", "time_lag"):
        placed = [Placed(cause, seed) for seed in range(trials)]
        yield Row("logs", f"paths on both sides: {cause}", placed, ("named",), 0.95)


def tracked_rows(trials: int) -> Iterator[Row]:
    """Yield measured poses of a real arm."""
    if not TRACKER.exists():
        print(f"left out, not there: {TRACKER}")
        return
    faults = [
        "none",
        *(f"joint_sign {j}" for j in range(6)),
        *(f"joints_swapped {js}" for js in ("1,3", "0,2", "2,4", "0,1")),
    ]
    faults += [
        *(f"joint_offset {j}" for j in (1, 2, 3, 4)),
        *(f"link_length {one}" for one in ("a_2", "a_3", "d_4", "d_5")),
    ]
    for fault in [*faults, "other_robot"]:
        jobs = [Tracked(fault, seed) for seed in range(trials)]
        yield Row("tracker", f"UR10, laser tracker, {POSES} poses: {fault}", jobs, ("named",), 0.95)


PARTS = {
    "signs": edited_rows,
    "causes": cause_rows,
    "silence": quiet_rows,
    "logs": log_rows,
    "tracker": tracked_rows,
}


def main() -> None:
    """Run the trials and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=20, help="of each cause; others in proportion")
    parser.add_argument("--only", nargs="+", choices=[*PARTS, "time"], default=[*PARTS, "time"])
    options = parser.parse_args()
    lines = [
        f"# Diagnosis: seeded trials, {options.trials} of each cause",
        "",
        *machine("scipy"),
        f"A cause is clear if it has {CLEAR:g} standard deviations beside the rival that resembles it most.",
        "Uniform noise is up to 3.5 mm a coordinate.",
        "",
        "| trials of | number | right | outcomes | largest share or ratio |",
        "|---|---|---|---|---|",
    ]
    print("\n".join(lines))
    bounds: list[Bound] = []
    covered: list[bool] = []
    with ProcessPoolExecutor(2) as pool:
        for row in (one for part in PARTS if part in options.only for one in PARTS[part](options.trials)):
            found = list(pool.map(ran, row.trials, chunksize=2))
            lines.append(_line(row, found, bounds, covered))
            print(lines[-1], flush=True)
    if covered:
        bounds.append(
            Bound(
                f"95 % intervals that hold the size, of {len(covered)}",
                float(np.mean(covered)),
                least=0.93,
                most=0.97,
            )
        )
    if "time" in options.only:
        bounds += [
            Bound(f"s of a diagnosis of {n} samples", seconds(n), under=limit) for n, limit in TIMES.items()
        ]
    if len(options.only) == len(PARTS) + 1:
        write_results("diagnosis", lines, bounds)
    print("\n".join(map(str, bounds)))


def _line(row: Row, found: Sequence[tuple[str, Any]], bounds: list[Bound], covered: list[bool]) -> str:
    """Return a line of the table, and take its bounds and intervals down."""
    outcomes = Counter(outcome for outcome, _ in found)
    right = sum(outcomes[one] for one in row.right) / len(found)
    if row.least is not None:
        bounds.append(Bound(f"{row.what}: right", right, least=row.least))
    most = ""
    if row.part == "causes":
        covered += [
            hit
            for trial, (_, hits) in zip(row.trials, found, strict=True)
            if isinstance(trial, Caused) and trial.factor == 1.0
            for hit in hits
        ]
    else:
        numbers = [number for _, number in found]
        worst = min(numbers) if row.part == "signs" else max(numbers)
        most = f"{worst:.3g}" if np.isfinite(worst) else ""
        if row.part == "signs" and most:
            bounds.append(Bound(f"{row.what}: next best pattern of signs, times the rms", worst, least=5.0))
        if row.part == "remainder":
            bounds.append(Bound(f"{row.what}: share of wrong causes", worst, under=LARGE))
    told = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
    return f"| {row.what} | {len(found)} | {100 * right:.1f} % | {told} | {most} |"


def seconds(samples: int) -> float:
    """Return what a diagnosis of a joint's offset takes in [s], without reading and comparing."""
    chain = load_robot("urm6")
    q = _rich("urm6")(times(samples))
    path = path_run(uniform(np.random.default_rng(0), poses(chain, q, oriented=False)[0]).T)
    log = run_of(q + np.eye(6)[1] * SIZES["joint_offset"], chain)
    sides = Side(path, trajectory(path), by_joints=False), Side(log, trajectory(log), by_joints=True)
    (deviation,) = compare_runs(path, [log]).runs
    matched = match(sides[0].trajectory, sides[1].trajectory, deviation.sync)
    return min(timed(lambda: diagnose(deviation, matched, *sides)) for _ in range(3))


if __name__ == "__main__":
    main()
