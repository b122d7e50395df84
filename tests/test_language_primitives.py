"""Laws of every primitive, those of the example statements included: surface, distance, mesh and volume agree."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from declared import LANGUAGE

from shapeprog.geometry import Primitive
from shapeprog.geometry import primitives as KINDS

SIZES = [(4.0, 9.0, 1.0, 0.0), (1.0, 1.0, 1.0, 0.0), (5.0, 0.01, 3.0, 0.0), (0.02, 7.0, 7.0, 0.0), (6.0, 3.0, 2.0, 4.5)]
FLAT = [(6.0, 3.0, 0.0, 0.0), (0.0, 2.0, 3.0, 0.0), (3.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)]


def size_of(kind: Primitive, size: tuple[float, ...]) -> torch.Tensor:
    used = torch.arange(4) < len(kind.sizes)
    return torch.where(used, torch.tensor(size, dtype=torch.float64), 0.0)


def surface(kind: Primitive, size: torch.Tensor, count: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Uniform points on a primitive and their normals."""
    generator = torch.Generator().manual_seed(7)
    face = torch.multinomial(kind.areas(size).double() + 1e-300, count, replacement=True, generator=generator)
    many = size.expand(count, 4)
    unit = kind.sample(many, face, torch.rand(count, 3, generator=generator, dtype=size.dtype))
    return kind.place(many, unit), kind.normal(many, unit, face)


def test_the_examples_are_among_them() -> None:
    assert {"pouf", "cone_leg", "arch", "bolster"} <= set(LANGUAGE.names)
    assert {"arc", "cuboid", "cylinder", "frustum", "rounded_box"} == {kind.name for kind in KINDS}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_primitives_are_their_own_mirror_images_along_axis_2(kind: Primitive) -> None:
    points = 4 * torch.rand(50, 3, generator=torch.Generator().manual_seed(3), dtype=torch.float64) - 2
    sizes = size_of(kind, (1.0, 0.8, 0.6, 0.4)).expand(50, 4)
    mirrored = points * torch.tensor([1.0, 1.0, -1.0])
    torch.testing.assert_close(kind.distance(points, sizes), kind.distance(mirrored, sizes))


@pytest.mark.parametrize("size", [*SIZES, *FLAT[:2]], ids=str)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_samples_lie_on_the_surface_and_normals_leave_it(kind: Primitive, size: tuple[float, ...]) -> None:
    sizes = size_of(kind, size)
    points, normals = surface(kind, sizes, 2000)
    assert kind.distance(points, sizes.expand(2000, 4)).abs().max() < 1e-9
    if (sizes[: kind.extents] > 0).all():
        out = kind.distance(points + 1e-4 * normals, sizes.expand(2000, 4))
        torch.testing.assert_close(out, torch.full_like(out, 1e-4), rtol=0, atol=1e-8)
    assert (points.abs() <= kind.bound(sizes) + 1e-9).all()


@pytest.mark.parametrize("size", [*SIZES, *FLAT[:2]], ids=str)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_distance_is_that_to_the_nearest_surface_point(kind: Primitive, size: tuple[float, ...]) -> None:
    sizes = size_of(kind, size)
    points, _ = surface(kind, sizes, 20000)
    places = 9 * torch.rand(200, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64) - 4.5
    nearest = torch.cdist(places, points).amin(-1)
    found = kind.distance(places, sizes.expand(200, 4)).abs()
    spacing = math.sqrt(float(kind.areas(sizes).sum()) / 20000)
    assert (found <= nearest + 1e-9).all()
    assert (nearest - found).max() < 4 * spacing + 1e-9


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_samples_are_uniform_by_area(kind: Primitive, size: tuple[float, ...]) -> None:
    """The divergence theorem gives the volume back, and the second moments are those of the mesh."""
    sizes = size_of(kind, size)
    points, normals = surface(kind, sizes, 20000)
    area = float(kind.areas(sizes).sum())
    share = (points * normals).sum(-1) * area / 3
    error = 4 * float(share.std()) / math.sqrt(20000) + 1e-9
    assert abs(float(share.mean()) - float(kind.volume(sizes))) < error
    vertices, faces = kind.mesh(sizes.numpy())
    corners = vertices[faces]
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert twice.sum() / 2 == pytest.approx(area, rel=0.01)
    moments = (corners[:, :, None] * corners.sum(1)[:, None, None] + corners[:, :, None] * corners[:, :, None]).sum(
        (1, 2)
    )
    wanted = (moments / 24 * twice[:, None]).sum(0) / area
    found = points**2
    allowed = 4 * found.std(0).numpy() / math.sqrt(20000) + 0.02 * wanted + 1e-9
    assert (np.abs(found.mean(0).numpy() - wanted) < allowed).all()


@pytest.mark.parametrize("size", [*SIZES, *FLAT], ids=str)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_meshes_are_closed_and_have_the_exact_volume(kind: Primitive, size: tuple[float, ...]) -> None:
    sizes = size_of(kind, size)
    vertices, faces = kind.mesh(sizes.numpy())
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert len({tuple(edge) for edge in edges.tolist()}) == len(edges)
    assert {tuple(edge) for edge in edges.tolist()} == {tuple(edge) for edge in edges[:, ::-1].tolist()}
    volume = np.linalg.det(vertices[faces]).sum() / 6
    assert volume == pytest.approx(float(kind.volume(sizes)), abs=1e-9)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_gradients_of_distance_area_and_place_agree_with_differences(kind: Primitive) -> None:
    sizes = size_of(kind, SIZES[-1]).requires_grad_()
    places = 8 * torch.rand(12, 3, generator=torch.Generator().manual_seed(2), dtype=torch.float64) - 4
    places.requires_grad_()
    assert torch.autograd.gradcheck(lambda p, s: kind.distance(p, s.expand(12, 4)), (places, sizes))
    assert torch.autograd.gradcheck(kind.areas, sizes)
    assert torch.autograd.gradcheck(kind.volume, sizes)


@pytest.mark.parametrize("size", [*SIZES, *FLAT], ids=str)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_gradients_are_finite_everywhere(kind: Primitive, dtype: torch.dtype, size: tuple[float, ...]) -> None:
    grid = torch.tensor([-6.0, -3.0, -1.0, 0.0, 1.0, 3.0, 6.0])
    points = torch.cartesian_prod(grid, grid, grid).to(dtype).requires_grad_()
    sizes = size_of(kind, size).to(dtype).requires_grad_()
    distance = kind.distance(points, sizes.expand(len(points), 4))
    total = distance.sum() + kind.areas(sizes).sum() + kind.volume(sizes)
    for gradient in torch.autograd.grad(total, (points, sizes)):
        assert torch.isfinite(gradient).all()
    assert torch.isfinite(distance).all()


def test_scripts_written_for_release_0_1_0_still_import_the_primitives() -> None:
    from shapeprog.geometry.primitive import primitives as former
    from shapeprog.geometry.primitives import primitives

    assert former is primitives
