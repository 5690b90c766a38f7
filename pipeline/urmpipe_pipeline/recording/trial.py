"""All that stands in a recording, read once; in a process of its own, see `urmpipe_pipeline.isolated`."""

from __future__ import annotations

from pathlib import Path

from urmpipe_pipeline.isolated import abort_of


def recording_abort(path: Path) -> str:
    """Return how reading a recording ends the process that does it; empty if it does not."""
    return abort_of(path, __name__, meanwhile=("rerun.chunk",))


def read_through(path: str) -> None:
    """Read all that stands in a recording; what its reader refuses in an orderly way is told elsewhere.

    Rerun's own classes round these take half a second to import.
    """
    from rerun_bindings import RrdReaderInternal

    try:
        reader = RrdReaderInternal(path)
        for entry in reader.store_entries():
            store = reader.store(store=entry)
            store.summary()
            for chunk in store.stream().to_chunks():
                chunk.to_record_batch()
    except (RuntimeError, ValueError):
        pass
