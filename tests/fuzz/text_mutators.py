"""Changes of numbers, words, lines and columns of a text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from random import Random

from tests.fuzz.byte_mutators import Mutator

DIGIT = re.compile(rb"[0-9]")
NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
WORD = re.compile(rb"[A-Za-z_][\w./-]*")
SEPARATORS = (b",", b";", b"\t", b" ", b"|", b"  ", b", ", b"\xc2\xa0")

NUMBERS = (
    b"nan", b"NaN", b"inf", b"-Infinity", b"1e308", b"-1e308", b"1e309", b"1e-320", b"-0", b"0", b"1", b"-1",
    b"", b"x", b"9" * 5000, b"0." + b"3" * 5000, b"1e99999999999", b"1_000", b"0x1F", b"1,5", b"1.5.2",
    b"--1", b"9223372036854775808", b"-9223372036854775809", b"4294967296", b"1e18", b"1700000000",
    b"2024-02-30", b"25:61:61", b"true", b"None", b"[]", b"\xd9\xa1\xd9\xa2", b"\xc2\xb2", b"1\xc2\xa0000",
    b"1e", b"+", b".",
)  # fmt: skip
"""What stands for a number: limits of floats and integers, other types, digits of other scripts."""

WORDS = (
    b"", b"a\0b", b"../../etc/passwd", b"/dev/stdin", b"~", b"$HOME", b"x" * 5000, b"t", b"time", b"q1",
    b"x", b"y", b"z", b"rx", b"deg", b"rad", b"mm", b"[deg]", b"qw", b"nan", b"\xe2\x80\xae", b"a\nPASS",
    b"%s%n", b"{0}", b"\xff\xfe", b"world", b"base_link", b"fixed", b"revolute", b"urm6", b"constructor",
    b"\x1b[31m",
)  # fmt: skip
"""What stands for a word: names that mean something elsewhere, or break lines, paths and terminals."""


def _replaced(data: bytes, rng: Random, pattern: re.Pattern[bytes], values: Sequence[bytes]) -> bytes:
    """Return data with one match of a pattern replaced, or a few by the same."""
    found = list(pattern.finditer(data))
    if not found:
        return data + rng.choice(values)
    value = rng.choice(values)
    for one in sorted(
        rng.sample(found, min(len(found), rng.choice((1, 1, 2, 10)))), key=lambda m: -m.start()
    ):
        data = data[: one.start()] + value + data[one.end() :]
    return data


def number(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    return _replaced(data, rng, NUMBER, NUMBERS)


def scaled(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Write other powers of ten, signs and digits into a number."""
    kept = rng.choice(NUMBER.findall(data) or [b"1"])
    return _replaced(
        data, rng, NUMBER, [kept + b"e%d" % rng.randint(-30, 30), b"-" + kept, kept[::-1], kept * 2]
    )


def digit(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Change a digit."""
    return _replaced(data, rng, DIGIT, [b"%d" % i for i in range(10)])


def word(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    return _replaced(data, rng, WORD, WORDS)


def exchanged_word(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Put a word of this text, or of another of its kind, in the place of a word."""
    return _replaced(data, rng, WORD, WORD.findall(rng.choice((data, rng.choice(others)))[:20_000]) or WORDS)


def separator(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    old, new = rng.choice(_used(data)), rng.choice(SEPARATORS)
    if rng.random() < 0.5:
        return data.replace(old, new)
    at = data.find(old, rng.randrange(len(data) + 1))
    return data if at < 0 else data[:at] + new + data[at + len(old) :]


def line_end(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    new = rng.choice((b"\r\n", b"\r", b"\n\n", b" \n", b"\x0b", b"\xe2\x80\xa8", b"", b"\n#", b",\n"))
    return data.replace(b"\n", new, rng.choice((-1, 1, 2)))


def lines(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Delete, duplicate, move, repeat or borrow a line."""
    rows = data.split(b"\n")
    i, j = rng.randrange(len(rows)), rng.randrange(len(rows))
    match rng.randrange(6):
        case 0:
            del rows[i]
        case 1:
            rows.insert(j, rows[i])
        case 2:
            rows[i], rows[j] = rows[j], rows[i]
        case 3:
            rows[i:i] = [rows[i]] * int(10.0 ** rng.uniform(0.3, 3.5))
        case 4:
            rows.insert(i, rng.choice(rng.choice(others).split(b"\n")))
        case _:
            rows = rows[: i + 1]
    return b"\n".join(rows)


def columns(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Delete, duplicate or exchange a column, empty it, or move it from some row on."""
    mark = rng.choice(_used(data))
    rows = [row.split(mark) for row in data.split(b"\n")]
    width = max(map(len, rows))
    i, j, how, begin = (
        rng.randrange(width),
        rng.randrange(width),
        rng.randrange(5),
        rng.choice((0, 0, 1, len(rows) // 2)),
    )
    times = int(10.0 ** rng.uniform(0.0, 2.5))
    for row in rows[begin:]:
        if len(row) <= max(i, j):
            continue
        if how == 0:
            del row[i]
        elif how == 1:
            row[j:j] = [row[i]] * times
        elif how == 2:
            row[i], row[j] = row[j], row[i]
        elif how == 3:
            row[i] = b""
        else:
            row[i] = row[j]
    return b"\n".join(mark.join(row) for row in rows)


def recoded(data: bytes, rng: Random, others: Sequence[bytes]) -> bytes:
    """Write the text in another encoding, with or without its mark."""
    text = data.decode("utf-8", "replace")
    return text.encode(
        rng.choice(("utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-8-sig", "cp1252", "cp037")), "replace"
    )


def _used(data: bytes) -> list[bytes]:
    """Return the separators that stand in a text, at least one."""
    return [one for one in SEPARATORS if one in data[:2000]] or [b","]


TEXT: tuple[Mutator, ...] = (
    digit, digit, digit, number, number, scaled, word, exchanged_word, separator, line_end, lines, lines,
    columns, columns, recoded,
)  # fmt: skip
