"""The tables of a log: what its files are, which source wrote them, how each table is written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from urmpipe_models.errors import Finding, Hint, OptionError, format_value, map_collecting_errors
from urmpipe_models.files import log_stem
from urmpipe_pipeline.joint_log import URMPIPE_SOURCE, Inference, LogWarning
from urmpipe_pipeline.logs.formats import coppeliasim
from urmpipe_pipeline.logs.formats.bag import MAGIC, is_bag_folder, is_packed
from urmpipe_pipeline.logs.formats.cells import is_number
from urmpipe_pipeline.logs.formats.files import first_bytes, import_optional
from urmpipe_pipeline.logs.formats.json import read_json, sniff_json_lines
from urmpipe_pipeline.logs.formats.labels import refuse_among_rows, refuse_conflict, sniff_labels, with_names
from urmpipe_pipeline.logs.formats.log_table import LogTable
from urmpipe_pipeline.logs.formats.memory import MemoryTable, to_log_table
from urmpipe_pipeline.logs.formats.own import in_si
from urmpipe_pipeline.logs.formats.programs import read_program
from urmpipe_pipeline.logs.formats.shape import sniff_arrays, turned
from urmpipe_pipeline.logs.formats.sniff import across, sniff
from urmpipe_pipeline.logs.formats.table import choose_rows
from urmpipe_pipeline.logs.formats.text import Segment, open_text, refuse_long_lines
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.formats.workbook import read_workbook
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import KnownSource, vocabulary

COPPELIASIM, PATH, TABLE = "coppeliasim", "path", "table"


def source_names() -> tuple[str, ...]:
    """Return the names that `LogMap.source` takes."""
    return (COPPELIASIM, *(source.name for source in vocabulary().sources), PATH, TABLE)


@dataclass(frozen=True, slots=True)
class Tables:
    """The tables of a log before their columns are understood.

    Attributes:
        source: Name of the source.
        known: What is known of it, if anything.
        layouts: How each table is written.
        titles: Title of each table: the file's stem, or the graph's path.
        inferences: What was found out.
        foreign: Whether its source was given, and has columns or graphs of its own, which are not there.
        warnings: Warnings about its files.
    """

    source: str
    known: KnownSource | None
    layouts: tuple[LogTable, ...]
    titles: tuple[str, ...]
    inferences: tuple[Inference, ...]
    foreign: bool = False
    warnings: tuple[LogWarning, ...] = ()

    @property
    def paths(self) -> list[Path]:
        """The file of each table."""
        return [layout.path for layout in self.layouts]


Sniff: TypeAlias = Callable[[Segment, str | None, str | None], TextTable]
"""What finds out how a plain table is written, with delimiter and decimal sign as options give them."""


def open_tables(files: Sequence[Path | MemoryTable], options: LogMap, sniff_plain: Sniff = sniff) -> Tables:
    """Return the tables of a log's files, or of what is in memory.

    Raises:
        LogError: If a file is no text table, or holds a merge conflict; all files are looked at first.
        OptionError: If there is no file, or the source is unknown.
    """
    if not files:
        raise OptionError("found no log file, allowed: one, or several if the program writes one per plot")
    if options.source is not None and options.source not in source_names():
        found, allowed = format_value(options.source), ", ".join(source_names())
        raise OptionError(Finding(parameter="source", found=found, allowed=allowed))
    is_number.cache_clear()  # cells of other logs, which may be long
    opened = map_collecting_errors(lambda one: _opened(one, options), files)
    texts = [one for one in opened if isinstance(one, Segment)]
    if options.sheet is not None and not options.shared and not any(text.delimiter for text in texts):
        sheet = format_value(options.sheet)
        raise OptionError(Finding(parameter="sheet", found=sheet, allowed="with a workbook"))
    markers = map_collecting_errors(refuse_conflict, texts)
    titled = [
        (log_stem(file) if isinstance(file, Path) else file.name, one)
        for file, one in zip(files, opened, strict=True)
    ]
    forced, graphs = options.source == COPPELIASIM, list[tuple[str, Segment]]()
    if len(texts) == len(files) == 1 and (
        forced or (options.source is None and coppeliasim.is_export(texts[0]))
    ):
        graphs = coppeliasim.graphs(texts[0])
        titled, forced = [*graphs] or titled, True
    layouts = map_collecting_errors(lambda item: _layout(item[1], options, sniff_plain), titled)
    map_collecting_errors(
        lambda table: refuse_among_rows(*table),
        zip([layout for layout in layouts if isinstance(layout, TextTable)], markers, strict=False),
    )
    if len(files) > 1:
        layouts = [across(layout) for layout in layouts]
    layouts = _shaped(layouts, options) if sniff_plain is sniff else layouts
    titles = tuple(title for title, _ in titled)
    names = _names(layouts)
    tables = [table for table in opened if isinstance(table, MemoryTable)]
    stated = next((table.source for table in tables if table.source), "")
    known, why = _known(names, options.source, titles if forced else (), stated)
    if known is None and options.source is None and all(map(in_si, layouts)):
        known, why = vocabulary().source(URMPIPE_SOURCE), "what its columns are called, and their units"
    name = options.source or (COPPELIASIM if forced else known.name if known else TABLE)
    said = Inference("source", name, why, hints=(Hint("source"),), basis="named")
    foreign = known is not None and bool(known.columns and options.source) and not known.wrote(names)
    foreign = foreign and options.source != stated
    foreign = not graphs if options.source == COPPELIASIM else foreign
    said_of_all = (*_encoding(texts[:1]), said)
    warnings = tuple(warning for table in tables for warning in table.warnings)
    return Tables(name, known, tuple(layouts), titles, said_of_all, foreign, warnings)


def _opened(one: Path | MemoryTable, options: LogMap) -> Segment | MemoryTable:
    """Return a table as it is in memory, a file of typed columns or a program read, any other as text."""
    if isinstance(one, MemoryTable):
        return one
    if (typed := _read_typed(one, options)) is not None:
        return typed
    if (sheet := read_workbook(one, options)) is not None:
        return sheet
    text = open_text(one, any_suffix=options.source is not None)
    table = read_program(text, options) or read_json(text, options)
    if table is None:
        refuse_long_lines(text)
    return table or text


def _read_typed(path: Path, options: LogMap) -> MemoryTable | None:
    """Return the table of a file of typed columns; None of any other file, which may be text."""
    head = first_bytes(path, 128)
    is_zipped_arrays = head.startswith(b"PK\x03\x04") and path.suffix.lower() == ".npz"
    if head.startswith((b"PAR1", b"PARE", b"ARROW1")):
        from urmpipe_pipeline.logs.formats.parquet import read_feather, read_parquet

        return read_feather(path) if head.startswith(b"ARROW1") else read_parquet(path, head, options)
    if head.startswith(b"MATLAB 5.0 MAT-file"):
        from urmpipe_pipeline.logs.formats.matlab import read_mat

        return read_mat(path, head, options)
    if head.startswith((b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file")):
        import_optional("h5py", path, "an HDF5 file")
        from urmpipe_pipeline.logs.formats.matlab import read_hdf5

        return read_hdf5(path, options)
    if head.startswith(b"\x93NUMPY") or is_zipped_arrays:
        from urmpipe_pipeline.logs.formats.arrays import read_numpy

        return read_numpy(path, options)
    if head.startswith(tuple(MAGIC)) or is_packed(path) or is_bag_folder(path):
        for library in ("mcap.reader", "rosbags.typesys"):
            import_optional(library, path, "a recording of messages")
        from urmpipe_pipeline.logs.formats.bag_table import read_bag

        return read_bag(path, options)
    return None


def _shaped(layouts: Sequence[LogTable], options: LogMap) -> list[LogTable]:
    """Return tables with a row a sample: the rows that are read, without end marks in what is sampled."""
    alone = len(layouts) == 1
    shaped = map_collecting_errors(lambda one: turned(one, options.layout, alone=alone), layouts)
    return [one.without_sampled_ends() for one in choose_rows(shaped, options)]


def _encoding(texts: Sequence[Segment]) -> Iterator[Inference]:
    """Yield the encoding of a text, and how its file was read."""
    for text in texts:
        yield from text.inferences
        if text.delimiter:
            continue
        mark = "byte order mark" if text.start else "its bytes"
        utf_8 = (Hint("", effect="save the file as UTF-8"),)
        yield Inference("encoding", text.encoding, mark, hints=utf_8)


def _layout(one: Segment | MemoryTable, options: LogMap, sniff_plain: Sniff) -> LogTable:
    """Return how a table is written: rows with labels, with arrays in their cells, or plain ones."""
    if isinstance(one, MemoryTable):
        return to_log_table(one)
    given = one.delimiter or options.delimiter, options.decimal
    found = None if one.delimiter else sniff_json_lines(one)
    found = found or (None if given[0] else sniff_labels(one))
    return found or sniff_arrays(one, *given) or with_names(sniff_plain(one, *given))


def _known(
    names: Sequence[str], given: str | None, graphs: Sequence[str], stated: str = ""
) -> tuple[KnownSource | None, str]:
    """Return the source that is given, stated by a schema, or known by graphs or columns, and why."""
    if given is not None:
        return vocabulary().source(given), "given as an option"
    if stated:
        return vocabulary().source(stated), "the types of the messages"
    if graphs:
        return None, f"each graph has its path and header: {', '.join(graphs)}"
    known = next((source for source in vocabulary().sources if source.wrote(names)), None)
    return known, "the names of its columns" if known else "no source is known by these columns"


def _names(layouts: Sequence[LogTable]) -> list[str]:
    """Return the names of all columns and the labels of rows."""
    labels = (table.form.labels if isinstance(table, TextTable) and table.form else () for table in layouts)
    return [name for layout, more in zip(layouts, labels, strict=True) for name in (*layout.names, *more)]
