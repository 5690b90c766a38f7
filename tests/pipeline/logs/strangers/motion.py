"""How arms move and what is recorded beside their joints: the truth that strangers' files hold.

Joints are smooth, come with their exact rates, and reach each end of their motion more than once, so that no
joint looks like a clock unless it is made to.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.math3d import to_quaternions
from urmpipe_models.robots.catalogue import load_robot

FASTEST = 2.0
"""No joint turns faster, in [rad/s]."""


@dataclass(frozen=True)
class Motion:
    """What happened, in SI.

    Attributes:
        t: Times in [s], the first 0, shape (n,).
        q: Joint angles in [rad], shape (n, joints).
        qd: Their exact rates in [rad/s].
        seed: What draws whatever is recorded beside them.
        robot: Name of the robot of the catalogue that moved; empty if it is none of them.
    """

    t: FloatArray
    q: FloatArray
    qd: FloatArray
    seed: int = 0
    robot: str = ""

    @property
    def joints(self) -> int:
        return int(self.q.shape[1])

    @property
    def wrapped(self) -> Motion:
        """The same by encoders that show -pi to pi."""
        return replace(self, q=(self.q + np.pi) % (2 * np.pi) - np.pi)

    def rising(self, joint: int, reach: float = 2.5) -> Motion:
        """The same with one joint that only ever increases, by so much in [rad], never still."""
        q, qd = self.q.copy(), self.qd.copy()
        part = self.t / self.t[-1]
        # reach (x + 0.06 (1 - cos 4 pi x) / ...) has a rate of 1 +- 0.75 of the mean: it never stands still
        q[:, joint] = -1.1 + reach * (part - 0.06 * np.sin(4 * np.pi * part))
        qd[:, joint] = reach / self.t[-1] * (1 - 0.24 * np.pi * np.cos(4 * np.pi * part))
        return replace(self, q=q, qd=qd)

    def padded(self, rows: int) -> Motion:
        """The same with rows of zeros behind it."""
        t, q, qd = (np.concatenate((a, np.zeros((rows, *a.shape[1:])))) for a in (self.t, self.q, self.qd))
        return replace(self, t=t, q=q, qd=qd)

    @property
    def tau(self) -> FloatArray:
        """Torques in [N m]: gravity, friction and noise, no joint's derivative."""
        rng = np.random.default_rng(self.seed + 1)
        weight = np.linspace(38.0, 2.0, self.joints)
        gravity = weight * np.cos(self.q + 0.5 * np.roll(self.q, 1, axis=1) + 0.3)
        noise = rng.normal(0.0, 0.15, self.q.shape)
        return np.round(gravity + 1.2 * np.tanh(6 * self.qd) + noise, 6)

    @property
    def current(self) -> FloatArray:
        """Currents in [A]."""
        return np.round(self.tau / 11.0 + 0.2, 4)

    @property
    def temperature(self) -> FloatArray:
        """Temperatures of the drives in [degC], by tenths, slowly rising."""
        rise = 3.0 * (1 - np.exp(-self.t / 8.0))
        noise = np.random.default_rng(self.seed + 2).normal(0.0, 0.08, self.q.shape)
        return np.round(np.linspace(27.0, 34.0, self.joints) + rise[:, np.newaxis] + noise, 1)

    @property
    def wheels(self) -> FloatArray:
        """Angles of four wheels in [rad], ever increasing, shape (n, 4)."""
        rate = np.array([5.0, 5.6, 4.7, 5.3])
        return np.round(np.outer(self.t, rate) + 0.1 * np.sin(np.outer(self.t, rate / 9)), 6)

    @property
    def rocking(self) -> FloatArray:
        """Angles of four wheels in [rad] that turn to and fro by several turns, shape (n, 4)."""
        part = 2 * np.pi * self.t / self.t[-1]
        return np.round(14 * np.sin(np.outer(part, [1.0, 1.3, 0.8, 1.1]) + np.arange(4)), 6)

    @property
    def gripper(self) -> FloatArray:
        """Width of a gripper in [m], open, closed and open again, shape (n, 1)."""
        part = self.t / self.t[-1]
        closed: FloatArray = ((part > 0.3) & (part < 0.7)).astype(np.float64)
        return np.round(0.08 - 0.05 * closed, 6)[:, np.newaxis]

    @property
    def tip(self) -> FloatArray:
        """Tool centre point in [m] of a robot of the catalogue, shape (n, 3)."""
        position, _ = poses_over_log(load_robot(self.robot), self.q)
        return position

    @property
    def turn(self) -> FloatArray:
        """Orientation of its tool as quaternions x, y, z, w, shape (n, 4)."""
        _, rotation = poses_over_log(load_robot(self.robot), self.q)
        turn: FloatArray = to_quaternions(rotation.reshape(-1, 9), "matrix")
        return turn

    @property
    def matrix(self) -> FloatArray:
        """Its poses as rows of [R | p], shape (n, 12)."""
        position, rotation = poses_over_log(load_robot(self.robot), self.q)
        poses: FloatArray = np.concatenate((rotation, position[:, :, np.newaxis]), axis=2)
        return poses.reshape(-1, 12)


def times(rows: int, period: float = 0.02, jitter: float = 0.0, seed: int = 0) -> FloatArray:
    """Return times in [s] on whole microseconds from 0; the steps differ by that part of the period."""
    steps = np.random.default_rng(seed).uniform(1 - jitter, 1 + jitter, rows - 1) * period
    t: FloatArray = np.concatenate(([0.0], np.cumsum(steps)))
    return np.round(t, 6)


def sines(t: FloatArray, joints: int = 6, seed: int = 0, rest: float = 0.0, drift: float = 0.0) -> Motion:
    """Return joints that swing, after a rest.

    Args:
        t: Times in [s].
        joints: How many.
        seed: Draws middles, widths and frequencies.
        rest: How long the arm stands first, in [s].
        drift: How far each joint gets beside its swinging, in [rad].
    """
    rng = np.random.default_rng(seed)
    span = t[-1] - rest
    cycles = rng.uniform(1.2, 3.0, joints)
    rate = 2 * np.pi * cycles / span
    width = np.minimum(rng.uniform(0.4, 1.1, joints), 0.5 * FASTEST / rate)
    middle, phase = rng.uniform(-1.7, 1.7, joints), rng.uniform(0, 2 * np.pi, joints)
    # The arm gets going over the ramp: moved time u grows as (t - rest)^2 / (2 ramp), then as t.
    ramp, since = 0.1 * span, np.maximum(t - rest, 0.0)
    u = np.where(since < ramp, since**2 / (2 * ramp), since - ramp / 2)[:, np.newaxis]
    du = np.minimum(since / ramp, 1.0)[:, np.newaxis]
    slope = drift / span
    q = middle + width * np.sin(rate * u + phase) + slope * u
    return Motion(t, q, (width * rate * np.cos(rate * u + phase) + slope) * du, seed)


def moves(t: FloatArray, joints: int = 6, seed: int = 0, count: int = 4) -> Motion:
    """Return so many moves from pose to pose, all joints together, each a trapezoid of speed, and rests."""
    rng = np.random.default_rng(seed)
    width = t[-1] / (count + 0.5)
    quarter, top = 0.2, 1 / 0.8  # a fifth speeds up, a fifth slows down: the top speed is 1 / 0.8 of the mean
    reach = min(1.3, 0.5 * FASTEST * 0.8 * width / top)
    poses = rng.uniform(-reach, reach, (count + 1, joints)) + rng.uniform(-1.2, 1.2, joints)
    q = np.repeat(poses[:1], len(t), axis=0)
    qd = np.zeros_like(q)
    for k in range(count):
        x = np.clip((t - (k + 0.5) * width) / (0.8 * width), 0.0, 1.0)
        up, down = np.minimum(x, quarter), np.maximum(x - (1 - quarter), 0.0)
        part = top * (up**2 / (2 * quarter) + np.maximum(x - quarter, 0.0) - down**2 / (2 * quarter))
        rate = np.where((x > 0) & (x < 1), top * (up - down) / quarter, 0.0) / (0.8 * width)
        q += np.outer(part, poses[k + 1] - poses[k])
        qd += np.outer(rate, poses[k + 1] - poses[k])
    return Motion(t, q, qd, seed)


def of_robot(name: str, t: FloatArray, seed: int = 0) -> Motion:
    """Return a motion of a robot of the catalogue, whose tool is then known."""
    return replace(sines(t, len(load_robot(name).joints), seed), robot=name)
