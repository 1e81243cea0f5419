# SPDX-License-Identifier: Apache-2.0
"""From samples to located contacts and events, against the simulated truth."""

import json

import numpy as np
import pytest

import touchline as tl
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import Run, base_touch, singular_push, three_touches

K = 100.0


@pytest.fixture(scope="module")
def sara():
    return tl.load_robot("sara")


def run(robot, simulated, **options):
    s = simulated.samples
    pipeline = tl.Pipeline(robot, **options)
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    return pipeline


def steady_errors(robot, simulated, pipeline):
    """Per contact: its body, the statuses and bodies answered, position error [m], speed [m/s]."""
    truth, time = simulated.truth, simulated.samples.time
    columns, table = pipeline.contacts.columns(), pipeline.contacts
    by_link = {link: body for body in robot.bodies for link in body.links}
    for k in range(truth.link.shape[1]):
        force = np.linalg.norm(truth.force[:, k], axis=1)
        steady = np.flatnonzero(force > 0.999 * force.max())[80:]  # the filter follows the flanks
        body = by_link[truth.links[truth.link[steady[0], k]]]
        segment = robot.segment_names.index(body.segment)
        rows = np.flatnonzero((table.segment == segment) & np.isin(table.sample, steady))
        assert len(rows) == len(steady)
        position = np.stack([columns[axis][rows] for axis in "xyz"], axis=1)
        at = table.sample[rows]
        error = np.linalg.norm(position - truth.point[at, k], axis=1)
        speed = np.linalg.norm(np.gradient(truth.point[:, k], time, axis=0)[at], axis=1)
        yield body.name, columns["status"][rows], columns["body"][rows], error, speed


@pytest.mark.parametrize("speed", [0.0, 1.0, 2.0])
def test_three_contacts_at_once_are_each_where_they_are(sara, speed):
    simulated = three_touches(sara, speed=speed)
    pipeline = run(sara, simulated)
    found = list(steady_errors(sara, simulated, pipeline))
    assert len(found) == 3
    for body, status, bodies, error, rate in found:
        assert set(bodies) == {body}
        assert set(status) <= {"located", "ambiguous"}
        # Without lag compensation it would be |v| / K beside the truth; see theory, section 4.
        assert (error < 3e-4 + 0.2 * rate / K).all()
    assert sorted(event.segment for event in pipeline.events) == ["base", "handle", "wrist"]


@pytest.mark.parametrize("scenario", [base_touch, singular_push])
def test_contacts_that_no_joint_torque_shows(sara, scenario):
    simulated = scenario(sara)
    pipeline = run(sara, simulated)
    ((body, _, bodies, error, _),) = steady_errors(sara, simulated, pipeline)
    assert set(bodies) == {body}
    assert error.max() < 3e-3
    (event,) = pipeline.events
    assert (event.status, event.body) == ("located", body)


@pytest.fixture(scope="module")
def noisy(sara):
    return three_touches(sara, speed=0.5, settings=Run(noise=SensorNoise()))


def test_a_live_stream_gives_what_the_recording_gives(sara, noisy):
    whole, s = run(sara, noisy), noisy.samples
    live = tl.Pipeline(sara)
    table, columns = whole.contacts, whole.contacts.columns()
    row = 0
    for i in range(len(s)):
        result = live.update(s.time[i], s.q[i], s.qd[i], s.tau[i], s.wrench[i])
        for contact in result.contacts:
            assert table.sample[row] == i
            assert contact.event == columns["event"][row]
            assert (contact.status, contact.link) == (columns["status"][row], columns["link"][row])
            if contact.position is not None:
                expected = [columns[axis][row] for axis in "xyz"]
                np.testing.assert_allclose(contact.position, expected, atol=1e-9)
                assert contact.position_std == pytest.approx(columns["position_std"][row])
            row += 1
    assert row == len(table)
    for ours, theirs in zip(live.events, whole.events, strict=True):
        assert (ours.id, ours.link, ours.status) == (theirs.id, theirs.link, theirs.status)
        np.testing.assert_allclose(ours.position, theirs.position, atol=1e-9)
        np.testing.assert_allclose(ours.force, theirs.force, atol=1e-9)


def test_an_event_tells_its_place_in_world_and_on_its_link(sara, noisy):
    pipeline, truth, s = run(sara, noisy), noisy.truth, noisy.samples
    for event in pipeline.events:
        assert event.status == "located"
        i = int(np.searchsorted(s.time, event.time_of_position))
        T = sara.T_world_links(s.q[i])[event.link]
        at = T[:3, :3] @ event.position_link + T[:3, 3]
        np.testing.assert_allclose(at, event.position, atol=1e-9)
        slot = [truth.links[truth.link[i, k]] for k in range(3)].index(event.link)
        assert np.linalg.norm(event.position - truth.point[i, slot]) < 3e-3
        best = event.candidates[0]
        assert (best.link, best.body) == (event.link, event.body)
        assert 0.9 <= event.body_probability <= 1.0 + 1e-9
        assert 0 < event.position_std < 5e-3


def test_an_event_is_valid_json(sara, noisy):
    keys = {"link", "body", "body_probability", "position", "position_link", "time_of_position"}
    for event in run(sara, noisy).events:
        data = json.loads(json.dumps(event.as_json(), allow_nan=False))
        assert keys <= set(data)
        assert len(data["position"]) == 3 and len(data["position_link"]) == 3
        assert set(data["candidates"][0]) == {"link", "body", "probability", "position"}


def test_the_paper_rule_can_be_asked_for(sara, noisy):
    pipeline = run(sara, noisy, rule="paper")
    assert {event.segment for event in pipeline.events} == {"base", "wrist", "handle"}
