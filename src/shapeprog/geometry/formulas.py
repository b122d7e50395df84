"""Formulas written once: evaluated on tensors, and turned into code for kernels, with derivatives.

    def distance(size, point):
        half, radius, *_ = size
        return maximum(abs(point[0]) - half, root(point[1] ** 2 + point[2] ** 2) - radius)

A formula takes and returns numbers, or tuples of them.  A number is a tensor, or a node of an expression graph: called
with nodes, a formula returns its graph, which :func:`gradient` differentiates in reverse mode (Griewank and Walther
2008) and :func:`generated` writes out as a helper for kernels.  Derivatives at kinks are those of torch: equal
arguments of ``maximum`` get half of it each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from itertools import takewhile
from typing import Any

from shapeprog.kernels.compile import helper
from shapeprog.lazy_torch import torch

Number = Any  # a tensor of any shape, a :class:`Node`, or a constant

Triple = tuple[Number, Number, Number]
Four = tuple[Number, Number, Number, Number]

Branch = tuple[tuple["Node", int], ...]  # nodes ``where``, the outermost first, each with one of its sides

TINY = 1e-24  # squares below this have this root, and no gradient


class Node:
    """An operation on nodes and constants; without any, the operation is the code of a variable."""

    def __init__(self, operation: str, *arguments: Any) -> None:
        self.operation, self.arguments = operation, arguments


_node = cache(Node)  # equal expressions are one node


_OPERATORS: dict[str, Callable[..., Node]] = {
    "neg": lambda number: _node("-", 0.0, number),
    "abs": lambda number: _node("abs", number),
    "pow": lambda number, _: _node("square", number),
}
for _name, _sign in {
    "add": "+", "sub": "-", "mul": "*", "truediv": "/", "mod": "%", "and": "and", "or": "or",
    "lt": "<", "le": "<=", "gt": ">", "ge": ">=",
}.items():  # fmt: skip
    _OPERATORS[_name] = lambda number, other, sign=_sign: _node(sign, number, other)
    _OPERATORS[f"r{_name}"] = lambda number, other, sign=_sign: _node(sign, other, number)
for _name, _operator in _OPERATORS.items():
    setattr(Node, f"__{_name}__", _operator)


def _elementary(operation: str, on_tensors: Callable[..., Any]) -> Callable[..., Number]:
    def apply(*arguments: Number) -> Number:
        symbolic = any(isinstance(argument, Node) for argument in arguments)
        return _node(operation, *arguments) if symbolic else on_tensors(*arguments)

    return apply


where = _elementary("where", lambda condition, x, y: torch.where(condition, x, y))
minimum = _elementary("min", lambda x, y: torch.minimum(x, y))
maximum = _elementary("max", lambda x, y: torch.maximum(x, y))
at_least = _elementary("at_least", lambda x, low: x.clamp(min=low))
clamp = _elementary("clamp", lambda x, low, high: x.clamp(low, high))
root = _elementary("root", lambda squared: torch.sqrt(squared.clamp(min=TINY)))
plain_root = _elementary("plain_root", lambda squared: torch.sqrt(squared))  # exact near 0, where slopes are infinite
sin = _elementary("sin", lambda angle: angle.sin())
cos = _elementary("cos", lambda angle: angle.cos())
atan2 = _elementary("atan2", lambda x, y: torch.atan2(x, y))
constant = _elementary("constant", lambda x: x.detach())


def positive(number: Number) -> Number:
    """The number, or 0 if it is negative."""
    return at_least(number, 0.0)


def meet(x: Number, y: Number) -> Number:
    """Signed distance to the intersection of two perpendicular bodies, from the signed distances to each."""
    inner = maximum(x, y)
    return where(inner > 0, root(positive(x) ** 2 + positive(y) ** 2), inner)


_CODE: dict[str, str] = {
    "abs": "abs({})", "square": "{0} * {0}", "where": "({1} if {0} else {2})", "min": "min({}, {})",
    "max": "max({}, {})", "at_least": "max({}, {})", "clamp": "min(max({}, {}), {})",
    "root": f"math.sqrt(max({{}}, {TINY}))", "plain_root": "math.sqrt({})", "sin": "math.sin({})",
    "cos": "math.cos({})", "atan2": "math.atan2({}, {})", "constant": "{}",
}  # fmt: skip

_GRADIENTS: dict[str, Callable[..., tuple[Number | None, ...]]] = {
    "+": lambda g, v, a, b: (g, g),
    "-": lambda g, v, a, b: (g, -g),
    "*": lambda g, v, a, b: (g * b, g * a),
    "/": lambda g, v, a, b: (g / b, -(g / b) * v),
    "square": lambda g, v, a: (g * (a + a),),
    "abs": lambda g, v, a: (where(a > 0, g, where(a < 0, -g, 0.0)),),
    "where": lambda g, v, a, b, c: (None, where(a, g, 0.0), where(a, 0.0, g)),
    "min": lambda g, v, a, b: (g - g * _greater(a, b), g * _greater(a, b)),
    "max": lambda g, v, a, b: (g * _greater(a, b), g - g * _greater(a, b)),
    "at_least": lambda g, v, a, b: (where(a >= b, g, 0.0), None),
    "clamp": lambda g, v, a, b, c: (where((a >= b) & (a <= c), g, 0.0), None, None),
    "root": lambda g, v, a: (where(a >= TINY, 0.5 * g / v, 0.0),),
    "sin": lambda g, v, a: (g * cos(a),),
    "cos": lambda g, v, a: (-g * sin(a),),
    "atan2": lambda g, v, a, b: (g * b / (a * a + b * b), -g * a / (a * a + b * b)),
}
"""Gradients by the arguments a, b and c, from the gradient g by the result v."""


def _greater(x: Number, y: Number) -> Number:
    return where(x > y, 1.0, where(x < y, 0.0, 0.5))


def gradient(outputs: Sequence[Node], slopes: Sequence[Number], inputs: Sequence[Node]) -> list[Number]:
    """Gradient by the inputs of a formula, from the gradient ``slopes`` by its outputs."""
    results: dict[Node, Number] = {}
    for output, slope in zip(outputs, slopes, strict=True):
        results[output] = results[output] + slope if output in results else slope
    for node in reversed(_sorted(outputs)):
        if node in results and node.operation in _GRADIENTS:
            parts = _GRADIENTS[node.operation](results[node], node, *node.arguments)
            for argument, part in zip(node.arguments, parts, strict=True):
                if isinstance(argument, Node) and part is not None:
                    results[argument] = results[argument] + part if argument in results else part
    return [results.get(node, 0.0) for node in inputs]


def _sorted(outputs: Sequence[Number]) -> list[Node]:
    """All nodes that outputs need, arguments before results."""
    results: dict[Node, None] = {}

    def visit(node: Any) -> None:
        if isinstance(node, Node) and node not in results:
            for argument in node.arguments:
                visit(argument)
            results[node] = None

    for output in outputs:
        visit(output)
    return list(results)


def generated(name: str, arguments: str, results: str, outputs: Sequence[Number]) -> Callable[..., Any]:
    """A helper of kernels; what one side of a ``where`` alone needs is computed on that side.

    Parameters
    ----------
    name, arguments
        Of the helper; the code of variables reads the arguments.
    results
        Its last line, a format string of the code of the outputs.
    """
    scope: dict[str, Any] = {"__name__": __name__, "math": math}
    lines, branches = [f"def {name}({arguments}):"], _branches(outputs)
    names: dict[Any, str] = {node: f"v{number}" for number, node in enumerate(branches)}

    def write(branch: Branch) -> None:
        indent = "    " * (len(branch) + 1)
        for node in [node for node, needed in branches.items() if needed == branch]:
            values = [names.get(value, repr(value)) for value in node.arguments]
            sides = [(*branch, (node, side)) for side in (1, 2)]
            if node.operation == "where" and any(side in branches.values() for side in sides):
                for opening, side, value in zip((f"if {values[0]}:", "else:"), sides, values[1:], strict=True):
                    lines.append(indent + opening)
                    write(side)
                    lines.append(f"{indent}    {names[node]} = {value}")
            else:
                code = _CODE.get(node.operation, f"{{}} {node.operation} {{}}") if values else node.operation
                lines.append(f"{indent}{names[node]} = {code.format(*values)}")

    write(())
    lines.append("    " + results.format(*(names.get(output, repr(output)) for output in outputs)))
    exec("\n".join(lines), scope)
    return helper(scope[name])


def _branches(outputs: Sequence[Number]) -> dict[Node, Branch]:
    """The branch in which each node is computed, the innermost that all that need it have in common."""
    nodes = _sorted(outputs)
    branches: dict[Node, Branch] = {output: () for output in outputs if isinstance(output, Node)}
    for node in reversed(nodes):
        for side, argument in enumerate(node.arguments):
            if isinstance(argument, Node):
                branch = branches[node] if node.operation != "where" or not side else (*branches[node], (node, side))
                known = branches.get(argument, branch)
                common = takewhile(lambda pair: pair[0] == pair[1], zip(known, branch, strict=False))
                branches[argument] = tuple(pair[0] for pair in common)
    return {node: branches[node] for node in nodes}
