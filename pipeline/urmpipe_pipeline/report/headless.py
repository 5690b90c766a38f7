"""Drawing figures without a window: Kaleido, which has a Chromium of the system run plotly.js."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Literal

from urmpipe_models.errors import Finding, OutputError
from urmpipe_pipeline.report.spec import Figure

if TYPE_CHECKING:
    from kaleido import Kaleido

FigureFormat = Literal["svg", "png"]

WIDTH = 960
"""Width of a figure in [px]; its text of 12 px is 6.5 points on paper where it is 17 cm wide."""

PNG_SCALE = 2
"""Pixels of a PNG a px: 290 dpi on paper where it is 17 cm wide."""

FONT = "Arial, Helvetica, Liberation Sans, sans-serif"
"""Fonts of the same widths on every system, so that an SVG looks everywhere as it was laid out."""

NO_KALEIDO = Finding(
    parameter="figures", found="no kaleido, which draws them", allowed="pip install 'urmpipe[figures]'"
)
NO_BROWSER = Finding(
    parameter="figures",
    found="no Chromium or Chrome, which draws them",
    allowed="an installed one (Debian: apt-get install chromium), or the environment variable BROWSER_PATH"
    " with its place",
)

Draw = Sequence[tuple[Figure, FigureFormat]]


def draw(figures: Draw, done: Callable[[int, bytes], None]) -> None:
    """Draw figures one after the other, off the network; `done` is told the number, from 0, and the bytes.

    Raises:
        OutputError: If there is nothing to draw with, or a figure could not be drawn.
    """
    drawing = _draw(figures, done)
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        asyncio.run(drawing)
        return
    with ThreadPoolExecutor(1) as pool:  # a notebook has a loop in this thread already
        pool.submit(asyncio.run, drawing).result()


async def _draw(figures: Draw, done: Callable[[int, bytes], None]) -> None:
    browser = await _opened()
    try:
        for number, (figure, suffix) in enumerate(figures):
            done(number, await _drawn(browser, figure, suffix))
    finally:
        await browser.close()


async def _opened() -> Kaleido:
    """Return a browser that is ready to draw."""
    try:
        from kaleido import Kaleido
        from kaleido.errors import ChromeNotFoundError
    except ImportError as error:
        raise OutputError(NO_KALEIDO) from error
    try:
        browser = Kaleido(mathjax=False)  # else it loads MathJax from the network
        await browser.open()
    except ChromeNotFoundError as error:
        raise OutputError(NO_BROWSER) from error
    except (RuntimeError, OSError, TimeoutError) as error:
        said = f"the browser that draws them did not start: {_said(error)}"
        raise OutputError(Finding(said, parameter="figures")) from error
    return browser


async def _drawn(browser: Kaleido, figure: Figure, suffix: FigureFormat) -> bytes:
    """Return a figure as the browser draws it."""
    from choreographer.errors import DevtoolsProtocolError
    from kaleido.errors import KaleidoError

    layout = figure.spec["layout"]
    spec = figure.spec | {"layout": layout | {"font": layout["font"] | {"family": FONT}}}
    scale = PNG_SCALE if suffix == "png" else 1
    size = {"width": WIDTH, "height": figure.height, "scale": scale, "format": suffix}
    try:
        drawn: bytes = await browser.calc_fig(spec, opts=size)
    except (KaleidoError, DevtoolsProtocolError, RuntimeError, OSError, TimeoutError) as error:
        said = f"{figure.title!r} could not be drawn: {_said(error)}"
        raise OutputError(Finding(said, parameter="figures")) from error
    return drawn


def _said(error: Exception) -> str:
    """Return the first line of what an error says."""
    return str(error).partition("\n")[0] or type(error).__name__
