"""The process that runs the FMUs, from the parent's side: started early, given one job, waited for."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from urmpipe_fmus.cosim.job import SAID
from urmpipe_fmus.fmu_process import command, environment

POLL = 0.02
"""How often it is looked at, in [s]."""

SAID_BYTES = 16_000_000
"""A process that printed more has it forgotten, as its disk is not for that."""


class Worker:
    """A process that loads what it needs while its job is prepared; use it as a context.

    It ends with the context, and with the process that started it.

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
                bufsize=0,  # so that closing its input writes nothing to a process that has ended
            )
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        with self._process:  # closes its input, and waits for its end
            pass
        self._folder.cleanup()

    def work(self, poll: Callable[[], None]) -> int:
        """Let it do the job that is in its folder.

        Args:
            poll: Called now and then.

        Returns:
            Its exit code, negative for the signal that ended it.
        """
        self._begin()
        while True:
            try:
                return self._process.wait(POLL)
            except subprocess.TimeoutExpired:
                if (self.folder / SAID).stat().st_size > SAID_BYTES:
                    os.truncate(self.folder / SAID, 0)  # what is appended from then on begins there
                poll()

    def _begin(self) -> None:
        """Tell it that the job is there."""
        assert self._process.stdin is not None
        with suppress(OSError):  # if it ended already, its exit code tells
            self._process.stdin.write(b"begin\n")
