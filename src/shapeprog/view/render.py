"""A small renderer: one camera, soft light from the sky with true shadows, thin lines along edges, all on the CPU.

Every light of the sky sees the scene once (a depth map); a surface is as bright as the lights that reach it.  Each
pixel is the mean over a square of samples, and each sample uses another share of the lights, so shadows are smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from shapeprog.space import Array
from shapeprog.view.model import Model

Image = npt.NDArray[np.uint8]

DIRECTION = (0.62, -1.0, -0.72)  # from the shape to the eye: above, in front, on the viewer's right
DISTANCE = 4.2  # distance of the eye from the middle, in radii of the model: a mild perspective
MARGIN = 0.07  # empty border around the shape, as a share of the picture
SAMPLES = 3  # samples along each side of a pixel
LIGHTS = (27, 45)  # fewest and most lights: small pictures and large meshes get fewer
MAP_SIZE = (112, 208)  # pixels along each side of a depth map of a light, in small and in large pictures
LARGE = 480  # width in pixels from which a picture counts as large
WORK = 1_500_000  # most triangles times lights of a picture
KEY = np.array([0.85, -0.55, 0.45])  # where the sky is brightest: above, in front, on the viewer's left
AMBIENT = 0.36  # light that reaches every corner, as a share
SHADOW = 0.7  # how much of the sky's shadow shows on the ground
COARSE = 3  # pixels along each side of a square of ground that shares its light
FADE = 0.14  # width of the border, as a share of the picture, over which the shadow fades to white
BLUR = 1.6  # width of the blur, in such squares, that hides the single lights in the shadow on the ground

INKS = np.array([1.0, 0.45, 0.16, 0.1])
"""Brightness without a line, of creases, of outlines, and of outlines on the ground."""

GAMMA = 2.2


@dataclass(frozen=True)
class Camera:
    """A pinhole camera directed at the middle of the models.

    Parameters
    ----------
    eye
        Its position in the grid frame.
    right, up, ahead
        Unit axes of the view.
    focal
        Pixels per unit of slope.
    middle
        Slope (right, up) at the middle of the picture.
    low, radius
        Height of the ground, and a radius around the origin that holds everything shown.
    """

    eye: Array
    right: Array
    up: Array
    ahead: Array
    focal: float
    middle: Array
    low: float
    radius: float

    def project(self, points: Array, width: int, height: int) -> Array:
        """Pixel coordinates and inverse depth (V, 3)."""
        offset = points - self.eye
        depth = np.maximum(offset @ self.ahead, 1e-6)
        across = (offset @ self.right / depth - self.middle[0]) * self.focal * width + width / 2
        down = height / 2 - (offset @ self.up / depth - self.middle[1]) * self.focal * width
        return np.stack([across, down, 1 / depth], 1)


def camera_for(models: Sequence[Model], aspect: float = 1.0) -> Camera:
    """The camera that shows all models as large as they fit into a picture of width / height ``aspect``."""
    clouds = [model.vertices for model in models if len(model.vertices)] or [np.zeros((1, 3))]
    low, high = np.min([cloud.min(0) for cloud in clouds], 0), np.max([cloud.max(0) for cloud in clouds], 0)
    centre, span = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1.0)
    back = np.array(DIRECTION) / np.linalg.norm(DIRECTION)
    right = np.cross(-back, [1.0, 0, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, -back)
    eye = centre + DISTANCE * span * back
    first, last, farthest = np.full(2, np.inf), np.full(2, -np.inf), 0.0
    for cloud in clouds:
        offset = cloud - eye
        slopes = offset @ np.stack([right, up], 1) / (offset @ -back)[:, None]
        first, last = np.minimum(first, slopes.min(0)), np.maximum(last, slopes.max(0))
        farthest = max(farthest, float(np.linalg.norm(cloud, axis=1).max()))
    extent = np.maximum(last - first, 1e-6)
    focal = (1 - 2 * MARGIN) * min(1 / extent[0], 1 / (aspect * extent[1]))
    radius = farthest * 1.02 + 0.5
    return Camera(eye, right, up, -back, float(focal), (first + last) / 2, float(low[0]), radius)


def render(model: Model, camera: Camera, width: int, height: int) -> Image:
    """A picture (height, width, 3) of a model on white ground with its soft shadow.

    Parameters
    ----------
    model
        What to draw, in the grid frame.
    camera
        Use the same one for pictures to be compared.
    width, height
        In pixels.
    """
    from shapeprog.view import raster_kernels as kernels

    wide, tall = width * SAMPLES, height * SAMPLES
    vertices = np.ascontiguousarray(model.vertices, np.float64)
    faces = np.ascontiguousarray(model.faces, np.int64)
    shown = np.ascontiguousarray(model.normals, np.float64)
    points = camera.project(vertices, wide, tall)
    face, depth = _nearest(points, faces, (tall, wide), 0.0, 1e-6)
    scale = camera.focal * wide
    across, down = camera.right / scale, -camera.up / scale
    corner = camera.ahead + camera.right * camera.middle[0] + camera.up * camera.middle[1]
    corner = corner - across * wide / 2 - down * tall / 2
    position, normal = (np.zeros((tall, wide, 3), np.float32) for _ in range(2))
    view = np.stack([camera.eye, corner, across, down])
    kernels.surface(face, depth, points, faces, shown, view, position, normal)
    large = int(width >= LARGE)
    lights = SAMPLES**2 * max(1, min(LIGHTS[large], WORK // max(len(faces), 1)) // SAMPLES**2)
    frames, weights = _sky(lights)
    maps = np.stack([_height_map(vertices, faces, frame, camera.radius, MAP_SIZE[large]) for frame in frames])
    bias = 2.2 * camera.radius / MAP_SIZE[large]
    sky = (maps, frames, weights, camera.radius)
    lit = np.zeros((tall, wide), np.float32)
    kernels.irradiance(position, normal, face, *sky, SAMPLES, bias, lit)
    ground = _ground(view * [[1], [1], [SAMPLES], [SAMPLES]], camera.low, sky, bias, height, width)
    lines = _lines(face, np.asarray(model.group, np.int64), position, normal)
    colours = (np.ascontiguousarray(model.colours, np.float32).reshape(-1, 3) / 255) ** GAMMA
    total = np.zeros((height, width, 3), np.float32)
    kernels.develop(face, colours, lit, lines, INKS, AMBIENT, ground, SAMPLES, total)
    linear = total / np.float64(SAMPLES * SAMPLES)
    return (np.clip(linear, 0, 1) ** (1 / GAMMA) * 255 + 0.5).astype(np.uint8)


def _nearest(
    points: Array, faces: Array, shape: tuple[int, int], lowest: float, tolerance: float
) -> tuple[Array, Array]:
    """The face and the depth of every pixel; without one, ``BACKGROUND`` and the lowest depth."""
    from shapeprog.view import raster_kernels as kernels

    face, depth = np.full(shape, kernels.BACKGROUND, np.int32), np.full(shape, lowest)
    kernels.nearest_faces(np.ascontiguousarray(points), faces, tolerance, face, depth)
    return face, depth


def _height_map(vertices: Array, faces: Array, frame: Array, radius: float, size: int) -> Array:
    """The height (size, size) of the highest surface below a light, along its direction, the last row of ``frame``."""
    seen = vertices @ frame.T
    seen[:, :2] = (seen[:, :2] + radius) * size / (2 * radius)
    return _nearest(seen, faces, (size, size), -1e9, 0.0)[1].astype(np.float32)


def _lines(face: Array, groups: Array, position: Array, normal: Array) -> Array:
    """Lines (H, W) between pixels: 2 where another part or the ground begins or the surface jumps, 1 at creases."""
    width = face.shape[1]
    lines = np.zeros(face.shape, np.uint8)
    flat, drawn, place, facing = face.reshape(-1), lines.reshape(-1), position.reshape(-1, 3), normal.reshape(-1, 3)
    for step, borders in ((1, face[:, 1:] != face[:, :-1]), (width, face[1:] != face[:-1])):
        rows, columns = np.nonzero(borders)
        first = rows * width + columns
        second = first + step
        part = (flat[first] < 0) | (flat[second] < 0) | (groups[flat[first]] != groups[flat[second]])
        offset = place[second] - place[first]
        gaps = [np.abs((offset * facing[pixel]).sum(1)) for pixel in (first, second)]
        crease = (facing[first] * facing[second]).sum(1) < 0.8
        kind = np.where(part | (np.minimum(*gaps) > 0.3), 2, crease).astype(np.uint8)
        for pixel in (first, second):
            drawn[pixel] = np.maximum(drawn[pixel], kind)
    return lines


def _ground(view: Array, low: float, sky: Sequence[Any], bias: float, height: int, width: int) -> Array:
    """Brightness (H, W) of the ground, smooth and fading to white at the border.

    It is computed for coarse squares, but with all lights of the sky, and blurred.  ``view`` holds as rows the eye, and
    the corner, across and down of its rays, in pixels of the picture; ``low`` is the height of the ground.
    """
    from PIL import Image as Pillow
    from scipy.ndimage import gaussian_filter

    from shapeprog.view.raster_kernels import irradiance

    eye, corner, across, down = view
    x, y = np.meshgrid(np.arange(width // COARSE + 1) + 0.5, np.arange(height // COARSE + 1) + 0.5)
    rays: Array = corner + COARSE * (x[..., None] * across + y[..., None] * down)
    along = np.where(rays[..., 0] < -1e-6, (low - eye[0]) / np.minimum(rays[..., 0], -1e-6), 1e6)
    position = (eye + along[..., None] * rays).astype(np.float32)
    upward = np.zeros_like(position)
    upward[..., 0] = 1
    lit = np.zeros(along.shape, np.float32)
    irradiance(position, upward, np.zeros(along.shape, np.int32), *sky, 1, bias, lit)
    tall, wide = rays.shape[:2]
    blurred = Pillow.fromarray(gaussian_filter(lit, BLUR, mode="nearest"))
    large = blurred.resize((wide * COARSE, tall * COARSE), Pillow.Resampling.BICUBIC)
    field = np.clip(np.asarray(large), 0, 1)[:height, :width]
    columns, rows = (np.minimum(np.arange(n), np.arange(n)[::-1]) / (FADE * n) for n in (width, height))
    inside = np.minimum(np.minimum.outer(rows, columns), 1)
    return (1 - SHADOW * (1 - field) * inside**2 * (3 - 2 * inside)).astype(np.float32)


@lru_cache(maxsize=8)
def _sky(count: int) -> tuple[Array, Array]:
    """Frames (L, 3, 3) of lights spread over the upper hemisphere, brightest around the key, and their weights (L,)."""
    index = np.arange(count) + 0.5
    rise = 0.08 + 0.9 * index / count
    angle = np.pi * (1 + 5**0.5) * index
    flat = np.sqrt(1 - rise**2)
    towards = np.stack([rise, flat * np.cos(angle), flat * np.sin(angle)], 1)
    # Neighbouring shares of the lights must each cover the whole sky.
    towards = towards[np.random.default_rng(0).permutation(count)]
    across = np.cross(towards, [0.3, 0.9, 0.1])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frames = np.stack([across, np.cross(towards, across), towards], 1)
    weights = 0.55 + 2.6 * np.exp(5 * (towards @ (KEY / np.linalg.norm(KEY)) - 1))
    return np.ascontiguousarray(frames), weights / (weights * towards[:, 0]).sum()
