"""Files that stay well formed on the outside and are wrong within: JSON, GLB, NPY, ZIP, HDF5."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from random import Random
from typing import Any

import numpy as np

from .mutations import BYTES, TEXT, flip_bits

ODD: tuple[Any, ...] = (
    None, True, 0, 1, -1, 3, 2**31, 2**64, 10**310, 0.5, 1e300, -1e19, float("nan"), float("inf"),
    "", "x", "leg", "\ud800", "\x1b[2J", "4", "../../secret", "data:,", "data:application/octet-stream;base64,!!",
    [], [0], [[]], [-1, 10**9], {}, {"x": 0},
)  # fmt: skip
"""What is put in the place of a JSON value."""

DTYPES = ("|b1", "|u1", "<i8", ">f4", "<f2", "<f8", "<c8", "<U4", "|S3", "|O", "<M8[s]", "|V8", "f4,i4", "<f999", "")
SHAPES = (
    (),
    (0,),
    (3,),
    (0, 3),
    (5, 3),
    (1, 1, 1),
    (-1, 3),
    (8, 8, 8),
    (2**40, 3),
    (1 << 21, 1 << 21, 1 << 21),
    (1,) * 40,
)
_JSON, _BINARY = 0x4E4F534A, 0x004E4942


def change_json(random: Random, content: bytes) -> bytes:
    """A value of a JSON text is of another type, missing, doubled or deep within brackets."""
    try:
        whole = json.loads(content)
    except (ValueError, RecursionError):  # broken before, by another way
        return random.choice(TEXT)(random, content)
    places = list(_places(whole))
    if not places:
        return json.dumps(random.choice(ODD)).encode()
    for _ in range(random.choice((1, 1, 2))):
        holder, key = random.choice(places)
        if key not in (holder if isinstance(holder, dict) else range(len(holder))):
            continue
        how = random.randrange(8)
        if how == 0:
            del holder[key]
        elif how == 1 and isinstance(holder, list):
            holder[key:key] = [holder[key]] * random.choice((1, 300))
        elif how == 2 and isinstance(holder, dict):
            holder[random.choice(("extra", "name", "\u0000", ""))] = holder[key]
        elif how == 3:
            holder[key] = [holder[key]]
        elif how == 4:
            other, name = random.choice(places)
            if name in (other if isinstance(other, dict) else range(len(other))):
                holder[key] = json.loads(json.dumps(other[name]))
        else:
            holder[key] = random.choice(ODD)
    if random.random() < 0.03:
        return b'{"program": ' + b"[" * 20000 + b"]" * 20000 + b"}"
    return json.dumps(whole).encode()


def change_glb(random: Random, content: bytes) -> bytes:
    """The JSON or the buffer of a GLB, with the lengths put right again."""
    size = struct.unpack_from("<I", content, 12)[0] if len(content) >= 20 else 0
    text, buffer = content[20 : 20 + size], content[28 + size :]
    if random.random() < 0.75:
        text = change_json(random, text)
    else:
        buffer = random.choice(BYTES)(random, buffer)
    text, buffer = text + b" " * (-len(text) % 4), buffer + b"\0" * (-len(buffer) % 4)
    chunks = [(text, _JSON), (buffer, _BINARY)]
    if random.random() < 0.1:
        chunks = random.choice((chunks[::-1], chunks[:1], chunks + chunks, chunks[1:], []))
    body = b"".join(struct.pack("<II", len(chunk), kind) + chunk for chunk, kind in chunks)
    return struct.pack("<4sII", b"glTF", random.choice((2, 2, 2, 2, 1, 3)), 12 + len(body)) + body


def change_npy(random: Random, content: bytes) -> bytes:
    """An NPY with another type, shape or order announced, or another version, or with broken text for a head."""
    if len(content) < 10 or content[:6] != b"\x93NUMPY":
        return flip_bits(random, content)
    size = struct.unpack_from("<H", content, 8)[0]
    text, body = content[10 : 10 + size].decode("latin-1"), content[10 + size :]
    how = random.randrange(6)
    if how < 3:
        try:
            shape, order, dtype = np.lib.format.read_array_header_1_0(io.BytesIO(content[8:]))
        except Exception:  # broken before, by another way
            return flip_bits(random, content)
        head = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": order, "shape": shape}
        key = random.choice(("descr", "shape", "shape", "fortran_order"))
        head[key] = random.choice({"descr": DTYPES, "shape": SHAPES, "fortran_order": (True, 1, None)}[key])
        text = str(head)
    elif how == 3:
        text = random.choice(TEXT)(random, text.encode("latin-1")).decode("latin-1")
    elif how == 4:
        text = random.choice(
            ("", "{", "[]", "{}", "__import__('os')", "{'descr': 1 + 1}", "(" * 3000, "{'shape': (1,)}")
        )
    else:
        body = random.choice(BYTES)(random, body)
    head_bytes = text.encode("latin-1", "replace")[:60000] + b"\n"
    version = random.choice((b"\x01\0",) * 8 + (b"\x02\0", b"\x03\0", b"\x09\0"))
    length = struct.pack("<H" if version == b"\x01\0" else "<I", len(head_bytes))
    return b"\x93NUMPY" + version + length + head_bytes + body


def change_zip(random: Random, content: bytes) -> bytes:
    """An archive with a broken, missing, doubled, foreign, renamed, encrypted or wrongly announced member."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [(name, archive.read(name)) for name in archive.namelist()]
    except Exception:  # broken before, by another way
        return random.choice(BYTES)(random, content)
    at = random.randrange(len(members)) if members else 0
    how = random.randrange(9)
    if members and how < 4:
        members[at] = members[at][0], change_npy(random, members[at][1])
    elif members and how == 4:
        members[at] = members[at][0], random.choice(BYTES)(random, members[at][1])
    elif members and how == 5:
        del members[at]
    elif members and how == 6:
        members[at] = (
            random.choice(("voxels", "points.npy", "../out.npy", "ids.npy", "x", "\u00fc.npy")),
            members[at][1],
        )
    elif how == 7:
        foreign = (b"", b"text", b"\x80\x04}.", bytes(1 << 20))
        members.insert(at, (random.choice(("a.npy", "notes.txt", "split.npy", "dir/")), random.choice(foreign)))
    method = random.choice(
        (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
    )
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w", method) as archive:
        for name, part in dict(members).items():
            archive.writestr(zipfile.ZipInfo(name), part, method)
    return _announce(random, written.getvalue()) if how == 8 else written.getvalue()


def _announce(random: Random, content: bytes) -> bytes:
    """Other flags, method, checksum or sizes in the central directory or in the heads of the members."""
    mark, first = random.choice(((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)))
    starts = [at for at in range(len(content) - 30) if content.startswith(mark, at)]
    changed = bytearray(content)
    width, offset = random.choice(((2, 0), (2, 2), (4, 8), (4, 12), (4, 16)))
    value = random.choice((1, 0, 8, 99, 2**16 - 1, 2**31, 2**32 - 1)) % 256**width
    for start in starts if random.random() < 0.5 else starts[:1]:
        changed[start + first + offset : start + first + offset + width] = value.to_bytes(width, "little")
    return bytes(changed)


def change_hdf5(random: Random, content: bytes) -> bytes:
    """An HDF5 whose ``data`` is of another type, shape, place or kind, or leads elsewhere."""
    import h5py

    if random.random() < 0.4:
        return random.choice(BYTES)(random, content)
    written = io.BytesIO()
    with h5py.File(written, "w") as file:
        how = random.randrange(10)
        shape = random.choice(
            ((2, 8, 8, 8), (8, 8, 8), (0, 8, 8, 8), (2, 8, 8, 4), (3,), (), (10**12, 32, 32, 32), (2**18,) * 3)
        )
        if how < 4:
            kinds = ("u1", "f8", "?", "c8", "S3", "V4", "i8", h5py.string_dtype(), h5py.vlen_dtype("i4"), [("a", "f4")])
            file.create_dataset(
                "data", shape, random.choice(kinds), chunks=(1,) * len(shape) if 10**12 in shape else None
            )
        elif how == 4:
            file["data"] = h5py.Empty("f4")
        elif how == 5:
            file["data"] = random.choice(
                (h5py.SoftLink("/data"), h5py.SoftLink("/no"), h5py.ExternalLink("secret.h5", "/data"))
            )
        elif how == 6:
            file.create_group(random.choice(("data", "data/data", "other", b"\xff\xfe")))
        elif how == 7:
            file.create_dataset("data", (2, 8, 8, 8), "u1", external=[("secret.raw", 0, h5py.h5f.UNLIMITED)])
        elif how == 8:
            layout = h5py.VirtualLayout((2, 8, 8, 8), "u1")
            layout[:] = h5py.VirtualSource("secret.h5", "data", (2, 8, 8, 8))
            file.create_virtual_dataset("data", layout)
        else:
            values = np.full((1, 8, 8, 8), random.choice((0.3, np.nan, np.inf, 255, -1)))
            file.create_dataset("data", data=values, chunks=True, compression=random.choice(("gzip", "lzf", None)))
    return written.getvalue()


def change_head(random: Random, content: bytes) -> bytes:
    """The text before the numbers of a PLY or binvox, with those kept as they are."""
    mark = b"end_header" if b"end_header" in content else b"data\n"
    head, found, body = content.partition(mark)
    return random.choice(TEXT)(random, head) + found + body


def _places(value: Any) -> Any:
    """Every (holder, key) within a JSON value; numbers in long lists count as one."""
    if isinstance(value, dict):
        pairs = list(value.items())
    elif isinstance(value, list):
        pairs = list(enumerate(value[:8]))
    else:
        return
    for key, inner in pairs:
        yield value, key
        yield from _places(inner)
