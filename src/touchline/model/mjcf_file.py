# SPDX-License-Identifier: Apache-2.0
"""Compiling an MJCF that may name meshes which are not there."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from touchline.errors import InputError
from touchline.extras import need
from touchline.model.mesh_file import mesh_problem


@dataclass(frozen=True)
class LostMesh:
    """A geom left out because its mesh cannot be read; `body` is the name of its body.

    Where the file is not there, `missing_in` is the folder that should hold it.
    """

    body: str
    collides: bool
    problem: str
    missing_in: str | None


def compile_mjcf(path: Path) -> tuple[Any, list[LostMesh]]:
    """Return MuJoCo's model of the file without the geoms whose meshes cannot be read.

    Raises:
        InputError: MuJoCo's own message; or the mass of a body comes from a lost mesh.
    """
    mujoco: Any = need("mujoco")
    warnings: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warnings.append)  # else a log in the working directory gets them
    try:
        compiled = _compiled(mujoco, path)
    finally:
        mujoco.set_mju_user_warning(before)
    nan = [warning for warning in warnings if "NaN" in warning]
    if nan:
        raise InputError(f"{path}: {nan[0]}")
    return compiled


def _compiled(mujoco: Any, path: Path) -> tuple[Any, list[LostMesh]]:
    try:
        return mujoco.MjModel.from_xml_path(str(path)), []
    except ValueError as error:
        message = " ".join(str(error).split())
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        lost = _leave_out_meshes(spec, path)  # none where no geom is made of a missing mesh
        return spec.compile(), lost
    except InputError:
        raise
    except ValueError as error:
        message = " ".join(str(error).split())
    raise InputError(f"{path}: MuJoCo cannot read it: {message}") from None


def _leave_out_meshes(spec: Any, path: Path) -> list[LostMesh]:
    """Delete each mesh that cannot be read, and the geoms made of it; name nameless bodies."""
    lost, problems = [], []
    for index, body in enumerate(spec.bodies):
        body.name = body.name or f"body_{index}"
    for mesh in [mesh for mesh in spec.meshes if mesh.file]:
        # The model's folder is as given, maybe relative.
        found = Path(spec.modelfiledir or "") / (spec.meshdir or "") / mesh.file
        missing = not found.is_file()
        reason = f"no such file: {found}" if missing else mesh_problem(found)
        if reason is None:
            continue
        problem = f"mesh '{mesh.file}': {reason}"
        for geom in [geom for geom in spec.geoms if geom.meshname == mesh.name]:
            body = geom.parent
            if not body.explicitinertial and geom.mass != 0 and geom.density != 0:
                what = f"its mass comes from a mesh that cannot be read: {problem}"
                problems.append(f"{path}: body '{body.name}': {what}")
            collides = bool(geom.contype or geom.conaffinity)
            lost.append(
                LostMesh(body.name, collides, problem, str(found.parent) if missing else None)
            )
            spec.delete(geom)
        spec.delete(mesh)
    if problems:
        raise InputError(problems)
    return lost
