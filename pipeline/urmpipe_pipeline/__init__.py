"""Logs in; recordings, verdicts and reports out.

The way of the data: `logs` (file -> LogMap -> JointLog) -> `ingest` (repolarize, grid, kinematics -> Run)
-> `recording` (.rrd) -> `compare` (delta, verdict -> Comparison) -> `report` (HTML).
"""
