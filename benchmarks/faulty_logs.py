"""Real motions of robot arms as logs that deviate for a known reason, in 1000 seeded trials.

1. A motion: joints of a real log of others (`MOTIONS`), thinned to about 1000 rows, or still poses.
2. A truth: causes that are drawn, and scaled until the tool centre point moves by a given rms (`make_trial`).
3. Data: where the arm is with them, by `faulty_arms`, and noise (`Trial.data`).

Needs the folder `shared` next to the checkout.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from faulty_arms import AXES, Arm, Fault, matrix, segments
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

import urmpipe
from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray, IntArray
from urmpipe_models.robots.catalogue import load_robot, parse_offset
from urmpipe_pipeline.runs.run import Run

SHARED = Path(__file__).resolve().parents[2] / "shared"
COUNT, SEED = 1000, 44
SIZES = (0.3e-3, 1e-3, 4e-3, 20e-3)  # m, rms at the tool centre point
NOISES = (0.05e-3, 0.2e-3, 0.5e-3)  # m a coordinate, standard deviation
LASTING = 0.1  # s, until correlated noise falls to 1/e
LEVER = 0.2  # m: a turn of the tool counts as what it moves at this distance
ROWS = 1000
MOVED = 1e-3  # m rms: what singles have to move to count


class Source(NamedTuple):
    """A log of others: file, robot, how often its motion is drawn, whether still, or of encoders."""

    file: str
    robot: str
    weight: float
    still: bool = False
    period: float | None = None
    encoders: bool = True


MOTIONS = (
    Source("traj-recorder-ros2/salva.csv", "ur5e", 4),
    Source("ur5e-isaaclab/joint_log.csv", "ur5e", 1, encoders=False),
    Source("ur5-mujoco-rttsa/joint_trajectory.csv", "ur5", 0.4),
    Source("panda-matlab-ascii/q_Traj1_Grad.txt", "panda", 2),
    Source("panda-matlab-ascii/q_Traj1_PI.txt", "panda", 2),
    Source("iiwa14-fri-text/pour1.txt", "iiwa14", 1.5),
    Source("iiwa14-fri-text/iiwa14_singularity_change_config.txt", "iiwa14", 1.5),
    Source("iiwa-dmp-text/iiwa_example1.txt", "iiwa14", 1.5),
    Source("abb-egm-irb120/theta_actual.txt", "irb120", 4, period=0.01),
    Source("ur10-laser-tracker/measurements_grid.csv", "ur10", 4, still=True),
    Source("pybotics-ur10-fk/ur10-joints-poses.csv", "ur10", 1, still=True),
    Source("ur5-factory-calibration/joint-eef-data.csv", "ur5e", 1, still=True),
)


TOOL = "0.05,0.03,0.12,0,0,-0.785398"
"""The known tool of every second trial, in m and rad: one off the last axis shows what that joint does."""

OTHERS = {
    "ur5e": ("ur5", "ur3e", "ur10e"), "ur5": ("ur5e", "ur3", "ur10"), "ur10": ("ur10e", "ur5"),
    "panda": ("iiwa14",), "iiwa14": ("panda",), "irb120": ("arm6", "ur5"),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of a real log, and its arm with or without the tool.

    Attributes:
        source: Where it comes from.
        chain: The arm.
        t: Times of the rows in [s], shape (n,).
        q: Joints in [rad], shape (n, joints).
    """

    source: Source
    chain: Chain
    t: FloatArray
    q: FloatArray

    @cached_property
    def arm(self) -> Arm:
        """Its kinematics."""
        return Arm(self.chain)

    @cached_property
    def at(self) -> CubicSpline:
        """The joints over time."""
        return CubicSpline(self.t, self.q)

    @cached_property
    def rate(self) -> CubicSpline:
        """Their rates in [rad/s], without what the encoders add: of means over 30 ms."""
        if not self.source.encoders:
            return self.at.derivative()
        width = max(0.03 / float(np.median(np.diff(self.t))), 1.0)
        return CubicSpline(self.t, gaussian_filter1d(self.q, width, axis=0, mode="nearest")).derivative()


@cache
def _rows(source: Source) -> tuple[Chain, FloatArray, FloatArray]:
    """Return the arm of a log, and its times and joints thinned to about `ROWS`; of still poses 300."""
    robot = str(SHARED / "cases/diagnosis/irb120.toml") if source.robot == "irb120" else source.robot
    reading: dict[str, Any] = {} if source.still else {"unit": "rad"}
    reading |= {"period": source.period} if source.period else {}
    run = urmpipe.ingest(SHARED / "logs" / source.file, robot, **reading)
    step = max(round(len(run.log.q) / (300 if source.still else ROWS)), 1)
    assert run.robot is not None
    t = run.log.t_ns[::step] / 1e9
    return run.robot, t - t[0], run.log.q[::step].round(6)


@cache
def motion_of(source: Source, tool: bool) -> Motion:
    """Return a motion from its file, of the arm with the tool or without."""
    chain, t, q = _rows(source)
    return Motion(source, chain.placed(tool=parse_offset(TOOL)) if tool else chain, t, q)


def _of_joint(kind: str, value: float) -> Drawn:
    return lambda motion, rng: Fault(kind, (value,), (int(rng.integers(motion.q.shape[1])),))


def _of_frame(kind: str, count: int) -> Drawn:
    """Return how base or tool are drawn to differ by one number or three."""

    def drawn(motion: Motion, rng: np.random.Generator) -> Fault:
        frames = motion.arm.frames
        place = 0 if kind.startswith("base") else len(frames) - 1
        at = frames[place] if place else matrix(AXES, frames[0][:3, 3])
        if count == 1:
            return Fault(kind, (1e-4,), axis=AXES[rng.integers(3)], place=place, at=at)
        return Fault(kind, tuple(1e-4 * rng.uniform(0.3, 1.0, 3)), place=place, at=at)

    return drawn


def _of_segment(kind: str) -> Drawn:
    return lambda motion, rng: (known := segments(motion.chain, kind))[rng.integers(len(known))]


def _turned_base(motion: Motion, rng: np.random.Generator) -> Fault:
    angle = float(rng.choice([np.pi, np.pi / 2, -np.pi / 2]))
    return replace(_of_frame("base_rotation", 1)(motion, rng), value=(angle,))


def _mirrored_base(motion: Motion, rng: np.random.Generator) -> Fault:
    k = int(rng.integers(3))
    return Fault("base_mirrored", name="({})".format(", ".join("-" * (i == k) + "xyz"[i] for i in range(3))))


def _two_joints(kind: str) -> Drawn:
    def drawn(motion: Motion, rng: np.random.Generator) -> Fault:
        j = int(rng.integers(1, motion.q.shape[1]))
        k = j - 1 if kind == "joint_coupled" else int(rng.integers(j))
        return Fault(kind, (float(rng.choice([-1.0, 1.0])),) if kind == "joint_coupled" else (), (j, k))

    return drawn


def _later(kind: str) -> Drawn:
    def drawn(motion: Motion, rng: np.random.Generator) -> Fault:
        n, count = motion.q.shape
        return Fault(kind, (), (int(rng.integers(count)),), first=int(rng.integers(n // 10, n * 9 // 10)))

    return drawn


def _outliers(motion: Motion, rng: np.random.Generator) -> Fault:
    n = len(motion.t)
    count = max(int(rng.uniform(0.02, 0.05) * n), 1)
    return Fault(
        "outliers", rows=tuple(sorted(map(int, rng.choice(n, count, replace=False)))), name="scattered"
    )


def _reset(motion: Motion, rng: np.random.Generator) -> Fault:
    n = len(motion.t)
    count = max(int(rng.uniform(0.005, 0.04) * n), 1)
    first = int(rng.integers(n // 10, n - count))
    return Fault("outliers", rows=tuple(range(first, first + count)), name="a reset")


def _unit(motion: Motion, rng: np.random.Generator) -> Fault:
    name, metres = [("mm", 1e-3), ("cm", 1e-2), ("inch", 0.0254)][rng.integers(3)]
    return Fault("path_unit", (metres,), name=f"reference in {name}")


Drawn: TypeAlias = Callable[[Motion, np.random.Generator], Fault]
Cell: TypeAlias = tuple[str, tuple[str, ...], float, float]

SIZED: dict[str, Drawn] = {
    "time_lag": lambda motion, rng: Fault("time_lag", (1e-3,)),
    "clock_drift": lambda motion, rng: Fault("clock_drift", (1e-4,)),
    "servo_lag": lambda motion, rng: Fault("servo_lag", (1e-3,)),
    "joint_lag": _of_joint("joint_lag", 1e-3),
    "base_shift, one axis": _of_frame("base_shift", 1), "base_shift": _of_frame("base_shift", 3),
    "base_rotation, one axis": _of_frame("base_rotation", 1), "base_rotation": _of_frame("base_rotation", 3),
    "tool_shift, one axis": _of_frame("tool_shift", 1), "tool_shift": _of_frame("tool_shift", 3),
    "tool_rotation": _of_frame("tool_rotation", 3),
    "joint_offset": _of_joint("joint_offset", 1e-4), "joint_scale": _of_joint("joint_scale", 1e-4),
    "compliance": _of_joint("compliance", 1e-4), "backlash": _of_joint("backlash", 1e-3),
    "sag": _of_joint("sag", 1e-5),
    "link_length": _of_segment("link_length"), "link_shift": _of_segment("link_shift"),
    "tilt": _of_segment("tilt"),
}  # fmt: skip

DISCRETE: dict[str, Drawn] = {
    "base turned by 90 or 180 deg": _turned_base, "base_mirrored": _mirrored_base, "path_unit": _unit,
    "joint_sign": _of_joint("joint_sign", 0.0), "joints_swapped": _two_joints("joints_swapped"),
    "joint_unit": lambda motion, rng: replace(
        _of_joint("joint_unit", 0.0)(motion, rng), value=(float(rng.choice([np.pi / 180, 180 / np.pi])),)
    ),
    "joint_coupled": _two_joints("joint_coupled"), "half_turn": _later("half_turn"),
    "mirrored": _later("mirrored"), "turns": _of_joint("turns", 1.0),
    "other_robot": lambda motion, rng: Fault(
        "other_robot", name=str(rng.choice(OTHERS[motion.source.robot]))
    ),
    "outliers": _outliers, "outliers, a reset": _reset,
}  # fmt: skip

OUTSIDE = ("thermal growth", "quantised joints", "dropped rows")
PAIRS = 127
UNDISTURBED = 200

TIMED = (
    "time_lag", "clock_drift", "servo_lag", "joint_lag", "compliance", "backlash", "half_turn", "mirrored",
    "outliers, a reset", "dropped rows",
)  # fmt: skip
"""What still poses do not have."""

BY_ROW = ("half_turn", "mirrored", "outliers", "outliers, a reset", "dropped rows")
"""What needs the same rows on both sides."""

BY_JOINTS = (
    "time_lag", "clock_drift", "servo_lag", "joint_lag", "joint_offset", "joint_scale", "compliance",
    "backlash", "joint_sign", "joints_swapped", "joint_unit", "joint_coupled", "half_turn", "mirrored",
    "turns",
)  # fmt: skip
"""What joints on both sides have, too."""

EDITS = ("joint_sign", "joints_swapped", "joint_unit", "joint_coupled", "half_turn", "mirrored", "turns")
LARGEST = {
    "time_lag": 0.5,
    "servo_lag": 0.2,
    "joint_lag": 0.2,
    "clock_drift": 0.05,
    "joint_scale": 0.2,
    "sag": 5e-3,
    "compliance": 0.05,
}
"""Largest values that are drawn in SI; of angles and lengths 0.3."""

QUIET = 5e-4
"""A joint that moves back by less in [rad] has not turned round: noise of encoders."""

ONE_SIGN = ("backlash", "sag")  # the reference lags, or sags


def read(q: FloatArray, fault: Fault, rows: FloatArray | IntArray, *, back: bool = False) -> FloatArray:
    """Return joints, shape (n, joints), as a fault of the reading corrects them; back: as it spoils them."""
    q, later, sign = q.copy(), rows >= fault.first, -1.0 if back else 1.0
    j = fault.joints[0]
    if fault.kind in ("joint_sign", "mirrored"):
        q[later, j] *= -1.0
    elif fault.kind == "joints_swapped":
        q[:, list(fault.joints)] = q[:, list(fault.joints[::-1])]
    elif fault.kind == "joint_unit":
        q[:, j] *= fault.value[0] ** sign
    elif fault.kind == "joint_coupled":
        q[:, j] += sign * fault.value[0] * q[:, fault.joints[1]]
    else:
        q[later, j] += sign * (np.pi if fault.kind == "half_turn" else 2.0 * np.pi * fault.value[0])
    return q


def undo_lag(t: FloatArray, q: FloatArray, rate: FloatArray, lag: float) -> FloatArray:
    """Return the joints that a log, shape (n, joints), follows with a first-order lag T y' + y = q.

    Of a lag below 0 the reference lags: exact where the log is a line from row to row.
    """
    if lag > 0.0:
        return q + lag * rate
    behind = q + lag * rate
    for k, dt in enumerate(np.diff(t), 1):
        slope = (q[k] - q[k - 1]) / dt
        behind[k] = q[k] + lag * slope + (behind[k - 1] - q[k - 1] - lag * slope) * np.exp(dt / lag)
    return behind


def direction(q: FloatArray) -> FloatArray:
    """Return which way a joint, shape (n,), moves or moved last; before, as it moves first."""
    there, moves = q[0], np.zeros_like(q)
    for k, value in enumerate(q):
        moved = min(max(there, value - QUIET / 2.0), value + QUIET / 2.0)
        moves[k], there = np.sign(moved - there), moved
    steps = np.flatnonzero(moves)
    if not len(steps):
        return moves
    return np.asarray(moves[steps[np.maximum(np.searchsorted(steps, np.arange(len(q)), "right") - 1, 0)]])


@dataclass(frozen=True, eq=False)
class Trial:
    """One question whose answer is known.

    Attributes:
        number: Its place among all, which seeds its noise.
        group: single, pair, outside or undisturbed.
        kinds: Names of what it has, of `SIZED`, `DISCRETE` or `OUTSIDE`.
        size: What each sized cause moves in [m] rms; 0 of others.
        sigma: Noise of a coordinate in [m]; of joints in as many rad.
        correlated: Whether that lasts.
        oriented: Whether the reference has orientations.
        both: Whether the reference has joints instead.
        every: The reference has each so manieth row.
        motion: The motion.
        truth: The causes.
    """

    number: int
    group: str
    kinds: tuple[str, ...]
    size: float
    sigma: float
    correlated: bool
    oriented: bool
    both: bool
    every: int
    motion: Motion
    truth: tuple[Fault, ...] = ()

    def log(self, at: FloatArray) -> FloatArray:
        """Return what the log reads at some times in [s]: the joints, spoilt by the edits of the truth."""
        t = self.motion.t
        inside = np.clip(at, t[0], t[-1])
        q, rows = self.motion.at(inside), np.interp(inside, t, np.arange(len(t))).round()
        for fault in reversed(self.truth):
            q = read(q, fault, rows, back=True) if fault.kind in EDITS else q
        return np.asarray(q)

    def joints(self, faults: Sequence[Fault]) -> FloatArray:
        """Return the joints that the log means, if some faults are true, in [rad], shape (n, joints)."""
        t = self.motion.t
        by = {
            kind: [fault for fault in faults if fault.kind == kind]
            for kind in {fault.kind for fault in faults}
        }
        at = t - sum(fault.value[0] for fault in by.get("time_lag", ()))
        at -= sum(fault.value[0] for fault in by.get("clock_drift", ())) * (t - t[0])
        q = self.log(at)
        for fault in by.get("joint_lag", ()):
            q[:, fault.joints[0]] = self.log(at - fault.value[0])[:, fault.joints[0]]
        for fault in by.get("servo_lag", ()):
            q = undo_lag(t, q, self.motion.rate(np.clip(at, t[0], t[-1])), fault.value[0])
        for fault in faults:
            q = read(q, fault, np.arange(len(t))) if fault.kind in EDITS else q
        factors = {"joint_offset": np.ones_like(q), "joint_scale": q.copy()}
        factors["compliance"] = self.motion.rate(np.clip(at, t[0], t[-1]), 1)
        for fault in faults:
            if fault.kind in factors:
                q[:, fault.joints[0]] += fault.value[0] * factors[fault.kind][:, fault.joints[0]]
        for fault in by.get("backlash", ()):
            q[:, fault.joints[0]] -= fault.value[0] / 2.0 * direction(q[:, fault.joints[0]])
        for fault in by.get("sag", ()):
            q[:, fault.joints[0]] += fault.value[0] * self.motion.arm.torque(q, fault.joints[0])
        return q

    def tcp(self, faults: Sequence[Fault], growth: FloatArray | None = None) -> tuple[FloatArray, Rotation]:
        """Return where the tool centre point is, if some faults are true, in [m], shape (n, 3)."""
        arm = self.motion.arm
        for fault in faults:
            if fault.kind == "other_robot":
                arm = Arm(load_robot(fault.name).placed(arm.chain.base, arm.chain.tool))
        _, tip = arm.poses(self.joints(faults), faults, growth)
        position = tip[:, :3, 3]
        for fault in faults:
            if fault.kind == "base_mirrored":
                position = position * [-1.0 if "-" in part else 1.0 for part in fault.name.split(",")]
            elif fault.kind == "path_unit":
                position = position / fault.value[0]
        return position, Rotation.from_matrix(tip[:, :3, :3])

    def distance(self, first: Sequence[Fault], second: Sequence[Fault], *, seen: bool = True) -> FloatArray:
        """Return how far two explanations are from each other in each row, shape (n,).

        Args:
            first: Causes.
            second: Other causes.
            seen: Whether it is in [rad] where both sides have joints; else always of the places in [m].
        """
        if seen and self.both:
            return np.asarray(np.linalg.norm(self.joints(first) - self.joints(second), axis=1))
        (p, turn), (p_other, turn_other) = self.tcp(first), self.tcp(second)
        squares = ((p - p_other) ** 2).sum(axis=1)
        if self.oriented:
            squares = squares + (LEVER * (turn * turn_other.inv()).magnitude()) ** 2
        return np.asarray(np.sqrt(squares))

    @cached_property
    def effect(self) -> float:
        """How much the causes move the tool centre point in [m] rms."""
        return rms(self.distance(self.truth, (), seen=False))

    def noise(self, rng: np.random.Generator, columns: int) -> FloatArray:
        """Return noise of each row, shape (n, columns), in [m] or [rad]."""
        t = self.motion.t
        if not self.correlated:
            return np.asarray(rng.normal(0.0, self.sigma, (len(t), columns)))
        a = np.exp(-float(np.median(np.diff(t))) / LASTING)
        white = rng.normal(0.0, self.sigma * np.sqrt(1.0 - a * a), (len(t) + 1000, columns))
        return np.asarray(lfilter([1.0], [1.0, -a], white, axis=0)[1000:])

    def data(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return times and joints of the log, then times and values of the reference.

        These are joints, or x, y, z in [m] and a quaternion if there are orientations.
        """
        rng, t = np.random.default_rng([SEED, self.number, 1]), self.motion.t
        q, log_t = self.log(t), t.copy()
        growth = 1.0 + rng.uniform(5e-4, 2e-3) * t / t[-1] if self.kinds == ("thermal growth",) else None
        position, turn = self.tcp(self.truth, growth)
        values = self.joints(self.truth) if self.both else position
        unit = next((fault.value[0] for fault in self.truth if fault.kind == "path_unit"), 1.0)
        values = values + self.noise(rng, values.shape[1]) / unit
        if self.oriented:
            off = Rotation.from_rotvec(rng.normal(0.0, self.sigma / LEVER, (len(t), 3)))
            values = np.hstack([values, (off * turn).as_quat()])
        for fault in self.truth:
            if fault.name == "scattered":
                away = rng.normal(size=(len(fault.rows), 3))
                away *= (rng.uniform(0.03, 0.3, len(away)) / np.linalg.norm(away, axis=1))[:, np.newaxis]
                values[list(fault.rows), :3] += away
            elif fault.name == "a reset":
                q[list(fault.rows)] = 0.0
        if self.kinds == ("quantised joints",):
            step = np.radians(rng.uniform(0.02, 0.2))
            q = np.round(q / step) * step
        elif self.kinds == ("dropped rows",):
            kept = np.ones(len(t), bool)
            for _ in range(rng.integers(1, 4)):
                first = int(rng.integers(len(t) // 10, len(t) * 9 // 10))
                kept[first : first + int(rng.integers(2, max(len(t) // 50, 3)))] = False
            q, log_t = q[kept], np.arange(kept.sum()) * float(np.median(np.diff(t)))
        return log_t, q.round(7), t[:: self.every], values[:: self.every].round(7)

    def runs(self) -> tuple[Run, Run]:
        """Return the reference and the log, as a script would hand them over."""
        chain, still = self.motion.chain, self.motion.source.still
        t, q, reference_t, values = self.data()
        when: list[dict[str, Any]] = [{"poses": True}] * 2 if still else [{"t": reference_t}, {"t": t}]
        named: dict[str, Any] = {"robot": chain, "names": chain.coordinates, "unit": "rad"}
        reference = {"q": values, **named} if self.both else {"recorded_tcp": values}
        return (
            urmpipe.ingest(name="reference", **reference, **when[0]),
            urmpipe.ingest(name="log", q=q, **named, **when[1]),
        )

    def __str__(self) -> str:
        """Return it in a line."""
        where = Path(self.motion.source.file).stem + ", tool" * any(self.motion.chain.tool.translation)
        flags = [name for name in ("correlated", "oriented", "both") if getattr(self, name)]
        flags += [f"each {self.every}th row"] * (self.every > 1)
        causes = "; ".join(map(str, self.truth)) or ", ".join(self.kinds)
        moved = f"{1e3 * self.effect:.3g} mm, noise {1e3 * self.sigma:g} mm"
        return f"{self.number} {self.group}: {causes} | {moved} | {', '.join([where, *flags])}"


def rms(values: FloatArray) -> float:
    """Return the root mean square in the unit of the values."""
    return float(np.sqrt(np.mean(values**2)))


def plan() -> list[Cell]:
    """Return group, kinds, size and noise of all trials, so mixed that each beginning has all kinds."""
    rng = np.random.default_rng(SEED)
    cells: list[Cell] = []
    for kind, size, sigma in [*product(SIZED, SIZES, NOISES)] * 2 + [*product(DISCRETE, (0.0,), NOISES)] * 3:
        cells.append(("single", (kind,), size, sigma))
    every = [*SIZED, *(kind for kind in DISCRETE if not kind.startswith("outliers"))]
    for k in range(PAIRS):
        first, second = str(rng.choice([*SIZED])), str(rng.choice(every))
        while second.partition(",")[0] == first.partition(",")[0]:
            second = str(rng.choice(every))
        cells.append(("pair", (first, second), SIZES[1 + k % 3], NOISES[k // 3 % 3]))
    cells += [("undisturbed", (), 0.0, NOISES[k % 3]) for k in range(UNDISTURBED)]
    outside = COUNT - len(cells)
    cells += [("outside", (OUTSIDE[k % 3],), 0.0, NOISES[k // 3 % 3]) for k in range(outside)]
    return [cells[k] for k in rng.permutation(COUNT)]


@cache
def make_trial(number: int) -> Trial:
    """Return a trial: circumstances and causes are drawn until the causes move as much as they should."""
    group, kinds, size, sigma = plan()[number]
    rng = np.random.default_rng([SEED, number])
    for _ in range(300):
        trial = _circumstances(rng, number, group, kinds, size, sigma)
        truth = []
        for kind in kinds if group in ("single", "pair") else ():
            drawn = (SIZED | DISCRETE)[kind](trial.motion, rng)
            if kind in SIZED and kind not in ONE_SIGN:
                drawn = replace(drawn, value=tuple(rng.choice([-1.0, 1.0]) * v for v in drawn.value))
            fault = scaled(trial, drawn, size) if kind in SIZED else _clear(trial, drawn)
            truth += [] if fault is None else [fault]
        if group not in ("single", "pair") or len(truth) == len(kinds):
            return replace(trial, truth=tuple(truth))
    raise RuntimeError(f"trial {number}: {kinds} of {size} m: no motion has it")


def _circumstances(
    rng: np.random.Generator, number: int, group: str, kinds: tuple[str, ...], size: float, sigma: float
) -> Trial:
    """Return a trial without causes: its motion, noise and sides."""
    still = not {*kinds} & {*TIMED}
    weights = np.array([source.weight * (still or not source.still) for source in MOTIONS])
    source = MOTIONS[rng.choice(len(MOTIONS), p=weights / weights.sum())]
    chance = dict(zip(("tool", "correlated", "oriented", "both", "sparse"), rng.random(5), strict=True))
    both = {*kinds} <= {*BY_JOINTS} and (chance["both"] < 0.2 or "turns" in kinds)
    oriented = (
        ("tool_rotation" in kinds or chance["oriented"] < 0.25) and "base_mirrored" not in kinds and not both
    )
    sparse = chance["sparse"] < 0.1 and not source.still and not {*kinds} & {*BY_ROW}
    return Trial(
        number, group, kinds, size, sigma, chance["correlated"] < 0.2 and not source.still, oriented, both,
        4 if sparse and source.weight > 1 else 1, motion_of(source, bool(chance["tool"] < 0.5)),
    )  # fmt: skip


def scaled(trial: Trial, fault: Fault, size: float) -> Fault | None:
    """Return a cause that moves the tool centre point by a size in [m] rms; None where none does."""
    for _ in range(5):
        moved = rms(trial.distance([fault], (), seen=False))
        if moved < 1e-9:
            return None
        fault = replace(fault, value=tuple(v * min(size / moved, 1e3) for v in fault.value))
        if np.abs(fault.value).max() > LARGEST.get(fault.kind, 0.3):
            return None
    if abs(rms(trial.distance([fault], (), seen=False)) / size - 1.0) > 0.2:
        return None
    return None if fault.kind == "backlash" and _moves_one_way(trial, fault) else fault


def _moves_one_way(trial: Trial, fault: Fault) -> bool:
    """Return whether a joint moves one way most of the time, or by less than ten times its play."""
    q = trial.motion.q[:, fault.joints[0]]
    return bool(abs(direction(q).mean()) > 0.8 or np.ptp(q) < 10.0 * fault.value[0])


def _clear(trial: Trial, fault: Fault) -> Fault | None:
    """Return a cause without a size, if it moves something by 1 mm rms."""
    if fault.name == "a reset":
        zeros = (
            trial.motion.arm.poses(np.zeros_like(trial.motion.q))[1]
            - trial.motion.arm.poses(trial.motion.q)[1]
        )
        return fault if (np.linalg.norm(zeros[list(fault.rows), :3, 3], axis=1) > 0.02).all() else None
    if fault.kind in ("outliers", "turns"):
        return fault
    single = replace(trial, truth=(fault,))
    return fault if single.effect > MOVED else None
