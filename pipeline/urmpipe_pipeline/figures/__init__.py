"""Figures for papers: what presentations show as plots, drawn by matplotlib.

`listing` (which figures there are, and which are wanted) -> `sheet` (paper of one width and font) ->
`panels` and `space` (what stands on it) -> `drawing` (one figure) -> `files` (PDF, SVG, PNG). matplotlib,
the extra `figures`, is imported where a figure is drawn. It knows no kind of result.
"""

from urmpipe_pipeline.figures.files import FigureFile, FigureOptions, write_figures

__all__ = ["FigureFile", "FigureOptions", "write_figures"]
