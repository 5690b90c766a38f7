"""The deviation that is allowed unless another one is given."""

DEFAULT_TOLERANCE = 0.0035
"""Largest deviation allowed along x, y and z each in [m], +-3.5 mm. Source: [UrmArm2021]_ section 2.4."""
