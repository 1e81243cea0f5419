# SPDX-License-Identifier: Apache-2.0
"""A description that does not fit the robot is refused, with the right reason."""

from dataclasses import replace

import numpy as np
import pytest

from touchline.live.preflight import preflight
from touchline.live.sample import Sample
from touchline.model.robot import load_robot
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import free_motion
from touchline.simulation.scene import Run


@pytest.fixture(scope="module")
def full():
    return load_robot("sara-full")


@pytest.fixture(scope="module")
def still(full):
    found = free_motion(full, 1.0, 0.0, Run(noise=SensorNoise())).samples
    return [
        Sample(found.time[i], found.q[i], found.qd[i], found.tau[i], found.wrench[i])
        for i in range(len(found))
    ]


def changed(samples, **changes):
    """Samples with signals changed by functions."""
    return [
        replace(s, **{name: change(getattr(s, name).copy()) for name, change in changes.items()})
        for s in samples
    ]


def names(reasons):
    return {reason.name for reason in reasons}


def scaled(index, factor):
    def change(values):
        values[index] *= factor
        return values

    return change


def test_a_robot_that_fits_is_let_through(full, still):
    assert preflight(full, still) == []


@pytest.mark.parametrize("joint", [1, 3])
def test_a_wrong_sign_of_a_torque(full, still, joint):
    (reason,) = preflight(full, changed(still, tau=scaled(joint, -1.0)))
    assert reason.name == "signs" and full.joint_names[joint] in reason.text


def test_torques_in_millinewtonmetres(full, still):
    found = preflight(full, changed(still, tau=lambda tau: 1e3 * tau))
    assert "units" in names(found) and any("gain: 0.001" in r.text for r in found)


def test_two_torques_exchanged(full, still):
    def swap(tau):
        tau[[1, 3]] = tau[[3, 1]]
        return tau

    (reason,) = preflight(full, changed(still, tau=swap))
    assert reason.name == "order"


def test_a_driver_that_has_taken_the_weight_out(full, still):
    found = preflight(full, changed(still, tau=lambda tau: 0.0 * tau))
    assert names(found) == {"gravity"} and "compensated: gravity" in found[0].text


def test_a_wrong_polarity(full, still):
    found = preflight(full, changed(still, wrench=scaled(full.sensor_names.index("base"), -1.0)))
    assert names(found) == {"signs"} and "polarity: inboard" in found[0].text


def test_a_sensor_that_was_zeroed_under_load(full, still):
    base = full.sensor_names.index("base")
    found = preflight(full, changed(still, wrench=scaled(base, 0.0)))
    assert names(found) == {"gravity"} and "zeroed" in found[0].text


def test_a_turned_sensor(full, still):
    base = full.sensor_names.index("base")

    def turn(wrench):
        wrench[base] = wrench[base][[2, 0, 1, 5, 3, 4]]
        return wrench

    assert names(preflight(full, changed(still, wrench=turn))) == {"signs"}


def test_positions_in_degrees(full, still):
    found = preflight(full, changed(still, q=np.rad2deg))
    assert "units" in names(found) and any("degrees" in reason.text for reason in found)


def test_a_clock_in_milliseconds(full, still):
    found = preflight(full, [replace(s, time=1e3 * s.time) for s in still])
    assert names(found) == {"rate"} and "seconds" in found[0].text


def test_a_rate_that_is_too_slow_for_the_bandwidth(full, still):
    assert names(preflight(full, still[::30])) == {"rate"}


def test_a_channel_without_numbers(full, still):
    def silent(wrench):
        wrench[1] = np.nan
        return wrench

    (reason,) = preflight(full, changed(still, wrench=silent))
    assert reason.name == "channels" and full.sensor_names[1] in reason.text


def test_a_robot_that_moves(full):
    found = free_motion(full, 1.0, 0.5, Run(noise=SensorNoise())).samples
    samples = [
        Sample(found.time[i], found.q[i], found.qd[i], found.tau[i], found.wrench[i])
        for i in range(len(found))
    ]
    assert names(preflight(full, samples)) == {"standstill"}


def test_a_load_that_nobody_has_described(full, still):
    def load(tau):
        tau[3] += 15.0
        return tau

    assert names(preflight(full, changed(still, tau=load))) == {"model"}


def test_too_few_samples(full, still):
    assert names(preflight(full, still[:5])) == {"rate"}
