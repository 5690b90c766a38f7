"""What the viewer draws of a recording's arrays: names and colours of their columns, and where else it draws.

Arrays stand at the paths of their fields, which `codec` gives. What is there to be looked at only, and is not
read back, stands beside them; what belongs to a run further than the first below runs/<key>/:

    overview/...                                                few rows of what is long, and a run's speed
    marks/repolarization/up, down, doubt; marks/worst/<plot>    in the plots of a run
    tolerance/delta, path, angle, joints                        what is allowed, in the plot of each
    branches/<branch>/arm, name; targets/path, points, frames, missed
    events/..., summary, robot/..., path/..., point/...
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from urmpipe_models.arrays import FloatArray, IntArray
from urmpipe_models.orientation import NAMES
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import AXES
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS, joint_colour
from urmpipe_pipeline.recording.codec import Encoded
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.text import unique

Series = Literal["joints", "xyz", "rotation", "euler", "delta", "number", "signal"]
"""What the columns of an array are."""

LOG_ARRAYS: dict[str, Series] = {
    "q": "joints",
    "qd": "joints",
    "qdd": "joints",
    "tcp_position": "xyz",
    "tcp_rotation": "rotation",
}
"""Attribute of `JointLog`, and what its columns are."""

GRID_ARRAYS: dict[str, Series] = {"q": "joints", "qd": "joints", "qdd": "joints", "tcp_recorded": "xyz"}
"""Attribute of `Run`."""

TCP_ARRAYS: dict[str, Series] = {
    "position": "xyz",
    "velocity": "xyz",
    "acceleration": "xyz",
    "euler_zyx": "euler",
}
"""Attribute of `PointLog`."""

GOAL_ARRAYS: dict[str, Series] = {"position": "xyz", "quat_xyzw": "rotation"}
"""Attribute of `Goals`."""

MATCHED_ARRAYS: dict[str, Series] = {
    "delta": "delta",
    "reference": "xyz",
    "actual": "xyz",
    "path": "number",
    "speed": "number",
    "angle": "number",
    "joint_delta": "joints",
}
"""Attribute of `Deviation`."""

REFERENCE_ARRAYS: dict[str, Series] = {"position": "xyz", "quat_xyzw": "rotation", "q": "joints"}
"""Attribute of `Trajectory`."""

SUMMARY = "/summary"

RESERVED = ("reference", "recorded", "tolerance", "enlarged", "worst")
"""Names below path/, point/ and delta/ that are no run's."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """One array as it is drawn.

    Attributes:
        entity: Its path, escaped, from the root.
        t_ns: Time of each row in integer [ns], shape (n,).
        values: In SI, shape (n, k).
        series: What the columns are.
        names: Name of each column.
        numbers: Name of the second timeline and its values, shape (n,); None without one.
        palette: The colour of each column, where the series does not tell.
    """

    entity: str
    t_ns: IntArray
    values: FloatArray
    series: Series
    names: tuple[str, ...]
    numbers: tuple[str, IntArray] | None = None
    palette: tuple[str, ...] = ()

    @property
    def colours(self) -> list[str]:
        """The colour of each column as #rrggbb."""
        if self.palette:
            return list(self.palette)
        if self.series == "joints":
            return [joint_colour(j) for j in range(len(self.names))]
        if self.series == "number":
            return [AXIS_COLOURS["norm"]]
        if self.series == "euler":
            return [AXIS_COLOURS[name[1]] for name in self.names]
        palette = [*AXIS_COLOURS.values(), *JOINT_COLOURS]
        return palette[: len(self.names)]


@dataclass(frozen=True, slots=True)
class Place:
    """Where a run stands in a recording.

    Attributes:
        key: Its name as part of an entity path, unescaped, unique in the recording.
        prefix: What stands before the entities of its log and grid: "/" or "/runs/<key>/".
    """

    key: str
    prefix: str

    def named(self, root: str, leaf: str | None = None) -> str:
        """Return the entity of this run below a common root, such as /delta/<key>."""
        return entity_path(root, self.key, *([leaf] if leaf else []))


def entity_path(*parts: str) -> str:
    """Return the path of an entity from the root, each part escaped as Rerun wants it."""
    import rerun as rr

    return rr.new_entity_path(list(parts))


def places(names: Sequence[str]) -> list[Place]:
    """Return where the runs with these names stand: the first at the root."""
    keys: list[str] = []
    for name in names:
        plain = entity_key(name)
        key, number = plain, 2
        while key in keys or key in RESERVED:
            key, number = f"{plain} ({number})", number + 1
        keys.append(key)
    return [Place(key, "/" if i == 0 else entity_path("runs", key) + "/") for i, key in enumerate(keys)]


def places_of(result: Run | Comparison) -> list[Place]:
    """Return where the runs of a result stand."""
    return places([result.name] if isinstance(result, Run) else [one.name for one in result.runs])


def entity_key(name: str) -> str:
    """Return a name as a part of an entity path that Rerun finds again.

    Its filters, by which arrays are read back and views choose what they show, drop blanks at the end of a
    path, and take a backslash before a slash for the slash's own, escaped or not: names end before these.
    """
    return re.sub(r"[\s\\]+\Z", "", printable(name)) or "unnamed"


def printable(text: str) -> str:
    """Return a text without the lone surrogates that stand for undecodable bytes of a file name."""
    return text.encode("utf-8", "replace").decode("utf-8")


def blocks(result: Run | Comparison, encoded: Encoded) -> list[Block]:
    """Return every array of a result that has names and colours."""
    if isinstance(result, Run):
        return list(_run_blocks(result, encoded))
    found = list(_reference_blocks(result.reference, encoded))
    for deviation in result.runs:
        found += _run_blocks(deviation.run, encoded)
        samples, names = ("sample", deviation.sample), _names(deviation.run.log)
        found += _blocks(deviation, MATCHED_ARRAYS, encoded, deviation.t_ns, names, samples)
    return found


def _blocks(
    of: object,
    arrays: Mapping[str, Series],
    encoded: Encoded,
    t_ns: IntArray,
    names: Mapping[Series, tuple[str, ...]],
    numbers: tuple[str, IntArray] | None = None,
) -> Iterator[Block]:
    """Yield the arrays that there are of a table of attributes."""
    for attribute, series in arrays.items():
        values = getattr(of, attribute)
        if entity := encoded.entity_of(values, t_ns):
            columns = values.reshape(len(values), -1)
            known = AXES if series == "delta" else names.get(series, (attribute,))
            yield Block(entity, t_ns, columns, series, known, numbers)


def _run_blocks(run: Run, encoded: Encoded) -> Iterator[Block]:
    names, samples = _names(run.log), ("sample", np.arange(len(run.t_ns)))
    yield from _blocks(
        run.log, LOG_ARRAYS, encoded, run.log.t_ns, names, ("row", np.arange(1, run.log.rows + 1))
    )
    yield from _blocks(run, GRID_ARRAYS, encoded, run.t_ns, names, samples)
    for ghost in run.ghosts:
        yield from _blocks(ghost, {"q": "joints"}, encoded, ghost.t_ns, names)
    if run.goals is not None:
        turned: dict[Series, tuple[str, ...]] = {**names, "rotation": NAMES["quat_xyzw"]}
        yield from _blocks(run.goals, GOAL_ARRAYS, encoded, run.goals.t_ns, turned)
    if run.tcp is not None:
        yield from _blocks(run.tcp, TCP_ARRAYS, encoded, run.t_ns, names, samples)


def branch_keys(run: Run) -> list[str]:
    """Return the names of the ghosts of a run as parts of entity paths, all different."""
    return unique([entity_key(ghost.name) for ghost in run.ghosts])


def branch_entity(place: Place, key: str) -> str:
    """Return what the entities of a branch of a run stand below."""
    return place.prefix.rstrip("/") + entity_path("branches", key)


def _reference_blocks(reference: Trajectory, encoded: Encoded) -> Iterator[Block]:
    joints = tuple(printable(name) for name in reference.joints)
    names: dict[Series, tuple[str, ...]] = {"xyz": AXES[:3], "rotation": NAMES["quat_xyzw"], "joints": joints}
    yield from _blocks(reference, REFERENCE_ARRAYS, encoded, reference.t_ns, names)


def _names(log: JointLog) -> dict[Series, tuple[str, ...]]:
    """Return what the columns of each series are called."""
    rotation = NAMES[log.rotation_form] if log.rotation_form else ()
    joints = tuple(printable(name) for name in log.joints)
    return {"joints": joints, "xyz": AXES[:3], "rotation": rotation, "euler": ("rz", "ry", "rx")}
