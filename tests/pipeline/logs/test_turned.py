"""Joints as rows and flat arrays are asked about, and each printed answer leads to the arrays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import LogError, OptionError
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, format_map, map_of, read_log, read_map
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.padding import flat_ways, goes_along_rows

Read = Callable[..., JointLog]
Write = Callable[..., Path]


def motion(rows: int = 300, joints: int = 6, seed: int = 1, shortest: float = 40.0) -> FloatArray:
    """Return joints in [rad] that swing about places of their own, with samples in their shortest period."""
    rng = np.random.default_rng(seed)
    rates = 2 * np.pi / (shortest * rng.uniform(1.0, 4.0, joints))
    sizes, phases = rng.uniform(0.2, 0.7, joints), rng.uniform(0, 2 * np.pi, joints)
    places = rng.permutation(np.linspace(-2.2, 2.2, joints))
    return np.asarray(places + sizes * np.sin(rates * np.arange(rows)[:, None] + phases))


def written(values: FloatArray, sign: str = ",", decimal: str = ".") -> str:
    rows = np.atleast_2d(values).tolist()
    return "".join(sign.join(repr(v).replace(".", decimal) for v in row) + "\n" for row in rows)


def asked(read: Callable[[], JointLog]) -> tuple[str, list[str]]:
    """Return the question, and the answers that it prints, as their values."""
    with pytest.raises(LogError) as error:
        read()
    (finding,) = error.value.findings
    assert {hint.parameter for hint in finding.hints} == {"layout"}
    return finding.message, [str(hint.value) for hint in finding.hints]


STYLES = [(",", "."), (";", ","), ("\t", ".")]


@pytest.mark.parametrize(("sign", "decimal"), STYLES)
def test_joints_as_rows(sign: str, decimal: str, read: Read) -> None:
    q = motion()
    text = written(q.T, sign, decimal)
    said, answers = asked(lambda: read(text))
    assert said == (
        "found 6 rows of 300 numbers that go on smoothly along the rows, which may be joints as rows"
    )
    assert answers == ["transposed", "table"]
    np.testing.assert_array_equal(read(text, layout="transposed").q, q)


@pytest.mark.slow
@pytest.mark.parametrize(("sign", "decimal"), STYLES)
def test_a_time_as_the_first_row(sign: str, decimal: str, read: Read) -> None:
    q = motion(joints=7)
    text = written(np.vstack([np.arange(300) / 50, q.T]), sign, decimal)
    assert asked(lambda: read(text))[1] == ["transposed", "table"]
    log = read(text, layout="transposed")
    np.testing.assert_array_equal(log.q, q)
    assert log.period == 0.02


@pytest.mark.parametrize(
    ("names", "head"),
    [
        (["t [s]", "q1 [rad]", "q2 [rad]", "q3 [rad]"], ""),
        (["time", "A1", "A2", "A3"], ""),
        (["t", "J1", "J2", "J3"], "," + ",".join(map(str, range(300))) + "\n"),  # pandas
    ],
)
def test_rows_that_begin_with_a_name_are_joints(names: list[str], head: str, read: Read) -> None:
    q = motion(joints=3)
    rows = written(np.vstack([np.arange(300) / 50, q.T])).splitlines()
    log = read(head + "".join(f"{name},{row}\n" for name, row in zip(names, rows, strict=True)))
    assert log.joints == tuple(name.removesuffix(" [rad]") for name in names[1:])
    np.testing.assert_array_equal(log.q, q)
    assert log.period == 0.02
    (found,) = [one for one in log.inferences if one.what == "layout"]
    assert (found.value, found.alternatives()) == (
        "transposed", '--layout table takes each row as a sample',
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("joints", [2, 6, 7])
@pytest.mark.parametrize("end", ["\n", " "])
def test_numbers_one_by_one_sample_by_sample(joints: int, end: str, read: Read) -> None:
    q = motion(301, joints)
    text = end.join(map(repr, q.ravel().tolist())) + "\n"
    said, answers = asked(lambda: read(text))
    assert said.startswith(
        f"found {q.size} numbers one by one that go on smoothly from one to the {joints}th"
    )
    assert answers[0] == f"flat:{joints}"
    assert answers[-1] == "table"
    np.testing.assert_array_equal(read(text, layout=answers[0]).q, q)


@pytest.mark.slow
@pytest.mark.parametrize("joints", [2, 6, 7])
@pytest.mark.parametrize("head", ["", "q\n"])
def test_numbers_one_by_one_joint_by_joint(joints: int, head: str, read: Read) -> None:
    q = motion(301, joints)
    text = head + written(q.T.reshape(-1, 1))
    said, answers = asked(lambda: read(text))
    assert f"from one to the next, but for {joints - 1} jumps" in said
    assert answers[0] == f"flat-by-joint:{joints}"
    np.testing.assert_array_equal(read(text, layout=answers[0]).q, q)


def test_a_joint_in_one_line(read: Read) -> None:
    q = motion(200, 1)
    assert asked(lambda: read(written(q.T)))[1] == ["transposed", "table"]
    np.testing.assert_array_equal(read(written(q.T), layout="transposed").q, q)


def test_missing_samples_stay(read: Read) -> None:
    q = motion()
    q[7, 2] = np.nan
    text = written(q.T)
    assert asked(lambda: read(text))[1] == ["transposed", "table"]
    np.testing.assert_array_equal(read(text, layout="transposed").q, q)
    np.testing.assert_array_equal(read(written(q.reshape(-1, 1)), layout="flat:6").q, q)


def test_a_table_in_memory() -> None:
    q = motion()
    columns = MemoryTable("q", pa.table({str(k): column for k, column in enumerate(q)}), named=False)
    assert asked(lambda: read_log([columns]))[1] == ["transposed", "table"]
    np.testing.assert_array_equal(read_log([columns], LogMap(layout="transposed")).q, q)


@pytest.mark.slow
def test_rows_longer_than_what_is_looked_at_first(read: Read) -> None:
    q = motion(9000, 4)
    text = written(q.T)
    assert len(text) // 4 > 64 * 1024
    assert asked(lambda: read(text))[1] == ["transposed", "table"]
    np.testing.assert_array_equal(read(text, layout="transposed").q, q)


def test_an_epoch_in_ns_stays_exact(read: Read) -> None:
    start = 1_700_000_000_123_456_789
    rows = [",".join(str(start + k * 10_000_000) for k in range(300)), *written(motion().T).splitlines()]
    log = read("\n".join(rows) + "\n", layout="transposed")
    assert log.clock_start_ns == start
    assert log.t_ns[-1] == 299 * 10_000_000


def single_joints() -> dict[str, FloatArray]:
    rng = np.random.default_rng(4)
    at = np.arange(1200)
    return {
        "smooth": np.sin(at / 30),
        "at rest, noisy": rng.normal(0.4, 1e-4, 1200),
        "moving, noisy": np.sin(at / 200) + rng.normal(0, 0.05, 1200),
        "with spikes": np.sin(at / 30) + 3.0 * (at % 97 == 5),
        "turning on and on": np.radians((3.0 * at) % 360 - 180),
        "given steps": np.repeat([0.2, 1.0, -0.5, 0.7], 300),
        "rests, then moves": np.clip(at - 600, 0, 200) * 0.005,
        "straight pieces": np.interp(at, np.arange(0, 1201, 200), [0.1, 0.9, -0.4, 0.3, 1.2, -1.0, 0.2]),
        "20 samples a period": np.sin(2 * np.pi * at / 20),
    }


@pytest.mark.parametrize("kind", single_joints())
def test_a_single_joint_gets_no_question(kind: str, read: Read) -> None:
    q = single_joints()[kind]
    np.testing.assert_array_equal(read(written(q[:, None])).q[:, 0], q)


def test_a_row_is_a_sample_where_the_user_says_so(read: Read) -> None:
    q = motion(20)
    names = [str(k + 1) for k in range(20)]
    np.testing.assert_array_equal(read(written(q.T), layout="table", joints=names, time="none").q, q.T)
    flat = q.reshape(-1, 1)
    np.testing.assert_array_equal(read(written(flat), layout="table", joints=["1"], time="none").q, flat)


@pytest.mark.parametrize("rows", [2, 6, 16])
def test_a_few_samples_of_many_columns_are_no_joints_as_rows(rows: int, read: Read) -> None:
    """Joints, rates and torques of a few samples: what stands side by side has nothing in common."""
    q = motion(rows, 24)
    assert not goes_along_rows(q)
    names = [str(k + 1) for k in range(6)]
    np.testing.assert_array_equal(read(written(q), joints=names, time="none").q, q[:, :6])


@pytest.mark.parametrize(
    ("layout", "said"),
    [
        ("flat:7", "found 1800 numbers, allowed with flat:7: a multiple of 7"),
        ("transposed", "found a row of 2 cells, allowed: 1, as others have"),
    ],
)
def test_what_does_not_fit(layout: str, said: str, read: Read) -> None:
    text = written(motion().reshape(-1, 1)) + ("" if layout == "flat:7" else "1,2\n")
    with pytest.raises(LogError) as error:
        read(text, layout=layout)
    assert said.replace("2 cells, allowed: 1", "1 cells, allowed: 2") in str(error.value)


@pytest.mark.parametrize("wrong", ["columns", "flat", "flat:0", "flat:six", "flat-by-joint:", 6])
def test_other_layouts_are_refused(wrong: object) -> None:
    with pytest.raises(OptionError) as error:
        LogMap(layout=wrong)  # type: ignore[arg-type]
    assert str(error.value) == (
        f"layout (--layout): found {wrong!r}, allowed: table, transposed, flat:N or flat-by-joint:N,"
        " with N numbers a sample"
    )


@pytest.mark.parametrize("layout", ["transposed", "flat:6", "flat-by-joint:6", "table"])
def test_a_map_keeps_the_layout(layout: str, read: Read, write: Write) -> None:
    q = motion()
    texts = {"transposed": q.T, "flat:6": q.reshape(-1, 1), "flat-by-joint:6": q.T.reshape(-1, 1), "table": q}
    log = read(written(texts[layout]), layout=layout)
    told = read_map(write(format_map(map_of(log)), "lab.toml"))
    assert told.layout == layout
    np.testing.assert_array_equal(read_log([write(written(texts[layout]))], told).q, q)


def test_a_map_of_an_ordinary_table_says_no_layout(read: Read) -> None:
    assert "layout" not in format_map(map_of(read(written(motion()))))


smooth = st.builds(
    motion, st.integers(60, 200), st.integers(2, 8), st.integers(0, 10**6), st.floats(25.0, 200.0)
)


@given(smooth)
def test_a_flat_array_is_known_by_its_smoothness(q: FloatArray) -> None:
    count = q.shape[1]
    assert flat_ways(q.ravel())[0] == ("flat", count)
    assert flat_ways(q.T.ravel())[0] == ("flat-by-joint", count)
    assert goes_along_rows(q.T)
    assert not goes_along_rows(q)


@given(smooth, st.sampled_from([1.0, 180.0 / np.pi]))
def test_angles_that_wrap_are_known_as_well(q: FloatArray, factor: float) -> None:
    """The joints turn on as they swing, and by +-180 deg go on from the other side."""
    drift = np.linspace(0.0, 4.0, len(q))[:, None]
    wrapped = (np.mod(q + drift + np.pi, 2 * np.pi) - np.pi) * factor
    assert flat_ways(wrapped.ravel())[0] == ("flat", q.shape[1])
    assert goes_along_rows(wrapped.T)


@given(st.integers(0, 10**6), st.integers(200, 2000), st.floats(1e-6, 10.0))
def test_noise_is_one_joint(seed: int, rows: int, size: float) -> None:
    x = np.random.default_rng(seed).normal(0, size, rows)
    assert flat_ways(x) == []
    assert not goes_along_rows(x[: rows // 10 * 10].reshape(10, -1))
