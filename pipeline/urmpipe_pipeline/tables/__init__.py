"""Tables for other programs: CSV, Parquet, MATLAB's MAT, TUM trajectories, JUnit XML.

Data goes one way: what can leave of a result (`presentation.exports`, made by its kind) -> `write`, which
takes the writer of the format. Each file is read back before it gets its name.
"""

from urmpipe_pipeline.tables.options import FORMATS, ExportOptions, Format, PoseNames, RowNames, format_of
from urmpipe_pipeline.tables.write import Exported, ExportedFile, export_result

__all__ = [
    "FORMATS", "ExportOptions", "Exported", "ExportedFile", "Format", "PoseNames", "RowNames",
    "export_result", "format_of",
]  # fmt: skip
