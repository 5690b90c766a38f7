"""Logs: files become a `JointLog` in SI. Only this package knows formats, and the programs that write them.

    files -> formats: LogTable -> plan: Plan -> rows: Rows -> convert: Proposal, JointLog -> map_file: LogMap

1. Table (`formats.opening` selects the format): columns with names, units and cells; no joints yet.
2. Columns: joints and rates by their names (`columns`, `names`, `roles`) or by numbers (`unnamed`, `rates`),
   the recorded tool (`pose_columns`), the clock (`clock`, `clock_columns`). `plan` joins them; `coverage`
   warns of similar columns that are not read.
3. Rows (`rows`): times in ns (`timestamps`), values in the file's own units, checked and joined.
4. Units (`units`) and the form of orientations (`rotation`): stated, proved by the numbers (`proofs`),
   assumed with a warning, or asked.
5. Log (`convert`, `read`): joints in rad or m, recorded tool, warnings, and each decision with its evidence.
6. Map (`log_map`, `map_file`): the same decisions as options, keywords and TOML, which read the next log.

What is not known is a question: a `LogError` whose hints are the options that answer it. The words of names,
units and programs are in `vocabulary.toml`. `targets` reads the target poses of `ik` by the same tables.
"""

from urmpipe_pipeline.logs.formats.arrays import arrays_to_table
from urmpipe_pipeline.logs.formats.memory import MemoryTable
from urmpipe_pipeline.logs.formats.opening import source_names
from urmpipe_pipeline.logs.formats.parquet import TableLike, dataframe_to_table, is_table
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.map_file import format_map, map_of, read_map
from urmpipe_pipeline.logs.read import read_log

__all__ = [
    "LogMap",
    "MemoryTable",
    "TableLike",
    "arrays_to_table",
    "dataframe_to_table",
    "format_map",
    "is_table",
    "map_of",
    "read_log",
    "read_map",
    "source_names",
]
