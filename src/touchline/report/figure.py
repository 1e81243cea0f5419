# SPDX-License-Identifier: Apache-2.0
"""A picture as part of a page: the image, and the words on it as text."""

import base64
from dataclasses import dataclass, replace
from html import escape
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Floats
from touchline.report.picture import COLOURS, Scene
from touchline.report.render.camera import Camera, Size

APART = 13.0  # pixels between an arrow's tail and its label
LINE = 19.0  # pixels between lines of text
LETTER = 8.6  # pixels, roughly
STACKED = 6  # lines that a label may go away from its arrow, for others
QUALITY = 78  # of 100
EFFORT = 2  # of 6; 4 takes twice as long and saves 8 % of the bytes


@dataclass(frozen=True)
class Label:
    """A text in a picture.

    Attributes:
        text: of one line.
        place: (x, y) [pixels] of the middle of its left end, middle or right end.
        anchor: which of them: "start", "middle" or "end".
        colour: `#rrggbb`.
    """

    text: str
    place: tuple[float, float]
    anchor: str
    colour: str

    @property
    def left(self) -> float:
        """Where it begins [pixels], roughly."""
        width = LETTER * len(self.text)
        return self.place[0] - {"start": 0.0, "middle": 0.5, "end": 1.0}[self.anchor] * width

    def meets(self, other: "Label") -> bool:
        """Whether the two texts overlap."""
        width, wide = LETTER * len(self.text), LETTER * len(other.text)
        beside = self.left > other.left + wide or other.left > self.left + width
        return not beside and abs(self.place[1] - other.place[1]) < LINE

    def lies_on(self, tail: Floats, tip: Floats) -> bool:
        """Whether an arrow from `tail` to `tip` (2,) [pixels] passes below the text."""
        x, y = (tail + np.linspace(0.0, 1.0, 60)[:, None] * (tip - tail)).T
        width = LETTER * len(self.text)
        beside = (x < self.left) | (x > self.left + width)
        return bool(np.any(~beside & (np.abs(y - self.place[1]) < LINE / 2)))

    def moved(self, down: float) -> "Label":
        """The label so many pixels further down."""
        return replace(self, place=(self.place[0], self.place[1] + down))


def labels(scene: Scene, camera: Camera, size: Size = (640, 640)) -> list[Label]:
    """The labels of a scene's contacts, beside the tails of their arrows, none over another one.

    Nor does one lie on an arrow, where there is another place.

    Args:
        scene: with its contacts.
        camera: that takes the picture.
        size: of the picture [pixels].
    """
    placed: list[Label] = []
    arrows = [camera.project(np.array(scene.arrow(mark)), size)[0] for mark in scene.marks]
    for mark, (tail, tip) in zip(scene.marks, arrows, strict=True):
        if not mark.label:
            continue
        label = _beside(tail, tail - tip, mark.label, COLOURS[mark.kind], size)
        out = 1 if label.place[1] >= tail[1] else -1
        steps = sorted(range(-STACKED, STACKED + 1), key=lambda i: (abs(i), -i * out))
        free = [
            moved
            for moved in (label.moved(step * LINE) for step in steps)
            if 0.5 * LINE <= moved.place[1] <= size[1] - 0.5 * LINE
            and not any(moved.meets(other) for other in placed)
        ]
        clear = [moved for moved in free if not any(moved.lies_on(*arrow) for arrow in arrows)]
        placed.append((clear or free or [label])[0])
    return placed


def _beside(tail: Floats, out: Floats, text: str, colour: str, size: Size) -> Label:
    """A label beyond an arrow's tail, inside the picture."""
    length = float(np.linalg.norm(out))
    out = out / length if length > 4 else np.array([0.9, -0.44])
    x, y = tail + APART * out
    anchor = "start" if out[0] > 0.35 else "end" if out[0] < -0.35 else "middle"
    width = LETTER * len(text)
    before = {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor] * width
    x = float(np.clip(x, 4 + before, max(size[0] - 4 - width + before, 4 + before)))
    return Label(text, (x, float(np.clip(y, LINE / 2, size[1] - LINE / 2))), anchor, colour)


def svg_picture(scene: Scene, camera: Camera, size: Size = (640, 640), title: str = "") -> str:
    """The picture as an SVG element: the image inside it, the labels as text that stays sharp.

    How the text looks is said in the page's style, for the class `mark`.

    Args:
        scene: what it shows.
        camera: from where.
        size: of the image [pixels]; the element takes the width of what it stands in.
        title: what it shows, in words.
    """
    data = base64.b64encode(webp_bytes(scene.render(camera, size))).decode("ascii")
    width, height = size
    words = "".join(_text(label) for label in labels(scene, camera, size))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{escape(title)}"><title>{escape(title)}</title>'
        f'<image width="{width}" height="{height}" href="data:image/webp;base64,{data}"/>'
        f"{words}</svg>"
    )


def webp_bytes(image: NDArray[np.uint8]) -> bytes:
    """An image (H, W, 3) in sRGB as a WebP file, a tenth of the size of a PNG."""
    from PIL import Image

    file = BytesIO()
    Image.fromarray(image).save(file, "WEBP", quality=QUALITY, method=EFFORT)
    return file.getvalue()


def _text(label: Label) -> str:
    x, y = label.place
    return (
        f'<text class="mark" x="{x:.1f}" y="{y + 5:.1f}" text-anchor="{label.anchor}" '
        f'color="{label.colour}">{escape(label.text)}</text>'
    )
