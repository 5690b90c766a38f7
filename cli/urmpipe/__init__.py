"""urmpipe: does the motion this environment produced agree with the motion that was asked for?"""

__version__ = "0.1.0"
