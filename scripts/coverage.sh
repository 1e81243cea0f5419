#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The lines that tests reach: coverage.sh [TEST ...], all tests without one. Prints those of Python by
# file, then those of the core by header. A core that counts its lines is some times slower.
set -euo pipefail
cd "$(dirname "$0")/.."
.venv/bin/python -m pip install --quiet --disable-pip-version-check --group coverage
[ -x build/coverage/bin/python ] || scripts/instrumented.sh coverage "-O1 --coverage"
find build/coverage/core -name '*.gcda' -delete
.venv/bin/python -m coverage erase
build/coverage/bin/python -m coverage run -m pytest "$@" || echo "some tests failed" >&2
.venv/bin/python -m coverage combine --quiet
.venv/bin/python -m coverage report --sort cover
.venv/bin/gcovr --root core build/coverage/core --merge-lines --merge-mode-functions separate \
  --txt-metric line
