# SPDX-License-Identifier: Apache-2.0
"""Reset, tare and loads of a running session."""

import numpy as np
import pytest

from touchline.errors import InputError
from touchline.live.connection import Connection
from touchline.live.session import Session
from touchline.live.sources import make_source


def session_of(robot, address="sim://?speed=0"):
    return Session(robot, Connection(make_source(address, robot)))


def test_nothing_can_be_changed_before_it_is_live(sara):
    for act in ("reset", "tare"):
        with pytest.raises(InputError, match="not live yet"):
            getattr(session_of(sara), act)()


def test_a_load_that_is_told_and_taken_off(sara):
    with session_of(sara) as session:
        session.start()
        for news in session.run(1.2):
            del news
        told = session.set_load("tool", 0.4, (0.0, 0.0, 0.03))
        assert "tool carries 0.400 kg at (+0.000, +0.000, +0.030) m" in told
        assert session.pipeline.robot.description.loads[-1].mass == 0.4
        assert "nothing more" in session.set_load("tool", 0.0)
        assert session.pipeline.robot.description.loads == sara.description.loads
        with pytest.raises(InputError, match="unknown link 'claw'"):
            session.set_load("claw", 1.0)


def test_what_cannot_be_weighed_is_said(sara):
    with session_of(sara) as session:
        session.start()
        for news in session.run(1.2):
            del news
        with pytest.raises(InputError, match="no load on tool"):
            session.set_load("tool")


def test_a_tare_at_rest_tells_its_figures(sara):
    with session_of(sara, "sim://?speed=0&motion=0") as session:
        session.start()
        answers = []
        for news in session.run(1.5):
            del news
            if session.samples > 900 and not answers:
                answers.append(session.tare())
        assert answers[0].startswith("tare: took off ") and "N at base" in answers[0].replace(
            "Nm", "N"
        )
        biases = [sensor.bias for sensor in session.pipeline.robot.description.sensors]
        assert np.abs(biases).max() > 0.0
