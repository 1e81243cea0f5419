"""Names instead of robots, and what a notebook shows."""

from xml.etree import ElementTree

import numpy as np
import pytest

import touchline as tl
from touchline.simulation.scenario import three_touches


def test_names_stand_for_robots():
    assert tl.Pipeline("sara").robot.name == "sara"
    with pytest.raises(tl.InputError, match="did you mean 'sara'"):
        tl.Pipeline("sarah")


def test_a_notebook_shows_the_bodies():
    html = tl.load_robot("sara")._repr_html_()
    assert "<td>link3</td><td>base</td>" in html and "&lt;Robot sara" in html


@pytest.fixture(scope="module")
def touched():
    """A robot and 0.4 s of samples with three touches."""
    robot = tl.load_robot("sara")
    return robot, three_touches(robot, speed=0.5, seconds=0.4).samples


@pytest.mark.parametrize("kind", [tl.Pipeline, tl.Observer])
def test_integer_nanoseconds_are_told(touched, kind):
    robot, s = touched
    stamps = 1_700_000_000_000_000_000 + np.round(1e9 * s.time).astype(np.int64)
    for shifted in (stamps, stamps - stamps[0]):
        with pytest.raises(ValueError, match=r"integers.*time\[0\]\) \* 1e-9"):
            kind(robot).run(shifted, s.q, s.qd, s.tau, s.wrench)
    for stamp in (stamps[0], int(stamps[0])):
        with pytest.raises(ValueError, match="integers"):
            kind(robot).update(stamp, s.q[0], s.qd[0], s.tau[0], s.wrench[0])


def test_dates_are_told(touched):
    robot, s = touched
    stamps = (1e9 * s.time).astype("datetime64[ns]")
    with pytest.raises(ValueError, match="holds dates; pass"):
        tl.Pipeline(robot).run(stamps, s.q, s.qd, s.tau, s.wrench)
    with pytest.raises(ValueError, match="holds dates; pass"):
        tl.Pipeline(robot).update(stamps[0], s.q[0], s.qd[0], s.tau[0], s.wrench[0])


def test_a_whole_number_of_seconds_is_a_time(touched):
    robot, s = touched
    first = s.q[0], s.qd[0], s.tau[0], s.wrench[0]
    assert tl.Pipeline(robot).update(0, *first) == tl.Pipeline(robot).update(0.0, *first)
    now = tl.Pipeline(robot).update(1_700_000_000, *first)
    assert now.time == 1_700_000_000.0


@pytest.mark.parametrize("kind", [tl.Pipeline, tl.Observer])
def test_missing_velocities_are_told(touched, kind):
    robot, s = touched
    with pytest.raises(ValueError, match="^qd is missing: an estimate needs joint velocities"):
        kind(robot).run(s.time, s.q, None, s.tau, s.wrench)
    with pytest.raises(ValueError, match="^qd is missing"):
        kind(robot).update(0.0, s.q[0], None, s.tau[0], s.wrench[0])


def test_a_notebook_shows_results_and_events(touched):
    robot, s = touched
    pipeline = tl.Pipeline(robot)
    for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        result = pipeline.update(*sample)
    event = pipeline.events[0]
    assert f"<th>detected</th><td>{event.detected:.6g}</td>" in event._repr_html_()
    assert "<th>cleared</th>" not in event._repr_html_()  # it lasts
    for value, name in ((event, "Event"), (result, "Result"), (result.contacts[0], "Contact")):
        html = value._repr_html_()
        assert f"<caption>{name}</caption>" in html
        assert len(ElementTree.fromstring(html)) > 4  # whole, and nothing unescaped
    (bar, *_) = ElementTree.fromstring(event._repr_html_()).iter("meter")
    assert float(bar.get("value")) == pytest.approx(event.body_probability, abs=1e-4)
    assert f"<td>{result.contacts[0].event}</td>" in result._repr_html_()  # contacts are a table
    assert "resets=" not in repr(result) and "ratios=" not in repr(result)
