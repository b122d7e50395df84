"""Mutated program files: text, JSON and notation, each as a name that tells the mutation, and the bytes of the file.

The end of the name is the suffix that the file is to have.  The same seed gives the same files on every machine.
"""

from __future__ import annotations

import itertools
import json
import random
from collections.abc import Callable, Iterator
from typing import Any

from shapeprog.formats.json_form import result_json
from shapeprog.formats.notation import format_notation
from shapeprog.formats.shape import frame_comment
from shapeprog.language.text import format_program, parse
from shapeprog.space import Frame

FRAME = Frame(0.25, (1.0, -2.0, 3.5))

PROGRAMS = tuple(
    parse(text)
    for text in (
        "",
        "leg(at=(-12, -8, -10), size=(16, 2, 2))\n",
        "top_circle(at=(4, 0, 0), thickness=2, radius=9.5)\nbase_circle(at=(-12, 0, 0), thickness=1, radius=5)\n",
        "for i in translate(2, by=(0, 0, 18)):\n"
        "    for j in translate(3, by=(0, 7, 0)):\n"
        "        leg(at=(-12, -8, -10), size=(16, 2, 2))\n"
        "    back(at=(4, 9, -10), size=(8, 1, 2), tilt=2)\n",
        "for i in rotate(4, step=1):\n"
        "    line(start=(-4, 0, 0), end=(-12, 6, 6), radius=0.75)\n"
        "    base_cross(at=(-12, 0, 0), thickness=1, length=7, turn=1)\n",
    )
)
"""What is mutated: nothing, solids of every kind, loops in loops and loops that turn."""

NUMBERS = (
    "0", "-0.0", "1e-38", "1e-45", "1e-320", "5e-324", "-1e-38", "1e19", "-1e19", "1e38", "3.4028234663852886e38",
    "3.5e38", "-3.4e38", "1e308", "1e309", "-1e999", "nan", "inf", "-inf", "NaN", "Infinity", "-Infinity",
    "1" + "0" * 310, "9" * 4400, "0." + "0" * 400 + "1", "64", "65", "1048577", "16777216", "16777217", "-1",
    "2.5", "1_000", "0x10", "1j", "1e", "--1", "+1", "1.", ".5", "\u0661", "\u00bd", "True", "None", "''", "()", "(1,)",
    "[1]", "1,2", "1 2",
)  # fmt: skip
"""Numbers at the ends of what can be said, beyond them, and what is none."""

WORDS = (
    "leg", "legg", "translate", "rotate", "at", "size", "by", "count", "step", "pass", "end", "for", "draw",
    "import os", "__import__('os')", "lambda: 0", "\ud83d\ude00", "e\u0301", "\u202e", "\x1b[2J", "\x00", "\ufeff",
    "'Leg', 'Cub'", "P", "G", "theta*i", "axis", "# frame:", "# frame: {", '# frame: {"scale": 0}', "statement", "body",
    "null", "true", "\t", "\\", ";", ":", "(", ")", "[", "]", "{", "}", "'", '"', "\r", "\x0c", "\u2028", "=", "==",
    "*", "**", "...", "async ", "$",
)  # fmt: skip

Mutation = Callable[[bytes, random.Random], bytes]


def cases(seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and bytes of program files without end: first those that are crafted, then mutations of good files."""
    dice = random.Random(seed)
    yield from crafted()
    for number in itertools.count():
        program = dice.choice(PROGRAMS)
        suffix = dice.choice((".shape", ".json", ".notation"))
        content = _written(suffix, PROGRAMS.index(program))
        names = []
        for _ in range(dice.choice((1, 1, 1, 2, 3))):
            name, mutate = dice.choice(MUTATIONS)
            content = mutate(content, dice)
            names.append(name)
        yield f"{number}-{'-'.join(names)}{suffix}", content


def crafted() -> Iterator[tuple[str, bytes]]:
    """Files made for one weakness each: depth, length, repetition and numbers that are hard to hold."""
    deep = 100_000
    leg = "leg(at=(-12, -8, -10), size=(16, 2, 2))"
    for name, text in (
        ("deep-parentheses", f"leg(at={'(' * deep}1{')' * deep})"),
        ("deep-signs", f"leg(at={'-' * deep}1)"),
        ("deep-sum", "+".join(["1"] * deep)),
        ("deep-attributes", "a" + ".a" * deep),
        ("deep-calls", "a" + "()" * deep),
        ("deep-loops", "".join(f"{' ' * n}for i in translate(2, by=(0, 0, 1)):\n" for n in range(99)) + " " * 99 + leg),
        ("deep-frame", f"# frame: {'[' * deep}\n{leg}"),
        ("deep-frame-object", f'# frame: {{"scale": {"[" * 990}{"]" * 990}}}\n{leg}'),
        ("long-frame-number", f'# frame: {{"scale": {"9" * 400}}}\n{leg}'),
        ("longer-frame-number", f'# frame: {{"scale": {"9" * 5000}}}\n{leg}'),
        ("long-name", "a" * 900_000),
        ("long-text", "a\n" * 600_000),
        ("many-names", "a;" * 400_000),
        ("many-copies", _nest(["translate(1048577, by=(0, 0, 1))"] * 60, leg)),
        ("many-and-none", _nest([*["translate(16777216, by=(0, 0, 1))"] * 62, "translate(0, by=(0, 0, 1))"], leg)),
        ("latin", "leg(at=(1, 2, 3), size=(1, 2, 3))  # \u00e9"),
    ):
        yield f"{name}.shape", text.encode("latin-1" if name == "latin" else "utf-8")
    start = '{"format": "shapeprog", "version": 1, "program": '
    good = result_json(PROGRAMS[1], FRAME)[:-2]
    for name, text in (
        ("deep-lists", start + "[" * deep),
        ("deep-program", start + "[" * 990 + "]" * 990 + "}"),
        ("deep-frame", f'{good}, "frame": {"[" * 980}{"]" * 980}}}'),
        ("deep-snapped", f'{good}, "snapped": {"[" * 980}{"]" * 980}}}'),
        ("deep-scores", f'{good}, "scores": {{"iou": {"[" * 980}{"]" * 980}}}}}'),
        ("long-integer", start + '[{"statement": "leg", "parameters": {"at": [' + "9" * 400 + "]}}]}"),
        ("longer-integer", start + '[{"statement": "leg", "parameters": {"at": [' + "9" * 5000 + "]}}]}"),
        ("long-frame-integer", good.replace('"scale": 0.25', f'"scale": {"9" * 400}') + "}"),
        ("many-keys", start[:-12] + ", ".join(f'"{n}": 0' for n in range(200_000)) + ', "7": 1}'),
        ("long-key", start + '[{"statement": "' + "a" * 1_000_000 + '"}]}'),
        ("scores-text", f'{good}, "scores": "good"}}'),
        ("scores-list", f'{good}, "scores": [1, 2]}}'),
        ("scores-odd", f'{good}, "scores": {{"iou": "x", "cd": null, "f1": [1], "seconds": 1e999}}}}'),
        ("scores-large", f'{good}, "scores": {{"iou": {"9" * 400}, "cd": -1e308, "f1": true}}}}'),
        ("source-list", f'{good}, "source": ["/etc/passwd"]}}'),
        ("source-null-byte", f'{good}, "source": "a\\u0000b"}}'),
        ("source-half", f'{good}, "source": "\\ud800"}}'),
        ("source-long", f'{good}, "source": "{"a" * 5000}"}}'),
        ("source-device", f'{good}, "source": "/dev/zero"}}'),
        ("wide", '{"format"'.encode("utf-16").decode("latin-1")),
    ):
        yield f"{name}.json", text.encode()
    blanks = " " * 100_000
    for name, text in (
        ("blanks-in-group", f"draw('Leg', 'Cub', P=(1, 2,{blanks}x"),
        ("blanks-after-number", f"draw('Leg', 'Cub', P=1{blanks}x"),
        ("blanks-after-copies", f"draw('Leg', 'Cub', P=(1, 2, 3)+i*u{blanks}x"),
        ("blanks-after-end", f"draw('Leg', 'Cub', P=(1, 2, 3), G=(1, 2, 3)){blanks}x"),
        ("blanks-after-word", f"draw('Leg'{blanks}x"),
        ("blanks-in-for", f"for(i<2{blanks}x"),
        ("many-copies", "draw('Leg', 'Cub', P=(1, 2, 3)" + "+i*u" * 100_000 + "x"),
        ("many-numbers", "draw('Leg', 'Cub', P=(" + "1," * 100_000 + "x"),
        ("long-number", "draw('Leg', 'Cub', P=(" + "1" * 100_000 + "x"),
        ("many-words", "draw(" + "'Leg', " * 100_000),
        ("open-quote", "draw('" + "a" * 100_000),
        ("deep-loops", "".join(f"{' ' * n}for(i<2, 'Trans', u=(0, 0, 1))\n" for n in range(2000))),
        ("tilt-of-a-right-angle", "draw('Back', 'Cub', P=(0, 0, 0), G=(3e38, 1, 1), theta=90)"),
        ("tilt-beyond-numbers", "draw('Back', 'Cub', P=(0, 0, 0), G=(1, 1, 1), theta=1e999)"),
        (
            "count-beyond-numbers",
            "for(i<1e999, 'Rot', theta=1, axis)\n    draw('Leg', 'Cub', P=(0, 0, 0), G=(1, 1, 1))",
        ),
        ("deep-frame", f"# frame: {'[' * deep}\n"),
        ("blank-frame", "#" + "\n" * 200_000 + "frame:\n"),
    ):
        yield f"{name}.notation", text.encode()


def _nest(loops: list[str], leg: str) -> str:
    lines = [f"{'    ' * depth}for i in {loop}:" for depth, loop in enumerate(loops)]
    return "\n".join([*lines, "    " * len(loops) + leg])


def _written(suffix: str, number: int) -> bytes:
    program = PROGRAMS[number]
    if suffix == ".json":
        return result_json(program, FRAME, scores={"iou": 0.9, "cd": 1e-4}, source="/nowhere/chair.obj").encode()
    text = format_program(program) if suffix == ".shape" else format_notation(program)
    return (frame_comment(FRAME) + text).encode()


def _spans(content: bytes, letters: str) -> list[tuple[int, int]]:
    """Where runs of such letters begin and end."""
    spans, start = [], None
    for place, byte in enumerate([*content, 0]):
        if chr(byte) in letters:
            start = place if start is None else start
        elif start is not None:
            spans.append((start, place))
            start = None
    return spans


def _number(content: bytes, dice: random.Random) -> bytes:
    """Another number in the place of one."""
    spans = _spans(content, "0123456789.-")
    if not spans:
        return content + dice.choice(NUMBERS).encode()
    start, end = dice.choice(spans)
    return content[:start] + dice.choice(NUMBERS).encode() + content[end:]


def _word(content: bytes, dice: random.Random) -> bytes:
    """Another word in the place of one, or between two."""
    spans = _spans(content, "abcdefghijklmnopqrstuvwxyzPGCLubge'_") or [(0, 0)]
    start, end = dice.choice(spans)
    end = dice.choice((start, end))
    return content[:start] + dice.choice(WORDS).encode("utf-8", "surrogatepass") + content[end:]


def _flipped(content: bytes, dice: random.Random) -> bytes:
    changed = bytearray(content or b" ")
    for _ in range(dice.randint(1, 4)):
        changed[dice.randrange(len(changed))] ^= 1 << dice.randrange(8)
    return bytes(changed)


def _cut(content: bytes, dice: random.Random) -> bytes:
    return content[: dice.randrange(len(content) + 1)]


def _moved(content: bytes, dice: random.Random) -> bytes:
    """A piece taken out, doubled, or put elsewhere."""
    start, end = sorted(dice.randrange(len(content) + 1) for _ in range(2))
    piece, rest = content[start:end], content[:start] + content[end:]
    place = dice.randrange(len(rest) + 1)
    return dice.choice((rest, content[:end] + piece + content[end:], rest[:place] + piece + rest[place:]))


def _lines(content: bytes, dice: random.Random) -> bytes:
    """Lines in another order, indented otherwise, or many times."""
    lines = content.split(b"\n")
    place = dice.randrange(len(lines))
    kind = dice.randrange(4)
    if kind == 0:
        dice.shuffle(lines)
    elif kind == 1:
        lines[place] = dice.choice((b" ", b"\t", b"    ", b"\x0c")) + lines[place]
    elif kind == 2:
        lines[place : place + 1] = [lines[place]] * dice.choice((2, 50, 400))
    else:
        lines[place] = lines[place].lstrip()
    return dice.choice((b"\n", b"\r\n", b"\r")).join(lines)


def _entry(content: bytes, dice: random.Random) -> bytes:
    """Another value in the place of one entry of a JSON file; of other files, a piece of one."""
    try:
        whole: Any = json.loads(content)
    except (ValueError, RecursionError):
        return _moved(content, dice)
    place: Any = whole
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place))) if isinstance(place, list) else []
        if not keys:
            return content
        key = dice.choice(keys)
        if dice.random() < 0.5 or not isinstance(place[key], dict | list):
            break
        place = place[key]
    value: Any = dice.choice(
        (None, True, "", "leg", "\ud800", 1e300, 10**320, -1, [], {}, [[]], {"a": 1}, [None] * 3, "...")
    )
    if isinstance(place, dict) and dice.random() < 0.3:
        del place[key]
    else:
        place[key] = value
    return json.dumps(whole).encode()


def _encoded(content: bytes, dice: random.Random) -> bytes:
    text = content.decode("utf-8", "replace")
    return text.encode(dice.choice(("utf-16", "utf-32", "utf-8-sig", "utf-7")))


MUTATIONS: tuple[tuple[str, Mutation], ...] = (
    ("number", _number), ("number", _number), ("word", _word), ("flip", _flipped), ("cut", _cut), ("move", _moved),
    ("lines", _lines), ("entry", _entry), ("entry", _entry), ("encoding", _encoded),
)  # fmt: skip
