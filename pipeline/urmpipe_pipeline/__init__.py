"""Logs in; recordings, verdicts and reports out.

The way of the data: `sources` (CSV -> JointLog) -> `ingest` (repolarize, grid, kinematics -> Run)
-> `recording` (.rrd) -> `compare` (delta, verdict -> Comparison) -> `report` (HTML).
"""
