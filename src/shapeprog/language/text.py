"""Program text: reading and canonical printing.

Every float32 survives: ``parse(format_program(program)) == program`` for all finite numbers, negative zero and
negative lengths included (which draw nothing); counts and turns are whole.
"""

from __future__ import annotations

from collections.abc import Iterator

from shapeprog.errors import ShapeProgError
from shapeprog.language.program import Loop, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.syntax import DEEPEST, read
from shapeprog.language.values import written

INDENT = "    "
"""One level of indentation."""

_LETTERS = "ijklmnopqrstuvwxyz"


def parse(text: str, name: str = "<program>") -> Program:
    """The program of a text.

    Parameters
    ----------
    text
        A strict subset of Python: calls of drawing statements with literal numbers, and ``for`` loops over calls of
        loops.  Comments are allowed and forgotten.  Numbers are rounded to float32.
    name
        What error messages call the text, a path for instance.

    Raises
    ------
    ProgramError
        At the first mistake, with line, column, the nearest name or the legal range.
    """
    return Program(read(text, name))


def format_program(program: Program) -> str:
    """The canonical text of a program: parameters by name in declared order, the fewest digits, loops i, j, k...

    Raises
    ------
    ShapeProgError
        If a number is not finite, a statement is not declared, or loops nest deeper than text can.
    """
    return "".join(f"{line}\n" for node in program.body for line in _lines(node, 0))


def call_text(node: Node, name: str) -> str:
    """The call that a statement or loop of the text is, without what is around it.

    Raises
    ------
    ShapeProgError
        If the statement is not declared or has another number of values.
    """
    known = language()
    if name not in known:
        raise ShapeProgError(f"no statement is called {name!r}", "load the module that declares it")
    declared = known[name]
    if len(node.values) != declared.size:
        raise ShapeProgError(f"{name} has {len(node.values)} numbers instead of {declared.size}", "mend the program")
    words: list[str] = []
    for parameter in declared.parameters:
        numbers = [written(parameter.quantity, value) for value in node.values[parameter.slots]]
        group = numbers[0] if len(numbers) == 1 else f"({', '.join(numbers)})"
        bare = declared.is_loop and not words
        words.append(group if bare else f"{parameter.name}={group}")
    return f"{name}({', '.join(words)})"


def _lines(node: Node, depth: int) -> Iterator[str]:
    indent = INDENT * depth
    if not isinstance(node, Loop):
        yield f"{indent}{call_text(node, node.name)}"
        return
    if depth >= DEEPEST:
        raise ShapeProgError(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
    yield f"{indent}for {variable(depth)} in {call_text(node, node.name)}:"
    if not node.body:
        yield f"{indent}{INDENT}pass"
    for inner in node.body:
        yield from _lines(inner, depth + 1)


def variable(depth: int) -> str:
    """The name of the variable of a loop inside ``depth`` others: i, j, k and so on."""
    return _LETTERS[depth] if depth < len(_LETTERS) else f"i{depth}"
