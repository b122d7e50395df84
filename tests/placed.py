"""Random programs whose parts are placed from the sides of a box: every form of the language, all of it legal."""

from __future__ import annotations

import random

from shapeprog.language.placement import AXES, SIZES

ROLES = ("seat", "leg", "shelf", "drawer", "rail", "back")
NAMES = ("thickness", "gap", "inset", "radius", "overhang")
INDENT = "    "


class Author:
    """Writes one program.

    Lengths are shares of the box around: ``width * 0.2`` where its size is not known, such as in functions; else often
    numbers and names.  Sides take at most .3 of a size and sizes are at most .4 of it, so that nothing vanishes.
    """

    def __init__(self, seed: int) -> None:
        self.choice = random.Random(seed)
        self.names: dict[str, float] = {}
        self.functions: list[tuple[str, list[str], bool]] = []

    def program(self) -> str:
        sizes = [self.choice.choice((40, 60.5, 75, 120)) for _ in SIZES]
        lines = ["# unit: cm"] * self.chance(0.5)
        if self.chance(0.2):
            lines.append(f"diameter = {sizes[0]}")
            lines.append(f"width, depth, height = diameter, {sizes[1]}, {sizes[2]}")
        else:
            lines.append(f"width, depth, height = {', '.join(map(str, sizes))}")
        for name in self.choice.sample(NAMES, self.choice.randint(0, 4)):
            self.names[name] = round(self.choice.uniform(1, 4), 1)
            used = [other for other in self.names if other != name]
            if used and self.chance(0.2):
                other = self.choice.choice(used)
                self.names[name] = self.names[other] / 2
                lines.append(f"{name} = {other} / 2")
            else:
                lines.append(f"{name} = {self.names[name]}{self.note()}")
        for number in range(self.choice.randint(0, 2)):
            lines += self.function(f"part_{number}")
        for _ in range(self.choice.randint(1, 5)):
            lines += self.line(dict(zip(SIZES, sizes, strict=True)), 2)
        return "\n".join(lines) + "\n"

    def function(self, name: str) -> list[str]:
        parameters = self.choice.sample(("share", "edge", "gap"), self.choice.randint(0, 2))
        with_defaults = [f"{each}={round(self.choice.uniform(0.1, 0.3), 2)}" for each in parameters]
        required = bool(parameters) and self.chance(0.5)
        head = [parameters[0], *with_defaults[1:]] if required else with_defaults
        lines = [f"def {name}({', '.join(head)}):"]
        lines += [f"{INDENT}inner_{each} = width * {each} / 2" for each in parameters]
        lines += [f"{INDENT}box(left=inner_{each}, height=height * {each})" for each in parameters]
        for _ in range(self.choice.randint(1, 2)):
            lines += [f"{INDENT}{line}" for line in self.line(None, 1)]
        self.functions.append((name, parameters, required))
        return lines

    def line(self, box: dict[str, float] | None, depth: int) -> list[str]:
        """One statement, or a loop or group with its body, in a box of known size."""
        kind = self.choice.random()
        if depth and kind < 0.4:
            return self.group(box, depth)
        if self.functions and kind < 0.55:
            return [self.call(box) + self.note()]
        return [self.part(box) + self.note()]

    def group(self, box: dict[str, float] | None, depth: int) -> list[str]:
        kind = self.choice.choice(("inside", "divide", "mirror", "rotate", "translate", "row"))
        count, inner, first = self.count(), box, None
        if kind == "inside":
            words, inner = self.box(box)
            head = f"with inside({', '.join([*words, *self.tilt()])}):"
        elif kind == "divide":
            words, inner = self.box(box)[0], None
            axis = self.choice.randrange(3)
            gap = [f"gap={round(self.choice.uniform(0, 0.3), 2)}"] * self.chance(0.5)
            head = f"for _ in divide({', '.join([count, 'xyz'[axis], *words, *gap, *self.tilt()])}):"
        elif kind == "mirror":
            head = f"for _ in mirror({', '.join(self.point(box, least=1))}):"
        elif kind == "rotate":
            step = [f"step={self.choice.choice((20, 45, -30.5))}"] * self.chance(0.4)
            head = f"for _ in rotate({', '.join([count, *self.point(box, axes=2), *step])}):"
        elif kind == "translate":
            steps = [f"{axis}={round(self.choice.uniform(-9, 9), 1)}" for axis in self.some("xyz")]
            head = f"for _ in translate({', '.join([count, *steps])}):"
        else:
            head, first = f"for _ in row({count}, last=at({', '.join(self.point(box, least=1))})):", self.part(box)
        body = [first] if first else []
        for _ in range(self.choice.randint(0 if body else 1, 2)):
            body += self.line(inner, depth - 1)
        return [head, *(f"{INDENT}{line}" for line in body)]

    def call(self, box: dict[str, float] | None) -> str:
        name, parameters, required = self.choice.choice(self.functions)
        words = self.box(box)[0] if self.chance(0.7) else []
        for place, word in enumerate(parameters):
            if (required and not place) or self.chance(0.4):
                words.append(f"{word}={round(self.choice.uniform(0.1, 0.3), 2)}")
        return self.with_role(f"{name}({', '.join([*words, *self.tilt()])})")

    def part(self, box: dict[str, float] | None) -> str:
        words = self.box(box)[0]
        small = round(self.choice.uniform(0.5, 2), 1)
        radius = self.choice.choice([*(name for name in self.names if self.names[name] < 3), str(small)])
        pair = f"radius=({radius}, {small + 0.5})"
        kind = self.choice.choice(
            ("box", "role", "cushion", "cylinder", "round", "taper", "rod", "cone", "bent_rod", "bar")
        )
        if kind == "role":
            return f"{self.choice.choice(ROLES)}({', '.join([*words, *self.tilt()])})"
        if kind == "box":
            lean = [f"lean={round(self.choice.uniform(-4, 4), 1)}"] * self.chance(0.3)
            return self.with_role(f"box({', '.join([*words, *lean, *self.tilt()])})")
        if kind == "cushion":
            return self.with_role(f"cushion({', '.join([*words, f'edge={small}', *self.tilt()])})", must=True)
        vertical = [word for word in words if word.split("=")[0] in AXES[2]]
        if kind == "cylinder":
            size = f"{self.choice.choice(SIZES[:2])}={radius}"
            return self.with_role(f"cylinder({', '.join([size, *vertical, *self.tilt()])})")
        if kind in ("round", "taper"):
            places = self.point(box, axes=2)
            form = (self.choice.choice(("cylinder", "rod")), f"radius={radius}") if kind == "round" else ("taper", pair)
            return self.with_role(f"{form[0]}({', '.join([*places, *vertical, form[1], *self.tilt()])})")
        return self.with_role(self.between(kind, box, radius, pair))

    def between(self, kind: str, box: dict[str, float] | None, radius: str, pair: str) -> str:
        """A solid from a side to the opposite one along an axis."""
        axis = self.choice.randrange(3)
        words, others = AXES[axis], [each for each in range(3) if each != axis]
        start = f"{words.low}={self.length(box, axis, 0.02, 0.3)}"
        end = f"{words.high}={self.length(box, axis, 0.02, 0.3)}"
        side = AXES[self.choice.choice(others)].high
        aside = f"{side}={self.length(box, [side in each for each in AXES].index(True), 0.1, 0.3)}"
        points = f"start=at({start}{self.choice.choice(('', f', {aside}'))}), "
        if kind == "bent_rod":
            bow = AXES[others[0]].offset
            return f"bent_rod({points}through=at({words.offset}=0, {bow}=1.5), end=at({end}), radius={radius})"
        points += f"end=at({end})"
        if kind == "bar":
            sizes = ", ".join(f"{SIZES[each]}={self.length(box, each, 0.02, 0.1)}" for each in others)
            turn = self.choice.choice(("", ", turn=30", ", turn=-12.5"))
            return f"bar({points}, {sizes}{turn})"
        return f"rod({points}, radius={radius})" if kind == "rod" else f"taper({points}, {pair})"

    def box(self, box: dict[str, float] | None) -> tuple[list[str], dict[str, float] | None]:
        """Keywords of a box in a box; the size of the new one is not tracked."""
        words: list[str] = []
        for axis, (low, high, size, offset) in enumerate(AXES):
            forms = ((), (size,), (low,), (high,), (low, size), (high, size), (low, high), (offset, size))
            for word in self.choice.choice(forms):
                least, most = (0.2, 0.4) if word == size else (-0.1, 0.3)
                words.append(f"{word}={self.length(box, axis, least, most)}")
        return words, None if words else box

    def point(self, box: dict[str, float] | None, least: int = 0, axes: int = 3) -> list[str]:
        chosen = self.some(range(axes), least)
        words = [(axis, self.choice.choice([word for word in AXES[axis] if word not in SIZES])) for axis in chosen]
        return [f"{word}={self.length(box, axis, -0.1, 0.4)}" for axis, word in words]

    def length(self, box: dict[str, float] | None, axis: int, least: float, most: float) -> str:
        """A length along an axis: a number, a name, or an expression."""
        share = round(self.choice.uniform(least, most), 2)
        if box is None or self.chance(0.15):
            return f"{SIZES[axis]} * {share}" if share >= 0 else f"-{SIZES[axis]} * {-share}"
        value = round(share * box[SIZES[axis]], 1)
        names = [name for name, number in self.names.items() if 0 < number < value]
        if names and self.chance(0.4):
            name = self.choice.choice(names)
            rest = round(value - self.names[name], 1)
            return self.choice.choice((name, f"{rest} + {name}", f"{value} - {name} / 2", f"({name} + {rest}) / 2"))
        return str(value)

    def count(self) -> str:
        return self.choice.choice(("0", "1", "2", "3", "4", "2.5", "5 / 2", "-1"))

    def tilt(self) -> list[str]:
        return [f"tilt={self.choice.choice((5, -10, 12.5))}"] * self.chance(0.2)

    def with_role(self, solid: str, must: bool = False) -> str:
        return f"{self.choice.choice(ROLES)}({solid})" if must or self.chance(0.5) else solid

    def some(self, of: str | range, least: int = 1) -> list:
        return sorted(self.choice.sample(list(of), self.choice.randint(least, len(of))))

    def note(self) -> str:
        return self.choice.choice(("", "", "", "", "", "", "  # twice", "  # größe"))

    def chance(self, share: float) -> bool:
        return self.choice.random() < share


def placed_text(seed: int) -> str:
    """The text of a random placed program."""
    return Author(seed).program()
