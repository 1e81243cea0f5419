# SPDX-License-Identifier: Apache-2.0
"""Installs launch file and RViz configuration; the node itself is `touchline.live.node`."""

from setuptools import setup

NAME = "touchline_ros"
setup(
    name=NAME,
    version="0.1.0",
    packages=[],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/touchline.launch.py"]),
        (f"share/{NAME}/rviz", ["rviz/touchline.rviz"]),
    ],
    install_requires=["setuptools", "touchline"],
    license="Apache-2.0",
)
