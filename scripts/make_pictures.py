# SPDX-License-Identifier: Apache-2.0
"""Makes the pictures of the README: `sara` simulated, touched at three places at once, and located.

Run `python scripts/make_pictures.py` from the repository; it needs matplotlib for the words. The
arrows are what the estimator found in a simulated, noisy recording; the truth lies behind them.
"""

import argparse
from io import BytesIO
from pathlib import Path

import numpy as np

import touchline as tl
from touchline.report.figure import Label, labels
from touchline.report.picture import COLOURS, Scene, png_bytes
from touchline.report.render.camera import Camera
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import scripted
from touchline.simulation.scene import Run

TARGET = Path(__file__).resolve().parents[1] / "docs" / "images"
SIZE = (1200, 800)
POSE = np.array([0.35, 0.62, -0.25, 1.15, 0.35, 0.75, 0.0])
# link, direction of the force in world, size [N], where along the link's height it acts (0 to 1)
TOUCHES = [
    ("link3", (0.25, 0.9, -0.25), 30.0, 0.42),
    ("handle", (-0.9, -0.3, -0.45), 20.0, 0.9),
    ("tool", (-0.75, 0.55, 0.2), 12.0, 0.6),
]


def touch(robot: tl.Robot, link: str, direction, size: float, height: float) -> ScriptedContact:
    """A force that comes along `direction` and ends on the near side of a link."""
    T = robot.T_world_links(POSE)[link]
    scene = Scene(robot, POSE)
    own = np.array([p.link == link and not p.trim for p in scene.pieces])[scene.surface.part]
    middles = scene.surface.corners[own].mean(axis=1)
    along = np.asarray(direction, float) / np.linalg.norm(direction)
    local = (middles - T[:3, 3]) @ T[:3, :3]
    at = local[:, 2].min() + height * np.ptp(local[:, 2])
    axis = np.median(middles[np.abs(local[:, 2] - at) < 0.02], axis=0)
    aside = np.linalg.norm(np.cross(middles - axis, along), axis=1)
    near = np.flatnonzero(aside < aside.min() + 0.004)
    point = middles[near[(middles[near] @ along).argmin()]]
    local_point = T[:3, :3].T @ (point - T[:3, 3])
    return ScriptedContact(link, local_point, size * along, Profile(0.2, hold=0.6))


def touched_scene() -> Scene:
    """The arm with what was found and what was true."""
    robot = tl.load_robot("sara")
    contacts = [touch(robot, *touched) for touched in TOUCHES]
    simulated = scripted(robot, contacts, 1.2, settings=Run(noise=SensorNoise()), start=POSE)
    samples, truth = simulated.samples, simulated.truth
    pipeline = tl.Pipeline(robot)
    pipeline.run(samples.time, samples.q, samples.qd, samples.tau, samples.wrench)
    middle = int(np.searchsorted(samples.time, 0.6))
    scene = Scene(robot, samples.q[middle])
    for slot, contact in enumerate(contacts):
        scene.add_contact(truth.point[middle, slot], truth.force[middle, slot], "truth", label="")
        segment = robot.body_of(contact.link).segment
        event = next(e for e in pipeline.events if e.segment == segment)
        if event.link is None or event.position_link is None:
            raise SystemExit(f"{segment}: {event.status}; choose another touch")
        T = robot.T_world_links(scene.q)[event.link]
        position = T[:3, :3] @ event.position_link + T[:3, 3]
        off = 1e3 * float(np.linalg.norm(position - truth.point[middle, slot]))
        size = float(np.linalg.norm(event.force))
        words = f"{size:.1f} N, {off:.1f} mm off"
        scene.add_contact(position, event.force, "estimate", label=words)
        scene.highlight(event.link)
    return scene


def with_words(image: np.ndarray, words: list[Label], scale: float) -> np.ndarray:
    """The image with labels drawn into it, their places given in pixels / `scale`."""
    import matplotlib.image
    from matplotlib.figure import Figure
    from matplotlib.patheffects import withStroke

    height, width = image.shape[:2]
    figure = Figure((width / 100, height / 100), dpi=100)
    figure.figimage(image)
    halo = [withStroke(linewidth=3.5, foreground="#fbfcfd")]
    for word in words:
        x, y = word.place[0] * scale / width, 1 - word.place[1] * scale / height
        align = {"start": "left", "middle": "center", "end": "right"}[word.anchor]
        style = {"fontsize": 12, "fontweight": "bold", "color": word.colour, "path_effects": halo}
        figure.text(x, y, word.text, ha=align, va="center", **style)
    file = BytesIO()
    figure.savefig(file, format="png", dpi=100)
    file.seek(0)
    drawn = matplotlib.image.imread(file)[..., :3]
    return (drawn * 255 + 0.5).astype(np.uint8)


def make(target: Path) -> None:
    """Writes `sara.png`."""
    scene = touched_scene()
    camera = Camera.framing(scene.points(), (0.75, -1.0, 0.32), SIZE[0] / SIZE[1], 0.1)
    scale = 1.3
    words = labels(scene, camera, (int(SIZE[0] / scale), int(SIZE[1] / scale)))
    for line, (kind, text) in enumerate((("estimate", "estimated"), ("truth", "true"))):
        place = (20.0, SIZE[1] / scale - 44 + 22 * line)
        words.append(Label(f"\N{BLACK CIRCLE} {text}", place, "start", COLOURS[kind]))
    image = with_words(scene.render(camera, SIZE), words, scale)
    target.mkdir(parents=True, exist_ok=True)
    data = png_bytes(image)
    (target / "sara.png").write_bytes(data)
    print(f"{target / 'sara.png'}: {len(data) / 1e3:.0f} kB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=TARGET, help="directory for the pictures")
    make(parser.parse_args().out)
