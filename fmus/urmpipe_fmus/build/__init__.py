"""The FMU of a block model: its texts, its files, and the cache of built ones."""
