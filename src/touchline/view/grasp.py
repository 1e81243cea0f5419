# SPDX-License-Identifier: Apache-2.0
"""The visitor's mouse on the arm: a click pushes, a drag pulls."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
import viser

from touchline.arrays import Array


class Touching(Protocol):
    """What a visitor's mouse does to the arm; points and directions are (3,) in world [m]."""

    def press(self, origin: Array, direction: Array) -> None:
        """A click along a ray."""
        ...

    def pull_begins(self, visitor: int, link: str, point: Array, eye: Array) -> None:
        """A drag begins at a point of a link, seen from `eye`."""
        ...

    def pull_moves(self, visitor: int, way: Array) -> None:
        """The mouse is that way (3,) from where it took hold, in world."""
        ...

    def pull_ends(self, visitor: int) -> None:
        """The button is released."""
        ...


def let_touch(
    drawn: Mapping[str, Sequence[viser.MeshHandle]],
    touching: Touching,
    post: Callable[[Callable[[], None]], None],
) -> None:
    """Connects the mouse.

    Args:
        drawn: what can be clicked and dragged, by link or widget.
        touching: what then happens.
        post: takes calls to be made between two steps of the simulation.
    """
    for link, meshes in drawn.items():
        for mesh in meshes:
            _connect(mesh, link, touching, post)


def _connect(mesh: viser.MeshHandle, link: str, touching: Touching, post) -> None:
    # Coroutines, since viser runs plain functions in threads, where their order is lost.
    @mesh.on_click
    async def _(event) -> None:
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        post(lambda: touching.press(origin, direction))

    @mesh.on_drag
    async def _(event) -> None:
        visitor, point = int(event.client_id), np.array(event.start_position)
        way, eye = np.array(event.end_position) - point, np.array(event.client.camera.position)
        if event.phase == "start":
            post(lambda: touching.pull_begins(visitor, link, point, eye))
        elif event.phase == "update":
            post(lambda: touching.pull_moves(visitor, way))
        else:
            post(lambda: touching.pull_ends(visitor))
