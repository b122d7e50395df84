"""Arrays, packs and voxel files that cannot be read as shapes; part of :mod:`bad_files`."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from bad_meshes import BAD, add

CELLS = np.zeros((32, 32, 32), np.bool_)
CELLS[4:28, 10:20, 8:24] = True


def npy(array: np.ndarray, pickled: bool = False) -> bytes:
    content = io.BytesIO()
    np.save(content, array, allow_pickle=pickled)
    return content.getvalue()


def npy_that_announces(shape: str, kind: str = "|u1", data: bytes = b"") -> bytes:
    head = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}}}".encode()
    head += b" " * (-(len(head) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + data


def archive(members: dict[str, bytes], packed: int = zipfile.ZIP_DEFLATED) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", packed) as file:
        for name, each in members.items():
            file.writestr(f"{name}.npy", each)
    return content.getvalue()


def npz(**arrays: np.ndarray) -> bytes:
    return archive({name: npy(array) for name, array in arrays.items()})


def encrypted(content: bytes) -> bytes:
    """The archive with the flag of encryption set in both heads of its first member."""
    marked = bytearray(content)
    marked[6] |= 1
    marked[content.rindex(b"PK\x01\x02") + 8] |= 1
    return bytes(marked)


for _name, _content in {
    "npy_cut": npy(CELLS)[:-100],
    "npy_head_with_a_hole": npy(CELLS).replace(b"'descr'", b"'de\ncr'"),
    "npy_head_of_tokens": npy(CELLS).replace(b"{'descr'", b"((('''a"),
    "npy_announces_a_lot": npy_that_announces("(1000000, 1000000, 1000000)"),
    "npy_announces_less_than_nothing": npy_that_announces("(-3, 3)", "<f8", bytes(72)),
    "npy_of_objects": npy(np.array([{}], dtype=object), pickled=True),
    "npy_of_text": npy(np.array(["x", "y"])),
    "npy_of_complex_numbers": npy(np.zeros((4, 3), complex)),
    "npy_of_dates": npy(np.zeros((4, 3), "datetime64[s]")),
    "npy_of_records": npy(np.zeros(4, [("x", float)])),
    "npy_of_thirds": npy(np.full((8, 8, 8), 1 / 3)),
    "npy_of_odd_booleans": npy_that_announces("(2, 2, 2)", "|b1", bytes([7] * 8)),
    "npy_empty_grid": npy(np.zeros((8, 8, 8), np.bool_)),
    "npy_of_one_number": npy(np.float64(3)),
    "npy_of_nan": npy(np.full((4, 3), np.nan)),
    "npy_at_one_place": npy(np.ones((4, 3))),
    "npy_from_end_to_end": npy(np.array([[-1.7e308] * 3, [1.7e308] * 3])),
    "npy_smaller_than_any_shape": npy(np.array([[0.0] * 3, [1e-38] * 3])),
    "npy_far_from_the_origin": npy(np.array([[1e19] * 3, [1e19 + 4096] * 3])),
}.items():
    add(_name, "npy", _content)

_PACKED = np.packbits(CELLS)[None]
_PACK = {"ids": np.array(["a"]), "voxels": _PACKED}
for _name, _content in {
    "npz_cut": npz(voxels=CELLS)[:-30],
    "npz_damaged_inside": npz(voxels=CELLS).replace(npz(voxels=CELLS)[200:210], b"0123456789"),
    "npz_member_that_is_no_array": archive({"voxels": b"hello"}),
    "npz_encrypted": encrypted(npz(voxels=CELLS)),
    "npz_packed_in_an_unknown_way": npz(voxels=CELLS).replace(b"\x08\x00", b"\x63\x00"),
    "npz_of_objects": archive({"voxels": npy(np.array([{}], dtype=object), pickled=True)}),
    "npz_of_nothing": archive({}),
    "npz_of_two_arrays": npz(a=CELLS, b=CELLS),
    "npz_announces_a_lot": archive({"voxels": npy_that_announces("(1000000, 1000000, 1000000)")}),
    "pack_with_one_id_for_all": npz(**{**_PACK, "ids": np.array("a")}),
    "pack_with_numbers_for_ids": npz(**{**_PACK, "ids": np.array([1.5])}),
    "pack_with_odd_letters": archive(
        {"ids": npy_that_announces("(1,)", "<U1", b"\xff\xff\xff\x7f"), "voxels": npy(_PACKED)}
    ),
    "pack_with_fewer_ids": npz(**{**_PACK, "voxels": np.repeat(_PACKED, 2, 0)}),
    "pack_without_cells": npz(**{**_PACK, "voxels": np.zeros_like(_PACKED)}),
    "pack_without_points": npz(**_PACK, points=np.zeros((1, 0, 3), np.uint16)),
    "pack_with_points_of_floats": npz(**_PACK, points=np.zeros((1, 9, 3))),
    "pack_with_sides_in_words": npz(**_PACK, longest_side=np.array(["long"])),
    "pack_with_a_side_of_next_to_nothing": npz(**_PACK, longest_side=np.array([5e-324])),
    "pack_with_a_side_of_next_to_everything": npz(**_PACK, longest_side=np.array([1.7e308])),
    "pack_with_a_side_of_nan": npz(**_PACK, longest_side=np.array([np.nan])),
    "pack_with_numbers_for_splits": npz(**_PACK, split=np.array([1])),
    "pack_with_a_damaged_head": archive({"ids": npy(np.array(["a"])), "voxels": b"\x93NUMPY\x01\x00\xff\xff{"}),
}.items():
    add(_name, "npz", _content)


def binvox(size: int, body: bytes, head: str = "translate 0 0 0\nscale 1\n") -> bytes:
    return f"#binvox 1\ndim {size} {size} {size}\n{head}data\n".encode() + body


for _name, _content in {
    "binvox_cut": binvox(4, bytes([1, 63])),
    "binvox_too_long": binvox(4, bytes([1, 65])),
    "binvox_half_a_run": binvox(4, bytes([1, 64, 0])),
    "binvox_of_sevens": binvox(4, bytes([7, 64])),
    "binvox_empty_grid": binvox(4, bytes([0, 64])),
    "binvox_without_data": b"#binvox 1\ndim 4 4 4\n" * 1000,
    "binvox_too_fine": binvox(100_000, bytes([1, 64])),
    "binvox_of_no_size": binvox(4, bytes([1, 64]), "scale 1e-320\n"),
    "binvox_far_away": binvox(4, bytes([1, 64]), "translate 1e30 0 0\nscale 1\n"),
    "binvox_of_nan": binvox(4, bytes([1, 64]), "scale nan\n"),
}.items():
    add(_name, "binvox", _content)


def hdf5(name: str, fill: Callable[[object], None]) -> None:
    def build(folder: Path) -> Path:
        import h5py

        path = folder / f"{name}.h5"
        with h5py.File(path, "w") as file:
            fill(file)
        return path

    BAD[name] = build


def _elsewhere(file: object) -> Path:
    """A whole HDF5 file beside another, whose voxels that one may not show."""
    import h5py

    other = Path(file.filename).with_suffix(".hidden")
    with h5py.File(other, "w") as there:
        there["data"] = CELLS
    return other


def _fill_virtual(file: object) -> None:
    import h5py

    layout = h5py.VirtualLayout(CELLS.shape, bool)
    layout[:] = h5py.VirtualSource(_elsewhere(file), "data", CELLS.shape)
    file.create_virtual_dataset("data", layout)


def _fill_link(file: object) -> None:
    import h5py

    file["data"] = h5py.ExternalLink(str(_elsewhere(file)), "data")


def _fill_external(file: object) -> None:
    raw = Path(file.filename).with_suffix(".raw")
    raw.write_bytes(CELLS.tobytes())
    file.create_dataset("data", CELLS.shape, np.uint8, external=[(str(raw), 0, CELLS.size)])


def _fill_soft_link(file: object) -> None:
    import h5py

    file["real"] = CELLS
    file["data"] = h5py.SoftLink("/real")


def _fill_null(file: object) -> None:
    import h5py

    file["data"] = h5py.Empty("u1")


hdf5("hdf5_virtual", _fill_virtual)
hdf5("hdf5_link_to_another_file", _fill_link)
hdf5("hdf5_external_storage", _fill_external)
hdf5("hdf5_soft_link", _fill_soft_link)
hdf5("hdf5_null", _fill_null)
hdf5("hdf5_group", lambda file: file.create_group("data"))
hdf5("hdf5_byte_names", lambda file: file.id.links.create_soft(b"\xff\xfe", b"/nowhere"))
hdf5("hdf5_text", lambda file: file.create_dataset("data", data=[[["a"]]]))
hdf5("hdf5_announces_a_lot", lambda file: file.create_dataset("data", (10**12, 2, 2, 2), "u1", chunks=(1, 2, 2, 2)))
hdf5("hdf5_announces_more", lambda file: file.create_dataset("data", (9, 2, 2, 2), "u1", chunks=(1, 2, 2, 2)))
hdf5("hdf5_never_written", lambda file: file.create_dataset("data", (2, 4, 4, 4), "u1"))
hdf5("hdf5_of_sevens", lambda file: file.create_dataset("data", data=np.full((4, 4, 4), 7)))
