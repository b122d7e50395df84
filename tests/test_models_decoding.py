"""Generators and decoding: legality, teacher forcing agrees with decoding, beams, lessons."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from shapeprog.data.random import outside_published, random_program
from shapeprog.data.synthetic import Stream, prior
from shapeprog.errors import ShapeProgError
from shapeprog.geometry.cells import count, pack, preceding, unpack, widen
from shapeprog.inference.snapping import snapped_from
from shapeprog.language.parameters import Extent, Position
from shapeprog.language.program import Program
from shapeprog.language.shapes import box
from shapeprog.language.statement import Language, language, statement, using
from shapeprog.language.tensors import Code, encode
from shapeprog.language.tensors import decode as programs_of
from shapeprog.language.unroll import draw_blocks
from shapeprog.models.decoding import beam, decode
from shapeprog.models.designs import build_generator
from shapeprog.models.generator import Generator, live_blocks
from shapeprog.models.vocabulary import Vocabulary
from shapeprog.training.lessons import by_coverage, lesson, relabelled

SMALL = {"widths": (4, 8, 8), "squeeze": 4, "feature": 16}


@pytest.fixture(params=["swift", "chained"])
def small(request: pytest.FixtureRequest) -> Callable[..., Generator]:
    """Makes tiny generators of each design."""

    def make(seed: int = 0, vocabulary: Vocabulary | None = None) -> Generator:
        torch.manual_seed(seed)
        return build_generator(request.param, SMALL, vocabulary).eval()

    return make


def targets(count: int, seed: int = 0) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    cells = torch.zeros(count, 32, 32, 32, dtype=torch.uint8)
    for each in cells:
        low = torch.randint(4, 12, (3,), generator=generator)
        high = low + torch.randint(4, 16, (3,), generator=generator)
        each[low[0] : high[0], low[1] : high[1], low[2] : high[2]] = 1
    return cells


def code_of(seeds: range, blocks: int = 6) -> Code:
    programs = [
        random_program(torch.Generator().manual_seed(seed), blocks=1 + seed % blocks, whole=True, published=True)
        for seed in seeds
    ]
    return encode(programs, blocks=blocks)


@pytest.mark.parametrize("choose", ["argmax", "sample"])
def test_only_legal_blocks_are_written(small: Callable[..., Generator], choose: str) -> None:
    random = torch.Generator().manual_seed(1)
    for seed in range(3):
        code = decode(small(seed), targets(8, seed), choose=choose, temperature=3.0, random=random).code  # type: ignore[arg-type]
        written = programs_of(code)
        assert [outside_published(program) for program in written] == [[]] * 8
        drawing = (code.ids[:, :, 0] != 0).sum(-1)
        assert [program.blocks for program in written] == drawing.tolist()


@pytest.mark.parametrize("choose", ["drawn", "argmax"])
def test_offsets_move_the_surface_by_less_than_a_cell_and_change_nothing_that_is_drawn(choose: str) -> None:
    torch.manual_seed(0)
    generator, target = build_generator("chained", SMALL).eval(), targets(6)
    plain = decode(generator, target, choose=choose)  # type: ignore[arg-type]
    assert torch.equal(plain.code.parameters, plain.drawn.parameters), "offsets are zero before anything moved them"
    with torch.no_grad():
        for weight in generator.offset_weights():
            weight.normal_(std=3.0)
    moved = decode(generator, target, choose=choose)  # type: ignore[arg-type]
    assert torch.equal(moved.canvases, plain.canvases)
    assert torch.equal(moved.drawn.parameters, plain.drawn.parameters)
    assert torch.equal(moved.code.ids, plain.code.ids)
    off = moved.code.parameters - moved.drawn.parameters
    assert 0.5 < float(off.abs().max()) < 1
    known = generator.vocabulary
    live = live_blocks(moved.code.ids)
    assert not bool(off[live][known.discrete[moved.code.ids[live]]].any())
    low, high = known.ranges[moved.code.ids[live]].unbind(-1)
    values, used = moved.code.parameters[live], known.used[moved.code.ids[live]]
    assert bool(((values >= low) & (values <= high))[used].all())
    told = generator.predict(target, moved.canvases, moved.drawn)
    torch.testing.assert_close(told.parameters[live], moved.code.parameters[live])
    whole = programs_of(Code(moved.code.ids, moved.drawn.parameters.round()))
    for program, snapped in zip(programs_of(moved.code), whole, strict=True):
        assert snapped_from(program, snapped)


def test_beams_end_in_the_offsets_of_their_blocks() -> None:
    torch.manual_seed(0)
    generator, target = build_generator("chained", SMALL).eval(), targets(3)
    with torch.no_grad():
        for weight in generator.offset_weights():
            weight.normal_(std=3.0)
    best, alone = beam(generator, target, width=1), decode(generator, target, choose="argmax")
    torch.testing.assert_close(best.code.parameters[:, 0], alone.code.parameters)


def test_a_program_does_not_depend_on_its_batch(small: Callable[..., Generator]) -> None:
    generator, target = small(), targets(5)
    together = decode(generator, target).code
    for n in range(5):
        alone = decode(generator, target[n : n + 1]).code
        assert torch.equal(alone.ids[0], together.ids[n])
        torch.testing.assert_close(alone.parameters[0], together.parameters[n], rtol=1e-4, atol=1e-4)


def test_teacher_forcing_on_its_own_program_says_the_same(small: Callable[..., Generator]) -> None:
    generator, target = small(2), targets(4)
    found = decode(generator, target, choose="argmax")
    told = generator.predict(target, found.canvases, found.code)
    live = told.live[..., None, None]
    torch.testing.assert_close(told.parameters, found.code.parameters * live, rtol=1e-4, atol=1e-4)
    total = told.log_probability(found.code.ids).sum(-1)
    torch.testing.assert_close(total, found.log_probability, rtol=1e-4, atol=1e-3)


def test_blocks_that_do_not_help_are_not_written(small: Callable[..., Generator]) -> None:
    target = targets(6)
    for seed in range(3):
        found = decode(small(seed), target)
        drawn, cells = draw_blocks(found.code), pack(target)[:, None]
        before, written = found.canvases, (found.code.ids != 0).any(-1)
        new = drawn & ~before
        near = count(cells & widen(drawn) & ~widen(before))
        assert (near + count(new & cells) > 0)[written].all()  # something of the target is new, or newly near
        assert torch.equal(written, live_blocks(found.code.ids) & written)  # nothing after the end


def test_by_drawing_what_is_known_by_heart_is_rebuilt() -> None:
    generator, _, target = known_by_heart()
    code = decode(generator, target, width=4).code
    drawn = preceding(torch.nn.functional.pad(draw_blocks(code), (0, 0, 0, 0, 0, 1)))[:, -1]
    iou = count(drawn & pack(target)) / count(drawn | pack(target))
    assert (iou > 0.9).all()


def test_widened_cells_are_those_within_one_face() -> None:
    cells = torch.zeros(1, 32, 32, 32, dtype=torch.uint8)
    cells[0, 5, 6, 31] = cells[0, 0, 0, 0] = 1
    wide = unpack(widen(pack(cells)))
    kernel = torch.zeros(1, 1, 3, 3, 3)
    kernel[0, 0, [0, 1, 1, 1, 1, 1, 2], [1, 0, 1, 1, 1, 2, 1], [1, 1, 0, 1, 2, 1, 1]] = 1
    expected = torch.nn.functional.conv3d(cells[:, None].float(), kernel, padding=1)[:, 0] > 0
    assert torch.equal(wide, expected.to(torch.uint8))


def test_the_canvases_are_what_the_blocks_before_draw(small: Callable[..., Generator]) -> None:
    found = decode(small(), targets(4))
    assert torch.equal(preceding(draw_blocks(found.code)), found.canvases)


def test_a_beam_of_one_is_the_greedy_program_and_wider_ones_are_no_less_likely(small: Callable[..., Generator]) -> None:
    generator, target = small(3), targets(4)
    greedy = decode(generator, target, blocks=3, choose="argmax")
    one = beam(generator, target, width=1, blocks=3)
    assert torch.equal(one.code.ids[:, 0], greedy.code.ids)
    torch.testing.assert_close(one.code.parameters[:, 0], greedy.code.parameters, rtol=1e-4, atol=1e-4)
    wide = beam(generator, target, width=6, blocks=3, rank="log_probability")
    assert (wide.log_probability[:, :-1] >= wide.log_probability[:, 1:]).all()
    every = beam(generator, target, width=80, blocks=1, rank="log_probability")
    likelihood = every.log_probability.exp()
    assert (likelihood.sum(-1) <= 1 + 1e-4).all()  # different programs: their chances add up to at most one
    assert every.code.ids.flatten(2).unique(dim=1).shape[1] <= 80


def test_a_beam_is_ordered_by_what_it_draws(small: Callable[..., Generator]) -> None:
    target = targets(4)
    found = beam(small(4), target, width=5)
    blocks = draw_blocks(found.code)
    drawn = torch.zeros_like(blocks[:, :, 0])
    for k in range(blocks.shape[2]):
        drawn = drawn | blocks[:, :, k]
    cells = pack(target)[:, None]
    iou = count(drawn & cells) / count(drawn | cells)
    assert (iou[:, :-1] >= iou[:, 1:] - 1e-6).all()


def test_canvases_pack_and_unpack() -> None:
    cells = (torch.rand(3, 32, 32, 32, generator=torch.Generator().manual_seed(0)) < 0.5).to(torch.uint8)
    assert torch.equal(unpack(pack(cells)), cells)
    assert torch.equal(count(pack(cells)), cells.flatten(1).sum(1, dtype=torch.int64))


def test_blocks_in_order_of_coverage_draw_the_same_and_cover_less_and_less() -> None:
    code = code_of(range(24))
    drawn = draw_blocks(code)
    ordered, cells = by_coverage(code, drawn)
    assert torch.equal(draw_blocks(ordered), cells)
    whole, union = preceding(torch.cat([drawn, drawn[:, :1]], 1))[:, -1], preceding(torch.cat([cells, cells[:, :1]], 1))
    assert torch.equal(union[:, -1], whole)
    new = count(cells & ~union[:, :-1])
    assert (new[:, :-1] >= new[:, 1:]).all()
    kept = (ordered.ids != 0).any(-1)
    assert torch.equal(new > 0, kept)


def test_a_lesson_ends_with_a_stop() -> None:
    code = code_of(range(12))
    target = targets(12)
    taught = lesson(target, code)
    assert torch.equal(taught.live.sum(-1), (taught.code.ids != 0).any(-1).sum(-1) + 1)
    assert torch.equal(taught.live, live_blocks(taught.code.ids))


def test_relabelling_on_the_canvases_of_the_lesson_changes_nothing() -> None:
    code, target = code_of(range(12)), targets(12)
    taught = lesson(target, code)
    again = relabelled(target, code, taught.canvases, taught.live)
    assert torch.equal(again.code.ids * again.live[..., None], taught.code.ids * taught.live[..., None])


def test_no_more_rows_are_picked_than_asked_for() -> None:
    taught = lesson(targets(12), code_of(range(12)))
    picked = taught.pick(2, torch.Generator().manual_seed(0))
    assert torch.equal(picked.live.sum(-1), taught.live.sum(-1).clamp(max=2))
    assert not (picked.live & ~taught.live).any()


def known_by_heart(design: str = "swift") -> tuple[Generator, Code, Tensor]:
    """A generator that has learned four programs by heart, these, and what they draw."""
    torch.manual_seed(0)
    generator = build_generator(design, SMALL)
    made = Stream(prior("narrow"), 4, seed=0)[0]
    taught = lesson(made.voxels, made.code)
    optimiser = torch.optim.Adam(generator.parameters(), 1e-2)
    for _ in range(150):
        told = generator.predict(taught.target, taught.canvases, taught.code, taught.live)
        loss = sum(generator.losses(told, taught.code).values(), torch.zeros(()))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    assert float(loss.detach()) < 0.2
    return generator.eval(), taught.code, taught.target


@pytest.mark.parametrize("design", ["swift", "chained"])
def test_what_is_learned_by_heart_is_said_again(design: str) -> None:
    generator, code, target = known_by_heart(design)
    told = generator.predict(target, preceding(draw_blocks(code)), code)
    used = generator.vocabulary.used[told.told.ids]
    off = (told.values - told.told.values).detach().abs() * used
    assert float(off.max()) < 0.5


def test_values_between_whole_ones_are_learned_as_such(small: Callable[..., Generator]) -> None:
    generator = small()
    ids = torch.tensor([[1, 0, 0]])
    heads = torch.zeros(1, 3, 32)
    values = torch.full((1, 3, 7), 2.25)
    assert (generator.parameter_loss(heads, ids, values)[0, 0, :6] > 0).all()
    assert (generator.values(heads, ids)[0, 1:] == 0).all()  # an empty step has no parameters


def test_changed_statements_are_named() -> None:
    record = Vocabulary.current().record()
    assert Vocabulary.check(record).size == 22
    other = Language()
    for declared in language():
        if declared.name != "leg":
            other.register(declared)
    with using(other):
        with pytest.raises(ShapeProgError, match="'leg' that is not registered"):
            Vocabulary.check(record)

        @statement("leg", id=1)
        def leg(at: Position, extent: Extent) -> object:
            """A leg with another parameter name."""
            return box(at, extent)

        with pytest.raises(ShapeProgError, match="'leg' has changed"):
            Vocabulary.check(record)


def test_registered_statements_are_legal_and_sayable(small: Callable[..., Generator]) -> None:
    other = Language()
    for declared in language():
        other.register(declared)
    with using(other):

        @statement("puff")
        def puff(at: Position, size: Extent) -> object:
            """A soft box."""
            return box(at, size)

        vocabulary = Vocabulary.current()
        assert vocabulary.size == 23
        assert bool(vocabulary.allowed(0, None)[0, 22])
        assert bool(vocabulary.allowed(1, torch.tensor([19]))[0, 22])
        assert not bool(vocabulary.allowed(1, torch.tensor([20]))[0, 22])  # it has no axis of its own to turn about
        generator = small(0, vocabulary)
        assert all(isinstance(each, Program) for each in programs_of(decode(generator, targets(2)).code))


def test_unknown_designs_and_settings_are_named() -> None:
    with pytest.raises(ShapeProgError, match="no design 'swfit'"):
        build_generator("swfit")
    with pytest.raises(ShapeProgError, match="no setting 'width'"):
        build_generator("swift", {"width": 3})
