#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The lines that tests reach: coverage.sh [TEST ...], all tests without one. Prints those of Python by
# file, then those of the core by header. A core that counts its lines is some times slower.
# Without REQUIRE_ROS=1 and what `make test-live` installs, the ROS 2 node and reader do not run.
set -euo pipefail
cd "$(dirname "$0")/.."
.venv/bin/python -m pip install --quiet --disable-pip-version-check --group coverage
[ -x build/coverage/bin/python ] || scripts/instrumented.sh coverage "-O1 --coverage"
# Programs that tests start count too. The name comes behind that of the packages' paths.
site=$(build/coverage/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
echo 'import os; "COVERAGE_PROCESS_CONFIG" in os.environ and __import__("coverage").process_startup()' \
  >"$site/started.pth"
find build/coverage/core -name '*.gcda' -delete
.venv/bin/python -m coverage erase
build/coverage/bin/python -m coverage run -m pytest "$@" || echo "some tests failed" >&2
.venv/bin/python -m coverage combine --quiet
.venv/bin/python -m coverage report --sort cover
# Billions of hits are real, and threads that count at the same time may leave a wrong number.
.venv/bin/gcovr --root core build/coverage/core --merge-lines --merge-mode-functions separate \
  --gcov-suspicious-hits-threshold 0 --gcov-ignore-parse-errors negative_hits.warn_once_per_file \
  --txt-metric line
