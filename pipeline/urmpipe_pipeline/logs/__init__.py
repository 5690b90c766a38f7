"""Sources: log files in, a `JointLog` out. Only this package knows who wrote a file.

A file goes through `text` (is it text?), `sniff` (how is it written?), `clock` and `roles` (what are its
columns?), `table` (its numbers, and where it is wrong, with line and column), `units` and `assemble` (SI).
The words by which columns, units and sources are known are in `vocabulary.toml`.
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
