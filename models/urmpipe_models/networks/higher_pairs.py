"""Higher pairs: gears, racks and cams, as equations between the variables of two joints.

With the angle q_1 of the first joint, the variable q_2 of the second joint, and an offset,

    q_2 = offset + f(q_1)

    gear    f = -(z_1 / z_2) q_1            z: teeth, negative of an internal wheel
    rack    f = r q_1                       r: radius of the pinion, with a sign
    cam     f = S(q_1)                      S: periodic cubic spline through the points of the profile

The variables are not reduced by full turns: a gear keeps the count of its turns.

1. `transmitted`: f and its derivative, elementwise.
2. `read_pair`: a pair from its table of a file, with the profile of a cam from a CSV file.
3. `pair_faults`: the errors of a pair.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.elementwise import Element
from urmpipe_models.errors import Finding, shown
from urmpipe_models.files.tables import Table, are_numbers, is_number
from urmpipe_models.names import not_among
from urmpipe_models.networks.expressions import Expression
from urmpipe_models.networks.file_values import in_si, read_expression
from urmpipe_models.networks.parts import (
    PAIR_JOINTS,
    ConstraintElement,
    ElementKind,
    Joint,
    Parts,
    pair_bodies,
)
from urmpipe_models.robots.robot_frames import Units

TURN = 2.0 * math.pi
MIN_POINTS, MAX_POINTS = 4, 1000  # of a profile: a third of a degree apart; each costs a comparison
MAX_LISTED = 10  # faulty lines of a CSV file that are named; the others are counted
MAX_VALUE = 1e9  # no radius or lift of a mechanism is larger, in [m] or [rad]

Profile = tuple[tuple[float, float], ...]


def transmitted(element: ConstraintElement, angle: Element) -> tuple[Element, Element]:
    """Return f of the angle of the first joint, and its derivative.

    Args:
        element: A gear, a rack or a cam.
        angle: In [rad], any element.

    Returns:
        In [rad] or [m], and in that unit per [rad].
    """
    if element.kind == "cam":
        return _spline_value(element.profile, angle)
    slope = element.radius if element.kind == "rack" else -element.teeth[0] / element.teeth[1]
    return slope * angle, slope


def _spline_value(profile: Profile, angle: Element) -> tuple[Element, Element]:
    """Return the periodic cubic spline through the points of a profile, and its derivative.

    Every segment is evaluated, then the right value selected: so symbols pass, too.
    """
    coefficients, first = _segments(profile), profile[0][0]
    turned = angle - first
    turned = turned - TURN * np.floor(turned / TURN)
    value: Element = 0.0
    slope: Element = 0.0
    for k, (start, a, b, c, d) in enumerate(coefficients.tolist()):
        u = turned - start
        cubic, rate = a + u * (b + u * (c + u * d)), b + u * (2.0 * c + u * (3.0 * d))
        value = np.where(turned >= start, cubic, value) if k else cubic
        slope = np.where(turned >= start, rate, slope) if k else rate
    return value, slope


@lru_cache(maxsize=64)
def _segments(profile: Profile) -> FloatArray:
    """Return where each segment starts after the first point in [rad], and its a, b, c, d, shape (n, 5).

    a + b u + c u^2 + d u^3. The second derivatives M solve
    h_(i-1) M_(i-1) + 2 (h_(i-1) + h_i) M_i + h_i M_(i+1) = 6 (s_i - s_(i-1)), s the slopes of the chords, all
    indices modulo n.

    Source: de Boor 1978, A Practical Guide to Splines, chapter IV, with periodic ends.
    """
    x, y = np.array(profile).T
    h = np.diff(x, append=x[0] + TURN)
    chords = (np.roll(y, -1) - y) / h
    before = np.roll(h, 1)
    eye = np.eye(len(x))
    matrix = 2.0 * np.diag(before + h)
    matrix += before[:, np.newaxis] * np.roll(eye, -1, axis=1) + h[:, np.newaxis] * np.roll(eye, 1, axis=1)
    M = np.linalg.solve(matrix, 6.0 * (chords - np.roll(chords, 1)))
    after = np.roll(M, -1)
    return np.stack(
        (x - x[0], y, chords - h * (2.0 * M + after) / 6.0, 0.5 * M, (after - M) / (6.0 * h)), axis=1
    )


# --- reading


def read_pair(
    name: str, kind: ElementKind, table: Table, joints: Mapping[str, Joint], units: Units, folder: Path
) -> ConstraintElement:
    """Return a gear, rack or cam from its table; errors are noted there.

    Args:
        name: Its name.
        kind: gear, rack or cam.
        table: Its table, with `joints`, `offset`, and `teeth`, `radius` or `profile`.
        joints: The joints of the network by name.
        units: The units of the file.
        folder: Where a file of a profile is relative to.
    """
    names = table.texts("joints")
    first, second = (joints.get(joint) for joint in (*names, "", "")[:2])
    unit = "rad" if kind == "gear" or (kind == "cam" and second and second.kind == "revolute") else "m"
    offset = read_expression(table, "offset", unit, units) if table.has("offset") else Expression("0.0")
    pair = ConstraintElement(
        name,
        kind,
        pair_bodies(first, second) if first and second else ("", ""),
        offset,
        joints=names,
        teeth=table.numbers("teeth", 2) if kind == "gear" else (),
        radius=units.length(table.number("radius")) if kind == "rack" else 0.0,
        profile=_read_profile(table, unit, units, folder) if kind == "cam" else (),
    )
    table.close()
    return pair


def _read_profile(table: Table, unit: str, units: Units, folder: Path) -> Profile:
    """Return the points of `profile`, a list or a CSV file, in [rad] and the unit of the follower."""
    value = table.value("profile")
    rows: Sequence[Any]
    if isinstance(value, str):
        rows = _read_csv(table, value, folder)
    else:
        rows = value if isinstance(value, (list, tuple)) else []
        unreadable = [k for k, row in enumerate(rows) if not are_numbers(row, 2)]
        for k in unreadable:
            table.fault(
                f"profile[{k}]", f"found {shown(rows[k])}, allowed: [angle, lift], two finite numbers"
            )
        if rows is not value:
            text = "nothing" if value is None else shown(value)
            table.fault("profile", f"found {text}, allowed: a list of [angle, lift], or a .csv file")
        rows = [] if unreadable else rows
    return tuple((in_si(float(a), "rad", units), in_si(float(b), unit, units)) for a, b in rows)


def _read_csv(table: Table, file: str, folder: Path) -> list[tuple[float, float]]:
    """Return the rows of a file of two columns; its first line may name these."""
    try:
        with (folder / file).open(encoding="utf-8-sig") as lines:
            cells = [line.strip().split(",") for line in islice(lines, MAX_POINTS + 2)]
    except (OSError, ValueError) as error:  # a ValueError: no text, or no path
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        table.fault("profile", f"{shown(file)} cannot be read: {reason}; allowed: a .csv file of two columns")
        return []
    points, faults = [], []
    for number, row in enumerate(cells, 1):
        pair = [_number(cell) for cell in row]
        if len(pair) == 2 and all(map(is_number, pair)):
            points.append((pair[0], pair[1]))
        elif row != [""] and not (number == 1 and all(map(math.isnan, pair))):
            faults.append(f"{file}, line {number}: found {shown(','.join(row))}")
    for message in faults[:MAX_LISTED]:
        table.fault("profile", f"{message}, allowed: angle,lift, two finite numbers")
    if len(faults) > MAX_LISTED:
        table.fault("profile", f"{file}: {len(faults) - MAX_LISTED} more such lines")
    return [] if faults else points


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


# --- faults


def pair_faults(where: str, element: ConstraintElement, parts: Parts) -> Iterator[Finding]:
    """Yield the errors of a pair; those that may follow from an unreadable joint have the kind "coupled".

    Args:
        where: Its place in a file, such as elements.mesh.
        element: The pair.
        parts: The parts of its network.
    """
    yield from _joints_faults(where, element, parts)
    if element.kind == "gear":
        yield from _teeth_faults(f"{where}.teeth", element.teeth)
    elif element.kind == "rack" and not 0.0 < abs(element.radius) <= MAX_VALUE:
        allowed = f"a radius other than 0, {MAX_VALUE:g} m at most; its sign is that of the motion"
        yield Finding(f"found {element.radius:g} m, allowed: {allowed}", about=f"{where}.radius")
    elif element.kind == "cam":
        yield from _profile_faults(f"{where}.profile", element.profile)


def _joints_faults(where: str, element: ConstraintElement, parts: Parts) -> Iterator[Finding]:
    """Yield unknown joints, joints of the wrong kind, and a joint that is named twice."""
    place, joints = f"{where}.joints", {joint.name: joint for joint in parts.joints}
    if len(element.joints) != 2:
        yield Finding(f"found {len(element.joints)}, allowed: the names of two joints", about=place)
        return
    if element.joints[0] == element.joints[1]:
        yield Finding(f"found {element.joints[0]} twice, allowed: two joints", about=place)
    kinds = PAIR_JOINTS[element.kind]
    for name, allowed, order in zip(element.joints, kinds, ("first", "second"), strict=True):
        if name not in joints:
            yield Finding(f"joint {not_among(name, joints)}", about=place, kind="coupled")
        elif joints[name].kind not in allowed:
            message = f"found {name}, a {joints[name].kind} joint, allowed as the {order} of a {element.kind}"
            yield Finding(f"{message}: {', '.join(allowed)}", about=place, kind="coupled")
    known = [joints[name] for name in element.joints if name in joints]
    if len(known) == 2 and element.bodies != (ends := pair_bodies(*known)):
        message = f"found {', '.join(element.bodies)}, allowed: those of its joints, {', '.join(ends)}"
        yield Finding(message, about=f"{where}.bodies")


def _teeth_faults(where: str, teeth: tuple[float, ...]) -> Iterator[Finding]:
    """Yield teeth that are 0, and two internal wheels."""
    allowed = "two numbers other than 0, at most one of them negative: that of an internal wheel"
    if len(teeth) != 2 or not all(0.0 < abs(count) <= MAX_VALUE for count in teeth) or max(teeth) < 0.0:
        yield Finding(f"found {', '.join(f'{count:g}' for count in teeth)}, allowed: {allowed}", about=where)


def _profile_faults(where: str, profile: Profile) -> Iterator[Finding]:
    """Yield a number of points, numbers and angles that make no periodic spline."""
    if not MIN_POINTS <= len(profile) <= MAX_POINTS:
        yield Finding(f"found {len(profile)} points, allowed: {MIN_POINTS} to {MAX_POINTS}", about=where)
    for k, row in enumerate(profile):
        if not all(abs(number) <= MAX_VALUE for number in row):  # NaN is not, either
            text = ", ".join(f"{number:g}" for number in row)
            yield Finding(f"found {text}, allowed: finite numbers of a mechanism", about=f"{where}[{k}]")
    for k, ((before, _), (angle, _)) in enumerate(pairwise(profile), 1):
        if angle <= before:
            message = f"found the angle {angle:g} rad after {before:g} rad"
            yield Finding(f"{message}, allowed: angles that increase", about=f"{where}[{k}]")
    if profile and profile[-1][0] - profile[0][0] >= TURN - 1e-9:
        span = f"found angles over {profile[-1][0] - profile[0][0]:.6g} rad"
        reason = "the first point repeats after it"
        yield Finding(f"{span}, allowed: less than a full turn: {reason}", about=where)
