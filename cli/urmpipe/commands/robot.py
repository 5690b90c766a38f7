"""List, show and export robots."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import urmpipe
from urmpipe.answers import Answer, Call, command
from urmpipe.command_line import Group, operand
from urmpipe.parameters import kinds
from urmpipe.parameters.outputs import Equations, ExportRobot, ShowRobot
from urmpipe_models.errors import Finding, OptionError, format_value

if TYPE_CHECKING:
    from urmpipe_models.arm.chain import Chain


@click.group(cls=Group, short_help="List, show and export robots.")
def robot() -> None:
    """List, show and export robots: built-in ones, and your own files.

    A robot is a name of `urmpipe robot list`, a URDF, or a TOML file of URM modules, DH parameters or
    frames; docs/robots.md lists its keys.
    """


@robot.add_command
@command(name="list", short_help="List the built-in robots.")
def list_(call: Call) -> Answer:
    """List the built-in robots.

    \b
    Examples:
      urmpipe robot list
      urmpipe robot list --json
    """
    from urmpipe.printing.mechanisms import print_robots, robots_dict
    from urmpipe_models.robots.catalogue import load_robot, robot_names

    robots = [load_robot(name) for name in robot_names()]
    return Answer(to_dict=lambda: robots_dict(robots), print_text=lambda: print_robots(robots))


@robot.add_command
@command(ShowRobot, short_help="Print the parameters of a robot, or draw it.")
@operand("name", kinds.ROBOT, metavar="NAME|FILE")
def show(call: Call, name: str, q: tuple[str, ...] | None, picture: Path | None, **placing: Any) -> Answer:
    """Print the parameters of a robot and the positions of its points; --picture draws it from two sides.

    The points p1..pn are the ends of its segments; the last one is the tool centre point (TCP). The picture
    also shows the centres of mass.

    \b
    Examples:
      urmpipe robot show urm6
      urmpipe robot show urm6 --q 0,3.14,0,3.14,0,0 --picture urm6.svg
      urmpipe robot show panda.urdf --tip panda_hand_tcp --json
    """
    from urmpipe.printing.mechanisms import chain_at, print_chain
    from urmpipe_models.files import EXPORT_MARK, write_export
    from urmpipe_pipeline.presentation.projections import (
        FRONT,
        SIDEWAYS,
        Sketch,
        chain_masses,
        draw_projections,
        label_skeleton,
    )
    from urmpipe_pipeline.runs.torques import mass_warnings
    from urmpipe_pipeline.solved_targets.request import joint_values
    from urmpipe_pipeline.solved_targets.solution_warnings import start_warnings

    chain = _load_placed(name, placing)
    values = joint_values(chain, chain.start if q is None else q, "q")
    posed = chain_at(chain, values.tolist())
    if picture is not None:
        masses = chain_masses(chain, values)
        sketch = Sketch([posed.skeleton], spots=label_skeleton(posed.skeleton), masses=masses)
        write_export(
            picture, draw_projections(sketch, (SIDEWAYS, FRONT), posed.title, EXPORT_MARK), Path(name)
        )
    warnings = [*start_warnings(chain, values, "q"), *mass_warnings(chain)]
    return Answer(warnings=warnings, to_dict=posed.to_dict, print_text=lambda: print_chain(posed))


@robot.add_command
@command(ExportRobot, short_help="Write a robot as URDF or TOML.")
@operand("name", kinds.ROBOT, metavar="NAME|FILE")
def export(call: Call, name: str, output: Path | None, **placing: Any) -> Answer:
    """Write a robot as URDF (with its visuals, else solids from its geometry) or as a TOML robot file.

    Reading the file back gives the same arm: exactly from TOML, to rounding from URDF. The command replaces
    earlier exports only.

    \b
    Examples:
      urmpipe robot export urm6
      urmpipe robot export ur5e --tool 0,0,0.15 -o ur5e-gripper.urdf
      urmpipe robot export urm8 -o urm8.toml
    """
    from urmpipe_models.files import write_export
    from urmpipe_models.robots.toml import robot_toml
    from urmpipe_models.robots.urdf_writer import urdf_text
    from urmpipe_pipeline.runs.torques import urdf_mass_warning

    target = output or Path(f"{Path(name).stem}.urdf")
    suffix = target.suffix.lower()
    writers = {".urdf": urdf_text, ".toml": robot_toml}
    if suffix not in writers:
        allowed = "a name that ends in .urdf or .toml"
        raise OptionError(Finding(parameter="output", found=format_value(str(target)), allowed=allowed))
    chain = _load_placed(name, placing)
    write_export(target, writers[suffix](chain), Path(name))
    return Answer(
        lines=[f"Robot: {target}"],
        warnings=urdf_mass_warning(chain) if suffix == ".urdf" else [],
        to_dict=lambda: {"schema": 1, "robot": chain.name, "file": target},
    )


@robot.add_command
@command(Equations, short_help="Write the equations of motion of a robot.")
@operand("name", kinds.ROBOT, metavar="NAME|FILE")
def equations(call: Call, name: str, **options: Any) -> Answer:
    """Write the equations of motion of a robot with masses and up to 4 coordinates as formulas.

    Lagrange's equations of the second kind, term by term, with their number of additions and
    multiplications before and after simplification. Needs SymPy: pip install "urmpipe[planning]". The
    command replaces earlier exports of a robot only.

    \b
    Examples:
      urmpipe robot equations my-arm.urdf
      urmpipe robot equations my-arm.urdf --term gravity
      urmpipe robot equations my-arm.urdf -o my_arm.c
    """
    with call.working(f"Deriving {name}"):
        result = urmpipe.equations(name, **options)
    if result.output is None:
        return Answer(to_dict=result.to_dict, print_text=lambda: click.echo(result.text, nl=False))
    cost = f"({result.reduced}; before reduction {result.operations})"
    return Answer(lines=[f"Equations: {result.output}  {cost}"], to_dict=result.to_dict)


def _load_placed(name: str, placing: Mapping[str, Any]) -> Chain:
    """Return a robot on its base, with its tool, and cut."""
    from urmpipe_models.robots.catalogue import load_robot

    robot = load_robot(name, base_link=placing["base_link"], tip_link=placing["tip_link"])
    return robot.placed(placing["base"], placing["tool"])
