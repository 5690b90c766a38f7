"""What a command does to its own process."""

from __future__ import annotations

import subprocess
import sys


def said(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=100
    )
    return done.stdout


def test_pyarrow_does_not_import_pandas_and_pandas_can_still_be_imported() -> None:
    code = (
        "import sys; from urmpipe.process import tune_pyarrow; tune_pyarrow();"
        "import pyarrow; pyarrow.array(['a']); print('pandas' in sys.modules);"
        "import pandas; print(pandas.DataFrame({'a': [1]}).shape)"
    )
    assert said(code) == "False\n(1, 1)\n"


def test_pyarrow_leaves_a_core_however_often_it_is_tuned() -> None:
    code = (
        "import os, pyarrow; from urmpipe.process import tune_pyarrow; before = pyarrow.cpu_count();"
        "tune_pyarrow(); tune_pyarrow();"
        "print(pyarrow.cpu_count() == min(before, max(1, os.cpu_count() - 1)))"
    )
    assert said(code) == "True\n"


def test_importing_urmpipe_tunes_nothing() -> None:
    code = (
        "import gc, sys; before = gc.get_threshold(), sys.getswitchinterval();"
        "import urmpipe; urmpipe.ingest; import urmpipe.main;"
        "print((gc.get_threshold(), sys.getswitchinterval()) == before)"
    )
    assert said(code) == "True\n"
