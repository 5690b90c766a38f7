"""Changes of bytes, whatever they mean."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from random import Random
from typing import TypeAlias

LARGEST = 900_000
"""Bytes of an input: what is promised of time and memory holds for a file below 1 MB."""

Mutator: TypeAlias = Callable[[bytes, Random, Sequence[bytes]], bytes]
"""Returns changed bytes; the last argument holds what else there is of the same kind, to be mixed in."""

ODD = (
    b"\0", b"\n", b"\r", b"\r\n", b'"', b"'", b"`", b"\\", b"\xff", b"\xfe\xff", b"\xef\xbb\xbf", b"\x1a",
    b"\x7f", b"\x80", b"\xc2\x85", b"\xe2\x80\xae", b"\xed\xa0\x80", b"#", b"%", b",", b";", b"\t", b" ",
    b"=", b"[", b"{", b"<", b"&", b"\x00\x00\x00\x00", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f",
    b"\x00\x00\x00\x80",
)  # fmt: skip
"""Bytes that readers treat apart: ends of lines and texts, quotes, marks of encodings, limits of integers."""


def _span(data: bytes, rng: Random, longest: int = 64) -> tuple[int, int]:
    """Return the first and the end of a part."""
    first = rng.randrange(len(data) + 1)
    return first, min(len(data), first + rng.randint(1, longest))


def flip(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8)) if data else 0):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def overwrite(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    at, odd = rng.randrange(len(data) + 1), rng.choice(ODD)
    return data[:at] + odd + data[at + len(odd) :]


def insert(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    at = rng.choice((0, len(data), rng.randrange(len(data) + 1)))
    return data[:at] + rng.choice(ODD) + data[at:]


def delete(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    first, end = _span(data, rng, rng.choice((1, 16, 1000)))
    return data[:first] + data[end:]


def duplicate(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    first, end = _span(data, rng, rng.choice((4, 64, 1000)))
    at = rng.randrange(len(data) + 1)
    return data[:at] + data[first:end] + data[at:]


def truncate(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def splice(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    other = rng.choice(others)
    return data[: rng.randrange(len(data) + 1)] + other[rng.randrange(len(other) + 1) :]


def repeat(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    first, end = _span(data, rng, rng.choice((1, 4, 64)))
    times = int(10.0 ** rng.uniform(0.3, 4.0))
    return data[:first] + data[first:end] * times + data[end:]


BYTES: tuple[Mutator, ...] = (flip, overwrite, insert, delete, duplicate, truncate, splice, repeat)


def mutate(data: bytes, rng: Random, others: Sequence[bytes], mutators: Sequence[Mutator]) -> bytes:
    """Return data after one change or a few."""
    for _ in range(rng.choice((1, 1, 1, 1, 2, 2, 4))):
        data = rng.choice(mutators)(data, rng, others)[:LARGEST]
    return data
