"""Recordings (.rrd): every array and all metadata of a result, and what the viewer shows of it.

The only part of urmpipe that knows Rerun. A result -> `codec` (JSON and arrays, by the types of its fields)
-> `writer` -> .rrd -> `reader` -> `codec` -> a result. `layout` is what writer and reader agree on;
`file_check` finds out what a file is; `views` sends what is shown, and `viewer` opens it.
"""

from urmpipe_pipeline.recording.file_check import is_ours, is_recording, preload_writer

__all__ = ["is_ours", "is_recording", "preload_writer"]
