"""The report as one HTML file, and the figures of it as files of their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from urmpipe_models.errors import OptionError
from urmpipe_pipeline.outputs import guarded_output
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.report.figure_files import FigureFile, FigureOptions, figure_stem, write_figures
from urmpipe_pipeline.report.markup import asset, environment, script_hash
from urmpipe_pipeline.report.page import Page, lay_out


@dataclass(frozen=True, slots=True)
class Written:
    """What was written.

    Attributes:
        path: The HTML file.
        figures: The files of its figures; none unless they were asked for.
    """

    path: Path
    figures: tuple[FigureFile, ...] = ()


def render_report(presentations: Sequence[Presentation]) -> str:
    """Return the report as one HTML file that needs no network, the results in their order.

    The verdict stands first, then a card for each judged part, then all parts with their facts, tables and
    figures. Everything that came from a file is escaped, and a content security policy lets only the page's
    own two scripts run, known by their hashes.

    Raises:
        OptionError: If there is nothing to report.
    """
    return _render(_lay_out(presentations))


def write_report(
    presentations: Sequence[Presentation],
    path: Path,
    inputs: Sequence[Path] = (),
    figures: FigureOptions | None = None,
    progress: Callable[[float], None] | None = None,
) -> Written:
    """Write the report, and its figures as files if asked for: all or none.

    An existing file is replaced only if it is a report or a figure of ours and no input.

    Args:
        presentations: As `render_report` takes them.
        path: Where to.
        inputs: Files that must not be overwritten.
        figures: Where the figures go, and in which formats.
        progress: Told the share that is done, 0..1.

    Raises:
        OptionError: If there is nothing to report.
        OutputError: If it may not be written there, or the figures cannot be drawn.
    """
    page = _lay_out(presentations)
    with guarded_output(path, inputs, kind="report") as part:
        part.write_bytes(_render(page).encode("utf-8", "replace"))  # a file name may hold bytes of no text
        if progress and figures is None:
            progress(1.0)
        files = () if figures is None else write_figures(page.figures, figures, inputs, progress)
    return Written(path, files)


def _lay_out(presentations: Sequence[Presentation]) -> Page:
    """Return the page about at least one result."""
    if not presentations:
        raise OptionError("a report needs at least one run, comparison or simulation; found none")
    return lay_out(presentations)


def _render(page: Page) -> str:
    """Return the page as HTML."""
    from plotly.offline import get_plotlyjs

    plotly, script = get_plotlyjs(), asset("page.js")
    engine = environment()
    engine.filters["stem"] = figure_stem
    return engine.get_template("template.html.jinja").render(
        page=page,
        version=version("urmpipe"),
        hashes=[script_hash(plotly), script_hash(script)],
        style=asset("style.css"),
        plotly=plotly,
        script=script,
    )
