# SPDX-License-Identifier: Apache-2.0
# `make demo` and `make test` set up all they need in .venv first.
PYTHON := .venv/bin/python
CORE := $(shell find core -name '*.hpp' -o -name '*.cpp' -o -name 'CMakeLists.txt')

.PHONY: demo test check format clean

demo: .venv/demo
	.venv/bin/touchline demo $(ARGS)

test: .venv/ready
	$(PYTHON) -m pytest -n 2 --dist worksteal $(ARGS)

check: .venv/ready
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/pyright --pythonpath $(PYTHON)
	.venv/bin/lint-imports

format: .venv/ready
	.venv/bin/ruff check --fix .
	.venv/bin/ruff format .

clean:
	rm -rf .venv build

.venv/demo: pyproject.toml scripts/setup.sh $(CORE)
	scripts/setup.sh demo

.venv/ready: pyproject.toml scripts/setup.sh $(CORE)
	scripts/setup.sh
