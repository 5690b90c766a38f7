"""Recordings (.rrd): every array and all metadata of a run or a comparison, and a layout for the viewer.

The only part of urmpipe that knows Rerun. What stands where is told in `entities`.
"""

from urmpipe_pipeline.recording.identity import is_ours, is_recording
from urmpipe_pipeline.recording.reader import read_recording
from urmpipe_pipeline.recording.writer import write_recording

__all__ = ["is_ours", "is_recording", "read_recording", "write_recording"]
