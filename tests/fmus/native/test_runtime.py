"""The runtime in C: no warning, nothing that a sanitizer finds, and memory that stays flat."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from c_host import host, ran, script, write
from sliding_arm import sliding_arm
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.instance import Instance
from urmpipe_fmus.native import native_unavailable_reason, this_platform
from written_units import unit_of

HERE = Path(__file__).parent

SANITIZED = ["cc", "-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

WARNINGS = (
    "all extra pedantic conversion sign-conversion shadow strict-prototypes missing-prototypes"
    " old-style-definition cast-qual cast-align pointer-arith write-strings format=2 undef vla"
    " null-dereference bad-function-cast switch-enum switch-default error"
)

pytestmark = pytest.mark.skipif(
    native_unavailable_reason() is not None or shutil.which("cc") is None,
    reason=f"needs cc; {native_unavailable_reason()}",
)


UNITS = (
    *map(unit_of, ("oscillator", "player", "elementary")),
    make_block("kinematic_chain", robot=sliding_arm()),
)
"""Units with states and memories, a table, elementary functions, and an arm."""


def c_files(folder: Path) -> list[str]:
    return [str(one) for one in sorted((folder / "sources").glob("*.c"))]


@pytest.mark.slow
def test_the_sources_compile_without_a_warning(tmp_path: Path) -> None:
    for k, model in enumerate(UNITS):
        folder = tmp_path / model.name
        write(folder, model, [])
        # optimized, as some warnings come of it; but for model.c the sources are the same, with other sizes
        files = c_files(folder) if k < 2 else [str(folder / "sources" / "model.c")]
        flags = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", *(f"-W{one}" for one in WARNINGS.split())]
        done = subprocess.run(
            ["cc", *flags, "-c", *files], cwd=folder, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_sanitizers_find_nothing(tmp_path: Path) -> None:
    program = host(tmp_path, [*SANITIZED, "-ldl"])
    for model in UNITS:
        folder = tmp_path / model.name
        write(folder, model, [])
        library = folder / "unit.so"
        together = folder / "sources" / "together.c"  # as an FMU is compiled
        together.write_text("".join(f'#include "{one}"\n' for one in c_files(folder)))
        subprocess.run([*SANITIZED, "-shared", "-fPIC", "-o", str(library), str(together), "-lm"], check=True)
        wrong = "set 0 nan\nset 99999 1.0\nget 4000000000\nstep nan 1\nstep 1 -1\nstep 0 1e300\n"
        seen = ran([program, str(library)], folder, script(model, 100, 2) + wrong)
        assert sum(line == "state 0 1" for line in seen) == 10
        assert sum(line.startswith("log 3 unit") for line in seen) >= 5


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="needs LD_PRELOAD")
def test_the_tests_of_the_runtime_pass_with_sanitizers() -> None:
    """Strings, types and refusals that the host does not call: through FMPy, with the sanitizer in Python."""
    libraries = [  # that of C++ for the exceptions in the binaries of pythonfmu
        subprocess.run(["cc", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout
        for name in ("libasan.so", "libstdc++.so.6")
    ]
    if not all(Path(one.strip()).is_file() for one in libraries):
        pytest.skip("needs gcc's libasan.so, to be loaded before Python")
    tests = [str(HERE / name) for name in ("test_states.py", "calls.cases")]
    env = {
        **os.environ,
        "CC": " ".join(["env", "-u", "LD_PRELOAD", *SANITIZED]),  # the compiler itself runs without
        "LD_PRELOAD": " ".join(map(str.strip, libraries)),
        "ASAN_OPTIONS": "detect_leaks=0",  # Python's own; those of the runtime the host would show
    }
    command = [sys.executable, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider", *tests]
    done = subprocess.run(command, cwd=HERE.parents[2], env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    assert " passed" in done.stdout
    assert "skipped" not in done.stdout


FLAT = 128
"""kB that the heap may grow by while nothing is lost: the least block, of 32 bytes, lost in each of 10,000
instances is 320 kB."""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    ("name", "warm_up", "work"),
    [
        ("oscillator", "steps 10000 0.001", "steps 1000000 0.001"),
        ("oscillator", "instances 1000", "instances 10000"),
        ("player", "instances 1000", "instances 10000"),
    ],
)
def test_a_host_in_c_sees_what_python_sees_and_memory_is_flat(
    name: str, warm_up: str, work: str, tmp_path: Path, c_host: str
) -> None:
    model = unit_of(name)
    write(tmp_path, model, [this_platform()])
    (library,) = tmp_path.glob(f"binaries/*/{name}*")
    reals = [k for k, (_, one) in enumerate(model.scalars) if one.type == "Real"]
    lines = ["step 0 0.05", f"get {' '.join(map(str, reals))}", warm_up, "resident", work, "resident"]
    printed = ran([c_host, str(library)], tmp_path, "\n".join(lines) + "\n")
    instance = Instance(model)
    instance.do_step(0.0, 0.05)
    values = [struct.unpack(">d", bytes.fromhex(one))[0] for one in printed[1].split()[2:]]
    # C's math library and NumPy's differ by some units in the last place
    np.testing.assert_allclose(values, instance.get(reals), rtol=1e-13)
    assert [line.split()[1] for line in (printed[2], printed[4])] == ["0", "0"]
    before, after = (int(line.removeprefix("resident ")) for line in (printed[3], printed[5]))
    assert after - before < FLAT
