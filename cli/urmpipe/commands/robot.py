"""`urmpipe robot list|show|export|equations`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from urmpipe.options.output import Terminal, output_option, output_options
from urmpipe.options.reading import placing_options
from urmpipe.options.types import DRAWING, JOINT_VALUES, ROBOT, OneOf
from urmpipe.usage import Group

if TYPE_CHECKING:
    from urmpipe_models.arm.chain import Chain


@click.group(cls=Group, short_help="List, show and export robots.")
def robot() -> None:
    """List, show and export robots: built-in ones, and your own files.

    A robot is a name of `urmpipe robot list`, a URDF, or a TOML file of URM modules, DH parameters or
    frames; docs/robots.md lists its keys.
    """


@robot.command("list", short_help="List the built-in robots.")
@output_options
def list_(terminal: Terminal) -> int:
    """List the built-in robots.

    \b
    Examples:
      urmpipe robot list
      urmpipe robot list --json
    """
    from urmpipe.printing.mechanisms import print_robots, robots_dict
    from urmpipe_models.robots.catalogue import load_robot, robot_names

    robots = [load_robot(name) for name in robot_names()]
    terminal.answer(lambda: robots_dict(robots), lambda: print_robots(robots))
    return 0


@robot.command(short_help="Print the parameters of a robot, or draw it.")
@click.argument("name", metavar="NAME|FILE", type=ROBOT)
@click.option(
    "--q",
    type=JOINT_VALUES,
    help="Joint values in rad and m, or with units, such as 0,90deg,500mm [default: the start pose].",
)
@click.option("--picture", metavar="FILE.svg", type=DRAWING, help="Draw the robot.")
@placing_options
@output_options
def show(
    name: str,
    q: tuple[str, ...] | None,
    picture: Path | None,
    terminal: Terminal,
    **placing: Any,
) -> int:
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

    chain = _placed(name, placing)
    values = joint_values(chain, chain.start if q is None else q, "q")
    terminal.warn([*start_warnings(chain, values, "q"), *mass_warnings(chain)])
    posed = chain_at(chain, values.tolist())
    if picture is not None:
        masses = chain_masses(chain, values)
        sketch = Sketch([posed.skeleton], spots=label_skeleton(posed.skeleton), masses=masses)
        write_export(
            picture, draw_projections(sketch, (SIDEWAYS, FRONT), posed.title, EXPORT_MARK), Path(name)
        )
    terminal.answer(posed.to_dict, lambda: print_chain(posed))
    return 0


@robot.command(short_help="Write a robot as URDF or TOML.")
@click.argument("name", metavar="NAME|FILE", type=ROBOT)
@output_option("FILE", "File to write, .urdf or .toml [default: NAME.urdf].")
@placing_options
@output_options
def export(name: str, output: Path | None, terminal: Terminal, **placing: Any) -> int:
    """Write a robot as URDF (with its visuals, else solids from its geometry) or as a TOML robot file.

    Reading the file back gives the same arm: exactly from TOML, to rounding from URDF. The command replaces
    earlier exports only.

    \b
    Examples:
      urmpipe robot export urm6
      urmpipe robot export ur5e --tool 0,0,0.15 -o ur5e-gripper.urdf
      urmpipe robot export urm8 -o urm8.toml
    """
    from urmpipe.printing.terminal import say
    from urmpipe_models.errors import Finding, OptionError, format_value
    from urmpipe_models.files import write_export
    from urmpipe_models.robots.toml import robot_toml
    from urmpipe_models.robots.urdf_writer import urdf_text
    from urmpipe_pipeline.runs.torques import urdf_mass_warning

    target = output or Path(f"{Path(name).stem}.urdf")
    writers = {".urdf": urdf_text, ".toml": robot_toml}
    if target.suffix.lower() not in writers:
        allowed = "a name that ends in .urdf or .toml"
        raise OptionError(Finding(parameter="output", found=format_value(str(target)), allowed=allowed))
    chain = _placed(name, placing)
    write_export(target, writers[target.suffix.lower()](chain), Path(name))
    terminal.warn(urdf_mass_warning(chain) if target.suffix.lower() == ".urdf" else [])
    made = {"schema": 1, "robot": chain.name, "file": target}
    terminal.answer(lambda: made, lambda: say(f"Robot: {target}"))
    return 0


@robot.command(short_help="Write the equations of motion of a robot.")
@click.argument("name", metavar="NAME|FILE", type=ROBOT)
@output_option("FILE", "File to write [default: print the equations].")
@click.option(
    "--form",
    type=OneOf(["text", "c"]),
    help="Text, or C99 functions [default: c for a .c file, else text].",
)
@click.option(
    "--term",
    type=OneOf(["all", "inertia", "centrifugal", "coriolis", "gravity", "tool"]),
    default="all",
    show_default=True,
    help="Term of the equations.",
)
@placing_options
@output_options
def equations(name: str, terminal: Terminal, **options: Any) -> int:
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
    import urmpipe
    from urmpipe.printing.terminal import say

    with terminal.working(f"Deriving {name}"):
        result = urmpipe.equations(name, **options)

    def text() -> None:
        """Print the formulas, or where they are."""
        if result.output is None:
            click.echo(result.text, nl=False)
        else:
            say(f"Equations: {result.output}  ({result.reduced}; before reduction {result.operations})")

    terminal.answer(result.to_dict, text)
    return 0


def _placed(name: str, placing: Mapping[str, Any]) -> Chain:
    """Return a robot on its base, with its tool, and cut."""
    from urmpipe_models.robots.catalogue import load_robot

    robot = load_robot(name, base_link=placing["base_link"], tip_link=placing["tip_link"])
    return robot.placed(placing["base"], placing["tool"])
