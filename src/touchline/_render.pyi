"""
The native renderer of the report: no OpenGL, no window, no display needed.
"""

from collections.abc import Sequence
from typing import Any

import numpy
import numpy.typing


class Posed:
    """The pieces of a skin where they stand."""

    @property
    def box(self, /) -> tuple[numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]:
        """Least and largest coordinates (1, 3) [m] in world."""

    def sees(self, point: numpy.typing.NDArray[Any], directions: numpy.typing.NDArray[Any], off: float) -> list[bool]:
        """
        Whether rays from `off` [m] before a point (3,) along unit directions (D, 3) meet nothing.
        """

class Skin:
    """Pieces (corners (T, 3, 3) [m], unit normals (T, 3, 3), closed)."""

    def __init__(self, pieces: Sequence[tuple[numpy.typing.NDArray[Any], numpy.typing.NDArray[Any], bool]]) -> None: ...

    def posed(self, poses: numpy.typing.NDArray[Any]) -> Posed:
        """The pieces at poses (P, 4, 4) in world."""

class Canvas:
    """What a camera sees of posed pieces, four samples a pixel."""

    def __init__(self, posed: Posed, eye: numpy.typing.NDArray[Any], axes: numpy.typing.NDArray[Any], focal: float, size: tuple[int, int]) -> None: ...

    @property
    def part(self, /) -> numpy.typing.NDArray[numpy.int64]:
        """Number (N,) of the piece that each sample shows."""

    @property
    def position(self, /) -> numpy.typing.NDArray[numpy.float64]:
        """Points (N, 3) [m] in world that the samples show."""

    def image(self, albedo: numpy.typing.NDArray[Any], map: int, sky: numpy.typing.NDArray[Any], floor: numpy.typing.NDArray[Any] | None, layers: Sequence[tuple[numpy.typing.NDArray[Any], numpy.typing.NDArray[Any], numpy.typing.NDArray[Any], float]]) -> numpy.typing.NDArray[numpy.uint8]:
        """
        The picture (H, W, 3) in sRGB, once. Albedo by piece (P, 3); without a floor by sample (N, 3), on paper of the sky's colour. The shadow map is `map` pixels wide. Layers (corners, normals, linear colour, opacity) go over it, fainter where hidden.
        """

def rasterize(corners: numpy.typing.NDArray[Any], nearness: numpy.typing.NDArray[Any], size: tuple[int, int]) -> tuple[numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.int64], numpy.typing.NDArray[numpy.float64]]:
    """
    Pixels (N,) that show a triangle, which one, and how near it is there; corners (T, 3, 2) in pixels, nearness (T, 3) linear in the image.
    """
