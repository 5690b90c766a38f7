"""`urmpipe.equations`: the equations of motion of an arm as formulas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack, cast

from urmpipe.arm_placing import Robot, place_robot
from urmpipe.parameters import kinds
from urmpipe.parameters.outputs import Equations as EquationsParameters
from urmpipe.parameters.param import params_of
from urmpipe.parameters.shared import Placing
from urmpipe.public_functions import public_function
from urmpipe_models.arm.chain import Chain
from urmpipe_models.display import Displayable, format_count, format_headline
from urmpipe_models.errors import Finding, OptionError
from urmpipe_models.files import write_export
from urmpipe_models.lagrange.derivation import TERMS
from urmpipe_models.lagrange.formulas import (
    Cost,
    Operations,
    c_code,
    equations_text,
    open_form,
    sum_operations,
)

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Equations(Displayable):
    """The equations of motion of an arm.

    Attributes:
        robot: The arm.
        text: The formulas, as text or C.
        terms: What each term of each coordinate costs: `joint`, `term`, `operations` and `reduced`, each with
            its `additions` and `multiplications`.
        output: The file that was written, if any.
    """

    robot: Chain
    text: str
    terms: tuple[Cost, ...]
    output: Path | None = None

    @property
    def operations(self) -> Operations:
        """What all of it costs as expanded sums."""
        return sum_operations(cost.operations for cost in self.terms)

    @property
    def reduced(self) -> Operations:
        """What all of it costs as C computes it."""
        return sum_operations(cost.reduced for cost in self.terms)

    def _headline(self) -> str:
        """Return the arm, its coordinates, and what the formulas cost."""
        return format_headline(
            self.robot.name, format_count(len(self.robot.coordinates), "coordinate"), str(self.reduced)
        )

    def to_frame(self) -> pd.DataFrame:
        """Return one row per coordinate and term: names, and operations before and after reduction."""
        import pandas as pd

        columns = ("joint", "term", "additions", "multiplications")
        reduced = ("reduced_additions", "reduced_multiplications")
        rows = [(cost.joint, cost.term, *cost.operations, *cost.reduced) for cost in self.terms]
        return pd.DataFrame(rows, columns=[*columns, *reduced])

    def to_dict(self) -> dict[str, Any]:
        """Return the object that `urmpipe robot equations --json` prints."""
        terms = [
            {
                "joint": cost.joint, "term": cost.term,
                "operations": cost.operations._asdict(), "reduced": cost.reduced._asdict(),
            }
            for cost in self.terms
        ]  # fmt: skip
        return {
            "schema": 1,
            "robot": self.robot.name,
            "coordinates": list(self.robot.coordinates),
            "terms": terms,
            "output": None if self.output is None else str(self.output),
        }


@public_function(EquationsParameters, robot=kinds.ROBOT)
def equations(robot: Robot, **options: Unpack[EquationsParameters]) -> Equations:
    """Derive the equations of motion of an arm of up to 4 coordinates as formulas. See docs/dynamics.md.

    Args:
        robot: The arm, with masses.
        **options: The place of the arm, `form` (text: a line per term; c: functions in C99), `term`, and
            `output`, a file to write, which replaces only another export of a robot: the options of `urmpipe
            robot equations`, by their names.

    Raises:
        UrmpipeError: With all faults of the arm, such as no masses or too many coordinates; if SymPy
            (extra `planning`) is not installed; if the output may not be written.

    Source: [Iso9283]_ eq. 8-13, section 4.
    """
    values: Mapping[str, Any] = options  # as their kinds read them
    output, term = values["output"], values["term"]
    is_c = output is not None and output.suffix == ".c"
    form = values["form"] or ("c" if is_c else "text")
    if is_c and form == "text":
        raise OptionError(Finding(parameter="form", found=f"text for {output}", allowed="c, or another name"))
    placing = {name: values[name] for name in params_of(Placing)}
    chain = cast("Chain", place_robot(robot, **placing))
    formulas = open_form(chain, TERMS if term == "all" else (term,))
    text = c_code(formulas) if form == "c" else equations_text(formulas)
    if output is not None:
        write_export(output, text, Path(chain.name if isinstance(robot, Chain) else robot))
    return Equations(chain, text, formulas.costs, output)
