# SPDX-License-Identifier: Apache-2.0
"""Packages that come with extras: what is missing is named with the extra that brings it."""

from importlib import import_module
from typing import Any

EXTRAS = {
    "mujoco": "sim",
    "scipy": "sim",
    "pyarrow": "logs",
    "rosbags": "logs",
    "threadpoolctl": "logs",
    "lz4": "logs",
    "backports": "logs",
    "trimesh": "meshes",
    "collada": "meshes",
    "matplotlib": "report",
    "PIL": "report",
    "viser": "view",
    "websockets": "view",
    "h5py": "hdf5",
    "fsspec": "fleet",
    "aiohttp": "fleet",
    "distributed": "fleet",
    "s3fs": "s3",
    "gcsfs": "gs",
    "rerun": "rerun",
    "foxglove": "foxglove",
    "pinocchio": "bench",
    "idyntree": "bench",
    "example_robot_data": "bench",
}


def missing(module: str) -> str | None:
    """How to install a missing module; None for one that belongs to no extra."""
    extra = EXTRAS.get(module.partition(".")[0])
    if extra is None:
        return None
    return f"{module} is not installed: pip install 'touchline[{extra}]'"


def need(module: str) -> Any:
    """Import a module of an extra.

    Raises:
        ModuleNotFoundError: with the extra that brings it.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        told = missing(error.name or "")
        raise ModuleNotFoundError(told or str(error), name=error.name) from None
