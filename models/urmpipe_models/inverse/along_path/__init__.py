"""Solutions along a path: one continuous motion, and where there is none."""
