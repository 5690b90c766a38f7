"""Logs of one motion: `wanted`, and others within tolerance, a little worse, and out of it."""

from __future__ import annotations

from functools import cache
from io import StringIO

import numpy as np


@cache
def log_text(off: float) -> str:
    """Return the text of a log that differs by so much from the one that is wanted."""
    t, text = 0.005 * np.arange(200), StringIO()
    q = np.cos(np.outer(t, 0.5 + 0.1 * np.arange(6)))
    header = "t [s]," + ",".join(f"q{i} [rad]" for i in range(1, 7))
    table = np.column_stack([t, q - off * np.sin(t)[:, np.newaxis]])
    np.savetxt(text, table, fmt="%.9f", delimiter=",", header=header, comments="")
    return text.getvalue()
