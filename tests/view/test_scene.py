# SPDX-License-Identifier: Apache-2.0
"""The page shows the robot and a contact where they are; it asks for nothing from elsewhere."""

import numpy as np
from browser import until
from projection import count_near, pixel

import touchline as tl
from touchline.view.markers import COLOURS, ContactMarker, disc_of
from touchline.view.pose import quaternion_to
from touchline.view.scene import TINT, RobotScene, dress
from touchline.view.server import PageServer

Q = np.array([0.3, 0.6, -0.2, 1.2, 0.4, 0.8, 0.0])


def test_arm_and_marker_are_where_they_should_be(browser):
    robot = tl.load_robot("sara")
    poses = robot.T_world_links(Q)
    point, force = np.array([0.35, 0.3, 0.9]), np.array([0.0, 15.0, -20.0])
    with PageServer("test", port=0) as server:
        dress(server.page)
        scene = RobotScene(server.page.scene, robot)
        marker = ContactMarker(server.page.scene, "/contact", "estimate")
        browser.open(server.url)
        (client,) = until(lambda: list(server.page.get_clients().values()), pause=browser.rest)
        scene.place(Q)
        scene.tint(frozenset({"link5"}))
        marker.show(point, force)
        middle = {name: T[:3, 3] for name, T in poses.items()}

        def shown():
            image = browser.picture()
            return count_near(image, *pixel(client.camera, point), COLOURS["estimate"]) > 15

        until(shown, pause=browser.rest, what="the marker's point")
        browser.rest(1.0)
        image = browser.picture()
        tail = point - 0.008 * 0.7 * force  # within the arrow
        assert count_near(image, *pixel(client.camera, tail), COLOURS["estimate"], 2) > 5
        beyond = point + 0.008 * force
        assert count_near(image, *pixel(client.camera, beyond), COLOURS["estimate"]) == 0
        assert count_near(image, *pixel(client.camera, middle["link5"]), TINT, 6) > 80
        for link in ("link0", "link2", "link3", "link7"):
            column, row = (round(x) for x in pixel(client.camera, middle[link]))
            assert image[row, column].min() < 245, f"{link} is not at {column}, {row}"
            assert count_near(image, column, row, TINT, 6) < 20
        marker.hide()
        until(lambda: not shown(), pause=browser.rest, what="the marker to go")
        assert browser.complaints == []
        port = server.page.get_port()
        local = (f"http://127.0.0.1:{port}/", f"blob:http://127.0.0.1:{port}/", "data:")
        sockets = [url for url in browser.requests if url.startswith("ws:")]
        assert [url.rstrip("/") for url in sockets] == [f"ws://127.0.0.1:{port}"]
        others = [u for u in browser.requests if u not in sockets and not u.startswith(local)]
        assert others == []


def test_disc_spans_the_two_large_axes_of_the_covariance():
    a, b, c = 0.05, 0.03, 1e-6
    (long, short), wxyz = disc_of(np.diag([b**2, c**2, a**2]))
    assert np.allclose((long, short), (2 * a, 2 * b))
    w, x, y, z = wxyz
    normal = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    assert np.allclose(np.abs(normal), [0, 1, 0], atol=1e-9)


def test_quaternion_turns_z_to_a_direction():
    for direction in ([0, 0, 1], [0, 0, -1], [1, 2, -3], [-0.1, 0, 0]):
        w, x, y, z = quaternion_to(np.array(direction, float))
        turned = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
        assert np.allclose(turned, np.array(direction) / np.linalg.norm(direction))
