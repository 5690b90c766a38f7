"""What stands where in a recording: one table for the writer and the reader.

A run stands at the root; of a comparison the first run does, and each further one below runs/<key>/. Of a
simulation `signal_entities` tells.

    joints/raw, raw_velocity, raw_acceleration                  the file's own rows: timelines t and row
    tcp/raw_position, raw_rotation
    joints/repolarized, velocity, acceleration                  the grid: timelines t and sample
    tcp/recorded, position, velocity, acceleration, euler_zyx, singular
    branches/<branch>/q                                         of solved targets: t and row
    targets/position, quat_xyzw
    delta/<key>                                                 the compared samples: t and sample
    matched/<key>/reference, actual, path, speed, angle, joints, outside
    reference/position, quat_xyzw, joints                       the reference on its own times: t

Everything is in SI: [rad] or [m] and their derivatives, times in integer [ns]. joints/raw and
joints/repolarized always stand, with no value a row for a log without joints: they carry the times.
Flags (tcp/singular, matched/<key>/outside) stand only at the samples where they are true.

What is there to be looked at only, and is not read back:

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
from urmpipe_pipeline.comparison.deviation import AXES, Deviation
from urmpipe_pipeline.comparison.trajectory import Trajectory
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.palette import AXIS_COLOURS, JOINT_COLOURS, joint_colour
from urmpipe_pipeline.runs.results import Run
from urmpipe_pipeline.text import unique

LAYOUTS = {"run": 4, "comparison": 4, "simulation": 5}
"""The version that a recording says, by what it holds; raised when an older reader would misunderstand it.

Each kind has its own, so that an older urmpipe reads what it knows, and refuses what it does not by number.
"""

LAYOUT_VERSION = LAYOUTS["run"]
"""The version of a run and of a comparison."""

Series = Literal["joints", "xyz", "rotation", "euler", "delta", "number", "flag", "signal"]
"""What the columns of an entity are."""

LOG_ARRAYS: dict[str, tuple[str, Series]] = {
    "joints/raw": ("q", "joints"),
    "joints/raw_velocity": ("qd", "joints"),
    "joints/raw_acceleration": ("qdd", "joints"),
    "tcp/raw_position": ("tcp_position", "xyz"),
    "tcp/raw_rotation": ("tcp_rotation", "rotation"),
}
"""Entity: attribute of `JointLog`, and what its columns are."""

GRID_ARRAYS: dict[str, tuple[str, Series]] = {
    "joints/repolarized": ("q", "joints"),
    "joints/velocity": ("qd", "joints"),
    "joints/acceleration": ("qdd", "joints"),
    "tcp/recorded": ("tcp_recorded", "xyz"),
}
"""Entity: attribute of `Run`."""

TCP_ARRAYS: dict[str, tuple[str, Series]] = {
    "tcp/position": ("position", "xyz"),
    "tcp/velocity": ("velocity", "xyz"),
    "tcp/acceleration": ("acceleration", "xyz"),
    "tcp/euler_zyx": ("euler_zyx", "euler"),
}
"""Entity: attribute of `PointLog`."""

GOAL_ARRAYS: dict[str, tuple[str, Series]] = {
    "targets/position": ("position", "xyz"),
    "targets/quat_xyzw": ("quat_xyzw", "rotation"),
}
"""Entity: attribute of `Goals`."""

MATCHED_ARRAYS: dict[str, tuple[str, Series]] = {
    "reference": ("reference", "xyz"),
    "actual": ("actual", "xyz"),
    "path": ("path", "number"),
    "speed": ("speed", "number"),
    "angle": ("angle", "number"),
    "joints": ("joint_delta", "joints"),
}
"""Entity below matched/<key>: attribute of `Deviation`, and what its columns are."""

REFERENCE_ARRAYS: dict[str, tuple[str, Series]] = {
    "reference/position": ("position", "xyz"),
    "reference/quat_xyzw": ("quat_xyzw", "rotation"),
    "reference/joints": ("q", "joints"),
}
"""Entity: attribute of `Trajectory`."""

SINGULAR = "tcp/singular"
SUMMARY = "/summary"

RESERVED = ("reference", "recorded", "tolerance", "enlarged", "worst")
"""Names below path/, point/ and delta/ that are no run's."""


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """One array with its times: what one entity holds.

    Attributes:
        entity: Its path, escaped, from the root.
        t_ns: Time of each row in integer [ns], shape (n,).
        values: In SI, shape (n, k).
        series: What the columns are.
        names: Name of each column.
        numbers: Name of the second timeline and its values, shape (n,); None without one.
        worst: Row that is verified besides the first and the last, or None.
        palette: The colour of each column, where the series does not tell.
    """

    entity: str
    t_ns: IntArray
    values: FloatArray
    series: Series
    names: tuple[str, ...]
    numbers: tuple[str, IntArray] | None = None
    worst: int | None = None
    palette: tuple[str, ...] = ()

    @property
    def verified(self) -> tuple[int, ...]:
        """The rows that are read back: the first, the last, and the worst where there is one."""
        ends = (0, len(self.t_ns) - 1) if len(self.t_ns) else ()
        return ends if self.worst is None else (*ends, self.worst)

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


def blocks(result: JointLog | Run | Comparison) -> list[Block]:
    """Return every array of a result with its place, in the order of writing; of a log, as part of a run."""
    if isinstance(result, JointLog):
        return list(_log_blocks(result, "/"))
    standing = places_of(result)
    if isinstance(result, Run):
        return list(_run_blocks(result, standing[0]))
    found = list(_reference_blocks(result.reference))
    for place, deviation in zip(standing, result.runs, strict=True):
        found += _run_blocks(deviation.run, place)
        found += _deviation_blocks(deviation, place)
    return found


def _log_blocks(log: JointLog, prefix: str) -> Iterator[Block]:
    names = _names(log)
    rows = ("row", np.arange(1, log.rows + 1))
    for entity, (attribute, series) in LOG_ARRAYS.items():
        if (values := getattr(log, attribute)) is not None:
            yield Block(prefix + entity, log.t_ns, values, series, names[series], rows)


def _run_blocks(run: Run, place: Place) -> Iterator[Block]:
    yield from _log_blocks(run.log, place.prefix)
    names = _names(run.log)
    samples = ("sample", np.arange(len(run.t_ns)))
    for entity, (attribute, series) in GRID_ARRAYS.items():
        if (values := getattr(run, attribute)) is not None:
            yield Block(place.prefix + entity, run.t_ns, values, series, names[series], samples)
    yield from _solved_blocks(run, place, names)
    if run.tcp is not None:
        for entity, (attribute, series) in TCP_ARRAYS.items():
            values = getattr(run.tcp, attribute)
            yield Block(place.prefix + entity, run.t_ns, values, series, names[series], samples)
        yield from _flags(place.prefix + SINGULAR, run.tcp.singular, run.t_ns, samples[1])


def _solved_blocks(run: Run, place: Place, names: Mapping[Series, tuple[str, ...]]) -> Iterator[Block]:
    """Yield the other branches and the targets of solved joint values, by the rows of the log."""
    for ghost, key in zip(run.ghosts, branch_keys(run), strict=True):
        rows = ("row", np.searchsorted(run.log.t_ns, ghost.t_ns) + 1)
        yield Block(f"{branch_entity(place, key)}/q", ghost.t_ns, ghost.q, "joints", names["joints"], rows)
    if run.goals is None:
        return
    rows = ("row", np.arange(1, len(run.goals.t_ns) + 1))
    rotation = {"xyz": AXES[:3], "rotation": NAMES["quat_xyzw"]}
    for entity, (attribute, series) in GOAL_ARRAYS.items():
        if (values := getattr(run.goals, attribute)) is not None:
            yield Block(place.prefix + entity, run.goals.t_ns, values, series, rotation[series], rows)


def branch_keys(run: Run) -> list[str]:
    """Return the names of the ghosts of a run as parts of entity paths, all different."""
    return unique([entity_key(ghost.name) for ghost in run.ghosts])


def branch_entity(place: Place, key: str) -> str:
    """Return what the entities of a branch of a run stand below."""
    return place.prefix.rstrip("/") + entity_path("branches", key)


def _deviation_blocks(one: Deviation, place: Place) -> Iterator[Block]:
    samples = ("sample", one.sample)
    yield Block(place.named("delta"), one.t_ns, one.delta, "delta", AXES, samples, one.worst)
    names = _names(one.run.log)
    for leaf, (attribute, series) in MATCHED_ARRAYS.items():
        if (values := getattr(one, attribute)) is not None:
            known = names.get(series, (leaf,))
            columns = values.reshape(len(values), -1)
            yield Block(place.named("matched", leaf), one.t_ns, columns, series, known, samples, one.worst)
    yield from _flags(place.named("matched", "outside"), one.outside, one.t_ns, one.sample)


def _reference_blocks(reference: Trajectory) -> Iterator[Block]:
    joints = tuple(printable(name) for name in reference.joints)
    names: dict[Series, tuple[str, ...]] = {"xyz": AXES[:3], "rotation": NAMES["quat_xyzw"], "joints": joints}
    for entity, (attribute, series) in REFERENCE_ARRAYS.items():
        if (values := getattr(reference, attribute)) is not None:
            yield Block("/" + entity, reference.t_ns, values, series, names[series])


def _names(log: JointLog) -> dict[Series, tuple[str, ...]]:
    """Return what the columns of each series are called."""
    rotation = NAMES[log.rotation_form] if log.rotation_form else ()
    joints = tuple(printable(name) for name in log.joints)
    return {"joints": joints, "xyz": AXES[:3], "rotation": rotation, "euler": ("rz", "ry", "rx")}


def _flags(
    entity: str, flags: np.ndarray[tuple[int], np.dtype[np.bool_]], t_ns: IntArray, sample: IntArray
) -> Iterator[Block]:
    """Yield a block of ones at the samples where a flag is true, if it is anywhere."""
    true = np.flatnonzero(flags)
    if len(true):
        yield Block(entity, t_ns[true], np.ones((len(true), 1)), "flag", ("true",), ("sample", sample[true]))
