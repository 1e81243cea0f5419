# SPDX-License-Identifier: Apache-2.0
"""The core as a library: installed, found by a project of a user, or as its subdirectory."""

import shutil
import subprocess
from pathlib import Path

import pytest
from program import COMPILER

import touchline as tl

CORE = Path(__file__).parents[2] / "core"
PROJECT = Path(__file__).parent / "external"
CMAKE = shutil.which("cmake")

pytestmark = pytest.mark.skipif(
    COMPILER is None or CMAKE is None, reason="no CMake or C++ compiler on this machine"
)


def cmake(*arguments):
    command = [str(CMAKE), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    path = tmp_path_factory.mktemp("exported") / "sara.touchline"
    tl.Pipeline(tl.load_robot("sara")).export(path)
    return path


def says(program, exported):
    return subprocess.run(
        [str(program), str(exported)], check=True, capture_output=True, text=True
    ).stdout.split()


def test_a_project_finds_the_installed_package(tmp_path, exported):
    cmake("-S", CORE, "-B", tmp_path / "core")
    cmake("--install", tmp_path / "core", "--prefix", tmp_path / "prefix")
    cmake("-S", PROJECT, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={tmp_path / 'prefix'}")
    cmake("--build", tmp_path / "build")
    assert says(tmp_path / "build" / "external", exported) == [tl.__version__, "7"]


def test_a_project_takes_it_as_a_subdirectory(tmp_path, exported):
    project = (PROJECT / "CMakeLists.txt").read_text()
    whole = f'add_subdirectory("{CORE}" touchline)'
    project = project.replace("find_package(touchline 0.1 REQUIRED)", whole)
    (tmp_path / "CMakeLists.txt").write_text(project)
    (tmp_path / "main.cpp").write_text((PROJECT / "main.cpp").read_text())
    cmake("-S", tmp_path, "-B", tmp_path / "build")
    cmake("--build", tmp_path / "build")
    assert says(tmp_path / "build" / "external", exported) == [tl.__version__, "7"]
