"""What is found of a network: assemblies, what does not close, and how much moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from urmpipe_models.arrays import FloatArray

NetworkKind = Literal["mechanism", "structure"]


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """A configuration in which everything closes, or one that comes as near to that as was found.

    Attributes:
        values: The values of each control, joint (driven ones, too) and body with freedoms of its own, by its
            name, in [rad] and [m] by `Joint.units` and `POSE_UNITS`, of a control as it is given.
        poses: The bodies in the ground, the ground first, in the order of `Network.body_names`, as matrices
            [-] and [m], shape (bodies, 4, 4).
        residual: The largest gap in [m] and [rad].
        mobility: Variables less the rank of the Jacobian.
    """

    values: dict[str, tuple[float, ...]]
    poses: FloatArray
    residual: float
    mobility: int


@dataclass(frozen=True, slots=True)
class Gap:
    """What does not close.

    Attributes:
        name: The cut joint, or the element.
        loop: The names of the joints of its loop; of an element its own.
        metres: How far apart it is in [m]; what an element is too long or too short by.
        radians: By which angle it is turned away in [rad]; what a gear or a rocker is off by.
    """

    name: str
    loop: tuple[str, ...]
    metres: float
    radians: float


@dataclass(frozen=True, slots=True)
class Redundant:
    """A constraint that forbids what others forbid already.

    Attributes:
        joint: The joint or the element.
        constraint: Which of its constraints, such as "rotation about m".
    """

    joint: str
    constraint: str


@dataclass(frozen=True, slots=True)
class Mobility:
    """How much of an assembled network moves.

    Attributes:
        variables: How many there are: controls that can be set, free variables of joints, six of each body
            that no joint ties to the ground.
        rank: Of the Jacobian.
        kutzbach: 6 (bodies - 1) - sum of (6 - f) - elements - what controls take.
        redundant: Constraints whose loss would set nothing free; mobility less kutzbach of them.
        idle: Bodies that spin about the line through two global joints and move nothing else; those that spin
            together joined by " + ".
        nearby: The mobility at configurations near to this one, that are assembled, too.
    """

    variables: int
    rank: int
    kutzbach: int
    redundant: tuple[Redundant, ...]
    idle: tuple[str, ...]
    nearby: int

    @property
    def mobility(self) -> int:
        """Variables less rank."""
        return self.variables - self.rank

    @property
    def special(self) -> bool:
        """Whether the rank falls here against assembled configurations nearby."""
        return self.nearby < self.mobility

    @property
    def kind(self) -> NetworkKind:
        """A mechanism if anything but idle spins moves, else a structure."""
        return "mechanism" if self.nearby > len(self.idle) else "structure"
