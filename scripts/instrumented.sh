#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes build/NAME/bin/python, which runs the package with a core that is compiled with FLAGS:
# instrumented.sh NAME FLAGS. All else is that of .venv. Compiling takes some minutes.
set -euo pipefail
cd "$(dirname "$0")/.."
place=build/$1
.venv/bin/python -m venv --without-pip "$place"
packages=$("$place/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
# The paths themselves: a .pth file in them, as that of .venv's own build, is not read.
.venv/bin/python -c 'import sys; print(*(p for p in sys.path if "site-packages" in p), sep="\n")' \
  >"$packages/packages.pth"
# With its extension's binaries where pip puts them, and the sources where they are.
PATH="$PWD/.venv/bin:$PATH" .venv/bin/python -m pip --python "$place/bin/python" install --quiet \
  --disable-pip-version-check --no-deps --no-build-isolation --editable . \
  -C build-dir="$place/core" -C cmake.build-type=Debug -C cmake.define.CMAKE_CXX_FLAGS="$2"
