# SPDX-License-Identifier: Apache-2.0
"""Makes the arms that ship with Touchline: meshes, URDF and robot descriptions.

Run `python scripts/make_arms.py` from the repository. Beside Touchline's own dependencies it needs
`fast-simplification` (0.2), which nothing else uses; the files it writes are committed.
"""

import argparse
from pathlib import Path

import numpy as np
import trimesh
from arms import files
from arms.inertia import Body, uniform_body
from arms.kinematics import JOINTS, MASSES, MOVING, REACH
from arms.mesher import mesh_field
from arms.shapes import box, shells
from arms.trim import trims

TARGET = Path(__file__).resolve().parents[1] / "src" / "touchline" / "robots"
CELL = 0.0015
TRIANGLES = {"handle": 4000, "link7": 3000, "tool": 2800}


def make_shells(only: set[str] | None = None) -> dict[str, trimesh.Trimesh]:
    """The closed shell of every link, or of those named."""
    meshes = {}
    for name, shell in shells().items():
        if only is None or name in only:
            low, high = box(shell)
            triangles = TRIANGLES.get(name, 5000)
            meshes[name] = mesh_field(shell.field, low, high, CELL, triangles)
    return meshes


def save_stl(mesh: trimesh.Trimesh, path: Path) -> trimesh.Trimesh:
    """Writes binary STL and returns what a reader gets back."""
    path.parent.mkdir(parents=True, exist_ok=True)
    mesh.export(path, file_type="stl")
    return trimesh.load_mesh(path)


def make(target: Path) -> dict[str, Body]:
    """Writes everything below `target` and returns the links' mass properties."""
    meshes = target / "sara" / "meshes"
    bodies = {}
    for name, mesh in make_shells().items():
        bodies[name] = uniform_body(save_stl(mesh, meshes / f"{name}.stl"), MASSES[name])
    drawn = trims()
    for name, mesh in drawn.items():
        save_stl(mesh, meshes / f"{name}_trim.stl")
    files.write(target / "sara" / "sara.urdf", files.urdf(bodies, set(drawn)))
    files.write(target / "sara" / "simulation.yaml", files.simulation_yaml())
    for name in files.HEADERS:
        files.write(target / name / "robot.yaml", files.robot_yaml(name))
    return bodies


def print_table(bodies: dict[str, Body]) -> None:
    """Masses, centres and principal inertias, and the sums."""
    print(f"{'link':8}{'kg':>7}{'kg/m3':>8}   {'com [mm]':>22}   principal inertia [g m2]")
    for name, body in bodies.items():
        com = " ".join(f"{1e3 * c:7.1f}" for c in body.com)
        moments = " ".join(f"{1e3 * m:8.3f}" for m in np.linalg.eigvalsh(body.inertia))
        print(f"{name:8}{body.mass:7.2f}{body.density:8.0f}   {com}  {moments}")
    print(f"moving mass, links 1 to 7 and handle: {sum(bodies[n].mass for n in MOVING):.2f} kg")
    rise = {row.child: row.xyz[2] for row in JOINTS}
    reach = sum(rise[f"link{i}"] for i in range(3, 8)) + rise["tool"]
    print(f"axis 2 to flange {reach:.3f} m, to the tool's tip {REACH:.3f} m")


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=TARGET, help="directory of the robots")
    bodies = make(parser.parse_args().out)
    print_table(bodies)


if __name__ == "__main__":
    main()
