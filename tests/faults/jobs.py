"""The commands that write something, each with short inputs, and how to tell that what it wrote is whole."""

from __future__ import annotations

import csv
import zipfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import urmpipe
from urmpipe_datasets import LOGS

ROWS = 200
"""Rows of the logs: a second of motion."""


@dataclass(frozen=True)
class Job:
    """A command that writes.

    Attributes:
        name: What it is called.
        line: What follows `urmpipe`, outputs by their names.
        outputs: The names of what it writes.
    """

    name: str
    line: str
    outputs: tuple[str, ...]


JOBS = (
    Job("ingest", "ingest log.csv --robot urm6 -o run.rrd --audit audit.csv --write-map map.toml",
        ("run.rrd", "audit.csv", "map.toml")),
    Job("compare",
        "compare path.csv log.csv --robot urm6 --unit x=m -o all.rrd --junit all.xml --csv all.csv",
        ("all.rrd", "all.xml", "all.csv")),
    Job("report", "report in.rrd -o page.html", ("page.html",)),
    Job("export csv", "export in.rrd -o table.csv", ("table.csv",)),
    Job("export parquet", "export in.rrd -o table.parquet", ("table.parquet",)),
    Job("export mat", "export in.rrd -o table.mat", ("table.mat",)),
    Job("export tum", "export in.rrd -o poses.tum", ("poses.tum",)),
    Job("ik", "ik path.csv --robot urm6 --unit x=m -o joints.csv", ("joints.csv",)),
    Job("plan", "plan cube:wall,a=0.6,r=0.03,x=1.7,y=0,z=1 --robot irb60 -o plan.csv", ("plan.csv",)),
    Job("network", "network solve four-bar --draw graph.svg -o net.rrd", ("graph.svg", "net.rrd")),
    Job("simulate",
        "simulate log-to-delta --set log=log.csv --set reference=path.csv -o sim.rrd --draw sim.svg",
        ("sim.rrd", "sim.svg")),
    Job("fmu build", "fmu build repolarizer -s joints=6 --backend python -o joints.fmu", ("joints.fmu",)),
    Job("robot export", "robot export urm6 -o arm.urdf", ("arm.urdf",)),
)  # fmt: skip
"""Every command that writes, with all that it can write."""


def write_inputs(folder: Path) -> None:
    """Write the inputs of all jobs."""
    for name, source in (("log.csv", "matlab.csv"), ("path.csv", "path.csv")):
        lines = (LOGS / source).read_text(encoding="utf-8").splitlines()[: ROWS + 1]
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    urmpipe.ingest(folder / "log.csv", robot="urm6", output=folder / "in.rrd")


def check_whole(path: Path) -> None:
    """Raise an error if an output is not whole."""
    match path.suffix:
        case ".rrd":
            urmpipe.read_recording(path)
        case ".xml" | ".svg" | ".urdf":
            ET.parse(path)
        case ".fmu":
            assert zipfile.ZipFile(path).testzip() is None
        case ".html":
            assert path.read_bytes().rstrip().endswith(b"</html>")
        case ".mat":
            from scipy.io import loadmat

            loadmat(path)
        case ".parquet":
            from pyarrow import parquet

            parquet.read_table(path)
        case ".toml":
            urmpipe.read_map(path)
        case _:
            separator = " " if path.suffix == ".tum" else ","
            rows = list(csv.reader(path.read_text().splitlines(), delimiter=separator))
            assert path.read_bytes().endswith(b"\n")
            assert len({len(row) for row in rows if row and not row[0].startswith("#")}) == 1
