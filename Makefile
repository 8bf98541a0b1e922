# make demo   a tractor tips over onto the ground array: loads in the terminal, recording in out/demo
# make test   lint, types, import rules, tests; first installs all optional packages that the tests use
# make docs   the documentation site in out/site, every warning an error
# Each sets everything up in .venv first (Python >= 3.11 with pip is all they need).

PYTHON ?= python3
UV := $(shell command -v uv 2>/dev/null || echo .tools/bin/uv)
READY := .venv/.ready
TESTED := .venv/.tested
GROUPS := --group formats --group oracle --group studies --group posterior --group browser --group docs
CORE := .venv/core

.PHONY: demo test test-core kernels docs view setup lint bench clean

demo: setup
	.venv/bin/rollover run side_overturn --set simulation.step=0.0005 --out out/demo --force
	@echo "Look at it with: .venv/bin/rollover view out/demo"

# what takes one core goes side by side; worksteal keeps a module's tests, and what they share, with one worker
# and tests start the program some hundred times, which compiles every source anew where the environment writes no bytecode
test: $(TESTED)
	@.venv/bin/python -m compileall -q -j 0 ground rollover viz tests
	@$(MAKE) --no-print-directory -j lint test-core
	.venv/bin/pytest -n auto --dist worksteal --strict-skips tests

# an environment without any optional package: what needs one says so in one line; its kernels are the same
test-core: kernels
	UV_PROJECT_ENVIRONMENT=$(CORE) $(UV) sync --locked --quiet --compile-bytecode --python $(PYTHON)
	NUMBA_CACHE_DIR="$$(.venv/bin/python -c 'from ground.compiled import KEPT; print(KEPT)')" \
	  $(CORE)/bin/pytest -q tests/core_only

# once, before the workers of the tests would compile the same at the same time
kernels: setup
	.venv/bin/python -m tests.kernels

docs: $(TESTED)
	.venv/bin/python docs/build.py out/site
	@echo "Look at it with a browser: out/site/index.html"

lint: setup
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy
	.venv/bin/lint-imports --no-logo

bench: setup
	$(UV) sync --locked --quiet --group benchmark
	.venv/bin/pytest -m benchmark tests/benchmarks -s

view: setup
	.venv/bin/rollover view out/demo

setup: $(READY)

$(READY): pyproject.toml uv.lock
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "rollover needs Python 3.11 or newer; name one with: make PYTHON=python3.12" >&2; exit 2; }
	@command -v $(UV) >/dev/null 2>&1 || $(PYTHON) -m pip install -q --disable-pip-version-check --root-user-action=ignore --target .tools 'uv==0.13.8'
	$(UV) sync --locked --quiet --compile-bytecode --python $(PYTHON)
	@touch $(READY)

$(TESTED): $(READY)
	$(UV) sync --locked --quiet --compile-bytecode --python $(PYTHON) $(GROUPS)
	@touch $(TESTED)

clean:
	rm -rf .venv .tools out
