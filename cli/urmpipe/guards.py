"""What the public functions share: the robot they place, and what they refuse."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from urmpipe_models.arrays import FloatArray
from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, LogError, OptionError, RecordingError, shown
from urmpipe_models.inverse.checks import ROTATION_TOLERANCE
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.transform import Transform, from_offset, rpy_of
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import OutputKind, guarded_output, refuse_output
from urmpipe_pipeline.recording import is_recording
from urmpipe_pipeline.results import write_recording
from urmpipe_pipeline.simulations.simulation import Result
from urmpipe_pipeline.text import counted

Made = TypeVar("Made", bound=Result)

PathLike = str | Path
Robot = Chain | str | Path
Frame = Transform | Sequence[float] | FloatArray
"""A frame: x, y, z in [m] and, if it turns, rx, ry, rz in [rad]; or a 4 by 4 matrix; or a `Transform`."""

FRAME_ALLOWED = "x, y, z in m and rx, ry, rz in rad (3 or 6 numbers), a 4 x 4 matrix, or a Transform"

GIANT = 10
"""A tool that is more times as long as its arm was written in mm: 13 of them would be 13 m on a UR5e."""

WRITTEN_FIRST = 'arrays and tables are written first, such as table.to_csv("log.csv", index=False)'


def place_robot(
    robot: Robot | None,
    base: Frame | None = None,
    tool: Frame | None = None,
    *,
    base_link: str | None = None,
    tip_link: str | None = None,
) -> Chain | None:
    """Return the arm on its base and with its tool; None without a robot.

    Args:
        robot: Name, file (TOML, URDF) or chain of the arm.
        base: Where the arm stands in the world, in [m] and [rad]; as a matrix of shape (4, 4).
        tool: The tool centre point in the frame of the arm's tip, likewise.
        base_link: Link of a URDF where the arm begins.
        tip_link: Link of a URDF where it ends.

    Raises:
        RobotError: If the robot is unknown, or with everything that is wrong with its file.
        OptionError: If the arm is placed or cut, but there is none; if the tool dwarfs it.
    """
    frames = (frame_of("base", base), frame_of("tool", tool))
    if robot is not None:
        chain = (
            robot if isinstance(robot, Chain) else load_robot(robot, base_link=base_link, tip_link=tip_link)
        )
        _refuse_giant_tool(chain, frames[1])
        return chain.placed(*frames)
    if any(value is not None for value in (base, tool, base_link, tip_link)):
        raise OptionError(
            "found --base, --tool, --base-link or --tip without a robot; allowed: with --robot NAME|FILE"
        )
    return None


def _refuse_giant_tool(chain: Chain, tool: Transform | None) -> None:
    """Raise an `OptionError` for a tool many times as long as its arm: it was written in mm."""
    if tool is None:
        return
    from urmpipe_models.kinematics.singularity import characteristic_length

    reach, length = characteristic_length(chain), math.hypot(*tool.translation)
    if length > GIANT * reach:
        raise OptionError(
            f"--tool: found {length:g} m from the tip, {length / reach:.0f} times the length of {chain.name},"
            f" allowed: up to {GIANT} times it; a number without a unit is in m"
        )


def frame_of(name: str, given: Frame | None) -> Transform | None:
    """Return the frame that was given; None for none.

    Args:
        name: The keyword, for messages.
        given: x, y, z in [m] and, if it turns, rx, ry, rz in [rad]; a homogeneous matrix, shape (4, 4); or a
            transform.

    Raises:
        OptionError: If it is anything else, or its matrix does not turn.
    """
    if given is None or isinstance(given, Transform):
        return given
    found = f"found {shown(given)}"
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise OptionError(f"{name}: {found}, allowed: {FRAME_ALLOWED}") from None
    if values.shape not in ((3,), (6,), (4, 4)) or not np.isfinite(values).all():
        raise OptionError(f"{name}: {found} of shape {values.shape}, allowed: {FRAME_ALLOWED}, all finite")
    if values.ndim == 1:
        return from_offset(values.tolist())
    turn = values[:3, :3]
    proper = np.abs(turn @ turn.T - np.eye(3)).max() < ROTATION_TOLERANCE and np.linalg.det(turn) > 0.0
    if not proper or np.abs(values[3] - (0.0, 0.0, 0.0, 1.0)).max() > ROTATION_TOLERANCE:
        raise OptionError(
            f"{name}: found a matrix that is no rigid motion, allowed: a rotation and a translation"
        )
    rows, place = tuple(map(tuple, turn.tolist())), tuple(values[:3, 3].tolist())
    return Transform(cast("Any", rows), cast("Any", place))


def one_or_many(given: object) -> list[Any]:
    """Return what was given as a list: a path, a run or another result alone is a list of one."""
    alone = isinstance(given, (str, Path, Mapping)) or hasattr(given, "__array__")  # a table is no list
    return [given] if alone or not isinstance(given, Iterable) else list(given)


def paths(given: PathLike | Sequence[PathLike]) -> list[Path]:
    """Return files that were named as paths; one alone is a list of one."""
    return [Path(one) for one in one_or_many(given)]


def refuse_others(name: str, given: Sequence[object], kinds: tuple[type, ...], allowed: str) -> None:
    """Raise an `OptionError` with everything that is neither a path nor of some kinds.

    Args:
        name: The keyword, for messages.
        given: What was given.
        kinds: Classes that are allowed besides paths.
        allowed: What is allowed, in words.
    """
    found = [shown(one) for one in given if not isinstance(one, (str, Path, *kinds)) or one == ""]
    if found or not given:
        raise OptionError(f"{name}: found {', '.join(found) or 'none'}, allowed: {allowed}")


@contextmanager
def guarded_outputs(
    named: Mapping[OutputKind, PathLike | None], inputs: Sequence[Path]
) -> Iterator[dict[OutputKind, Path]]:
    """Give the parts to write of all outputs but the recording, which `recorded` writes: all or none of them.

    Args:
        named: The files that are asked for, by kind; None for one that is not.
        inputs: Files that are never replaced.

    Raises:
        OptionError: If two outputs have one name.
        OutputError: If one may not be written there.
    """
    targets = {kind: Path(path) for kind, path in named.items() if path is not None}
    _refuse_shared(targets)
    if "recording" in targets:
        refuse_output(targets["recording"], inputs, "recording")
    with ExitStack() as stack:
        yield {
            kind: stack.enter_context(guarded_output(path, inputs, kind))
            for kind, path in targets.items()
            if kind != "recording"
        }


def recorded(
    result: Made,
    output: PathLike | None,
    inputs: Sequence[Path],
    progress: Callable[[float], None] | None,
) -> Made:
    """Return a result with the recording that was written of it; as it is without an output.

    Args:
        result: What to record.
        output: The recording (.rrd) to write; None for none.
        inputs: Files that are never replaced.
        progress: Told the share of the recording that is written, 0..1.

    Raises:
        OutputError: If it may not be written there, or did not read back as it was written.
    """
    if output is None:
        return result
    return replace(result, recording=write_recording(result, Path(output), inputs, progress))


def _refuse_shared(targets: Mapping[OutputKind, Path]) -> None:
    """Raise an `OptionError` if two outputs have one name."""
    places: dict[Path, OutputKind] = {}
    for kind, path in targets.items():
        other = places.setdefault(path.resolve(), kind)
        if other != kind:
            raise OptionError(f"found {path} as {other} and as {kind}; allowed: a name for each")


def refuse_foreign(files: Sequence[Path]) -> None:
    """Raise a `RecordingError` with all files that are there and are no recordings."""
    foreign = [path for path in files if path.exists() and not is_recording(path)]
    if foreign:
        message = "found no recording of urmpipe, allowed: a .rrd that ingest, compare or simulate wrote"
        raise RecordingError(*(Finding(message, file=str(path)) for path in foreign))


def refuse_warnings(strict: bool, warnings: Sequence[LogWarning]) -> None:
    """Raise a `LogError` with all warnings if they are to be errors."""
    if strict and warnings:
        found = Finding(parameter="strict", found=counted(len(warnings), "warning"), allowed="none")
        raise LogError(found, *(one.as_finding() for one in warnings))


def offset_of(frame: Transform) -> tuple[float, ...]:
    """Return a frame as X, Y, Z in [m], with RX, RY, RZ in [rad] if it turns; nothing for none at all."""
    if frame == Transform():
        return ()
    turn = () if frame.rotation == Transform().rotation else rpy_of(frame.rotation)
    return tuple(float(value) + 0.0 for value in (*frame.translation, *turn))  # + 0.0: no -0.0 in the file
