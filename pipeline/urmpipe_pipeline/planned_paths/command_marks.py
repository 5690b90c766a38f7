"""The corners and stops of a plan, for a test after ISO 9283 in which it is the command."""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline.iso9283.command_path import CORNER_ANGLE, RoundedCorner, Stop
from urmpipe_pipeline.planned_paths.result import PlannedPath


def find_rounded_corners(plan: PlannedPath) -> tuple[RoundedCorner, ...]:
    """Return the corners that arcs of a plan round by 30 deg or more, each with its times."""
    arcs = [k for k, kind in enumerate(plan.path.kinds) if kind == "arc"]
    times, angle = plan.segment_times.tolist(), plan.path.length / np.maximum(plan.path.radius, 1e-12)
    return tuple(
        RoundedCorner(times[k], times[k + 1], (float(x), float(y), float(z)))
        for k, (x, y, z) in zip(arcs, plan.corners, strict=True)
        if CORNER_ANGLE - 1e-9 <= angle[k] < np.pi and np.isfinite(x)
    )


def find_stops(plan: PlannedPath) -> tuple[Stop, ...]:
    """Return where and when a plan stops, including its start and its end."""
    times = plan.row_times[plan.path.stop_row].tolist()
    return tuple(
        Stop(t, (float(x), float(y), float(z))) for t, (x, y, z) in zip(times, plan.stops, strict=True)
    )
