"""Parameters of ingest, compare, iso and diagnose."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal, TypedDict

from urmpipe.parameters import kinds
from urmpipe.parameters.param import Heading, Param, params_of
from urmpipe.parameters.shared import (
    Inputs,
    PathLike,
    Placing,
    Processing,
    Progress,
    Quantity,
    Reading,
    Strict,
)

if TYPE_CHECKING:
    from urmpipe_pipeline.comparison.comparison import Comparison
    from urmpipe_pipeline.solved_targets.given_targets import TargetsLike

_judging = partial(Param, heading=Heading.JUDGING)
_compared = partial(Param, heading=Heading.COMPARED)
_iso = partial(Param, heading=Heading.ISO)
_output = partial(Param, heading=Heading.OUTPUT, each_call=True)

SYNC_HELP = (
    "Align the clocks: by Unix times or dates on both sides (stamps), at the first samples (start), by the"
    " motion (auto), or by an offset such as 200ms: t_reference = t_log + TIME, negative if the log is late"
    " [default: "
)


class Ingest(Placing, Reading, Processing, Strict, Inputs, Progress, total=False):
    """The parameters of `ingest`."""

    output: Annotated[
        PathLike | None,
        _output(kinds.RECORDING, "Recording to write [default: LOG.rrd].", names=("-o",)),
    ]
    explain: Annotated[
        bool,
        _output(
            kinds.FLAG,
            "Print the map of the log, each entry with its evidence; write no recording.",
            default=False,
            python=False,
        ),
    ]
    write_map: Annotated[
        PathLike | None,
        _output(kinds.MAP_FILE, "Save the inferred columns and units as a map for --map."),
    ]
    audit: Annotated[
        PathLike | None,
        _output(kinds.TABLE_FILE, "Write every wrap, repair and open question, one per row."),
    ]


class Compared(TypedDict, total=False):
    """Which motions are compared."""

    tcp: Annotated[
        Literal["fk", "recorded"],
        _compared(
            kinds.one_of("fk", "recorded"),
            "Source of the tool position: fk, from the joint values; recorded, from the log.",
            default="fk",
        ),
    ]
    sides: Annotated[
        str | tuple[str, str] | None,
        _compared(
            kinds.SIDES,
            "Compare two sets of columns of one log, selected by words in their names: target,actual;"
            " desired,actual; commanded,measured. The word rest stands for all columns without the"
            " other word.",
        ),
    ]
    block: Annotated[
        str | Sequence[str] | None,
        _compared(
            kinds.BLOCK,
            "Block of a simulation whose motion is compared; for several simulations once for all, or once"
            " for each in their order [default: the only block with a motion].",
        ),
    ]


class Judging(TypedDict, total=False):
    """What is judged log by log."""

    tolerance: Annotated[
        Quantity | Mapping[str, Quantity],
        _judging(
            kinds.TOLERANCE,
            "Largest allowed deviation on each axis, such as 3.5mm, or per kind, such as"
            " axis=3.5mm,norm=5mm,angle=0.5deg. Kinds: axis, x, y, z, norm, path (m, mm, um), angle, joint"
            " (rad, mrad, deg; m for prismatic joints). A number alone is in m or rad; lengths from 0.02 and"
            " angles above 0.2 need their unit. The given kinds replace the default: other kinds are not"
            " judged. Minimum shares, these if not given: coverage=90% of the reference that the log shows,"
            " judged=50% of the log's motion that is compared.",
            default="3.5mm",
            decides=True,
        ),
    ]
    keep_going: Annotated[
        bool,
        _judging(
            kinds.FLAG,
            "If a log cannot be judged, judge the others, write the outputs, and exit with code 2.",
            default=False,
        ),
    ]
    sync: Annotated[
        Quantity | None,
        Param(
            kinds.SYNC,
            f"{SYNC_HELP}stamps if both sides have them and overlap, else start].",
            heading=Heading.ALIGNING,
            decides=True,
        ),
    ]


class Baseline(TypedDict, total=False):
    """An earlier comparison."""

    baseline: Annotated[
        "PathLike | Comparison | None",
        Param(
            kinds.BASELINE,
            "Report changes since an earlier comparison or test (.rrd); exit code 1 if worse.",
            heading=Heading.BASELINE,
            each_call=True,
        ),
    ]
    noise: Annotated[
        Quantity | Mapping[str, Quantity] | None,
        Param(
            kinds.NOISE,
            "Ignore smaller changes since the baseline; written like --tolerance [default: 1um, 1e-6 rad].",
            heading=Heading.BASELINE,
        ),
    ]


class Verdicts(Inputs, Progress, total=False):
    """What is written of a verdict."""

    output: Annotated[
        PathLike | None,
        _output(kinds.RECORDING, "Recording to write [default: LOG-against-REFERENCE.rrd].", names=("-o",)),
    ]
    junit: Annotated[
        PathLike | None,
        _output(
            kinds.file("FILE.xml", ".xml"),
            "Write the verdicts as JUnit XML for GitLab, Jenkins and GitHub.",
        ),
    ]
    csv: Annotated[
        PathLike | None,
        _output(
            kinds.TABLE_FILE,
            "Write the statistics as a table, one row per log and quantity; of a test one per criterion and"
            " place.",
        ),
    ]
    defaults: Annotated[
        Sequence[str],
        Param(
            kinds.DEFAULTS,
            'Options that a file set, for the line of the verdict: "sync=auto from ../urmpipe.toml".',
            default=(),
            shell=False,
        ),
    ]


class Compare(Placing, Reading, Processing, Judging, Compared, Baseline, Strict, Verdicts, total=False):
    """The parameters of `compare`."""

    align: Annotated[
        Literal["none", "start", "rigid", "tool", "base+tool"],
        Param(
            kinds.one_of("none", "start", "rigid", "tool", "base+tool"),
            "Align the log first: start pose, best rigid motion, best tool offset, or best base and tool"
            " together (for an external measuring device).",
            default="none",
            heading=Heading.ALIGNING,
            decides=True,
        ),
    ]


class Diagnose(Placing, Reading, Processing, Judging, Compared, Baseline, Strict, Verdicts, total=False):
    """The parameters of `diagnose`: those of `compare`, without alignment, as base and tool are causes."""


class Iso(Placing, Reading, Processing, Compared, Baseline, Strict, Verdicts, total=False):
    """The parameters of `iso`."""

    tolerance: Annotated[
        str | Mapping[str, Quantity] | None,
        _judging(
            kinds.CRITERIA,
            "Criteria that are judged, such as AP=0.4mm,RP=0.1mm,AT=1mm,AV=5% [default: none].",
            decides=True,
        ),
    ]
    sync: Annotated[
        Quantity,
        Param(
            kinds.SYNC,
            "Align the clocks of each cycle: by the motion (auto), at the first samples (start), or by an"
            " offset such as 200ms: t_reference = t_log + TIME.",
            default="auto",
            heading=Heading.ALIGNING,
            decides=True,
        ),
    ]
    cycles: Annotated[
        str | Sequence[tuple[int, int]] | None,
        _iso(kinds.CYCLES, "Rows of each cycle of one log, from 1 [default: from each return to the start]."),
    ]
    planes: Annotated[
        int | str, _iso(kinds.POSITIVE_COUNT, "Number of planes that cut the command path.", default=50)
    ]
    band: Annotated[
        Quantity, _iso(kinds.DEVIATION, "Half width of the band around a final pose.", default="0.1mm")
    ]
    targets: Annotated[
        "TargetsLike | None",
        _iso(
            kinds.TARGETS._replace(metavar="FILE.csv"),
            "Poses to judge, one per row: x, y, z and optionally an orientation [default: the poses at which"
            " REFERENCE rests].",
        ),
    ]


LOG_PARAMETERS = tuple(
    params_of(Reading, Processing)
)  # a recording is a run already: they do not apply to it
