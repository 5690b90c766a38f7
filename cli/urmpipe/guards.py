"""What the public functions share: the robot they place, and what they refuse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from urmpipe_models.chains.chain import Chain
from urmpipe_models.errors import Finding, LogError, OptionError, RecordingError
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.transform import Transform, rpy_of
from urmpipe_pipeline.joint_log import LogWarning
from urmpipe_pipeline.outputs import OutputKind
from urmpipe_pipeline.recording import is_recording

PathLike = str | Path
Robot = Chain | str | Path


def place_robot(
    robot: Robot | None,
    base: Transform | None = None,
    tool: Transform | None = None,
    *,
    base_link: str | None = None,
    tip_link: str | None = None,
) -> Chain | None:
    """Return the arm on its base and with its tool; None without a robot.

    Args:
        robot: Name, file (TOML, URDF) or chain of the arm.
        base: Where the arm stands in the world.
        tool: The tool centre point in the frame of the arm's tip.
        base_link: Link of a URDF where the arm begins.
        tip_link: Link of a URDF where it ends.

    Raises:
        RobotError: If the robot is unknown, or with everything that is wrong with its file.
        OptionError: If the arm is placed or cut, but there is none.
    """
    if robot is not None:
        chain = (
            robot if isinstance(robot, Chain) else load_robot(robot, base_link=base_link, tip_link=tip_link)
        )
        return chain.placed(base, tool)
    if any(value is not None for value in (base, tool, base_link, tip_link)):
        raise OptionError(
            "found --base, --tool, --base-link or --tip without a robot; allowed: with --robot NAME|FILE"
        )
    return None


def refuse_shared(targets: Mapping[OutputKind, Path]) -> None:
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
        raise LogError(*(Finding(f"{w.kind}: {w.message} (--strict)", row=w.row) for w in warnings))


def offset_of(frame: Transform) -> tuple[float, ...]:
    """Return a frame as X, Y, Z in [m], with RX, RY, RZ in [rad] if it turns; nothing for none at all."""
    if frame == Transform():
        return ()
    turn = () if frame.rotation == Transform().rotation else rpy_of(frame.rotation)
    return tuple(float(value) + 0.0 for value in (*frame.translation, *turn))  # + 0.0: no -0.0 in the file
