"""Write the specimens: python tests/specimens/make_specimens.py, with urmpipe installed.

Every log holds the one motion of `specimen.motion`, written by what people write logs with. None of this
knows the reader: what must be read of a specimen follows from the motion and from its writer's rounding.
"""

from __future__ import annotations

from pathlib import Path

import by_python
import by_robots
import by_simulators
import damaged
import with_clocks
import with_tcp
from specimen import SPECIMENS, Specimen

FOLDER = Path(__file__).parent
GROUPS = (by_python, by_simulators, by_robots, with_clocks, with_tcp, damaged)

README = """\
# Specimen logs

Small logs of one known motion, as people's tools write them; `wrong/` holds those that must be refused or
warned of. `make_specimens.py` writes them byte for byte, as a test holds, and does not know the reader.
The motion and its rounding are in `specimen.py`; what must be read of each file, with the option where it
cannot tell, in `tests/pipeline/logs/test_specimens.py`. To add one: a function with `@specimen` and a line
of docstring, run `make_specimens.py`, and add its row to the table of that test.
"""


def files() -> dict[Path, bytes]:
    """Return every file of the folder that is made, README too, by its path."""
    made = {
        FOLDER / one.folder / name: content
        for one in SPECIMENS.values()
        for name, content in one.make().files.items()
    }
    return {**made, FOLDER / "README.md": readme().encode()}


def paths(one: Specimen) -> list[Path]:
    """Return a specimen's files in the order in which they are read."""
    return [FOLDER / one.folder / name for name in one.make().files]


def readme() -> str:
    """Return the list of the specimens, one line each, in the order of the modules that make them."""
    parts = [README]
    for group in GROUPS:
        title = str(group.__doc__).strip()
        listed = [one for one in SPECIMENS.values() if one.make.__module__ == group.__name__]
        parts.append("\n".join([f"## {title}", "", *(f"- `{one.name}`: {one.about}" for one in listed), ""]))
    return "\n".join(parts)


def main() -> None:
    """Write all files."""
    (FOLDER / "wrong").mkdir(exist_ok=True)
    for path, content in files().items():
        path.write_bytes(content)


if __name__ == "__main__":
    main()
