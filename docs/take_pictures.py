"""Take pictures of recordings and reports as a user sees them; without arguments those of the README.

    python docs/take_pictures.py
    python docs/take_pictures.py run.rrd run.png --time 12.5
    python docs/take_pictures.py report.html report.png --width 390

Needs the test extra, Chromium (pages) and a software Vulkan such as Mesa's (recordings). What the viewer or
the page complain of is printed, and the exit code is 1 then.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import runpy
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

HERE = Path(__file__).resolve().parent / "pictures"
CHROMIUM = "/usr/bin/chromium"
VULKAN = Path("/usr/share/vulkan/icd.d")
QUIET = ("INFO", "DEBUG", "TRACE")

SETTLE = 12.0
"""Time in [s] that the viewer has to load and to draw: no event tells when it has."""


def of_recording(
    source: Path, target: Path, at: float | None, done: Callable[[], bool] = lambda: False
) -> list[str]:
    """Picture a recording without a window, at a time in [s] or where `view` opens it; return complaints.

    It pictures it every second, until a function finds the picture done or the viewer has had its time.
    """
    from urmpipe_pipeline.recording.layout import TIME, Opening
    from urmpipe_pipeline.recording.viewer import open_window, openings

    draw_in_software()
    opening = openings([source])[source] if at is None else Opening(TIME, round(at * 1e9))
    with open_window(source, opening, headless=True) as (_, viewer):
        end = time.monotonic() + SETTLE
        while True:
            time.sleep(1.0)
            viewer.save_screenshot(str(target))
            if done() or time.monotonic() > end:
                break
        return complaints_of(viewer)


def draw_in_software() -> None:
    """Have the viewer draw by Mesa's software Vulkan where there is one: with the same pixels everywhere."""
    for driver in sorted(VULKAN.glob("lvp_icd*.json"))[:1]:
        os.environ.setdefault("VK_ICD_FILENAMES", str(driver))


def complaints_of(viewer: ViewerClient) -> list[str]:
    """Return what the viewer has to say against what it shows."""
    shown = [f"{view.name}: {report}" for view in viewer.get_state().views for report in view.reports]
    logged = [entry.message for entry in viewer.get_logs() if entry.level not in QUIET]
    return shown + [message for message in logged if "Software rasterizer" not in message]


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


def of_readme() -> list[str]:
    """Run the demo, a system of blocks and a target's inverse, and picture what they made, for the pages."""
    HERE.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        demo, drives = Path(folder) / "urmpipe-demo", Path(folder) / "driven-arm.rrd"
        for line in ("demo", f"simulate driven-arm -o {drives.name}"):  # there: so they name no folder
            subprocess.run([sys.executable, "-m", "urmpipe", *line.split(), "-q"], cwd=folder, check=True)
        return [
            *of_recording(demo / "demo.rrd", HERE / "recording.png", None),
            *of_page(demo / "report.html", HERE / "report.png", 1280),
            *of_recording(drives, HERE / "driven-arm.png", 0.5),
            *of_branches(Path(folder), HERE / "ik.png"),
            *of_tutorial(Path(folder)),
        ]


def of_branches(folder: Path, target: Path, done: Callable[[], bool] = lambda: False) -> list[str]:
    """Solve one target for all branches in a folder, and picture them; return complaints."""
    pose, branches = folder / "one.csv", folder / "one.rrd"
    pose.write_text("x,y,z,rz,ry,rx\n0.15,0.05,0.2,0.3,0.9,0.1\n", encoding="utf-8")
    solved = ["ik", str(pose), "--robot", "arm6", "--all", "-q", "-o", str(branches)]
    subprocess.run([sys.executable, "-m", "urmpipe", *solved], check=True)
    return of_recording(branches, target, None, done)


def of_tutorial(folder: Path) -> list[str]:
    """Do what docs/tutorial.md tells in a folder, and picture what it opens; return complaints."""
    tutorial = runpy.run_path(str(HERE.parent / "write_tutorial.py"))
    with contextlib.chdir(folder):
        list(tutorial["steps"](tutorial["PAGE"].read_text(encoding="utf-8"), folder))
    return [
        *of_recording(folder / "counter_rotating-against-path.rrd", HERE / "tutorial-failed.png", None),
        *of_page(folder / "report.html", HERE / "tutorial-report.png", 1280),
    ]


def main() -> None:
    """Take the pictures asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, nargs="?")
    parser.add_argument("target", type=Path, nargs="?")
    parser.add_argument("--time", type=float, help="time on the timeline t, in s [default: the worst]")
    parser.add_argument("--width", type=int, default=1280, help="width of a page, in px")
    options = parser.parse_args()
    if options.source is None:
        complaints = of_readme()
    elif not options.source.is_file():
        parser.error(f"{options.source}: found no such file")
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
