"""What stands in space of a test after ISO 9283: command, mean path and tube, clouds of poses, all cycles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from urmpipe_pipeline.comparison.alignment import placed
from urmpipe_pipeline.comparison.comparison import Comparison
from urmpipe_pipeline.comparison.deviation import Deviation
from urmpipe_pipeline.iso9283.figures import (
    CYCLES_COLOUR,
    TUBE_COLOUR,
    command_path,
    enlarged,
    mean_of,
    tube_of,
)
from urmpipe_pipeline.iso9283.result import AttainedPoses, IsoTest
from urmpipe_pipeline.presentation.palette import DEVIATION_COLOUR, REFERENCE_COLOUR
from urmpipe_pipeline.presentation.scene import Arm, Balls, Path, Scene
from urmpipe_pipeline.runs.figures import times_of


def iso_scene(result: Comparison, test: IsoTest) -> Scene:
    """Return the command, what was attained of it, enlarged, and the cycles that move on one clock.

    The deviations of poses and path are enlarged by the same factor.
    """
    factor = enlarged(test.path, test.poses)
    shown = next((one for one in result.runs if one.run.tcp is not None), None)
    arms = () if shown is None else tuple(_arm(shown))
    paths = [*(_cycle(one) for one in result.runs if one.run.timed)]
    if test.path is not None:
        tube = tube_of(test.path, factor)
        paths = [
            command_path(test.path),
            *paths,
            *([] if tube is None else [tube]),
            mean_of(test.path, factor),
        ]
    if test.poses is not None:
        paths += _clouds(test.poses, factor)
    of_arm = [f"arm of {shown.name}"] if shown is not None and arms else []
    title = ", ".join((*of_arm, *_titled(test)))
    balls = None if test.poses is None else _balls(test, test.poses, factor)
    return Scene(
        f"{title[0].upper()}{title[1:]} [m], deviations drawn x{factor}", arms, tuple(paths), balls=balls
    )


def _titled(test: IsoTest) -> list[str]:
    """Return what is shown of a test."""
    of_path = ["mean path coloured by AT", "tube of RT"] if test.path is not None else []
    of_poses = ["attained poses", "balls of RP"] if test.poses is not None else []
    return of_path + of_poses


def _arm(one: Deviation) -> Iterator[Arm]:
    """Yield the arm of a cycle, on its own clock from its start on; nothing without kinematics."""
    if one.run.robot is not None:
        t_ns = times_of(one.run)
        since = None if t_ns is None else t_ns[:] - t_ns[0]
        yield Arm(placed(one.run.robot, one.alignment), one.run.q, since, CYCLES_COLOUR)


def _cycle(one: Deviation) -> Path:
    """Return the point that moves as a cycle does, on its own clock from its start on."""
    since = one.t_ns[:] - one.run.t_ns[0]
    return Path("cycles", one.actual, since, CYCLES_COLOUR, sample=one.sample, line=False)


def _clouds(poses: AttainedPoses, factor: int) -> Iterator[Path]:
    """Yield the commanded poses, and where they were attained, enlarged about them."""
    cloud = poses.command + factor * (poses.attained - poses.command)
    yield Path("commanded poses", poses.command, None, REFERENCE_COLOUR, asked=True, line=False)
    yield Path(f"attained x{factor}", cloud.reshape(-1, 3), None, DEVIATION_COLOUR, line=False)


def _balls(test: IsoTest, poses: AttainedPoses, factor: int) -> Balls | None:
    """Return balls of the radius RP about the barycentres; None of one cycle."""
    found = {one.at: one.value for one in test.criteria if one.name == "RP"}
    radius = [found.get(f"pose {k + 1}") for k in range(len(poses.command))]
    known = np.array([one is not None for one in radius], dtype=np.bool_)
    if not known.any():
        return None
    centre = poses.command + factor * (poses.attained.mean(axis=0) - poses.command)
    sizes = factor * np.array([one for one in radius if one is not None])
    return Balls(f"RP x{factor}", centre[known], sizes, TUBE_COLOUR)
