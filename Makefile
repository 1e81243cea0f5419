# SPDX-License-Identifier: Apache-2.0
# `make demo` and `make test` set up all they need in .venv first.
PYTHON := .venv/bin/python
CORE := $(shell find core -name '*.hpp' -o -name '*.cpp' -o -name 'CMakeLists.txt')

.PHONY: demo test test-live sanitize valgrind coverage check accept format docs wheels acceptance clean

demo: .venv/demo
	.venv/bin/touchline demo $(ARGS)

test: .venv/ready
	$(PYTHON) -m pytest -n 2 --dist worksteal $(ARGS)

# With real ROS 2, the public RTDE client and franky, which are large: 300 MB.
test-live: .venv/live
	REQUIRE_ROS=1 $(PYTHON) -m pytest -n 2 --dist worksteal tests/live $(ARGS)

# The core's programs under the address, undefined-behaviour and thread sanitizers.
SANITIZED := $(patsubst %,tests/core/test_%.py,cpp_example replay_example robot_file live_ring)
sanitize: .venv/ready
	$(PYTHON) -m pytest -n 2 $(SANITIZED) $(ARGS)

# Programs of the core under Valgrind, but for those with sanitizers, which do not run under it.
PROGRAMS := $(patsubst %,tests/core/test_%.py,cpp_example replay_example start_lanes mesh_around)
valgrind: .venv/ready
	RUN_UNDER="valgrind --quiet --leak-check=full --error-exitcode=1" $(PYTHON) -m pytest \
	  $(PROGRAMS) -k "not sanitized and not per_thread" $(ARGS)

# The lines of Python and of the core that tests reach: make coverage ARGS="tests/observer".
coverage: .venv/ready
	scripts/coverage.sh $(ARGS)

check: .venv/ready
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/pyright --pythonpath $(PYTHON)
	.venv/bin/lint-imports
	$(PYTHON) scripts/make_reference.py --check

# What recordings give now becomes the reference; `git diff` shows what has changed.
accept: .venv/ready
	$(PYTHON) tests/references/accept.py $(ARGS)

format: .venv/ready
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

docs: .venv/ready
	$(PYTHON) scripts/make_reference.py
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet

# For each Python from 3.11 on that is found; needs network for the build tools.
wheels:
	scripts/wheels.sh dist

# Eight robots in a fresh environment: make acceptance WHEEL=dist/touchline-...whl
acceptance:
	python3 scripts/acceptance.py $(WHEEL) $(ARGS)

clean:
	rm -rf .venv build dist site

.venv/demo: pyproject.toml scripts/setup.sh $(CORE)
	scripts/setup.sh demo

.venv/live: .venv/ready
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --group live
	touch $@

.venv/ready: pyproject.toml scripts/setup.sh $(CORE)
	scripts/setup.sh
