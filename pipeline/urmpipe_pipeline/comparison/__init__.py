"""Runs held against a reference: offset in time and space, deviations, verdicts, changes since a baseline."""
