"""Tables of targets: their header, rows that are wrong, orientations."""
