"""Runs compared with a reference: offset in time and space, deviations, verdicts, and changes of these."""
