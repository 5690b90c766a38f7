"""Recordings (.rrd): every array and all metadata of a result, and what the viewer shows of it.

The only part of urmpipe that knows Rerun. Data goes one way: result -> `codec` (JSON and arrays by the types
of its fields) -> `writer` -> .rrd -> `reader` -> `codec` -> result; what is shown comes from `views`.
"""

from urmpipe_pipeline.recording.identity import import_ahead, is_ours, is_recording

__all__ = ["import_ahead", "is_ours", "is_recording"]
