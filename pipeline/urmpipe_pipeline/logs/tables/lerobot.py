"""Data sets of LeRobot: Parquet files of episodes, with names of joints in meta/info.json.

    v2  data/chunk-000/episode_000003.parquet   one episode per file
    v3  data/chunk-000/file-000.parquet         several episodes, of which meta/episodes has the file

Source: the formats v2.1 and v3.0 of huggingface/lerobot.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from os.path import isdir, isfile
from pathlib import Path
from typing import Any

import pyarrow as pa

from urmpipe_models.errors import Finding, Hint, LogError, OptionError, format_value

EPISODE = "episode_index"
SHOWN = 9  # episodes that a question lists
FOLDERS_ABOVE = 3  # meta/ is next to the file, or next to data/chunk-000/
MAX_INFO = 16 << 20  # bytes of meta/info.json, which describes columns


def is_data_set(path: Path) -> bool:
    """Return whether a folder is a data set of LeRobot."""
    return isfile(path / "meta" / "info.json") and isdir(path / "data")  # noqa: PTH112, PTH113 (any name)


def episode_file(folder: Path, episode: str | None) -> Path:
    """Return the file of a data set with an episode; without one, the only file, or that of the only episode.

    Raises:
        LogError: If there is no episode, or with the question which one is read.
        OptionError: If there is no such episode.
    """
    try:
        files = dict(_iter_episodes(folder))
    except (pa.ArrowException, OSError) as error:
        reason = str(error).partition("\n")[0]
        raise LogError(Finding(f"found a data set that cannot be read ({reason})", str(folder))) from None
    if not files:
        raise LogError(Finding(file=str(folder), found="a data set without episodes", allowed="one or more"))
    number = chosen_episode(folder, tuple(files), episode)
    return files[next(iter(files)) if number is None else number]


def chosen_episode(path: Path, numbers: Sequence[int], episode: str | None) -> int | None:
    """Return the episode that is given, among the numbers of those that there are; None if one is alone.

    Raises:
        LogError: With the question which one of several is read.
        OptionError: If there is no such episode.
    """
    number = None if episode is None else episode.removeprefix(f"{EPISODE}=")
    if number is not None and number.isdecimal() and int(number) in numbers:
        return int(number)
    shown = ", ".join(map(str, numbers[:SHOWN])) + ", ..." * (len(numbers) > SHOWN)
    if number is not None:
        allowed = f"the number of an episode: {shown}"
        finding = Finding(parameter="episode", file=str(path), found=format_value(episode), allowed=allowed)
        raise OptionError(finding)
    if len(numbers) == 1:
        return None
    hints = tuple(Hint("episode", str(k), f"reads episode {k}") for k in numbers[:SHOWN])
    raise LogError(
        Finding(file=str(path), found=f"{len(numbers)} episodes: {shown}", allowed="one", hints=hints)
    )


def _iter_episodes(folder: Path) -> Iterator[tuple[int, Path]]:
    """Yield number and file of each episode."""
    import pyarrow.parquet as pq

    keys = [EPISODE, "data/chunk_index", "data/file_index"]
    for meta in sorted((folder / "meta" / "episodes").glob("chunk-*/file-*.parquet")):
        rows = pq.read_table(meta, columns=keys).to_pydict()
        for number, chunk, file in zip(*(rows[key] for key in keys), strict=True):
            yield number, folder / "data" / f"chunk-{chunk:03d}" / f"file-{file:03d}.parquet"
    for path in sorted((folder / "data").glob("chunk-*/episode_*.parquet")):
        if match := re.fullmatch(r"episode_(\d+)", path.stem):
            yield int(match[1]), path


def with_names(table: pa.Table, path: Path) -> pa.Table:
    """Return a table with a column NAME.ENTRY for each entry of lists whose names are in meta/info.json."""
    import pyarrow.compute as pc  # takes long

    names = _feature_names(path)
    fields, columns = [], []
    for field, column in zip(table.schema, table.columns, strict=True):
        labels = names.get(field.name, []) if _is_list(field.type) else []
        if labels and pc.unique(pc.list_value_length(column)).to_pylist() == [len(labels)]:
            fields += [pa.field(f"{field.name}.{label}", field.type.value_type) for label in labels]
            columns += [pc.list_element(column, k) for k in range(len(labels))]
        else:
            fields.append(field)
            columns.append(column)
    return pa.Table.from_arrays(columns, schema=pa.schema(fields, table.schema.metadata))


def _is_list(kind: pa.DataType) -> bool:
    return bool(pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind))


def _feature_names(path: Path) -> dict[str, list[str]]:
    """Return the names of the entries of each feature, from the description of the file's data set."""
    infos = (folder / "meta" / "info.json" for folder in islice(path.resolve().parents, FOLDERS_ABOVE))
    info = next((file for file in infos if file.is_file() and file.stat().st_size < MAX_INFO), None)
    try:
        features = json.loads(info.read_bytes()).get("features", {}) if info else {}
        return {name: _texts(feature.get("names")) for name, feature in features.items()}
    except (OSError, ValueError, AttributeError, RecursionError) as error:
        raise LogError(Finding(f"found a description that cannot be read ({error})", str(info))) from None


def _texts(names: Any) -> list[str]:
    """Return the names of entries: a list, perhaps in another list, or under "motors" or "axes"."""
    names = next(iter(names.values()), None) if isinstance(names, Mapping) else names
    names = names[0] if isinstance(names, list) and len(names) == 1 and isinstance(names[0], list) else names
    texts = names if isinstance(names, list) and all(isinstance(name, str) for name in names) else []
    return texts if len(set(texts)) == len(texts) else []
