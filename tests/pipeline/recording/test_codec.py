"""Any dataclass comes back from JSON and arrays as it was, and nothing but what its types allow."""

from __future__ import annotations

import functools
import json
import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from asserting import refusal
from same_results import assert_same
from urmpipe_models.arm.chain import Chain
from urmpipe_models.drives import Drive, DrivenJoint, Gains, PassiveJoint
from urmpipe_models.elementwise import BoolArray, FloatArray, IntArray, TextArray
from urmpipe_models.kinematics.forward import forward
from urmpipe_models.robots.catalogue import load_robot, robot_names
from urmpipe_models.robots.toml import robot_toml
from urmpipe_pipeline.recording.codec import CodecError, decode, encode


@dataclass(frozen=True)
class Ball:
    radius: float


@dataclass(frozen=True)
class Bar:
    radius: float
    length: float


@dataclass(frozen=True)
class Row:
    """A flat record: many of them stand as columns."""

    name: str
    kind: Literal["a", "b"]
    count: int
    share: float
    sure: bool
    mixed: int | float | None = None


@dataclass(frozen=True, eq=False)
class Part:
    name: str
    t_ns: IntArray
    values: FloatArray
    flags: BoolArray
    counts: NDArray[np.uint8]
    small: NDArray[np.float32]
    texts: TextArray


@dataclass(frozen=True, eq=False)
class Toy:
    name: str
    number: float
    file: Path | None
    shape: Ball | Bar
    pair: tuple[int, float]
    rows: tuple[Row, ...]
    parts: tuple[Part, ...]
    notes: Mapping[str, tuple[str, ...]]
    anything: Mapping[str, Any]
    poses: FloatArray | None
    lone: FloatArray
    labels: NDArray[np.str_]
    recording: Path | None = field(default=None, metadata={"stored": False})


@dataclass(frozen=True, eq=False)
class Placed:
    t_ns: IntArray
    values: FloatArray = field(metadata={"path": "deep/values"})


TEXT = st.text(st.characters(exclude_categories=[]), max_size=8)
WORDS = st.text(max_size=8)
NUMBER = st.floats() | st.integers(-(2**70), 2**70)
LENGTH = st.integers(0, 7)


def array(dtype: Any, *shape: int) -> st.SearchStrategy[NDArray[Any]]:
    return arrays.arrays(dtype, shape)


@st.composite
def part(draw: st.DrawFn) -> Part:
    n = draw(LENGTH)
    texts = np.array([*draw(st.lists(TEXT, min_size=n, max_size=n)), ""], dtype=np.object_)[:n]
    return Part(
        draw(TEXT), draw(array(np.int64, n)), draw(array(np.float64, n, 3)), draw(array(np.bool_, n)),
        draw(array(np.uint8, n)), draw(array(np.float32, n, 2)), texts,
    )  # fmt: skip


ROW = st.builds(
    Row, TEXT, st.sampled_from(["a", "b"]), st.integers(-(2**63), 2**63), st.floats(), st.booleans(),
    st.none() | NUMBER,
)  # fmt: skip
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | TEXT,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=5,
)
TOY = st.builds(
    Toy,
    name=TEXT,
    number=NUMBER,
    file=st.none() | st.just(Path("a/b.csv")),
    shape=st.builds(Ball, st.floats()) | st.builds(Bar, st.floats(), st.floats()),
    pair=st.tuples(st.integers(), st.floats()),
    rows=st.lists(ROW, max_size=3).map(tuple)
    | st.lists(ROW, min_size=1, max_size=3).map(lambda x: tuple(x * 30)),
    parts=st.lists(part(), max_size=3).map(tuple),
    notes=st.dictionaries(TEXT, st.lists(TEXT, max_size=2).map(tuple), max_size=2),
    anything=st.dictionaries(TEXT | st.just("$array"), JSON, max_size=3),
    poses=st.none() | array(np.float64, 4, 2, 3),
    lone=array(np.float64),
    labels=arrays.arrays("<U3", 4, elements=WORDS.map(lambda text: text[:3].rstrip("\0"))),
)


def round_trip(value: Any) -> Any:
    """Return a value that went through JSON and the bytes of its arrays."""
    found = encode(value)
    paths = [one.path for one in found.arrays]
    assert len(set(paths)) == len(paths)
    stored = {
        one.path: (one.values.shape, one.values.dtype, np.asarray(one.values).tobytes())
        for one in found.arrays
    }

    def array_of(at: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> NDArray[Any]:
        assert stored[at][:2] == (shape, dtype)
        return np.frombuffer(stored[at][2], dtype).reshape(shape)

    return decode(type(value), json.loads(json.dumps(found.tree)), array_of)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(TOY)
def test_whatever_its_fields_hold_comes_back(toy: Toy) -> None:
    assert_same(round_trip(toy), toy)


def test_numbers_of_numpy_come_back_as_numbers() -> None:
    back = round_trip(Row("x", "a", np.int64(3), np.float64(0.1), np.bool_(True), np.float64("nan")))  # type: ignore[arg-type]
    assert [type(one) for one in (back.count, back.share, back.sure, back.mixed)] == [int, float, bool, float]


def small_toy(**fields: Any) -> Toy:
    told: dict[str, Any] = {
        "name": "toy", "number": 0.5, "file": None, "shape": Ball(1.0), "pair": (1, 2.0), "rows": (),
        "parts": (), "notes": {}, "anything": {}, "poses": None, "lone": np.array(1.0),
        "labels": np.array(["a"]),
    }  # fmt: skip
    return Toy(**(told | fields))


def one_part(name: str, n: int) -> Part:
    return Part(
        name, np.arange(n), np.ones((n, 3)), np.ones(n, np.bool_), np.ones(n, np.uint8),
        np.ones((n, 2), np.float32), np.full(n, "x", np.object_),
    )  # fmt: skip


def test_an_array_stands_at_the_path_of_its_field_on_the_nearest_times() -> None:
    parts = one_part("matlab", 3), one_part("a b/c", 4), one_part("matlab", 5)
    found = {one.path: one for one in encode(small_toy(parts=parts, poses=np.zeros((3, 2, 2)))).arrays}
    assert found["/parts/matlab/values"].t_ns is parts[0].t_ns
    assert found["/parts/a_b_c/flags"].t_ns is parts[1].t_ns
    assert found["/parts/matlab-2/values"].values is parts[2].values
    assert found["/parts/matlab/t_ns"].t_ns is None
    assert found["/poses"].t_ns is None
    plotted = {at for at, one in found.items() if one.plotted}
    assert plotted == {f"/parts/{name}/values" for name in ("matlab", "a_b_c", "matlab-2")}


def test_a_field_may_say_where_its_array_stands() -> None:
    one = Placed(np.arange(3), np.ones((3, 2)))
    assert [column.path for column in encode(one).arrays] == ["/t_ns", "/deep/values"]
    assert encode(one).arrays[1].t_ns is one.t_ns
    assert_same(round_trip(one), one)


def test_an_array_in_two_places_is_kept_once() -> None:
    both = np.zeros((3, 3))
    toy = small_toy(poses=both, lone=both)
    found = encode(toy)
    assert [one.path for one in found.arrays] == ["/poses", "/labels"]
    assert (found.path_of(both), found.path_of(toy.labels)) == ("/poses", "")


def test_many_records_and_many_plain_values_stand_as_columns() -> None:
    rows = tuple(Row(f"r{i % 3}", "ab"[i % 2], i, i / 7, i % 2 == 0) for i in range(100))  # type: ignore[arg-type]
    found = encode(small_toy(rows=rows, notes={"n": tuple(map(str, range(100)))}))
    columns = {one.path: one.values for one in found.arrays}
    assert columns["/rows/share"].tolist() == [one.share for one in rows]
    assert found.tree["rows"]["$columns"]["name"]["$text"] == ["r0", "r1", "r2"]
    assert found.tree["rows"]["$columns"]["mixed"] == [None] * 100
    assert len(columns["/notes/n"]) == 100


@pytest.mark.parametrize("name", robot_names())
def test_an_arm_comes_back_with_every_bit(name: str) -> None:
    chain = load_robot(name)
    back = round_trip(chain)
    assert (back, robot_toml(back), back.parameters) == (chain, robot_toml(chain), chain.parameters)
    q = [0.1 * k + 0.37 for k in range(len(chain.coordinates))]
    assert forward(back, q) == forward(chain, q)


def test_masses_gravity_and_drives_come_back() -> None:
    arm = load_robot("ur3")
    motor, gains = Drive(2500.0, 5.0, 100.0, 0.05, 0.5, 0.001, 0.5), Gains(7.5, 0.75, 0.01)
    driven = DrivenJoint(arm.coordinates[0], motor, 0.005, gains, 48.0)
    drives = driven, PassiveJoint(arm.coordinates[1], 3000.0, 0.0)
    heavy = replace(arm, gravity=(0.0, 9.81, 0.0), left_out=("finger",), drives=drives)
    assert round_trip(heavy) == heavy


def test_an_arm_stored_without_its_parameters_has_those_of_its_frames() -> None:
    tree = encode(load_robot("urm4")).tree
    for frame in (tree["base"], tree["tip"], tree["tool"], *(joint["origin"] for joint in tree["joints"])):
        del frame["steps"]
    back = decode(Chain, tree, lambda *_: np.zeros(0))
    assert back == load_robot("urm4")
    found = {one.name: one.value for one in back.parameters}
    assert (found["phi2.z"], found["tip.z"], found["phi2.ry"]) == (0.243215, 0.042215, 0.0)


GONE = object()
WRONG: list[tuple[str, Any, str]] = [
    ("name", 3, "/name: found 3, allowed: str"),
    ("number", "1", "/number: found '1', allowed: float"),
    ("number", True, "/number: found True, allowed: float"),
    ("file", [], "/file: found [], allowed: Path or None"),
    ("shape", {"radius": 1.0}, "/shape: found {'radius': 1.0}, allowed: Ball or Bar"),
    ("shape/$is", "Path", "allowed: Ball or Bar"),
    ("shape/radius", GONE, "/shape: found None, allowed: the field radius of Ball"),
    ("pair", [1], "/pair: found [1], allowed: tuple[int, float]"),
    ("pair", [1.5, 1.5], "/pair/0: found 1.5, allowed: int"),
    ("rows", {}, "/rows: found {}, allowed: tuple[Row, ...]"),
    ("rows/$columns/kind", ["c"] * 100, "/rows/kind: found 'c', allowed: 'a' or 'b'"),
    ("rows/$columns/sure", [1] * 100, "/rows/sure: found 1, allowed: bool"),
    ("rows/count", 99, "found 100, allowed: 99 values"),
    ("rows/$columns/count", GONE, "the field count of Row"),
    ("rows/$columns/count", {"$array": "/rows/share", "shape": [100], "dtype": "<f8"}, "allowed: int"),
    ("lone", 1.0, "/lone: found 1.0, allowed: array of float"),
    ("lone/dtype", "<i8", "/lone: found '<i8', allowed: an array of float"),
    ("lone/dtype", "|O", "/lone: found '|O', allowed: an array of float"),
    ("lone/shape", [-1], "/lone: found [-1], allowed: the shape of an array"),
    ("labels/$text", [], "found 0, allowed: the number of one of 0 texts"),
    ("labels/$text", [1], "/labels: found [1], allowed: a list of texts"),
    ("notes", {"n": "text"}, "/notes/n: found 'text', allowed: tuple[str, ...]"),
]


@pytest.mark.parametrize(("place", "value", "said"), WRONG)
def test_what_the_types_do_not_allow_is_refused_in_one_line(place: str, value: Any, said: str) -> None:
    found = encode(small_toy(rows=tuple(Row("r", "a", i, i / 7, True) for i in range(100))))
    arrays_of = {one.path: one.values for one in found.arrays}
    tree = json.loads(json.dumps(found.tree))
    *ways, last = place.split("/")
    inner = functools.reduce(operator.getitem, ways, tree)
    if value is GONE:
        del inner[last]
    else:
        inner[last] = value
    message = refusal(CodecError, decode, Toy, tree, lambda at, shape, dtype: arrays_of[at])
    assert said in message
    assert "\n" not in message


def test_what_could_not_be_read_back_is_not_written() -> None:
    for wrong, said in (
        ({"number": "much"}, "/number: found 'much', allowed: float"),
        ({"lone": np.array(["x"])}, "/lone: found array"),
        ({"anything": {"a": object()}}, "/anything/a: found an object, allowed: what JSON can hold"),
    ):
        assert said in refusal(CodecError, encode, small_toy(**wrong))


def test_what_a_class_refuses_is_refused() -> None:
    tree = encode(load_robot("urm6")).tree
    tree["joints"][0]["axis"] = [0.0, 0.0, math.nan]
    tree["joints"] = tree["joints"][:1] * 2
    with pytest.raises(CodecError, match="joint names repeat"):
        decode(Chain, tree, lambda at, shape, dtype: np.empty(shape, dtype))


@dataclass
class Ambiguous:
    place: str | Path


def test_a_union_that_json_does_not_tell_apart_has_no_form() -> None:
    with pytest.raises(TypeError, match="allowed: what JSON tells apart"):
        encode(Ambiguous("a"))
