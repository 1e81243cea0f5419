# SPDX-License-Identifier: Apache-2.0
"""Pictures show things where the camera says they are, and what hides what."""

import re
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import touchline as tl
from touchline import _render
from touchline.report.event_pictures import EventPoses, event_pictures, event_scene
from touchline.report.facts import event_doubt, event_place, event_where
from touchline.report.figure import labels, svg_picture
from touchline.report.picture import Camera, Scene, png_bytes
from touchline.report.views import sees, views_of_contact
from touchline.result.contact import Candidate
from touchline.result.event import Event

SIZE = (360, 300)
Q = np.array([0.4, 0.7, 0.3, -1.3, 0.3, 0.9, 0.2])


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


def camera_of(scene, direction=(0.3, -1.0, 0.3)):
    return Camera.framing(scene.points(), direction, SIZE[0] / SIZE[1])


def at(image, pixel):
    """Colour of the pixel at a place."""
    x, y = np.floor(pixel).astype(int)
    return image[y, x].astype(int)


def is_orange(colour):
    return colour[0] > 170 and colour[0] - colour[2] > 90


def is_violet(colour):
    return colour[2] > 120 and colour[2] - colour[1] > 50 and colour[0] - colour[1] > 15


def test_camera_projects_by_similar_triangles():
    camera = Camera.looking_at((0, 0, 1), (0, -4, 1), field_of_view=2 * np.arctan(0.25))
    pixels, depth = camera.project(np.array([[0, 0, 1], [0.5, 0, 1], [0, 1, 1.4]]), (400, 200))
    np.testing.assert_allclose(depth, [4, 4, 5])
    # 1 m at 4 m fills half of the height of 200 pixels; up is up.
    np.testing.assert_allclose(pixels, [[200, 100], [250, 100], [200, 100 - 0.4 * 80]])


def test_camera_looks_straight_down_and_refuses_to_look_at_itself():
    camera = Camera.looking_at((0, 0, 0), (0, 0, 2))
    pixels, depth = camera.project(np.zeros(3), (100, 100))
    np.testing.assert_allclose([*pixels, depth], [50, 50, 2])
    with pytest.raises(ValueError, match="elsewhere"):
        Camera.looking_at((1, 2, 3), (1, 2, 3))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 999), st.floats(0.4, 3.0))
def test_framing_shows_all_points_and_touches_the_margin(seed, aspect):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(40, 3)) * rng.uniform(0.1, 2, 3)
    camera = Camera.framing(points, rng.normal(size=3), aspect, margin=0.1)
    pixels, depth = camera.project(points, (round(1000 * aspect), 1000))
    part = pixels / (round(1000 * aspect), 1000)
    assert (depth > 0).all()
    assert part.min() > 0.099 and part.max() < 0.901
    assert min(part.min(), 1 - part.max()) < 0.101


def test_raster_agrees_with_a_test_of_every_pixel():
    rng = np.random.default_rng(2)
    corners, nearness = rng.uniform(-10, 40, (60, 3, 2)), rng.uniform(0.2, 1, (60, 3))
    pixel, shown, near = _render.rasterize(corners, nearness, (32, 24))
    y, x = np.mgrid[:24, :32] + 0.5
    points = np.column_stack([x.ravel(), y.ravel()])
    best = np.zeros(len(points))
    number = np.full(len(points), -1)
    for i, (triangle, value) in enumerate(zip(corners, nearness, strict=True)):
        matrix = np.vstack([triangle.T, np.ones(3)])
        share = np.linalg.solve(matrix, np.vstack([points.T, np.ones(len(points))])).T
        depth = np.where((share > 0).all(axis=1), share @ value, 0)
        number[depth > best] = i
        best = np.maximum(best, depth)
    np.testing.assert_array_equal(pixel, np.flatnonzero(number >= 0))
    np.testing.assert_array_equal(shown, number[number >= 0])
    np.testing.assert_allclose(near, best[number >= 0], rtol=1e-5)


def test_a_fan_of_triangles_has_no_crack_and_no_overlap():
    angle = np.linspace(0, 2 * np.pi, 38)[:-1]
    rim = 50 + 45 * np.column_stack([np.cos(angle), np.sin(angle)])
    middle = np.full_like(rim, 50.3)
    corners = np.stack([middle, rim, np.roll(rim, 1, axis=0)], axis=1)
    each = [_render.rasterize(c[None], np.ones((1, 3)), (100, 100))[0] for c in corners]
    together = _render.rasterize(corners, np.ones((37, 3)), (100, 100))[0]
    assert sum(map(len, each)) == len(together)
    inside = np.hypot(*(np.divmod(together, 100) - np.array([[49.5], [49.5]]))) < 44
    assert inside.sum() == (np.hypot(*(np.mgrid[:100, :100] - 49.5)) < 44).sum()


def test_contacts_have_their_colours_where_the_camera_says(robot):
    scene = Scene(robot, Q)
    camera = camera_of(scene)
    high = np.array([0.3, -0.3, 1.2])
    scene.add_contact(high, (0, 0, -20), "estimate")
    scene.add_contact(high + [0.25, 0, 0], (0, 0, -20), "truth")
    image = scene.render(camera, SIZE)
    for mark, has_its_colour in zip(scene.marks, (is_orange, is_violet), strict=True):
        tail, tip = scene.arrow(mark)
        (shaft, point), _ = camera.project(np.array([(tail + tip) / 2, tip]), SIZE)
        assert has_its_colour(at(image, point)) and has_its_colour(at(image, shaft))
    clean = Scene(robot, Q).render(camera, SIZE)
    pixels, _ = camera.project(np.array([scene.arrow(m)[1] for m in scene.marks]), SIZE)
    assert not any(is_orange(at(clean, p)) or is_violet(at(clean, p)) for p in pixels)


def test_the_arrow_ends_at_the_contact_and_is_longer_for_more_force(robot):
    scene = Scene(robot, Q)
    for size in (15.0, 30.0):
        scene.add_contact(np.ones(3), (size, 0, 0))
    (tail, tip), (longer, same) = map(scene.arrow, scene.marks)
    np.testing.assert_allclose([tip, same], 1.0)
    assert longer[0] < tail[0] < 1.0 and (1 - longer[0]) == pytest.approx(2 * (1 - tail[0]))


def test_what_the_arm_hides_is_drawn_fainter(robot):
    middle = robot.T_world_links(Q)["link3"][:3] @ [0, -0.03, 0.15, 1]
    scene = Scene(robot, Q)
    camera = camera_of(scene)
    behind, before = (middle + side * 0.35 * camera.axes[2] for side in (1, -1))
    pictures = []
    for place in (behind, before):
        # Along the ray through the same pixel, so that only the depth differs.
        ray = middle - camera.eye
        along = (place - camera.eye) @ camera.axes[2] / (ray @ camera.axes[2])
        marked = Scene(robot, Q)
        marked.add_contact(camera.eye + along * ray, None)
        pictures.append(marked.render(camera, SIZE).astype(int))
    pixel, _ = camera.project(middle, SIZE)
    arm = at(scene.render(camera, SIZE), pixel)
    hidden, shown = (at(picture, pixel) for picture in pictures)
    assert is_orange(shown) and not is_orange(hidden)
    faint = np.abs(hidden - arm).max()
    assert 10 < faint < 0.6 * np.abs(shown - arm).max()


def test_highlight_tints_its_link_alone(robot):
    scene, plain = Scene(robot, Q), Scene(robot, Q)
    scene.highlight("link3")
    camera = camera_of(scene)
    change = np.abs(scene.render(camera, SIZE).astype(int) - plain.render(camera, SIZE)).max(axis=2)
    own = np.array([piece.link == "link3" for piece in scene.pieces])[scene.surface.part]
    pixels, _ = camera.project(scene.surface.corners[own].reshape(-1, 3), SIZE)
    row, column = np.nonzero(change > 3)
    assert len(row) > 200
    assert column.min() >= pixels[:, 0].min() - 1 and column.max() <= pixels[:, 0].max() + 1
    assert row.min() >= pixels[:, 1].min() - 1 and row.max() <= pixels[:, 1].max() + 1


def test_triangles_that_are_no_triangles_are_left_out():
    corners = np.array([[[1.0, 1.0], [5.0, 5.0], [9.0, 9.0]], [[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]]])
    odd = np.vstack([corners, np.full((1, 3, 2), np.nan), corners[1:] * 1e300])
    pixel, triangle, _ = _render.rasterize(odd, np.ones((len(odd), 3)), (10, 10))
    assert len(pixel) and set(triangle) <= {1, 3}
    with pytest.raises(ValueError, match="pixels"):
        scene_pixels((0, 5))


def scene_pixels(size):
    skin = _render.Skin([])
    return _render.Canvas(skin.posed(np.zeros((0, 4, 4))), np.zeros(3), np.eye(3), 1.0, size)


def test_a_robot_without_meshes_leaves_the_ground_alone():
    image = scene_pixels((8, 6)).image(np.zeros((0, 3)), 64, np.ones(3), None, [])
    assert image.shape == (6, 8, 3) and (image == 255).all()


def test_the_same_scene_gives_the_same_bytes(robot):
    first, second = (png_bytes(s.render(camera_of(s), SIZE)) for s in (Scene(robot, Q),) * 2)
    again = Scene(robot, Q)
    assert first == second == png_bytes(again.render(camera_of(again), SIZE))


def decode(data):
    """A plain decoder of the PNGs that are written: 8 bits, RGB, all five filters."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    place, parts = 8, {}
    while place < len(data):
        (length,), kind = struct.unpack(">I", data[place : place + 4]), data[place + 4 : place + 8]
        body = data[place + 8 : place + 8 + length]
        (check,) = struct.unpack(">I", data[place + 8 + length : place + 12 + length])
        assert check == zlib.crc32(kind + body)
        parts[kind] = body
        place += 12 + length
    width, height, *rest = struct.unpack(">IIBBBBB", parts[b"IHDR"])
    assert rest == [8, 2, 0, 0, 0]
    rows = np.frombuffer(zlib.decompress(parts[b"IDAT"]), np.uint8).reshape(height, -1).astype(int)
    image = np.zeros((height + 1, width + 1, 3), int)
    for y, row in enumerate(rows, 1):
        for x in range(1, width + 1):
            a, b, c = image[y, x - 1], image[y - 1, x], image[y - 1, x - 1]
            p = a + b - c
            da, db, dc = abs(p - a), abs(p - b), abs(p - c)
            paeth = np.where((da <= db) & (da <= dc), a, np.where(db <= dc, b, c))
            guess = (0, a, b, (a + b) // 2, paeth)[row[0]]
            image[y, x] = (row[3 * x - 2 : 3 * x + 1] + guess) % 256
    return image[1:, 1:], set(rows[:, 0].tolist())


def test_png_comes_back_as_it_was():
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.arange(30), np.arange(24))
    smooth = np.stack([3 * x, 5 * y, x * y // 3], axis=2)
    smooth[8:16] = rng.integers(0, 256, (8, 30, 3))
    smooth[20:] = 200 - x[20:, :, None] * 7
    image = (smooth % 256).astype(np.uint8)
    back, filters = decode(png_bytes(image))
    np.testing.assert_array_equal(back, image)
    assert len(filters) >= 3
    with pytest.raises(ValueError, match="uint8"):
        png_bytes(image.astype(float))


def test_two_views_see_the_contact_from_different_sides(robot):
    T = robot.T_world_links(Q)["link3"]
    for side in np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], float):
        scene = Scene(robot, Q)
        own = np.array([p.link == "link3" for p in scene.pieces])[scene.surface.part]
        corners = scene.surface.corners[own].reshape(-1, 3)
        out = T[:3, :3] @ side
        point = corners[(corners @ out).argmax()]
        scene.add_contact(point, -20 * out)
        cameras = views_of_contact(scene)
        assert all(sees(scene, point, -camera.axes[2:])[0] for camera in cameras)
        assert cameras[0].axes[2, :2] @ cameras[1].axes[2, :2] < 0.7
        for camera in cameras:
            pixels, _ = camera.project(scene.points(), (100, 100))
            assert pixels.min() > 0 and pixels.max() < 100


@settings(max_examples=40, deadline=None)
@given(
    place=st.tuples(*[st.floats(0.0, 1.0)] * 3),
    force=st.tuples(*[st.floats(-200.0, 200.0)] * 3).filter(lambda f: np.linalg.norm(f) > 0.1),
    posture=st.integers(0, 9),
    aspect=st.sampled_from([0.7, 4.0 / 3.0, 2.2]),
)
def test_no_arrow_is_cut_off(robot, place, force, posture, aspect):
    q = np.random.default_rng(posture).uniform(-1.5, 1.5, 7)
    scene, bare = Scene(robot, q), Scene(robot, q)
    corners = scene.surface.corners.reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    scene.add_contact(low + np.array(place) * (high - low), force, "truth")
    size = (round(240 * aspect), 240)
    for camera in views_of_contact(scene, aspect):
        # The truth is the widest arrow, and has no line that goes on: nothing of it is at a border.
        drawn = np.abs(scene.render(camera, size).astype(int) - bare.render(camera, size)) > 2
        ys, xs = np.nonzero(drawn.any(axis=2))
        assert len(xs) and xs.min() > 0 and xs.max() < size[0] - 1
        assert ys.min() > 0 and ys.max() < size[1] - 1


def test_lines_of_sight_end_at_the_arm(robot):
    scene = Scene(robot, Q)
    inside = robot.T_world_links(Q)["link3"][:3] @ [0, -0.03, 0.15, 1]
    around = np.vstack([np.eye(3), -np.eye(3)])
    assert not sees(scene, inside, around).any()
    assert sees(scene, np.array([0.0, 0.0, 3.0]), around).tolist() == [True] * 5 + [False]


def test_labels_stay_inside_and_apart(robot):
    scene = Scene(robot, Q)
    for _ in range(3):
        scene.add_contact((0.1, 0.1, 0.9), (20, 0, -3))
    found = labels(scene, camera_of(scene), SIZE)
    assert [label.text for label in found] == ["20.2 N"] * 3
    assert all(0 <= label.left and 0 < label.place[1] < SIZE[1] for label in found)
    assert not any(a.meets(b) for i, a in enumerate(found) for b in found[:i])


def test_labels_at_the_border_are_inside_as_well(robot):
    scene = Scene(robot, Q)
    top = scene.surface.corners[..., 2].max()
    for _ in range(4):
        scene.add_contact((0.1, 0.1, top), (0.0, 3.0, -30.0))
    found = labels(scene, camera_of(scene), (300, 225))
    assert all(5 < label.place[1] < 220 for label in found)
    assert not any(a.meets(b) for i, a in enumerate(found) for b in found[:i])


def test_no_label_lies_on_an_arrow(robot):
    rng = np.random.default_rng(3)
    for _ in range(20):
        scene = Scene(robot, Q)
        for _ in range(3):
            place = np.array([0.1, 0.1, 0.9]) + rng.normal(scale=0.03, size=3)
            scene.add_contact(place, 20.0 * rng.normal(size=3))
        camera = camera_of(scene)
        arrows = [camera.project(np.array(scene.arrow(mark)), SIZE)[0] for mark in scene.marks]
        for label in labels(scene, camera, SIZE):
            assert not any(label.lies_on(tail, tip) for tail, tip in arrows)


def test_words_of_an_svg_are_escaped(robot):
    scene = Scene(robot, Q)
    scene.add_contact((0.1, 0.1, 0.9), None, label='<b> & "c"')
    text = svg_picture(scene, camera_of(scene), SIZE, "a < b")
    assert "&lt;b&gt; &amp;" in text and "a &lt; b" in text and "<b>" not in text
    assert text.count("data:image/webp;base64,") == 1


def test_an_event_with_a_place_is_drawn_on_the_link_as_it_stands(robot):
    force, on_link = np.array([0.0, -25.0, 0.0]), np.array([0.0, 0.07, 0.2])
    T = robot.T_world_links(Q)["link3"]
    event = Event(
        id=3,
        segment="base",
        level="contact",
        detected=1.0,
        force=force,
        status="located",
        link="link3",
    )
    event.position, event.position_link, event.position_std = np.zeros(3), on_link, 0.02
    scene = event_scene(robot, event, Q, [(np.ones(3), force)])
    truth, estimate = scene.marks
    assert truth.kind == "truth" and estimate.is_point
    np.testing.assert_allclose(estimate.position, T[:3, :3] @ on_link + T[:3, 3])
    assert np.trace(estimate.covariance) == pytest.approx(0.02**2)
    assert np.linalg.eigvalsh(estimate.covariance)[0] == pytest.approx(0.0, abs=1e-12)


def test_an_event_without_a_place_claims_none(robot):
    event = Event(
        id=0, segment="base", level="contact", detected=1.0, force=np.array([5.0, 0.0, 0.0])
    )
    scene = event_scene(robot, event, Q)
    assert [mark.is_point for mark in scene.marks] == [False]
    event.status = "ambiguous"
    event.candidates = (
        Candidate("link3", "link3", 0.7, np.array([0.1, 0.2, 0.8])),
        Candidate("link4", "link4", 0.29, np.array([0.2, 0.2, 0.9])),
        Candidate("link5", "link5", 0.01, np.array([0.3, 0.2, 0.9])),
    )
    marks = event_scene(robot, event, Q).marks
    assert [mark.label for mark in marks] == ["70 %", "29 %", "5.0 N"]
    text = event_pictures(event_scene(robot, event, Q), event)
    assert text.count("<svg") == 2 and "ambiguous" in text
    assert len(text) < 4.0e4
    assert re.search(r">5\.0 N</text>", text)


def test_what_is_not_known_is_said_in_words():
    event = Event(id=0, segment="base", level="contact", detected=1.0, status="not_separable")
    event.rank, event.unknowns = 7, 10
    assert event_where(event) == "several touches, or a twist"
    assert event_place(event) == "several touches, or a twist (not separable)"
    words = event_doubt(event)
    assert "One push on base cannot explain" in words and "(7 equations, 10 unknowns)" in words
    assert "two contacts or more" in words
    event.unknowns = 15
    assert "three contacts or more" in event_doubt(event)
    assert "part of its link" not in words
    event.candidates = (Candidate("link1", "link1", 0.4, np.zeros(3), 0.21),)
    assert "up to 21 cm away" in event_doubt(event)
    event.status, event.candidates = "ambiguous", ()
    assert "any of the marked places" in event_doubt(event)
    event.status = "wrench_only"
    assert "its place is not" in event_doubt(event)
    assert event_place(event) == "(wrench only)"
    ambiguous = event.replace(status="ambiguous", link="link4", body_probability=0.617)
    assert event_place(ambiguous) == "link4 (ambiguous, 62 %)"
    event.status, event.link = "located", "link1"
    assert event_doubt(event) == "" and event_where(event) == "link1"
    assert event_place(event) == "link1"
    event.body_probability = 0.999
    assert event_place(event) == "link1"
    event.body_probability = 0.93
    assert event_place(event) == "link1 (93 %)"


def test_the_arm_is_drawn_as_it_stood(robot):
    poses, event = EventPoses(), Event(id=0, segment="base", level="contact", detected=0.25)
    time = np.arange(10) * 0.1
    q = np.tile(time[:, None], 7)
    q[2] = np.nan
    poses.add(time[:5], q[:5], [event])
    np.testing.assert_array_equal(poses.get(event), q[3])
    event.time_of_position = 0.61
    poses.add(time[5:], q[5:], [event])
    np.testing.assert_array_equal(poses.get(event), q[6])
    assert poses.get(Event(id=1, segment="base", level="contact", detected=0.0)) is None
