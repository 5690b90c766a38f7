"""Parameters of report, export, robot and demo."""

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal, TypedDict

from urmpipe.parameters import kinds
from urmpipe.parameters.completion import comma_separated
from urmpipe.parameters.param import Param
from urmpipe.parameters.shared import Inputs, PathLike, Placing, Progress

if TYPE_CHECKING:
    from urmpipe_models.lagrange.derivation import TermName
    from urmpipe_pipeline.figures.files import FigureFormat

_output = partial(Param, each_call=True)


class Report(Inputs, Progress, total=False):
    """The parameters of `report`."""

    figures: Annotated[
        PathLike | None, Param(kinds.FOLDER, "Write the figures as files into this folder, too.")
    ]
    formats: Annotated[
        "str | Sequence[FigureFormat]",
        Param(
            kinds.texts(
                "FORMATS", "pdf, svg, png or a list of them", comma_separated("pdf", "svg", "png"), split=True
            ),
            "Formats of figures: pdf, svg, png.",
            default="pdf,png",
            names=("--format",),
        ),
    ]
    figure_names: Annotated[
        str | Sequence[str],
        Param(
            kinds.texts("TITLE", 'a title or a list of titles, such as "Deviation*"'),
            "Write only figures of this title or pattern (repeatable).",
            default=(),
        ),
    ]
    figure_width: Annotated[
        str | float,
        Param(
            kinds.WIDTH, "column (88 mm), page (180 mm), or a length such as 85mm or 3.5in.", default="page"
        ),
    ]
    figure_font: Annotated[
        float | str,
        Param(kinds.number("pt", positive=True), "Size of the text in figures, such as 8pt.", default="8pt"),
    ]
    figure_dpi: Annotated[
        int | str, Param(kinds.COUNT, "Resolution of PNG files in dots per inch.", default=300)
    ]


class Export(Inputs, total=False):
    """The parameters of `export`."""

    to: Annotated[
        Literal["csv", "parquet", "mat", "tum"] | None,
        Param(
            kinds.one_of("csv", "parquet", "mat", "tum"),
            "Format [default: by the suffix of the output, else csv].",
        ),
    ]
    rows: Annotated[
        Literal["grid", "file", "compared", "criteria", "velocities", "samples", "simulated"] | None,
        Param(
            kinds.one_of("grid", "file", "compared", "criteria", "velocities", "samples", "simulated"),
            "Rows of a log: grid, in SI on the time grid, or file, with the file's own names and units"
            " [default: grid]; of a comparison: compared; of iso also criteria; of accuracy:"
            " velocities or samples [default: velocities]; of a simulation: simulated.",
        ),
    ]
    tcp: Annotated[
        Literal["fk", "recorded"] | None,
        Param(
            kinds.one_of("fk", "recorded"),
            "Source of the tool poses for --to tum: fk, from the joint values; recorded, from the log"
            " [default: fk].",
        ),
    ]


class ShowRobot(Placing, total=False):
    """The parameters of `robot show`."""

    q: Annotated[
        str | None,
        Param(
            kinds.JOINT_VALUES,
            "Joint values in rad and m, or with units, such as 0,90deg,500mm [default: the start pose].",
        ),
    ]
    picture: Annotated[PathLike | None, _output(kinds.DRAWING, "Draw the robot.")]


class ExportRobot(Placing, total=False):
    """The parameters of `robot export`."""

    output: Annotated[
        PathLike | None,
        _output(kinds.file("FILE"), "File to write, .urdf or .toml [default: NAME.urdf].", names=("-o",)),
    ]


class Equations(Placing, total=False):
    """The parameters of `equations`."""

    form: Annotated[
        Literal["text", "c"] | None,
        Param(kinds.one_of("text", "c"), "Text, or C99 functions [default: c for a .c file, else text]."),
    ]
    term: Annotated[
        "TermName | Literal['all']",
        Param(
            kinds.one_of("all", "inertia", "centrifugal", "coriolis", "gravity", "tool"),
            "Term of the equations.",
            default="all",
        ),
    ]
    output: Annotated[
        PathLike | None,
        _output(kinds.file("FILE"), "File to write [default: print the equations].", names=("-o",)),
    ]


class Demo(TypedDict, total=False):
    """The parameters of `demo`."""

    output: Annotated[
        PathLike,
        _output(kinds.FOLDER, "Folder for recordings and report.", default="urmpipe-demo", names=("-o",)),
    ]


def file_output(metavar: str, help: str, *suffixes: str) -> Param:
    """Return the parameter of a file that a function takes by its position, and a command as -o."""
    return _output(kinds.file(metavar, *suffixes), help, names=("-o",))
