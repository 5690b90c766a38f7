"""A log becomes a run: repolarized, on a uniform grid, with kinematics and what is doubtful about it."""
