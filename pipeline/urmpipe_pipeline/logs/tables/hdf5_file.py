"""HDF5 files: datasets of one length, variables of MATLAB 7.3 and Octave, tables of pandas."""

from __future__ import annotations

from pathlib import Path

from urmpipe_models.errors import Finding, LogError
from urmpipe_pipeline.array_choice import Question
from urmpipe_pipeline.logs.options import LogMap
from urmpipe_pipeline.logs.tables.array_table import ask_for_arrays, make_array_table
from urmpipe_pipeline.logs.tables.held import MemoryTable
from urmpipe_pipeline.logs.tables.limits import refuse_unpacked, refuse_wide, unpacked_limit
from urmpipe_pipeline.logs.tables.mat_file import make_variable_table
from urmpipe_pipeline.subprocess_reader import ReaderCrashError, read_in_subprocess

READER = "urmpipe_pipeline.hdf5_contents"  # it is imported with h5py, which may be missing


def read_hdf5(path: Path, options: LogMap) -> MemoryTable:
    """Return the table of an HDF5 file.

    Raises:
        LogError: If the file is damaged, or has no arrays of numbers with one row per
            sample; with a question if it has several episodes, or arrays of several lengths.
    """
    arguments = (str(unpacked_limit(path.stat().st_size)), options.episode or "", options.topic or "")
    try:
        contents, reason = read_in_subprocess(path, READER, arguments=arguments)
    except ReaderCrashError as error:
        contents, reason = None, str(error)
    if reason:
        raise LogError(
            Finding(f"found an HDF5 file that cannot be read ({reason}), allowed: a whole one", str(path))
        )
    refuse_unpacked(path, contents.size)
    if contents.variables is not None:
        return make_variable_table(path, contents.variables, options)
    if isinstance(contents.choice, Question):
        ask_for_arrays(path, contents.choice)
    not_read = [f"{name} {shape}" for name, shape in contents.not_read]
    if not contents.columns:
        shown = ", ".join(not_read[:8]) or "no dataset"
        allowed = "datasets of numbers with one row per sample, such as t (n,) and q (n, joints)"
        raise LogError(Finding(file=str(path), found=shown, allowed=allowed))
    refuse_wide(len(contents.columns), str(path))
    return make_array_table(path, contents.choice, contents.columns, contents.scalars, "/", not_read)
