"""The tables of a log: what its files are, which source wrote them, how each table is written.

1. Each file is opened: typed columns, a program, JSON or YAML become a table in memory, all else is text.
2. A text is refused if it holds a merge conflict: the rows of two versions may form one motion.
   CoppeliaSim's export (File > Export > selected graphs as CSV) is several tables in one file. Each graph has
   its path, its header `Time (s),<stream> (<unit>),...` and its rows.
3. Each table is sniffed: JSON lines, YAML, labels in rows, arrays in cells, or plain cells.
4. Its rows are chosen: a row per sample (`shape`), then the rows and the episode that options name.
5. The source: given as an option, stated by a schema, or known by the names of columns.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value, map_collecting_errors
from urmpipe_models.files import log_stem
from urmpipe_pipeline.joint_log import URMPIPE_SOURCE, Inference, LogWarning
from urmpipe_pipeline.logs.formats.bag import MAGIC, is_bag_folder, is_packed
from urmpipe_pipeline.logs.formats.cells import is_number, printable
from urmpipe_pipeline.logs.formats.files import first_bytes, import_optional
from urmpipe_pipeline.logs.formats.json import read_document, sniff_records
from urmpipe_pipeline.logs.formats.log_table import LogTable, capped
from urmpipe_pipeline.logs.formats.memory import MemoryTable, to_log_table
from urmpipe_pipeline.logs.formats.programs import read_program
from urmpipe_pipeline.logs.formats.shape import choose_rows, orient_table
from urmpipe_pipeline.logs.formats.sniff import GIVEN, across, sniff
from urmpipe_pipeline.logs.formats.sniff_rows import name_echoed_columns, sniff_arrays, sniff_labels
from urmpipe_pipeline.logs.formats.text import Segment, check_line_lengths, open_text
from urmpipe_pipeline.logs.formats.text_table import TextTable
from urmpipe_pipeline.logs.formats.urmpipe_tables import is_in_si
from urmpipe_pipeline.logs.formats.workbook import read_workbook
from urmpipe_pipeline.logs.log_map import LogMap
from urmpipe_pipeline.logs.vocabulary import KnownSource, vocabulary

COPPELIASIM, PATH, TABLE = "coppeliasim", "path", "table"

_NUMBERS = re.compile(r"\d+(-\d+)?")  # of columns

Sniff: TypeAlias = Callable[[Segment, str | None, str | None], TextTable]
# finds out how a plain table is written, with delimiter and decimal sign as options give them

_MARKER = re.compile(r"\"?([<|=>])\1{6}(?!\1)")  # git's; spreadsheets may put quotes around it
_GRAPHS = re.compile(r'\A\s*[^\r\n]*\r?\n"?Time \([^)]*\)"?,')  # how an export of CoppeliaSim begins
_GRAPH = re.compile(rb'^(?:(?![-+0-9.]+,)[^\r\n]*\S[^\r\n]*\r?\n)?"?Time \(', re.MULTILINE)


def source_names() -> tuple[str, ...]:
    """Return the names that `LogMap.source` takes."""
    return (COPPELIASIM, *(source.name for source in vocabulary().sources), PATH, TABLE)


@dataclass(frozen=True, slots=True)
class Tables:
    """The tables of a log before their columns are understood.

    Attributes:
        source: Name of the source.
        known: Its entry in the vocabulary, if it has one.
        tables: The tables.
        titles: Title of each table: the file's stem, or the graph's path.
        inferences: What was found out.
        foreign: Whether its source was given, and has special columns or graphs, which are missing.
        warnings: Warnings about its files.
    """

    source: str
    known: KnownSource | None
    tables: tuple[LogTable, ...]
    titles: tuple[str, ...]
    inferences: tuple[Inference, ...]
    foreign: bool = False
    warnings: tuple[LogWarning, ...] = ()

    @property
    def paths(self) -> list[Path]:
        """The file of each table."""
        return [table.path for table in self.tables]


def open_tables(files: Sequence[Path | MemoryTable], options: LogMap, sniff_plain: Sniff = sniff) -> Tables:
    """Return the tables of a log's files, or of what is in memory.

    Raises:
        LogError: If a file is no text table, or holds a merge conflict; all files are looked at first.
        OptionError: If there is no file, or the source is unknown.
    """
    if not files:
        raise OptionError("found no log file, allowed: one, or several if the program writes one per plot")
    if options.source is not None and options.source not in source_names():
        source, allowed = format_value(options.source), ", ".join(source_names())
        raise OptionError(Finding(parameter="source", found=source, allowed=allowed))
    is_number.cache_clear()  # cells of other logs, which may be long
    contents = map_collecting_errors(lambda file: _open_file(file, options), files)
    texts = [content for content in contents if isinstance(content, Segment)]
    if options.sheet is not None and not options.shared and not any(text.delimiter for text in texts):
        sheet = format_value(options.sheet)
        raise OptionError(Finding(parameter="sheet", found=sheet, allowed="with a workbook"))
    map_collecting_errors(_check_no_conflict, texts)
    titles = tuple(log_stem(file) if isinstance(file, Path) else file.name for file in files)
    graphs: list[tuple[str, Segment]] = []
    is_export = options.source == COPPELIASIM
    if len(texts) == len(files) == 1 and options.source in (None, COPPELIASIM):
        is_export = is_export or bool(_GRAPHS.match(texts[0].head.lstrip("\r\n")))
        graphs = _split_graphs(texts[0]) if is_export else []
    if graphs:
        titles, contents = tuple(title for title, _ in graphs), [segment for _, segment in graphs]
    tables = map_collecting_errors(lambda content: _sniff(content, options, sniff_plain), contents)
    if len(files) > 1:
        tables = [across(table) for table in tables]
    if sniff_plain is sniff:
        is_only = len(tables) == 1
        oriented = map_collecting_errors(
            lambda table: orient_table(table, options.layout, is_only=is_only), tables
        )
        tables = choose_rows(oriented, options)
    in_memory = [content for content in contents if isinstance(content, MemoryTable)]
    stated = next((memory.source for memory in in_memory if memory.source), "")
    forms = (table.form for table in tables if isinstance(table, TextTable) and table.form)
    names = [name for table in tables for name in table.names]
    names += [label for form in forms for label in form.labels]
    known, why = _find_source(names, options.source, titles if is_export else (), stated)
    if known is None and options.source is None and all(map(is_in_si, tables)):
        known, why = vocabulary().source(URMPIPE_SOURCE), "what its columns are called, and their units"
    name = options.source or (COPPELIASIM if is_export else known.name if known else TABLE)
    is_foreign = known is not None and bool(known.columns and options.source) and not known.wrote(names)
    is_foreign = is_foreign and options.source != stated
    inference = Inference("source", name, why, hints=(Hint("source"),), basis="named")
    return Tables(
        source=name,
        known=known,
        tables=tuple(tables),
        titles=titles,
        inferences=(*_describe_text(texts[:1]), inference),
        foreign=not graphs if options.source == COPPELIASIM else is_foreign,
        warnings=tuple(warning for memory in in_memory for warning in memory.warnings),
    )


def _open_file(file: Path | MemoryTable, options: LogMap) -> Segment | MemoryTable:
    """Return a table as it is in memory, a file of typed columns or a program read, any other as text."""
    if isinstance(file, MemoryTable):
        return file
    if (content := _read_typed(file, options) or read_workbook(file, options)) is not None:
        return content
    text = open_text(file, any_suffix=options.source is not None)
    table = read_program(text, options) or read_document(text, options)
    if table is None:
        check_line_lengths(text)
    return table or text


def _read_typed(path: Path, options: LogMap) -> MemoryTable | None:
    """Return the table of a file of typed columns; None of any other file, which may be text."""
    head = first_bytes(path, 128)
    is_zipped_arrays = head.startswith(b"PK\x03\x04") and path.suffix.lower() == ".npz"
    if head.startswith((b"PAR1", b"PARE", b"ARROW1")):
        from urmpipe_pipeline.logs.formats.parquet import read_feather, read_parquet

        return read_feather(path) if head.startswith(b"ARROW1") else read_parquet(path, head)
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


def _check_no_conflict(segment: Segment) -> None:
    """Raise a `LogError` with the markers that git left in a file whose versions it could not merge."""
    signs = [(sign.encode(), (sign * 7).encode(segment.encoding)) for sign in "<>"]
    blocks = _overlapping_blocks(segment)  # that lack even one sign, which is found faster than seven
    if not any(sign in block and marker in block for block in blocks for sign, marker in signs):
        return
    markers = [(line, text.strip(' ,;"')) for line, text in segment.lines() if _MARKER.match(text)]
    if any(text[0] in "<>" for _, text in markers):
        file, what = str(segment.path), "a marker of a merge conflict"
        allowed = "one version, without git's markers"
        findings = [
            Finding(file=file, line=line, found=f"{format_value(text)}, {what}", allowed=allowed)
            for line, text in markers
        ]
        raise LogError(*capped(findings, file))


def _overlapping_blocks(segment: Segment, size: int = 1 << 20) -> Iterator[bytes]:
    """Yield the bytes of a file in blocks, each with the last ones of the block before."""
    before = b""
    with segment.open() as file:
        while block := file.read(size):
            yield before + block
            before = block[-32:]


def _split_graphs(segment: Segment) -> list[tuple[str, Segment]]:
    """Return the path of each graph of an export of CoppeliaSim, and where it stands."""
    first, line = segment.start, segment.first_line
    content = (segment.data or segment.path.read_bytes())[first : segment.end]
    starts = [match.start() for match in _GRAPH.finditer(content)]
    graphs = list[tuple[str, Segment]]()
    line += content.count(b"\n", 0, starts[0] if starts else None)
    for start, end in zip(starts, [*starts[1:], len(content)], strict=False):
        title = content[start : content.find(b"\n", start)].decode(segment.encoding, "replace")
        graphs.append((printable(title.strip()), segment.cut(first + start, first + end, line)))
        line += content.count(b"\n", start, end)
    return graphs


def _sniff(content: Segment | MemoryTable, options: LogMap, sniff_plain: Sniff) -> LogTable:
    """Return a table: rows with labels, with arrays in their cells, or plain ones."""
    if isinstance(content, MemoryTable):
        return to_log_table(content)
    signs = content.delimiter or options.delimiter, options.decimal
    table = None if content.delimiter else sniff_records(content)
    table = table or (None if signs[0] else sniff_labels(content))
    by_number = bool(options.joints) and all(map(_NUMBERS.fullmatch, options.joints))
    if sniff_plain is sniff:
        sniff_plain = partial(sniff, by_number=by_number)
    table = table or sniff_arrays(content, *signs, by_number=by_number)
    return table or name_echoed_columns(sniff_plain(content, *signs))


def _describe_text(texts: Sequence[Segment]) -> Iterator[Inference]:
    """Yield how the file of a text was read, and its encoding."""
    for text in texts:
        yield from text.inferences
        if not text.delimiter:
            evidence = "byte order mark" if text.start else "its bytes"
            hints = (Hint("", effect="save the file as UTF-8"),)
            yield Inference("encoding", text.encoding, evidence, hints=hints)


def _find_source(
    names: Sequence[str], chosen: str | None, graphs: Sequence[str], stated: str
) -> tuple[KnownSource | None, str]:
    """Return the source that is given, stated by a schema, or known by graphs or columns, and why."""
    if chosen is not None:
        return vocabulary().source(chosen), GIVEN
    if stated:
        return vocabulary().source(stated), "the types of the messages"
    if graphs:
        return None, f"each graph has its path and header: {', '.join(graphs)}"
    known = next((source for source in vocabulary().sources if source.wrote(names)), None)
    return known, "the names of its columns" if known else "no source is known by these columns"
