# SPDX-License-Identifier: Apache-2.0
"""The time of a replay: it goes on, stops at the ends, and jumps to events."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from touchline.result.event import Event
from touchline.view.player import Player


def test_it_plays_at_its_speed_and_stops_at_the_end():
    player = Player(10.0, 12.0)
    player.advance(1.0)
    assert player.time == 10.0
    player.play()
    player.speed = 0.5
    player.advance(1.0)
    assert player.time == 10.5 and player.playing
    player.advance(9.0)
    assert player.time == 12.0 and not player.playing
    player.play()
    assert player.time == 10.0 and player.playing
    for wanted, found in ((-1.0, 10.0), (11.0, 11.0), (99.0, 12.0)):
        player.seek(wanted)
        assert player.time == found


@settings(max_examples=50, deadline=None)
@given(st.lists(st.integers(0, 500), max_size=8, unique=True), st.integers(0, 99))
def test_next_visits_every_event_once_and_previous_goes_back(begins, seed):
    rng = np.random.default_rng(seed)
    events = []
    for number, begin in enumerate(begins):
        event = Event(id=number, segment="base", level="contact", detected=begin / 10)
        event.cleared = None if rng.random() < 0.2 else event.detected + rng.uniform(0.01, 0.05)
        if event.cleared is not None and rng.random() < 0.5:
            event.time_of_position = event.detected + 0.005
        events.append(event)
    player = Player(0.0, 60.0, events)
    player.seek(-1.0)
    visited = []
    if 0 in begins:  # one that begins with the recording is not ahead
        player.show(next(e for e in events if e.detected == 0.0))
        visited.append(0.0)
    while (event := player.neighbour(1)) is not None and event.cleared is not None:
        player.show(event)
        assert event.detected <= player.time <= event.cleared and not player.playing
        visited.append(event.detected)
    ended = [e for e in player.events if e.cleared is None]
    expected = [e.detected for e in player.events if not ended or e.detected < ended[0].detected]
    if not (ended and ended[0].detected == 0.0):
        assert visited == expected
        if len(visited) > 1:
            assert player.neighbour(-1).detected == visited[-2]
