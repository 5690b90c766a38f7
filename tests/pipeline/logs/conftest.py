"""What the tests of the sources share: writing specimens, and arms with so many joints."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from urmpipe_models.arm.chain import Chain, Joint
from urmpipe_pipeline.joint_log import JointLog
from urmpipe_pipeline.logs import LogMap, read_log

Read = Callable[..., JointLog]
Wrong = Callable[..., list[str]]


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    """Write a specimen byte for byte."""

    def write(text: str | bytes, name: str = "log.csv", encoding: str = "utf-8") -> Path:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return path

    return write


@pytest.fixture
def read(write: Callable[..., Path]) -> Read:
    """Write a specimen and read it; keywords that are no options of `read_log` say how it is written."""

    def read(
        text: str | bytes,
        robot: Chain | None = None,
        *,
        name: str = "log.csv",
        encoding: str = "utf-8",
        **options: object,
    ) -> JointLog:
        return read_log([write(text, name, encoding)], LogMap(**options), robot)  # type: ignore[arg-type]

    return read


@pytest.fixture
def arm() -> Callable[..., Chain]:
    """Make an arm of so many joints that turn; others by their kinds."""

    def arm(count: int, *kinds: str, names: tuple[str, ...] = ()) -> Chain:
        names = names or tuple(f"phi{k + 1}" for k in range(count))
        padded = kinds or ("revolute",) * count
        joints = tuple(Joint(name, kind=kind) for name, kind in zip(names, padded, strict=True))  # type: ignore[arg-type]
        return Chain("arm", joints)

    return arm
