"""Numbers that do not stand as a row a sample, and files that are no plain text tables."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from asking import Truth
from motion import Motion, moves, of_robot, sines, times
from stranger import DEG, Stranger, strangers, told_by_rates
from urmpipe_models.elementwise import FloatArray


def stranger(
    motion: Motion, content: bytes | str, name: str = "log.csv", decimals: int | None = None,
    timed: bool = True, unit: float = 1.0, truth: dict[str, Any] | None = None, **own: Any,
) -> Stranger:  # fmt: skip
    """Return a file of our own writing that holds a motion."""
    within = unit * (0.5 * 10.0**-decimals if decimals else 0.0) + 1e-9
    held = {
        "q": motion.q,
        "t": motion.t if timed else None,
        "q_within": within,
        "t_within": within,
        "qd": motion.qd,
    }
    content = content.encode() if isinstance(content, str) else content
    return Stranger({name: content}, Truth(**{**held, **(truth or {})}), **own)


def savetxt(values: FloatArray, **options: Any) -> bytes:
    out = io.BytesIO()
    np.savetxt(out, values, **options)
    return out.getvalue()


@strangers
def joints_as_rows() -> Iterator[Stranger]:
    """A row a joint, a column a sample."""
    m, seven = sines(times(150, 0.04), 6, 401), sines(times(300, 0.02), 7, 402)
    yield stranger(m, savetxt(m.q.T), timed=False)
    yield stranger(seven, savetxt(seven.q.T, delimiter=",", fmt="%.8f"), decimals=8, timed=False, arm=7)
    timed = np.vstack((m.t, m.q.T))
    yield stranger(m, savetxt(timed, delimiter=","))
    labels = ["t", *(f"q{k}" for k in range(1, 7))]
    rows = [",".join([label, *(f"{v:.6f}" for v in row)]) for label, row in zip(labels, timed, strict=True)]
    yield stranger(m, "\n".join([*rows, ""]), decimals=6)
    rows = [";".join([f"J{k + 1}", *(f"{v:.5f}" for v in row)]) for k, row in enumerate(np.degrees(m.q).T)]
    yield stranger(m, "\n".join([*rows, ""]), decimals=5, unit=DEG, timed=False)
    both = savetxt(np.vstack((m.q.T, m.qd.T)), delimiter=",")
    yield stranger(m, both, timed=False, truth={"period": told_by_rates(m.t)})
    moved = moves(times(200, 0.03), 6, 403)
    yield stranger(moved, savetxt(np.degrees(moved.q).T, delimiter="\t"), timed=False)


@strangers
def one_number_a_line() -> Iterator[Stranger]:
    """An array flattened row by row, or joint by joint."""
    m, seven = sines(times(150, 0.04), 6, 411), sines(times(200, 0.03), 7, 412)
    yield stranger(m, savetxt(m.q.ravel()), timed=False, arm=6)
    yield stranger(m, savetxt(m.q.ravel()), timed=False)
    yield stranger(seven, savetxt(seven.q.T.ravel(), fmt="%.8f"), decimals=8, timed=False)
    yield stranger(m, savetxt(np.degrees(m.q).ravel()), timed=False)
    yield stranger(m, b"q\n" + savetxt(m.q.ravel(), fmt="%.9f"), decimals=9, timed=False)
    moved = moves(times(180, 0.03), 6, 413)
    yield stranger(moved, savetxt(moved.q.T.ravel()), timed=False, arm=6)
    text = " ".join(f"{v:.6f}" for v in m.q.ravel())
    yield stranger(m, text + "\n", "q.txt", decimals=6, timed=False, arm=6)


def plc(names: Sequence[str], values: FloatArray, form: str, head: Sequence[str] = ()) -> str:
    """Return arrays as IEC 61131-3 declares them, one a line."""
    kinds = [form.format(name=name, n=len(column)) for name, column in zip(names, values.T, strict=True)]
    cells = [", ".join(f"{v:.6f}" for v in column) for column in values.T]
    return "\n".join([*head, *(f"{kind} := [{row}];" for kind, row in zip(kinds, cells, strict=True)), ""])


@strangers
def arrays_of_a_plc() -> Iterator[Stranger]:
    m = sines(times(300, 0.02), 6, 421)
    array = "{name} : ARRAY[1..{n}] OF REAL"
    head = ["n : UDINT := 300;", "t_end : LREAL := 5.980000;", "t_sample : LREAL := 0.020000;"]
    phi, names = np.degrees(m.q), [f"phi_{k}" for k in range(1, 7)]
    yield stranger(m, plc(names, phi, array, head), "target.txt", 6, unit=DEG)
    yield stranger(
        m, plc([f"q{k}" for k in range(1, 7)], m.q, "{name} : ARRAY[0..299] OF LREAL"), "q.txt", 6,
        timed=False,
    )  # fmt: skip
    timed = np.column_stack((m.t, m.q))
    text = plc(["time", *(f"rAxis{k}" for k in range(1, 7))], timed, array)
    yield stranger(m, f"VAR\n{text}END_VAR\n", "vars.st", 6)
    both = np.column_stack((m.q, m.qd))
    names = [f"{kind}_{k}" for kind in ("phi", "dphi") for k in range(1, 7)]
    yield stranger(m, plc(names, both, array, head), "both.txt", 6)


@strangers
def targets_of_rapid() -> Iterator[Stranger]:
    m = moves(times(120, 0.05), 6, 431)
    targets = [
        "[[" + ",".join(f"{v:.4f}" for v in row) + "],[9E9,9E9,9E9,9E9,9E9,9E9]]" for row in np.degrees(m.q)
    ]
    own: dict[str, Any] = {"decimals": 4, "unit": DEG, "timed": False}
    array = "VAR jointtarget jt{120} := [" + ",\n".join(targets) + "];\n"
    yield stranger(m, array, "path.mod", **own)
    lines = [f"  CONST jointtarget j{k + 1} := {target};" for k, target in enumerate(targets)]
    yield stranger(m, "\n".join(["MODULE Path", *lines, "ENDMODULE", ""]), "path.mod", **own)
    yield stranger(m, "\n".join([*targets, ""]), "targets.txt", **own)


@strangers
def parquet() -> Iterator[Stranger]:
    def content(columns: dict[str, Any]) -> bytes:
        out = io.BytesIO()
        pq.write_table(pa.table(columns), out)
        return out.getvalue()

    m, seven = sines(times(300, 0.02, 0.2, 441), 6, 441), sines(times(200, 0.03), 7, 442)
    q = {f"q{k + 1}": m.q[:, k] for k in range(6)}
    yield stranger(m, content({"time": m.t, **q}), "log.parquet")
    epoch = np.datetime64("2024-03-05T10:20:30") + np.rint(m.t * 1e9).astype("timedelta64[ns]")
    yield stranger(
        m,
        content({"stamp": epoch, **{f"joint_{k}_deg": np.degrees(one) for k, one in enumerate(m.q.T)}}),
        "log.parquet",
    )
    indexed = pd.DataFrame(m.q, columns=[f"joint_{k}" for k in range(6)], index=pd.Index(epoch, name="time"))
    indexed.to_parquet(out := io.BytesIO())
    yield stranger(m, out.getvalue(), "indexed.parquet")
    out = io.BytesIO()
    frame = pd.DataFrame(np.column_stack((seven.t, seven.q)), columns=["t", *(f"A{k}" for k in range(1, 8))])
    frame.to_parquet(out)
    yield stranger(seven, out.getvalue(), "frame.parquet")
    state = pa.array(m.q.astype(np.float32).tolist(), pa.list_(pa.float32()))
    ten = {"observation.state": state, "timestamp": m.t.astype(np.float32), "frame_index": np.arange(300)}
    # numbers of 32 bits: 2^-24 of a value below 4 rad, and of a time below 8 s
    yield stranger(m, content(ten), "episode_000000.parquet", truth={"q_within": 3e-7, "t_within": 6e-7})


@strangers
def arrays_of_numpy() -> Iterator[Stranger]:
    def content(*unnamed: Any, **arrays: Any) -> bytes:
        out = io.BytesIO()
        np.savez(out, *unnamed, **arrays)
        return out.getvalue()

    def single(array: FloatArray) -> bytes:
        out = io.BytesIO()
        np.save(out, array)
        return out.getvalue()

    m = sines(times(300, 0.02, 0.2, 451), 6, 451)
    even = sines(times(200, 0.03), 7, 452)
    yield stranger(m, content(t=m.t, q=m.q), "log.npz")
    yield stranger(m, content(q=m.q, qd=m.qd, time=m.t, tau=m.tau), "log.npz")
    yield stranger(
        even, content(positions=even.q, timestamps=even.t + 1.6e9), "run.npz", truth={"t_within": 1e-6}
    )
    yield stranger(m, content(m.t, m.q), "arrays.npz")
    yield stranger(even, single(np.column_stack((even.t, even.q))), "log.npy")
    yield stranger(even, single(even.q), "q.npy", timed=False)
    robot = of_robot("ur5e", times(100, 0.05), 453)
    yield stranger(robot, content(t=robot.t, q=robot.q, tcp=robot.tip), "log.npz", robot="ur5e")
