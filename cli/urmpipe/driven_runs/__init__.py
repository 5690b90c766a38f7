"""An arm with drives, run along planned paths: as machine code where it can be built, else in NumPy."""
