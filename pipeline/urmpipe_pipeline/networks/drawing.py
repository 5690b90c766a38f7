"""All drawings of a network in one SVG: its graph, the mechanism, its assemblies."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from urmpipe_models.display import format_count
from urmpipe_models.errors import escape_html
from urmpipe_pipeline.networks.gallery import gallery_svg
from urmpipe_pipeline.networks.graph_drawing import graph_svg
from urmpipe_pipeline.networks.result import NetworkResult
from urmpipe_pipeline.networks.scene import motion_plane
from urmpipe_pipeline.networks.sketch import mechanism_svg, view_words
from urmpipe_pipeline.presentation.figure import Drawing

APART_PX = 12.0
"""Between two drawings below each other, in pixels."""


def network_svg(result: NetworkResult) -> str:
    """Return the drawings of a network below each other."""
    return stacked([one.svg for one in drawings(result)], result.name)


def drawings(result: NetworkResult) -> Iterator[Drawing]:
    """Yield the graph, the projections of what was found, and if all were requested each assembly."""
    network = result.network
    ties = format_count(len(network.joints), "joint")
    ties += f" and {format_count(len(network.elements), 'element')}" if network.elements else ""
    loops = format_count(len(result.loops), "loop")
    bodies = f"{len(network.body_names)} bodies"
    yield Drawing(
        "Graph",
        f"{bodies} of {result.name} as boxes, {ties} between them, {loops} shaded.",
        graph_svg(result),
    )
    if svg := mechanism_svg(result):
        yield Drawing("Mechanism", f"{bodies} of {result.name}, {view_words(motion_plane(result))}.", svg)
    if result.all_solutions and len(result.assemblies) > 1:
        alt = f"The assemblies of {result.name} as {len(result.assemblies)} small pictures."
        yield Drawing("Assemblies", alt, gallery_svg(result))


def stacked(pictures: Sequence[str], title: str) -> str:
    """Return pictures (SVG) below each other as one."""
    sizes = np.array([re.findall(r'(?:width|height)="(\d+)"', one)[:2] for one in pictures], np.float64)
    tops = np.cumsum([0.0, *(sizes[:, 1] + APART_PX)])
    wide, high = sizes[:, 0].max(), tops[-1]
    size = f'width="{wide:.0f}" height="{high:.0f}" viewBox="0 0 {wide:.0f} {high:.0f}"'
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size}>',
            f"<title>{escape_html(title)}</title>",
            '<rect width="100%" height="100%" fill="white"/>',
            *(
                one.replace("<svg ", f'<svg y="{top:.0f}" ', 1)
                for one, top in zip(pictures, tops[:-1].tolist(), strict=True)
            ),
            "</svg>\n",
        )
    )
