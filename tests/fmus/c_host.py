"""The host in C that runs an FMU's binary by a script."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import fmpy
import numpy as np

from urmpipe_fmus.block import TABLE_FILE, BlockModel, table_bytes
from urmpipe_fmus.native import guid_header, native_binaries, native_sources

GUID = "{12345678-0000-0000-0000-000000000000}"
HOST = Path(__file__).parent / "native" / "host.c"


def script(model: BlockModel, count: int, seed: int) -> str:
    """Random inputs and steps for the host, in hexadecimal: not all strtod round decimals alike."""
    rng = np.random.default_rng(seed)
    seen = {k: one.causality for k, (_, one) in enumerate(model.scalars) if one.type == "Real"}
    inputs = [k for k, causality in seen.items() if causality == "input"]
    lines = []
    for k in range(count):
        values = (rng.normal(size=len(inputs)) * rng.choice([0.01, 1.0, 10.0])).tolist()
        pairs = zip(inputs, values, strict=True)
        lines.append("set " + " ".join(f"{one} {value.hex()}" for one, value in pairs))
        lines.append("get " + " ".join(map(str, seen)))
        lines.append(f"step {(k * 0.01).hex()} {(0.01).hex()}")
        if k % 10 == 9:
            lines.append("state")
    return "\n".join(lines) + "\n"


def host(folder: Path, command: Sequence[str], name: str = "host") -> str:
    """Compile the host, from its folder: seen from above its own, zig builds its C libraries anew."""
    program, headers = str(folder / name), str(Path(fmpy.__file__).parent / "c-code")
    flags = ["-O1", "-I", headers, str(HOST), "-o", program]
    subprocess.run([*command, *flags], cwd=folder, check=True, capture_output=True)
    return program


def write(folder: Path, model: BlockModel, platforms: Sequence[str]) -> None:
    """Write sources and binaries of a unit."""
    sources = native_sources(model)
    files = {**sources, "sources/guid.h": guid_header(GUID)}
    files |= native_binaries(model, sources, GUID, platforms) if platforms else {}
    if model.table is not None:
        files[TABLE_FILE] = table_bytes(model.table)
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def ran(
    command: Sequence[str],
    folder: Path,
    given: str,
    resources: str = "",
    environment: Mapping[str, str] = os.environ,
) -> list[str]:
    """What the host prints."""
    program = [*command, GUID, resources or (folder / "resources").as_uri()]
    env = {**environment, "ASAN_OPTIONS": "detect_leaks=1"}
    done = subprocess.run(program, input=given, capture_output=True, text=True, check=False, env=env)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return done.stdout.splitlines()
