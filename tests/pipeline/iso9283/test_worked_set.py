"""A set worked by hand: 3 poses, 5 cycles, a square path with an overshooting corner.

All lengths are in u = 10 um and all angles in mrad, so that the working stays in whole numbers. The command
goes at 0.1 m/s, a row each 5 ms, z = 0:

    A (0, 0) -> B (-0.28, 0) -> A -> K1 (0.2, 0) -> C (0.2, 0.2) -> K2 (0, 0.2) -> A

and rests at A, B, A, C, A for 0.2 s; K1 and K2 are corners. It ends where it starts, so that its poses are

    pose 1: B    pose 2: A, from B    pose 3: C    pose 4: A, from C

Each cycle rests where the tables below say, goes along each leg off the command by a constant amount, and
changes to the next amount from one row to the next, where nothing is told of it.

The spreads come from five points about their barycentre, whose distances from it are 13, 13, 7, 7, 10:

    (12, 0, -5), (-12, 0, -5), (0, 7, 0), (0, -7, 0), (0, 0, 10)    sum (0, 0, 0)
    mean 50/5 = 10, S^2 = (9 + 9 + 9 + 9 + 0)/4 = 9, mean + 3 S = 19

and, in a plane, (12, -5), (-12, -5), (7, 0), (-7, 0), (0, 10), of the same distances.
Angles are off by m + s D with D = (1, 1, -1, -1, 0): mean m, S^2 = s^2 (1 + 1 + 1 + 1)/4, S = s.
"""

from __future__ import annotations

from math import hypot, sqrt
from pathlib import Path

import numpy as np
import pytest

from repeated import PLACE, TURNS, Drawn, logs, still, told, value, written
from urmpipe_pipeline.iso9283.criteria import UNITS
from urmpipe_pipeline.iso9283.result import IsoTest

U, MRAD = 1e-5, 1e-3
CYCLES = range(5)
CLOUD = ((12, 0, -5), (-12, 0, -5), (0, 7, 0), (0, -7, 0), (0, 0, 10))
FLAT = ((12, -5), (-12, -5), (7, 0), (-7, 0), (0, 10))
D = (1, 1, -1, -1, 0)
K = (2, 0, 1, 1, 1)

# (m, s) of rz, ry, rx
POSE_TURNS = (
    ((2, 1), (-1, 0.5), (0.5, 0.25)),
    ((-3, 2), (1, 1), (0, 0)),
    ((1, 0), (0, 0.5), (-2, 1)),
    ((0, 0.5), (2, 0), (1, 2)),
)
LEG_TURNS = (
    ((4, 1), (1, 1), (-1, 2)),
    ((-5, 1.5), (0, 0), (3, 1)),
    ((1, 0), (2, 2), (1, 0.5)),
    ((2, 0.5), (-3, 1.5), (0, 1)),
    ((0, 2), (1, 0), (-4, 1.5)),
    ((3, 3), (-1, 0.5), (2, 0)),
)
COMMANDED_TURN = (0.3, 0.1, -0.2)

BEFORE_CORNER = (4, 14, 24, 34, 44)  # z before and behind K1
BEYOND = (90, 100, 110, 45, 55)  # x beyond K1
BEHIND = (-10, -10, -10, -20, -20)  # x on the leg behind it
CUT_Z = (-6, -12, -18, -24, -30)  # z before and behind K2
CUT = (0.02, 0.02, 0.03, 0.03, 0.03)  # in [m]: where K2 begins to be cut
LANE = 20  # x behind K2, on the inner side


def command() -> Drawn:
    turn = COMMANDED_TURN
    drawn = Drawn(0, 0, 0, *turn).stay(40)
    drawn.to(560, -0.28, 0, 0, *turn).stay(40).to(560, 0, 0, 0, *turn).stay(40)
    drawn.to(400, 0.2, 0, 0, *turn).to(400, 0.2, 0.2, 0, *turn).stay(40)
    return drawn.to(400, 0, 0.2, 0, *turn).to(400, 0, 0, 0, *turn).stay(40)


class Cycle:
    """What cycle j, from 0, does.

    Pose 1 is attained at (20, -10, 20) + the five points; pose 2 another 7 K along x, pose 3 another
    K (12, 5); pose 4 at (3, 4, 0) from pose 2: differences along the lines between the poses.
    """

    def __init__(self, j: int) -> None:
        self.j = j
        self.pose, self.leg = [self.turn(one) for one in POSE_TURNS], [self.turn(one) for one in LEG_TURNS]
        self.bx, self.by, self.bz = (U * (a + b) for a, b in zip((20, -10, 20), CLOUD[j], strict=True))
        self.ax, self.cx, self.cy = self.bx + 7 * U * K[j], self.bx + 12 * U * K[j], self.by + 5 * U * K[j]
        self.drawn = Drawn(0, 0, 0, *self.pose[3]).stay(40)
        self.to_b()
        self.to_a()
        self.to_k1()
        self.to_c()
        self.to_k2()
        self.back_to_a()

    def turn(self, of: tuple[tuple[float, float], ...]) -> list[float]:
        """Angles of a pose or leg."""
        offs = [mean + s * D[self.j] for mean, s in of]
        return [wanted + off * MRAD for wanted, off in zip(COMMANDED_TURN, offs, strict=True)]

    def flat(self, first: float, second: float, size: float = 1.0) -> tuple[float, float]:
        """Two coordinates off the command: given ones and the point of the five in a plane."""
        return U * (first + size * FLAT[self.j][0]), U * (second + size * FLAT[self.j][1])

    def to_b(self) -> None:
        """Leg 1, at 0.1 m/s, of cycle 5 at 0.08 m/s; cycles 1 and 2 settle."""
        (y, z), leg, pose, by, bz = self.flat(30, 40), self.leg[0], self.pose[0], self.by, self.bz
        go, end = self.drawn.to, -0.28 + self.bx
        go(1, -0.001, y, z, *leg).to(100, -0.05, y, z, *leg)
        go(450 if self.j == 4 else 360, -0.23, y, z, *leg).to(1, -0.231, by, bz, *pose)
        go(80, end + 0.01, by, bz, *pose).to(20, end, by, bz, *pose)
        if self.j == 0:
            go(3, end - 30 * U, by, bz, *pose).to(6, end, by, bz, *pose)
        if self.j == 1:
            go(4, end - 20 * U, by, bz, *pose).to(5, end, by, bz, *pose)
        self.drawn.stay(40)

    def to_a(self) -> None:
        """Leg 2, at 0.1 m/s."""
        (y, z), leg, pose, by, bz = self.flat(5, 12, 2.0), self.leg[1], self.pose[1], self.by, self.bz
        go = self.drawn.to
        go(1, -0.279, y, z, *leg).to(60, -0.25, y, z, *leg).to(400, -0.05, y, z, *leg)
        go(1, -0.049, by, bz, *pose).to(80, self.ax - 0.01, by, bz, *pose)
        go(20, self.ax, by, bz, *pose).stay(40)

    def to_k1(self) -> None:
        """Leg 3, at 0.125, 0.125, 0.08, 0.08 m/s; of cycle 5 faster and slower in the middle half."""
        (y, z), leg, f, go = self.flat(-8, 15), self.leg[2], U * BEFORE_CORNER[self.j], self.drawn.to
        go(1, 0.001, y, z, *leg).to(60, 0.03, y, z, *leg).to(1, 0.031, 0, f, *leg).to(18, 0.04, 0, f, *leg)
        if self.j == 4:
            go(40, 0.06, 0, f, *leg).to(40, 0.10, 0, f, *leg).to(120, 0.14, 0, f, *leg)
            go(120, 0.2, 0, f, *leg)
        else:
            go((256, 256, 400, 400)[self.j], 0.2, 0, f, *leg)

    def to_c(self) -> None:
        """Leg 4, after going beyond K1."""
        f, beyond, behind = (U * one[self.j] for one in (BEFORE_CORNER, BEYOND, BEHIND))
        ticks, leg, pose, go = (40, 40, 120, 90), self.leg[3], self.pose[2], self.drawn.to
        if self.j > 2:
            ticks = (160, 80, 160, 120)
        go(ticks[0], 0.2 + beyond, 0, f, *leg).to(ticks[1], 0.2 + behind, 0.02, f, *leg)
        go(ticks[2], 0.2 + behind, 0.1, f, *leg).to(ticks[3], 0.2 + behind, 0.16, f, *leg)
        go(1, 0.2 + self.cx, 0.161, self.bz, *pose)
        go(60, 0.2 + self.cx, 0.2 + self.cy, self.bz, *pose).stay(40)

    def to_k2(self) -> None:
        """Leg 5, at 0.125 and 0.1 m/s, and the cut of K2."""
        (y, z), leg, go = self.flat(12, 35), self.leg[4], self.drawn.to
        h, cut, lane = U * CUT_Z[self.j], CUT[self.j], U * LANE
        go(1, 0.199, 0.2 + y, z, *leg).to(80, 0.157, 0.2 + y, z, *leg).to(1, 0.155, 0.2, h, *leg)
        go(216 if self.j < 2 else 250, cut, 0.2, h, *leg)
        go(40 if self.j < 2 else 80, lane, 0.2 - cut + lane, h, *self.leg[5])

    def back_to_a(self) -> None:
        """Leg 6, at 0.12, 0.12, 0.08, 0.08, 0.1 m/s; cycle 3 settles."""
        (x, z), leg, pose, go, bz = self.flat(-24, 7), self.leg[5], self.pose[3], self.drawn.to, self.bz
        part, h, lane = (50, 50, 75, 75, 60)[self.j], U * CUT_Z[self.j], U * LANE
        go(30, lane, 0.16, h, *leg).to(3 * part, lane, 0.07, h, *leg)
        go(1, x, 0.07 - 0.03 / part, z, *leg).to(part - 1, x, 0.04, z, *leg)
        ex, ey = self.ax + 3 * U, self.by + 4 * U
        go(1, ex, 0.039, bz, *pose).to(60, ex, ey + 0.01, bz, *pose).to(20, ex, ey, bz, *pose)
        if self.j == 2:
            go(2, ex, ey - 40 * U, bz, *pose).to(6, ex, ey + 20 * U, bz, *pose).to(4, ex, ey, bz, *pose)
        self.drawn.stay(40)


@pytest.fixture(scope="module")
def iso(tmp_path_factory: pytest.TempPathFactory) -> IsoTest:
    folder = tmp_path_factory.mktemp("worked")
    names = (*PLACE, *TURNS)
    reference = written(folder / "command.csv", command().values, None, names)
    done = logs(folder, (Cycle(j).drawn.values for j in CYCLES), names)
    return told(reference, done, planes=10, rotation="rpy")


def agrees(test: IsoTest, name: str, unit: float, wanted: dict[str, float]) -> None:
    """Every place of a criterion, and the largest over all; nothing else is told of it."""
    assert {one.at for one in test.criteria if one.name == name} == {None, *wanted}
    largest = max(wanted.values(), key=abs)
    for at, number in [*wanted.items(), (None, largest)]:
        assert value(test, name, at) == pytest.approx(number * unit, abs=1e-12), (name, at)
    assert abs(test.worst_of(name).value or 0.0) == pytest.approx(abs(largest * unit), abs=1e-12)


def each(place: str, *numbers: float) -> dict[str, float]:
    return {f"{place} {k}": number for k, number in enumerate(numbers, 1)}


@pytest.mark.slow
def test_every_criterion_is_told_once_in_its_unit(iso: IsoTest) -> None:
    assert [one.name for one in iso.overall] == list(UNITS)
    assert {one.name: one.unit for one in iso.overall} == UNITS
    assert {one.cycles for one in iso.criteria} == {5}
    assert iso.to_dict()["poses"] == 4 and len(iso.cycles) == 5
    assert [one["name"] for one in iso.to_dict()["criteria"] if one["at"] is None] == list(UNITS)


def test_pose_accuracy(iso: IsoTest) -> None:
    # The five points have their barycentre in 0, K = (2, 0, 1, 1, 1) has mean 1:
    # pose 1 (20, -10, 20), pose 2 (27, -10, 20), pose 3 (32, -5, 20), pose 4 (30, -6, 20)
    # squares: 400 + 100 + 400 = 900; 729 + 100 + 400; 1024 + 25 + 400; 900 + 36 + 400
    agrees(iso, "AP", U, each("pose", 30, sqrt(1229), sqrt(1449), sqrt(1336)))


def test_pose_repeatability(iso: IsoTest) -> None:
    # K - 1 = (1, -1, 0, 0, 0) moves the first two points by +-7 along x at A, by +-(12, 5) at C:
    # A: (+-19, 0, -5), L^2 = 361 + 25 = 386; C: (+-24, +-5, -5), L^2 = 576 + 25 + 25 = 626.
    # Distances L, L, 7, 7, 10: mean (2 L + 24)/5, sum of squares 2 L^2 + 198,
    # S^2 = (2 L^2 + 198 - (2 L + 24)^2/5)/4
    # A: (970 - (2120 + 96 L)/5)/4 = 136.5 - 4.8 L; C: (1450 - (3080 + 96 L)/5)/4 = 208.5 - 4.8 L
    a = (2 * sqrt(386) + 24) / 5 + 3 * sqrt(136.5 - 4.8 * sqrt(386))
    c = (2 * sqrt(626) + 24) / 5 + 3 * sqrt(208.5 - 4.8 * sqrt(626))
    agrees(iso, "RP", U, each("pose", 19, a, c, a))


def test_angles_of_poses(iso: IsoTest) -> None:
    agrees(iso, "AP_rz", MRAD, each("pose", 2, 3, 1, 0))
    agrees(iso, "AP_ry", MRAD, each("pose", 1, 1, 0, 2))
    agrees(iso, "AP_rx", MRAD, each("pose", 0.5, 0, 2, 1))
    agrees(iso, "RP_rz", MRAD, each("pose", 3, 6, 0, 1.5))
    agrees(iso, "RP_ry", MRAD, each("pose", 1.5, 3, 1.5, 0))
    agrees(iso, "RP_rx", MRAD, each("pose", 0.75, 0, 3, 6))


def test_distances(iso: IsoTest) -> None:
    # Off along the lines: B to A by 7 K, A to C by 5 K (1, 1), B to C by K (12, 5), |(12, 5)| = 13.
    # mean K = 1, S^2 of K = (1 + 1)/4 = 1/2.
    # To pose 4, (3, 4, 0) from pose 2, in u: from B (28000 + 7 K + 3, 4), to C (20000 + 5 K - 3,
    # 20000 + 5 K - 4); K = 2, 0, 1, 1, 1.
    to_b = (hypot(28017, 4), hypot(28003, 4), hypot(28010, 4))
    to_c = (hypot(20007, 20006), hypot(19997, 19996), hypot(20002, 20001))
    mean_b, mean_c = ((p + q + 3 * r) / 5 for p, q, r in (to_b, to_c))
    s_b, s_c = (
        sqrt(((p - mean) ** 2 + (q - mean) ** 2 + 3 * (r - mean) ** 2) / 4)
        for (p, q, r), mean in ((to_b, mean_b), (to_c, mean_c))
    )
    pairs = ("poses 1-2", "poses 1-3", "poses 1-4", "poses 2-3", "poses 3-4")
    accuracies = (7, 13, mean_b - 28000, 5 * sqrt(2), mean_c - 20000 * sqrt(2))
    spreads = (21 * sqrt(0.5), 39 * sqrt(0.5), 3 * s_b, 15, 3 * s_c)  # 3 . 5 sqrt(2) . sqrt(1/2) = 15
    agrees(iso, "AD", U, dict(zip(pairs, accuracies, strict=True)))
    agrees(iso, "RD", U, dict(zip(pairs, spreads, strict=True)))


def test_variation_with_direction(iso: IsoTest) -> None:
    # A from B along (1, 0), from C along (-1, -1): 135 deg; the barycentres are (3, 4, 0) apart.
    agrees(iso, "vAP", U, {"poses 2, 4": 5})


def test_stabilisation_and_overshoot(iso: IsoTest) -> None:
    # In ms from when the final pose is reached first; that is at 0.1 mm/ms, so the band of 0.1 mm is
    # entered at -1.
    # Pose 1, cycle 1: 0.3 mm beyond at 15, back at 45: at 0.1 mm again at 15 + 30 . 2/3 = 35; 36 in all.
    # Cycle 2: 0.2 mm beyond at 20, back at 45: at 0.1 mm at 20 + 25/2 = 32.5; 33.5. The others 0.
    # Pose 4, cycle 3: 0.4 mm beyond at 10, 0.2 mm before at 40, there at 60: at 0.1 mm at 50; 51.
    agrees(iso, "PSt", 1e-3, each("pose", (36 + 33.5) / 5, 0, 0, 51 / 5))
    agrees(iso, "OV", U, each("pose", 30, 0, 0, 40))


def test_drift_of_accuracy(iso: IsoTest) -> None:
    # A tenth of 5 cycles is one: the first, with point (12, 0, -5) and K = 2, and the last, with
    # (0, 0, 10) and K = 1. Attained - commanded, and its square:
    # pose 1: (32, -10, 15) 1349, (20, -10, 30) 1400
    # pose 2: (46, -10, 15) 2441, (27, -10, 30) 1729
    # pose 3: (56, 0, 15) 3361, (32, -5, 30) 1949
    # pose 4: (49, -6, 15) 2662, (30, -6, 30) 1836
    drifts = ((1349, 1400), (2441, 1729), (3361, 1949), (2662, 1836))
    agrees(iso, "dAP", U, each("pose", *(abs(sqrt(last) - sqrt(first)) for first, last in drifts)))
    assert {one.value for one in iso.criteria if one.name == "dRP"} == {None}


def test_path_accuracy(iso: IsoTest) -> None:
    # Length 2 . 0.28 + 4 . 0.2 = 1.36; zones of 0.02 to either side of K1 at 0.76 and of K2 at 1.16:
    # 1.28 is free, planes are 0.128 apart, at 0.064, 0.192 (leg 1), 0.32, 0.448 (leg 2), 0.576, 0.704
    # (leg 3), 0.832 + 0.04 (leg 4), 0.96 + 0.04, 1.088 + 0.04 (leg 5), 1.216 + 0.08 (leg 6).
    # Legs are off by (30, 40), (5, 12), (-8, 15); before K1 by z of mean 24, behind it by x of mean
    # -70/5 = -14, too: 196 + 576 = 772; then (12, 35), before K2 z of mean -18, (-24, 7).
    agrees(iso, "AT", U, each("plane", 50, 50, 13, 13, 17, 24, sqrt(772), 37, 18, 25))


def test_path_repeatability(iso: IsoTest) -> None:
    # 19, 38 of twice the spread. Plane 6: z of 24 -20, -10, 0, 10, 20: distances 20, 10, 0, 10, 20,
    # mean 12, S^2 = (64 + 4 + 144 + 4 + 64)/4 = 70. Plane 9: 12, 6, 0, 6, 12: 0.6 of that.
    # Plane 7: x of -14 by 4, 4, 4, -6, -6 besides: squares 416, 116, 16, 136, 436, sum 1120,
    # S^2 = (1120 - (sum of roots)^2/5)/4.
    six = 12 + 3 * sqrt(70)
    roots = sqrt(416) + sqrt(116) + 4 + sqrt(136) + sqrt(436)
    seven = roots / 5 + 3 * sqrt((1120 - roots**2 / 5) / 4)
    agrees(iso, "RT", U, each("plane", 19, 19, 38, 38, 19, six, seven, 19, 0.6 * six, 19))


def test_angles_at_planes(iso: IsoTest) -> None:
    agrees(iso, "AT_rz", MRAD, each("plane", 4, 4, 5, 5, 1, 1, 2, 0, 0, 3))
    agrees(iso, "AT_ry", MRAD, each("plane", 1, 1, 0, 0, 2, 2, 3, 1, 1, 1))
    agrees(iso, "AT_rx", MRAD, each("plane", 1, 1, 3, 3, 1, 1, 0, 4, 4, 2))
    agrees(iso, "RT_rz", MRAD, each("plane", 3, 3, 4.5, 4.5, 0, 0, 1.5, 6, 6, 9))
    agrees(iso, "RT_ry", MRAD, each("plane", 3, 3, 0, 0, 6, 6, 4.5, 0, 0, 1.5))
    agrees(iso, "RT_rx", MRAD, each("plane", 6, 6, 3, 3, 1.5, 1.5, 3, 4.5, 4.5, 0))


def test_corner_rounding(iso: IsoTest) -> None:
    # The mean path comes to K1 along y = 0 and z of mean 24, and goes on beyond it: 24.
    # K2: cut from (d, 0.2) at 45 deg; on the bisector at (d/2, 0.2 - d/2), d of mean (2 . 2000 + 3 . 3000)/5
    # = 2600, across the direction of the mean path there; z of mean -18. 1300^2 + 1300^2 + 18^2 = 3380324.
    agrees(iso, "CR", U, {"corner 1": 24, "corner 2": sqrt(3380324)})


def test_corner_overshoot(iso: IsoTest) -> None:
    # From K1 to the middle of the leg behind it, y = 0.1, cycles 1 to 3 take 1 s and are furthest beyond
    # at 0.2 s: share 0.2; cycles 4 and 5 take 2 s and are at 0.8 s: share 0.4. Means of x:
    # share 0.2: (90 + 100 + 110 + 45/2 + 55/2)/5 = 70; share 0.4: (-10 - 10 - 10 + 45 + 55)/5 = 14.
    # From the line of the leg, with z: sqrt(70^2 + 24^2) = 74. K2 is cut on the inner side: 0.
    agrees(iso, "CO", U, {"corner 1": 74, "corner 2": 0})


def test_speeds(iso: IsoTest) -> None:
    # Middle halves of 0.14 and 0.1 m; mean speeds of the cycles in [mm/s], mean, 4 S^2:
    # leg 1: 100, 100, 100, 100, 80: 96, 4 . 16 + 256 = 320
    # leg 2: 100 each
    # leg 3: 125, 125, 80, 80, 100: 102, 2 . 529 + 2 . 484 + 4 = 2030
    # leg 4: 80/0.6 = 400/3 three times, 80/0.8 = 100 twice: 120, 3 . 1600/9 + 2 . 400 = 4000/3
    # leg 5: 125, 125, 100, 100, 100: 110, 2 . 225 + 3 . 100 = 750
    # leg 6: 120, 120, 80, 80, 100: 100, 4 . 400 = 1600
    agrees(iso, "AV", 0.01, each("leg", -4, 0, 2, 20, 10, 0))
    agrees(iso, "RV", 0.03, each("leg", sqrt(80), 0, sqrt(507.5), sqrt(1000 / 3), sqrt(187.5), 20))
    # Cycle 5 goes on leg 3 from 0.06 to 0.1 m in 0.2 s, from there to 0.14 m in 0.6 s: 200 and 200/3 mm/s.
    agrees(iso, "FV", 1e-3, each("leg", 0, 0, 400 / 3, 0, 0, 0))


def test_drift_of_repeatability(tmp_path: Path) -> None:
    # 11 cycles: a tenth of them is two. Two points that are 2 d apart have distances d and d from their
    # barycentre, S = 0, RP = d: first d = 3 in x, last d = 5 in (3, 4) . 1e-5. Barycentres (6, 0, 0) and
    # (0, 0, 8): dAP = 2, dRP = 2. A second pose, at (0.1, 0, 0), is always attained at (0, 1, 0): 0.
    first = ((3, 0, 0), (9, 0, 0))
    last = ((3, 4, 8), (-3, -4, 8))
    points = (*first, *((100 * k, -50 * k, 7) for k in range(7)), *last)
    rows = [row for x, y, z in points for row in ((x * U, y * U, z * U), (0.1, U, 0.0))]
    reference = still(tmp_path / "command.csv", np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)]))
    done = still(tmp_path / "visits.csv", np.array(rows))
    iso = told(reference, done, poses=True)
    assert len(iso.cycles) == 11
    agrees(iso, "dAP", U, each("pose", 2, 0))
    agrees(iso, "dRP", U, each("pose", 2, 0))
