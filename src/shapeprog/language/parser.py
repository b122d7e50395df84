"""The parser of program text: a strict subset of Python, read through ``ast``; nothing is ever executed.

Text in which parts are placed from the sides of a box is read here, statements in cells in
:mod:`shapeprog.language.cells_parser`.
"""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterable, Mapping, Sequence

from shapeprog.errors import did_you_mean
from shapeprog.language.ast import Argument, Call, Fault, Function, Group, Line, Part, Point
from shapeprog.language.cells_parser import parse_cells
from shapeprog.language.evaluate import evaluated, placed_source
from shapeprog.language.placement import (
    AXES,
    BETWEEN,
    BOX,
    GROUPS,
    IN_BOX,
    POINT,
    POINTS,
    ROUND,
    ROUND_ROLES,
    SIZES,
    is_sized,
)
from shapeprog.language.program import Program
from shapeprog.language.reader import BEGIN, Block, Comments, Names, Reader, is_reserved
from shapeprog.language.statement import language
from shapeprog.language.text import Node, Text
from shapeprog.language.unit import METRES

_IN_CELLS = {"at", "size", "by", "section"}
_ONLY_PLACED = {"at", "inside", "divide", "row"}
_LIKE_UNIT = re.compile(r"[^#]*#[ \t]*units?[ \t]*[:=][ \t]*\w+[ \t]*$", re.IGNORECASE)
_UNIT = re.compile(r"[ \t]*#[ \t]*unit:[ \t]*(\S+)[ \t]*")


def parse(text: str, name: str = "<program>") -> Program:
    """The program of a text.

    Wherever a number may stand, an expression of numbers and names with + - * / may.  Numbers are rounded to float32.

    Parameters
    ----------
    text
        The text: parts placed from the sides of a box, or statements in cells.
    name
        What it is called in errors, such as a path.

    Raises
    ------
    ProgramError
        With line and column of a mistake, and the nearest name or what is allowed.
    """
    source = Text(text, name)
    tree = source.tree()
    if _is_in_cells(tree) and (tree.body or not any(map(_UNIT.fullmatch, source.lines))):
        return parse_cells(source, tree)
    unit, lines = _unit(source, tree)
    reader = _Reader(source, tree, Comments(lines))
    try:
        body = reader.lines()
        if not reader.has_whole:
            raise source.at(1, 1, "the program does not declare its size", BEGIN)
        stray = [] if unit else [row for row, line in enumerate(source.lines, 1) if _LIKE_UNIT.match(line)]
        warnings = [f"line {row}: this comment sets no unit; write # unit: cm above all other lines" for row in stray]
        return evaluated(placed_source(body, unit, (*reader.warnings(), *warnings)))
    except Fault as fault:
        raise reader.located(fault) from None
    except RecursionError:
        raise source.at(1, 1, "the program is nested too deeply", "use fewer levels") from None


def _is_in_cells(tree: ast.Module) -> bool:
    """Whether a text holds statements in cells: it declares no size of the whole, and has coordinates, a statement that
    is no placed part, loops alone, or nothing."""
    nodes = list(ast.walk(tree))
    if set(SIZES) <= {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}:
        return False
    calls = [node for node in nodes if isinstance(node, ast.Call)]
    functions = {node.name for node in nodes if isinstance(node, ast.FunctionDef)}
    called = {node.func.id for node in calls if isinstance(node.func, ast.Name)} - functions
    keywords = [word for node in calls if getattr(node.func, "id", "") not in functions for word in node.keywords]
    if any(word.arg in _IN_CELLS or (isinstance(word.value, ast.Tuple) and word.arg != "radius") for word in keywords):
        return True
    if not tree.body or any(word in language() and not is_reserved(word) for word in called):
        return True
    return bool(called) and not called & _ONLY_PLACED and not any(isinstance(node, ast.Expr) for node in nodes)


def _unit(text: Text, tree: ast.Module) -> tuple[str, Sequence[str]]:
    """The unit in a comment above the first statement, empty without one, and the lines without that comment."""
    first = tree.body[0].lineno if tree.body else math.inf
    for row, line in enumerate(text.lines, 1):
        match = _UNIT.fullmatch(line)
        if match and row < first:
            if match[1] not in METRES:
                hint = f"use {', '.join([*METRES][:-1])} or {[*METRES][-1]}"
                raise text.at(row, match.start(1) + 1, f"unknown unit {match[1]!r}", hint)
            return match[1], [*text.lines[: row - 1], "", *text.lines[row:]]
    return "", text.lines


class _Reader(Reader):
    """Reads placed parts, loops and groups."""

    def loop(self, node: ast.For | ast.With, block: Block) -> Line:
        """A loop or a group."""
        if isinstance(node, ast.For):
            simple = isinstance(node.target, ast.Name) and not node.orelse
            self.require(simple, node, "a loop has one variable and no else", "write for _ in row(3, last=...):")
            return self._group(node.iter, [*GROUPS][1:], node.body, block)
        simple = len(node.items) == 1 and not node.items[0].optional_vars
        self.require(simple, node, "a group has one box and no name", f"write {GROUPS['inside'].example}")
        return self._group(node.items[0].context_expr, ["inside"], node.body, block)

    def _group(self, call: ast.expr, kinds: Sequence[str], body: list[ast.stmt], block: Block) -> Line:
        """A loop or a group: its arguments, its keywords and its body."""
        kind = getattr(call.func, "id", "") if isinstance(call, ast.Call) else ""
        if kind not in kinds:
            what = "group" if kinds == ["inside"] else "loop"
            hint = did_you_mean(kind, kinds, f"use {' or '.join(kinds)}")
            hint = f"write {GROUPS[kind].example}" if kind in GROUPS else hint
            hint = "write row(3, last=at(...)) or translate(3, x=...)" if kind == "range" else hint
            raise self.error(call, f"unknown {what} {kind or self.text.shown(call)!r}", hint)
        assert isinstance(call, ast.Call)
        words, arguments, example = GROUPS[kind]
        expected = ("no number", "a count", "a count and an axis")[arguments]
        message = f"{kind} takes {expected} before its keywords"
        self.require(len(call.args) == arguments, call, message, f"write {example}")
        keywords, places = self._keywords(call, words, block.scope, kind)
        if kind == "row" and keywords:
            last = keywords["last"]
            assert isinstance(last, Point)
            node = call.keywords[0].value
            self.require(last.keywords, node, "a row needs to know where the last copy is", "write last=at(top=2)")
        count = None
        if arguments:
            count, places["count"] = self.value("count", call.args[0], block.scope), call.args[0]
        axis = ""
        if kind == "divide":
            axis = getattr(call.args[1], "id", "")
            self.require(axis in ("x", "y", "z"), call.args[1], "divide needs an axis", "use x, y or z")
        complete = keywords or kind not in ("mirror", "translate", "row")
        self.require(complete, call, f"{kind} needs a keyword", f"write {example}")
        if kind in ("inside", "divide"):
            self._check_box(kind, keywords, places)
        elif kind != "translate":
            self._check_point(keywords, places)
        note = self.note(call)
        lines = self.body(body, block._replace(depth=block.depth + 1))
        return self.recorded(Group(kind, tuple(keywords.items()), lines, count, axis, note), call, places)

    def element(self, call: ast.Call, scope: Names, role: str = "") -> Line:
        """A solid or a call of a function, with a role around it, or a role alone."""
        word = getattr(call.func, "id", "")
        inner = call.args[0] if len(call.args) == 1 and not call.keywords else None
        if word in language().roles and not role and isinstance(inner, ast.Call):
            return self.element(inner, scope, word)
        words = {keyword.arg or "" for keyword in call.keywords}
        function, kind = self.functions.get(word), self._solid(call, word, role, words)
        if call.args:
            self._refuse(call.args[0], word, function)
        needed: Sequence[str]
        if function and not kind:
            self.function_names[word].used = True
            needed = [name for name, default in function.parameters if default is None]
            box_words: Sequence[str] = BOX
            optional: Sequence[str] = ("tilt", *dict(function.parameters))
        else:
            between = kind not in IN_BOX or (kind in BETWEEN and bool(words & set(POINTS)))
            needed, optional = (BETWEEN if between else IN_BOX)[kind]
            box_words = () if between else BOX
        keywords, places = self._keywords(call, (*box_words, *needed, *optional), scope, kind)
        for missing in needed:
            self.require(missing in keywords, call, f"{word} needs {missing}", f"write {word}(..., {missing}=...)")
        if kind == "bar":
            hint = "width and depth if it rises, depth and height if it runs left-right, width and height if front-rear"
            two = sum(size in words for size in SIZES) == 2
            self.require(two, call, "a bar needs the two sizes across it", hint)
        elif box_words:
            self._check_box(kind, keywords, places)
        pairs, note = tuple(keywords.items()), self.note(call)
        if function and not kind:
            return self.recorded(Call(word, pairs, note, role), call, places)  # type: ignore[arg-type]
        role = role or (word if word in language().roles else "")
        return self.recorded(Part(kind, pairs, "" if role == kind else role, note), call, places)

    def _refuse(self, argument: ast.expr, word: str, function: Function | None) -> None:
        """Refuse an argument without a keyword."""
        if isinstance(argument, ast.Call) and word in language().roles:
            message, cure = f"{word} takes one solid and nothing else", "write the keywords inside it"
            raise self.error(argument, message, f"{cure}: {word}({self.text.shown(argument.func)}(...))")
        parameters = [name for name, _ in function.parameters] if function else []
        raise self.error(argument, "a number without a keyword", f"write {[*parameters, 'width'][0]}=...")

    def _solid(self, call: ast.Call, word: str, role: str, words: set[str]) -> str:
        """The solid that a call draws: the one that it names, or a box for a role alone; empty for a function."""
        roles = language().roles
        if (word in IN_BOX or word in BETWEEN) and (word != "cushion" or role or "edge" in words):
            return word
        if word in roles and not role:
            plain = word not in ROUND_ROLES and not words & {"radius", *POINTS}
            hint = f"a role alone is a box; write {word}(cylinder(...))"
            self.require(plain, call, f"{word} needs a solid in it", hint)
            return "box"
        message = f"{word} is a role, and a part has only one"
        self.require(word not in roles, call, message, "write the solid inside it")
        self.require(word != "at", call, "a point is no part", "a point belongs to a solid: rod(start=at(...), ...)")
        if word in GROUPS:
            raise self.error(call, f"{word} draws nothing itself", f"write {GROUPS[word].example}")
        if word in self.function_names and word not in self.functions:
            raise self.error(call, f"{word} calls itself", "use a loop: functions call only those above them")
        if word not in self.functions:
            names = {*IN_BOX, *BETWEEN, *roles, *self.functions}
            hint = did_you_mean(word, sorted(names), "'shapeprog statements' lists all; functions stand above calls")
            raise self.error(call, f"unknown part {word or self.text.shown(call)!r}", hint)
        return ""

    def _keywords(
        self, call: ast.Call, allowed: Sequence[str], scope: Names, kind: str = ""
    ) -> tuple[dict[str, Argument], dict[str, Node]]:
        """The keywords of a call by name, with every expression in them checked, and where they stand."""
        result: dict[str, Argument] = {}
        places: dict[str, Node] = {}
        for keyword in call.keywords:
            word, value = keyword.arg or "**", keyword.value
            if word not in allowed:
                hint = did_you_mean(word, allowed, f"possible are {', '.join(dict.fromkeys(allowed))}")
                hint = f"write last=at({word}=...)" if kind == "row" and word in POINT else hint
                hint = "keywords place a part, such as leg(left=0, width=2)" if word in _IN_CELLS else hint
                raise self.error(keyword, f"unknown keyword {word!r}", hint)
            self.require(word not in result, keyword, f"{word!r} is given twice", "keep one of them")
            places[word] = keyword
            if kind and word in (*POINTS, "last"):
                is_point = isinstance(value, ast.Call) and getattr(value.func, "id", "") == "at" and not value.args
                hint = "write at(left=..., front=..., bottom=...)"
                self.require(is_point, keyword, "a point is expected here", hint)
                assert isinstance(value, ast.Call)
                point, point_places = self._keywords(value, POINT, scope)
                self._check_point(point, point_places)
                result[word] = Point(tuple(point.items()))  # type: ignore[arg-type]
                places |= {f"{word}.{inner}": node for inner, node in point_places.items()}
            elif (kind, word) == ("taper", "radius"):
                two = isinstance(value, ast.Tuple) and len(value.elts) == 2
                self.require(two, keyword, "a taper takes two radii", "write radius=(2, 3)")
                assert isinstance(value, ast.Tuple)
                result[word] = (self.value(word, value.elts[0], scope), self.value(word, value.elts[1], scope))
            else:
                result[word] = self.value(word, value, scope)
        return result, places

    def _check_point(self, keywords: Iterable[str], places: Mapping[str, Node]) -> None:
        """Refuse several keywords of one axis in a point."""
        for axis in AXES:
            words = [word for word in keywords if word in axis]
            if len(words) > 1:
                raise self.error(places[words[-1]], f"{_listed(words)} exclude each other", "keep one of them")

    def _check_box(self, kind: str, keywords: Mapping[str, Argument], places: Mapping[str, Node]) -> None:
        """Refuse combinations of keywords that do not describe an interval on every axis."""
        for index, (low, high, size, offset) in enumerate(AXES):
            words = [word for word in keywords if word in AXES[index]]
            horizontal = kind in ROUND and index < 2
            has_radius = horizontal and "radius" in keywords
            allowed: list[set[str]] = [set(), {low}, {high}]
            if has_radius or (horizontal and is_sized(keywords, 1 - index)):
                allowed.append({offset})
            if not has_radius:
                allowed += [{size}, {low, size}, {high, size}, {low, high}, {offset, size}]
            if set(words) not in allowed:
                last = places[words[-1]]
                self.require(words != [offset], last, f"{offset} needs {size}", f"write {offset}=..., {size}=...")
                hint = f"keep two of {low}, {high}, {size}; or {offset} and {size}"
                hint = f"keep one of {low}, {high}, {offset}" if has_radius else hint
                raise self.error(last, f"{_listed(words + ['radius'] * has_radius)} exclude each other", hint)


def _listed(words: Sequence[str]) -> str:
    """Words as a list in English: ``left, right and width``."""
    return f"{', '.join(words[:-1])} and {words[-1]}" if len(words) > 1 else "".join(words)
