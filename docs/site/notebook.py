"""A hook of mkdocs: notebooks run when the site is built, and become pages like the others.

The repository keeps them without outputs: each output comes from the code of the same build, and a change of
a notebook reads as text. A cell that fails ends the build.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig


@event_priority(100)  # first: links to the pages are looked up then
def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Put a page and its plots in the place of each notebook."""
    for file in [file for file in files if file.src_uri.endswith(".ipynb")]:
        files.remove(file)
        name = file.src_uri.removesuffix(".ipynb")
        for uri, content in page_files(Path(str(file.abs_src_path)), name):
            files.append(File.generated(config, uri, content=content))
    return files


def page_files(notebook: Path, name: str) -> Iterator[tuple[str, str | bytes]]:
    """Run a notebook in a new folder; yield the path and content of its page and of each plot."""
    from nbconvert import MarkdownExporter
    from nbconvert.preprocessors import ExecutePreprocessor
    from nbformat import read

    cells = read(str(notebook), as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        ExecutePreprocessor(timeout=None).preprocess(cells, {"metadata": {"path": folder}})
    places = {"output_files_dir": f"{Path(name).name}_files", "unique_key": "plot"}
    text, resources = MarkdownExporter().from_notebook_node(cells, resources=places)
    yield f"{name}.md", text.replace("![png]", "![Plot that the cell draws]")
    for plot, content in resources["outputs"].items():
        yield (Path(name).parent / plot).as_posix(), content
