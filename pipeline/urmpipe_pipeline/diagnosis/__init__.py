"""Causes of a deviation: hypotheses of sign, structure, pose and time, fitted and selected (diagnose.py)."""
