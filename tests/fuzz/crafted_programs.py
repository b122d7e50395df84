"""Program files made for one weakness each: depth, length, repetition, copies and numbers that are hard to hold."""

from __future__ import annotations

from collections.abc import Iterator

LEG = "leg(at=(-12, -8, -10), size=(16, 2, 2))"

COPIES = (
    *((count, "0.01") for count in ("0", "2", "1000", "100000", "1048576", "1e12", "3e38")),
    *(("1000", step) for step in ("0", "7", "1e19", "3e38")),
    *(("100000", step) for step in ("0", "7")),
    ("1048576", "1e19"),
)
"""How often a leg is repeated, and how far apart."""


def crafted() -> Iterator[tuple[str, bytes]]:
    """Names and contents of such files."""
    from shapeprog.formats.json_form import program_to_json
    from shapeprog.language.parser import parse
    from shapeprog.space import Frame

    deep = 100_000
    for number, (count, step) in enumerate(COPIES):
        yield f"copies-{number}.shape", nested([f"translate({count}, by=({step}, 3, 0))"], LEG).encode()
    for name, text in (
        ("deep-parentheses", f"leg(at={'(' * deep}1{')' * deep})"),
        ("deep-signs", f"leg(at={'-' * deep}1)"),
        ("deep-sum", "+".join(["1"] * deep)),
        ("deep-attributes", "a" + ".a" * deep),
        ("deep-calls", "a" + "()" * deep),
        ("deep-loops", "".join(f"{' ' * n}for i in translate(2, by=(0, 0, 1)):\n" for n in range(99)) + " " * 99 + LEG),
        ("deepest-loops", nested(["translate(1, by=(0, 0, 1))"] * 64, LEG)),
        ("many-lines", f"{LEG}\n" * 2000),
        ("long-frame-number", f"# placed: up y, front z, origin 0 0 0, 1 unit = {'9' * 5000}\n{LEG}"),
        ("long-direction", f"# placed: up {'9' * 400} 0 0, front z, origin 0 0 0, 1 unit = 1\n{LEG}"),
        ("long-name", "a" * 900_000),
        ("long-text", "a\n" * 600_000),
        ("many-names", "a;" * 400_000),
        ("many-copies", nested(["translate(1048577, by=(0, 0, 1))"] * 60, LEG)),
        ("many-and-none", nested([*["translate(16777216, by=(0, 0, 1))"] * 62, "translate(0, by=(0, 0, 1))"], LEG)),
        ("latin", "leg(at=(1, 2, 3), size=(1, 2, 3))  # \u00e9"),
    ):
        yield f"{name}.shape", text.encode("latin-1" if name == "latin" else "utf-8")
    start = '{"format": "shapeprog", "version": 4, "text": '
    good = program_to_json(parse(LEG), Frame(0.25, (1.0, -2.0, 3.5)))[:-2]
    for name, text in (
        ("deep-lists", start + "[" * deep),
        ("deep-program", start + "[" * 990 + "]" * 990 + "}"),
        ("deep-frame", f'{good}, "frame": {"[" * 980}{"]" * 980}}}'),
        ("deep-snapped", f'{good}, "snapped": {"[" * 980}{"]" * 980}}}'),
        ("deep-scores", f'{good}, "scores": {{"iou": {"[" * 980}{"]" * 980}}}}}'),
        ("long-integer", f'{good}, "snapped": {"9" * 400}}}'),
        ("longer-integer", f'{good}, "snapped": {"9" * 5000}}}'),
        ("text-of-mistakes", start + '"leg(at=(1, 2, 3), size=(' + "9" * 400 + ', 1, 1))"}'),
        ("text-deep", start + '"leg(at=' + "(" * 990 + ')"}'),
        ("text-half", start + '"\\ud800"}'),
        ("many-keys", start[:-9] + ", ".join(f'"{n}": 0' for n in range(200_000)) + ', "7": 1}'),
        ("long-key", f'{good}, "{"a" * 1_000_000}": 0}}'),
        ("scores-text", f'{good}, "scores": "good"}}'),
        ("scores-list", f'{good}, "scores": [1, 2]}}'),
        ("scores-odd", f'{good}, "scores": {{"iou": "x", "cd": null, "f1_percent": [1], "seconds": 1e999}}}}'),
        ("scores-large", f'{good}, "scores": {{"iou": {"9" * 400}, "cd": -1e308, "f1_percent": true}}}}'),
        ("source-list", f'{good}, "source": ["/etc/passwd"]}}'),
        ("source-null-byte", f'{good}, "source": "a\\u0000b"}}'),
        ("source-half", f'{good}, "source": "\\ud800"}}'),
        ("source-long", f'{good}, "source": "{"a" * 5000}"}}'),
        ("source-device", f'{good}, "source": "/dev/zero"}}'),
        ("wide", '{"format"'.encode("utf-16").decode("latin-1")),
    ):
        yield f"{name}.json", text.encode()
    yield "blank-frame.shape", ("#" + "\n" * 200_000 + "placed:\n").encode()


def nested(loops: list[str], drawn: str) -> str:
    """The text of loops in each other around a statement."""
    lines = [f"{'    ' * depth}for i in {loop}:" for depth, loop in enumerate(loops)]
    return "\n".join([*lines, "    " * len(loops) + drawn])
