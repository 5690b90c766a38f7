"""Rerun is imported while a log is read: the reader must not import what Rerun imports too."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from urmpipe_datasets import LOGS

SHARED = Path(__file__).resolve().parents[4] / "shared" / "logs"

SPECIMENS = {
    "plain.csv": b"t,q1,q2\n0,1,2\n0.1,2,3\n0.2,1,2\n",
    "degrees.csv": "Zeit[sec];A1[°];A2[°]\n0,0;1,5;6\n0,1;1,5;7\n".encode("latin-1"),
    "wide.csv": "t;q1\n0;1,5\n0,1;2\n".encode("utf-16"),
    "marked.csv": b"\xef\xbb\xbf# t q1 q2\n0 1 2\n 0.1  3 4\n",
    "exact.csv": b"t,q1\n0.000000000000000000e+00,1\n5.000000000000000104e-03,2\n",
    "ros.csv": b"%time,field.header.seq,field.name0,field.position0\n1486559106139796569,1,a,0.5\n",
    "graph.csv": b"/g\nTime (s),a (deg),b (deg)\n0.0,+1.0e+00,Null\n0.05,0.0,0.0\n",
    "ragged.csv": b"t,q1\n0,1\n0.1,2,3\n",
    "text.csv": b"t,q1\n0,1\n0.1,two\n",
    "backwards.csv": b"t,q1\n0,1\n-1,2\n",
    "arrays.csv": b't,q\n0,"[ 1. 2.\n  3.]"\n0.1,"[ 1. 2.\n  3.]"\n',
    "unclosed.csv": b't,q\n0,"[ 1. 2.]"\n0.1,"[ 1. 2."\n0.2,"[ 1. 2.]"\n',
    "labels.txt": b"Time: 0.1 q values: [1, 2] Type: 0\nquality\nTime: 0.2 q values: [1, 3] Type: 0\n",
    "second.csv": b"t,q1\n0,1\n1,2\nt,q1\n0,1\n1,2\n",
    "dates.csv": b'timestamp,q1\n" 01/20/2021 10:11:32.332",1\n" 01/20/2021 10:11:32.532",2\n',
    "german.csv": b"Datum;Uhrzeit;A1\n20.01.2021;10:11:32,332;1\n20.01.2021;10:11:32,432;2\n",
    "coarse.csv": b"Time,q1\n" + b"".join(b"10:11:%02d,1\n" % (k // 4) for k in range(40)),
    "empty.csv": b"",
    "log.mat": b"MATLAB 5.0",
}

IMPORTS = """
import json, sys
from pathlib import Path
import urmpipe
from urmpipe.process import tune_pyarrow
from urmpipe_models.robots.catalogue import load_robot
from urmpipe_models.errors import UrmpipeError
from urmpipe_pipeline.operands import log_files
from urmpipe_pipeline.recording import identity
from urmpipe_pipeline.sources import read_log

if sys.argv[1] == "command":
    tune_pyarrow()
before = set(sys.modules)
if sys.argv[2] == "rerun":
    identity.load_rerun()
for log in sys.argv[3:]:
    for robot in (None, load_robot("urm6")):
        try:
            read_log(log_files(Path(log)), None, robot)
        except UrmpipeError:
            pass
print(json.dumps(sorted(set(sys.modules) - before)))
"""


def imported(*arguments: str) -> set[str]:
    """What a fresh Python imports for Rerun or for reading logs, once the program itself is there."""
    done = subprocess.run(
        [sys.executable, "-c", IMPORTS, *arguments], capture_output=True, text=True, check=True, timeout=300
    )
    return set(json.loads(done.stdout))


SENT = """
import json, sys, threading
import urmpipe
from urmpipe.process import tune_pyarrow

tune_pyarrow()
threads = []

class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if threading.current_thread() is not threading.main_thread():
            threads.append(name)

sys.meta_path.insert(0, Finder)
urmpipe.ingest(sys.argv[1], robot="urm6", output=sys.argv[2])
print(json.dumps([name for name in threads if name in sys.modules]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("process", ["command", "python"])
def test_reading_a_log_imports_nothing_that_rerun_imports_too(process: str, tmp_path: Path) -> None:
    for name, content in SPECIMENS.items():
        (tmp_path / name).write_bytes(content)
    logs = [*tmp_path.iterdir(), *LOGS.iterdir(), *SHARED.glob("*/*")]
    for_rerun = imported(process, "rerun")
    for_logs = imported(process, "logs", *map(str, logs))
    assert {"rerun", "rerun.blueprint", "rerun.chunk"} <= for_rerun
    assert not for_rerun & for_logs
    assert not {name for name in for_logs if name.startswith(("rerun", "pandas", "numpy"))}


@pytest.mark.slow
@pytest.mark.parametrize("log", ["coppeliasim.csv", "matlab.csv"])
def test_a_thread_beside_imports_rerun_and_nothing_else(log: str, tmp_path: Path) -> None:
    """What is sent while the kinematics are computed (SciPy is imported for some) imports nothing."""
    done = subprocess.run(
        [sys.executable, "-c", SENT, str(LOGS / log), str(tmp_path / "run.rrd")],
        capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    beside = set(json.loads(done.stdout))
    assert {"rerun", "rerun.chunk"} <= beside
    assert beside <= imported("command", "rerun")
