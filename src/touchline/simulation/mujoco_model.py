# SPDX-License-Identifier: Apache-2.0
"""A MuJoCo model of a robot: every link a body, every force-torque sensor a site.

Links joined by fixed or locked joints stay bodies of their own, so that the wrench that passes
between any two of them exists in the simulation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.extras import need
from touchline.model.mechanism import Inertia, Joint, Mechanism
from touchline.model.robot import Robot
from touchline.model.transforms import joint_motion, pose_rpy

Addition = Callable[[Any, dict[str, Any]], None]


@dataclass(frozen=True)
class PlantModel:
    """A compiled model and where the robot's parts are in it.

    Attributes:
        model: `mujoco.MjModel`.
        bodies: link -> body.
        joints: moving joint -> its coordinate (all have one), mimicking joints included.
    """

    model: Any
    bodies: dict[str, int]
    joints: dict[str, int]


def _mujoco() -> Any:  # its stubs lack most names
    return need("mujoco")


def build_model(
    robot: Robot,
    step: float,
    mechanism: Mechanism | None = None,
    armature: Mapping[str, float] | None = None,
    addition: Addition | None = None,
) -> PlantModel:
    """Builds the model.

    Args:
        robot: its sensors and locked joints.
        step: of the physics [s].
        mechanism: with other inertias than the robot's description has; default: the robot's own.
        armature: rotor inertia [kg m2] by joint.
        addition: called with the `mujoco.MjSpec` and its bodies by link before compilation, to add
            shapes or other objects.

    Raises:
        InputError: a moving joint carries no mass.
    """
    mechanism = mechanism or robot.mechanism
    spec = _mujoco().MjSpec()
    spec.option.timestep = step
    spec.option.gravity = np.asarray(robot.gravity)
    spec.option.integrator = _mujoco().mjtIntegrator.mjINT_RK4
    spec.compiler.degree = False
    bodies = _add_links(spec, robot, mechanism, armature or {})
    _add_mimics(spec, mechanism, step)
    for sensor in robot.description.sensors:
        _add_sensor(spec, bodies[sensor.link], sensor.name, pose_rpy(sensor.xyz, sensor.rpy))
    if addition is not None:
        addition(spec, bodies)
    model = spec.compile()
    ids = {name: body.id for name, body in bodies.items()}
    _set_inertias(model, mechanism, ids)
    joints = _coordinates(model, mechanism, set(robot.description.locked))
    return PlantModel(model, ids, joints)


def _add_links(
    spec: Any, robot: Robot, mechanism: Mechanism, armature: Mapping[str, float]
) -> dict[str, Any]:
    locked = robot.description.locked
    inboard = {joint.child: joint for joint in mechanism.joints.values()}
    bodies: dict[str, Any] = {}
    for name in _inboard_first(mechanism):
        joint = inboard.get(name)
        parent = bodies[joint.parent] if joint else spec.worldbody
        T = joint.T_parent_joint if joint else np.eye(4)
        moving = joint is not None and joint.kind != "fixed"
        if joint and moving and _master(joint) in locked:
            T = T @ joint_motion(joint.kind, joint.axis, _locked_position(joint, locked))
            moving = False
        body = parent.add_body(name=f"link:{name}", pos=T[:3, 3], quat=quaternion(T[:3, :3]))
        _add_inertia(body, mechanism.links[name].inertia)
        if joint and moving:
            _add_joint(body, joint, armature.get(joint.name, 0.0))
        bodies[name] = body
    return bodies


def _inboard_first(mechanism: Mechanism) -> list[str]:
    children: dict[str, list[str]] = {}
    for joint in mechanism.joints.values():
        children.setdefault(joint.parent, []).append(joint.child)
    order = [mechanism.root]
    for name in order:  # grows while it is walked
        order += children.get(name, [])
    return order


def _master(joint: Joint) -> str:
    return joint.mimic.joint if joint.mimic else joint.name


def _locked_position(joint: Joint, locked: Mapping[str, float]) -> float:
    if joint.mimic is None:
        return locked[joint.name]
    return joint.mimic.multiplier * locked[joint.mimic.joint] + joint.mimic.offset


def _add_joint(body: Any, joint: Joint, armature: float) -> None:
    kinds = _mujoco().mjtJoint
    body.add_joint(
        name=f"joint:{joint.name}",
        type=kinds.mjJNT_HINGE if joint.kind == "revolute" else kinds.mjJNT_SLIDE,
        axis=joint.axis,
        armature=armature,
    )


def _add_mimics(spec: Any, mechanism: Mechanism, step: float) -> None:
    """Each mimicking joint follows its master by as stiff a constraint as the step allows."""
    present = {joint.name for joint in spec.joints}
    for joint in mechanism.joints.values():
        if joint.mimic is None or f"joint:{joint.name}" not in present:
            continue
        equality = spec.add_equality(
            type=_mujoco().mjtEq.mjEQ_JOINT,
            objtype=_mujoco().mjtObj.mjOBJ_JOINT,
            name1=f"joint:{joint.name}",
            name2=f"joint:{joint.mimic.joint}",
            solref=[2 * step, 1.0],
            solimp=[0.999, 0.9999, 0.001, 0.5, 2.0],
        )
        equality.data[:5] = joint.mimic.offset, joint.mimic.multiplier, 0.0, 0.0, 0.0


def _add_sensor(spec: Any, body: Any, name: str, T_link_sensor: Array) -> None:
    site = f"sensor:{name}"
    body.add_site(name=site, pos=T_link_sensor[:3, 3], quat=quaternion(T_link_sensor[:3, :3]))
    kinds, on_site = _mujoco().mjtSensor, _mujoco().mjtObj.mjOBJ_SITE
    for kind in (kinds.mjSENS_FORCE, kinds.mjSENS_TORQUE):
        spec.add_sensor(name=f"{kind.name}:{name}", type=kind, objtype=on_site, objname=site)


def quaternion(R: Array) -> Array:
    """The quaternion (4,) w, x, y, z of a rotation (3, 3)."""
    out = np.empty(4)
    _mujoco().mju_mat2Quat(out, np.ascontiguousarray(R).ravel())
    return out


def _principal(inertia: Array) -> tuple[Array, Array]:
    """Moments (3,) and right-handed axes (3, 3) of an inertia matrix."""
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 2] *= -1
    return moments, axes


def _add_inertia(body: Any, inertia: Inertia) -> None:
    """The exact place and axes, with stand-ins for the numbers: MuJoCo refuses or changes some."""
    _, axes = _principal(inertia.inertia)
    body.explicitinertial = True
    body.mass, body.inertia = 1.0, np.ones(3)
    body.ipos, body.iquat = inertia.com, quaternion(axes)


def _set_inertias(model: Any, mechanism: Mechanism, bodies: Mapping[str, int]) -> None:
    for name, body in bodies.items():
        inertia = mechanism.links[name].inertia
        model.body_mass[body] = inertia.mass
        model.body_inertia[body] = _principal(inertia.inertia)[0]
    _refuse_massless(model)
    _mujoco().mj_setConst(model, _mujoco().MjData(model))


def _refuse_massless(model: Any) -> None:
    carried = model.body_mass + np.max(model.body_inertia, axis=1)
    for body in range(model.nbody - 1, 0, -1):
        carried[model.body_parentid[body]] += carried[body]
    empty = [
        model.joint(j).name.removeprefix("joint:")
        for j in range(model.njnt)
        if carried[model.jnt_bodyid[j]] <= 0.0 and model.dof_armature[model.jnt_dofadr[j]] <= 0.0
    ]
    if empty:
        raise InputError(f"joints {', '.join(empty)}: carry no mass, so they cannot be simulated")


def _coordinates(model: Any, mechanism: Mechanism, locked: set[str]) -> dict[str, int]:
    return {
        joint.name: int(model.joint(f"joint:{joint.name}").dofadr[0])
        for joint in mechanism.joints.values()
        if joint.kind != "fixed" and _master(joint) not in locked
    }
