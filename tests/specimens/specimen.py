"""The motion that every specimen holds, what a reader must find of it, and the list of the specimens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import poses_over_log
from urmpipe_models.robots.catalogue import load_robot

# q_j(t) = START_j + SLOPE_j t + WIDTH_j sin(RATE_j t + j): no two joints alike, none still, none faster than
# 3 rad/s. Within 0.6 s the fifth passes +pi upwards and the sixth -pi downwards.
START = (0.4, -1.6, 1.3, -0.9, 2.7, -2.3, 0.8)
SLOPE = (0.35, -0.2, 0.15, -0.4, 1.6, -1.7, 0.25)
WIDTH = (0.30, 0.22, 0.41, 0.35, 0.27, 0.33, 0.19)
RATE = (2.1, 2.9, 1.7, 3.3, 2.5, 1.3, 3.7)

EXACT = 2e-9
"""Motion is rounded to 1e-9 rad and 1e-9 m, so that the files do not depend on the last bit of a machine's
sine: what is written with all digits agrees with the motion to within the last of them."""


@dataclass(frozen=True)
class Truth:
    """What a log holds, whoever reads it, and how far its writer rounded.

    Attributes:
        t: Times from the first row in [s], shape (n,).
        q: Joint values in [rad] or [m], as the file limits them, shape (n, joints), in the robot's order.
        turned: The same without the file's limits to an interval: what was moved.
        t_within: Rounding of the times in [s].
        q_within: Rounding of the joint values in [rad] or [m], one for all or one a joint.
        start: The file's clock at the first row in [s], if it is not 0.
        qd: Recorded rates, where they are.
        position: Recorded tool centre point in [m], shape (n, 3).
        position_within: Its rounding in [m].
        rotation: Recorded orientation, where it is.
        rotation_within: Its rounding in [rad].
    """

    t: FloatArray
    q: FloatArray
    turned: FloatArray
    t_within: float = 1e-9
    q_within: float | tuple[float, ...] = EXACT
    start: float = 0.0
    qd: FloatArray | None = None
    position: FloatArray | None = None
    position_within: float = EXACT
    rotation: Rotation | None = None
    rotation_within: float = 10 * EXACT  # quaternions and matrices are rounded entry by entry

    @property
    def tool(self) -> FloatArray:
        """Where the tool is in [m], of a motion with a robot."""
        assert self.position is not None
        return self.position

    @property
    def turn(self) -> Rotation:
        """How the tool is turned, of a motion with a robot."""
        assert self.rotation is not None
        return self.rotation

    @property
    def rates(self) -> FloatArray:
        """The rates of a motion in [rad/s]."""
        assert self.qd is not None
        return self.qd

    def limited(self, low: float, high: float) -> Truth:
        """Return the log of encoders that show values from low up to high in [rad]."""
        return replace(self, q=np.round((self.q - low) % (high - low) + low, 9))


def motion(
    rows: int = 24, period: float = 0.02, joints: int = 6, robot: str | None = None, begin: float = 0.0
) -> Truth:
    """Return the motion on even times; with a robot also where its tool is.

    Args:
        rows: Number of samples.
        period: Time between them in [s].
        joints: How many of the seven joints.
        robot: Name of a robot of the catalogue.
        begin: Time of the motion at the first row in [s].
    """
    t = np.round(np.arange(rows) * period, 9)
    at, j = (t + begin)[:, np.newaxis], np.arange(joints)
    start, slope, width, rate = (np.array(one)[:joints] for one in (START, SLOPE, WIDTH, RATE))
    q = np.round(start + slope * at + width * np.sin(rate * at + j), 9)
    qd = np.round(slope + width * rate * np.cos(rate * at + j), 9)
    truth = Truth(t, q, q, qd=qd)
    if robot is None:
        return truth
    position, rotation = poses_over_log(load_robot(robot), q)
    return replace(truth, position=np.round(position, 9), rotation=Rotation.from_matrix(rotation))


def degrees(q: FloatArray, decimals: int = 6) -> FloatArray:
    """Return angles in [deg] with so many decimals."""
    in_degrees: FloatArray = np.degrees(q)
    return np.round(in_degrees, decimals)


def rounding(decimals: int, unit: float = 1.0) -> float:
    """Return half a unit of the last decimal in SI, and the motion's own rounding."""
    return 0.5 * 10.0**-decimals * unit + EXACT


DEG = np.pi / 180


@dataclass(frozen=True)
class Made:
    """The files of a specimen, in the order in which they are read, and what they hold.

    Attributes:
        files: Bytes by file name.
        truth: What a reader must find; None if the specimen is one that must not load as it is.
    """

    files: Mapping[str, bytes]
    truth: Truth | None = None


@dataclass(frozen=True)
class Specimen:
    """A specimen of the folder.

    Attributes:
        name: Its name, and the stem of its file.
        about: One line: what it is like, and who writes such files.
        make: Returns its files.
        folder: "" or "wrong".
    """

    name: str
    about: str
    make: Callable[[], Made]
    folder: str = ""


SPECIMENS: dict[str, Specimen] = {}


def specimen(make: Callable[[], Made]) -> Callable[[], Made]:
    """Put a function that makes a specimen on the list, under its own name and docstring."""
    folder = "wrong" if make.__module__ == "damaged" else ""
    SPECIMENS[make.__name__] = Specimen(make.__name__, str(make.__doc__).strip(), make, folder)
    return make


def made(name: str, text: str | bytes, truth: Truth | None = None, encoding: str = "utf-8") -> Made:
    """Return a specimen of one file."""
    return Made({name: text if isinstance(text, bytes) else text.encode(encoding)}, truth)


def lines(*rows: str, end: str = "\n") -> str:
    """Return rows with a line end after each."""
    return end.join([*rows, ""])
