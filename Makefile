# Two commands: `make fly` flies the Farm Survey, `make test` runs the tests.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SLOWEST := $(if $(CI),--durations=25 --durations-min=20)

.PHONY: fly test bench lint mypy pyright docs console training lock audit licences matrix clean

fly: $(VENV)/.installed
	$(BIN)/aerodaas run apps/farm_survey.py --speed max

# One worker for each of two cores, with a Ray of its own. Slow tests run where CI is set, as
# continuous integration does; those that go by the wall clock afterwards. There one that met a busy
# machine is run once more, named, and counted as a rerun. Each part ends with its slowest tests,
# before one of them meets its time-out.
CLOCK := slow and wall_clock
test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest --numprocesses 2 -m "$(if $(CI),not ($(CLOCK)),not slow)" $(SLOWEST)
	$(if $(CI),$(BIN)/python -m pytest --numprocesses 2 -m "$(CLOCK)" $(SLOWEST))

# Speed and size beside what was committed last; the machine must have nothing else to do.
bench: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/all.py --json benchmarks/results.json

# The two type checkers, which take minutes, side by side.
lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo
	$(MAKE) --no-print-directory --jobs 2 --output-sync mypy pyright

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

# Known holes of what is locked; asks a service on the network.
audit: $(VENV)/.installed-dev
	$(BIN)/uv tool run pip-audit --requirement requirements-dev.txt --disable-pip --strict

licences: $(VENV)/.installed-dev
	$(BIN)/python -m tools.licences

# Installs the wheel for each Python from 3.10 to 3.13 that is found, and tests it.
matrix: $(VENV)/.installed-dev
	$(BIN)/python -m tools.matrix

clean:
	rm -rf $(VENV) runs site console/node_modules
