"""From data to one safe HTML file: the template engine, embedded files, escaping, script hashes."""

from __future__ import annotations

import base64
import hashlib
import json
from importlib.resources import files
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


def environment() -> Environment:
    """Return the template engine: it escapes everything but what passes the filters raw and json."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    engine = Environment(
        loader=PackageLoader(__package__, "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    engine.filters["raw"] = Markup
    engine.filters["json"] = script_json
    engine.filters["data_address"] = data_address
    engine.filters["kind"] = lambda block: type(block).__name__
    return engine


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
    from markupsafe import Markup

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
