"""The runtime's own elementary functions against those of NumPy, in more digits where there are some."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from urmpipe_models.elementwise import FloatArray

EXACT = np.longdouble if np.finfo(np.longdouble).nmant > 60 else np.float64
MOST_ULPS = 3 if EXACT is np.longdouble else 4
"""elementary.h promises 3 units in the last place; a C library of doubles is wrong by up to one itself."""

EDGES = [
    *(0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -2.0, 709.7, 709.8, 710.5, -745.2),
    *(1e-320, 1.7e308, math.inf, math.nan),
]

rng = np.random.default_rng(11)
SIZES = 10.0 ** rng.uniform(-12.0, 6.0, 2000) * rng.choice([-1.0, 1.0], 2000)
POSITIVE = 10.0 ** rng.uniform(-300.0, 300.0, 2000)
NEAR = np.concatenate([rng.normal(size=2000), SIZES / 1e5, rng.uniform(-745.0, 711.0, 2000)])
SHARES = np.concatenate([rng.uniform(-1.0, 1.0, 2000), 1.0 - 10.0 ** rng.uniform(-16.0, 0.0, 500)])
QUARTERS = np.arange(-5000, 5000) * (math.pi / 2.0)
ANY = rng.integers(0, 2**64, 2000, dtype=np.uint64).view(np.float64)
"""Doubles of any bits: tiny, huge, of both signs."""

ARGUMENTS: dict[str, FloatArray] = {
    **dict.fromkeys(("sin", "cos", "tan"), np.concatenate([SIZES, QUARTERS])),
    **dict.fromkeys(("asin", "acos", "atanh"), SHARES),
    **dict.fromkeys(("exp", "expm1", "sinh", "cosh", "tanh"), NEAR),
    **dict.fromkeys(("atan", "asinh"), SIZES),
    "log": np.concatenate([POSITIVE, rng.uniform(0.3, 3.0, 2000)]),
    "log1p": np.concatenate([POSITIVE, rng.uniform(-1.0, 3.0, 2000), SIZES / 1e7]),
    "acosh": np.concatenate([1.0 + POSITIVE, -POSITIVE]),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """elementary.c compiled alone."""
    if shutil.which("cc") is None:
        pytest.skip("needs a C compiler")
    source = Path(str(files("urmpipe_fmus.native") / "runtime" / "elementary.c"))
    made = tmp_path_factory.mktemp("elementary") / "elementary.so"
    flags = ["-shared", "-fPIC", "-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror"]
    subprocess.run(["cc", *flags, str(source), "-o", str(made), "-lm"], check=True)
    return ctypes.CDLL(str(made))


def function(library: ctypes.CDLL, name: str, arguments: int) -> Callable[..., float]:
    found = library[f"{name}_of"]
    found.restype, found.argtypes = ctypes.c_double, [ctypes.c_double] * arguments
    return found


def numpys(name: str) -> Callable[..., FloatArray]:
    """NumPy's function of the same values as C's."""
    same = {"atan2": "arctan2", "pow": "power"}.get(name, f"arc{name[1:]}" if name[0] == "a" else name)
    return getattr(np, same)  # type: ignore[no-any-return]


def assert_near(name: str, found: FloatArray, exact: FloatArray) -> None:
    """Assert the same values but for units in the last place; zeros, infinities and NaN as they are."""
    expected = exact.astype(np.float64)
    finite = np.isfinite(expected) & np.isfinite(found)
    np.testing.assert_array_equal(np.where(finite, 0.0, found), np.where(finite, 0.0, expected), name)
    ulps = np.abs(found - exact)[finite] / np.spacing(np.abs(expected[finite]))
    assert ulps.max() <= MOST_ULPS, name
    zero = expected == 0.0
    np.testing.assert_array_equal(np.signbit(found[zero]), np.signbit(expected[zero]), name)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of what is not finite, which is meant here
@pytest.mark.parametrize("name", ARGUMENTS)
def test_functions_of_one_value(library: ctypes.CDLL, name: str) -> None:
    ours = function(library, name, 1)
    x = np.concatenate([ARGUMENTS[name], ANY, EDGES])
    assert_near(name, np.array([ours(one) for one in x]), numpys(name)(x.astype(EXACT)))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", ["atan2", "hypot", "pow"])
def test_functions_of_two_values(library: ctypes.CDLL, name: str) -> None:
    ours = function(library, name, 2)
    edges = [*EDGES, -3.0, -0.5, -math.inf, 5e-324, -1.7e308, 1e18, 1.0 + 2.0**-52]
    bases = rng.uniform(0.6, 1.5, 2000)  # the powers of which go to the ends of the range
    x = np.concatenate([SIZES, POSITIVE, 1.0 + SIZES[:500] / 1e9, bases, ANY, np.repeat(edges, len(edges))])
    powers = rng.uniform(-700.0, 700.0, 2000) / np.log(bases)
    others = (rng.permutation(SIZES), rng.uniform(-1, 1, 2000), SIZES[500:1000], powers, rng.permutation(ANY))
    y = np.concatenate([*others, np.tile(edges, len(edges))])
    found = np.array([ours(*pair) for pair in zip(x, y, strict=True)])
    assert_near(name, found, numpys(name)(x.astype(EXACT), y.astype(EXACT)))


def test_whole_powers_are_whole(library: ctypes.CDLL) -> None:
    """A floor after a power must not jump."""
    ours = function(library, "pow", 2)
    cases = [(a, n) for a in range(-100, 101) for n in range(1, 30) if abs(a) ** n < 2**53]
    assert [(a, n) for a, n in cases if ours(a, n) != a**n] == []
    assert [n for n in range(-1074, 1024) if ours(2.0, n) != 2.0**n] == []
    assert [k for k in range(1000) if ours(float(k * k), 0.5) != k] == []


def test_sine_and_cosine_stay_on_the_circle(library: ctypes.CDLL) -> None:
    sine, cosine = function(library, "sin", 1), function(library, "cos", 1)
    for x in SIZES.tolist():
        # each is within a unit in the last place, 1.1e-16 below 1
        assert abs(sine(x) ** 2 + cosine(x) ** 2 - 1.0) < 6e-16
        assert (sine(-x), cosine(-x)) == (-sine(x), cosine(x))
