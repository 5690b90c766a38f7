"""What `urmpipe network list` prints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from urmpipe.printing.terminal import new_console, new_table
from urmpipe_models.networks.file import Network


def networks_dict(networks: Sequence[Network]) -> dict[str, Any]:
    """Return the object that `urmpipe network list --json` prints."""
    listed = [
        {
            "name": one.name,
            "bodies": len(one.body_names),
            "joints": len(one.joints),
            "elements": len(one.elements),
            "controls": [control.name for control in one.controls],
            "description": one.description,
            "source": one.source,
        }
        for one in networks
    ]
    return {"schema": 1, "networks": listed}


def print_networks(networks: Sequence[Network]) -> None:
    """Print the networks."""
    heads = ("Name", "Bodies", "Joints", "Elements", "Controls", "Description")
    table = new_table(*heads, title=f"{len(networks)} networks")
    for one in networks:
        counts = (len(one.body_names), len(one.joints), len(one.elements))
        controls = ", ".join(control.name for control in one.controls)
        table.add_row(one.name, *map(str, counts), controls, one.description)
    new_console().print(table)
