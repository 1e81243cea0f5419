# SPDX-License-Identifier: Apache-2.0
"""The committed arm and the script that makes it, for all tests of this directory."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

REPOSITORY = Path(__file__).resolve().parents[2]
ROBOTS = REPOSITORY / "src" / "touchline" / "robots"
sys.path.insert(0, str(REPOSITORY / "scripts"))


@pytest.fixture(scope="session")
def robots() -> Path:
    return ROBOTS


@pytest.fixture(scope="session")
def shells() -> dict[str, trimesh.Trimesh]:
    """The committed collision mesh of every link."""
    paths = sorted((ROBOTS / "sara" / "meshes").glob("*.stl"))
    return {p.stem: trimesh.load(p, force="mesh") for p in paths if not p.stem.endswith("_trim")}


def poses(q: np.ndarray) -> dict[str, np.ndarray]:
    """Pose (4, 4) of every link in world for the joint positions `q` (7,)."""
    from arms.kinematics import JOINTS

    result, remaining = {"base_mount": np.eye(4)}, list(q)
    for row in JOINTS:
        T = trimesh.transformations.euler_matrix(*row.rpy, axes="sxyz")
        T[:3, 3] = row.xyz
        if row.axis:
            T = T @ trimesh.transformations.rotation_matrix(remaining.pop(0), row.axis)
        result[row.child] = result[row.parent] @ T
    return result
