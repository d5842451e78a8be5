# Two commands: `make fly` flies the Farm Survey, `make test` runs the tests.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: fly test lint docs training clean

fly: $(VENV)/.installed
	$(BIN)/aerodaas run apps/farm_survey.py --speed max

# One worker for each of two cores, with a Ray of its own. Slow tests run where CI is set, as
# continuous integration does; those that go by the wall clock afterwards, in two halves that leave
# each other time (tests/conftest.py). There one that met a busy machine is run once more, named, and
# counted as a rerun.
test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest --numprocesses 2 -m "$(if $(CI),not (slow and wall_clock),not slow)"
	$(if $(CI),$(BIN)/python -m pytest --numprocesses 2 -m "slow and wall_clock")

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-logo
	$(BIN)/mypy
	$(BIN)/pyright

# The documentation with its API reference, in site/index.html.
docs: $(VENV)/.installed-dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10) and "AeroDaaS needs Python 3.10 or newer; run: make PYTHON=python3.x")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[all]'
	@touch $@

$(VENV)/.installed-dev: pyproject.toml $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@

# PyTorch's own CPU build where there is one; only the tests of training need it.
training: $(VENV)/.installed-dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check 'torch==2.13.0' -e '.[dev,training]'

clean:
	rm -rf $(VENV) runs site
