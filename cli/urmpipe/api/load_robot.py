"""`urmpipe.load_robot`: an arm by its name, or from a file."""

from __future__ import annotations

from urmpipe.parameters import kinds
from urmpipe.public_functions import PathLike, public_function
from urmpipe_models.arm.chain import Chain
from urmpipe_models.robots import catalogue


@public_function(name_or_path=kinds.ROBOT_FILE, base_link=kinds.LINK, tip_link=kinds.LINK)
def load_robot(name_or_path: PathLike, *, base_link: str | None = None, tip_link: str | None = None) -> Chain:
    """Return a robot of the catalogue, or of a .toml or .urdf file.

    Args:
        name_or_path: The robot's name, or its file.
        base_link: Link of a URDF where the chain begins; default: its root.
        tip_link: Link of a URDF where the chain ends; default: its only leaf, or the one with the
            most moving joints on its way.

    Raises:
        RobotError: If there is no such robot, or with everything that is wrong with its file.
        OptionError: If links are chosen of a robot that is no URDF.
    """
    return catalogue.load_robot(name_or_path, base_link=base_link, tip_link=tip_link)
