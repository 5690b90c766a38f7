"""Recordings of messages: MCAP, ROS 2 (SQLite, MCAP, their folders) and ROS 1 bags.

1. `open_bag`: the files of a recording in order, and its topics with types and counts.
2. `Bag.read`: the messages of a topic with their log times, until the recording ends or is damaged.
3. `make_decoder`: the function that decodes the messages of a topic.

Libraries' own readers need the index at the end of a file, which a recording that was cut does not have.

Sources: the MCAP specification, the ROS bag format 2.0, rosbag2_storage_sqlite3 (tables `topics`, `messages`,
`message_definitions`), rosbag2_storage (`metadata.yaml`).
"""

from __future__ import annotations

import json
import re
import sqlite3
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from io import BytesIO
from os.path import isdir  # Path raises for a name that no file can have
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any, NamedTuple
from urllib.parse import quote

import pyarrow as pa

from urmpipe_models.errors import Finding, LogError, format_value
from urmpipe_pipeline.logs.formats.text import check_unpacked_size, unpacked_limit

MAGIC = {b"\x89MCAP": ".mcap", b"SQLite format 3\0": ".db3", b"#ROSBAG V": ".bag"}
METADATA = "metadata.yaml"
MAX_HEADER = 1 << 20  # bytes of a header of ROS 1, which holds a topic and a few numbers

_PACKED = (".mcap.zstd", ".db3.zstd")  # as a whole, by `ros2 bag record --compression-mode file`
_SUFFIXES = (*MAGIC.values(), *_PACKED)
_ZSTD = b"\x28\xb5\x2f\xfd"  # begins a packed message; one of ROS 2 begins with 0
_SPLIT = re.compile(r"[-_]?\d+(?=\.[^.]+(\.zstd)?$)")  # what names of the parts of a recording differ by
_LISTED = re.compile(r"^\s*- (\S+\.(?:mcap|db3)(?:\.zstd)?)\s*$", re.MULTILINE)  # parts, in their metadata
_CODECS = ("zstd", "lz4", "bz2")  # of MCAP and ROS 1, as pyarrow calls them


class Topic(NamedTuple):
    """A topic of a recording.

    Attributes:
        name: Its name.
        type: Type of its messages, such as sensor_msgs/msg/JointState.
        encoding: How they are written: cdr, ros1, json, or another one, which is not decoded.
        form: How the definition is written: ros2msg, ros2idl, ros1msg; empty without one.
        definition: The definition of the type.
    """

    name: str
    type: str
    encoding: str
    form: str = ""
    definition: str = ""


class Message(NamedTuple):
    """A message as it was recorded: its topic, the time of the recorder in [ns], its bytes."""

    topic: Topic
    log_ns: int
    data: bytes


class Bag(NamedTuple):
    """A recording.

    Attributes:
        path: Its file or folder.
        files: Its files in the order of their names, or of its metadata.
        topics: Its topics with the number of their messages.
    """

    path: Path
    files: tuple[Path, ...]
    topics: Mapping[Topic, int]

    def read(self, name: str) -> tuple[list[Message], list[str]]:
        """Return the messages of a topic by their log times, and what kept others from being read."""
        messages, damage = list[Message](), list[str]()
        for file in self.files:
            try:
                messages += (message for message in _iter_messages(file) if message.topic.name == name)
            except _DamageError as error:
                damage.append(f"{file.name}: {error}")
        stated = sum(count for topic, count in self.topics.items() if topic.name == name)
        if not damage and len(messages) < stated:
            damage.append(f"{stated} messages are stated")
        return sorted(messages, key=lambda message: message.log_ns), damage


class _DamageError(Exception):
    """The recording cannot be read from here on."""


def is_bag_folder(path: Path) -> bool:
    """Return whether a path is a folder with a recording: its metadata, or files of messages."""
    return isdir(path) and ((path / METADATA).is_file() or bool(_list_files(path)))  # noqa: PTH112


def is_packed(path: Path) -> bool:
    """Return whether a file is called like a recording that was packed as a whole."""
    return path.name.lower().endswith(_PACKED)


def open_bag(path: Path) -> Bag:
    """Return a recording with its topics.

    Raises:
        LogError: If a file is missing or is no recording, or several recordings lie in one folder.
    """
    files = _find_parts(path) if path.is_dir() else (path,)
    topics, damage = Counter[Topic](), list[str]()
    for file in files:
        try:
            topics.update(_count_messages(file))
        except _DamageError as error:
            damage.append(f"{file.name}: {error}")
    if not +topics:
        reason = f" ({'; '.join(damage)})" if damage else ""
        raise LogError(Finding(f"found no message{reason}, allowed: a recording of messages", str(path)))
    return Bag(path, files, +topics)


def _list_files(folder: Path) -> list[Path]:
    """Return the files of messages in a folder, in the order of their numbers."""
    files = (path for path in folder.iterdir() if path.name.lower().endswith(_SUFFIXES) and path.is_file())
    return sorted(files, key=lambda path: [int(number) for number in re.findall(r"\d+", path.name)])


def _find_parts(folder: Path) -> tuple[Path, ...]:
    """Return the files of a recording in a folder: those that its metadata name, else all."""
    files, metadata = _list_files(folder), folder / METADATA
    text = metadata.read_text(encoding="utf-8", errors="replace") if metadata.is_file() else ""
    parts = [folder / name.rpartition("/")[2] for name in _LISTED.findall(text)]
    if missing := [path.name for path in parts if not path.is_file()]:
        message = f"found no {', '.join(missing)}, allowed: every file that {METADATA} names"
        raise LogError(Finding(message, str(folder)))
    if not parts and len({_SPLIT.sub("", path.name) for path in files}) > 1:
        names = ", ".join(path.name for path in files[:6])
        message = f"found several recordings ({names}), allowed: one, or its parts NAME_0, NAME_1, ..."
        raise LogError(Finding(f"{message}; give one of the files", str(folder)))
    return tuple(parts or files)


@contextmanager
def _opened(file: Path) -> Iterator[tuple[Path, str]]:
    """Provide a file, unpacked if it was packed as a whole, and the suffix that it has by its first bytes."""
    with TemporaryDirectory() as folder:
        if is_packed(file):
            size, most, packed, file = 0, unpacked_limit(file.stat().st_size), file, Path(folder) / file.stem
            try:
                with pa.input_stream(str(packed), compression="zstd") as stream, file.open("wb") as target:
                    while size <= most and (block := stream.read(1 << 20)):
                        size += target.write(block)
            except (pa.ArrowException, OSError) as error:
                raise _DamageError(f"cannot be unpacked ({_reason(error)})") from error
            check_unpacked_size(packed, size)
        with file.open("rb") as stream:
            head = stream.read(16)
        kind = next((suffix for magic, suffix in MAGIC.items() if head.startswith(magic)), None)
        if kind is None:
            raise _DamageError("is no file of messages")
        yield file, kind


def _count_messages(file: Path) -> Mapping[Topic, int]:
    """Return the topics of a file with the number of their messages, by its index if it has one."""
    with _opened(file) as (unpacked, kind):
        if kind == ".db3":
            return _sqlite_topics(unpacked)
        if kind == ".mcap" and (indexed := _mcap_index(unpacked)) is not None:
            return indexed
    counts = Counter[Topic]()
    try:
        counts.update(message.topic for message in _iter_messages(file))
    except _DamageError:
        if not counts:
            raise
    return counts


def _iter_messages(file: Path) -> Iterator[Message]:
    """Yield the messages of a file."""
    with _opened(file) as (unpacked, kind):
        read = {".db3": _sqlite_messages, ".mcap": _mcap_messages, ".bag": _ros1_messages}[kind]
        most = unpacked_limit(unpacked.stat().st_size)
        try:
            for message in read(unpacked):
                is_message_packed = message.data.startswith(_ZSTD) and message.topic.encoding == "cdr"
                data = _unpack(message.data, "zstd", most) if is_message_packed else message.data
                yield message._replace(data=data)
        except (KeyError, ValueError, struct.error) as error:
            raise _DamageError(f"holds a damaged record ({_reason(error)})") from error


def _unpack(data: bytes, codec: str, most: int) -> bytes:
    """Return packed bytes unpacked; a `_DamageError` if they are damaged or larger than allowed."""
    if codec not in _CODECS:
        raise _DamageError(f"messages are packed by {format_value(codec)}, which is not known")
    try:
        with pa.CompressedInputStream(pa.BufferReader(data), codec) as stream:
            unpacked: bytes = stream.read(most + 1)
    except (pa.ArrowException, OSError) as error:
        raise _DamageError(f"packed messages are damaged ({_reason(error)})") from error
    if len(unpacked) > most:
        raise _DamageError(f"messages unpack to more than {most} bytes")
    return unpacked


def _reason(error: BaseException) -> str:
    return str(error).partition("\n")[0].strip(" .") or type(error).__name__


class _ExactStream:
    """A stream whose reads return as many bytes as requested, or raise."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.stream = stream

    def read(self, count: int) -> bytes:
        data = self.stream.read(count)
        if len(data) < count:
            raise _DamageError("ends within a record")
        return data


# MCAP


def _mcap_index(file: Path) -> Mapping[Topic, int] | None:
    """Return the topics of an MCAP file by its summary; None without one."""
    from mcap.exceptions import McapError
    from mcap.reader import SeekingReader

    with file.open("rb") as stream:
        try:
            summary = SeekingReader(stream, record_size_limit=file.stat().st_size).get_summary()
        except (McapError, OSError, ValueError, KeyError, struct.error, StopIteration):
            return None
    if summary is None or summary.statistics is None or not summary.channels:
        return None
    by_channel, counts = summary.statistics.channel_message_counts, Counter[Topic]()
    for number, channel in summary.channels.items():
        counts[_mcap_topic(channel, summary.schemas.get(channel.schema_id))] += by_channel.get(number, 0)
    return counts


def _mcap_topic(channel: Any, schema: Any) -> Topic:
    if schema is None:
        return Topic(channel.topic, "", channel.message_encoding)
    text = schema.data.decode(errors="replace") if schema.encoding.startswith("ros") else ""
    return Topic(channel.topic, schema.name, channel.message_encoding, schema.encoding, text)


def _mcap_messages(file: Path) -> Iterator[Message]:
    """Yield the messages of an MCAP file in its order."""
    from mcap.records import Channel, Schema
    from mcap.records import Message as Record

    schemas, topics = dict[int, Any](), dict[int, Topic]()
    for record in _mcap_records(file):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            topics[record.id] = _mcap_topic(record, schemas.get(record.schema_id))
        elif isinstance(record, Record) and record.channel_id in topics:
            yield Message(topics[record.channel_id], record.log_time, record.data)


def _mcap_records(file: Path) -> Iterator[Any]:
    """Yield the records of an MCAP file, those of its chunks unpacked and checked."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    size = file.stat().st_size
    with file.open("rb") as stream:
        exact: Any = _ExactStream(stream)
        try:
            for record in StreamReader(exact, emit_chunks=True, record_size_limit=size).records:
                if not isinstance(record, Chunk):
                    yield record
                    continue
                if record.uncompressed_size > unpacked_limit(size):
                    raise _DamageError(f"messages unpack to {record.uncompressed_size} bytes")
                yield from breakup_chunk(record, validate_crc=True)
        except _DamageError:
            raise
        except Exception as error:  # lz4 and zstandard raise their own
            raise _DamageError(f"holds a damaged record ({_reason(error)})") from error


# ROS 2 in SQLite


def _query(file: Path, query: str) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of a query of a file of SQLite, which is not written to."""
    try:
        with closing(sqlite3.connect(f"file:{quote(str(file))}?mode=ro&immutable=1", uri=True)) as database:
            yield from database.execute(query)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise _DamageError(f"cannot be read ({_reason(error)})") from error


def _sqlite_topics(file: Path) -> Mapping[Topic, int]:
    """Return the topics of a file of SQLite; definitions of their types are there since ROS 2 Iron."""
    tables = {name for (name,) in _query(file, "SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"topics", "messages"} <= tables:
        raise _DamageError("is a database without messages of ROS 2")
    definitions = {}
    if "message_definitions" in tables:
        fields = "topic_type, encoding, encoded_message_definition"
        definitions = {
            name: texts for name, *texts in _query(file, f"SELECT {fields} FROM message_definitions")
        }
    by_number = Counter[int]()
    with suppress(_DamageError):  # which `_sqlite_messages` reports
        by_number.update(number for (number,) in _query(file, "SELECT topic_id FROM messages ORDER BY id"))
    counts = Counter[Topic]()
    rows = _query(file, "SELECT id, name, type, serialization_format FROM topics")
    for number, name, kind, encoding in rows:
        counts[Topic(name, kind, encoding, *definitions.get(kind, ("", "")))] += by_number.get(number, 0)
    return counts


def _sqlite_messages(file: Path) -> Iterator[Message]:
    topics = {topic.name: topic for topic in _sqlite_topics(file)}
    joined = "messages JOIN topics ON topics.id = topic_id"
    for name, when, data in _query(file, f"SELECT name, timestamp, data FROM {joined} ORDER BY messages.id"):
        if not (isinstance(when, int) and isinstance(data, bytes)):
            raise _DamageError("holds a damaged row")
        yield Message(topics[name], when, data)


# ROS 1

_HEADER, _CHUNK, _CONNECTION, _MESSAGE = 3, 5, 7, 2  # operations of records


def _ros1_messages(file: Path) -> Iterator[Message]:
    """Yield the messages of a ROS 1 bag in its order; its index is not needed."""
    topics = dict[int, Topic]()
    with file.open("rb") as stream:
        version = stream.readline(16)
        if version != b"#ROSBAG V2.0\n":
            raise _DamageError(f"is a bag of version {version[9:].decode('latin-1').strip()}, not 2.0")
        size, is_closed = file.stat().st_size, True
        for fields, data in _ros1_records(stream, size):
            if fields["op"] == _HEADER:
                is_closed = struct.unpack("<Q", fields["index_pos"])[0] != 0
            inner: Iterator[tuple[dict[str, Any], bytes]] = iter([(fields, data)])
            if fields["op"] == _CHUNK:
                codec, length = fields["compression"].decode(), struct.unpack("<I", fields["size"])[0]
                most = min(unpacked_limit(size), length)
                chunk = data if codec == "none" else _unpack(data, codec, most)
                inner = _ros1_records(BytesIO(chunk), len(chunk))
            for part, content in inner:
                number = int.from_bytes(part.get("conn", b""), "little")
                if part.get("op") == _CONNECTION:
                    about = _ros1_fields(content)
                    texts = (part["topic"], about["type"], about["message_definition"])
                    name, kind, text = (value.decode(errors="replace") for value in texts)
                    topics[number] = Topic(name, kind, "ros1", "ros1msg", text)
                elif part.get("op") == _MESSAGE and number in topics:
                    seconds, rest = struct.unpack("<II", part["time"])
                    yield Message(topics[number], seconds * 10**9 + rest, content)
    if not is_closed:
        raise _DamageError("was not closed by its recorder")


def _ros1_records(stream: IO[bytes], size: int) -> Iterator[tuple[dict[str, Any], bytes]]:
    """Yield the fields and the data of records; of a chunk in which the file ends those that are there."""
    exact = _ExactStream(stream)
    while stream.tell() < size:
        length = struct.unpack("<I", exact.read(4))[0]
        if length > min(size, MAX_HEADER):
            raise _DamageError("holds a damaged record")
        fields = _ros1_fields(exact.read(length))
        length = struct.unpack("<I", exact.read(4))[0]
        data = stream.read(min(length, size))
        if len(data) == length or fields.get("op") == _CHUNK:
            yield fields, data
        if len(data) < length:
            raise _DamageError("ends within a record")


def _ros1_fields(header: bytes) -> dict[str, Any]:
    fields, place = dict[str, Any](), 0
    while place < len(header):
        end = place + 4 + int.from_bytes(header[place : place + 4], "little")
        name, _, value = header[place + 4 : end].partition(b"=")
        fields[name.decode("latin-1")], place = value, end
    if "op" in fields:
        fields["op"] = int.from_bytes(fields["op"], "little")
    return fields


# Messages


def make_decoder(topic: Topic, file: str) -> Callable[[bytes], Any]:
    """Return the function that decodes the messages of a topic: mappings of JSON, or objects with fields.

    The function raises a ValueError for bytes that are no such message.

    Raises:
        LogError: If their encoding or type is not known.
    """
    if topic.encoding == "json":
        return json.loads
    if topic.encoding not in ("cdr", "ros1"):
        message = f"{topic.name} with messages encoded as {format_value(topic.encoding)}"
        raise LogError(Finding(file=file, found=message, allowed="cdr (ROS 2), ros1, json"))
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
    from rosbags.typesys.msg import normalize_msgtype

    kind = normalize_msgtype(topic.type)
    store = get_typestore(Stores.EMPTY if topic.definition else Stores.LATEST)
    try:
        if topic.form == "ros2idl":
            for text in re.split(r"={80}\nIDL: .*\n", topic.definition):
                store.register(get_types_from_idl(text) if text.strip() else {})
        elif topic.definition:
            store.register(get_types_from_msg(topic.definition, kind))
        store.get_msgdef(kind)
    except (TypesysError, KeyError) as error:
        message = f"{topic.name} of the type {topic.type}, whose definition is not known ({_reason(error)})"
        allowed = "types of ROS, or a recording with the definitions of its types"
        raise LogError(Finding(file=file, found=message, allowed=allowed)) from None
    decode = store.deserialize_cdr if topic.encoding == "cdr" else store.deserialize_ros1

    def decode_message(data: bytes) -> Any:
        try:
            return decode(data, kind)
        except (SerdeError, struct.error, IndexError, AssertionError, MemoryError, TypeError) as error:
            raise ValueError(_reason(error)) from error

    return decode_message
