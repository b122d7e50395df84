"""Program text: reading, which is in :mod:`shapeprog.language.syntax`, and canonical printing.

Every float32 survives: ``parse(format_program(program)) == program`` for all finite numbers, negative zero and
negative lengths included (which draw nothing); counts and turns are whole.
"""

from __future__ import annotations

from collections.abc import Iterator

from shapeprog.errors import ShapeProgError, did_you_mean
from shapeprog.language.program import Draw, Loop, Node, Program
from shapeprog.language.statement import language
from shapeprog.language.syntax import DEEPEST, LONGEST
from shapeprog.language.syntax import parse as parse

INDENT = "    "
"""One level of indentation."""


def format_program(program: Program) -> str:
    """The canonical text of a program: parameters by name in declared order, the fewest digits, loops i, j, k...

    A ``ShapeProgError`` if a number is not finite, a statement is not declared or has more or fewer, or the text would
    be longer, or its loops deeper, than can be read back.
    """
    text = "".join(f"{line}\n" for node in program.body for line in _lines(node, 0))
    if len(text) > LONGEST:
        raise ShapeProgError(f"the text of this program has more than {LONGEST:,} letters", "keep it as .json")
    return text


def _call(node: Node) -> str:
    known = language()
    if node.name not in known:
        raise ShapeProgError(f"no statement is called {node.name!r}", "load the module that declares it")
    declared = known[node.name]
    if len(node.values) != declared.size:
        said = f"{node.name} has {len(node.values)} numbers instead of {declared.size}"
        raise ShapeProgError(said, "mend the program")
    text = declared.call([each.written(value) for each, value in zip(declared.quantities, node.values, strict=True)])
    return text if isinstance(node, Loop) or not node.role else f"{checked_role(node)}({text})"


def numbers_written(node: Node) -> int:
    """How many continuous numbers the line of a statement or loop has; counts and steps of loops are none."""
    return language()[node.name].written(node.values)


def checked_role(node: Draw) -> str:
    """The role of a part; a ``ShapeProgError`` if it is not declared, or no other than the name of its statement."""
    if node.role and node.role not in language().roles:
        raise ShapeProgError(f"no role is called {node.role!r}", did_you_mean(node.role, language().roles))
    if node.role == node.name:
        raise ShapeProgError(f"{node.name} is a {node.name} without being called one", "leave the role out")
    return node.role


def _lines(node: Node, depth: int) -> Iterator[str]:
    if not isinstance(node, Loop):
        yield f"{INDENT * depth}{_call(node)}"
        return
    if depth >= DEEPEST:
        raise ShapeProgError(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
    yield f"{INDENT * depth}for {variable(depth)} in {_call(node)}:"
    if not node.body:
        yield f"{INDENT * (depth + 1)}pass"
    for inner in node.body:
        yield from _lines(inner, depth + 1)


def variable(depth: int) -> str:
    """The name of the variable of a loop inside ``depth`` others: i, j, k and so on."""
    return chr(ord("i") + depth) if depth <= ord("z") - ord("i") else f"i{depth}"
