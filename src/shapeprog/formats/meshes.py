"""Mesh export: GLB, OBJ, PLY and 3MF of coloured parts, STL of their union."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from shapeprog.errors import OutputError
from shapeprog.formats.colours import colour, hexadecimal
from shapeprog.formats.parts import Faces, Part, Vertices, drawn_parts, part_normals, solid
from shapeprog.geometry.mesh import joined
from shapeprog.language.program import Program
from shapeprog.space import Frame

MOST_NODES = 1 << 14  # most named nodes of a GLB: each takes half a millisecond to write, and viewers list them all

_UNITS = {"mm": "millimeter", "cm": "centimeter", "m": "meter", "in": "inch"}
_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
_TYPES = (
    f'{_HEAD}<Types xmlns="{_PACKAGE}/content-types">'
    f'<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    f'<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
)
_RELATIONS = (
    f'{_HEAD}<Relationships xmlns="{_PACKAGE}/relationships"><Relationship Target="/3D/3dmodel.model" Id="model" '
    f'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)


def glb(program: Program, frame: Frame) -> bytes:
    """One named node per part (``leg_1``, ``leg_2``...) and one material per statement.

    The material is what a viewer shows; vertices are split along creases, so that boards look flat and bars round.

    Raises
    ------
    OutputError
        If there are no parts, or more than ``MOST_NODES``.
    """
    import trimesh
    from trimesh.visual.material import PBRMaterial

    make_material: Any = PBRMaterial
    make_visual: Any = trimesh.visual.TextureVisuals
    scene: Any = trimesh.Scene()
    materials: dict[str, Any] = {}
    solids = drawn_parts(program, frame)
    if len(solids) > MOST_NODES:
        message = f"the {len(solids)} parts of this program are too many named nodes: a GLB takes at most {MOST_NODES}"
        raise OutputError(message, "lower the counts, or export .ply, which has all parts in one mesh")
    for part, of_corners in zip(solids, part_normals(solids), strict=True):
        if part.word not in materials:
            materials[part.word] = make_material(
                name=part.word, baseColorFactor=[*colour(part.word), 255], metallicFactor=0.0, roughnessFactor=0.7
            )
        vertices, normals, faces = _split(part, of_corners)
        mesh = trimesh.Trimesh(vertices, faces, vertex_normals=normals, process=False)
        mesh.visual = make_visual(uv=np.zeros((len(vertices), 2)), material=materials[part.word])
        scene.add_geometry(mesh, node_name=part.name, geom_name=part.name)
    return scene.export(file_type="glb", include_normals=True)


def obj(program: Program, frame: Frame, stem: str) -> dict[str, str]:
    """One named object per part; its colours in an ``.mtl`` file of the same name beside it."""
    solids = drawn_parts(program, frame)
    lines, first = [f"mtllib {stem}.mtl"], 1
    for part in solids:
        lines += [f"o {part.name}", f"usemtl {part.word}"]
        lines += ["v {:.12g} {:.12g} {:.12g}".format(*vertex) for vertex in part.vertices.tolist()]
        lines += ["f {} {} {}".format(*face) for face in (part.faces + first).tolist()]
        first += len(part.vertices)
    materials = []
    for word in dict.fromkeys(part.word for part in solids):
        materials.append("newmtl {}\nKd {:.4f} {:.4f} {:.4f}\n".format(word, *(c / 255 for c in colour(word))))
    return {".mtl": "\n".join(materials), ".obj": "\n".join([*lines, ""])}


def ply(program: Program, frame: Frame) -> bytes:
    """All parts in one mesh with a colour at each vertex; parts overlap as they do in the program."""
    import trimesh

    solids = drawn_parts(program, frame)
    colours = [np.tile([*colour(part.word), 255], (len(part.vertices), 1)) for part in solids]
    vertices, faces = joined([(part.vertices, part.faces) for part in solids])
    mesh: Any = trimesh.Trimesh(vertices, faces, vertex_colors=np.concatenate(colours).astype(np.uint8), process=False)
    return mesh.export(file_type="ply")


def stl(program: Program, frame: Frame) -> bytes:
    """The union of all parts as one watertight solid, ready to print."""
    import trimesh

    vertices, faces = solid(program, frame)
    corners = vertices.astype(np.float32)[faces]
    kept = (corners != np.roll(corners, 1, 1)).any(2).all(1)  # STL has no vertices: corners that coincide are one
    mesh: Any = trimesh.Trimesh(vertices, faces[kept], process=False)
    return mesh.export(file_type="stl")


def three_mf(program: Program, frame: Frame, unit: str = "") -> bytes:
    """One object per part, as the 3MF core specification 1.3 describes them; an unknown unit counts as mm."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as package:
        for name, text in (
            ("[Content_Types].xml", _TYPES),
            ("_rels/.rels", _RELATIONS),
            ("3D/3dmodel.model", "".join(_model(program, frame, _UNITS.get(unit, "millimeter")))),
        ):
            package.writestr(zipfile.ZipInfo(name), text, zipfile.ZIP_DEFLATED)
    return content.getvalue()


def _model(program: Program, frame: Frame, unit: str) -> Iterator[str]:
    solids = drawn_parts(program, frame)
    words = list(dict.fromkeys(part.word for part in solids))
    yield f'{_HEAD}<model unit="{unit}" xml:lang="en-US" xmlns="{_CORE}"><resources><basematerials id="1">'
    for word in words:
        yield f'<base name={quoteattr(word)} displaycolor="{hexadecimal(word).upper()}"/>'
    yield "</basematerials>"
    for number, part in enumerate(solids, 2):
        pindex = words.index(part.word)
        yield f'<object id="{number}" type="model" name={quoteattr(part.name)} pid="1" pindex="{pindex}">'
        yield "<mesh><vertices>"
        yield from ('<vertex x="{:.9g}" y="{:.9g}" z="{:.9g}"/>'.format(*vertex) for vertex in part.vertices.tolist())
        yield "</vertices><triangles>"
        yield from ('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*face) for face in part.faces.tolist())
        yield "</triangles></mesh></object>"
    items = "".join(f'<item objectid="{number}"/>' for number in range(2, len(solids) + 2))
    yield f"</resources><build>{items}</build></model>"


def _split(part: Part, of_corners: Vertices) -> tuple[Vertices, Vertices, Faces]:
    """Vertices, normals and faces; corners share a vertex only if they share a normal."""
    normals = of_corners.reshape(-1, 3)
    corners = part.faces.reshape(-1)
    key = np.concatenate([corners[:, None], np.rint(normals * 1e4)], 1)
    _, first, index = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return part.vertices[corners[first]], normals[first], index.reshape(-1, 3)
