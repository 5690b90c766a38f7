"""The process that runs the FMUs, from the parent's side: started early, given one job, waited for."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import monotonic
from types import TracebackType

from urmpipe_fmus.cosim.job import ELSEWHERE, SAID, Progress
from urmpipe_models.processes import command, end_group, ending, environment

POLL = 0.02
"""How often it is looked at, in [s]."""

BETWEEN_LOOKS = 1.0
"""So many seconds count at most between two looks at a call: the processes may have been stopped."""

SAID_BYTES = 16_000_000
"""A process that printed more has it forgotten, as its disk is not for that."""


class Worker:
    """A process that loads what it needs while its job is prepared; use it as a context.

    It ends with the context, and with the process that started it, and so does what the FMUs started.

    Attributes:
        folder: Where its job is put, and what it leaves; it goes with the context.
    """

    folder: Path

    def __enter__(self) -> Worker:
        self._folder = tempfile.TemporaryDirectory(prefix="urmpipe-", ignore_cleanup_errors=True)
        self.folder = Path(self._folder.name)
        with (self.folder / SAID).open("ab") as said:
            self._process = subprocess.Popen(
                command("urmpipe_fmus.cosim.worker", str(self.folder)),
                stdin=subprocess.PIPE,
                stdout=said,
                stderr=subprocess.STDOUT,
                env=environment(),
                start_new_session=True,
                bufsize=0,  # so that closing its input writes nothing to a process that has ended
            )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        end_group(self._process)
        with self._process:  # closes its input, and waits for its end
            pass
        self._folder.cleanup()

    def work(self, watch: Callable[[], str]) -> str:
        """Let it do the job that is in its folder.

        Args:
            watch: Called now and then: tells why it is to be ended, empty if it is not.

        Returns:
            How it ended; empty if by itself, and with the exit code 0.
        """
        self._begin()
        while True:
            with suppress(subprocess.TimeoutExpired):
                code = self._process.wait(POLL)
                return ending(code) if code else ""
            if (self.folder / SAID).stat().st_size > SAID_BYTES:
                os.truncate(self.folder / SAID, 0)  # what is appended from then on begins there
            why = watch()
            if why:
                end_group(self._process)
                self._process.wait()
                return why

    def _begin(self) -> None:
        """Tell it that the job is there."""
        assert self._process.stdin is not None
        with suppress(OSError):  # if it ended already, its exit code tells
            self._process.stdin.write(b"begin\n")


class CallWatch:
    """Sees whether a call returns.

    Args:
        timeout: How long a call may take, in [s].
    """

    def __init__(self, timeout: float) -> None:
        self._timeout = timeout
        self._call, self._taken, self._looked = ELSEWHERE, 0.0, monotonic()

    def overdue(self, state: Progress) -> str:
        """Return that the call at which a run is does not return; empty as long as it may."""
        now = monotonic()
        passed, self._looked = min(now - self._looked, BETWEEN_LOOKS), now
        if state.call != self._call or state.code == ELSEWHERE:
            self._call, self._taken = state.call, 0.0
            return ""
        self._taken += passed
        return f"did not return within {self._timeout:g} s" if self._taken > self._timeout else ""
