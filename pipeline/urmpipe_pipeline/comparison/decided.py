"""Where the verdict on a log was decided: the sample that a viewer opens at, and every word points to."""

from __future__ import annotations

import numpy as np

from urmpipe_pipeline.comparison.deviation import Deviation


def decided_row(one: Deviation) -> int:
    """Return the index into the compared samples where the quantity that decides is largest.

    It need not be where the norm is largest: a joint, an angle or one axis may decide.
    """
    return int(np.searchsorted(one.sample, one.decisive.sample_max))
