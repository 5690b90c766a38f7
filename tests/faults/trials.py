"""Faults provoked in commands: at every trial all of their outputs are new and whole, or none is."""

from __future__ import annotations

import re
import signal
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from forks import Ended, Forks
from jobs import Job, check_whole
from urmpipe.answers import OWN_ERROR

Content = dict[str, bytes]


def interrupted(forks: Forks, job: Job, folder: Path, number: int, moments: int) -> Counter[str]:
    """Send a command a signal at so many moments from its start to just after its end.

    Returns:
        How often it ended before its outputs were in place, and after.
    """
    whole = _whole(forks, job, folder)
    found: Counter[str] = Counter()
    for moment in range(moments):
        before = _old(job, folder, whole)
        ended = forks.run(job.line.split(), folder, number, forks.seconds[job.name] * 1.1 * moment / moments)
        _check_end(job, ended, killed=number == signal.SIGKILL)
        if number != signal.SIGKILL:  # which nobody can clean up after
            assert not list(folder.glob("*.part")), job.name
        state = _outputs(job, folder, before)
        if state == "new":  # a machine that was busy at first is measured anew by runs that came to their end
            forks.seconds[job.name] = min(forks.seconds[job.name], ended.seconds)
        found[state] += 1
        _remove_parts(folder)
    return found


def limited(forks: Forks, job: Job, folder: Path, sizes: int) -> Counter[str]:
    """Run a command while no file may have more than a share of the bytes that its largest output needs."""
    whole = _whole(forks, job, folder)
    largest = max(map(len, whole.values()))

    def run(share: float) -> Ended:
        """Run the command with the limit."""
        return forks.run(job.line.split(), folder, limit=int(share * largest))

    return _refused(job, folder, whole, sizes, run, "File too large")


def full(forks: Forks, job: Job, folder: Path, sizes: int) -> Counter[str]:
    """Run a command on a disk with no more room than a share of what all its outputs need."""
    whole = _whole(forks, job, folder)
    largest = sum(map(len, whole.values()))

    def run(share: float) -> Ended:
        """Run the command with so much room."""
        with _filled(folder, int(share * largest)):
            return forks.run(job.line.split(), folder)

    return _refused(job, folder, whole, sizes, run, "No space left on device")


def _refused(
    job: Job, folder: Path, whole: Content, sizes: int, run: Callable[[float], Ended], why: str
) -> Counter[str]:
    """Run a command with a growing share of the room that it needs: an error in one line, or its outputs."""
    found: Counter[str] = Counter()
    for size in range(sizes):
        before = _old(job, folder, whole)
        ended = run((size + 0.5) / sizes)
        _check_end(job, ended, killed=False)
        assert not list(folder.glob("*.part")), job.name
        outcome = _outputs(job, folder, before)
        if outcome == "old":
            named = "|".join(map(re.escape, job.outputs))
            told = rf"^error: (({named}): cannot be written: {why}|.*[.]fmu: .*: {why}|found no room .*)$"
            assert ended.code == 2, (job.name, ended)
            assert re.search(told, ended.err, re.MULTILINE), (job.name, ended)
        found[outcome] += 1
    return found


def _whole(forks: Forks, job: Job, folder: Path) -> Content:
    """Return what a command writes undisturbed; it runs twice for all trials, and the shorter time counts."""
    if job.name not in forks.written:
        forks.seconds[job.name] = min(_undisturbed(forks, job, folder).seconds for _ in range(2))
        forks.written[job.name] = {name: (folder / name).read_bytes() for name in job.outputs}
    return forks.written[job.name]


def _undisturbed(forks: Forks, job: Job, folder: Path) -> Ended:
    """Run a command undisturbed, and return how it ended."""
    for name in job.outputs:
        (folder / name).unlink(missing_ok=True)
    ended = forks.run(job.line.split(), folder)
    assert ended.code in (0, 1), ended
    return ended


def _old(job: Job, folder: Path, whole: Content) -> dict[str, tuple[int, bytes] | None]:
    """Put older outputs in their places, which a command may replace; of a table none, which it may not."""
    for name, content in whole.items():
        (folder / name).unlink(missing_ok=True)
        if not job.name.startswith("export csv"):
            (folder / name).write_bytes(content)
    return _state(job, folder)


def _state(job: Job, folder: Path) -> dict[str, tuple[int, bytes] | None]:
    """Return the file that stands in each place, by its number on the disk, and what is in it."""
    paths = {name: folder / name for name in job.outputs}
    return {
        name: (path.stat().st_ino, path.read_bytes()) if path.exists() else None
        for name, path in paths.items()
    }


def _outputs(job: Job, folder: Path, before: dict[str, tuple[int, bytes] | None]) -> str:
    """Return whether all outputs are old or new: each is whole, and no new one stands beside an old one."""
    after = _state(job, folder)
    for name, state in after.items():
        if name.endswith(".xml") and state is not None and b"<error " in state[1]:
            after[name] = before[name]  # it tells the error in the place of an earlier verdict
    same = {name: after[name] == before[name] for name in job.outputs}
    assert len(set(same.values())) == 1, (job.name, same)
    if all(same.values()):
        return "old"
    for name in job.outputs:
        assert after[name] is not None, (job.name, name)
        check_whole(folder / name)
    return "new"


def _check_end(job: Job, ended: Ended, *, killed: bool) -> None:
    """Hold that a command ended by itself, in order, and that nothing of it is left."""
    assert not ended.hung, (job.name, ended)
    assert not ended.left, (job.name, ended)
    assert OWN_ERROR not in ended.err, (job.name, ended)
    if not killed:
        assert "Traceback" not in ended.err, (job.name, ended)


def _remove_parts(folder: Path) -> None:
    """Remove what a kill left behind."""
    for path in folder.glob("*.part"):
        path.unlink()


@contextmanager
def _filled(folder: Path, room: int) -> Iterator[None]:
    """Fill the disk of a folder up to some room."""
    filler = folder / "filler"
    try:
        with filler.open("wb") as file:
            while True:
                file.write(bytes(4096))
                file.flush()
    except OSError:
        pass
    try:
        size = filler.stat().st_size
        if size > room:
            with filler.open("r+b") as file:
                file.truncate(size - room)
        yield
    finally:
        filler.unlink()


@contextmanager
def small_disk(folder: Path, size: str) -> Iterator[bool]:
    """Mount a small disk over a folder, and tell whether that is possible here: it needs Linux and root."""
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "--lazy", str(folder)], check=True)  # a recording may still be open


def total(counts: Sequence[Counter[str]]) -> Counter[str]:
    """Return the sum of some counts."""
    return sum(counts, Counter())
