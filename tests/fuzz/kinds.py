"""The kinds of files: what is changed in each, and what is called with it."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

from tests.fuzz import corpus
from tests.fuzz.archive_mutators import XML, ZIP, within
from tests.fuzz.byte_mutators import BYTES, Mutator
from tests.fuzz.corpus import Specimen, texts
from tests.fuzz.text_mutators import TEXT
from tests.fuzz.tree_mutators import json_tree, toml

TREES = (*BYTES, *TEXT, *[toml] * 40)


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        name: What it is called.
        specimens: Returns what is changed, of the folder of what was made.
        mutators: How.
        read: Does with a file what the commands that take it do, and writes nothing; the folder of what was
            made is given, too.
        share: Of the inputs of `--inputs`, by what one takes; 0 for a kind that is read only by its name.
    """

    name: str
    specimens: Callable[[Path], Sequence[Specimen]]
    mutators: Sequence[Mutator]
    read: Callable[[Path, Path, Random], object]
    share: float


def told(result: Any) -> None:
    """Do what a command does with a result: its JSON, and its warnings as lines."""
    json.dumps(result.to_dict(), default=str)
    for one in result.warnings:
        str(one)


def log(path: Path, made: Path, rng: Random) -> None:
    import urmpipe

    way = rng.randrange(12)
    if way == 0:
        told(urmpipe.compare(made / "log.csv", path, robot="ur5"))
        return
    robot = None if way < 6 else rng.choice(("ur5", "urm6", "arm6", "panda"))
    told(
        urmpipe.ingest(
            path,
            robot=robot,
            skip_bad=way == 11,
            repair=way == 10,
            poses=way == 9,
            tsp=0.05 if way == 8 else None,
        )
    )


def robot(path: Path, made: Path, rng: Random) -> None:
    import numpy as np

    import urmpipe
    from urmpipe.printing.mechanisms import chain_at
    from urmpipe_models.robots.toml import robot_toml
    from urmpipe_models.robots.urdf_writer import urdf_text
    from urmpipe_pipeline.presentation.meshes import mesh_warnings
    from urmpipe_pipeline.runs.torques import mass_warnings
    from urmpipe_pipeline.solved_targets.solution_warnings import start_warnings

    tip = "tool0" if path.suffix == ".urdf" and b"tool0" in path.read_bytes() else None
    chain = urmpipe.load_robot(path, tip_link=tip)
    for one in (
        *mesh_warnings(chain),
        *start_warnings(chain, np.array(chain.start), "q"),
        *mass_warnings(chain),
    ):
        str(one)
    json.dumps(chain_at(chain, chain.start).to_dict(), default=str)
    robot_toml(chain)
    urdf_text(chain)


def mesh(path: Path, made: Path, rng: Random) -> None:
    import numpy as np

    import urmpipe
    from urmpipe_pipeline.presentation.meshes import mesh_warnings
    from urmpipe_pipeline.recording.views.shapes import bodies_over_log

    described = path.with_name("arm.urdf")
    described.write_text(corpus.URDF.replace("MESH", path.name), encoding="utf-8")
    chain = urmpipe.load_robot(described)
    mesh_warnings(chain)
    bodies_over_log(chain, np.array([chain.start]))


def log_map(path: Path, made: Path, rng: Random) -> None:
    import urmpipe

    found = urmpipe.read_map(path)
    told(urmpipe.ingest(made / "log.csv", map=found, robot=None if found.robot else "ur5"))


def system(path: Path, made: Path, rng: Random) -> None:
    """Put a system together and draw it; nothing of it runs."""
    from urmpipe.systems.blocks import Blocks
    from urmpipe.systems.result import check_meters
    from urmpipe_fmus.cosim import prepare, read_system, system_svg

    for name in ("coppeliasim.csv", "path.csv", "log.csv", "foreign.fmu"):
        link = path.with_name(name)
        link.unlink(missing_ok=True)
        link.symlink_to(made / (name if name == "foreign.fmu" else "log.csv"))
    loaded = read_system(path)
    blocks = Blocks(loaded, backend="python")
    plan = prepare(loaded, blocks.make, column=blocks.column, duration=blocks.end, period=blocks.period)
    check_meters(plan, blocks)
    system_svg(plan)


def network(path: Path, made: Path, rng: Random) -> None:
    import urmpipe

    loaded = urmpipe.load_network(path)
    if rng.random() < 0.5:
        told(urmpipe.network_check(loaded, restarts=1))


def defaults(path: Path, made: Path, rng: Random) -> None:
    """Begin a command where the file stands; none of their operands is there, so that nothing is done."""
    from urmpipe.main import cli

    name = rng.choice(("ingest", "compare", "ik", "plan", "accuracy", "export", "report", "diagnose"))
    before = {"compare": ["none.csv"], "diagnose": ["none.csv"], "accuracy": ["--path"]}
    words = [name, *before.get(name, []), "no.csv"]
    cli.main(words, prog_name="urmpipe", standalone_mode=False)


def targets(path: Path, made: Path, rng: Random) -> None:
    import urmpipe

    told(urmpipe.ik(path, robot="ur5e", restarts=1, every=rng.random() < 0.2))


def planned(path: Path, made: Path, rng: Random) -> None:
    import urmpipe

    told(urmpipe.plan(path, robot="ur5e" if rng.random() < 0.03 else None))


def recording(path: Path, made: Path, rng: Random) -> None:
    """Read a recording, and what report, export and compare make of it."""
    import urmpipe
    from urmpipe_models.errors import OptionError
    from urmpipe_pipeline import results

    found: Any = urmpipe.read_recording(path)
    told(found)
    results.present(found)
    try:
        results.exports(found)
    except OptionError:
        return
    if rng.random() < 0.2:
        urmpipe.compare(found, found)


@contextmanager
def forged(path: Path, made: Path) -> Iterator[Path]:
    """Let a recording have other metadata with a checksum that fits, its arrays as they were."""
    from urmpipe_pipeline.recording.layout import checksum
    from urmpipe_pipeline.recording.reader import Store

    name, _, text = path.read_text("utf-8", "replace").partition("\n")
    opened = Store.__init__

    def changed(store: Store, path: Path) -> None:
        opened(store, path)
        store.metadata, store.checksum = text, checksum(text)

    with patch.object(Store, "__init__", changed):
        yield made / Path(name.strip()).name


def metadata(path: Path, made: Path, rng: Random) -> None:
    """Read a recording with other metadata: every field is of its type, or it is refused."""
    import urmpipe

    with forged(path, made) as file:
        urmpipe.read_recording(file)


def forgery(path: Path, made: Path, rng: Random) -> None:
    """Read a recording with other metadata, and what is made of it, whatever the metadata tell."""
    with forged(path, made) as file:
        recording(file, made, rng)


def behind_name(*mutators: Mutator) -> list[Mutator]:
    """Return mutators that leave the first line as it is."""

    def keeping(mutator: Mutator) -> Mutator:
        def changed(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
            name, _, text = data.partition(b"\n")
            return name + b"\n" + mutator(text, rng, [one.partition(b"\n")[2] for one in others])

        return changed

    return [keeping(one) for one in mutators]


def fmu(path: Path, made: Path, rng: Random) -> None:
    """Check an FMU, and read what a system reads of it."""
    from urmpipe.printing.units import checked_dict
    from urmpipe_fmus.check import check_fmu
    from urmpipe_fmus.cosim.checks import read_interface

    if path.name.startswith("here"):
        read_interface(path)
    if path.name.startswith("away") or rng.random() < 0.02:
        json.dumps(checked_dict(check_fmu(path)), default=str)


KINDS: tuple[Kind, ...] = (
    Kind("log", lambda made: corpus.logs(), (*BYTES, *TEXT, *TEXT), log, 8.0),
    Kind("table", corpus.tables, (*BYTES, *ZIP), log, 1.0),
    Kind("robot", lambda made: corpus.robots(), TREES, robot, 6.0),
    Kind("urdf", corpus.urdfs, (*BYTES, *TEXT[:5], *XML, *XML, *XML), robot, 6.0),
    Kind("mesh", lambda made: corpus.meshes(), (*BYTES, *TEXT[:5], *[json_tree] * 8), mesh, 2.0),
    Kind("map", corpus.maps, TREES, log_map, 3.0),
    Kind("system", lambda made: corpus.systems(), TREES, system, 4.0),
    Kind("network", lambda made: corpus.networks(), TREES, network, 4.0),
    Kind("defaults", lambda made: texts({"urmpipe.toml": corpus.DEFAULTS}), TREES, defaults, 2.0),
    Kind("targets", lambda made: texts(corpus.TARGETS), (*BYTES, *TEXT, *TEXT), targets, 2.0),
    Kind("path", lambda made: texts(corpus.PATHS), (*BYTES, *TEXT, *TEXT), planned, 2.0),
    Kind("metadata", corpus.metadata, behind_name(*BYTES[:1], *[json_tree] * 20), metadata, 5.0),
    Kind("forgery", corpus.metadata, behind_name(*[json_tree] * 20), forgery, 0.0),
    Kind("recording", corpus.recordings, BYTES, recording, 0.4),
    Kind("fmu", lambda made: corpus.fmus(), (*BYTES, *ZIP), fmu, 3.0),
    Kind("description", lambda made: corpus.fmus(), [within("modelDescription.xml", XML)], fmu, 4.0),
)  # fmt: skip
"""Every kind, in the order of the table at the end."""

BY_NAME = {one.name: one for one in KINDS}


def warm() -> None:
    """Import what reads files, so that a worker is ready when it is forked."""
    import pandas  # noqa: F401
    import scipy.io  # noqa: F401

    import urmpipe
    import urmpipe.main
    import urmpipe_pipeline.results  # noqa: F401

    warnings.simplefilter("ignore")
    for name in (
        "ingest",
        "compare",
        "ik",
        "plan",
        "network_check",
        "simulate",
        "read_recording",
        "read_map",
    ):
        getattr(urmpipe, name)
