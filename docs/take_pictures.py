"""Take pictures of recordings and reports as a user sees them; without arguments those of the README.

    python docs/take_pictures.py
    python docs/take_pictures.py run.rrd run.png --time 12.5
    python docs/take_pictures.py report.html report.png --width 390

Needs the test extra, Chromium (pages) and a software Vulkan such as Mesa's (recordings). What the viewer or
the page complain of is printed, and the exit code is 1 then.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).resolve().parent / "pictures"
CHROMIUM = "/usr/bin/chromium"
VULKAN = Path("/usr/share/vulkan/icd.d")
QUIET = ("INFO", "DEBUG", "TRACE")


def of_recording(source: Path, target: Path, at: float | None, settle: float = 12.0) -> list[str]:
    """Picture a recording in the headless viewer, at a time in [s] or where it opens; return complaints."""
    from rerun.experimental import ViewerClient

    complaints = []
    with headless_viewer() as url, ViewerClient.connect(url) as viewer:
        viewer.open(str(source.resolve()))
        deadline = time.monotonic() + 60.0
        while not (state := viewer.get_state()).recordings or not state.views:
            if time.monotonic() > deadline:
                return ["the viewer showed no recording within a minute"]
            time.sleep(0.2)
        if at is not None:
            viewer.set_time(timeline="t", duration=at)
        time.sleep(settle)  # data load lazily, and no event tells when they are there
        viewer.save_screenshot(str(target))
        complaints += [
            f"{view.name}: {report}" for view in viewer.get_state().views for report in view.reports
        ]
        complaints += [
            entry.message
            for entry in viewer.get_logs()
            if entry.level not in QUIET and "Software rasterizer" not in entry.message
        ]
    return complaints


def of_page(source: Path, target: Path, width: int, height: int = 1000) -> list[str]:
    """Picture the top of a page in Chromium; return complaints."""
    from playwright.sync_api import sync_playwright

    complaints: list[str] = []
    with sync_playwright() as play:
        quiet = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
        browser = play.chromium.launch(executable_path=CHROMIUM, args=quiet)
        page = browser.new_page(viewport={"width": width, "height": height})
        page.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(source.resolve().as_uri())
        page.wait_for_timeout(3000)
        page.screenshot(path=str(target))
        browser.close()
    return complaints


@contextmanager
def headless_viewer() -> Iterator[str]:
    """Run the viewer without a window, on the loopback interface only; yield where it listens."""
    import rerun_cli

    icd = sorted(VULKAN.glob("lvp_icd*.json"))
    environment = os.environ | ({"VK_ICD_FILENAMES": str(icd[0])} if icd else {})
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    binary = Path(rerun_cli.__file__).parent / "rerun"
    command = [str(binary), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        try:
            deadline = time.monotonic() + 30.0
            while not _listens(port) and time.monotonic() < deadline:
                time.sleep(0.2)
            yield f"rerun+http://127.0.0.1:{port}/proxy"
        finally:
            process.terminate()


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def of_readme() -> list[str]:
    """Run the demo and picture what it made, for the README."""
    HERE.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        demo = Path(folder) / "demo"
        urmpipe = [sys.executable, "-m", "urmpipe"]
        subprocess.run([*urmpipe, "demo", "-q", "-o", str(demo)], check=True)
        return [
            *of_recording(demo / "demo.rrd", HERE / "recording.png", None),
            *of_page(demo / "report.html", HERE / "report.png", 1280),
        ]


def main() -> None:
    """Take the pictures asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, nargs="?")
    parser.add_argument("target", type=Path, nargs="?")
    parser.add_argument("--time", type=float, help="time on the timeline t, in s")
    parser.add_argument("--width", type=int, default=1280, help="width of a page, in px")
    options = parser.parse_args()
    if options.source is None:
        complaints = of_readme()
    elif options.target is None:
        parser.error("a picture needs a name: SOURCE TARGET.png")
    elif options.source.suffix == ".rrd":
        complaints = of_recording(options.source, options.target, options.time)
    else:
        complaints = of_page(options.source, options.target, options.width)
    print(*complaints, sep="\n")
    sys.exit(bool(complaints))


if __name__ == "__main__":
    main()
