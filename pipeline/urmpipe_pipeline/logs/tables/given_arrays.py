"""Arrays in Python as a table in memory: times, joint values and a recorded tool centre point."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from urmpipe_models.arm.chain import Chain
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.errors import Finding, OptionError, format_value, map_collecting_errors
from urmpipe_pipeline.logs.tables import numpy_columns
from urmpipe_pipeline.logs.tables.column_facts import ROLE, UNIT
from urmpipe_pipeline.logs.tables.frames import is_table
from urmpipe_pipeline.logs.tables.held import MemoryTable
from urmpipe_pipeline.logs.tables.own_tables import FORM, GIVEN

TIMES = "n times in s, or datetime64 or timedelta64"
JOINTS = "an array of shape (n, joints), in rad or m; a table is a log"
POSES = "an array of shape (n, 3), in m, (n, 7), with quaternions x, y, z, w behind, or (n, 4, 4)"

POSITION, QUATERNION = ("tcp_x", "tcp_y", "tcp_z"), ("tcp_qx", "tcp_qy", "tcp_qz", "tcp_qw")

Array = NDArray[Any]


def arrays_to_table(
    t: Any,
    q: Any,
    recorded_tcp: Any,
    names: Sequence[str],
    name: str,
    robot: Chain | None,
    units: Collection[str],
) -> MemoryTable:
    """Return arrays as a table in memory: t, the joints, and x, y, z and the orientation of the tool.

    Args:
        t: Times in [s], or as datetime64 or timedelta64, shape (n,); None without times.
        q: Joint values in [rad] or [m], shape (n, joints); None for a path.
        recorded_tcp: The recorded tool centre point in [m], shape (n, 3), with quaternions x, y, z, w behind,
            shape (n, 7), or as matrices, shape (n, 4, 4); None without one.
        names: Of the joints; by default q1, q2, ...
        name: What to call the log.
        robot: The arm: it tells which joints slide.
        units: Columns by name of which a unit is given apart; "" for every angle.

    Raises:
        OptionError: With each array of another shape, or if they do not have one length.
    """
    parts: tuple[Callable[[], Array | None], ...] = (
        lambda: _times(t),
        lambda: _joints(q),
        lambda: _poses(recorded_tcp),
    )
    times, values, poses = map_collecting_errors(lambda make: make(), parts)
    if values is None and poses is None:
        raise OptionError(Finding(parameter="q", found="none", allowed=JOINTS))
    _refuse_lengths({"t": times, "q": values, "recorded_tcp": poses})
    columns: list[tuple[str, str, str, Any]] = []
    if times is not None:
        columns.append(("t", "" if times.dtype.kind in "mM" else "s", "time 0", times))
    if values is not None:
        joints = _names(names, values.shape[1])
        columns += [
            (label, unit, f"joint {k}", values[:, k])
            for k, (label, unit) in enumerate(zip(joints, _units(joints, robot, units), strict=True))
        ]
    if poses is not None:
        wide = [(label, "m", f"position {k}") for k, label in enumerate(POSITION)]
        wide += [(label, "", f"rotation {k}") for k, label in enumerate(QUATERNION[: poses.shape[1] - 3])]
        columns += [(*told, poses[:, k]) for k, told in enumerate(wide)]
    arrays = [numpy_columns.column(array) for *_, array in columns]
    fields = [
        pa.field(label, array.type, metadata={UNIT: "" if label in units else unit, ROLE: role})
        for (label, unit, role, _), array in zip(columns, arrays, strict=True)
    ]
    return MemoryTable(
        name, pa.Table.from_arrays(arrays, schema=pa.schema(fields, {GIVEN: "", FORM: "quat_xyzw"}))
    )


def _times(t: Any) -> Array | None:
    """Return times as an array of shape (n,)."""
    if t is None:
        return None
    try:
        array = np.asarray(np.ma.filled(t, np.nan) if isinstance(t, np.ma.MaskedArray) else t)
        array = array if array.dtype.kind != "O" else array.astype("datetime64[ns]")
        array = array if array.dtype.kind in "mMiuc" else array.astype(np.float64)
    except (TypeError, ValueError):
        raise _unfit("t", t, TIMES) from None
    if array.ndim != 1 or not len(array) or array.dtype.kind == "c":
        raise _unfit("t", t, TIMES)
    return array


def _joints(q: Any) -> FloatArray | None:
    """Return joint values as an array of shape (n, joints)."""
    if q is None:
        return None
    array = _numbers("q", q, JOINTS)
    if array.ndim != 2 or not array.size:
        raise _unfit("q", q, JOINTS)
    return array


def _poses(given: Any) -> FloatArray | None:
    """Return positions, and quaternions where there are orientations, of shape (n, 3) or (n, 7)."""
    if given is None:
        return None
    array = _numbers("recorded_tcp", given, POSES)
    if array.ndim == 2 and len(array) and array.shape[1] in (3, 7):
        return array
    if array.ndim != 3 or not len(array) or array.shape[1:] != (4, 4):
        raise _unfit("recorded_tcp", given, POSES)
    from urmpipe_models.math3d import to_quaternions

    turned = to_quaternions(array[:, :3, :3].reshape(-1, 9), "matrix")
    return np.column_stack([array[:, :3, 3], turned])


def _numbers(parameter: str, given: Any, allowed: str) -> FloatArray:
    """Return numbers as an array, NaN where they are masked."""
    try:
        array = np.ma.asanyarray(given)
        if is_table(given) or array.dtype.kind == "c":
            raise _unfit(parameter, given, allowed)
        return np.asarray(np.ma.filled(array.astype(np.float64), np.nan), dtype=np.float64)
    except (TypeError, ValueError):
        raise _unfit(parameter, given, allowed) from None


def _unfit(parameter: str, given: Any, allowed: str) -> OptionError:
    """Return the error about what is no array of a shape."""
    shape = getattr(given, "shape", None)
    text = format_value(given)
    if isinstance(given, np.ndarray):
        text = "a complex array" if given.dtype.kind == "c" else "an array"
    if shape is not None:
        text += f" of shape {tuple(shape)}"
    return OptionError(Finding(parameter=parameter, found=text, allowed=allowed))


def _refuse_lengths(arrays: dict[str, Array | None]) -> None:
    """Raise an `OptionError` if some arrays do not have one length."""
    lengths = {name: len(array) for name, array in arrays.items() if array is not None}
    if len(set(lengths.values())) > 1:
        found = ", ".join(f"{rows} rows of {name}" for name, rows in lengths.items())
        raise OptionError(f"found {found}, allowed: as many of each")


def _names(names: Sequence[str], joints: int) -> Sequence[str]:
    """Return the names of the joints, by default q1, q2, ..."""
    if not names:
        return [f"q{k + 1}" for k in range(joints)]
    if len(names) != joints or len(set(names)) < joints:
        allowed = f"a name for each of the {joints} joints, each once"
        raise OptionError(Finding(parameter="names", found=", ".join(names), allowed=allowed))
    return names


def _units(joints: Sequence[str], robot: Chain | None, given: Collection[str]) -> Iterator[str]:
    """Yield the unit of each joint: m where it slides; none of an angle where that is given apart."""
    moving = robot.moving if robot is not None and len(robot.moving) == len(joints) else [None] * len(joints)
    for joint in moving:
        slides = joint is not None and joint.kind != "revolute"
        yield "m" if slides else "" if "" in given else "rad"
