"""Tables for other programs: CSV, Parquet, MATLAB's MAT, TUM trajectories, JUnit XML.

What can be exported of a result (`presentation.exports`, made by its kind) -> `export`, which takes the
writer of the format: `csv_files` or `typed_files`. Each file is read back before it gets its name.
"""

from urmpipe_pipeline.tables.export import (
    FORMATS,
    Exported,
    ExportedFile,
    ExportOptions,
    Format,
    PoseNames,
    RowNames,
    export_result,
    format_of,
)

__all__ = [
    "FORMATS", "ExportOptions", "Exported", "ExportedFile", "Format", "PoseNames", "RowNames",
    "export_result", "format_of",
]  # fmt: skip
