"""A parameter: its kind, its help and its default, declared once as metadata of a typed dictionary's field.

    class Processing(TypedDict, total=False):
        tsp: Annotated[float | str | None, Param(kinds.SECONDS, "Sample period of the time grid.")]

The name of the field is the option (`--tsp`), the keyword (`tsp=`) and the key of urmpipe.toml. Its `Kind`
reads a text of the shell, a value of TOML and a value of Python, and reads what it returned again as it is.
`read_parameters` reads many, and raises one error with all faults.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from urmpipe_models.errors import Finding


class Heading(StrEnum):
    """The headings of options, in the order of every help page."""

    ROBOT = "Robot"
    PLANNING = "Planning"
    SOLVING = "Solving"
    RUNNING = "Running"
    JUDGING = "Judging"
    ALIGNING = "Aligning"
    COMPARED = "Compared motions"
    ISO = "Test after ISO 9283"
    BASELINE = "Baseline"
    READING = "Reading files"
    PROCESSING = "Processing"
    OUTPUT = "Output"
    GENERAL = "General"


class Kind(NamedTuple):
    """What the values of a parameter are.

    Attributes:
        metavar: The value in the help; empty for a flag.
        allowed: The values allowed, for the message about any other.
        read: Returns the value; raises a ValueError or TypeError, or an `OptionError` with a message of its
            own.
        complete: The completion of a value in the shell.
        repeats: Whether the option may be given several times; `read` also takes a list of their texts.
        is_file: Whether a text may name a file, which urmpipe.toml names from its own folder.
        typed: The values allowed in a shell and in urmpipe.toml, where Python has others.
    """

    metavar: str
    allowed: str
    read: Callable[[Any], Any]
    complete: Callable[..., Any] | None = None
    repeats: bool = False
    is_file: bool = False
    typed: str = ""

    def find_faults(
        self, name: str, value: Any, error: Exception, *, typed: bool = False
    ) -> Iterator[Finding]:
        """Yield the faults of a value that `read` refused with an error; if typed, in a shell or a file."""
        from urmpipe_models.errors import Finding, UrmpipeError, format_value

        if isinstance(error, UrmpipeError):
            yield from (replace(finding, parameter=name) for finding in error.findings)
        else:
            yield Finding(
                parameter=name, found=format_value(value), allowed=(typed and self.typed) or self.allowed
            )


class Param(NamedTuple):
    """A parameter.

    Attributes:
        kind: The kind of its values.
        help: Its effect, for the help of the command.
        default: Its default, as the user would give it; None if there is none, or it is found from the input.
        heading: Where its option is listed.
        names: Further names of the option.
        each_call: Whether it is about a single call, so that no urmpipe.toml sets it.
        decides: Whether it may change a verdict: the verdict's line names the file that sets it.
        required: Whether the option must be given.
        python: Whether it is a keyword of the function.
        shell: Whether it is an option of the command.
    """

    kind: Kind
    help: str
    default: Any = None
    heading: Heading = Heading.GENERAL
    names: tuple[str, ...] = ()
    each_call: bool = False
    decides: bool = False
    required: bool = False
    python: bool = True
    shell: bool = True


def params_of(*groups: type) -> dict[str, Param]:
    """Return the parameters that typed dictionaries declare, by name, in their order."""
    return {
        name: annotation.__metadata__[0]
        for group in groups
        for name, annotation in group.__annotations__.items()
    }


def read_parameters(params: Mapping[str, Param], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of all parameters: those that are given as their kinds read them, else the defaults.

    Args:
        params: The parameters by name.
        values: The given values by name; None where None is the default.

    Raises:
        OptionError: With the faults of all values.
    """
    from urmpipe_models.errors import OptionError

    result: dict[str, Any] = {}
    faults: list[Finding] = []
    for name, param in params.items():
        value = values.get(name, param.default)
        if value is None and param.default is None:
            result[name] = None
            continue
        try:
            result[name] = param.kind.read(value)
        except (ValueError, TypeError, OptionError) as error:
            faults += param.kind.find_faults(name, value, error)
    if faults:
        raise OptionError(*faults)
    return result
