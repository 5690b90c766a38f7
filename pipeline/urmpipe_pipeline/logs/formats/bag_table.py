"""The table of one topic of a recording: the fields of its messages as columns, their stamps as the clock.

- `read_bag`: the topic that is given, or the only one of the first kind in `KINDS` that the recording has.
- A message becomes a row; of a JointTrajectory or a Path each of its points. Arrays with a list of names
  are called by these: position.elbow_joint. Any other number is called by its path: twist.linear.x, data[0].
- The clock is header.stamp in integer [ns], or the time of the recorder where messages have no stamps.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import pyarrow as pa

from urmpipe_models.display import format_count
from urmpipe_models.errors import Finding, Hint, LogError, format_value
from urmpipe_pipeline.joint_log import Inference, LogWarning
from urmpipe_pipeline.logs.formats.bag import Message, decoder, open_bag
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.numbers import JOINT, ROLE, UNIT
from urmpipe_pipeline.logs.formats.text import refuse_wide
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import key, vocabulary

JOINTS, POINTS, FRAMES = (
    ("JointState", "JointStates"),
    ("JointTrajectory", "Path"),
    ("TransformStamped", "FrameTransform"),
)
TOOL_POSES = ("PoseStamped", "PoseWithCovarianceStamped", "PoseInFrame")
POSES = (*TOOL_POSES, "Odometry")
CONTROLLERS = ("JointTrajectoryControllerState", "JointControllerState")
ARRAYS = ("Float64MultiArray", "Float32MultiArray")
TRANSFORMS = ("TFMessage", "FrameTransforms")
KINDS = (
    JOINTS,
    (*POINTS, *POSES, *CONTROLLERS, *ARRAYS),
    (*FRAMES, *TRANSFORMS),
)  # the first that is there is read
SOURCE = "ros"  # REP 103: rad, m, s

MAX_VALUES = (
    500  # numbers of an array that become columns, as many as a log may have joints: others are images, scans
)
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

    file: str
    counts: Mapping[str, int]
    types: Mapping[str, str]

    def kind(self, name: str) -> str:
        """Return the last word of a type: JointState of sensor_msgs/msg/JointState, foxglove.JointState."""
        return re.split(r"[/.:]+", self.types[name])[-1]

    def describe(self, name: str) -> str:
        """Return type and number of messages of a topic."""
        return f"{self.types[name] or 'no type'}, {format_count(self.counts[name], 'message')}"

    def list(self, names: Sequence[str]) -> str:
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
    topics = _Topics(str(path), counts, {topic.name: topic.type for topic in bag.topics})
    name, frame, why = _choose(topics, options.topic)
    messages, damage = bag.read(name)
    warnings = [*_damage_warning(topics, name, len(messages), damage)]
    rows = [*_decode(messages, topics.file)]
    applied = ["topic"] if options.topic else []
    kind, title, clock = topics.kind(name), name, ""
    if kind in (*FRAMES, *TRANSFORMS):
        rows, title = _select_frame([*_iter_transforms(rows)], topics, name, frame)
    elif kind in POINTS:
        rows = _select_points(rows, options.episode, topics.file, name)
        applied += ["episode"] if options.episode else []
        clock = "time_from_start" if kind == "JointTrajectory" else ""
    elif kind in JOINTS:
        rows, other_joints = _select_joints(rows, options.joints, topics.file)
        warnings += other_joints
    table, inferences, more = _build_table(rows, name, topics.file, clock)
    unread = [other for other in counts if other != name]
    hints = tuple(Hint("topic", other) for other in unread[:1])
    inferences = [Inference("topic", title, why, hints=hints), *inferences]
    if unread:
        inferences.append(Inference("topics not read", topics.list(unread), "a log is one topic"))
    for other in unread if kind in JOINTS else ():
        if topics.kind(other) in TOOL_POSES:
            message = f"{topics.list([other])} is not read: its rows are not those of the joints"
            warnings.append(LogWarning("other-topic", message, hints=(Hint("topic", other, "reads it"),)))
    is_ros = "/" in topics.types[name] or any(kind in kinds for kinds in KINDS)
    return MemoryTable(
        path.name if path.is_dir() else path.stem, table, path=path, inferences=tuple(inferences),
        applied=tuple(applied), source=SOURCE if is_ros else "", warnings=(*warnings, *more),
    )  # fmt: skip


def _choose(topics: _Topics, option: str | None) -> tuple[str, str, str]:
    """Return the topic that is read, the frame that the option names with it, and why."""
    names = sorted(topics.counts)
    if option is not None:
        for topic, frame in ((option, ""), option.rpartition(":")[::2]):
            name = next((name for name in names if topic in (name, name.lstrip("/"))), None)
            if name and (not frame or topics.kind(name) in (*FRAMES, *TRANSFORMS)):
                return name, frame, "given as an option"
        allowed = f"a topic of the recording: {topics.list(names)}"
        raise LogError(
            Finding(file=topics.file, parameter="topic", found=format_value(option), allowed=allowed)
        )
    for kinds in KINDS:
        matching = [name for name in names if topics.kind(name) in kinds]
        if len(matching) == 1:
            return matching[0], "", f"the only one with a {topics.kind(matching[0])}"
        if matching:
            raise _topic_question(topics.file, {name: topics.describe(name) for name in matching})
    if len(names) > 1:
        raise _topic_question(topics.file, {name: topics.describe(name) for name in names})
    return names[0], "", "the only one"


def _topic_question(file: str, choices: Mapping[str, str], what: str = "topics") -> LogError:
    """Return the question which topic, or frame of it, to read."""
    message = f"{len(choices)} {what} that may be the log"
    hints = tuple(Hint("topic", name, f"reads {does}") for name, does in [*choices.items()][:MAX_LISTED])
    return LogError(Finding(file=file, found=message, allowed="one of them", hints=hints))


def _damage_warning(topics: _Topics, name: str, count: int, damage: Sequence[str]) -> Iterator[LogWarning]:
    """Yield a warning about a recording that is read in part; raise if nothing of the topic was."""
    if not damage:
        return
    reasons = "; ".join(damage)
    if not count:
        message = f"found no message of {name} that can be read ({reasons}), allowed: a complete recording"
        raise LogError(Finding(message, topics.file))
    read = f"{format_count(count, 'message')} of {name}"
    message = f"the recording is cut or damaged: {read} were read, others are missing ({reasons})"
    yield LogWarning("cut-recording", message, assumption=f"{read} are the motion")


# Rows


def _decode(messages: Sequence[Message], file: str) -> Iterator[_Row]:
    """Yield the messages decoded; raise with the number of those that cannot be."""
    decoders = {topic: decoder(topic, file) for topic in dict.fromkeys(message.topic for message in messages)}
    bad = list[tuple[int, str]]()
    for number, (topic, log_ns, data) in enumerate(messages, start=1):
        try:
            message = decoders[topic](data)
            fields = _fields(message)
        except (ValueError, TypeError) as error:
            bad.append((number, str(error).partition("\n")[0]))
            continue
        yield _Row(_stamp(fields), log_ns, message, _names_in(fields))
    if bad:
        number, reason = bad[0]
        count = f"{len(bad)} of {format_count(len(messages), 'message')} that cannot be decoded"
        first = f"the first is message {number} of {messages[number - 1].topic.name} ({reason})"
        raise LogError(Finding(file=file, found=f"{count}: {first}", allowed="complete messages"))


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
        places = (place[name] for place in (inner, fields) for name in _STAMPS if name in place)
        stamp = next(places, None)
    return _nanoseconds(stamp)


def _names_in(fields: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names that a message gives the values of its arrays."""
    for field in _NAMES:
        names = fields.get(field)
        if isinstance(names, list) and names and isinstance(names[0], str):
            return tuple(names)
    joints = fields.get("joints")
    if isinstance(joints, list) and joints and not isinstance(joints[0], (str, int, float)):
        return tuple(str(_fields(joint).get("name", "")) for joint in joints)
    return ()


def _select_points(rows: Sequence[_Row], episode: str | None, file: str, name: str) -> list[_Row]:
    """Return the points of a trajectory or the poses of a path as rows, those of the message `episode`."""
    if episode is None and len(rows) > 1:
        counts = enumerate((len(_points_of(row)) for row in rows[:MAX_LISTED]), start=1)
        hints = tuple(Hint("episode", str(k), f"reads {format_count(n, 'point')}") for k, n in counts)
        message = f"{len(rows)} trajectories of {name}"
        raise LogError(Finding(file=file, found=message, allowed="one of them", hints=hints))
    number = 1 if episode is None else int(episode) if episode.isdecimal() else 0
    if not 1 <= number <= len(rows):
        allowed = f"1 to {len(rows)}, the trajectories of {name}"
        raise LogError(Finding(file=file, parameter="episode", found=format_value(episode), allowed=allowed))
    row = rows[number - 1]
    return [_Row(_stamp(_fields(point)), row.log_ns, point, row.names) for point in _points_of(row)]


def _points_of(row: _Row) -> Sequence[Any]:
    fields = _fields(row.message)
    points: Sequence[Any] = fields.get("points") or fields.get("poses") or ()
    return points


def _iter_transforms(rows: Sequence[_Row]) -> Iterator[tuple[str, _Row]]:
    """Yield the transforms of messages, each with the frame that it places."""
    for row in rows:
        for transform in _fields(row.message).get("transforms", [row.message]):
            fields = _fields(transform)
            yield str(fields.get("child_frame_id", "")), _Row(_stamp(fields), row.log_ns, transform, ())


def _select_frame(
    transforms: Sequence[tuple[str, _Row]], topics: _Topics, name: str, frame: str
) -> tuple[list[_Row], str]:
    """Return the transforms of one frame, and its title."""
    counts = Counter(child for child, _ in transforms)
    if not frame and len(counts) > 1:
        choices = {f"{name}:{child}": format_count(n, "transform") for child, n in counts.most_common()}
        raise _topic_question(topics.file, choices, f"frames of {name}")
    frame = frame or next(iter(counts), "")
    if frame not in counts:
        allowed = f"a frame of {name}: {', '.join([*counts][:MAX_LISTED])}"
        raise LogError(
            Finding(file=topics.file, parameter="topic", found=format_value(frame), allowed=allowed)
        )
    return [row for child, row in transforms if child == frame], f"{name}:{frame}"


def _select_joints(
    rows: Sequence[_Row], joints: Sequence[str], file: str
) -> tuple[list[_Row], list[LogWarning]]:
    """Return the messages of one set of joints, and warnings about those of other sets.

    Two nodes may publish on one topic: messages with nothing but grippers or wheels are left out.
    """
    sets = Counter(frozenset(row.names) for row in rows)
    order = {frozenset(row.names): row.names for row in reversed(rows)}
    no_arm = vocabulary().other | vocabulary().grippers
    arms = [names for names in sets if not all(no_arm & {*key(name).split("_")} for name in names)] or [*sets]
    requested = [names for names in sets if joints and all(_is_among(joint, names) for joint in joints)]
    if not requested and len(arms) > 1:
        choices = [(order[names], format_count(count, "message")) for names, count in sets.most_common()]
        hints = tuple(
            Hint("joints", [f"position.{name}" for name in names], f"reads {count}")
            for names, count in choices[:MAX_LISTED]
        )
        message = f"messages with {len(sets)} different sets of joints"
        raise LogError(Finding(file=file, found=message, allowed="one of them", hints=hints))
    kept = requested or arms
    left_out = [
        f"{format_count(count, 'message')} with the joints {', '.join(order[names]) or 'without names'}"
        for names, count in sets.items()
        if names not in kept
    ]
    warnings = [LogWarning("other-joints", f"{message} are left out") for message in left_out]
    return [row for row in rows if frozenset(row.names) in kept], warnings


def _is_among(joint: str, names: Collection[str]) -> bool:
    """Return whether a joint, perhaps as its column is called, is among names."""
    return joint in names or any(joint.endswith(f".{name}") for name in names)


# Columns


def _values(message: Any, names: tuple[str, ...], large: set[str], before: str = "") -> Iterator[_Values]:
    """Yield the numbers of a message with their names, which are paths."""
    for name, value in _fields(message).items():
        if name not in _NO_VALUES:
            yield from _value(before + name, value, names, large)


def _value(path: str, value: Any, names: tuple[str, ...], large: set[str]) -> Iterator[_Values]:
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
                yield from _item(path, k, item, names, large)
    elif value is not None and not isinstance(value, (str, bytes)) and _nanoseconds(value) is None:
        yield from _values(value, names, large, f"{path}.")


@lru_cache
def _labels(path: str, names: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Return the names of the numbers of an array: position.NAME for one name each, else data[0]."""
    if count == len(names):
        return tuple(f"{path}.{name}" for name in names)
    return tuple(f"{path}[{k}]" for k in range(count))


def _item(path: str, k: int, item: Any, names: tuple[str, ...], large: set[str]) -> Iterator[_Values]:
    """Yield the numbers of an element of a list: by its name if it has one, position.NAME, else by number."""
    if item is None or isinstance(item, (str, bytes)):
        return
    fields = {} if isinstance(item, (int, float, list)) or hasattr(item, "tolist") else _fields(item)
    if isinstance(fields.get("name"), str):
        for labels, values in _values(item, names, large):
            yield tuple(f"{label}.{fields['name']}" for label in labels), values
    else:
        yield from _value(f"{path}[{k}]", item, names, large)


def _build_table(
    rows: Sequence[_Row], topic: str, file: str, clock: str
) -> tuple[pa.Table, list[Inference], list[LogWarning]]:
    """Return rows as a table, with inferences and warnings about its clock and its columns."""
    large = set[str]()
    blocks = dict[tuple[str, ...], tuple[list[int], list[list[Any]]]]()  # rows with the same numbers
    for place, row in enumerate(rows):
        labels, numbers = list[str](), list[Any]()
        for more, values in _values(row.message, row.names, large):
            labels += more
            numbers += values
        places, block = blocks.setdefault(tuple(labels), ([], []))
        places.append(place)
        block.append(numbers)
    columns = dict[str, list[Any]]()
    for names, (places, block) in blocks.items():
        if twice := [name for name, count in Counter(names).items() if count > 1]:
            message = f"message {places[0] + 1} of {topic} has {twice[0]} twice, allowed: each name once"
            raise LogError(Finding(message, file))
        refuse_wide(len({*columns, *names}), file)
        for name, values in zip(names, zip(*block, strict=True), strict=True):
            column = columns.setdefault(name, [None] * len(rows))
            for place, value in zip(places, values, strict=True):
                column[place] = value
    times, called, inferences, warnings = _clock(rows, topic, clock)
    arrays = [*map(_array, (times, *columns.values()))]
    fields = [pa.field(called, arrays[0].type, metadata={UNIT: b"ns"})]
    joints = {name for names in {row.names for row in rows} for name in names}
    for name, array in zip(columns, arrays[1:], strict=True):
        match = _POSITION.fullmatch(name)
        is_joint = match is not None and match["name"] in joints and "error" not in name.split(".")
        fields.append(pa.field(name, array.type, metadata={ROLE: JOINT} if is_joint else None))
    if large:
        why = f"arrays of more than {MAX_VALUES} values"
        inferences.append(Inference("values not read", ", ".join(sorted(large)), why))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields)), inferences, warnings


def _array(values: Sequence[Any]) -> pa.Array:
    """Return numbers as an array: integers that fit, else doubles."""
    try:
        return pa.array(values)
    except (pa.ArrowException, OverflowError):
        return pa.array([None if value is None else float(value) for value in values])


def _clock(
    rows: Sequence[_Row], topic: str, name: str
) -> tuple[list[int], str, list[Inference], list[LogWarning]]:
    """Return the times of rows in [ns], the name of their column, inferences and warnings."""
    stamps, logged = [row.stamp for row in rows if row.stamp is not None], [row.log_ns for row in rows]
    if name and len(stamps) == len(rows):
        return stamps, name, [], []
    if not stamps:
        why = "the messages have no stamps: when the recorder received each"
        return logged, "log_time", [Inference("clock", "log time", why)], []
    distinct = len(set(stamps))
    if len(stamps) < len(rows) or (len(rows) > 1 and distinct <= MIN_DISTINCT * len(rows)):
        fault = f"repeat ({distinct} different ones in {len(rows)} messages)"
        fault = "are all 0" if set(stamps) == {0} else fault
        message = f"the stamps of {topic} {fault}: times are those of the recorder"
        return logged, "log_time", [], [LogWarning("log-time", message)]
    return stamps, "header.stamp", [], []
