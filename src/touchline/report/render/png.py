# SPDX-License-Identifier: Apache-2.0
"""PNG files (ISO/IEC 15948), with nothing but zlib."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

SIGNATURE = b"\x89PNG\r\n\x1a\n"


def png_bytes(image: Image) -> bytes:
    """Return an image (H, W, 3) of 8-bit sRGB as a PNG file.

    Each row takes the filter whose result is smallest in sum, as the standard recommends.

    Raises:
        ValueError: the image has another shape or type.
    """
    if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise ValueError(f"image {image.shape} of {image.dtype}; must be (H, W, 3) of uint8")
    height, width, _ = image.shape
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(_filtered(image).tobytes(), 9)
    return SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", data) + _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    check = struct.pack(">I", zlib.crc32(kind + data))
    return struct.pack(">I", len(data)) + kind + data + check


def _filtered(image: Image) -> Image:
    """Return rows (H, 1 + 3 W): the filter's number, then the row under that filter."""
    height = image.shape[0]
    here = image.astype(np.int16)
    padded = np.pad(here, ((1, 0), (1, 0), (0, 0)))
    left, up, corner = padded[1:, :-1], padded[:-1, 1:], padded[:-1, :-1]
    guesses = [np.zeros_like(here), left, up, (left + up) // 2, _paeth(left, up, corner)]
    rows = np.stack([(here - guess).astype(np.uint8).reshape(height, -1) for guess in guesses])
    cost = np.abs(rows.view(np.int8).astype(np.int16)).sum(axis=2)
    best = cost.argmin(axis=0)
    chosen = rows[best, np.arange(height)]
    return np.hstack([best.astype(np.uint8)[:, None], chosen])


def _paeth(left: NDArray, up: NDArray, corner: NDArray) -> NDArray:
    """Return the neighbour nearest to left + up - corner, ties in this order."""
    to_left, to_up = np.abs(up - corner), np.abs(left - corner)
    to_corner = np.abs(left + up - 2 * corner)
    is_left = (to_left <= to_up) & (to_left <= to_corner)
    return np.where(is_left, left, np.where(to_up <= to_corner, up, corner))
