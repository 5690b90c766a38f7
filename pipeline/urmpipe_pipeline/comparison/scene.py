"""What stands in space of a comparison: the worst log's arm, all paths, where it was decided."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.elementwise import FloatArray
from urmpipe_models.kinematics.forward import points_over_log
from urmpipe_pipeline.comparison.align import apply_alignment
from urmpipe_pipeline.comparison.comparison import Comparison, tolerance_sort_key
from urmpipe_pipeline.comparison.deviation import AXES, Deviation
from urmpipe_pipeline.comparison.mended import cause_marks, mended_path
from urmpipe_pipeline.comparison.wording import amount_words, when
from urmpipe_pipeline.presentation.palette import DEVIATION_COLOUR, REFERENCE_COLOUR, run_colour
from urmpipe_pipeline.presentation.parts import spot_at
from urmpipe_pipeline.presentation.scene import Arm, Arrows, Path, Scene, Spot
from urmpipe_pipeline.runs.figures import times_of
from urmpipe_pipeline.trajectories import Trajectory

FACTORS = (50, 20, 10, 5, 2)
"""How many times a deviation may be drawn, the usual one first."""

LEAST_SEEN = 0.005
"""An enlarged deviation below this share of the scene's radius lies within the width of the lines."""

MOST_ARROWS = 20_000
"""Poses whose deviation is drawn as an arrow."""

POSES = 1000
"""Poses from which the extent of the scene is told."""


def comparison_scene(result: Comparison) -> Scene:
    """Return the arm of the worst log, the reference, all logs, and the worst log's deviation enlarged."""
    shown = shown_log(result)
    index, several = result.runs.index(shown), len(result.runs) > 1
    arms = tuple(_arm(shown, run_colour(index)))
    paths = [
        *_reference(result.reference, shown),
        *(_log(one, run_colour(i)) for i, one in enumerate(result.runs)),
    ]
    radius, spots = _radius(arms, paths), (_decided(shown, several=several),)
    whose = f"Arm of {shown.name}" if arms and several else "Arm"
    if not shown.run.timed:
        arrows = deviation_arrows(shown, radius)
        title = f"{whose} and poses [m], {arrows.name}, from light to dark the larger"
        return Scene(title, arms, tuple(paths), spots, arrows=arrows)
    paths += mended_path(shown)
    if larger := _enlarged(shown, radius):
        paths.append(larger)
    said = f", in crimson the {larger.name}" if larger else ""
    return Scene(f"{whose} and paths [m]{said}", arms, tuple(paths), spots)


def deviation_arrows(one: Deviation, radius: float) -> Arrows:
    """Return the deviation of each pose, enlarged as far as a scene of a radius in [m] allows.

    Of very many poses those that deviate most are drawn.
    """
    factor = drawn_larger(one.statistics["norm"].max, radius) or 1
    size = np.asarray(one.delta[:, 3])
    drawn = np.sort(np.argsort(-size, kind="stable")[:MOST_ARROWS])
    start = np.asarray(one.reference)[drawn]
    end = start + factor * (np.asarray(one.actual)[drawn] - start)
    sample = np.asarray(one.sample)[drawn]
    return Arrows(f"deviation drawn x{factor}", start, end, size[drawn], sample, limit=allowed_norm(one))


def allowed_norm(one: Deviation) -> float | None:
    """Return what is allowed of the norm in [m]: its tolerance, else the least of an axis; None without."""
    norm = one.statistics["norm"].tolerance
    axes = [found for axis in AXES[:3] if (found := one.statistics[axis].tolerance) is not None]
    return min(axes, default=None) if norm is None else norm


def shown_log(result: Comparison) -> Deviation:
    """Return the compared log whose arm is drawn: the worst that has kinematics, else the worst."""
    worst_first = sorted(result.runs, key=tolerance_sort_key)[::-1]
    return next((one for one in worst_first if one.run.tcp is not None), worst_first[0])


def _arm(one: Deviation, colour: str) -> Iterator[Arm]:
    """Yield the arm of a log where the alignment puts it; nothing without kinematics."""
    run = one.run
    if run.robot is None or run.tcp is None:
        return
    decided = int(one.t_ns[one.worst_statistics_index])
    row = min(int(np.searchsorted(run.t_ns, decided)), len(run.t_ns) - 1)
    chain = apply_alignment(run.robot, one.alignment)
    yield Arm(chain, run.q, times_of(run), colour, kept=(row,), marks=cause_marks(one, chain))


def _reference(reference: Trajectory, shown: Deviation) -> Iterator[Path]:
    """Yield the whole reference as a line, and the point where it is at the samples of a log."""
    if shown.run.timed:
        yield Path(reference.name, reference.position, None, REFERENCE_COLOUR, asked=True)
    yield Path(
        reference.name, shown.reference, shown.axis_ns, REFERENCE_COLOUR, asked=True, sample=shown.sample,
        kept=(shown.worst_statistics_index,), line=False,
    )  # fmt: skip


def _log(one: Deviation, colour: str) -> Path:
    """Return where a compared log was."""
    return Path(
        one.name, one.actual, one.axis_ns, colour, sample=one.sample, kept=(one.worst_statistics_index,),
        line=one.run.timed,
    )  # fmt: skip


def _decided(one: Deviation, *, several: bool) -> Spot:
    """Return where the verdict on a log was decided: by what, how much and when."""
    whose = f", {one.name}" if several else ""
    said = f"{amount_words(one.worst_statistics)} {when(one.worst_statistics)}{whose}"
    return Spot(spot_at(one.actual[one.worst_statistics_index]), said, DEVIATION_COLOUR)


def _enlarged(one: Deviation, radius: float) -> Path | None:
    """Return reference + factor (actual - reference) of a log; None where it shows nothing.

    Only that of the log whose arm is drawn: a line a log would hide all of them.
    """
    factor = drawn_larger(one.statistics["norm"].max, radius)
    if factor is None:
        return None
    position = one.reference + factor * (np.asarray(one.actual) - one.reference)
    kept = (one.worst_statistics_index,)
    return Path(f"deviation x{factor}", position, one.t_ns, DEVIATION_COLOUR, sample=one.sample, kept=kept)


def drawn_larger(largest: float, radius: float) -> int | None:
    """Return the largest factor that keeps a deviation inside the scene; None where none makes it seen."""
    factor = next((factor for factor in FACTORS if factor * largest <= radius), None)
    return None if factor is None or factor * largest < LEAST_SEEN * radius else factor


def _radius(arms: Sequence[Arm], paths: Sequence[Path]) -> float:
    """Return half of the diagonal around arms and paths in [m]; 1 around one point."""
    points: list[FloatArray] = [np.asarray(path.position) for path in paths]
    for arm in arms:
        rows = np.unique(np.linspace(0, len(arm.q) - 1, min(POSES, len(arm.q))).astype(np.int64))
        points.append(points_over_log(arm.chain, np.asarray(arm.q)[rows]).reshape(-1, 3))
    low = np.min([np.nanmin(part, axis=0) for part in points if np.isfinite(part).any()], axis=0)
    high = np.max([np.nanmax(part, axis=0) for part in points if np.isfinite(part).any()], axis=0)
    return float(np.linalg.norm(high - low)) / 2 or 1.0
