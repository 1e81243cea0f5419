# SPDX-License-Identifier: Apache-2.0
"""MJCF through MuJoCo's own compiler, so that defaults, includes and inferred inertias are its own.

A body's frame moves by the product of its joints' motions about their anchors, in file order:
`T_parent_body(q) = T_parent_body(ref) * prod_i Trans(a_i) M_i(q_i - ref_i) Trans(-a_i)`
(MuJoCo, `mj_kinematics`). Each factor becomes a joint of ours: its child's frame has its origin on
the axis, and the last one is followed by a fixed joint back to the body's frame where they differ.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from touchline.errors import InputError
from touchline.model.mechanism import Array, Geometry, Inertia, Joint, Link, Mechanism, Mimic
from touchline.model.mjcf_file import LostMesh, compile_mjcf
from touchline.model.plausibility import mechanism_warnings
from touchline.model.topology import resolve_mimics
from touchline.model.transforms import joint_motion, move_points, pose, rotation_quaternion

REMEDIES = {
    "free": "the robot must stand on the world; take the <freejoint> out, and objects out of the "
    "robot's model",
    "ball": "replace it by three hinge joints on the same body",
}


def load_mjcf(path: Path | str) -> Mechanism:
    """Read an MJCF; its world is the root link, "world", and carries the world's geoms.

    Bodies are links; hinge and slide joints keep their names. Bodies with several joints get
    massless links BODY/JOINT between. Joint equalities become mimics.

    Raises:
        InputError: MuJoCo refuses the file, or it has free or ball joints.
    """
    path = Path(path)
    model, lost = compile_mjcf(path)
    reader = MjcfReader(model, lost)
    problems: list[str] = []
    for joint, kind, body in reader.unsupported():
        problems.append(f"{path}: body '{body}': {kind} joint '{joint}': {REMEDIES[kind]}")
    if problems:
        raise InputError(problems)
    links, joints = reader.tree()
    joints, notes = reader.couple(joints)

    def fault(where: str, what: str) -> None:
        problems.append(f"{path}: {where}: {what}")

    joints = resolve_mimics(joints, fault)
    if problems:
        raise InputError(problems)
    warnings = tuple(f"{path}: {note}" for note in notes)
    floating = None
    if reader.floating is not None:
        floating = model.body(model.jnt_bodyid[reader.floating]).name or "the first body"
    mechanism = Mechanism(reader.name, "world", links, joints, reader.gravity(), warnings, floating)
    return mechanism_warnings(mechanism, path)


class MjcfReader:
    """Reads the arrays of a compiled model; `lost` are the meshes that are not in it."""

    def __init__(self, model: Any, lost: Sequence[LostMesh] = ()):
        import mujoco

        self.lost = lost

        self.mujoco: Any = mujoco  # its stubs lack most names
        self.model = model
        self.name = model.names[: model.names.index(b"\0")].decode() or "mjcf"
        self.kinds = {
            int(self.mujoco.mjtJoint.mjJNT_HINGE): "revolute",
            int(self.mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
            int(self.mujoco.mjtJoint.mjJNT_FREE): "free",
            int(self.mujoco.mjtJoint.mjJNT_BALL): "ball",
        }
        self.floating = self._floating()

    def gravity(self) -> Array:
        """Return the acceleration of gravity (3,) in world [m/s2]; zero where it is disabled."""
        disabled = self.model.opt.disableflags & int(self.mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        return np.zeros(3) if disabled else self.model.opt.gravity.copy()

    def unsupported(self) -> Iterator[tuple[str, str, str]]:
        """Yield (joint, kind, body) of each joint that is neither hinge nor slide."""
        for index in range(self.model.njnt):
            kind = self.kinds[int(self.model.jnt_type[index])]
            if kind in REMEDIES and index != self.floating:
                yield self._joint_name(index), kind, self._body_name(self.model.jnt_bodyid[index])

    def _floating(self) -> int | None:
        """Return the free joint that carries all hinges and slides; None if there is none."""
        model = self.model
        kinds = [self.kinds[int(kind)] for kind in model.jnt_type]
        free = [index for index, kind in enumerate(kinds) if kind == "free"]
        moved = {
            int(model.body_rootid[model.jnt_bodyid[index]])
            for index, kind in enumerate(kinds)
            if kind != "free"
        }
        if len(free) != 1 or moved != {int(model.jnt_bodyid[free[0]])}:
            return None
        return free[0]

    def tree(self) -> tuple[dict[str, Link], dict[str, Joint]]:
        """Return the links and joints, each body after its parent."""
        links, joints = {"world": self._link(0)}, {}
        for body in range(1, self.model.nbody):
            between, chain = self._chain(body)
            links |= between
            links[self._body_name(body)] = self._link(body)
            joints |= {joint.name: joint for joint in chain}
        return links, joints

    def couple(self, joints: dict[str, Joint]) -> tuple[dict[str, Joint], list[str]]:
        """Return the joints with the equalities in them, and a note for each that is left out."""
        model, notes = self.model, []
        joint_kind = int(self.mujoco.mjtEq.mjEQ_JOINT)
        for index in map(int, np.flatnonzero(model.eq_active0)):
            name = model.equality(index).name or f"number {index + 1}"
            if int(model.eq_type[index]) != joint_kind:
                kind = (
                    self.mujoco.mjtEq(int(model.eq_type[index])).name.removeprefix("mjEQ_").lower()
                )
                notes.append(f"equality '{name}' ({kind}) is ignored; loops are not modelled")
                continue
            follower = self._joint_name(model.eq_obj1id[index])
            if np.any(model.eq_data[index, 2:5]):
                notes.append(f"equality '{name}': '{follower}' follows no straight line; ignored")
                continue
            joints = joints | {follower: self._follow(joints[follower], index)}
        return joints, notes

    def _follow(self, joint: Joint, index: int) -> Joint:
        """Return the joint bound by `y - y0 = a0 + a1 (x - x0)`; without x it is fixed."""
        model = self.model
        a0, a1 = model.eq_data[index, :2]
        own, master = model.eq_obj1id[index], model.eq_obj2id[index]
        y0 = self._reference(own)
        if master < 0:
            moved = joint.T_parent_joint @ joint_motion(joint.kind, joint.axis, y0 + a0)
            return replace(joint, kind="fixed", T_parent_joint=moved)
        offset = y0 + a0 - a1 * self._reference(master)
        return replace(joint, mimic=Mimic(self._joint_name(master), float(a1), float(offset)))

    def _chain(self, body: int) -> tuple[dict[str, Link], list[Joint]]:
        """Return the joints from the parent body to `body` and the massless links between them."""
        model, name = self.model, self._body_name(body)
        parent = self._body_name(model.body_parentid[body])
        T = pose(rotation_quaternion(model.body_quat[body]), model.body_pos[body])
        first = model.body_jntadr[body]
        indices = range(first, first + model.body_jntnum[body])
        between, chain = {}, []
        for index in () if self.floating in indices else indices:
            # A slide's axis has no place, so its child keeps the body's origin.
            hinge = self.kinds[int(model.jnt_type[index])] == "revolute"
            anchor = model.jnt_pos[index] if hinge else np.zeros(3)
            last = index == indices[-1] and not anchor.any()
            child = name if last else f"{name}/{self._joint_name(index)}"
            chain.append(self._joint(index, parent, child, T @ pose(p=anchor)))
            if last:
                return between, chain
            between[child] = Link(child, Inertia.zero(), virtual=True)
            parent, T = child, pose(p=-anchor)
        chain.append(Joint(f"{name}/fixed", "fixed", parent, name, T))
        return between, chain

    def _joint(self, index: int, parent: str, child: str, T_reference: Array) -> Joint:
        """Return the joint; the file's pose is the one at its reference position."""
        model = self.model
        kind, axis = self.kinds[int(model.jnt_type[index])], model.jnt_axis[index].copy()
        T = T_reference @ joint_motion(kind, axis, -self._reference(index))
        limits = _range(model.jnt_limited, model.jnt_range, index)
        effort = _range(model.jnt_actfrclimited, model.jnt_actfrcrange, index)[1]
        name = self._joint_name(index)
        return Joint(name, kind, parent, child, T, axis, *limits, effort=effort)

    def _link(self, body: int) -> Link:
        model, name = self.model, self._body_name(body)
        R = rotation_quaternion(model.body_iquat[body])
        inertia = R @ np.diag(model.body_inertia[body]) @ R.T
        first = model.body_geomadr[body]
        shapes: dict[bool, list[Geometry]] = {True: [], False: []}
        for geom in range(first, first + model.body_geomnum[body]):
            shape = self._geometry(geom)
            if shape is not None:
                shapes[bool(model.geom_contype[geom] | model.geom_conaffinity[geom])].append(shape)
        for mesh in self.lost:
            if mesh.body == model.body(body).name:
                shape = Geometry(
                    "mesh", np.eye(4), problem=mesh.problem, missing_in=mesh.missing_in
                )
                shapes[mesh.collides].append(shape)
        mass = Inertia(float(model.body_mass[body]), model.body_ipos[body].copy(), inertia)
        return Link(name, mass, tuple(shapes[True]), tuple(shapes[False]))

    def _geometry(self, geom: int) -> Geometry | None:
        model, kinds = self.model, self.mujoco.mjtGeom
        T = pose(rotation_quaternion(model.geom_quat[geom]), model.geom_pos[geom])
        kind, size = int(model.geom_type[geom]), model.geom_size[geom]
        if kind == int(kinds.mjGEOM_MESH):
            return self._triangles(model.geom_dataid[geom], T)
        primitives: dict[int, tuple[str, Callable[[], tuple]]] = {
            int(kinds.mjGEOM_BOX): ("box", lambda: tuple(2 * size)),
            int(kinds.mjGEOM_SPHERE): ("sphere", lambda: (size[0],)),
            int(kinds.mjGEOM_CAPSULE): ("capsule", lambda: (size[0], 2 * size[1])),
            int(kinds.mjGEOM_CYLINDER): ("cylinder", lambda: (size[0], 2 * size[1])),
            int(kinds.mjGEOM_ELLIPSOID): ("ellipsoid", lambda: tuple(size)),
        }
        if kind not in primitives:  # planes and height fields are the surroundings
            return None
        name, measure = primitives[kind]
        return Geometry(name, T, tuple(map(float, measure())))

    def _triangles(self, mesh: int, T: Array) -> Geometry:
        """Return a mesh's triangles in the link frame; `geom_pos` holds MuJoCo's recentring."""
        model = self.model
        start, faces = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        vertices = model.mesh_vert[start : start + model.mesh_vertnum[mesh]].astype(float)
        triangles = model.mesh_face[faces : faces + model.mesh_facenum[mesh]].astype(np.int64)
        vertices = move_points(vertices, T)
        return Geometry("triangles", np.eye(4), vertices=vertices, faces=triangles)

    def _reference(self, joint: int) -> float:
        return float(self.model.qpos0[self.model.jnt_qposadr[joint]])

    def _joint_name(self, index: int) -> str:
        return self.model.joint(index).name or f"joint_{index}"

    def _body_name(self, index: int) -> str:
        return self.model.body(index).name or f"body_{index}"


def _range(limited: Array, ranges: Array, index: int) -> tuple[float, float]:
    if not limited[index]:
        return -np.inf, np.inf
    lower, upper = ranges[index]
    return float(lower), float(upper)
