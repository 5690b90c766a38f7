"""Where an FMU of pythonfmu can be unpacked."""

from __future__ import annotations

from pathlib import Path


def why_not_in(folder: Path) -> str | None:
    """Return why an FMU that was unpacked in a folder would crash there; None if it would not.

    The binary (pythonfmu 0.7, fmi2Instantiate) undoes the %20 in the address of the resources and nothing
    else: in any other folder whose address is not spelled as it is, it finds nothing and ends the process.
    """
    resources = folder.absolute() / "resources"
    if not (resources / "slavemodule.txt").is_file() or "%" not in resources.as_uri().replace("%20", " "):
        return None
    return (
        f"a Python FMU cannot run in {folder.parent}: pythonfmu reads of its address plain letters, digits,"
        " - . _ ~ and spaces only; allowed: another folder for temporary files (TMPDIR, on Windows TEMP), or"
        " a native FMU"
    )
