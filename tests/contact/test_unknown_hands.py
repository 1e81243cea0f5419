# SPDX-License-Identifier: Apache-2.0
"""Joint torques alone: no link is sure by its size, or by a torque that is off at rest."""

import numpy as np
import pytest

from touchline.model.robot import load_robot
from touchline.observer.dynamics import contact_loads, gravity_loads
from touchline.pipeline.pipeline import Pipeline

# A long link, and at its end a ball about the last joint's axis.
MODEL = """
<mujoco model="ball"><compiler angle="radian"/><worldbody><body name="column">
  <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
  <joint name="pan" axis="0 0 1" range="-3 3"/>
  <body name="long" pos="0 0 0.5">
    <inertial pos="0.2 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
    <joint name="lift" axis="0 1 0" range="-3 3"/>
    <geom type="cylinder" fromto="0.05 0 0 0.4 0 0" size="0.05"/>
    <body name="ball" pos="0.5 0 0">
      <inertial pos="0 0 0" mass="0.2" diaginertia="0.001 0.001 0.001"/>
      <joint name="tip" axis="0 1 0" range="-3 3"/>
      <geom type="sphere" pos="0 0 0" size="0.03"/>
      <geom type="box" pos="0.1 0 0" size="0.03 0.006 0.006"/>
    </body>
  </body>
</body></worldbody></mujoco>
"""
PERIOD, BEGIN, END = 2e-3, 1.0, 1.6


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = tmp_path_factory.mktemp("ball") / "ball.xml"
    path.write_text(MODEL)
    return load_robot(path)


def shares(arm, point, force, offset=(0.0, 0.0, 0.0)):
    """The probability of each body, of a touch of "ball"; torques err by `offset` [Nm]."""
    rng = np.random.default_rng(0)
    time = np.arange(0.0, END, PERIOD)
    q = np.zeros((len(time), 3))
    wrench = np.concatenate([force, np.cross(point, force)])
    touch = contact_loads(arm, q[0], "ball", wrench).torque
    pushed = np.clip((time - BEGIN) / 0.05, 0.0, 1.0)[:, None] * touch
    tau = gravity_loads(arm, q[0]).torque + offset - pushed
    tau += 0.02 * rng.standard_normal(tau.shape)
    pipeline = Pipeline(arm, period=PERIOD)
    pipeline.run(time, q, 0.0 * q, tau, np.zeros((len(time), 0, 6)))
    (event,) = pipeline.events
    found = {}
    for c in event.candidates:
        found[c.body] = found.get(c.body, 0.0) + c.probability
    return found


def test_a_large_link_is_not_sure_by_its_size_alone(arm):
    # A push through the last axis loads it by nothing, wherever it meets the ball.
    found = shares(arm, [0.5, 0.02, 0.522], [0.0, -12.0, -16.0])
    assert sum(found.values()) == pytest.approx(1.0, abs=0.01)
    assert 0.5 < found["long"] < 0.8  # 0.95 by area


def test_what_a_torque_shows_at_rest_makes_links_less_sure(arm):
    # A push on the finger: only that link loads the last joint, by 0.8 Nm.
    place, force = [0.6, 0.0, 0.506], [0.0, 0.0, -8.0]
    assert shares(arm, place, force)["ball"] > 0.97
    assert shares(arm, place, force, offset=(0.0, 1.0, 0.0))["ball"] > 0.97
    assert 0.2 < shares(arm, place, force, offset=(0.0, 0.0, 1.0))["ball"] < 0.9
