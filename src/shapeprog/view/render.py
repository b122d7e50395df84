"""A small renderer: one camera, soft light from the sky with true shadows, thin lines along edges, all on the CPU.

Every light of the sky sees the scene once (a depth map); a surface is as bright as the lights that reach it.  Each
pixel is the mean over a square of samples, and each sample uses another share of the lights, so shadows are smooth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

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

_AT_ONCE = 1 << 18  # points projected at once: meshes may have millions


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


def camera_for(
    models: Sequence[Model], aspect: float = 1.0, direction: tuple[float, float, float] = DIRECTION
) -> Camera:
    """The camera that shows all models as large as they fit into a picture of width / height ``aspect``."""
    clouds = [model.vertices for model in models if len(model.vertices)] or [np.zeros((1, 3))]
    low, high = np.min([cloud.min(0) for cloud in clouds], 0), np.max([cloud.max(0) for cloud in clouds], 0)
    centre, span = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1.0)
    back = np.array(direction) / np.linalg.norm(direction)
    right = np.cross(-back, [1.0, 0, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, -back)
    eye = centre + DISTANCE * span * back
    first, last, farthest = np.full(2, np.inf), np.full(2, -np.inf), 0.0
    for cloud in clouds:
        for start in range(0, len(cloud), _AT_ONCE):
            points = cloud[start : start + _AT_ONCE]
            offset = points - eye
            slopes = offset @ np.stack([right, up], 1) / (offset @ -back)[:, None]
            first, last = np.minimum(first, slopes.min(0)), np.maximum(last, slopes.max(0))
            farthest = max(farthest, float(np.linalg.norm(points, axis=1).max()))
    extent = np.maximum(last - first, 1e-6)
    focal = (1 - 2 * MARGIN) * min(1 / extent[0], 1 / (aspect * extent[1]))
    radius = farthest * 1.02 + 0.5
    return Camera(eye, right, up, -back, float(focal), (first + last) / 2, float(low[0]), radius)


def render(model: Model, camera: Camera, width: int, height: int, samples: int = SAMPLES) -> Image:
    """A picture (height, width, 3) of a model on white ground with its soft shadow.

    Parameters
    ----------
    model
        What to draw, in the grid frame.
    camera
        Use the same one for pictures to be compared.
    width, height
        In pixels.
    samples
        Samples along each side of a pixel.
    """
    from shapeprog.view import raster_kernels as kernels

    wide, tall = width * samples, height * samples
    vertices = np.ascontiguousarray(model.vertices, np.float64)
    faces = np.ascontiguousarray(model.faces, np.int64)
    shown = np.ascontiguousarray(model.normals, np.float64)
    points = camera.project(vertices, wide, tall)
    face, depth = np.full((tall, wide), kernels.BACKGROUND, np.int32), np.zeros((tall, wide))
    kernels.nearest_faces(points, faces, 1e-6, face, depth)
    scale = camera.focal * wide
    across, down = camera.right / scale, -camera.up / scale
    corner = camera.ahead + camera.right * camera.middle[0] + camera.up * camera.middle[1]
    corner = corner - across * wide / 2 - down * tall / 2
    solid = (points, faces, shown)
    position, normal = _surface(face, depth, solid, np.stack([camera.eye, corner, across, down]), camera.low, False)
    large = int(width >= LARGE)
    lights = samples**2 * max(1, min(LIGHTS[large], WORK // max(len(faces), 1)) // samples**2)
    frames, weights = _sky(lights)
    maps = np.full((lights, MAP_SIZE[large], MAP_SIZE[large]), -1e9, np.float32)
    kernels.light_maps(vertices, faces, frames, camera.radius, np.empty_like(vertices), maps)
    bias = 2.2 * camera.radius / MAP_SIZE[large]
    sky = (maps, frames, weights, camera.radius)
    lit = np.zeros((tall, wide), np.float32)
    kernels.irradiance(position, normal, face, *sky, samples, bias, lit)
    # The ground is smooth: few places, all lights at each.
    few = np.full((height // COARSE + 1, width // COARSE + 1), kernels.BACKGROUND, np.int32)
    step = COARSE * samples
    coarse = np.stack([camera.eye, corner, across * step, down * step])
    ground_position, upward = _surface(few, few.astype(np.float64), solid, coarse, camera.low, True)
    sunlit = np.zeros(few.shape, np.float32)
    kernels.irradiance(ground_position, upward, -few, *sky, 1, bias, sunlit)
    ground = (1 - SHADOW * (1 - _enlarged(sunlit, height, width))).astype(np.float32)
    lines = np.zeros((tall, wide), np.uint8)
    groups = np.asarray(model.group, np.int64)
    kernels.edges(face, groups, position, normal, max(1, samples // 2), 0.3, lines)
    colours = (np.ascontiguousarray(model.colours, np.float32).reshape(-1, 3) / 255) ** GAMMA
    total = np.zeros((height, width, 3), np.float32)
    kernels.develop(face, colours, lit, lines, INKS, AMBIENT, ground, samples, total)
    linear = total / np.float64(samples * samples)
    return (np.clip(linear, 0, 1) ** (1 / GAMMA) * 255 + 0.5).astype(np.uint8)


def _surface(face: Array, depth: Array, solid: Sequence[Array], view: Array, low: float, ground: bool) -> list[Array]:
    """Position and normal (H, W, 3) of every pixel; without a face, and if ``ground``, those of the ground."""
    from shapeprog.view.raster_kernels import surface

    position, normal = (np.empty((*face.shape, 3), np.float32) for _ in range(2))
    surface(face, depth, *solid, view, low, ground, position, normal)
    return [position, normal]


def _enlarged(coarse: Array, height: int, width: int) -> Array:
    """A brightness known for coarse squares at every pixel, smooth and fading to white at the border."""
    from PIL import Image as Pillow

    tall, wide = coarse.shape
    large = Pillow.fromarray(_blurred(_blurred(coarse).T).T).resize(
        (wide * COARSE, tall * COARSE), Pillow.Resampling.BICUBIC
    )
    field = np.clip(np.asarray(large), 0, 1)[:height, :width]
    across, down = (np.minimum(np.arange(n), np.arange(n)[::-1]) / (FADE * n) for n in (width, height))
    inside = np.minimum(np.minimum.outer(down, across), 1)
    return (1 - (1 - field) * inside**2 * (3 - 2 * inside)).astype(np.float32)


def _blurred(image: Array) -> Array:
    """A Gaussian filter down the columns of an image, whose border is repeated outside."""
    offset = np.arange(-int(4 * BLUR + 0.5), int(4 * BLUR + 0.5) + 1)
    weights = np.exp(-0.5 * (offset / BLUR) ** 2)
    rows = np.clip(np.arange(len(image)) + offset[:, None], 0, len(image) - 1)
    return np.tensordot(weights / weights.sum(), image[rows].astype(np.float64), 1).astype(np.float32)


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
