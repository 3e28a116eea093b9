"""NIfTI-1 images in one file, as recordings and results hold them: arrays of voxels with an affine in mm."""

from __future__ import annotations

import gzip
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict

import numpy as np
import numpy.typing as npt

from ._errors import InputError

_HEADER_BYTES = 348
_INTENT_DISPLACEMENT = 1006
_UNITS_MM = 2
_TYPES: Dict[int, str] = {2: "u1", 4: "i2", 8: "i4", 16: "f4", 64: "f8", 512: "u2"}


@dataclass(frozen=True)
class Image:
    """Values of shape (nx, ny, nz) or (nx, ny, nz, 3), and the affine that leads from indices to mm."""

    values: npt.NDArray[Any]
    affine: npt.NDArray[np.float64]


def read_image(path: Path) -> Image:
    """Reads an image, plain or compressed.

    Raises:
        InputError: what stands in the way.
    """
    try:
        data = path.read_bytes()
        if data[:2] == b"\x1f\x8b":
            data = gzip.decompress(data)
        return _decoded(data)
    except (OSError, EOFError, struct.error, ValueError) as error:
        raise InputError((f"cannot read {path}: {error}",)) from None


def _decoded(data: bytes) -> Image:
    order = next((o for o in "<>" if struct.unpack_from(f"{o}i", data)[0] == _HEADER_BYTES), None)
    if order is None or data[344:348] != b"n+1\0":
        raise ValueError("it is not a NIfTI-1 image in one file")
    dims = struct.unpack_from(f"{order}8h", data, 40)
    code, offset = struct.unpack_from(f"{order}h", data, 70)[0], struct.unpack_from(f"{order}f", data, 108)[0]
    if code not in _TYPES:
        known = "float32, float64, int16, int32, uint8 and uint16"
        raise ValueError(f"its data type is {code}; {known} are read")
    if not 1 <= dims[0] <= 5 or min(dims[1 : dims[0] + 1]) < 1:
        raise ValueError(f"its dimensions {dims} are not those of an image")
    shape = dims[1 : dims[0] + 1] + (1,) * (5 - dims[0])
    count = int(np.prod(shape, dtype=np.int64))
    values = np.frombuffer(data, dtype=np.dtype(order + _TYPES[code]), count=count, offset=int(offset))
    values = values.reshape(shape, order="F")
    slope, intercept = struct.unpack_from(f"{order}2f", data, 112)
    if np.isfinite(slope) and slope != 0.0 and (slope, intercept) != (1.0, 0.0):
        values = slope * values + (intercept if np.isfinite(intercept) else 0.0)
    return Image(values[:, :, :, 0, 0] if shape[4] == 1 else values[:, :, :, 0, :], _affine(data, order))


def _affine(data: bytes, order: str) -> npt.NDArray[np.float64]:
    qform, sform = struct.unpack_from(f"{order}2h", data, 252)
    affine = np.eye(4)
    if sform > 0:
        affine[:3] = np.reshape(struct.unpack_from(f"{order}12f", data, 280), (3, 4))
        return affine
    if qform <= 0:
        raise ValueError("neither sform nor qform says where its voxels lie")
    b, c, d, *place = struct.unpack_from(f"{order}6f", data, 256)
    a = np.sqrt(max(0.0, 1.0 - b * b - c * c - d * d))
    turn = np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c],
        ]
    )
    sign, *edges = struct.unpack_from(f"{order}4f", data, 76)
    edges[2] *= -1.0 if sign < 0.0 else 1.0
    affine[:3, :3], affine[:3, 3] = turn * np.array(edges), place
    return affine


def write_image(path: Path, values: npt.NDArray[Any], affine: npt.NDArray[np.float64]) -> None:
    """Writes a mask (nx, ny, nz) as bytes, or displacements (nx, ny, nz, 3) in mm as 32-bit numbers."""
    is_vector = values.ndim == 4
    shape = values.shape[:3] + ((1, 3) if is_vector else (1, 1))
    if max(shape) > np.iinfo(np.int16).max:
        raise InputError((f"the array has {max(shape)} voxels along an axis; NIfTI-1 holds 32767 at most; crop it",))
    header = bytearray(_HEADER_BYTES + 4)
    code, bits, kind = (16, 32, "<f4") if is_vector else (2, 8, "u1")
    edges = np.sqrt((affine[:3, :3] ** 2).sum(axis=0))
    for at, form, fields in (
        (0, "i", (_HEADER_BYTES,)),
        (40, "8h", (5 if is_vector else 3, *shape, 1, 1)),
        (68, "h", (_INTENT_DISPLACEMENT if is_vector else 0,)),
        (70, "2h", (code, bits)),
        (76, "8f", (1, *edges, 1, 1, 0, 0)),
        (108, "2f", (_HEADER_BYTES + 4, 1)),
        (123, "B", (_UNITS_MM,)),
        (254, "h", (1,)),
        (280, "12f", tuple(affine[:3].ravel())),
        (344, "4s", (b"n+1\0",)),
    ):
        struct.pack_into(f"<{form}", header, at, *fields)
    body = np.asarray(values, dtype=kind).tobytes(order="F")
    # Without a time in the header equal arrays give equal files.
    path.write_bytes(gzip.compress(bytes(header) + body, compresslevel=6, mtime=0))
