"""3MF: one named, coloured object per part, for 3D printing."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

from shapeprog.files import write_bytes
from shapeprog.formats.colours import hexadecimal
from shapeprog.formats.parts import drawn_parts
from shapeprog.language.program import Program
from shapeprog.space import Frame

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


def write_3mf(program: Program, path: Path, frame: Frame, unit: str = "") -> None:
    """Write one object per part, as the 3MF core specification 1.3 describes them; an unknown unit counts as mm."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as package:
        for name, text in (
            ("[Content_Types].xml", _TYPES),
            ("_rels/.rels", _RELATIONS),
            ("3D/3dmodel.model", "".join(_model(program, frame, _UNITS.get(unit, "millimeter")))),
        ):
            package.writestr(zipfile.ZipInfo(name), text, zipfile.ZIP_DEFLATED)
    write_bytes(path, content.getvalue())


def _model(program: Program, frame: Frame, unit: str) -> Iterator[str]:
    solids = drawn_parts(program, frame)
    words = list(dict.fromkeys(part.word for part in solids))
    statements = {part.word: part.statement for part in solids}
    yield f'{_HEAD}<model unit="{unit}" xml:lang="en-US" xmlns="{_CORE}"><resources><basematerials id="1">'
    for word in words:
        yield f'<base name={quoteattr(word)} displaycolor="{hexadecimal(statements[word]).upper()}"/>'
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
