"""Kinematic networks as results: what was found of one, how it is drawn, and how it shows itself."""
