"""Program text: reading, which is in :mod:`shapeprog.language.syntax`, and canonical printing.

Every float32 survives: ``parse(format_program(program)) == program`` for all finite numbers, negative zero and
negative lengths included (which draw nothing); counts and turns are whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.expression import Expression, Value, text_of
from shapeprog.language.parameters import Quantity
from shapeprog.language.place import LONGEST
from shapeprog.language.program import DEEPEST, Draw, Node, Program
from shapeprog.language.source import (
    Assignment,
    Call,
    Comment,
    Function,
    Line,
    Source,
    WrittenDraw,
    WrittenLoop,
    names_of,
)
from shapeprog.language.statement import Statement, language
from shapeprog.language.syntax import parse as parse
from shapeprog.language.unit import HEAD

INDENT = "    "
"""One level of indentation."""


def format_program(program: Program) -> str:
    """The canonical text of a program: parameters by name in declared order, the fewest digits, loops i, j, k...

    Names, expressions, functions and comments stand as they are written.  A ``ShapeProgError`` if this is no program,
    a number is not finite, a statement is not declared or has more or fewer, or the text would be longer, or its loops
    deeper, than can be read back.
    """
    if not isinstance(program, Program):
        raise ShapeProgError(
            f"format_program takes one program, not a {type(program).__name__}",
            "decode returns a list of programs: format each of them",
        )
    return format_source(source_of(program))


def format_source(source: Source) -> str:
    """The canonical text of a program as it is written, see :func:`format_program`."""
    head = [] if source.unit is None else [source.unit.header]
    lines = _lines(source.lines, 0, 0, names_of(source) | {*source.functions})
    text = "".join(f"{line}\n" for line in [*head, *lines])
    if len(text) > LONGEST:
        raise ShapeProgError(f"the text of this program has more than {LONGEST:,} letters", "keep it as .json")
    return text


def source_of(program: Program) -> Source:
    """A program as it is written; one without names as its statements and loops."""
    return program.source or Source(tuple(map(line_of, program.body)))


def line_of(node: Node) -> WrittenDraw | WrittenLoop:
    """A statement or loop as it is written."""
    if isinstance(node, Draw):
        return WrittenDraw(node.name, node.values, node.role)
    return WrittenLoop(node.name, node.values, tuple(map(line_of, node.body)))


def numbers_written(node: Node) -> int:
    """How many continuous numbers the line of a statement or loop has; counts and steps of loops are none."""
    return language()[node.name].written(node.values)


def checked_role(node: Draw | WrittenDraw) -> str:
    """The role of a part; a ``ShapeProgError`` if it is not declared, or no other than the name of its statement."""
    if node.role and node.role not in language().roles:
        raise ShapeProgError(f"unknown role {node.role!r}", did_you_mean(node.role, language().roles))
    if node.role == node.name:
        raise ShapeProgError(
            f"redundant role: {node.name}(...) already has the role {node.name!r}", "leave the role out"
        )
    return node.role


def declared_of(node: Node | WrittenDraw | WrittenLoop) -> Statement:
    """The declaration of a statement or loop; a ``ShapeProgError`` if there is none of its name and size."""
    known = language()
    if node.name not in known:
        raise ShapeProgError(f"unknown statement {node.name!r}", "load the module that declares it")
    declared = known[node.name]
    if len(node.values) != declared.size:
        said = f"{node.name} has {len(node.values)} numbers instead of {declared.size}"
        raise ShapeProgError(said, "correct the program")
    return declared


def _lines(lines: Iterable[Line], depth: int, loops: int, taken: set[str]) -> Iterator[str]:
    """The lines of a block; ``taken`` are names that no variable of a loop may have."""
    indent, empty = INDENT * depth, True
    for line in lines:
        if isinstance(line, Comment):
            if not depth and line.text.startswith(HEAD):
                raise ShapeProgError(f"the comment {line.text!r} would be read as the unit of the text", "reword it")
            yield f"{indent}# {_remark(line.text)}" if line.text else ""
            continue
        empty = False
        note = f"  # {_remark(line.note)}" if line.note else ""
        match line:
            case WrittenDraw():
                role, call = checked_role(line), _call(line)
                yield f"{indent}{f'{role}({call})' if role else call}{note}"
            case WrittenLoop():
                if loops >= DEEPEST:
                    raise ShapeProgError(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
                yield f"{indent}for {variable(loops, taken)} in {_call(line)}:{note}"
                yield from _lines(line.body, depth + 1, loops + 1, taken)
            case Assignment():
                names, values = zip(*line.numbers, strict=True)
                yield f"{indent}{', '.join(names)} = {', '.join(map(text_of, values))}{note}"
            case Call():
                call = f"{line.name}({', '.join(_given(line.arguments))})"
                yield f"{indent}{f'{line.role}({call})' if line.role else call}{note}"
            case Function():
                yield f"{indent}def {line.name}({', '.join(_given(line.parameters))}):{note}"
                yield from _lines(line.body, depth + 1, loops, taken)
    if empty and depth:
        yield f"{indent}pass"


def _call(line: WrittenDraw | WrittenLoop) -> str:
    declared = declared_of(line)
    return declared.call(
        [number_text(each, value) for each, value in zip(declared.quantities, line.values, strict=True)]
    )


def number_text(quantity: Quantity, value: Value) -> str:
    """A number or expression of a statement as text."""
    return str(value) if isinstance(value, Expression) else quantity.written(value)


def _given(pairs: Iterable[tuple[str, Value | None]]) -> Iterator[str]:
    return (name if value is None else f"{name}={text_of(value)}" for name, value in pairs)


def _remark(text: str) -> str:
    if text != text.strip() or not text.isprintable():
        raise ShapeProgError("a comment has blanks around it, or letters that cannot be printed", "leave them out")
    return text


def variable(depth: int, taken: Iterable[str] = ()) -> str:
    """The name of the variable of a loop inside ``depth`` others: i, j, k and so on, past names that are taken."""
    letters = [letter for letter in map(chr, range(ord("i"), ord("z") + 1)) if letter not in taken]
    return letters[depth] if depth < len(letters) else f"i{depth}"
