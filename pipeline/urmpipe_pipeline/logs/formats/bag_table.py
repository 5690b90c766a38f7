"""The table of one topic of a recording: the fields of its messages as columns, their stamps as the clock.

1. `read_bag`: the topic that is given, or the only one of the first kind in `KINDS` that the recording has.
2. Rows: a message is a row; of a JointTrajectory or a Path each point, of transforms those of a frame.
3. Columns: arrays with a list of names are called by these: position.elbow_joint. Any other number is
   called by its path: twist.linear.x, data[0].
4. The clock is header.stamp in integer [ns], or the time of the recorder where messages have no stamps.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError
from urmpipe_pipeline.joint_log import Basis, Inference, LogWarning
from urmpipe_pipeline.logs.formats.bag import Message, make_decoder, open_bag
from urmpipe_pipeline.logs.formats.files import choice_error, choose_part, question
from urmpipe_pipeline.logs.formats.memory import JOINT, ROLE, UNIT, MemoryTable
from urmpipe_pipeline.logs.formats.text import check_width
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import key, vocabulary

JOINTS, POINTS = ("JointState", "JointStates"), ("JointTrajectory", "Path")
TOOL_POSES = ("PoseStamped", "PoseWithCovarianceStamped", "PoseInFrame")
CONTROLLERS = ("JointTrajectoryControllerState", "JointControllerState")
ARRAYS = ("Float64MultiArray", "Float32MultiArray")
TRANSFORMS = ("TransformStamped", "FrameTransform", "TFMessage", "FrameTransforms")
KINDS = (JOINTS, (*POINTS, *TOOL_POSES, "Odometry", *CONTROLLERS, *ARRAYS), TRANSFORMS)  # the first is read
SOURCE = "ros"  # REP 103: rad, m, s

MAX_VALUES = 500  # numbers of an array that become columns: larger ones are images and scans
MAX_LISTED = 12  # choices of a question, topics of a message
MIN_DISTINCT = 0.5  # share of the messages with different stamps, below which the stamps are no clock

_NAMES = ("joint_names", "name")  # fields that name the values of the arrays of a message
_NO_VALUES = frozenset(("header", "stamp", "timestamp", "layout", "time_from_start"))
_POSITION = re.compile(r"(.*?\.)?positions?\.(?P<name>.*)")  # of a joint, in any message
_STAMPS = ("time_from_start", "stamp", "timestamp")
_FRACTIONS = ("nanosec", "nsec", "nsecs")

_Values: TypeAlias = tuple[Sequence[str], Sequence[Any]]  # names of numbers, and the numbers


class _Row(NamedTuple):
    """A row: its stamp and the time of the recorder in [ns], the message, the names of its arrays."""

    stamp: int | None
    log_ns: int
    message: Any
    names: tuple[str, ...]


class _Topics(NamedTuple):
    """The topics of a recording: its file, the number of messages and the type of each by name."""

    path: Path
    counts: Mapping[str, int]
    types: Mapping[str, str]

    def kind(self, name: str) -> str:
        """Return the last word of a type: JointState of sensor_msgs/msg/JointState, foxglove.JointState."""
        return re.split(r"[/.:]+", self.types[name])[-1]

    def describe(self, name: str) -> str:
        return f"{self.types[name] or 'no type'}, {format_count(self.counts[name], 'message')}"

    def format_list(self, names: Sequence[str]) -> str:
        """Return topics with their types and numbers of messages."""
        shown = [f"{name} ({self.describe(name)})" for name in names[:MAX_LISTED]]
        return ", ".join([*shown, *([f"{len(names) - MAX_LISTED} more"] if len(names) > MAX_LISTED else [])])


def read_bag(path: Path, options: LogMap) -> MemoryTable:
    """Return the table of one topic of a recording.

    Args:
        path: An MCAP file, a bag of ROS 1 or ROS 2, or a folder with the files of one recording.
        options: `topic` selects it (TOPIC:FRAME a frame of a topic of transforms), `episode` one of several
            trajectories, `joints` one of several sets of joints on a topic.

    Raises:
        LogError: If it is no recording, messages cannot be decoded, or several topics may be the log.
    """
    bag = open_bag(path)
    counts = Counter[str]()
    for topic, count in bag.topics.items():
        counts[topic.name] += count
    topics = _Topics(path, counts, {topic.name: topic.type for topic in bag.topics})
    name, frame, why = _choose_topic(topics, options.topic)
    messages, damage = bag.read(name)
    warnings, why_missing = [], "; ".join(damage)
    if damage and not messages:
        fault = f"found no message of {name} that can be read ({why_missing})"
        raise LogError(Finding(f"{fault}, allowed: a complete recording", str(path)))
    if damage:
        read = f"{format_count(len(messages), 'message')} of {name}"
        fault = f"the recording is cut or damaged: {read} were read, others are missing ({why_missing})"
        warnings.append(LogWarning("cut-recording", fault, assumption=f"{read} are the motion"))
    rows = [*_decode(messages, path)]
    applied = ["topic"] if options.topic else []
    kind, title, clock = topics.kind(name), name, ""
    if kind in TRANSFORMS:
        rows, title = _select_frame(rows, path, name, frame)
    elif kind in POINTS:
        rows = _select_points(rows, options.episode, path, name)
        applied += ["episode"] if options.episode else []
        clock = "time_from_start" if kind == "JointTrajectory" else ""
    elif kind in JOINTS:
        rows = _select_joints(rows, options.joints, path, warnings)
    unread = [other for other in counts if other != name]
    hints = tuple(Hint("topic", other) for other in unread[:1])
    basis: Basis = "given" if options.topic else "named"
    inferences = [Inference("topic", title, why, hints=hints, basis=basis)]
    table = _build_table(rows, name, path, clock, inferences, warnings)
    if unread:
        inferences.append(Inference("topics not read", topics.format_list(unread), "a log is one topic"))
    for other in unread if kind in JOINTS else ():
        if topics.kind(other) in TOOL_POSES:
            message = f"{topics.format_list([other])} is not read: its rows are not those of the joints"
            warnings.append(LogWarning("other-topic", message, hints=(Hint("topic", other, "reads it"),)))
    is_ros = "/" in topics.types[name] or any(kind in kinds for kinds in KINDS)
    return MemoryTable(
        path.name if path.is_dir() else path.stem, table, path=path, inferences=tuple(inferences),
        applied=tuple(applied), source=SOURCE if is_ros else "", warnings=tuple(warnings),
    )  # fmt: skip


def _choose_topic(topics: _Topics, option: str | None) -> tuple[str, str, str]:
    """Return the topic that is read, the frame that the option names with it, and why."""
    names = sorted(topics.counts)
    if option is not None:
        for topic, frame in ((option, ""), option.rpartition(":")[::2]):
            name = next((name for name in names if topic in (name, name.lstrip("/"))), None)
            if name and (not frame or topics.kind(name) in TRANSFORMS):
                return name, frame, "given as an option"
        described = {name: topics.describe(name) for name in names}
        raise choice_error(topics.path, "topic", option, described, "topics")
    for kinds in KINDS:
        matching = [name for name in names if topics.kind(name) in kinds]
        if len(matching) == 1:
            return matching[0], "", f"the only one with a {topics.kind(matching[0])}"
        if matching:
            names = matching
            break
    choices = {name: topics.describe(name) for name in names}
    return choose_part(topics.path, "topic", None, choices, "topics that may be the log"), "", "the only one"


# Rows


def _decode(messages: Sequence[Message], path: Path) -> Iterator[_Row]:
    """Yield the messages decoded; raise with the number of those that cannot be."""
    topics = dict.fromkeys(message.topic for message in messages)
    decoders = {topic: make_decoder(topic, str(path)) for topic in topics}
    bad = list[tuple[int, str]]()
    for number, (topic, log_ns, data) in enumerate(messages, start=1):
        try:
            message = decoders[topic](data)
            fields = _fields(message)
        except (ValueError, TypeError) as error:
            bad.append((number, str(error).partition("\n")[0]))
            continue
        yield _Row(_stamp(fields), log_ns, message, _array_names(fields))
    if bad:
        number, reason = bad[0]
        count = f"{len(bad)} of {format_count(len(messages), 'message')} that cannot be decoded"
        first = f"the first is message {number} of {messages[number - 1].topic.name} ({reason})"
        raise LogError(Finding(file=str(path), found=f"{count}: {first}", allowed="complete messages"))


def _fields(message: Any) -> Mapping[str, Any]:
    """Return the fields of a message by name, those of a transform called as those of a pose."""
    fields: Mapping[str, Any] = message if isinstance(message, Mapping) else vars(message)
    if "translation" in fields and "rotation" in fields:
        names = {"translation": "position", "rotation": "orientation"}
        return {names.get(name, name): value for name, value in fields.items()}
    return fields


def _nanoseconds(value: Any) -> int | None:
    """Return a time of seconds and nanoseconds in [ns]; None of anything else."""
    if value is None or isinstance(value, (str, bytes, int, float, list)):
        return None
    fields = value if isinstance(value, Mapping) else getattr(value, "__dict__", {})
    rest = next((fields[name] for name in _FRACTIONS if name in fields), None)
    seconds = fields.get("sec", fields.get("secs"))
    is_time = isinstance(seconds, int) and isinstance(rest, int) and len({*fields} - {"__msgtype__"}) == 2
    return seconds * 10**9 + rest if is_time else None


def _stamp(fields: Mapping[str, Any]) -> int | None:
    """Return the time that a message states in [ns]; None without one."""
    header = fields.get("header")
    stamp = getattr(header, "stamp", None)
    if stamp is None:
        inner = header if isinstance(header, Mapping) else {}
        stamp = next((part[name] for part in (inner, fields) for name in _STAMPS if name in part), None)
    return _nanoseconds(stamp)


def _array_names(fields: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names that a message gives the values of its arrays."""
    for field in _NAMES:
        names = fields.get(field)
        if isinstance(names, list) and names and isinstance(names[0], str):
            return tuple(names)
    joints = fields.get("joints")
    if isinstance(joints, list) and joints and not isinstance(joints[0], (str, int, float)):
        return tuple(str(_fields(joint).get("name", "")) for joint in joints)
    return ()


def _select_points(rows: Sequence[_Row], episode: str | None, path: Path, name: str) -> list[_Row]:
    """Return the points of a trajectory or the poses of a path as rows, those of the message `episode`."""
    points = [_fields(row.message).get("points") or _fields(row.message).get("poses") or () for row in rows]
    choices = {str(k): format_count(len(part), "point") for k, part in enumerate(points, start=1)}
    number = int(choose_part(path, "episode", episode, choices, f"trajectories of {name}"))
    row = rows[number - 1]
    return [row._replace(stamp=_stamp(_fields(point)), message=point) for point in points[number - 1]]


def _select_frame(rows: Sequence[_Row], path: Path, name: str, frame: str) -> tuple[list[_Row], str]:
    """Return the transforms of one frame, and its title."""
    frames = dict[str, list[_Row]]()
    for row in rows:
        for transform in _fields(row.message).get("transforms", [row.message]):
            fields = _fields(transform)
            placed = _Row(_stamp(fields), row.log_ns, transform, ())
            frames.setdefault(str(fields.get("child_frame_id", "")), []).append(placed)
    in_order = sorted(frames.items(), key=lambda item: -len(item[1]))
    choices = {f"{name}:{child}": format_count(len(part), "transform") for child, part in in_order}
    title = choose_part(path, "topic", f"{name}:{frame}" if frame else None, choices, "frames")
    return frames[title.removeprefix(f"{name}:")], title


def _select_joints(
    rows: Sequence[_Row], joints: Sequence[str], path: Path, warnings: list[LogWarning]
) -> list[_Row]:
    """Return the messages of one set of joints, and add warnings about those of other sets.

    Two nodes may publish on one topic: messages with nothing but grippers or wheels are left out.
    """
    sets = Counter(frozenset(row.names) for row in rows)
    order = {frozenset(row.names): row.names for row in reversed(rows)}
    no_arm = vocabulary().other | vocabulary().grippers
    arms = [names for names in sets if not all(no_arm & {*key(name).split("_")} for name in names)] or [*sets]
    if joints:  # perhaps as their columns are called
        requested = [
            names
            for names in sets
            if all(joint in names or any(joint.endswith(f".{name}") for name in names) for joint in joints)
        ]
        arms = requested or arms
    if len(arms) > 1 and not (joints and requested):
        choices = [
            ([f"position.{name}" for name in order[names]], format_count(count, "message"))
            for names, count in sets.most_common()
        ]
        raise question(path, f"messages with {len(sets)} different sets of joints", "joints", choices)
    for names, count in sets.items():
        if names not in arms:
            listed = ", ".join(order[names]) or "without names"
            message = f"{format_count(count, 'message')} with the joints {listed} are left out"
            warnings.append(LogWarning("other-joints", message))
    return [row for row in rows if frozenset(row.names) in arms]


# Columns


def _values(message: Any, names: tuple[str, ...], large: set[str], before: str = "") -> Iterator[_Values]:
    """Yield the numbers of a message with their names, which are paths."""
    for name, value in _fields(message).items():
        if name not in _NO_VALUES:
            yield from _field_values(before + name, value, names, large)


def _field_values(path: str, value: Any, names: tuple[str, ...], large: set[str]) -> Iterator[_Values]:
    """Yield the numbers of a field; of a list of messages by their name if they have one, else by number."""
    if isinstance(value, (int, float)):
        yield (path,), (int(value) if isinstance(value, bool) else value,)
    elif isinstance(value, list) or hasattr(value, "tolist"):
        values: Any = value if isinstance(value, list) else value.tolist()
        if not isinstance(values, list):
            yield (path,), (values,)
        elif len(values) > MAX_VALUES:
            large.add(f"{path} ({len(values)} values)")
        elif values and isinstance(values[0], (int, float)):
            yield _labels(path, names, len(values)), values
        elif values and not isinstance(values[0], str):
            for k, item in enumerate(values):
                is_message = not (isinstance(item, (int, float, list, str)) or hasattr(item, "tolist"))
                name = _fields(item).get("name") if is_message and item is not None else None
                if isinstance(name, str):
                    for labels, numbers in _values(item, names, large):
                        yield tuple(f"{label}.{name}" for label in labels), numbers
                else:
                    yield from _field_values(f"{path}[{k}]", item, names, large)
    elif value is not None and not isinstance(value, (str, bytes)) and _nanoseconds(value) is None:
        yield from _values(value, names, large, f"{path}.")


@lru_cache
def _labels(path: str, names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Return the names of the numbers of an array: position.NAME for one name each, else data[0]."""
    if count == len(names):
        return tuple(f"{path}.{name}" for name in names)
    return tuple(f"{path}[{k}]" for k in range(count))


def _build_table(
    rows: Sequence[_Row],
    topic: str,
    path: Path,
    clock: str,
    inferences: list[Inference],
    warnings: list[LogWarning],
) -> pa.Table:
    """Return rows as a table, and add inferences and warnings about its clock and its columns."""
    large = set[str]()
    columns = dict[str, list[Any]]()
    for place, row in enumerate(rows):
        labels = list[str]()
        for names, values in _values(row.message, row.names, large):
            labels += names
            for name, value in zip(names, values, strict=True):
                if name not in columns:
                    columns[name] = [None] * len(rows)
                    check_width(len(columns), str(path))
                columns[name][place] = value
        if len(set(labels)) < len(labels):
            twice = Counter(labels).most_common(1)[0][0]
            message = f"message {place + 1} of {topic} has {twice} twice, allowed: each name once"
            raise LogError(Finding(message, str(path)))
    times, called = _choose_clock(rows, topic, clock, inferences, warnings)
    arrays = [_array(times)]
    fields = [pa.field(called, arrays[0].type, metadata={UNIT: b"ns"})]
    joints = {name for names in {row.names for row in rows} for name in names}
    for name, column in columns.items():
        match = _POSITION.fullmatch(name)
        is_joint = match is not None and match["name"] in joints and "error" not in name.split(".")
        arrays.append(_array(column))
        fields.append(pa.field(name, arrays[-1].type, metadata={ROLE: JOINT} if is_joint else None))
    if large:
        why = f"arrays of more than {MAX_VALUES} values"
        inferences.append(Inference("values not read", ", ".join(sorted(large)), why))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def _array(values: Sequence[Any]) -> pa.Array:
    """Return numbers as an array: integers that fit, else doubles."""
    try:
        return pa.array(values)
    except (pa.ArrowException, OverflowError):
        return pa.array([None if value is None else float(value) for value in values])


def _choose_clock(
    rows: Sequence[_Row], topic: str, name: str, inferences: list[Inference], warnings: list[LogWarning]
) -> tuple[list[int], str]:
    """Return the times of rows in [ns] and the name of their column; add what was found out about them."""
    stamps, logged = [row.stamp for row in rows if row.stamp is not None], [row.log_ns for row in rows]
    distinct = len(set(stamps))
    if name and len(stamps) == len(rows):
        return stamps, name
    if not stamps:
        why = "the messages have no stamps: when the recorder received each"
        inferences.append(Inference("clock", "log time", why))
    elif len(stamps) < len(rows) or (len(rows) > 1 and distinct <= MIN_DISTINCT * len(rows)):
        fault = f"repeat ({distinct} different ones in {len(rows)} messages)"
        fault = "are all 0" if set(stamps) == {0} else fault
        message = f"the stamps of {topic} {fault}: times are those of the recorder"
        warnings.append(LogWarning("log-time", message))
    else:
        return stamps, "header.stamp"
    return logged, "log_time"
