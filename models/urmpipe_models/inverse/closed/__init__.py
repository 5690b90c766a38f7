"""Closed forms: all solutions of a pose, written down."""
