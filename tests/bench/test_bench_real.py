# SPDX-License-Identifier: Apache-2.0
"""The benchmark on real recordings: one event to one touch, and what is counted."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from touchline.bench.matching import match
from touchline.bench.real import run as real
from touchline.bench.real.calibrated import calibrated, untouched
from touchline.bench.real.judged import Touched, judge_free, judge_touched
from touchline.bench.real.left_out import CHOICES, Tried, chosen, named
from touchline.cli import main
from touchline.model.robot import load_robot
from touchline.observer.samples import Samples
from touchline.result.contact import Candidate
from touchline.result.event import Event
from touchline.trials.real_recordings import PANDA_HAND, Recording, at_rate
from touchline.tuning import DEFAULTS


def spans(*intervals):
    return np.array(intervals, float).reshape(-1, 2)


def test_an_event_over_all_touches_is_one_of_them():
    assert len(match(spans((1, 2), (3, 4), (5, 6)), spans((0.5, np.inf)))) == 1


def test_two_events_in_one_touch_are_one_found_and_one_false():
    assert match(spans((1, 2)), spans((1.0, 1.3), (1.4, 2.1))) == [(0, 1)]


def test_a_pairing_that_finds_more_is_taken():
    pairs = match(spans((1, 2), (3, 4)), spans((1.5, 3.1), (1.0, 1.4)))
    assert sorted(pairs) == [(0, 1), (1, 0)]


def test_the_margin_counts_on_both_sides():
    touch = spans((1, 2))
    assert match(touch, spans((2.09, 2.2))) and match(touch, spans((0.5, 0.91)))
    assert not match(touch, spans((2.11, 2.2))) and not match(touch, spans((0.5, 0.89)))


intervals = st.lists(
    st.tuples(st.floats(0, 20), st.floats(0.05, 3)).map(lambda x: (x[0], x[0] + x[1])), max_size=6
)


@settings(max_examples=100, deadline=None)
@given(intervals, intervals)
def test_no_event_and_no_touch_is_paired_twice(touches, events):
    pairs = match(spans(*touches), spans(*events))
    assert len({t for t, _ in pairs}) == len({e for _, e in pairs}) == len(pairs)
    for t, e in pairs:
        assert events[e][0] <= touches[t][1] + 0.1 and touches[t][0] - 0.1 <= events[e][1]


def event(begin, end, **shares):
    candidates = tuple(Candidate(name, name, share, np.zeros(3)) for name, share in shares.items())
    return Event(
        id=0, segment="root", level="contact", detected=begin, cleared=end, candidates=candidates
    )


def recording(touches, link=0):
    time = np.arange(0.0, 10.0, 0.01)
    nothing = np.zeros((len(time), 0))
    samples = Samples(time, nothing, nothing, nothing, nothing)
    return Recording("made", load_robot("sara"), samples, 0.01, touches, link)


def test_links_are_counted_by_their_shares():
    events = [
        event(1.0, 1.5, link5=0.95, link4=0.05),  # right and sure
        event(3.0, 3.5, link6=0.92, link5=0.08),  # beyond, sure and wrong, not in the set
        event(5.0, 5.5, link4=0.6, link5=0.4),  # wrong, inboard, in the set of two
        event(7.0, 7.5, link5=1.0),  # no touch
        event(8.0, 8.5),  # found, but no link is named
    ]
    touches = spans((1, 1.5), (3, 3.5), (5, 5.5), (8, 8.5), (9, 9.5))
    assert judge_touched(recording(touches, 5), events) == Touched(
        touches=5,
        found=4,
        false=1,
        right=1,
        beyond=1,
        in_set=2,
        in_two=3,
        sure=2,
        sure_wrong=1,
        links=4,
    )


def test_an_arm_that_nothing_touches():
    free = judge_free(recording(spans()), [event(1.0, 2.0), event(9.0, None)])
    assert free.share == pytest.approx(0.2, abs=0.01)
    assert free.longest == pytest.approx(1.0, abs=0.02)
    assert free.events == 2 and free.open
    assert judge_free(recording(spans()), []).longest == 0.0


def test_a_folder_without_recordings_is_told(tmp_path, capsys):
    assert main(["bench", "real", "--data", str(tmp_path)]) == 2
    assert "panda_touches" in capsys.readouterr().err
    assert main(["bench", "real"]) == 2
    assert "--data" in capsys.readouterr().err


@pytest.fixture
def made_up(tmp_path, monkeypatch):
    """Two touched recordings and a free one; of the thin ones the second event is lost."""
    read = {"a5": recording(spans((1, 1.5), (3, 3.5)), 5), "b4": recording(spans((2, 3)), 4)}
    monkeypatch.setattr(real, "touched_files", lambda data: [tmp_path / name for name in read])
    monkeypatch.setattr(real, "read_touched", lambda path, folder: read[path.name])
    monkeypatch.setattr(real, "read_free", lambda data, folder: [recording(spans())])
    monkeypatch.setattr(
        real, "at_rate", lambda found, rate, later=0.0: replace(found, period=(1.0 + later) / rate)
    )

    def events_of(found):
        told = {5: [event(1.0, 1.5, link5=0.95), event(3.0, 3.5, link4=0.95)], 4: []}
        told = told.get(found.link, [event(1.0, None)])
        return told[:1] if found.period == 1.0 / 15.0 else told

    monkeypatch.setattr(real, "events_of", events_of)
    return tmp_path


def test_touched_and_free_recordings_are_printed(made_up, capsys):
    assert main(["bench", "real", "--data", str(made_up), "--rate", "15"]) == 0
    told = capsys.readouterr().out
    whole, thin, free = told.split("The same at 15 Hz")
    assert "found 66.7 % (2 of 3); of these: right link 50.0 % (1 of 2)" in whole
    assert "above 0.9 wrong 50.0 % (1 of 2)" in whole
    assert "found 33.3 % (1 of 3)" in thin and "of a period: 1, 2, 2, 2, of 2 found" in thin
    for text in (thin, free):  # motion in which nothing touches, at the full rate and at this one
        assert text.rstrip().splitlines()[-1].split()[-3:] == ["s", "1", "yes"]


def test_leaving_one_out_prints_nothing_else(made_up, monkeypatch, capsys):
    best = [Tried(Touched(touches=2, found=1), float(k == 3)) for k in range(len(CHOICES))]
    monkeypatch.setattr(real, "try_all", lambda found: best)
    assert main(["bench", "real", "--data", str(made_up), "--leave-one-out"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("Numbers chosen on all other files") and "nothing touches" not in told
    assert told.count(named(CHOICES[chosen([best, best], 0)])) == 2
    assert "found 50.0 % (2 of 4)" in told


def test_a_calibrated_arm_has_seen_nothing_of_the_recording_that_is_judged(tmp_path):
    rng = np.random.default_rng(0)
    robot = tmp_path / "robot.yaml"
    robot.write_text(PANDA_HAND)
    made = []
    for name in ("a1", "a2"):
        time = 5e-3 * np.arange(6000)
        q = 0.3 + 1e-6 * rng.normal(size=(6000, 7))
        samples = Samples(time, q, 0.0 * q, rng.normal(size=q.shape), np.zeros((6000, 0, 6)))
        touches = spans((1.0, 1.5), (3.0, 3.5))
        made.append(Recording(name, load_robot(robot), samples, 5e-3, touches, 7))
    far = untouched(made[0])
    assert not far[[150 + 1, 250, 350 - 1]].any() and far[[100, 400, 500]].all()
    louder = replace(made[1].samples, tau=3.0 * made[1].samples.tau)
    first, second = calibrated([made[0], replace(made[1], samples=louder)], tmp_path)
    assert first.name == "a1" and first.samples is made[0].samples
    np.testing.assert_allclose(first.robot.description.noise.tau, 3.0, rtol=0.1)
    np.testing.assert_allclose(second.robot.description.noise.tau, 1.0, rtol=0.1)
    assert first.robot.description.detection.calibration is None


def test_a_lower_rate_keeps_samples_of_even_instants():
    robot = load_robot("sara")
    n, k = len(robot.joint_names), len(robot.sensor_names)
    time = 5.0 + 0.005 * np.arange(400)
    q = np.tile(time[:, None], (1, n))
    samples = Samples(time, q, q, q, np.zeros((400, k, 6)))
    slow = at_rate(Recording("r", robot, samples, 0.005, spans((1, 2)), 7), 15.0)
    assert slow.period == 1.0 / 15.0 and len(slow.samples) == 30 and slow.link == 7
    np.testing.assert_allclose(slow.samples.time, 5.0 + np.arange(30) / 15.0, atol=0.005)
    assert np.isin(slow.samples.time, time).all()
    np.testing.assert_array_equal(slow.samples.q[:, 0], slow.samples.time)
    between = at_rate(Recording("r", robot, samples, 0.005, spans((1, 2)), 7), 15.0, 0.5)
    np.testing.assert_allclose(between.samples.time, slow.samples.time + 0.5 / 15.0, atol=0.01)


def test_a_recording_has_no_say_in_what_it_is_judged_with():
    def scores(*values):
        return [Tried(Touched(), value) for value in values]

    tried = [scores(0.0, 9.0, 0.0), scores(-1.0, 5.0, -0.5), scores(-1.0, -2.0, -3.0)]
    assert chosen(tried, 2) == 1
    assert chosen(tried, 0) == 0  # gains of 6 and -1: 5 +- 7 is luck
    assert chosen([scores(5.0, 0.0), scores(1.0, 1.0), scores(1.0, 1.0)], 0) == 0  # of equal ones
    assert chosen([scores(5.0, 0.0), scores(1.0, 9.0)], 0) == 0  # one recording chooses nothing


def test_what_is_tried_are_tuning_numbers_and_none_is_the_default():
    assert CHOICES[0] == {} and named(CHOICES[0]) == "defaults"
    for choice in CHOICES[1:]:
        ((name, value),) = choice.items()
        assert DEFAULTS[name] != value and named(choice) == f"{name} {value:g}"


def test_one_touched_file_leaves_nothing_to_calibrate_on(made_up, monkeypatch, capsys):
    monkeypatch.setattr(real, "touched_files", lambda data: [made_up / "a5"])
    assert main(["bench", "real", "--data", str(made_up), "--calibrate"]) == 2
    assert "a5: the only touched file" in capsys.readouterr().err
