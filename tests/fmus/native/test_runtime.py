"""The runtime in C: no warning, nothing that a sanitizer finds, and memory that stays flat."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from c_host import host, ran, script, write
from sliding_arm import sliding_arm
from urmpipe_fmus.block import BlockModel
from urmpipe_fmus.blocks import make_block
from urmpipe_fmus.native import native_unavailable_reason

HERE = Path(__file__).parent

SANITIZED = ["cc", "-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

WARNINGS = [
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wsign-conversion",
    "-Wshadow",
    "-Wstrict-prototypes",
    "-Wmissing-prototypes",
    "-Wold-style-definition",
    "-Wcast-qual",
    "-Wcast-align",
    "-Wpointer-arith",
    "-Wwrite-strings",
    "-Wformat=2",
    "-Wundef",
    "-Wvla",
    "-Wnull-dereference",
    "-Wbad-function-cast",
    "-Wswitch-enum",
    "-Wswitch-default",
]

pytestmark = pytest.mark.skipif(
    native_unavailable_reason() is not None or shutil.which("cc") is None,
    reason=f"needs cc; {native_unavailable_reason()}",
)


@pytest.fixture
def units(oscillator: BlockModel, player: BlockModel, elementary: BlockModel) -> Sequence[BlockModel]:
    """Units with states and memories, a table, elementary functions, and an arm."""
    return (oscillator, player, elementary, make_block("kinematic_chain", robot=sliding_arm()))


def c_files(folder: Path) -> list[str]:
    return [str(one) for one in sorted((folder / "sources").glob("*.c"))]


@pytest.mark.slow
def test_the_sources_compile_without_a_warning(units: Sequence[BlockModel], tmp_path: Path) -> None:
    for k, model in enumerate(units):
        folder = tmp_path / model.name
        write(folder, model, [])
        # optimized, as some warnings come of it; but for model.c the sources are the same, with other sizes
        files = c_files(folder) if k < 2 else [str(folder / "sources" / "model.c")]
        flags = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", *WARNINGS, "-Werror"]
        done = subprocess.run(
            ["cc", *flags, "-c", *files], cwd=folder, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_sanitizers_find_nothing(units: Sequence[BlockModel], tmp_path: Path) -> None:
    program = host(tmp_path, [*SANITIZED, "-ldl"])
    for model in units:
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
    library = subprocess.run(
        ["cc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    ).stdout.strip()
    if not Path(library).is_file():
        pytest.skip("needs gcc's libasan.so, to be loaded before Python")
    tests = [str(HERE / f"test_{name}.py") for name in ("states", "refusals")]
    environment = {
        **os.environ,
        "CC": " ".join(["env", "-u", "LD_PRELOAD", *SANITIZED]),  # the compiler itself runs without
        "LD_PRELOAD": library,
        "ASAN_OPTIONS": "detect_leaks=0",  # Python's own; those of the runtime the host would show
    }
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider", *tests],
        env=environment,
        cwd=HERE.parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    assert " passed" in done.stdout
    assert "skipped" not in done.stdout


FLAT = 128
"""kB that the heap may grow by while nothing is lost: the least block, of 32 bytes, lost in each of 10,000
instances is 320 kB."""


def grown(seen: Sequence[str]) -> int:
    """Return by how many kB memory grew between the first and the last line that tells it."""
    told = [int(line.split()[1]) for line in seen if line.startswith("resident ")]
    return told[-1] - told[0]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_memory_is_flat_over_a_million_steps(
    oscillator: BlockModel, built: Callable[..., Path], c_host: str
) -> None:
    folder = built(oscillator)
    (library,) = folder.glob("binaries/*/oscillator*")
    given = "steps 10000 0.001\nresident\nsteps 1000000 0.001\nresident\nget 5 6 9\n"
    seen = ran([c_host, str(library)], folder, given)
    assert [line for line in seen if line.startswith("steps")] == ["steps 0", "steps 0"]
    assert grown(seen) < FLAT


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
@pytest.mark.parametrize("name", ["oscillator", "player"])
def test_memory_is_flat_over_ten_thousand_instances(
    name: str, request: pytest.FixtureRequest, built: Callable[..., Path], c_host: str
) -> None:
    folder = built(request.getfixturevalue(name))
    (library,) = folder.glob(f"binaries/*/{name}*")
    given = "instances 1000\nresident\ninstances 10000\nresident\n"
    seen = ran([c_host, str(library)], folder, given)
    assert [line for line in seen if line.startswith("instances")] == ["instances 0", "instances 0"]
    assert grown(seen) < FLAT
