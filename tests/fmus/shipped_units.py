"""The units that are shipped, by name, with options that they are made with."""

from __future__ import annotations

from typing import Any

import numpy as np

from made_masses import with_drives, with_masses
from sliding_arm import sliding_arm, sprung_arm
from urmpipe_fmus.block import Table
from urmpipe_models.robots.catalogue import load_robot

ROWS = np.random.default_rng(1).uniform(-3.0, 3.0, (30, 3))
TABLE = Table(np.arange(30) * 7_000_000, ROWS)  # between the steps
COLUMNS = [["q", "rad", 2], ["d", "m"]]
URM6 = with_drives(with_masses(load_robot("urm6")))  # in importers/ a log is run over native FMUs of it, too

UNITS: dict[str, tuple[str, dict[str, Any]]] = {
    "a URM arm with rates": ("kinematic_chain", {"robot": load_robot("urm6"), "rates": True}),
    "a UR arm with rates": ("kinematic_chain", {"robot": load_robot("ur5e"), "rates": True}),
    "sliding joints": (
        "kinematic_chain",
        {"robot": sliding_arm(), "rates": True, "sensors": ["p1", "p3", "p5"], "points": ["p2", "p5"]},
    ),
    "six joints": ("repolarizer", {"joints": 6}),
    "a deviation": ("delta_meter", {}),
    "a held log": ("log_source", {"table": TABLE, "columns": COLUMNS}),
    "an interpolated log": ("log_source", {"table": TABLE, "columns": COLUMNS, "interpolate": True}),
    "a drive": ("dc_drive", {}),
    "a load": ("inertia", {}),
    "a controller": ("drive_controller", {}),
    "a set point": ("set_point", {}),
    "a network": ("network_motion", {"network": "rccc", "points": ["c3.body:0,0.1,0"]}),
    "sliding joints with masses": ("chain_dynamics", {"robot": sprung_arm()}),
    "a URM arm with drives": ("driven_arm", {"robot": URM6}),
    "driven, relieved and held sliding joints": ("driven_arm", {"robot": sprung_arm()}),
}
