"""Random arms with masses, and open forms as functions of numbers."""

from __future__ import annotations

import ctypes
import math
import re
import shlex
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from made_masses import body
from urmpipe_models.arm.chain import Chain, Joint, JointKind, Mimic
from urmpipe_models.elementwise import FloatArray
from urmpipe_models.lagrange.formulas import ARGUMENTS, c_name
from urmpipe_models.math3d import Transform, from_xyz_rpy

Motion = tuple[FloatArray, FloatArray, FloatArray]  # q, q', q'' of each coordinate
Terms = dict[str, FloatArray]  # each term of each coordinate


def random_arm(rng: np.random.Generator, coordinates: int) -> Chain:
    """Return an arm of any geometry: joints that turn or slide, fixed ones, mimics, parallel axes."""
    joints, inertials = list[Joint](), [body(None, rng)]
    for k in range(coordinates):
        kind: JointKind = "prismatic" if rng.random() < 0.3 else "revolute"
        joints.append(Joint(f"q{k + 1}", kind, *_frame(rng)))
        joints.append(Joint(f"f{k + 1}", "fixed", *_frame(rng)))
        if rng.random() < 0.5:
            mimic = Mimic(f"q{k + 1}", float(rng.choice([-1.0, 0.5, 2.0])), float(rng.normal()))
            follower: JointKind = "revolute" if rng.random() < 0.7 else "prismatic"
            joints.append(Joint(f"m{k + 1}", follower, *_frame(rng), mimic=mimic))
    inertials += [body(one.name, rng) for one in joints]
    base, tip, tool = (_frame(rng)[0] for _ in range(3))
    gravity = tuple(rng.normal(0.0, 9.0, 3).tolist())
    return Chain("any", tuple(joints), tip, base, tool, inertials=tuple(inertials), gravity=gravity)


def random_motion(rng: np.random.Generator, chain: Chain) -> Motion:
    q, qd, qdd = rng.normal(0.0, 1.5, (3, len(chain.coordinates)))
    return q, qd, qdd


def _frame(rng: np.random.Generator) -> tuple[Transform, tuple[float, float, float]]:
    """Return a frame and an axis: along one of its own axes or not, its neighbours' or not."""
    quarters = (rng.integers(0, 4, 3) * math.pi / 2).tolist()
    turn = rng.uniform(-3.0, 3.0, 3).tolist() if rng.random() < 0.4 else quarters
    skew = rng.random() < 0.2
    axis = rng.normal(0.0, 1.0, 3) if skew else np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0])
    x, y, z = (axis / np.linalg.norm(axis)).tolist()
    return from_xyz_rpy(rng.uniform(-0.5, 0.5, 3).tolist(), turn, "random"), (x, y, z)


def compiled(code: str, folder: Path) -> ctypes.CDLL:
    """Return what a file of C99 is compiled to, without any warning."""
    source = folder / "equations.c"
    source.write_text(code, encoding="utf-8")
    library = source.with_suffix(".so")
    flags = shlex.split("-std=c99 -O1 -Wall -Wextra -Wno-unused-parameter -Werror -pedantic -shared -fPIC")
    command = ["cc", *flags, str(source), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return ctypes.CDLL(str(library))


def c_terms(library: ctypes.CDLL, chain: Chain, motion: Motion, wrench: Sequence[float]) -> Terms:
    """Return each term, and the sum as `torque`, as compiled C computes them."""
    inputs = dict(zip(("q", "qd", "qdd"), motion, strict=True)) | {"force": np.asarray(wrench)}
    pointer, terms = ctypes.POINTER(ctypes.c_double), Terms()
    for term, names in [*ARGUMENTS.items(), ("torque", tuple(inputs))]:
        terms[term] = np.full(len(chain.coordinates), np.nan)
        arrays = [*(np.ascontiguousarray(inputs[name]) for name in names), terms[term]]
        getattr(library, f"{c_name(chain.name)}_{term}")(*(array.ctypes.data_as(pointer) for array in arrays))
    return terms


def text_terms(text: str) -> Callable[[Motion, Sequence[float]], Terms]:
    """Return a function that computes each term of each coordinate as a text says it."""
    coordinates = re.findall(r"^tau_(\w+) = ", text, re.MULTILINE)
    angles = re.findall(r"^# (c\w+) = (cos\(.*\)), (s\w+) = (sin\(.*\))$", text, re.MULTILINE)
    lines = re.findall(r"^  (\w+) = (.*)$", text, re.MULTILINE)
    code = [(term, line.replace("''", "_dd").replace("'", "_d").replace("^", "**")) for term, line in lines]

    def terms(motion: Motion, wrench: Sequence[float]) -> Terms:
        names: dict[str, Any] = {"cos": math.cos, "sin": math.sin}
        for mark, values in zip(("", "_d", "_dd"), motion, strict=True):
            names |= dict(zip((f"{name}{mark}" for name in coordinates), values.tolist(), strict=True))
        names |= dict(zip(("fx", "fy", "fz", "mx", "my", "mz"), wrench, strict=True))
        for cosine, c, sine, s in angles:
            names |= {cosine: eval(c, names), sine: eval(s, names)}
        results: dict[str, list[float]] = {}
        for term, formula in code:
            results.setdefault(term, []).append(eval(formula, names))
        return {term: np.array(values) for term, values in results.items()}

    return terms
