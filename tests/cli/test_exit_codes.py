"""The exit code of every command, of the installed program: 0 done or pass, 1 fail, 2 bad input or usage."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import click
import numpy as np
import pytest

from command_contexts import EVERY
from flat_arm import lay_flat_arm
from repeated import along, written
from urmpipe.main import run
from urmpipe_datasets import LOGS, NETWORKS

CODES = """
0 ingest log.csv --robot urm6
2 ingest missing.csv
2 ingest log.csv --tsp never
0 compare path.csv log.csv --robot urm6
1 compare path.csv log.csv --robot urm6 --tolerance 1um
2 compare path.csv missing.csv
2 compare path.csv log.csv missing.csv --robot urm6 --keep-going
2 compare path.csv log.csv missing.csv --robot urm6 --keep-going --tolerance 1um
1 compare path.csv log.csv --robot urm6 --tolerance 1um -q
0 iso square.csv cycles.csv
0 iso square.csv cycles.csv --tolerance AP=1mm
1 iso square.csv cycles.csv --tolerance AP=1um
2 iso square.csv
2 iso square.csv cycles.csv --tolerance axis=1mm
0 diagnose path.csv log.csv --robot urm6
1 diagnose path.csv log.csv --robot urm6 --tolerance 1um
1 diagnose path.csv log.csv log.csv --robot urm6 --tolerance 1um --json
2 diagnose path.csv log.csv
0 report run.rrd
2 report missing.rrd
2 view missing.rrd
0 export run.rrd -o out.parquet
2 export missing.rrd
0 robot list
0 robot show urm6
2 robot show urm66
0 robot export urm6
2 robot export urm6 -o urm6.txt
0 robot equations rod.toml
2 robot equations urm6
0 ik targets.csv --robot ur5e
1 ik far.csv --robot ur5e
2 ik targets.csv
0 plan cube:wall,a=0.02,r=0.001,x=1.7,y=0,z=1 --robot irb60
1 plan across.csv --robot ur5e
2 plan missing.csv
0 accuracy --path short.csv --robot arm.toml --velocities 0.05 --backend python
1 accuracy --path short.csv --robot arm.toml --velocities 0.05 --backend python --limit 1um
2 accuracy --path short.csv --robot ur5e
0 network list
0 network check four-bar
1 network check open.toml --restarts 50
2 network check missing.toml
0 network solve four-bar
1 network solve open.toml --restarts 50
2 network solve missing.toml
0 network drive four-bar crank=0:90deg --steps 9
1 network drive four-bar theta4=85deg:160deg --steps 50
2 network drive four-bar nothing=0:1
0 fmu list
2 fmu list nothing
0 fmu build dc_drive --backend python
2 fmu build nothing
0 fmu check dc_drive.fmu
1 fmu check broken.fmu
2 fmu check missing.fmu
0 simulate --list
0 simulate near.toml
1 simulate off.toml
2 simulate
2 simulate nothing
0 demo
2 igest log.csv
2 log.csv
0 --help
0 ingest -h
"""
CASES = [(int(line[0]), line[2:]) for line in CODES.split("\n") if line]

METER = """
[system]
duration = 0.1
[blocks.m]
unit = "delta_meter"
start = {{ tolerance = 0.001, reference = 0.0, actual = {} }}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of all lines."""
    folder = tmp_path_factory.mktemp("codes")
    for name, source in (("log", "matlab"), ("path", "path")):
        head = (LOGS / f"{source}.csv").read_text(encoding="utf-8").splitlines()[:121]
        (folder / f"{name}.csv").write_text("\n".join(head) + "\n", encoding="utf-8")
    square = along([(0.3, 0.1, 0.2), (0.4, 0.1, 0.2), (0.4, 0.2, 0.2), (0.3, 0.1, 0.2)], 0.2)
    written(folder / "square.csv", square)
    written(folder / "cycles.csv", np.vstack([square + 1e-4, square + 2e-4]))
    lay_flat_arm(folder)
    texts = {
        "rod.toml": 'kind = "joints"\njoints = [{ name = "a" }]\ninertials = [{ joint = "a", mass = 1 }]\n',
        "targets.csv": "x,y,z\n0.3,0.1,0.4\n",
        "far.csv": "x,y,z\n3,0,0\n",
        # Rows on either side of the column of ur5e.
        "across.csv": "x,y,z,rz,ry,rx\n0.3,0.3,0.3,0,0,3.141593\n-0.3,-0.3,0.3,0,0,3.141593\n",
        "open.toml": (NETWORKS / "bennett.toml").read_text(encoding="utf-8").replace("a = 0.4", "a = 0.42"),
        "near.toml": METER.format(0.0005),
        "off.toml": METER.format(0.003),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run(["ingest", "log.csv", "--robot", "urm6", "-q", "-o", "run.rrd"]) == 0
        assert run(["fmu", "build", "dc_drive", "--backend", "python", "-q"]) == 0
    built, broken = (folder / f"{name}.fmu" for name in ("dc_drive", "broken"))
    with zipfile.ZipFile(built) as good, zipfile.ZipFile(broken, "w") as target:
        for name in good.namelist():
            content = good.read(name)
            is_description = name == "modelDescription.xml"
            target.writestr(
                name, content.replace(b'unit="V"', b'unit="ell"', 1) if is_description else content
            )
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(("code", "line"), CASES)
def test_the_installed_program_exits_with_this_code(code: int, line: str, folder: Path) -> None:
    program = str(Path(sys.executable).with_name("urmpipe"))
    done = subprocess.run([program, *line.split()], cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, "an error in urmpipe" in done.stderr) == (code, False), done.stderr


@pytest.mark.parametrize("context", EVERY, ids=lambda one: one.command_path)
def test_every_command_has_its_codes(context: click.Context) -> None:
    words = context.command_path.removeprefix("urmpipe ")
    codes = {code for code, line in CASES if line.startswith(words)}
    says_fail = "1 " in (context.command.help or "").partition("Exit codes:")[2]
    assert codes and codes >= ({0, 1, 2} if says_fail else set())
