"""Mechanics in NumPy: chains, kinematics, repolarizer, deviation.

Every model function is written once, elementwise, on one array per coordinate (structure of
arrays), so that a column of a million samples, a float and a CasADi symbol pass through the same
lines. Units are SI: m, s, rad.
"""

DEFAULT_TOLERANCE = 0.0035  # [m], largest deviation allowed along x, y and z each; [UrmArm2021]_ section 2.4
