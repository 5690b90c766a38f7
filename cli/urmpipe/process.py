"""What a command does to its own process, to be done sooner; who only imports urmpipe is left alone."""

from __future__ import annotations

import gc
import os
import sys

COLLECT_AT = 100_000
"""Objects made before Python looks for cycles among them. Python's own 700 cost a command, which first of
all imports thousands of them, a tenth of a second."""

SWITCH_AFTER = 2e-4
"""Time in [s] after which a thread that computes lets another have Python's lock. With Python's own 5 ms a
thread that gives it up for each array waits longer for it than it works, while another one imports."""


def tune_python() -> None:
    """Set the pace of garbage collection and of switching threads."""
    gc.set_threshold(COLLECT_AT)
    sys.setswitchinterval(SWITCH_AFTER)


def tune_pyarrow() -> None:
    """Keep pandas out, and leave a core to whatever is done while pyarrow parses, such as importing Rerun."""
    import pyarrow as pa

    _keep_pandas_out()
    pa.set_cpu_count(min(pa.cpu_count(), max(1, (os.cpu_count() or 1) - 1)))


def _keep_pandas_out() -> None:
    """Let pyarrow find once and for all that pandas is not there: it converts nothing to pandas then.

    Otherwise it imports pandas (0.4 s, 32 MB) to see whether the first list that it converts is a Series.
    """
    if "pandas" in sys.modules:
        return
    import pyarrow as pa

    sys.meta_path.insert(0, _NoPandas)
    try:
        pa.array([0])
    finally:
        sys.meta_path.remove(_NoPandas)


class _NoPandas:
    """An import finder that does not find pandas."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> None:
        """Raise for pandas, and leave all else to the other finders."""
        if name == "pandas":
            raise ModuleNotFoundError("pandas is kept out of this process", name=name)
