"""The Python backend: a unit with its own sources under pythonfmu's binaries."""
