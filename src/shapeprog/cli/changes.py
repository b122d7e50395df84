"""Changes of named numbers on the command line: ``--set seat=11 'width*=1.2'``."""

from __future__ import annotations

import operator
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from shapeprog.errors import InputError

if TYPE_CHECKING:
    from shapeprog.language.program import Program

CHANGE = re.compile(r"([^\W\d]\w*)\s*([-+*/]?)=\s*(.*)", re.DOTALL)
_APPLY = {"": lambda _, number: number, "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}


def changed(program: Program, changes: Sequence[str]) -> Program:
    """The program with other numbers for some of its names, one change after another.

    Raises
    ------
    InputError
        If a change is none.
    ShapeProgError
        If the program has no such name, or cannot be drawn so.
    """
    if not changes:
        return program
    from shapeprog.language.named import names
    from shapeprog.language.named import set as set_numbers

    values = {named.name: named.value for named in names(program)}
    wanted: dict[str, float] = {}
    for change in changes:
        match = CHANGE.fullmatch(change.strip())
        if match is None:
            raise InputError(f"invalid change {change!r}", "write name=number, or name*=number with one of + - * /")
        name, sign, text = match.groups()
        try:
            number = float(text)
            wanted[name] = _APPLY[sign](wanted.get(name, values.get(name, number)), number)
        except ValueError:
            raise InputError(f"{change!r}: {text!r} is not a number", "write a number such as 11 or 1.2") from None
        except ZeroDivisionError:
            raise InputError(f"{change!r} divides by zero", "divide by another number") from None
    return set_numbers(program, wanted)
