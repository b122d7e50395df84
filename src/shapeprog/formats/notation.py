"""The notation of the paper, read and printed with nothing dropped.

    for(i<2, 'Trans', u=(0, 0, 18))
        draw('Leg', 'Cub', P=(-12, -8, -10)+i*u, G=(16, 2, 2))

``P`` is the position (``P1`` and ``P2`` the ends of a line), ``G`` the lengths in declared order; everything else
follows by its name: ``tilt``, ``turn``, ``step``.  Statements that the paper does not have go by their own name.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

from shapeprog.errors import ProgramError, ShapeProgError, did_you_mean
from shapeprog.files import write_text
from shapeprog.formats.frames import frame_comment, frame_in
from shapeprog.formats.shape import LARGEST_FILE, read_text
from shapeprog.language.parameters import Parameter
from shapeprog.language.printer import INDENT, checked_role, variable
from shapeprog.language.program import DEEPEST, Draw, Loop, Node, Program
from shapeprog.language.statement import Statement, language
from shapeprog.language.text import Text
from shapeprog.space import Frame

Groups: TypeAlias = dict[str, tuple[float, ...]]  # numbers by the name of their group
_COUNT = ""  # the group that holds the count of a loop; no name of the notation can be empty

_FORM = "write draw('Leg', 'Cub', P=(_, _, _), G=(_, _, _))"
_SHOWN = 60


def read_notation(path: Path) -> tuple[Program, Frame | None]:
    """The program of a file in the notation of the paper, and its frame where a comment keeps it."""
    text = read_text(path, LARGEST_FILE)
    return parse_notation(text, str(path)), frame_in(text, str(path))


def write_notation(program: Program, path: Path, frame: Frame | None) -> None:
    """Write a program in the notation of the paper."""
    write_text(path, frame_comment(frame) + format_notation(program))


def format_notation(program: Program) -> str:
    """A program in the notation of the paper; loops without a body draw nothing and are left out.

    Raises
    ------
    ShapeProgError
        If a number is not finite or a statement is not declared.
    """
    return "".join(f"{line}\n" for node in program.body for line in _lines(node, [], _nested(node)))


def parse_notation(text: str, name: str = "<program>") -> Program:
    """The program of a text in the notation of the paper; the body of a loop is indented.

    Raises
    ------
    ProgramError
        At the first place that is not in the notation.
    """
    return Program(_Reader(Text(text, name)).body(-1, 0))


def groups(declared: Statement) -> dict[str, tuple[Parameter, ...]]:
    """The groups of numbers that the notation writes for a statement and the parameters in each."""
    parameters = declared.parameters[declared.is_loop :]
    result: dict[str, tuple[Parameter, ...]] = {}
    if declared.is_loop:
        for parameter in parameters:
            symbol = declared.paper[1] if declared.paper and not result else parameter.name
            result[symbol] = (parameter,)
        return result
    positions = [parameter for parameter in parameters if parameter.quantity.kind == "position"]
    for number, parameter in enumerate(positions, 1):
        result[f"P{number}" if len(positions) > 1 else "P"] = (parameter,)
    lengths = tuple(parameter for parameter in parameters if parameter.quantity.kind == "length")
    if lengths:
        result["G"] = lengths
    result.update({p.name: (p,) for p in parameters if p.quantity.kind not in ("position", "length")})
    return result


def _words(declared: Statement) -> list[str]:
    words = list(declared.paper) if declared.paper else [declared.name]
    return words[:1] if declared.is_loop else words


def _quoted(words: list[str]) -> str:
    return ", ".join(f"'{word}'" for word in words)


def _moves(node: Node) -> bool:
    """Whether a node is a loop that shifts, with a ``u`` in the notation."""
    registry = language()
    shifts = node.name in registry and any(p.quantity.kind == "shift" for p in registry[node.name].parameters)
    return isinstance(node, Loop) and shifts


def _nested(node: Node, around: int = 0) -> bool:
    """Whether shifting loops lie in each other, so that their ``u`` are numbered."""
    around += _moves(node)
    return around > 1 or (isinstance(node, Loop) and any(_nested(inner, around) for inner in node.body))


def _lines(node: Node, loops: list[Loop], numbered: bool) -> Iterator[str]:
    declared = language().declaration(node.name, len(node.values))
    shifts = [depth for depth, outer in enumerate(loops) if _moves(outer)]
    names = [f"u{index + 1}" if numbered else "u" for index in range(len(shifts) + 1)]
    moved = "".join(f"+{variable(depth)}*{u}" for depth, u in zip(shifts, names, strict=False))
    words = [_quoted([checked_role(node), declared.name] if isinstance(node, Draw) and node.role else _words(declared))]
    for symbol, parameters in groups(declared).items():
        numbers = [_number(p, value) for p in parameters for value in node.values[p.slots]]
        group = numbers[0] if len(numbers) == 1 else f"({', '.join(numbers)})"
        at = moved if parameters[0].quantity.kind == "position" else ""
        words.append(f"{names[-1] if symbol == 'u' else symbol}={group}{at}")
    indent = INDENT * len(loops)
    if isinstance(node, Draw):
        yield f"{indent}draw({', '.join(words)})"
        return
    body = [line for inner in node.body for line in _lines(inner, [*loops, node], numbered)]
    if body:
        count = declared.parameters[0].quantity.written(node.values[0])
        yield f"{indent}for({variable(len(loops))}<{count}, {', '.join(words)})"
        yield from body


def _number(parameter: Parameter, value: float) -> str:
    """A number in the notation, which has no names."""
    return f"{value:.0f}" if parameter.quantity.kind == "axis" else parameter.quantity.written(value)


class _Reader:
    """Parses lines: each is a call in the syntax of Python but for its name ``for``."""

    def __init__(self, text: Text) -> None:
        self.text = text
        self.rest = [(row, line) for row, line in enumerate(text.lines, 1) if line.partition("#")[0].strip()][::-1]
        self.known = [{tuple(_words(d)): d for d in language() if d.is_loop == is_loop} for is_loop in (False, True)]
        self.place = 1, 0  # row and indentation of the line that is read

    def body(self, outside: int, depth: int) -> tuple[Node, ...]:
        """The nodes that are indented deeper than ``outside``, in ``depth`` loops."""
        nodes: list[Node] = []
        level: int | None = None
        while self.rest:
            row, line = self.rest[-1]
            indent = len(line) - len(line.lstrip())
            if indent <= outside:
                break
            if level not in (None, indent):
                raise self.text.at(row, indent + 1, "unexpected indentation", "indent with four spaces in a loop")
            level = indent
            self.rest.pop()
            nodes.append(self._node(row, indent, line, depth))
        return tuple(nodes)

    def _node(self, row: int, indent: int, line: str, depth: int) -> Node:
        self.place = row, indent
        call = self._call(row, indent, line)
        is_loop = getattr(call.func, "id", "") == "For"
        words, numbers = self._arguments(call, is_loop)
        try:
            declared = _statement(words, self.known[is_loop])
            values = _in_slots(declared, numbers)
        except ShapeProgError as mistake:
            raise self._error(call, mistake.message, mistake.hint) from None
        if not is_loop:
            return Draw(declared.name, values, "" if words == _words(declared) else words[0])
        if depth >= DEEPEST:
            message = f"loops are nested more than {DEEPEST} deep"
            raise self._error(call, message, "put some of them side by side")
        if not (body := self.body(indent, depth + 1)):
            raise self._error(call, "this loop has no body", "indent its body by four spaces")
        return Loop(declared.name, values, body)

    def _call(self, row: int, indent: int, line: str) -> ast.Call:
        """The call on a line."""
        bare = line.partition("#")[0].strip().removesuffix(":")
        if bare.startswith("for"):
            bare = "For" + bare[3:]
        try:
            tree = ast.parse(bare, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            column = (getattr(error, "offset", None) or 1) + indent
            raise self.text.at(
                row, min(column, len(line) + 1), f"invalid syntax: {getattr(error, 'msg', error)}", _FORM
            ) from None
        if isinstance(tree, ast.Call) and getattr(tree.func, "id", "") in ("draw", "For"):
            return tree
        raise self.text.at(row, indent + 1, "a line is draw(...) or for(...)", _FORM)

    def _arguments(self, call: ast.Call, is_loop: bool) -> tuple[list[str], Groups]:
        """Quoted words and groups of numbers."""
        words: list[str] = []
        numbers: Groups = {}
        for node in [*call.args, *call.keywords]:
            match node:
                case ast.Constant(str(word)):
                    words.append(word)
                    continue
                case ast.Compare(ast.Name(), [ast.Lt()], [value]) if is_loop and _COUNT not in numbers:
                    symbol = _COUNT
                case ast.keyword(str(symbol), value) if symbol not in numbers:
                    pass
                case ast.keyword(symbol):
                    raise self._error(node, f"{symbol} is given twice", "leave one of them out")
                case _:
                    raise self._neither(node)
            while isinstance(value, ast.BinOp) and isinstance(value.op, ast.Add):  # P=(...)+i*u
                value = value.left
            try:
                result = ast.literal_eval(value)
                numbers[symbol] = tuple(map(float, result if isinstance(result, tuple) else [result]))
            except (ValueError, TypeError, OverflowError, RecursionError):
                raise self._neither(value) from None
        return words, numbers

    def _error(self, node: Any, message: str, hint: str) -> ProgramError:
        """What is wrong at a piece of the line that is read."""
        row, indent = self.place
        before = self.text.lines[row - 1][indent:].encode()[: node.col_offset]  # ast counts columns in bytes of UTF-8
        return self.text.at(row, indent + len(before.decode(errors="replace")) + 1, message, hint)

    def _neither(self, node: Any) -> ProgramError:
        return self._error(node, "this is neither a quoted word nor a group of numbers", "write 'Leg' or P=(0, 0, 0)")


def _statement(words: list[str], known: dict[tuple[str, ...], Statement]) -> Statement:
    """The declaration that words name, after a role or alone."""
    declared = known.get(tuple(words))
    if declared is None and len(words) == 2 and words[0] in language().roles and words[0] != words[1]:
        declared = next((each for each in known.values() if each.name == words[1] and not each.is_loop), None)
    if declared is None:
        hint = did_you_mean(_quoted(words), [_quoted([*each]) for each in known])
        raise ShapeProgError(f"no statement or loop is called {_quoted(words)[:_SHOWN] or 'nothing'}", hint)
    return declared


def _in_slots(declared: Statement, by_symbol: Groups) -> tuple[float, ...]:
    """Numbers in slot order."""
    wanted = ({_COUNT: declared.parameters[:1]} if declared.is_loop else {}) | groups(declared)
    given = {}
    for symbol, numbers in by_symbol.items():
        bare = symbol.rstrip("0123456789")  # u1 and u2 of nested loops both mean u
        given[bare if symbol not in wanted and bare in wanted else symbol] = numbers
    for symbol in given:
        if symbol not in wanted:
            hint = f"its groups are {', '.join(groups(declared))}"
            raise ShapeProgError(f"{declared.name} has no group {symbol[:_SHOWN]}", hint)
    slots = [0.0] * declared.size
    for symbol, parameters in wanted.items():
        width = sum(parameter.quantity.width for parameter in parameters)
        numbers = given.get(symbol, ())
        if len(numbers) != width:
            actual = f"has {len(numbers)} numbers" if numbers else "is missing"
            hint = "write one number" if width == 1 else f"write {width} numbers"
            raise ShapeProgError(f"{symbol or 'the count'} of {declared.name} {actual}", hint)
        for parameter in parameters:
            slots[parameter.slots], numbers = numbers[: parameter.quantity.width], numbers[parameter.quantity.width :]
    return tuple(n for p in declared.parameters for n in p.checked(declared.name, slots[p.slots]))
