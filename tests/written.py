"""Random programs with names, expressions, functions and comments: whatever can be written, all of it legal."""

from __future__ import annotations

import random
from collections.abc import Sequence

import torch

from shapeprog.data.random import random_program
from shapeprog.errors import ShapeProgError
from shapeprog.language import Program, evaluated, language
from shapeprog.language.ast import (
    Assignment,
    Call,
    Comment,
    Draw,
    Function,
    Line,
    Loop,
    Source,
    values,
)
from shapeprog.language.expression import Binary, Expression, Name, Negative, Value, value_at
from shapeprog.language.parameters import Quantity, to_float32

WORDS = ("width", "depth", "height", "thick", "gap", "i", "at", "up", "span_2", "n", "größe", "_")
REMARKS = ("the floor", "# twice", "frame", "ties: a = b", "übung  mit   Lücken", "def legs():")


class Writer:
    """Draws one program; ``plain`` numbers come from a random one."""

    def __init__(self, seed: int) -> None:
        self.choice = random.Random(seed)
        generator = torch.Generator().manual_seed(seed)
        self.nodes = list(random_program(generator, blocks=self.choice.randint(1, 5), copies=3).body)
        self.defaults: dict[str, float] = {}

    def program(self) -> Program:
        scope: dict[str, float] = {}
        named: list[Assignment] = []
        for name in self.choice.sample(WORDS, self.choice.randint(0, 6)):
            value = self.expression(scope, 2) if scope and self.chance(0.4) else self.number()
            named.append(Assignment(((name, value),), self.note()))
            scope[name] = value_at(value, scope)
        functions, body = [], []
        for number in range(self.choice.randint(0, 2)):
            functions.append(self.function(f"part_{number}", scope, functions))
        for node in self.nodes:
            body += self.lines(node, scope, functions)
        body = self.remarked(body)
        used = used_in([*functions, *body])
        kept: list[Assignment] = []
        for line in reversed(named):
            if line.numbers[0][0] in used:
                kept.insert(0, line)
                used |= used_in([line])
        return evaluated(Source((*self.remarked(self.joined(kept)), *functions, *body)))

    def joined(self, lines: list[Assignment]) -> list[Line]:
        """Some lines put together, where the second does not need the first."""
        found: list[Assignment] = []
        for line in lines:
            if found and self.chance(0.3) and not used_in([line]) & {name for name, _ in found[-1].numbers}:
                found[-1] = Assignment((*found[-1].numbers, *line.numbers), found[-1].note)
            else:
                found.append(line)
        return list(found)

    def function(self, name: str, outer: dict[str, float], functions: list[Function]) -> Function:
        wanted = self.choice.sample(WORDS, self.choice.randint(0, 3))
        scope = outer | {word: self.number() for word in wanted}
        body: list[Line] = []
        if self.chance(0.5):
            local = f"inner_{len(functions)}"
            body.append(Assignment(((local, self.expression(scope, 2)),), self.note()))
            scope[local] = value_at(body[0].numbers[0][1], scope)
            body.append(self.draw(scope, Name(local)))
        node = self.nodes[self.choice.randrange(len(self.nodes))]
        body = self.remarked([*body, *self.lines(node, scope, functions)])
        used = used_in(body)
        plain = [word for word in wanted if word in used]
        given = self.choice.randint(0, len(plain))
        self.defaults |= {f"{name}.{word}": scope[word] for word in plain}
        parameters = [(word, None if place < given else scope[word]) for place, word in enumerate(plain)]
        return Function(name, tuple(parameters), tuple(body), self.note())

    def lines(self, node: Draw | Loop, scope: dict[str, float], functions: list[Function]) -> list[Line]:
        found: list[Line] = []
        if isinstance(node, Draw):
            roles = ["", *(role for role in ("seat", "handle", "rail") if role not in WORDS)]
            found.append(Draw(node.name, self.mixed(node, scope), self.choice.choice(roles), self.note()))
        else:
            body = [line for inner in node.body for line in self.lines(inner, scope, functions)]
            found.append(Loop(node.name, self.mixed(node, scope), tuple(self.remarked(body)), self.note()))
        if functions and self.chance(0.4):
            called = self.choice.choice(functions)
            arguments = [  # what a number is inside of a function decides whether it divides by zero
                (name, self.defaults[f"{called.name}.{name}"])
                for name, default in called.parameters
                if default is None or self.chance(0.5)
            ]
            roles = ["", *(role for role in ("leg", "handle", "rail") if role not in WORDS)]
            found.append(Call(called.name, tuple(arguments), self.note(), self.choice.choice(roles)))
        return found

    def draw(self, scope: dict[str, float], value: Value) -> Line:
        return Draw("top_square", (value, 0.0, 1.5, 2.0, self.expression(scope, 1)), "", self.note())

    def mixed(self, node: Draw | Loop, scope: dict[str, float]) -> tuple[Value, ...]:
        quantities = language()[node.name].quantities
        return tuple(self.slot(q, value, scope) for q, value in zip(quantities, node.values, strict=True))

    def slot(self, quantity: Quantity, value: float, scope: dict[str, float]) -> Value:
        if quantity.kind == "axis" or not quantity.written_out or self.chance(0.5):
            return value
        if not quantity.discrete:
            return self.expression(scope, 3)
        whole = [name for name, number in scope.items() if 0 <= number <= 4 and number == round(number)]
        return Name(self.choice.choice(whole)) if whole else Binary("+", value - 1.0, 1.0)

    def expression(self, scope: dict[str, float], depth: int) -> Expression:
        """One that has a value that float32 holds."""
        while True:
            found = self.tree(scope, depth)
            try:
                to_float32(value_at(found, scope))
            except ShapeProgError:
                continue
            if isinstance(found, Expression):
                return found

    def tree(self, scope: dict[str, float], depth: int) -> Value:
        if depth == 0 or self.chance(0.2):
            return Name(self.choice.choice([*scope])) if scope and self.chance(0.7) else self.number()
        if self.chance(0.15):
            inner = self.tree(scope, depth - 1)
            return Negative(inner) if isinstance(inner, Expression) else -inner
        sides = self.tree(scope, depth - 1), self.tree(scope, depth - 1)
        return Binary(self.choice.choice("+-*/"), *sides)

    def number(self) -> float:
        some = (float(self.choice.randint(0, 4)), self.choice.uniform(-9, 9), self.choice.choice((0.1, 1e-20, -0.0)))
        return to_float32(self.choice.choice(some))

    def remarked(self, lines: list[Line]) -> list[Line]:
        found: list[Line] = []
        for line in lines:
            while self.chance(0.2):
                found.append(Comment(self.choice.choice(("", *REMARKS))))
            found.append(line)
        return [*found, Comment(self.choice.choice(REMARKS))] if self.chance(0.1) else found

    def note(self) -> str:
        return self.choice.choice(REMARKS) if self.chance(0.15) else ""

    def chance(self, share: float) -> bool:
        return self.choice.random() < share


def used_in(lines: Sequence[Line]) -> set[str]:
    """The names that lines take from around them."""
    found: set[str] = set()
    for line in lines:
        found |= {name.name for value in values(line) if isinstance(value, Expression) for name in value.names()}
        if isinstance(line, Loop):
            found |= used_in(line.body)
        if isinstance(line, Function):
            own = {name for name, _ in line.parameters}
            own |= {name for each in line.body if isinstance(each, Assignment) for name, _ in each.numbers}
            found |= used_in(line.body) - own
    return found


def written_program(seed: int) -> Program:
    """A random program, most often one with names."""
    return Writer(seed).program()
