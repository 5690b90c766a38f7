"""What deviation is allowed where nothing else is said."""

DEFAULT_TOLERANCE = 0.0035
"""Largest deviation allowed on an axis in [m]. Source: [UrmArm2021]_ section 2.4."""
