"""Clocks as strangers write them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from motion import Motion, moves, of_robot, sines, times
from stranger import (
    COMMA,
    CSV,
    FIXED,
    GERMAN,
    PANDAS,
    SAVETXT,
    SEMICOLON,
    SIX,
    TABS,
    Clock,
    Column,
    Stranger,
    Writer,
    strangers,
    table,
    unit_clock,
)
from urmpipe_models.elementwise import FloatArray

EPOCH = 1_679_323_262.0
NAMED = {"t": "time", "q": "q{}", "qd": "dq{}", "tau": "tau{}"}


def paused(rows: int, seed: int) -> FloatArray:
    """Return times of which two steps are long: a recorder that was held."""
    t = times(rows, 0.02, 0.3, seed)
    t[rows // 3 :] += 2.5
    t[rows // 2 :] += 0.7
    return np.round(t, 6)


@strangers
def uneven_clock_without_header() -> Iterator[Stranger]:
    yield table(sines(times(180, 0.03, 0.4, 1), 6, 1), "t q")
    yield table(sines(times(400, 0.01, 0.9, 2), 7, 2, rest=0.6), "t q", writer=SAVETXT, unit="deg")
    yield table(of_robot("ur5e", times(120, 0.05, 0.6, 3), 3), "t q", writer=FIXED, robot="ur5e")
    yield table(moves(paused(300, 4), 6, 4), "t q", writer=SEMICOLON)
    yield table(sines(times(90, 0.06, 0.5, 5), 5, 5), "t q", writer=TABS, clock=unit_clock(1e-3, whole=True))


@strangers
def clock_behind_other_columns() -> Iterator[Stranger]:
    yield table(sines(times(150, 0.04), 6, 11), "q t")
    yield table(sines(times(150, 0.04, 0.5, 12), 6, 12), "q t", writer=SEMICOLON, arm=6)
    yield table(moves(times(260), 7, 13), "q t tau", NAMED, writer=TABS)
    yield table(
        sines(times(200, 0.03), 6, 14), "index q t", {"index": "frame", "q": "joint_{}", "t": "elapsed"},
        writer=PANDAS,
    )  # fmt: skip
    yield table(
        sines(times(200, 0.03, 0.2, 15), 6, 15), "q t", clock=unit_clock(start=EPOCH), writer=SAVETXT,
        unit="deg",
    )  # fmt: skip


@strangers
def clock_beside_a_counter() -> Iterator[Stranger]:
    yield table(sines(times(150, 0.04, 0.3, 17), 6, 17), "index t q")
    yield table(sines(times(150, 0.04), 7, 18), "t index q", writer=SAVETXT)
    yield table(
        sines(times(200, 0.03), 6, 19), "index t q", writer=SEMICOLON, clock=unit_clock(1e-3, EPOCH, True),
        arm=6,
    )  # fmt: skip
    named = {"index": "Nr", "t": "Zeit_ms", "q": "Achse{}"}
    clock = unit_clock(1e-3, whole=True)
    yield table(moves(times(200, 0.03), 6, 20), "index t q", named, writer=GERMAN, clock=clock)


@strangers
def joint_that_only_increases() -> Iterator[Stranger]:
    yield table(sines(times(150, 0.04), 6, 21).rising(0), "q", arm=6)
    yield table(sines(times(150, 0.04), 6, 22).rising(0), "t q")
    yield table(sines(times(150, 0.04, 0.5, 23), 6, 23).rising(2), "t q", writer=SEMICOLON)
    yield table(sines(times(150, 0.04), 6, 24).rising(1), "t q", NAMED, writer=TABS, unit="deg")
    yield table(sines(times(150, 0.04), 7, 25).rising(0, 4.0), "q", writer=SAVETXT)
    yield table(sines(times(150, 0.04), 6, 26).rising(3), "q", writer=FIXED)
    yield table(sines(times(150, 0.04), 6, 27).rising(0), "q", NAMED)


def digits(form: str, part: int = 0, start: str = "2020-07-14T16:39:04") -> Clock:
    """Return a clock of dates in digits alone, with so many digits of the second's part."""

    def clock(t: FloatArray) -> tuple[list[Column], float, FloatArray | None]:
        ns = np.datetime64(start, "ns") + np.rint(t * 1e9).astype("timedelta64[ns]")
        texts = [str(one) for one in ns]
        whole = [one[:19].replace("-", "").replace("T", "").replace(":", "") for one in texts]
        parts = [one[20 : 20 + part] for one in texts]
        return [[form.format(w, p) for w, p in zip(whole, parts, strict=True)]], 10.0**-part, None

    return clock


def float_digits(t: FloatArray) -> tuple[list[Column], float, FloatArray | None]:
    """Return dates in digits as numpy writes what it read as numbers."""
    (texts,), off, _ = digits("{}")(t)
    return [np.array(texts, dtype=np.float64)], off, None


def whole_seconds(rows: int, seed: int) -> FloatArray:
    """Return times on whole seconds, 1 to 4 apart."""
    steps = np.random.default_rng(seed).integers(1, 5, rows - 1)
    return np.concatenate(([0.0], np.cumsum(steps))).astype(float)


@strangers
def date_of_digits() -> Iterator[Stranger]:
    own = {"q": "joint_{}", "t": "Timestamp"}
    yield table(sines(whole_seconds(80, 31), 6, 31), "t q", own, writer=SEMICOLON, clock=digits("{}"))
    yield table(sines(whole_seconds(80, 32), 6, 32), "t q", clock=digits("{}"))
    yield table(sines(times(200, 0.05), 6, 33), "t q", own, clock=digits("{}.{}", 3), unit="deg")
    yield table(sines(times(200, 0.05), 6, 34), "t q", own, writer=TABS, clock=digits("{}{}", 3))
    yield table(sines(np.arange(90.0), 7, 35), "t q tau", NAMED, writer=PANDAS, clock=digits("{}"))
    yield table(sines(whole_seconds(80, 36), 6, 36), "t q", writer=SAVETXT, clock=float_digits)


def two_columns(unit: float, start: float, step: float = 0.0) -> Clock:
    """Return a clock of seconds and of what is left in a unit in [s]; it stands for a step of so long.

    Where in its step a row was nobody knows, nor where the first was: each may be off by a step.
    """

    def clock(t: FloatArray) -> tuple[list[Column], float, FloatArray | None]:
        ns = np.rint((t + start % 1) * 1e9).astype(np.int64)
        if step:
            tick = round(step * 1e9)
            ns = ns // tick * tick
        seconds = ns // 10**9
        return [seconds + int(start), (ns - seconds * 10**9) // round(unit * 1e9)], max(unit, 2 * step), None

    return clock


@strangers
def clock_in_two_columns() -> Iterator[Stranger]:
    def named(*names: str) -> dict[str, str | Sequence[str]]:
        return {**NAMED, "t": names}

    ns, us = two_columns(1e-9, EPOCH + 0.93), two_columns(1e-6, 41.7)
    yield table(sines(times(150, 0.04, 0.3, 41), 6, 41), "t q", named("sec", "nanosec"), clock=ns)
    yield table(
        sines(times(150, 0.04), 6, 42), "t q qd", named("seconds", "nseconds"),
        clock=two_columns(1e-9, 0.0), writer=PANDAS,
    )  # fmt: skip
    yield table(
        sines(times(150, 0.04), 7, 43), "t q", named("tv_sec", "tv_usec"), clock=us, writer=SEMICOLON,
        unit="deg",
    )  # fmt: skip
    yield table(
        sines(times(150, 0.04), 6, 44), "t q", named("header.stamp.secs", "header.stamp.nsecs"), clock=ns
    )
    yield table(sines(times(150, 0.04, 0.3, 45), 6, 45), "t q", clock=ns)
    yield table(sines(times(150, 0.04), 6, 46), "t q", clock=two_columns(1e-9, 0.0), writer=TABS, arm=6)
    yield table(sines(times(300, 0.01), 6, 47), "t q", clock=us, writer=SEMICOLON)
    # stepped: a clock of the kernel that moves on every 50 ms, the rows come every 10 ms
    stepped = two_columns(1e-9, EPOCH, 0.05)
    yield table(sines(times(400, 0.01), 6, 48), "t q", named("sec", "nsec"), clock=stepped)
    yield table(sines(times(400, 0.01), 6, 49), "t q", clock=stepped, writer=TABS)
    yield table(sines(times(300, 0.02), 7, 50), "t q", clock=two_columns(1e-9, 0.0, 0.1))


@strangers
def epoch_by_its_size() -> Iterator[Stranger]:
    units = {"s": (1.0, False), "ms": (1e-3, True), "us": (1e-6, True), "ns": (1e-9, True)}
    writers = [CSV, TABS, SEMICOLON, PANDAS]
    for k, ((unit, whole), writer) in enumerate(zip(units.values(), writers, strict=True)):
        moved = sines(times(150, 0.04, 0.3, 60 + k), 6 + k % 2, 60 + k)
        clock = unit_clock(unit, EPOCH, whole)
        yield table(moved, "t q", {**NAMED, "t": "stamp"}, writer=writer, clock=clock)
        yield table(moved, "t q", writer=writer, clock=clock)
        yield table(moved, "q t", {**NAMED, "t": "timestamp"}, writer=writer, clock=clock, unit="deg")


def chunked(unit: float, start: float, sizes: tuple[int, int], seed: int = 0) -> Clock:
    """Return a clock that gives all rows of a received chunk the time of its last row.

    Which row has the time is not written: rows may be off by a chunk, and the first of all by one more.
    """

    def clock(t: FloatArray) -> tuple[list[Column], float, FloatArray | None]:
        rng = np.random.default_rng(seed)
        bounds = np.cumsum(rng.integers(sizes[0], sizes[1] + 1, len(t)))
        bounds = np.append(bounds[bounds < len(t)], len(t))
        last = np.searchsorted(bounds, np.arange(len(t)), side="right")
        stamped = t[bounds[last] - 1]
        longest = float(np.max(np.diff(np.append(-t[1], t[bounds - 1]))))
        columns, off, _ = unit_clock(unit, start, whole=unit < 1)(stamped)
        return columns, off + 2 * longest, None

    return clock


@strangers
def stamp_for_a_chunk_of_rows() -> Iterator[Stranger]:
    yield table(sines(times(300, 0.02), 6, 81), "t q", NAMED, clock=chunked(1.0, EPOCH, (10, 10)))
    yield table(sines(times(300, 0.02), 6, 82), "t q", clock=chunked(1.0, 0.0, (5, 12)))
    yield table(
        sines(times(300, 0.02), 7, 83), "t q", NAMED, clock=chunked(1e-3, EPOCH, (4, 8)), writer=SEMICOLON
    )
    yield table(
        sines(times(300, 0.02), 6, 84), "t q tau", NAMED, clock=chunked(1e-9, EPOCH, (20, 20)), writer=TABS
    )
    yield table(
        moves(times(400, 0.01), 6, 85), "t q", clock=chunked(1e-3, 0.0, (8, 8)), writer=CSV, unit="deg"
    )


def durations(unit: float = 1.0, first: float = 0.0) -> Clock:
    """Return a column of how long each row took, in a unit in [s]."""

    def clock(t: FloatArray) -> tuple[list[Column], float, FloatArray | None]:
        steps = np.diff(t, prepend=t[0] - first)
        # A row may be counted by the step before it or behind it: as far apart as steps differ.
        return [np.round(steps / unit, 6)], 1e-6 * len(t) * unit + float(np.ptp(np.diff(t))) + first, None

    return clock


@strangers
def duration_a_row() -> Iterator[Stranger]:
    def named(name: str) -> dict[str, str | Sequence[str]]:
        return {**NAMED, "t": name}

    yield table(sines(times(150, 0.04, 0.3, 91), 6, 91), "t q", named("dt"), clock=durations())
    yield table(
        sines(times(150, 0.04, 0.3, 92), 6, 92), "q t", named("duration"), clock=durations(first=0.04),
        writer=TABS,
    )  # fmt: skip
    yield table(
        sines(times(150, 0.04, 0.3, 93), 7, 93), "t q", named("dt [ms]"), clock=durations(1e-3, 0.04),
        writer=SEMICOLON,
    )  # fmt: skip
    yield table(
        sines(times(150, 0.04), 6, 94), "t q qd", named("duration"), clock=durations(first=0.04),
        writer=PANDAS,
    )  # fmt: skip


def beside(motion: Motion, name: str, column: str, text: str, writer: Writer = CSV) -> Stranger:
    """Return joints in one file, and their times in a column of another that is named."""
    named = {"q": "q{}"}
    return table(
        motion, "q", named, writer=writer, t=motion.t, t_within=1e-6, more={name: text.encode()},
        beside=(name,), options={"time": f"{{folder}}/{name}:{column}"},
    )  # fmt: skip


@strangers
def clock_of_another_file() -> Iterator[Stranger]:
    m = sines(times(120, 0.05, 0.3, 101), 6, 101)
    rows = list(enumerate(m.t))
    yield beside(m, "times.csv", "stamp", "\n".join(["frame,stamp", *(f"{k},{t:.6f}" for k, t in rows), ""]))
    yield beside(m, "clock.txt", "2", "".join(f"{k} {t:.6f}\n" for k, t in rows), writer=TABS)
    epoch = [f"{k};{1_600_000_000_000 + round(1e3 * t)};{20 + k % 3}" for k, t in rows]
    text = "\n".join(["nr;time_ms;load", *epoch, ""])
    whole = sines(np.round(m.t, 3), 6, 101)
    yield beside(whole, "load.csv", "time_ms", text, writer=SEMICOLON)
    yield beside(m, "t.csv", "1", "".join(f"{t:.6f}\n" for _, t in rows), writer=COMMA)


@strangers
def period_of_rates() -> Iterator[Stranger]:
    """Rates beside the joints tell how long a row is where nothing else does."""
    named = {"q": "q{}", "qd": "qd{}"}
    yield table(sines(times(300, 0.02), 6, 111), "q qd", named)
    yield table(sines(times(300, 0.008), 6, 112), "q qd", writer=SAVETXT)
    yield table(moves(times(400, 0.01), 7, 113), "q qd", writer=SEMICOLON, arm=7)
    yield table(sines(times(200, 0.04), 6, 114), "q qd", named, writer=GERMAN, unit="deg")
    yield table(sines(times(200, 0.03), 6, 115), "q qd tau", writer=SIX)
