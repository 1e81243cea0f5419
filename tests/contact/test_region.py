# SPDX-License-Identifier: Apache-2.0
"""The posterior over links and surfaces: it adds up, and its regions keep their word."""

import numpy as np
import pytest
from shapes import box, chain, measured, still

import touchline as tl
from touchline.localizer.localizer import Localizer
from touchline.localizer.skin import Skin
from touchline.observer.observer import Observer
from touchline.simulation.scenario import three_touches
from touchline.trials.touches import TouchSampler, resting_signals

PLACE, PUSH = np.array([0.03, -0.05, 0.1]), np.array([4.0, 3.0, -20.0])


def cube():
    robot = still(box(0.2, 0.2, 0.2))
    observer, estimate, skin = measured(robot, [], [("body", PLACE, PUSH)])
    localizer = Localizer(observer, skin=skin)
    return localizer.locate("base", [], estimate), localizer.region()


def test_the_posterior_of_a_flat_face_is_the_normal_one_that_the_covariance_says():
    answer, region = cube()
    assert region.probability.sum() == pytest.approx(1.0)
    mean = region.probability @ region.points
    offsets = region.points - mean
    covariance = np.einsum("m,mi,mj->ij", region.probability, offsets, offsets)
    np.testing.assert_allclose(mean, answer.position, atol=1e-5)
    spread = np.trace(answer.covariance)
    np.testing.assert_allclose(covariance, answer.covariance, atol=0.03 * spread)


def test_regions_hold_what_they_say_and_the_densest_pieces():
    _, region = cube()
    for probability in (0.5, 0.9, 0.99):
        inside = region.largest(probability)
        assert region.probability[inside].sum() == pytest.approx(probability, abs=0.02)
        assert region.density[inside].min() >= region.density[~inside].max()
    assert region.contains("body", PLACE, 0.1)
    assert not region.contains("body", [0.03, -0.02, 0.1], 0.999)


def test_a_link_that_nothing_speaks_for_is_in_no_region():
    _, region = cube()
    assert region.level("another", PLACE) == 1.0


def level(localizer, touch):
    """The smallest region that holds the truth; all there is where the answer has no place."""
    try:
        return localizer.region().level(touch.patch.link, touch.position)
    except ValueError:
        return 1.0


LAYOUTS = {
    "base sensor and joint torques": ((("base", "link0"),), "sensor"),
    "base sensor": ((("base", "link0"),), "none"),
    "sensor in the chain": ((("base", "link0"), ("middle", "link2")), "sensor"),
    "joint torques": ((), "sensor"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_nine_in_ten_true_places_are_in_the_region_of_ninety_percent(layout):
    sensors, torque = LAYOUTS[layout]
    robot = chain((0.3,) * 5, sensors=sensors, torque=torque)
    skin, rng = Skin(robot), np.random.default_rng(20)
    sampler = TouchSampler(skin, rng, friction=0.8, floor=-9.0)
    observer = Observer(robot)
    localizer = Localizer(observer, skin=skin, friction=0.8, torque_error=0.0)
    levels = []
    for _ in range(200):
        touch = sampler.sample(20.0)
        s = resting_signals(robot, touch.q, [(touch, 0.0)], 0.1, rng)
        observer.reset()
        rows = observer.run(s.time, s.q, s.qd, s.tau, s.wrench).rows
        assert touch.patch.segment is not None
        localizer.locate(touch.patch.segment, touch.q, observer.estimate(rows[-1]))
        levels.append(level(localizer, touch))
    inside = np.mean(np.array(levels) <= 0.9)
    assert 0.85 <= inside <= 0.95  # 90 % of 200: one sigma is 2.1 %
    assert 0.38 <= np.mean(np.array(levels) <= 0.5) <= 0.62


def test_a_region_is_that_of_one_contact_or_an_error():
    robot = tl.load_robot("sara")
    s = three_touches(robot, speed=0.0, seconds=0.5).samples
    pipeline, several = tl.Pipeline(robot), 0
    with pytest.raises(ValueError, match="single contact"):
        pipeline.region()
    for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        contacts = pipeline.update(*sample).contacts
        if len(contacts) > 1 and several < 5:
            several += 1
            with pytest.raises(ValueError, match="single contact"):
                pipeline.region()
    assert several == 5
