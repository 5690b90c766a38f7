"""Units of the columns and forms of orientations: said, or told by the data."""
