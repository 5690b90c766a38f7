"""Motion of a driven network: the configurations along its drives, on the branch of the start.

1. `Drive`: which variables are prescribed and which follow; the closure F(y, s) = 0 along a straight line
   of the prescribed ones, x_d = x_d0 + s dx_d, in scaled coordinates z = (y, s).
2. `trace_branch`: predictor-corrector continuation of F = 0 by arc length. The tangent t spans the null space
   of dF/dz; each step follows it and returns to the curve at right angles to it; the steps follow the
   curvature. The orientation det [dF/dz; t^T] has one sign along a branch. A step that changes it is refined,
   until the branch itself bends, or the point is reached where two branches cross.
3. Singular poses, where the rank of dF/dy falls: the motion turns back (dF/ds is not in the range of dF/dy),
   branches (two curves cross), or goes through.
4. `sample_branch`: configurations at values of s, by Newton from cubic curves between the nodes; about
   singular poses by polynomials through configurations around them.

`row_motion` follows rows of a log that are not on a line.

Source: Allgower and Georg 2003, Introduction to Numerical Continuation Methods, chapters 2, 6 and 8.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from urmpipe_models.elementwise import FloatArray, IndexArray
from urmpipe_models.networks.closure import close_by_newton, evaluate_scaled_closure, iter_chunks
from urmpipe_models.networks.joint_motion import wrap_rotation_vector
from urmpipe_models.networks.mechanism import Mechanism
from urmpipe_models.networks.mobility import find_spinning_bodies

Passage = Literal["turns back", "branches", "goes through"]

FIRST_STEP, MAX_STEP, MIN_STEP = 0.02, 0.15, 1e-8  # arc length, in lengths of the mechanism and rad
MAX_TURN = 0.12  # rad between tangents: a cubic curve between nodes misses the branch by about 1e-6
MAX_CORRECTION = 0.2  # share of a step: a corrector that moves further has left the neighbourhood
CORRECTIONS = 7  # Newton steps of a corrector; four are usual
CONVERGED = 1e-10  # size of a Newton step after which the next one is rounding
ROUNDING = 1e-13  # residual of a closed configuration, in lengths of the mechanism and rad
CROSSING = 1e-4  # determinant, as a share of that at the last node, which counts as 0: rounding is 1e-5
NOISE = 1e-6  # rounding of a tangent at most, next to a pose where branches nearly meet; 2e-10 was seen
SINGULAR = 1e-6  # smallest singular value of the scaled Jacobian that counts as 0
STENCIL = 4e-3  # arc length between the configurations around a singular pose that interpolate it
OVERRUN = 0.02  # arc length of the drive that is traced beyond an end near a singular pose
MAX_LENGTH = 2000.0  # scaled length of a drive: 300 turns of a crank, which take some minutes

Segment: TypeAlias = "tuple[Node, Node]"


@dataclass(frozen=True, slots=True, eq=False)
class SingularPose:
    """A pose of a motion at which the Jacobian of the variables that follow loses rank.

    Attributes:
        passage: What the motion does there: it turns back, branches or goes through.
        s: Its place along the drive [-]; of a log its row from 0, with a fraction.
        x: The variables in [m], [rad] and as controls are given, shape (variables,).
        direction: The direction that becomes free, in `column_scales` [-], the largest entry 1, shape
            (variables,).
    """

    passage: Passage
    s: float
    x: FloatArray
    direction: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LimitStop:
    """A limit of a variable that ends a motion.

    Attributes:
        name: The variable: its owner, with its number from 1 if that has several.
        unit: m, rad, or "" of a control.
        limit: The limit in `unit`, of a control as it is given.
        s: Where the motion ends, as in `SingularPose`.
        x: The variables there in [m], [rad] and as controls are given, shape (variables,).
    """

    name: str
    unit: str
    limit: float
    s: float
    x: FloatArray


class Node(NamedTuple):
    """A solution z = (y, s) with its unit tangent t and the matrix [dF/dz; W^T; t^T], W the idle spins.

    `distance` from a singular pose: the smallest singular value of dF/dy without idle spins.
    """

    z: FloatArray
    tangent: FloatArray
    matrix: FloatArray
    distance: float


@dataclass(eq=False)
class Trace:
    """A branch along a straight drive.

    Attributes:
        segments: Its pieces between two nodes in the same coordinates, s increasing.
        singular: The singular poses on it, each with its node.
        stop: The limit that ends it, if one does.
        complete: Whether the end of the drive is reached.
    """

    segments: list[Segment] = field(default_factory=list)
    singular: list[tuple[SingularPose, Node]] = field(default_factory=list)
    stop: LimitStop | None = None
    complete: bool = False


@dataclass(frozen=True, eq=False)
class Drive:
    """A straight drive of a mechanism.

    Attributes:
        mechanism: The network.
        x: The prescribed variables where s is 0, and all others anywhere on the branch, shape (variables,),
            in [m], [rad] and as controls are given.
        change: What s = 1 adds to the prescribed variables in [m], [rad], shape (variables,); 0 of others.
        free: The numbers of the variables that follow, shape (free,) [-].
        limits: Lower and upper limits of all variables in [m], [rad], shape (variables, 2), or infinite.
    """

    mechanism: Mechanism
    x: FloatArray
    change: FloatArray
    free: IndexArray
    limits: FloatArray

    @cached_property
    def scales(self) -> FloatArray:
        """A step of each variable that follows in [m], [rad], shape (free,)."""
        return self.mechanism.column_scales[self.free]

    @cached_property
    def bounds(self) -> FloatArray:
        """The limits of the variables that follow [-], shape (free, 2)."""
        return self.limits[self.free] / self.scales[:, np.newaxis]

    @cached_property
    def length(self) -> float:
        """The scaled length of the drive [-]: s times it is the last coordinate of z."""
        return float(np.linalg.norm(self.change / self.mechanism.column_scales))

    @cached_property
    def spins(self) -> int:
        """The number of idle spins, which no drive prescribes."""
        return len(find_spinning_bodies(self.mechanism, self.x))

    def at(self, z: FloatArray) -> FloatArray:
        """Return the variables in [m], [rad], shape (variables, n), of z [-], shape (free + 1, n)."""
        x = self.x[:, np.newaxis] + self.change[:, np.newaxis] * (z[-1:] / self.length)
        x[self.free] = z[:-1] * self.scales[:, np.newaxis]
        return x

    def coordinates(self, x: FloatArray, s: float) -> FloatArray:
        """Return z [-], shape (free + 1,), of variables in [m], [rad], shape (variables,)."""
        return np.append(x[self.free] / self.scales, s * self.length)

    def closure(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return F and dF/dz [-], shapes (rows,) and (rows, free + 1), of z of shape (free + 1,)."""
        closure = evaluate_scaled_closure(self.mechanism, self.at(z[:, np.newaxis]))
        jacobian = closure.jacobian[:, :, 0]
        along = jacobian @ (self.change / self.mechanism.column_scales) / self.length
        return closure.residual[:, 0], np.column_stack((jacobian[:, self.free], along))

    def wrapped(self, z: FloatArray) -> FloatArray:
        """Return z [-], shape (free + 1,), with rotation vectors of pi at most: two pi is singular."""
        x = self.at(z[:, np.newaxis])
        for part in self.mechanism.rotations:
            x[part] = wrap_rotation_vector(tuple(x[part]))
        return self.coordinates(x[:, 0], float(z[-1]) / self.length)

    def correct(self, z: FloatArray, normal: FloatArray) -> FloatArray | None:
        """Return the solution of F = 0, normal . (z - z_start) = 0 next to z; None without convergence.

        All have the shape (free + 1,) [-].
        """
        start, size = z, np.inf
        for _ in range(CORRECTIONS):
            residual, jacobian = self.closure(z)
            if not np.isfinite(jacobian).all():
                return None
            matrix = np.vstack((jacobian, normal))
            step = np.linalg.lstsq(matrix, -np.append(residual, normal @ (z - start)), rcond=1e-12)[0]
            z, before, size = z + step, size, float(np.linalg.norm(step))
            if size < CONVERGED:
                return z
            if size > 0.5 * before:  # it does not converge, or only rounding is left next to a singular pose
                return z if size < 1e-6 and np.abs(residual).max() < ROUNDING else None
        return None

    def node(self, z: FloatArray, before: FloatArray | None = None) -> Node:
        """Return the node at a solution z; its tangent has the direction of `before`, else that of s.

        Both have the shape (free + 1,) [-]. Of the null space of dF/dz the tangent is the part orthogonal
        to the idle spins: these do not change s.
        """
        jacobian = self.closure(z)[1]
        columns = len(z)
        null = np.linalg.svd(jacobian)[2][columns - self.spins - 1 :].T
        along = null[-1]
        tangent = null @ along if np.linalg.norm(along) > 1e-3 or before is None else null @ (null.T @ before)
        tangent = tangent / (float(np.linalg.norm(tangent)) or 1.0)
        if before is not None and tangent @ before < 0.0:
            tangent = -tangent
        values = np.zeros(columns)
        local = np.linalg.svd(jacobian[:, :-1], compute_uv=False)
        values[: len(local)] = local
        distance = float(values[columns - 2 - self.spins])
        spins = np.linalg.svd(null - np.outer(tangent, tangent @ null))[0][:, : self.spins]
        return Node(z, tangent, np.vstack((jacobian, spins.T, tangent)), distance)


def _orientation(before: Node, after: Node, spins: int) -> tuple[float, float]:
    """Return the cosine between the orientations of nodes with matrices A, B, and det(A^T B) / det(A^T A).

    By Cauchy and Binet det(A^T B) is the scalar product of their minors, defined for redundant rows, too. Its
    sign changes where branches cross.
    """
    first, second = before.matrix, after.matrix
    if spins and np.linalg.det(second[-1 - spins : -1] @ first[-1 - spins : -1].T) < 0.0:
        second = np.array(second)  # the basis of the spins has either orientation: that of the first is taken
        second[-2] = -second[-2]
    sign, size = np.linalg.slogdet(first.T @ second)
    local = [float(np.linalg.slogdet(matrix.T @ matrix)[1]) for matrix in (first, second)]
    with np.errstate(under="ignore", invalid="ignore"):
        cosine, share = np.exp(size - 0.5 * (local[0] + local[1])), np.exp(size - local[0])
    return float(np.nan_to_num(sign * cosine)), float(np.nan_to_num(sign * share))


def _angle_between(before: Node, after: Node) -> float:
    return float(np.arccos(np.clip(before.tangent @ after.tangent, -1.0, 1.0)))


# ---------------------------------------------------------------------------------------- continuation


def trace_branch(
    drive: Drive, s: float, end: float = 1.0, progress: Callable[[float], None] = lambda share: None
) -> Trace:
    """Trace the branch of `drive.x`, which closes at s, to another s.

    Args:
        drive: The drive.
        s: The place of `drive.x` along it.
        end: Where to: s increases or decreases.
        progress: Called with the share of the way that is done, 0..1.
    """
    branch = _Tracer(drive, drive.node(drive.coordinates(drive.x, s)), end, progress).run()
    if end < s:
        branch.segments = [(_reversed(b), _reversed(a)) for a, b in reversed(branch.segments)]
    return branch


def _reversed(node: Node) -> Node:
    return node._replace(tangent=-node.tangent, matrix=np.vstack((node.matrix[:-1], -node.tangent)))


class _Tracer:
    """The trace from a node in one direction of s."""

    def __init__(self, drive: Drive, first: Node, end: float, progress: Callable[[float], None]) -> None:
        self.drive, self.progress = drive, progress
        self.begin, self.end = float(first.z[-1]), end * drive.length
        self.sign = 1.0 if self.end > self.begin else -1.0
        self.here = first if self.sign > 0.0 else _reversed(first)
        self.before = self.here
        self.step = FIRST_STEP
        self.last: Node | None = None  # at the end of the drive, if a segment crosses it
        self.trace = Trace()

    def run(self) -> Trace:
        """Trace to the end, and beyond it where a singular pose is near: poses there are interpolated."""
        while True:
            there = self._advance()
            if there is None:
                return self._finish()
            turns_back = self.sign * there.tangent[-1] <= 0.0
            if turns_back:
                there = self._find_extreme(there)
            if self._is_beyond(there):
                if not self._reach(there):
                    return self._finish()
                continue
            if turns_back:
                self.trace.segments.append((self.here, there))
                self._record("turns back", there, there.tangent)
                self.trace.complete |= self.sign * (there.z[-1] - self.end) >= -ROUNDING
                return self.trace
            self._touch(there)
            self._append(there)
            if not self.trace.complete:
                self.progress(abs((there.z[-1] - self.begin) / (self.end - self.begin)))

    def _finish(self) -> Trace:
        """Add the node at the end of the drive if no segment crosses it."""
        if self.last is not None and self.sign * (self.last.z[-1] - self.here.z[-1]) > 0.0:
            self._touch(self.last)
            self._append(self.last)
        return self.trace

    def _append(self, there: Node) -> None:
        """Add a segment, and continue from its end in coordinates that are far from singular."""
        self.trace.segments.append((self.here, there))
        self.before, z = self.here, self.drive.wrapped(there.z)
        if (z != there.z).any():
            moved = self.drive.wrapped(there.z + 1e-5 * there.tangent) - z
            there = self.drive.node(z, moved)
            if self.last is not None:
                self.last = self.drive.node(self.drive.wrapped(self.last.z), there.tangent)
        self.here = there

    def _is_beyond(self, there: Node) -> bool:
        lower, upper = self.drive.bounds.T
        is_outside = ((there.z[:-1] < lower - ROUNDING) | (there.z[:-1] > upper + ROUNDING)).any()
        return bool(is_outside or self.sign * (there.z[-1] - self.end) >= 0.0)

    def _advance(self) -> Node | None:
        """Return the next node; None where no step succeeds."""
        here = self.here
        while self.step > MIN_STEP:
            there = self._try(here, self.step)
            if there is not None and (turn := _angle_between(here, there)) < MAX_TURN:
                cosine, _ = _orientation(here, there, self.drive.spins)
                crossing = self._crossing(here, there) if cosine < 0.0 else None
                if crossing is not None and not self._is_recorded(
                    crossing
                ):  # on a step across the end before
                    self._record("branches", crossing, there.tangent)
                if cosine > 0.3 or crossing is not None:
                    self.step = min(self.step * min(2.0, 0.7 * MAX_TURN / max(turn, 1e-9)), MAX_STEP)
                    return there
            self.step *= 0.5
        return None

    def _try(self, here: Node, step: float) -> Node | None:
        """Return the node a step further along the tangent; None if the corrector leaves it."""
        predicted = here.z + step * here.tangent
        z = self.drive.correct(predicted, here.tangent)
        if z is None or np.linalg.norm(z - predicted) > MAX_CORRECTION * abs(step) + CONVERGED:
            return None
        return self.drive.node(z, here.tangent)

    def _crossing(self, here: Node, there: Node) -> Node | None:
        """Return where branches cross between two nodes: the determinant is continuous, and 0 there.

        None where it jumps: the step went from one branch to another that is near. The pose is the root of a
        cubic polynomial through configurations around it: there Newton's method loses half of the digits.
        """

        def share(node: Node) -> float:
            return _orientation(here, node, self.drive.spins)[1]

        rough = self._root(here, there, share, CROSSING)
        if rough is None:
            return None
        middle = float(here.tangent @ (rough.z - here.z))
        steps = middle + STENCIL * np.array([-2.0, -1.0, 1.0, 2.0])
        nodes = [node for step in steps.tolist() if (node := self._try(here, step)) is not None]
        if len(nodes) < len(steps):
            return rough
        roots = np.roots(np.polyfit(steps - middle, [share(node) for node in nodes], 3))
        root = float(roots[np.argmin(np.abs(roots))].real)
        cubics = np.polyfit(steps - middle, [node.z for node in nodes], 3).T
        return self.drive.node(np.array([np.polyval(cubic, root) for cubic in cubics]), here.tangent)

    def _find_extreme(self, there: Node) -> Node:
        """Return the node between two at which s has its extreme."""
        node = self._root(self.here, there, lambda node: self.sign * float(node.tangent[-1]), 1e-13)
        return there if node is None else node

    def _root(
        self, here: Node, there: Node, function: Callable[[Node], float], tolerance: float
    ) -> Node | None:
        """Return the node between two at which a function vanishes; None if it jumps over 0."""
        low, high = 0.0, float(here.tangent @ (there.z - here.z))
        at_low, at_high, best = function(here), function(there), there
        for count in range(80):
            share = at_low / (at_low - at_high) if count % 3 else 0.5
            middle = low + float(np.clip(share, 0.02, 0.98)) * (high - low)
            node = self._try(here, middle)
            if node is None:
                return None
            best, value = node, function(node)
            if abs(value) < tolerance:
                return node
            if value > 0.0:
                low, at_low = middle, value
            else:
                high, at_high = middle, value
            if high - low < 1e-15:
                break
        return best if max(abs(at_low), abs(at_high)) < max(1e3 * tolerance, NOISE) else None

    def _touch(self, there: Node) -> None:
        """Record a singular pose that the motion passes without a change of its orientation."""
        before, here = self.before, self.here
        if before is here or not before.distance > here.distance < there.distance:
            return
        low, high = -float(here.tangent @ (here.z - before.z)), float(here.tangent @ (there.z - here.z))
        best, golden = here, 0.5 * (5.0**0.5 - 1.0)
        for _ in range(60):
            steps = (high - golden * (high - low), low + golden * (high - low))
            nodes = [self._try(here, step) if abs(step) > MIN_STEP else here for step in steps]
            values = [np.inf if node is None else node.distance for node in nodes]
            least = min(values)
            if least < best.distance:
                best = nodes[values.index(least)] or best
            low, high = (low, steps[1]) if values[0] < values[1] else (steps[0], high)
            falls = max(before.distance, there.distance) * (high - low)
            if best.distance < SINGULAR or best.distance > 4.0 * falls:
                break  # at 0, or in a valley above it
        if best.distance < 10.0 * SINGULAR and not self._is_recorded(best):
            passage: Passage = "branches" if self._branches(best, here.tangent) else "goes through"
            self._record(passage, best, here.tangent)

    def _branches(self, node: Node, tangent: FloatArray) -> bool:
        """Return whether another curve of solutions passes through a singular node."""
        _, values, vectors = np.linalg.svd(node.matrix[: self.drive.mechanism.rows])
        null = vectors[int((values > 1e-4).sum()) :].T
        radius = 1e-2  # arc length of the trials
        for weights in np.random.default_rng(0).normal(size=(24, null.shape[1])):
            direction = null @ (weights / np.linalg.norm(weights))
            z = self.drive.correct(node.z + radius * direction, direction)
            offset = np.zeros_like(direction) if z is None else z - node.z
            size = float(np.linalg.norm(offset))
            if 0.5 * radius < size < 2.0 * radius and abs(offset @ tangent) < 0.9 * size:
                return True
        return False

    def _reach(self, there: Node) -> bool:
        """Add the node at the end of the drive or at a limit before it; return whether to continue."""
        drive, here = self.drive, self.here
        share, coordinate, value = np.inf, -1, self.end  # of the first limit, or of the end of the drive
        if self.sign * (there.z[-1] - self.end) >= 0.0:
            share = _first_share(here, there, -1, self.end)
        for k, (lower, upper) in enumerate(drive.bounds.tolist()):
            for bound, sign in ((lower, -1.0), (upper, 1.0)):
                if sign * (there.z[k] - bound) > ROUNDING:  # beyond it there; perhaps here already
                    is_beyond = sign * (here.z[k] - bound) >= 0.0
                    at = 0.0 if is_beyond else _first_share(here, there, k, bound)
                    if at < share:
                        share, coordinate, value = at, k, bound
        if share == 0.0 and coordinate >= 0:
            self._stop(coordinate, value, here)
            return False
        z = _Cubic.between(here, there).at(np.array([share]))[:, 0]
        z[coordinate] = value
        solution = drive.correct(z, np.eye(len(z))[coordinate])
        node = there if solution is None else drive.node(solution, here.tangent)
        if coordinate < 0 and not self.trace.complete and node.distance <= OVERRUN:
            # a segment across the end: the tangent of a node where branches cross has any direction
            chord = node.z - here.z
            chord /= float(np.linalg.norm(chord)) or 1.0
            node = node._replace(tangent=2.0 * (chord @ here.tangent) * chord - here.tangent)
            self.trace.complete, self.end, self.last = True, self.end + self.sign * OVERRUN, node
            return True
        self._touch(node)
        self._append(node)
        if coordinate >= 0:
            self._stop(coordinate, value, node)
        self.trace.complete |= coordinate < 0
        return False

    def _stop(self, coordinate: int, value: float, node: Node) -> None:
        """Record the limit that ends the trace, unless it is beyond the end of the drive."""
        drive, mechanism = self.drive, self.drive.mechanism
        if self.trace.complete:
            return
        poses = self.trace.singular  # one in the same step may be beyond the limit
        self.trace.singular = [pose for pose in poses if self.sign * (pose[1].z[-1] - node.z[-1]) <= 0.0]
        place, x = int(drive.free[coordinate]), drive.at(node.z[:, np.newaxis])[:, 0]
        limit, s = value * float(drive.scales[coordinate]), float(node.z[-1]) / drive.length
        unit = mechanism.variables[place].unit
        self.trace.stop = LimitStop(mechanism.labels[place], unit, limit, s, x)

    def _is_recorded(self, pose: Node) -> bool:
        z = self.drive.wrapped(pose.z)
        known = (self.drive.wrapped(node.z) for _, node in self.trace.singular)
        return any(np.allclose(z, other, rtol=0.0, atol=1e-4) for other in known)

    def _record(self, passage: Passage, node: Node, tangent: FloatArray) -> None:
        drive, direction = self.drive, np.zeros(len(self.drive.x))
        vectors = np.linalg.svd(node.matrix[: drive.mechanism.rows, :-1])[2]
        followers = vectors[len(drive.free) - 1 - drive.spins]
        direction[drive.free] = node.tangent[:-1] if passage == "turns back" else followers
        direction /= direction[int(np.argmax(np.abs(direction)))] or 1.0
        x = drive.at(node.z[:, np.newaxis])[:, 0]
        pose = SingularPose(passage, float(node.z[-1]) / drive.length, x, direction)
        self.trace.singular.append((pose, node._replace(tangent=tangent)))


class _Cubic(NamedTuple):
    """Cubic curves of z between ends, with derivatives by their shares there, shape (coordinates, n) each."""

    first: FloatArray
    second: FloatArray
    leaving: FloatArray
    arriving: FloatArray

    @classmethod
    def between(cls, here: Node, there: Node) -> _Cubic:
        """Return the curve between two nodes with their tangents."""
        chord = float(np.linalg.norm(there.z - here.z))
        parts = (here.z, there.z, chord * here.tangent, chord * there.tangent)
        return cls(*(part[:, np.newaxis] for part in parts))

    def at(self, share: FloatArray) -> FloatArray:
        """Return points at shares 0..1, shape (coordinates, n)."""
        square, cube = share * share, share * share * share
        return np.asarray(
            (1.0 - 3.0 * square + 2.0 * cube) * self.first
            + (3.0 * square - 2.0 * cube) * self.second
            + (share - 2.0 * square + cube) * self.leaving
            + (cube - square) * self.arriving
        )

    def shares(self, last: FloatArray) -> FloatArray:
        """Return where the curves reach values of their last coordinate, by bisection, shape (n,)."""
        along = _Cubic(*(part[-1:] for part in self))
        low, high = np.zeros(len(last)), np.ones(len(last))
        for _ in range(45):
            middle = 0.5 * (low + high)
            before = along.at(middle)[0] < last
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        return 0.5 * (low + high)


def _first_share(here: Node, there: Node, coordinate: int, value: float) -> float:
    """Return where the cubic curve between two nodes takes a value of a coordinate first."""
    curve, shares = _Cubic.between(here, there), np.linspace(0.0, 1.0, 65)
    values = curve.at(shares)[coordinate] - value
    first = int(np.argmax(values * values[0] <= 0.0))
    low, high = shares[max(first - 1, 0)], shares[first]
    for _ in range(50):
        middle = 0.5 * (low + high)
        is_before = (curve.at(np.array([middle]))[coordinate, 0] - value) * values[0] > 0.0
        low, high = (middle, high) if is_before else (low, middle)
    return float(0.5 * (low + high))


# ---------------------------------------------------------------------------------------- samples


class BranchDerivatives(NamedTuple):
    """Derivatives along a drive where Jacobians do not give them, next to points where branches meet.

    Attributes:
        rows: The numbers of the samples, shape (k,) [-].
        first: dx/ds in [m], [rad] and as controls are given, shape (variables, k).
        second: d2x/ds2, likewise, shape (variables, k).
    """

    rows: IndexArray
    first: FloatArray
    second: FloatArray


def sample_branch(drive: Drive, branch: Trace, s: FloatArray) -> tuple[FloatArray, list[BranchDerivatives]]:
    """Return the configurations of a trace at places s, and its derivatives where branches meet.

    Args:
        drive: The drive.
        branch: Its trace, which reaches all places.
        s: The places [-], shape (n,).

    Returns:
        Configurations in [m], [rad] and as controls are given, shape (variables, n), and derivatives.
    """
    at = s * drive.length
    ends = np.array([second.z[-1] for _, second in branch.segments])
    which = np.minimum(np.searchsorted(ends, at), len(ends) - 1)
    stacks = [np.array([pair[k].z for pair in branch.segments]).T for k in (0, 1)]
    chords = np.linalg.norm(stacks[1] - stacks[0], axis=0)
    tangents = [chords * np.array([pair[k].tangent for pair in branch.segments]).T for k in (0, 1)]
    x = np.empty((len(drive.x), len(s)))
    for rows in iter_chunks(len(s)):
        local = which[rows]
        curve = _Cubic(*(part[:, local] for part in (*stacks, *tangents)))
        z = curve.at(curve.shares(at[rows]))
        z[-1] = at[rows]
        x[:, rows] = close_by_newton(drive.mechanism, drive.at(z), drive.free)
    interpolated = [_interpolate(drive, pose, node, at, x) for pose, node in branch.singular]
    return x, [slopes for slopes in interpolated if slopes is not None]


def _interpolate(
    drive: Drive, pose: SingularPose, node: Node, at: FloatArray, x: FloatArray
) -> BranchDerivatives | None:
    """Replace configurations next to a singular pose, where Newton's method loses half of the digits.

    The branch is smooth in its arc length through the pose, where it turns back, too: a polynomial passes
    through eight configurations around it. Where s has its extreme, only the part before it is of the motion.
    Where the polynomial does not close, as at two singular poses next to each other, nothing is replaced.
    """
    places = np.array([-4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
    around = [
        drive.correct(node.z + STENCIL * place * node.tangent, node.tangent) for place in places.tolist()
    ]
    if any(z is None for z in around):
        return None
    terms = [np.polynomial.Polynomial.fit(places, values, 7) for values in np.array(around).T]
    turns = pose.passage == "turns back"
    last = 0.0 if turns else 1.0
    inner = np.linspace(-1.0, last, 2001)
    s = terms[-1](inner)
    order = np.argsort(s)
    near = np.flatnonzero((at >= s.min()) & (at <= s.max()))
    place = np.interp(at[near], s[order], inner[order])
    slope = terms[-1].deriv()
    for _ in range(6):
        rate = slope(place)
        safe = np.abs(rate) > 1e-8 * STENCIL
        step = np.where(safe, (at[near] - terms[-1](place)) / np.where(safe, rate, 1.0), 0.0)
        place = np.clip(place + step, -1.0, last)
    z = np.array([term(place) for term in terms])
    z[-1] = at[near]
    residual = evaluate_scaled_closure(drive.mechanism, drive.at(z)).residual
    if not len(near) or np.abs(residual).max(initial=0.0) > 1e2 * ROUNDING:
        return None
    x[:, near] = drive.at(z)
    if turns:
        return None
    first, second = (np.array([term.deriv(k)(place) for term in terms]) for k in (1, 2))
    rates = first / first[-1] * drive.length
    curvatures = (second - first / first[-1] * second[-1]) / np.square(first[-1]) * drive.length**2
    slopes = BranchDerivatives(
        near, np.repeat(drive.change[:, np.newaxis], len(near), axis=1), np.zeros((len(drive.x), len(near)))
    )
    scales = drive.scales[:, np.newaxis]
    slopes.first[drive.free], slopes.second[drive.free] = rates[:-1] * scales, curvatures[:-1] * scales
    return slopes
