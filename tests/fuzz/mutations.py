"""Ways to break bytes and text, each a function of a random generator alone, so that a seed says which case it was."""

from __future__ import annotations

import itertools
import re
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from random import Random

Mutation = Callable[[Random, bytes], bytes]

INTEGERS = (0, 1, 2, 3, 255, 256, 32767, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62, 2**63 - 1, 2**64 - 1)
FLOATS = (0.0, -0.0, 1e-38, 1e-30, 5e-324, 1e19, -1e19, 3e38, -3e38, 1.7e308, float("nan"), float("inf"), -float("inf"))
WORDS = (
    "0", "-0", "-1", "1", "2147483648", "-2147483649", "18446744073709551616", "1e19", "-1e19", "3e38", "-3e38",
    "3.5e38", "1e-38", "5e-324", "1.7e308", "1e999", "nan", "-nan", "inf", "-inf", "1" + 400 * "0", 5000 * "9", "0x10",
    "1_0", "1,5", "1e", ".", "-", "\u0663", "true", "null", '"4"', "", "1/1", "1//2", "64", "65", "1048577", "16777217",
    "3.4028234663852886e38", "1e-45", "1e309", "0." + 400 * "0" + "1", "2.5", "1j", "--1", "+1", "\u00bd",
    "()", "(1,)", "[1]", "1 2",
)  # fmt: skip
"""What is written in the place of a number."""

_NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_LONGEST = 1 << 20


def flip_bits(random: Random, content: bytes) -> bytes:
    """One to eight single bits."""
    changed = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 8)) if content else 0):
        changed[_place(random, content)] ^= 1 << random.randrange(8)
    return bytes(changed)


def set_run(random: Random, content: bytes) -> bytes:
    """A run of bytes becomes all zero, all ones, or blanks."""
    start, stop = _run(random, content)
    return content[:start] + random.choice((b"\0", b"\xff", b" ")) * (stop - start) + content[stop:]


def repeat_run(random: Random, content: bytes) -> bytes:
    """A run of bytes comes several times."""
    start, stop = _run(random, content)
    return (content[:stop] + content[start:stop] * random.choice((1, 2, 50)) + content[stop:])[:_LONGEST]


def delete_run(random: Random, content: bytes) -> bytes:
    """A run of bytes is left out."""
    start, stop = _run(random, content)
    return content[:start] + content[stop:]


def cut(random: Random, content: bytes) -> bytes:
    """The end is missing: anything, or a little."""
    return content[: max(0, len(content) - random.choice((1, 2, 7, random.randint(0, len(content)))))]


def insert(random: Random, content: bytes) -> bytes:
    """Foreign bytes at some place, at the front or at the end."""
    at = random.choice((0, len(content), random.randint(0, len(content))))
    return content[:at] + random.randbytes(random.choice((1, 3, 16, 300))) + content[at:]


def set_number(random: Random, content: bytes) -> bytes:
    """A number of 1, 2, 4 or 8 bytes at some place becomes an extreme one."""
    width = random.choice((1, 2, 4, 4, 8))
    order = random.choice("<<>")
    if width >= 4 and random.random() < 0.4:
        value = random.choice(FLOATS)
        number = struct.pack(order + ("f" if width == 4 else "d"), value if width == 8 or abs(value) < 3.4e38 else 0.0)
    else:
        number = (random.choice(INTEGERS) % 256**width).to_bytes(width, "little" if order == "<" else "big")
    start = random.choice((random.randint(0, min(len(content), 120)), random.randint(0, len(content))))
    return content[:start] + number + content[start + width :]


def write_number(random: Random, content: bytes) -> bytes:
    """A number that is written in digits becomes an extreme one, or another kind of word."""
    return replaced(random, content, _NUMBER, lambda _: random.choice(WORDS).encode())


def count_otherwise(random: Random, content: bytes) -> bytes:
    """A written whole number grows or shrinks a little: what is announced is not what there is."""
    step = random.choice((-2, -1, 1, 2, 10))
    return replaced(random, content, re.compile(rb"\d{1,15}"), lambda found: str(int(found) + step).encode())


def change_words(random: Random, content: bytes) -> bytes:
    """A word is doubled, left out, changed with another, or becomes another."""
    words = re.split(rb"(\s+)", content)
    one, two = (2 * random.randrange((len(words) + 1) // 2) for _ in range(2))
    if random.random() < 0.5:
        one, two = (each % 40 // 2 * 2 for each in (one, two))  # within the head
    one, two = min(one, len(words) - 1), min(two, len(words) - 1)
    how = random.randrange(4)
    if how == 0:
        words[one] = words[one] + b" " + words[one]
    elif how == 1:
        words[one] = b""
    elif how == 2:
        words[one], words[two] = words[two], words[one]
    else:
        words[one] = words[two]
    return b"".join(words)


def change_lines(random: Random, content: bytes) -> bytes:
    """A line is doubled, left out, moved, indented, joined with the next or very long, or all end in another way."""
    lines = content.split(b"\n")
    at, to = random.randrange(len(lines)), random.randrange(len(lines))
    how = random.randrange(8)
    if how == 0:
        lines[at:at] = [lines[at]] * random.choice((1, 1, 40))
    elif how == 1:
        del lines[at]
    elif how == 2:
        lines.insert(to, lines.pop(at))
    elif how == 3:
        lines[at] += random.choice((b"\\", b" ", b"#", b"\x0b", b"\x85")) + b"".join(lines[at + 1 : at + 2])
    elif how == 4:
        lines[at] = lines[at] * random.choice((3, 2000))
    elif how == 5:
        lines[at] = random.choice((b" ", b"\t", b"    ", b"\x0c")) + lines[at]
    elif how == 6:
        lines[at] = lines[at].lstrip()
    return random.choice((b"\r\n", b"\r", b"\n\n") if how == 7 else (b"\n",)).join(lines)[:_LONGEST]


def change_letters(random: Random, content: bytes) -> bytes:
    """Something that text should not hold: a null byte, half a character, another encoding, a byte order mark."""
    at = random.randint(0, len(content))
    odd = random.choice(
        (b"\0", b"\xff", b"\xc3", b"\xed\xa0\x80", "\u2028".encode(), b"\x1b[31m", b"\t", b"\x1a", b'"')
    )
    if random.random() < 0.5:
        return content[:at] + odd + content[at:]
    return content.decode("latin-1").encode(random.choice(("utf-8-sig", "utf-16", "utf-32", "utf-7")))


BYTES: tuple[Mutation, ...] = (flip_bits, set_run, repeat_run, delete_run, cut, insert, set_number)
TEXT: tuple[Mutation, ...] = (write_number, write_number, count_otherwise, change_words, change_lines, change_letters)


def splice(random: Random, content: bytes, other: bytes) -> bytes:
    """The front of one file and the back of another, or a piece of the other within."""
    at = random.randint(0, len(content))
    start, stop = _run(random, other)
    return content[:at] + random.choice((other[random.randint(0, len(other)) :], other[start:stop] + content[at:]))


def mutated(random: Random, content: bytes, ways: Sequence[Mutation], others: Sequence[bytes]) -> bytes:
    """``content`` after one to three of the ``ways``, or spliced with one of the ``others``."""
    if random.random() < 0.05:
        return splice(random, content, random.choice(others))
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        content = random.choice(ways)(random, content)
    return content


def replaced(random: Random, content: bytes, pattern: re.Pattern[bytes], by: Callable[[bytes], bytes]) -> bytes:
    """``content`` with one match of a pattern replaced, as often as not one of the first twelve."""
    found = list(pattern.finditer(content))
    if not found:
        return content
    one = random.choice(random.choice((found, found[:12])))  # counts stand in the head
    return content[: one.start()] + by(one[0]) + content[one.end() :]


def mutants_of(
    valid: Mapping[str, bytes], ways: Mapping[str, Sequence[Mutation]], seed: int
) -> Iterator[tuple[str, bytes]]:
    """Names and contents without an end of valid files that are mutated in the ``ways`` of their suffix."""
    listed = list(valid.items())
    often = [1 if len(content) < _LONGEST else 0.1 for _, content in listed]
    for index in itertools.count():
        random = Random(f"{seed}/{index}")
        [(name, content)] = random.choices(listed, often)
        stem, _, suffix = name.rpartition(".")
        others = [each for other, each in listed if other.endswith(suffix)]
        yield f"{stem}-{index}.{suffix}", mutated(random, content, ways[f".{suffix}"], others)


def _place(random: Random, content: bytes) -> int:
    """Some byte, one in three times within the head."""
    return random.randrange(min(len(content), random.choice((160, _LONGEST, _LONGEST))))


def _run(random: Random, content: bytes) -> tuple[int, int]:
    start = _place(random, content) if content else 0
    return start, min(len(content), start + random.choice((1, 2, 4, 16, 100, 1000)))
