"""Export: what was ingested leaves again, as CSV, Parquet, MATLAB's MAT, or TUM trajectories.

Data goes one way: result -> `tables` (the file's own columns with `originals`, the grid, the deviations)
or `poses` -> `write`, which takes the writer of the format (`csv_file`, `parquet_file`, `mat_file`,
`tum_file`). Each file is read back before it gets its name.
"""

from urmpipe_pipeline.export.options import FORMATS, ExportOptions, Format, Rows, format_of
from urmpipe_pipeline.export.write import Exported, ExportedFile, export_result

__all__ = [
    "FORMATS",
    "ExportOptions",
    "Exported",
    "ExportedFile",
    "Format",
    "Rows",
    "export_result",
    "format_of",
]
