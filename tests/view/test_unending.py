"""The live page goes on whatever its visitors do, by mouse or by messages of their own."""

import asyncio
import os
import threading

import msgspec
import numpy as np
import pytest
import viser
from browser import until
from test_guard import PROTOCOL
from websockets.asyncio.client import connect
from websockets.sync.client import connect as connect_sync

from touchline.reaction.reaction import REACTIONS
from touchline.simulation.hands import Hand, Hands
from touchline.view.faults import FAULTS
from touchline.view.gate import Gate
from touchline.view.live import LivePage
from touchline.view.methods import METHODS
from touchline.view.server import PageServer

ACTIONS = int(os.environ.get("ACTIONS", "1500"))  # of three visitors, on three pages


@pytest.fixture(scope="module")
def page():
    with PageServer("test", port=0) as server:
        yield LivePage(server), server


def test_hands_that_are_alike_are_still_told_apart():
    hands = Hands(2)
    first, second, third = (Hand("link4", np.zeros(3), np.ones(3)) for _ in range(3))
    for hand in (first, second, third):
        hands.add(hand)
    assert hands.slots[0] is third and hands.slots[1] is second
    second.released = True
    hands.add(first)
    assert hands.slots[0] is third and hands.slots[1] is first


@pytest.mark.parametrize("seed", range(3))
def test_hundreds_of_random_actions_do_not_fail_a_frame(page, seed):
    live, _ = page
    rng = np.random.default_rng(seed)
    links = list(live.arm.robot.mechanism.links)

    def point():
        return rng.uniform(-1.0, 1.0, 3) + (0.0, 0.0, 0.5)

    def press():
        origin = 2.0 * point()
        live.press(origin, live.arm.robot.T_world_links(live.arm.q)["link4"][:3, 3] - origin)

    actions = [
        lambda: live.arm.push_anywhere(live._controls.force),
        lambda: live.arm.push_anywhere(live._controls.force),
        press,
        lambda: live.pull_begins(int(rng.integers(3)), rng.choice(links), point(), 2.0 * point()),
        lambda: live.pull_moves(int(rng.integers(3)), 10.0 ** rng.uniform(-3, 6) * point()),
        lambda: live.pull_ends(int(rng.integers(3))),
        lambda: live.arm.hands.release_all() if rng.random() < 0.2 else None,
        lambda: setattr(live._controls._force, "value", float(rng.uniform(5, 60))),
        lambda: setattr(live._controls._motion, "value", str(rng.choice(["stands", "moves"]))),
        lambda: setattr(live._controls._reaction, "value", str(rng.choice(list(REACTIONS)))),
        lambda: setattr(live._controls._fault, "value", str(rng.choice(list(FAULTS)))),
        lambda: setattr(live._controls._payload, "value", float(rng.uniform(0, 1))),
        lambda: setattr(live._controls._stiffness, "value", int(rng.integers(1, 20)) * 5),
        lambda: setattr(live._controls._noise, "value", bool(rng.random() < 0.5)),
        lambda: setattr(live._controls._keep, "value", bool(rng.random() < 0.5)),
        lambda: setattr(live._controls._method, "value", str(rng.choice(list(METHODS)))),
    ]
    for _ in range(ACTIONS // 3):
        live.post(actions[rng.integers(len(actions))])
        live.frame(int(rng.integers(2, 9)))


def test_sixty_random_pushes_and_eight_clicks_on_one_link(page):
    live, _ = page
    for _ in range(60):
        live.post(lambda: live.arm.push_anywhere(25.0))
        live.frame(2)
    for _ in range(8):
        origin = np.array([2.0, 0.1, 0.8])
        aim = live.arm.robot.T_world_links(live.arm.q)["link4"][:3, 3]
        live.post(lambda o=origin, a=aim: live.press(o, a - o))
        live.frame(2)
    assert len(live.arm.hands.active()) == 6


def test_a_failing_frame_is_told_and_the_arm_begins_anew(page, capsys):
    live, _ = page
    before, restarts = live.arm, live.restarts

    def fail():
        raise ZeroDivisionError("nothing <left>")

    live.post(fail)
    live.frame_or_restart(8)
    assert live.restarts == restarts + 1 and live.arm is not before
    assert "ZeroDivisionError: nothing &lt;left&gt;" in live._controls.notice.content
    assert "ZeroDivisionError" in capsys.readouterr().err
    live.frame_or_restart(8)
    assert live.arm.time > 0.0 and live.restarts == restarts + 1


def message(kind, **fields) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


CAMERA = {
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 1.0, 1.0),
    "fov": 1.0,
    "near": 0.01,
    "far": 100.0,
    "image_height": 480,
    "image_width": 640,
    "look_at": (0.0, 0.0, 0.5),
    "up_direction": (0.0, 0.0, 1.0),
}
BAD_VALUES = ["text", float("nan"), float("inf"), 1e308, -1.0, None, [], {}, b"x", True, 10**30]


@pytest.mark.parametrize("value", BAD_VALUES[:-1], ids=str)
def test_a_slider_takes_no_value_that_it_cannot_have(page, value):
    live, server = page
    gate, uuid = Gate(server.page), live._controls._force._impl.uuid
    assert gate.admits(message("GuiUpdateMessage", uuid=uuid, updates={"value": 30.0}))
    assert gate.admits(message("GuiUpdateMessage", uuid=uuid, updates={"value": 30}))
    assert not gate.admits(message("GuiUpdateMessage", uuid=uuid, updates={"value": value}))
    assert not gate.admits(message("GuiUpdateMessage", uuid=uuid, updates={"max": 1e3}))
    assert not gate.admits(message("GuiUpdateMessage", uuid="other", updates={"value": 30.0}))


@pytest.mark.parametrize(
    "raw",
    ["text", b"", b"\xc1", b"\xa1\x90", message("NoSuchMessage"), b"\x91" * 100_000],
    ids=range(6),
)
def test_what_is_no_message_is_dropped(page, raw):
    assert not Gate(page[1].page).admits(raw)


def test_a_drop_down_takes_its_own_options_only(page):
    live, server = page
    gate, uuid = Gate(server.page), live._controls._method._impl.uuid
    assert gate.admits(message("GuiUpdateMessage", uuid=uuid, updates={"value": "paper"}))
    assert not gate.admits(message("GuiUpdateMessage", uuid=uuid, updates={"value": "guess"}))


def test_three_programs_that_send_nonsense_do_not_stop_the_arm():
    with PageServer("test", port=0) as server:
        live = LivePage(server)
        thread = threading.Thread(target=live.run)
        thread.start()
        try:
            problems = asyncio.run(_visit(server.page, live, 700))
            assert problems == []
            options: dict = {"subprotocols": [PROTOCOL], "max_size": None, "proxy": None}
            with connect_sync(_url(server.page), **options) as client:
                client.send(message("ViewerCameraMessage", **CAMERA))
                before = live.arm.time
                until(lambda: live.arm.time > before + 0.1, what="the arm to go on")
            assert live.restarts == 0 and thread.is_alive()
            assert 5.0 <= live._controls.force <= 60.0
        finally:
            live.stop()
            thread.join()


def _url(page: viser.ViserServer) -> str:
    return f"ws://127.0.0.1:{page.get_port()}"


async def _visit(page: viser.ViserServer, live: LivePage, actions: int) -> list[str]:
    """Three visitors at once; returns what the server's own loop complained of."""
    problems: list[str] = []
    loop = page._event_loop if hasattr(page, "_event_loop") else page._websock_server._event_loop
    loop.call_soon_threadsafe(
        loop.set_exception_handler, lambda _, context: problems.append(str(context))
    )
    uuids = [handle._impl.uuid for handle in page.gui._gui_input_handle_from_uuid.values()]
    await asyncio.gather(*(_send(page, live, uuids, seed, actions) for seed in range(3)))
    return problems


async def _send(page, live, uuids, seed, actions) -> None:
    rng = np.random.default_rng(seed)
    links = list(live.arm.robot.mechanism.links)

    def number():
        return [float(rng.normal()), float("nan"), 1e308, "x", None, 5.0][rng.integers(6)]

    def three():
        if rng.random() < 0.5:
            return [number() for _ in range(int(rng.integers(2, 5)))]
        return rng.normal(size=3).tolist()

    async with connect(_url(page), subprotocols=[PROTOCOL], max_size=None, proxy=None) as client:
        reading = asyncio.create_task(_read(client))
        await client.send(message("ViewerCameraMessage", **CAMERA))
        for _ in range(actions):
            name = f"/robot/{links[rng.integers(len(links))]}/0"
            common = {"name": name, "instance_index": None, "modifier": None, "owner": ""}
            kind = rng.integers(5)
            if kind == 0:
                value = [*BAD_VALUES[:-1], 20.0, "moves", "stop", "classical"][rng.integers(14)]
                uuid = uuids[rng.integers(len(uuids))]
                raw = message("GuiUpdateMessage", uuid=uuid, updates={"value": value})
            elif kind == 1:
                ray = {"ray_origin": three(), "ray_direction": three()}
                raw = message("SceneNodeClickMessage", screen_pos=(0.5, 0.5), **ray, **common)
            elif kind == 2:
                phase = ["start", "update", "end", "never"][rng.integers(4)]
                places = {"start_position": three(), "end_position": three()}
                pixels = {"start_screen_pos": (0.5, 0.5), "end_screen_pos": (0.5, 0.5)}
                more = {**places, **pixels, **common, "button": "left"}
                raw = message("SceneNodeDragMessage", phase=phase, **more)
            elif kind == 3:
                raw = message("ViewerCameraMessage", **{**CAMERA, "position": three()})
            else:
                raw = rng.bytes(int(rng.integers(1, 60)))
            await client.send(raw)
            await asyncio.sleep(0.001)
        reading.cancel()


async def _read(client) -> None:
    async for _ in client:
        pass


@pytest.mark.parametrize("name", ["panda", "ur10"])
def test_another_arm_is_pushed_and_feels_it_by_every_method(name):
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    with PageServer("test", port=0) as server:
        live = LivePage(server, robot=name)
        assert live._controls._fault.options == ("none",)
        felt = 0
        for method in live._controls._method.options:
            live._controls._method.value = method
            for _ in range(3):
                live.post(lambda: live.arm.push_anywhere(40.0))
                for _ in range(15):
                    live.frame(20)
                felt += any(v.level for v in live.verdicts)
                live.post(live.arm.hands.release_all)
                for _ in range(15):  # the next push is one of its own
                    live.frame(20)
        assert felt >= 3
