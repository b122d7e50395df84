"""Statements of a user's own: declared once they work everywhere; bad ones are refused in words and leave nothing."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
import torch
from declared import MODULES

from shapeprog.data.random import random_program
from shapeprog.errors import DeclarationError, InputError, ShapeProgError
from shapeprog.formats.cuts import cut_list
from shapeprog.formats.plugins import load_statements
from shapeprog.geometry import Solids
from shapeprog.inference.choice.connecting import floating
from shapeprog.language import Language, decode, encode, loop, standard, statement, unroll, using
from shapeprog.language.parameters import Axis, Count, Extent, Length, Position, Quantity, Shift3, Two
from shapeprog.language.parser import parse
from shapeprog.language.printer import format_program
from shapeprog.language.shapes import box
from shapeprog.language.statement import Motion
from shapeprog.space import Frame
from shapeprog.view.manual import manual


@pytest.fixture
def empty() -> Iterator[Language]:
    with using(Language()) as language:
        yield language


def crate(at: Position, size: Extent) -> Solids:
    """A crate."""
    return box(at, size)


def row(copy: torch.Tensor, quarter: torch.Tensor, count: Count, by: Shift3) -> Motion:
    """A row."""
    return Motion(shift=copy[..., None] * by)


def test_a_language_without_the_built_in_library_still_works(empty: Language) -> None:
    assert (empty.names, random_program(torch.Generator(), blocks=3).body) == ([], ())
    statement("crate")(crate)
    loop("row")(row)
    assert [declared.id for declared in empty] == [22, 23]
    program = random_program(torch.Generator().manual_seed(0), blocks=5)
    assert parse(format_program(program)) == program
    assert decode(encode(program)) == [program]
    assert int(unroll(program).mask.sum()) == program.size
    assert "A crate." in manual("crate")
    with pytest.raises(ShapeProgError, match="did you mean crate"):
        manual("crates")


def no_doc(at: Position, size: Extent) -> Solids:
    return box(at, size)


def no_kind(at: Position, size) -> Solids:  # type: ignore[no-untyped-def]
    """Size has no kind."""
    return box(at, size)


def too_wide(at: Position, size: Extent, a: Extent, b: Extent, c: Extent, d: Extent) -> Solids:
    """Eighteen numbers."""
    return box(at, size)


def wrong_shape(at: Position, size: Extent) -> Solids:
    """Sizes of the wrong width."""
    return Solids(0, size, at)


def no_batch(at: Position, size: Extent) -> Solids:
    """Forgets the leading dimensions."""
    return box(at[0], size[0])


def no_single(at: Position, size: Extent) -> Solids:
    """Needs leading dimensions."""
    return box(at[:, [0, 1, 2]], size)


def part_of_a_copy(at: Position, n: Count = 2.5) -> Solids:  # type: ignore[assignment]
    """Half a copy."""
    return box(at, at)


def no_axis(at: Position, a: Axis = 7) -> Solids:  # type: ignore[assignment]
    """There are three axes."""
    return box(at, at)


def no_number(at: Position, a: Length = "r") -> Solids:  # type: ignore[assignment]
    """Text."""
    return box(at, at)


def three_numbers(at: Position = 0) -> Solids:  # type: ignore[assignment]
    """A point has three numbers."""
    return box(at, at)


def failing(at: Position, size: Length) -> Solids:
    """Fails."""
    return box(at, size[..., 5])


def nothing(at: Position) -> list[Solids]:
    """Draws nothing."""
    return []


def forgotten(at: Position, size: Extent) -> Solids:
    """Has no return."""
    box(at, size)


def no_solids(at: Position, size: Extent) -> list[torch.Tensor]:
    """Returns tensors."""
    return [at, size]


def detached(at: Position, size: Extent) -> Solids:
    """Has a gradient to its position alone."""
    return box(at, size.detach())


def through_numpy(at: Position, size: Extent) -> Solids:
    """Takes square roots with NumPy."""
    return box(at, torch.from_numpy(np.sqrt(size.numpy())))


def unused(at: Position, size: Extent, edge: Length) -> Solids:
    """Does nothing with its edge."""
    return box(at, size)


def endless(at: Position, size: Extent) -> Solids:
    """The root of a negative number."""
    return box(at, (-size).sqrt())


def backwards(at: Annotated[torch.Tensor, Quantity("length", 3, 4, 2)]) -> Solids:
    """A range from 4 to 2."""
    return box(at, at)


@pytest.mark.parametrize(
    ("name", "options", "function", "words"),
    [
        ("leg", {}, crate, "'leg' is declared twice"),
        ("crate", {"id": 1}, crate, "wants id 1, which belongs to leg"),
        ("crate", {"id": 0}, crate, "belongs to the language itself"),
        ("my crate", {}, crate, "not a Python identifier"),
        ("for", {}, crate, "not a Python identifier"),
        ("crate", {}, no_doc, "no docstring"),
        ("crate", {}, no_kind, "parameter 'size' of statement 'crate' has no kind"),
        ("crate", {}, too_wide, "18 numbers, but a statement has at most 16"),
        ("crate", {}, wrong_shape, "solids of shapes|Type-check error"),
        ("crate", {}, no_batch, "cannot be drawn"),
        ("crate", {}, no_single, "cannot be drawn: too many indices"),
        ("crate", {}, failing, "cannot be drawn: index 5"),
        ("crate", {}, nothing, "solids of shapes"),
        ("crate", {}, forgotten, "cannot be drawn: it returns nothing, not Solids|Type-check error"),
        ("crate", {}, no_solids, "cannot be drawn: it returns Tensor, not Solids|Type-check error"),
        ("crate", {}, detached, "returns solids without a gradient to size\n.* compute with torch alone"),
        ("crate", {}, through_numpy, "cannot be drawn: Can't call numpy.*\n.* compute with torch alone"),
        ("crate", {}, unused, "without a gradient to edge\n  hint: use every parameter"),
        ("crate", {}, endless, "returns solids with numbers that are not finite\n  hint: it is tried with 0, 0, 0, "),
        ("crate", {}, backwards, "ends before it starts"),
        ("crate", {}, part_of_a_copy, "wrong default of 'n': n of crate is 2.5, but must be whole"),
        ("crate", {}, no_axis, "wrong default of .* not an axis"),
        ("crate", {}, no_number, "wrong default of 'a'"),
        ("crate", {}, three_numbers, "wrong default of 'at': at of crate takes 3 numbers"),
        ("crate", {"id": 1.5}, crate, "wants id 1.5"),
        ("crate", {"id": 1 << 70}, crate, "wants id 118"),
        ("crate", {"pivot": lambda at: at}, crate, "cannot be drawn: .* unexpected keyword"),
        ("crate", {"pivot": lambda at, **_: at[..., :2]}, crate, "solids of shapes"),
        ("crate", {"hint": lambda _: [[1.0, 2.0]]}, crate, "the hint of statement 'crate' yields 2 numbers"),
    ],
)
def test_bad_statements_are_refused(
    name: str, options: dict[str, Any], function: Callable[..., Any], words: str
) -> None:
    before = standard.names
    with pytest.raises(DeclarationError, match=words) as caught:
        statement(name, **options)(function)
    assert caught.value.hint
    assert standard.names == before


def still(copy: torch.Tensor, quarter: torch.Tensor, by: Shift3, count: Count) -> Motion:
    """The count comes last."""
    return Motion(shift=copy[..., None] * by)


def flat(copy: torch.Tensor, quarter: torch.Tensor, count: Count, by: Shift3) -> Motion:
    """Shifts by two numbers."""
    return Motion(shift=copy[..., None] * by[..., :2])


def absent(copy: torch.Tensor, quarter: torch.Tensor, count: Count) -> None:
    """Returns nothing."""


def stiff(copy: torch.Tensor, quarter: torch.Tensor, count: Count, by: Shift3) -> Motion:
    """Shifts without a gradient."""
    return Motion(shift=copy[..., None] * by.detach())


def thrice(copy: torch.Tensor, quarter: torch.Tensor, count: Count = 3) -> Motion:  # type: ignore[assignment]
    """Text could leave its count out."""
    return Motion()


def twice(copy: torch.Tensor, quarter: torch.Tensor, count: Two) -> Motion:
    """Text always leaves its count out."""
    return Motion()


def bent(copy: torch.Tensor, quarter: torch.Tensor, count: Count) -> Motion:
    """A rotation in the plane."""
    return Motion(rotation=torch.eye(2))


def off(copy: torch.Tensor, quarter: torch.Tensor, count: Count) -> Motion:
    """A pivot in the plane."""
    return Motion(pivot=torch.zeros(2))


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (still, "no count"),
        (flat, "a motion of shapes|Type-check error"),
        (absent, "cannot be moved: it returns nothing, not Motion|Type-check error"),
        (stiff, "returns a motion without a gradient to by"),
        (thrice, "needs a first argument without a default"),
        (twice, "needs a first argument"),
        (bent, "a motion of shapes|Type-check error"),
        (off, "a motion of shapes|Type-check error"),
    ],
)
def test_bad_loops_are_refused(function: Callable[..., Any], words: str) -> None:
    with pytest.raises(DeclarationError, match=words):
        loop("still")(function)


@pytest.mark.parametrize("module", MODULES, ids=lambda path: path.stem)
def test_the_examples_declare_in_at_most_15_lines(module: Path) -> None:
    text = module.read_text()
    declaration = text[text.index("@statement") :]
    assert len(declaration.strip().splitlines()) <= 15


def test_modules_load_into_any_language_once(empty: Language) -> None:
    for module in MODULES:
        first = load_statements(module)
        assert load_statements(str(module)) == first
        assert all(empty[declared.name] is declared for declared in first)
    assert sorted(empty.names) == ["arch", "bolster", "cone_leg", "pouf"]
    program = random_program(torch.Generator().manual_seed(0))
    assert parse(format_program(program)) == program


CRATE = '''
from shapeprog.geometry import Solids
from shapeprog.language import statement
from shapeprog.language.parameters import Extent, Position
from shapeprog.language.shapes import box

@statement("crate")
def crate(at: Position, size: Extent) -> Solids:
    """A crate."""
    return box(at, size)
'''


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("1 / 0", r"bad.py, line 1: ZeroDivisionError: division by zero"),
        (f"{CRATE}1 / 0", r"bad.py, line 11: ZeroDivisionError"),
        (f"{CRATE}raise SystemExit(3)", r"line 11: SystemExit: 3"),
        (f"{CRATE}{CRATE}", r"line 1[78]: statement 'crate' is declared twice"),
        ("def (", r"line 1: SyntaxError"),
        ("import no_such_module_anywhere", r"line 1: ModuleNotFoundError"),
        ("x = 1", r"bad.py: .*declares no statement"),
        ("\0", r"bad.py: .*null bytes"),
    ],
)
def test_failing_modules_leave_nothing(empty: Language, tmp_path: Path, code: str, words: str) -> None:
    path = tmp_path / "bad.py"
    path.write_text(code)
    with pytest.raises(DeclarationError, match=words):
        load_statements(path)
    assert empty.names == []
    path.write_text(CRATE)
    assert [declared.name for declared in load_statements(path)] == ["crate"]


def test_an_edited_module_replaces_its_declarations_and_a_broken_one_leaves_them(
    empty: Language, tmp_path: Path
) -> None:
    path = tmp_path / "crates.py"
    path.write_text(CRATE + 'from shapeprog.language import role\nrole("box_of_a_kind", "A box.")\n')
    (first,) = load_statements(path)
    path.write_text(CRATE.replace("at, size)\n", "at, 2 * size)\n") + CRATE.replace("crate", "chest"))
    second, chest = load_statements(path)
    assert ([*empty], [*empty.roles], second.id) == ([second, chest], [], first.id)
    assert float(unroll(parse("crate(at=(0, 0, 0), size=(1, 1, 1))")).size.max()) == 1
    path.write_text("1 / 0")
    with pytest.raises(DeclarationError, match="ZeroDivisionError"):
        load_statements(path)
    assert [*empty] == [second, chest]


def cell(code: str, number: int) -> None:
    """Run a cell of a notebook."""
    exec(compile(code, f"<cell {number}>", "exec"), {"__name__": "__main__"})


def test_a_cell_of_a_notebook_replaces_its_declaration() -> None:
    with using(copy.deepcopy(standard)) as own:
        declared = CRATE + 'from shapeprog.language import role\nrole("crate", "A crate.")\n'
        cell(declared, 1)
        number = own["crate"].id
        part = parse("crate(at=(0, 0, 0), size=(4, 4, 4))")
        assert cut_list(part, Frame()).cuts[0][0].length == 4
        assert not floating(part)
        cell(declared, 1)  # run again
        cell(declared.replace("return box(at, size)", "return [box(at, size / 2), box(at + size, size / 8)]"), 2)
        assert own["crate"].id == number == own.roles["crate"].id
        assert cut_list(part, Frame()).cuts[0][0].length == 2
        assert floating(part)
        with pytest.raises(DeclarationError, match="no docstring"):
            cell(declared.replace('"""A crate."""', ""), 3)
        assert len(unroll(part).mask) == 2
        with pytest.raises(DeclarationError, match="'leg' is declared twice"):
            cell(CRATE.replace('"crate"', '"leg"'), 4)
        with pytest.raises(DeclarationError, match="role 'crate' is declared twice"):
            cell('from shapeprog.language import role\nrole("crate", "Another crate.")\n', 5)


def test_missing_modules_are_named(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.py"):
        with pytest.raises(InputError, match=str(path)):
            load_statements(path)


def test_defaults_are_rounded_as_text_is(empty: Language) -> None:
    @statement("crate")
    def crate(at: Position, size: Length = 0.1) -> Solids:  # type: ignore[assignment]
        """A crate."""
        return box(at, size[..., None].expand(at.shape))

    program = parse("crate(at=(1, 2, 3))")
    assert parse(format_program(program)) == program
