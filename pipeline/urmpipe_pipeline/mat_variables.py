"""The variables of a MAT file, for `subprocess_reader`. It imports nothing else, to start quickly."""

from __future__ import annotations

from typing import Any


def read_through(path: str) -> tuple[dict[str, Any], str]:
    """Return the variables of a file, structs as dictionaries, or why there are none."""
    from scipy.io import loadmat

    try:
        return loadmat(path, appendmat=False, simplify_cells=True), ""
    except Exception as error:  # of damaged bytes SciPy's reader raises anything, an UnboundLocalError too
        return {}, str(error).partition("\n")[0].strip(" .") or type(error).__name__
