"""Models with FMI variables, packaged as FMUs: the area of the units and their export."""
