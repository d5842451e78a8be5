# Two commands: `make fly` flies the Farm Survey, `make test` runs the tests.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# One worker for each of two cores; the slowest tests are listed before one of them meets its time-out.
PYTEST := $(BIN)/python -m pytest --numprocesses 2 --durations=25 --durations-min=10

.PHONY: fly test test-all test-field bench lint mypy pyright docs console training lock audit licences matrix clean

fly: $(VENV)/.installed
	$(BIN)/aerodaas run apps/farm_survey.py --speed max

# The gate, which continuous integration runs: linters, types, and all tests but the slow ones.
test: lint
	$(PYTEST) -m "not slow and not sitl"

# All tests but those on real autopilots, both type checkers, and the golden flights; about two hours.
# Tests that go by the wall clock come last; one that met a busy machine runs once more and is counted.
CLOCK := slow and wall_clock
test-all: training lint mypy
	CI=true $(PYTEST) --hypothesis-profile full -m "not ($(CLOCK)) and not sitl"
	$(BIN)/python -m tools.golden
	CI=true $(PYTEST) -m "$(CLOCK) and not sitl"

# Real autopilots in simulation, which AERODAAS_SITL_PX4 and AERODAAS_SITL_ARDUPILOT name, mutants of what
# keeps a drone safe, and fuzzing.
SECONDS_OF_FUZZING ?= 1800
test-field: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -m sitl
	$(BIN)/python benchmarks/mutation.py aerodaas/mission/safety/supervisor.py --sample 40
	$(BIN)/python benchmarks/mutation.py aerodaas/mission/safety/setpoint_filter.py --sample 40
	$(BIN)/python -m tools.fuzz all --seconds $(SECONDS_OF_FUZZING) --jobs 2

# Speed and size beside what was committed last; the machine must have nothing else to do.
bench: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/all.py --json benchmarks/results.json

lint: $(VENV)/.installed-dev pyright
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo

mypy pyright: $(VENV)/.installed-dev
	$(BIN)/$@

# The documentation with its API reference, in site/index.html.
docs: $(VENV)/.installed-dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# The console's page from its source; what it says to a service is typed by the service's schema.
# What ships is committed, so that nobody else needs Node.
console: $(VENV)/.installed-dev
	$(BIN)/python -m tools.wire_schema
	cd console && npm ci --ignore-scripts --no-audit --no-fund && npm run build

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10) and "AeroDaaS needs Python 3.10 or newer; run: make PYTHON=python3.x")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[all]'
	@touch $@

# Exactly what requirements-dev.txt names, each file of which has one of the hashes there.
$(VENV)/.installed-dev: pyproject.toml requirements-dev.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-dev.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@ $(VENV)/.installed

# PyTorch's own CPU build where there is one; only the tests of training need it.
training: $(VENV)/.installed-dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch==2.13.0' -e '.[dev,training]'

# The newest versions that pyproject.toml allows, for all platforms and Pythons.
lock: $(VENV)/.installed-dev
	$(BIN)/uv pip compile pyproject.toml --extra dev --universal --python-version 3.10 --upgrade --quiet \
	  --generate-hashes --no-emit-index-url --no-annotate \
	  --custom-compile-command "make lock" --output-file requirements-dev.txt

# Known holes of what is locked, and of the oldest releases that our floors admit; asks a service on
# the network.
audit: $(VENV)/.installed-dev
	$(BIN)/uv tool run pip-audit --requirement requirements-dev.txt --disable-pip --strict
	$(BIN)/uv pip compile pyproject.toml --extra all --resolution lowest-direct --quiet \
	  --generate-hashes --output-file $(VENV)/floors.txt
	$(BIN)/uv tool run pip-audit --requirement $(VENV)/floors.txt --disable-pip --strict

licences: $(VENV)/.installed-dev
	$(BIN)/python -m tools.licences

# Installs the wheel for each Python from 3.10 to 3.13 that is found, and tests it.
matrix: $(VENV)/.installed-dev
	$(BIN)/python -m tools.matrix

clean:
	rm -rf $(VENV) runs site console/node_modules
