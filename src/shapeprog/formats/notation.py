"""The notation of the paper, read and printed with nothing dropped.

    for(i<2, 'Trans', u=(0, 0, 18))
        draw('Leg', 'Cub', P=(-12, -8, -10)+i*u, G=(16, 2, 2))

``P`` is the position (``P1`` and ``P2`` the ends of a line), ``G`` the lengths in declared order; everything else
follows by its name: ``tilt``, ``turn``, ``step``.  Statements that the paper does not have go by their own name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from shapeprog.errors import ProgramError, ShapeProgError, did_you_mean
from shapeprog.files import write_text
from shapeprog.formats.frames import frame_comment, frame_in
from shapeprog.formats.published import COUNT, Groups, is_published, restored
from shapeprog.formats.shape import LARGEST_FILE, read_text
from shapeprog.language.parameters import Parameter
from shapeprog.language.printer import INDENT, checked_role, variable
from shapeprog.language.program import DEEPEST, Draw, Loop, Node, Program
from shapeprog.language.statement import Statement, language
from shapeprog.language.text import proper_text
from shapeprog.space import Frame

_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
# No pattern begins with blanks if the one before may end with them, so that matching stays linear.
_VALUE = rf"\(\s*{_NUMBER}(?:\s*,\s*{_NUMBER})*\s*(?:,\s*)?\)|{_NUMBER}(?:\s*\N{{DEGREE SIGN}})?"
_COPIES = r"(?:\s*\+\s*[a-z]\w*\s*\*\s*[a-z]\w*)*"
_WORD = re.compile(r"\s*'([^'\n]*)'\s*(,|\)|$)")
_GROUP = re.compile(rf"\s*([A-Za-z_]\w*)\s*=\s*({_VALUE}){_COPIES}\s*(,|\)|$)")
_TURN = re.compile(r"\s*(?:theta\s*\*\s*[a-z]|axis)\s*(,|\)|$)")
_DRAW = re.compile(r"draw\s*\(")
_FOR = re.compile(rf"for\s*\(\s*[a-z]\w*\s*<\s*({_NUMBER})\s*(,|\))")
_REST = re.compile(rf"{_COPIES}\s*(?::\s*)?$")
_SHOWN = 60


def read_notation(path: Path) -> tuple[Program, Frame | None]:
    """The program of a file in the notation of the paper, and its frame where a comment keeps it.

    Defaults replace the numbers that the published printer omits; :func:`parse_notation` can report them.
    """
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


def parse_notation(text: str, name: str = "<program>", notes: list[str] | None = None) -> Program:
    """The program of a text in the notation of the paper.

    The body of a loop is indented, or ends with ``end``.  Text of the published
    printer is accepted too.

    Parameters
    ----------
    notes
        Receives one sentence for each omitted number that was replaced by a default.

    Raises
    ------
    ProgramError
        At the first place that is not in the notation.
    """
    text = proper_text(text, name)
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if _bare(line)]
    reader = _Reader(lines, name, [] if notes is None else notes)
    return Program(reader.body(-1, 0, inside=None))


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
    """Parses lines; errors have the line and column."""

    def __init__(self, lines: list[tuple[int, str]], name: str, notes: list[str]) -> None:
        self.lines = lines
        self.name = name
        self.notes = notes
        self.next = 0
        self.ends = any(_bare(line) == "end" for _, line in lines)

    def body(self, outside: int, depth: int, inside: int | None) -> tuple[Node, ...]:
        """The nodes indented deeper than ``outside``, or up to ``end``, for the loop of line ``inside``."""
        nodes: list[Node] = []
        level: int | None = None
        while self.next < len(self.lines):
            line = self.lines[self.next][1]
            indent = len(line) - len(line.lstrip())
            if self.ends:
                if _bare(line) == "end":
                    if inside is None:
                        raise self._error("there is no loop to end here", "remove this end")
                    break
            elif indent <= outside:
                break
            elif level is not None and indent != level:
                raise self._error("unexpected indentation", "indent with four spaces in a loop")
            level = indent
            nodes.append(self._node(indent, depth))
        if inside is not None and self.ends:
            if self.next == len(self.lines):
                self.next = inside
                raise self._error("missing end of this loop", "write end after its body")
            self.next += 1
        if inside is not None and not nodes:
            self.next = inside
            raise self._error("this loop has no body", "indent its body by four spaces")
        return tuple(nodes)

    def _node(self, indent: int, depth: int) -> Node:
        row = self.next
        text = _bare(self.lines[row][1])
        match = _DRAW.match(text) or _FOR.match(text)
        if not match:
            raise self._error(
                "a line is draw(...), for(...) or end", "write draw('Leg', 'Cub', P=(_, _, _), G=(_, _, _))"
            )
        is_loop = match.re is _FOR
        start: Groups = {COUNT: [float(match[1])]} if is_loop else {}
        words, groups = self._arguments(text, match, indent, start)
        declared, values = self._declared(words, groups, is_loop)
        self.next += 1
        if not is_loop:
            role = words[0] if words == [words[0], declared.name] != _words(declared) else ""
            return Draw(declared.name, values, role)
        if depth >= DEEPEST:
            self.next = row
            raise self._error(f"loops are nested more than {DEEPEST} deep", "put some of them side by side")
        return Loop(declared.name, values, self.body(indent, depth + 1, row))

    def _arguments(self, text: str, match: re.Match[str], indent: int, groups: Groups) -> tuple[list[str], Groups]:
        """Quoted words and groups of numbers; the published printer omits the last parenthesis of a rotation."""
        words: list[str] = []
        at = match.end()
        last = match[0][-1] if match.re is _FOR else ","
        while last == ",":
            part = _WORD.match(text, at) or _GROUP.match(text, at) or _TURN.match(text, at)
            if not part:
                raise self._error(
                    "this is neither a quoted word nor a group of numbers", "write 'Leg' or P=(0, 0, 0)", indent + at
                )
            if part.re is _WORD:
                words.append(part[1])
            elif part.re is _GROUP:
                if part[1] in groups:
                    raise self._error(f"{part[1][:_SHOWN]} is given twice", "leave one of them out", indent + at)
                groups[part[1]] = [float(number) for number in re.findall(_NUMBER, part[2])]
            at, last = part.end(), part[part.re.groups]
        if not last and words != ["Rot"]:
            raise self._error("the last parenthesis is missing", "write )", indent + at)
        if not _REST.match(text, at):
            raise self._error("unexpected text after the statement", "remove it", indent + at)
        return words, groups

    def _declared(self, words: list[str], by_symbol: Groups, is_loop: bool) -> tuple[Statement, tuple[float, ...]]:
        candidates = [declared for declared in language() if declared.is_loop == is_loop]
        fitting = next((declared for declared in candidates if _words(declared) == words), None)
        if fitting is None and not is_loop and len(words) > 1 and words[0] in language().roles:
            solids = [declared for declared in candidates if declared.name != words[0]]  # leg(...) implies the role
            fitting = next((declared for declared in solids if [words[0], declared.name] == words), None)
        try:
            if is_published(words, by_symbol):
                name, numbers, note = restored(words, by_symbol)
                fitting = next((declared for declared in candidates if declared.name == name), None)
                if fitting is not None:
                    self.notes.append(f"{self.name}, line {self.lines[self.next][0]}: {note}")
                    return fitting, _values(fitting, list(numbers))
            if fitting is None:
                spelled = [_quoted(_words(declared)) for declared in candidates]
                what = "loop" if is_loop else "statement"
                raise ShapeProgError(
                    f"no {what} is called {_quoted(words)[:_SHOWN] or 'nothing'}", did_you_mean(_quoted(words), spelled)
                )
            return fitting, self._sorted(fitting, by_symbol)
        except ShapeProgError as mistake:
            raise self._error(mistake.message, mistake.hint) from None

    def _sorted(self, declared: Statement, by_symbol: Groups) -> tuple[float, ...]:
        """Numbers in slot order."""
        declared_groups = groups(declared)
        numbers_of = {_symbol(symbol, declared_groups): numbers for symbol, numbers in by_symbol.items()}
        for symbol in numbers_of:
            if symbol not in declared_groups and symbol != COUNT:
                raise ShapeProgError(
                    f"{declared.name} has no group {symbol[:_SHOWN]}", f"its groups are {', '.join(declared_groups)}"
                )
        slots = [0.0] * declared.size
        if declared.is_loop:
            slots[:1] = numbers_of[COUNT]
        for symbol, parameters in declared_groups.items():
            width = sum(parameter.quantity.width for parameter in parameters)
            numbers = numbers_of.get(symbol)
            if numbers is None or len(numbers) != width:
                actual = "is missing" if numbers is None else f"has {len(numbers)} numbers"
                cure = "write one number" if width == 1 else f"write {width} numbers"
                raise ShapeProgError(f"{symbol} of {declared.name} {actual}", cure)
            for parameter in parameters:
                slots[parameter.slots] = numbers[: parameter.quantity.width]
                numbers = numbers[parameter.quantity.width :]
        return _values(declared, slots)

    def _error(self, message: str, hint: str, column: int | None = None) -> ProgramError:
        number, line = self.lines[min(self.next, len(self.lines) - 1)]
        start = len(line) - len(line.lstrip()) if column is None else column
        return ProgramError(message, line=number, column=start + 1, source=line, hint=hint, name=self.name)


def _symbol(symbol: str, declared_groups: dict[str, tuple[Parameter, ...]]) -> str:
    """``u1`` and ``u2`` of nested loops both mean ``u``."""
    bare = symbol.rstrip("0123456789")
    return bare if symbol not in declared_groups and bare in declared_groups else symbol


def _values(declared: Statement, slots: list[float]) -> tuple[float, ...]:
    return tuple(n for p in declared.parameters for n in p.checked(declared.name, slots[p.slots]))


def _bare(line: str) -> str:
    return line.partition("#")[0].strip()
