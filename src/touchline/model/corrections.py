# SPDX-License-Identifier: Apache-2.0
"""What a description changes of its model: link corrections, loads, gravity."""

from dataclasses import replace

import numpy as np

from touchline.arrays import Array
from touchline.model.description import LinkCorrection, Load, RobotDescription
from touchline.model.mechanism import Inertia, Link, Mechanism
from touchline.model.plausibility import inertia_warnings, load_problem
from touchline.model.transforms import combine_inertias, inertia_matrix

NO_MASS = 1e-9  # kg


def apply_corrections(mechanism: Mechanism, description: RobotDescription) -> Mechanism:
    """Return the mechanism as the description has it.

    Corrections replace what the model says of a link; then loads are added to their links by the
    parallel-axis theorem; a gravity given replaces the model's.

    Args:
        mechanism: as its model file has it.
        description: all its links exist in the mechanism.
    """
    links = {
        name: _changed(link, description.links.get(name), description.loads)
        for name, link in mechanism.links.items()
    }
    gravity = mechanism.gravity
    if description.gravity is not None:
        gravity = np.array(description.gravity)
    changed = replace(mechanism, links=links, gravity=gravity)
    return replace(changed, warnings=_warnings(mechanism, changed, description))


def _changed(link: Link, correction: LinkCorrection | None, loads: tuple[Load, ...]) -> Link:
    inertia = corrected_inertia(link.inertia, correction) if correction else link.inertia
    carried = [load_inertia(load) for load in loads if load.link == link.name]
    if carried:
        inertia = combine_inertias([inertia, *carried])
    return replace(link, inertia=inertia)


def with_loads(
    mechanism: Mechanism, description: RobotDescription, loads: tuple[Load, ...]
) -> tuple[RobotDescription, Mechanism]:
    """The description with other loads, and the mechanism that follows.

    Args:
        mechanism: with the loads that the description has now.
        description: of the same robot.
        loads: all that are carried from now on; their links exist.
    """
    changed = {load.link for load in (*description.loads, *loads)}
    links = dict(mechanism.links)
    for name in changed:
        before = [_opposite(load_inertia(x)) for x in description.loads if x.link == name]
        after = [load_inertia(x) for x in loads if x.link == name]
        own = combine_inertias([links[name].inertia, *before])
        if own.mass < NO_MASS:  # what is left of a link without mass is rounding
            own = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
        links[name] = replace(links[name], inertia=combine_inertias([own, *after]))
    return replace(description, loads=loads), replace(mechanism, links=links)


def with_offsets(description: RobotDescription, torque: Array, wrench: Array) -> RobotDescription:
    """The description with biases that take away what is felt.

    Args:
        description: of the robot.
        torque: (n,) external torques that nothing causes [Nm]; NaN where none is measured.
        wrench: (k, 6) external wrenches outboard of each sensor, in its frame [N, Nm].
    """
    felt_torque, felt_wrench = np.nan_to_num(torque), np.nan_to_num(wrench)
    joints = tuple(
        replace(joint, bias=joint.bias - float(felt)) if joint.measured else joint
        for joint, felt in zip(description.joints, felt_torque, strict=True)
    )
    sensors = tuple(
        replace(sensor, bias=tuple((np.array(sensor.bias) - felt).tolist()))
        for sensor, felt in zip(description.sensors, felt_wrench, strict=True)
    )
    return replace(description, joints=joints, sensors=sensors)


def _opposite(body: Inertia) -> Inertia:
    return Inertia(-body.mass, body.com, -body.inertia)


def corrected_inertia(body: Inertia, correction: LinkCorrection) -> Inertia:
    """Return the inertia with the values that the correction gives.

    A correction to no mass takes the model's moments of inertia away too.
    """
    mass = body.mass if correction.mass is None else correction.mass
    com = body.com if correction.com is None else np.array(correction.com)
    if correction.inertia is not None:
        return Inertia(mass, com, inertia_matrix(correction.inertia))
    emptied = correction.mass == 0.0
    return Inertia(mass, com, np.zeros((3, 3)) if emptied else body.inertia)


def load_inertia(load: Load) -> Inertia:
    """Return the load's mass properties in the axes of its link."""
    return Inertia(load.mass, np.array(load.com), inertia_matrix(load.inertia))


def _warnings(
    before: Mechanism, after: Mechanism, description: RobotDescription
) -> tuple[str, ...]:
    """Drop the model's warnings about masses that are mended, add those about new ones."""
    old, new = set(inertia_warnings(before)), list(inertia_warnings(after, description.locked))
    mended = tuple(f": {line}" for line in old.difference(new))
    kept = [line for line in before.warnings if not line.endswith(mended)]
    told = [line for line in new if line not in old]
    for i, load in enumerate(description.loads):
        problem = load_problem(load, before)
        if problem:
            told.append(f"loads[{i}] of link '{load.link}': {problem}")
    return (*kept, *(f"{description.path}: {line}" for line in told))
