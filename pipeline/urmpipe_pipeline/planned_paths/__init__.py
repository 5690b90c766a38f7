"""Planned paths: rows as lines and arcs, a time law along them, the joints, and how all that shows."""
