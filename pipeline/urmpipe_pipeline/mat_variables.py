"""The variables of a MAT file, for `subprocess_reader`. It imports little, to start quickly."""

from __future__ import annotations

from typing import Any

from urmpipe_pipeline.array_choice import OPAQUE


def read_through(path: str) -> tuple[dict[str, Any], str]:
    """Return the variables of a file, structs as dictionaries, or why there are none.

    An object of a class is the pair of OPAQUE and the name of its class.
    """
    from scipy.io import loadmat

    try:
        variables = loadmat(path, appendmat=False, simplify_cells=True)
    except Exception as error:  # of damaged bytes SciPy's reader raises anything, an UnboundLocalError too
        return {}, str(error).partition("\n")[0].strip(" .") or type(error).__name__
    return dict(_without_objects(name, value) for name, value in variables.items()), ""


def _without_objects(name: str, value: Any) -> tuple[str, Any]:
    """Return a variable by its name; SciPy before 1.18 gives an object the name None, and its own inside."""
    if isinstance(value, dict):
        return name, dict(_without_objects(key, inner) for key, inner in value.items())
    fields = getattr(getattr(value, "dtype", None), "names", None) or ()
    if fields[-2:] not in (("s2", "arr"), ("_Class", "_ObjectMetadata")):
        return name, value
    texts = [_as_text(value.ravel()[0][field]) for field in fields[:-1]]
    return (texts[0] if name == "None" else name), (OPAQUE, texts[-1])


def _as_text(value: Any) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)
