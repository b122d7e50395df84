"""Canonical program text.

Every float32 survives, negative zero and negative lengths included (which draw nothing); counts and turns are whole.
``parse(format_program(program)) == program`` for programs that were parsed and for statements in cells.  Placed parts
that were inferred or set to other numbers keep a scale that their text does not hold: they read back with the same text
in the grid of that text, and lie in the same place of the world in the frame with which they are saved.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import takewhile

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.ast import (
    Assignment,
    Call,
    Comment,
    Function,
    Group,
    Keywords,
    Line,
    Loop,
    Part,
    Point,
    Source,
    note_of,
)
from shapeprog.language.expression import Value, names_in, text_of
from shapeprog.language.placement import ROUND_ROLES
from shapeprog.language.program import DEEPEST, Draw, Node, Program, program_of
from shapeprog.language.statement import language
from shapeprog.language.text import LONGEST
from shapeprog.language.unit import HEAD

INDENT = "    "  # one level of indentation


def format_program(program: Program) -> str:
    """The canonical text of a program: parameters by name in declared order, the fewest digits, loops i, j, k...

    Names, expressions, functions and comments stand as they are written.  A ``ShapeProgError`` if this is no program,
    a number is not finite, a statement is not declared or has more or fewer, or the text would be longer, or its loops
    deeper, than can be read back.
    """
    return format_source(source_of(program))


def format_source(source: Source) -> str:
    """The canonical text of a program as it is written, see :func:`format_program`."""
    text = "".join(f"{line}\n" for line, _ in printed(source))
    if len(text) > LONGEST:
        raise ShapeProgError(f"the text of this program has more than {LONGEST:,} letters", "write loops")
    return text


def printed(source: Source) -> list[tuple[str, Line | None]]:
    """The rows of the canonical text, and of each the line that it is; ``None`` for its unit and the word ``pass``."""
    head: list[tuple[str, Line | None]] = []
    if source.unit and source.unit.name:
        head.append((f"# {HEAD} {source.unit.name}", None))
    for line in () if head else takewhile(lambda line: isinstance(line, Comment), source.lines):
        if isinstance(line, Comment) and re.fullmatch(rf"{HEAD}[ \t]*\S+", line.text):
            raise ShapeProgError(f"the comment {line.text!r} would be read as the unit of the text", "reword it")
    return [*head, *_lines(source.lines, 0, 0)]


def source_of(program: Program) -> Source:
    """A program as it is written; one without names as its statements and loops."""
    program = program_of(program)
    return program.source or Source(program.body)


def numbers_written(node: Node) -> int:
    """How many continuous numbers the line of a statement or loop has; counts and steps of loops are none."""
    return language()[node.name].written(node.values)


def checked_role(node: Draw) -> str:
    """The role of a part; a ``ShapeProgError`` if it is not declared, or no other than the name of its statement."""
    if node.role and node.role not in language().roles:
        raise ShapeProgError(f"unknown role {node.role!r}", did_you_mean(node.role, language().roles))
    if node.role == node.name:
        message = f"redundant role: {node.name}(...) already has the role {node.name!r}"
        raise ShapeProgError(message, "leave the role out")
    return node.role


def _lines(lines: Iterable[Line], depth: int, loops: int) -> Iterator[tuple[str, Line | None]]:
    """The lines of a block."""
    indent, empty = INDENT * depth, True
    for line in lines:
        if isinstance(line, Comment):
            yield f"{indent}# {_remark(line.text)}" if line.text else "", line
            continue
        empty = False
        note = f"  # {_remark(text)}" if (text := note_of(line)) else ""
        match line:
            case Draw():
                role, call = checked_role(line), _call(line)
                yield f"{indent}{f'{role}({call})' if role else call}", line
            case Loop():
                if loops >= DEEPEST:
                    raise ShapeProgError(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
                yield f"{indent}for {variable(loops)} in {_call(line)}:", line
                yield from _lines(line.body, depth + 1, loops + 1)
            case Assignment():
                names, values = zip(*line.numbers, strict=True)
                yield f"{indent}{', '.join(names)} = {', '.join(map(text_of, values))}{note}", line
            case Call():
                call = f"{line.name}({', '.join(_given(line.arguments))})"
                yield f"{indent}{f'{line.role}({call})' if line.role else call}{note}", line
            case Part():
                yield f"{indent}{part_text(line)}{note}", line
            case Group():
                yield f"{indent}{group_text(line)}:{note}", line
                yield from _lines(line.body, depth + 1, loops + 1)
            case Function():
                yield f"{indent}def {line.name}({', '.join(_given(line.parameters))}):{note}", line
                yield from _lines(line.body, depth + 1, loops)
    if empty and depth:
        yield f"{indent}pass", None


def lines_text(lines: Iterable[Line]) -> Iterator[str]:
    """Lines of placed text, with those inside of them, in canonical form."""
    return (text for text, _ in _lines(lines, 0, 0))


def part_text(line: Part) -> str:
    """A placed solid as text: ``leg(left=0, width=2)``."""
    call = f"{line.kind}({', '.join(keywords_text(line.keywords))})"
    if not line.role or line.role == line.kind:
        return call
    if line.kind == "box" and line.role not in ROUND_ROLES:
        return call.replace("box", line.role, 1)
    return f"{line.role}({call})"


def group_text(line: Group) -> str:
    """The head of a placed loop or group as text, without its colon: ``for _ in row(3, last=at(top=0))``."""
    before = [] if line.count is None else [text_of(line.count)]
    words = [*before, *([line.axis] if line.axis else []), *keywords_text(line.keywords)]
    return f"{'with' if line.kind == 'inside' else 'for _ in'} {line.kind}({', '.join(words)})"


def keywords_text(keywords: Keywords) -> Iterator[str]:
    """Keywords as text: ``left=2``, ``start=at(top=0)``, ``radius=(1, 2)``."""
    for word, argument in keywords:
        if isinstance(argument, Point):
            yield f"{word}=at({', '.join(keywords_text(argument.keywords))})"
        elif isinstance(argument, tuple):
            yield f"{word}=({', '.join(map(text_of, argument))})"
        else:
            yield f"{word}={text_of(argument)}"


def _call(line: Draw | Loop) -> str:
    declared = language().declaration(line.name, len(line.values))
    pairs = zip(declared.quantities, line.values, strict=True)
    return declared.call([quantity.written(value) for quantity, value in pairs])


def _given(pairs: Iterable[tuple[str, Value | None]]) -> Iterator[str]:
    return (name if value is None else f"{name}={text_of(value)}" for name, value in pairs)


def _remark(text: str) -> str:
    if text != text.strip() or not text.isprintable():
        raise ShapeProgError("a comment has blanks around it, or letters that cannot be printed", "leave them out")
    return text


def assigned(pairs: Iterable[tuple[str, Value]]) -> list[Assignment]:
    """Assignments of names to values; a value that uses a name of the current line starts the next one."""
    lines: list[list[tuple[str, Value]]] = [[]]
    for pair in pairs:
        long = sum(len(f"{name}{value}") + 4 for name, value in [*lines[-1], pair]) > 118
        if long or not dict(lines[-1]).keys().isdisjoint(names_in(pair[1])):
            lines.append([])
        lines[-1].append(pair)
    return [Assignment(tuple(line)) for line in lines if line]


def variable(depth: int) -> str:
    """The name of the variable of a loop inside ``depth`` others: i, j, k and so on."""
    letters = [*map(chr, range(ord("i"), ord("z") + 1))]
    return letters[depth] if depth < len(letters) else f"i{depth}"
