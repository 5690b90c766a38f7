"""The report as one HTML file in which nothing foreign runs, and its figures as files of their own."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from urmpipe_models.errors import escape_control_characters
from urmpipe_pipeline.figures.files import FigureFile, FigureOptions, figure_stem, write_figures
from urmpipe_pipeline.outputs import safe_output
from urmpipe_pipeline.presentation.section import Presentation
from urmpipe_pipeline.report.page import Page, lay_out
from urmpipe_pipeline.report.spec import DARK


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

    The verdict stands first, then a line for each judged part, then all parts with their facts, tables and
    figures: those that failed first and open, those that passed folded. Everything that came from a file is
    escaped, and a content security policy lets only the page's own two scripts run, known by their hashes.

    Raises:
        OptionError: If there is nothing to report.
    """
    return _render(lay_out(presentations))


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
        figures: Which figures go where, in which formats, and how large.
        progress: Told the share that is done, 0..1.

    Raises:
        OptionError: If there is nothing to report, or no figure of a name.
        OutputError: If it may not be written there, or the figures cannot be drawn.
    """
    with safe_output(path, inputs, kind="report") as part:
        part.write_bytes(
            render_report(presentations).encode("utf-8", "replace")
        )  # a file name may hold bytes of no text
        if progress and figures is None:
            progress(1.0)
        drawn = () if figures is None else write_figures(presentations, figures, inputs, progress)
    return Written(path, drawn)


def _render(page: Page) -> str:
    """Return the page as HTML."""
    from plotly.offline import get_plotlyjs

    plotly, script = get_plotlyjs(), asset("page.js")
    template = environment().get_template("template.html.jinja")
    return template.render(
        page=page,
        version=version("urmpipe"),
        dark=json.dumps(DARK),
        hashes=[script_hash(plotly), script_hash(script)],
        style=asset("style.css"),
        plotly=plotly,
        script=script,
    )


@cache
def environment() -> Environment:
    """Return the template engine: it escapes everything but what passes the filters raw and json.

    The one that there is keeps the templates that it has compiled.
    """
    engine = Environment(
        loader=PackageLoader(__package__, "assets"),
        autoescape=True,
        finalize=_inert,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    engine.filters |= {
        "raw": Markup,
        "lines": text_lines,
        "json": script_json,
        "data_address": data_address,
        "stem": figure_stem,
    }
    engine.filters["kind"] = lambda block: type(block).__name__
    return engine


def _inert(value: Any) -> Any:
    """Return a text of the page on one line, with escapes for what reorders letters or acts on a terminal.

    An arrow is one letter there: a line may not break within "->".
    """
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    return escape_control_characters(value).replace(" -> ", " → ")


def text_lines(text: str) -> Markup:
    """Return a text of several lines that stand as they are, else as any text of the page."""
    return escape(escape_control_characters(text, kept="\n\t"))


def data_address(svg: str) -> str:
    """Return a drawing as the source of an image.

    Browsers run no script in an image, load nothing for it and let nobody click in it, whatever the file
    says that it came from.
    """
    data = base64.b64encode(svg.encode("utf-8", "replace")).decode("ascii")
    return f"data:image/svg+xml;base64,{data}"


def script_json(value: Any) -> Markup:
    """Return a value as JSON that can stand inside a script element: no <, > or & is left in it.

    Raises:
        ValueError: If the value holds a NaN or an infinity, which JSON has no word for.
    """
    written = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for letter in "<>&":
        written = written.replace(letter, f"\\u{ord(letter):04x}")
    return Markup(written)


def script_hash(script: str) -> str:
    """Return a script's hash as a content security policy writes it."""
    digest = hashlib.sha256(script.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def asset(name: str) -> str:
    """Return the text of a file that is embedded in every page."""
    return files(__package__).joinpath("assets", name).read_text(encoding="utf-8")
