# Two commands: `make fly` flies the Farm Survey, `make test` runs the tests.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: fly test lint clean

fly: $(VENV)/.installed
	$(BIN)/aerodaas run apps/farm_survey.py --speed max

# Slow tests run where CI is set, as continuous integration does; there a test that flies by the
# wall clock and met a busy machine is run once more, and counted as such.
test: $(VENV)/.installed-dev
	$(BIN)/python -m pytest $(if $(CI),--reruns 1,-m "not slow")

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/pyright

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10) and "AeroDaaS needs Python 3.10 or newer; run: make PYTHON=python3.x")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@touch $@

$(VENV)/.installed-dev: pyproject.toml $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) runs
