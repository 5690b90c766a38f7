"""What was inferred about a log, and what the user would say to have it otherwise."""

from __future__ import annotations

from urmpipe_pipeline.joint_log import Inference
from urmpipe_pipeline.sources.option_text import option

_OPTIONS = {
    "encoding": "save the file as UTF-8",
    "source": "--source NAME",
    "delimiter": "--delimiter CHAR",
    "decimal sign": "--decimal CHAR",
    "time column": "--time COLUMN, or --time none",
    "form of the time": "--unit COLUMN=dmy, mdy, s, ms or us",
    "clock": "--time none with --period SECONDS",
    "period": "--period SECONDS",
    "joint columns": "--joints A,B,C in the robot's order",
    "recorded TCP": "position in a --map",
    "recorded orientation": "orientation in a --map",
    "path": "--joints A,B,C for a log of joints",
    "robot": "--robot NAME|FILE",
}
"""What was inferred: the option that decides it."""

_OTHER_UNIT = {
    **{"rad": "deg", "deg": "rad", "m": "mm", "mm": "m", "cm": "m"},
    **{"s": "ms", "ms": "s", "us": "s", "ns": "s"},
}
"""The unit that a wrong one would most likely be."""


def otherwise(inference: Inference) -> str:
    """Return the alternative to an inference, as an option; nothing where there is none.

    Args:
        inference: What was found out.
    """
    if inference.what in _OPTIONS:
        return _OPTIONS[inference.what]
    if inference.what.startswith("form of "):
        return "--rotation FORM"
    if inference.what.startswith("interval of "):
        joint = inference.what.removeprefix("interval of ").split(", ")[0]
        return option("--interval", f"{joint}=LOW:HIGH")
    other = _OTHER_UNIT.get(inference.value)
    if inference.what == "unit of the time" and other:
        return f"{other} with --unit COLUMN={other}"
    if inference.what.startswith("unit of ") and other:
        column, *more = inference.what.removeprefix("unit of ").split(", ")
        if more and inference.value in ("rad", "deg"):
            column = ""  # of all joints that turn
        return f"{other} with {option('--unit', f'{column}={other}' if column else other)}"
    return ""
