"""The table behind the generic laws: every statement there is, built in or from the examples, and random programs."""

from __future__ import annotations

from pathlib import Path

from hypothesis import strategies as st

from shapeprog.formats.plugins import load_statements
from shapeprog.language import Draw, Language, Loop, Program, Statement, standard, using
from shapeprog.language import builtin as builtin
from shapeprog.language import furniture as furniture
from shapeprog.language.parameters import LARGEST_WHOLE, Quantity

EXAMPLES = Path(__file__).parents[1] / "examples" / "statements"
MODULES = sorted(EXAMPLES.glob("*.py"))

LANGUAGE = Language()
for _declared in list(standard):
    if _declared.id <= 21 or not _declared.taught:
        LANGUAGE.register(_declared)
LANGUAGE.roles.update(standard.roles)
with using(LANGUAGE):
    for _module in MODULES:
        load_statements(_module)


def without_the_paper() -> Language:
    """A language of our own statements and all loops, for tests to add theirs to."""
    own = Language()
    for declared in standard:
        if not declared.taught or declared.is_loop:
            own.register(declared)
    return own


STATEMENTS = [declared for declared in LANGUAGE if not declared.is_loop]
LOOPS = [declared for declared in LANGUAGE if declared.is_loop]


def name_of(declared: Statement) -> str:
    return declared.name


def middle(declared: Statement) -> tuple[float, ...]:
    """Plain parameters inside the declared ranges, all different, none at a symmetric place."""
    values = []
    for slot, quantity in enumerate(declared.quantities):
        whole = {"count": min(3.0, quantity.high), "turn": 1.0, "axis": 2.0}.get(quantity.kind)
        real = 9.7 - 0.9 * slot if quantity.kind == "length" else -3.3 + 1.3 * slot + 0.17 * slot**2
        values.append(real if whole is None else whole)
    return tuple(values)


def numbers(declared: Statement) -> st.SearchStrategy[tuple[float, ...]]:
    """Every finite float32 for continuous parameters, every exact whole number for discrete ones."""
    real = st.floats(width=32, allow_nan=False, allow_infinity=False)
    whole = st.integers(-LARGEST_WHOLE, LARGEST_WHOLE).map(float)
    few = [_few(each) for each in declared.quantities]
    chosen = zip(declared.quantities, few, strict=True)
    return st.tuples(*((whole if each.discrete else real) if some is None else some for each, some in chosen))


def _few(quantity: Quantity) -> st.SearchStrategy[float] | None:
    """The values of a number that has but a few."""
    if quantity.kind != "axis" and quantity.written_out:
        return None
    return st.integers(int(quantity.low), int(quantity.high)).map(float)


def draws() -> st.SearchStrategy[Draw]:
    roles = st.sampled_from(["", *LANGUAGE.roles])
    return st.sampled_from(STATEMENTS).flatmap(
        lambda d: st.builds(Draw, st.just(d.name), numbers(d), roles.map(lambda role: "" if role == d.name else role))
    )


def loops(inner: st.SearchStrategy[Draw | Loop]) -> st.SearchStrategy[Loop]:
    body = st.lists(inner, min_size=1, max_size=3).map(tuple)
    return st.sampled_from(LOOPS).flatmap(lambda d: st.builds(Loop, st.just(d.name), numbers(d), body))


def programs() -> st.SearchStrategy[Program]:
    """Programs of any statements, freely nested."""
    nodes = st.recursive(draws(), loops, max_leaves=6)
    return st.lists(nodes, max_size=4).map(tuple).map(Program)
