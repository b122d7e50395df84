"""Program files about what parts are: roles around all sorts of things, mirrors, and solids at their ends."""

from __future__ import annotations

from collections.abc import Iterator

from .crafted_programs import LEG, nested

BOX = "box(at=(0, 0, 0), size=(1, 1, 1))"

ROLES = (
    "leg", "leg()", "leg(box)", "leg(1)", "seat()", "seat(at=(1, 2, 3))", "seat(BOX, BOX)", "seat(BOX, at=1)",
    "seat(*BOX)", "seat(leg(BOX))", f"leg({LEG})", "leg(back(at=(0, 0, 0), size=(1, 1, 1), tilt=2))",
    "seat(mirror(side))", "mirror(BOX)", "seat((BOX))", "seat(solid=BOX)", "seat(BOX)(BOX)", "seat.box(BOX)",
    "sofa(BOX)", "box(seat(BOX))", "seat(sofa(BOX))",
)  # fmt: skip
"""Roles around what they may and may not stand around."""

MIRRORS = (
    "mirror", "mirror()", "mirror(side)", "mirror(2)", "mirror(count=2, axis=side)", "mirror(count=3, axis=side)",
    "mirror(axis=up, at=2)", "mirror(side, 2)", "mirror(side, depth)", "mirror('side')", "mirror(left)",
    "mirror(-side)", "mirror(side, at=-3e38)", "mirror(side, at=1e-38)", "mirror(up, at=up)",
    "mirror(side, at=(1, 2))", "mirror(leg)",
)  # fmt: skip

DEGENERATE = (
    "bent_rod(start=(0, 0, 0), through=(0, 0, 0), end=(0, 0, 0), radius=1)",
    "bent_rod(start=(0, 0, 0), through=(0, 0, 5), end=(0, 0, 0), radius=1)",
    "bent_rod(start=(0, 0, 0), through=(0, 0, 4), end=(0, 0, 9), radius=1)",
    "bent_rod(start=(0, 0, 0), through=(0, 1e-5, 4), end=(0, 0, 9), radius=1)",
    "bent_rod(start=(0, 0, 0), through=(0, 0, 15), end=(0, 0, 9), radius=1)",
    "bent_rod(start=(0, 0, -9), through=(0, 1e-3, 9.5), end=(0, 0, 9), radius=20)",
    "bar(start=(1, 1, 1), end=(1, 1, 1), section=(2, 2))",
    "bar(start=(0, 0, 0), end=(5, 5, 5), section=(0, 2), turn=1e38)",
    "rod(start=(0, 0, 0), end=(1e-30, 0, 0), radius=2)",
    "taper(start=(0, 0, 0), end=(9, 0, 0), radius=(0, 0))",
    "taper(start=(0, 0, 0), end=(9, 0, 0), radius=(-1, 3))",
    "taper(start=(0, 0, 0), end=(1e-6, 0, 0), radius=(0, 9))",
    "board(at=(0, 0, 0), size=(9, 9, 1), tilt=90)",
    "board(at=(0, 0, 0), size=(9, 9, 1), tilt=1e38)",
    "cushion(at=(0, 0, 0), size=(2, 9, 9), edge=1)",
    "cushion(at=(0, 0, 0), size=(2, 9, 9), edge=20)",
    "cushion(at=(0, 0, 0), size=(2, 9, 9), edge=-1)",
    "cushion(at=(0, 0, 0), size=(0, 9, 9), edge=1)",
)
"""Solids at the ends of what they can be."""

EXTREMES = ("0", "-1", "1e-38", "1e-6", "1e19", "3e38", "-3e38")
"""What all numbers of a statement are at once."""

JSON_ROLES = (
    '"leg"', '""', "null", "7", '["leg"]', '{"leg": 1}', '"box"', '"mirror"', '"sofa"', f'"{"a" * 100_000}"',
    '"\\u0000"',
)  # fmt: skip
JSON_AXES = (
    '"side"', '["side"]', '"left"', "null", "0", "2.5", "3", "-1", "1e999", "true", '["side", "up"]', "[]", '{"a": 1}',
    "[[0]]",
)  # fmt: skip


def crafted() -> Iterator[tuple[str, bytes]]:
    """Names and contents of such files."""
    from shapeprog.language.statement import language

    drawing = [declared for declared in language() if not declared.is_loop]
    for kind, texts in (
        ("role", [each.replace("BOX", BOX) for each in ROLES]),
        ("deep-roles", ["seat(" * 100_000 + BOX + ")" * 100_000]),
        ("mirror", [nested([each], BOX) for each in MIRRORS]),
        (
            "mirrors",
            [nested([f"mirror({how})"] * count, BOX) for how in ("side", "up, at=3e38") for count in (9, 17, 64)],
        ),
        ("degenerate", [nested(["mirror(side, at=2)"], f"rail({each})") for each in DEGENERATE]),
        ("extreme", [each.call([number] * each.size) for each in drawing for number in EXTREMES]),
    ):
        yield from ((f"{kind}-{number}.shape", text.encode()) for number, text in enumerate(texts))
    start, end = '{"format": "shapeprog", "version": 1, "program": [', "]}"
    box = '{"statement": "box", "parameters": {"at": [0, 0, 0], "size": [1, 1, 1]}'
    mirror = '{"statement": "mirror", "parameters": {"axis": AXIS}, "body": '
    for kind, texts in (
        ("role", [f'{box}, "role": {role}}}' for role in JSON_ROLES]),
        ("loop-role", [mirror.replace("AXIS", '"up"') + '[], "role": "leg"}']),
        ("mirror", [f"{mirror.replace('AXIS', axis)}[{box}}}]}}" for axis in JSON_AXES]),
    ):
        yield from ((f"{kind}-{number}.json", (start + text + end).encode()) for number, text in enumerate(texts))
