# Everything below sets itself up: the first command in a fresh clone may be any of these.
VENV   ?= .venv
PYTHON ?= python3
BIN    := $(VENV)/bin
MISSION ?= missions/v80_blade.yaml
# compiles the program and its inner loops, so that neither the first flight nor the first test waits for that
READY  := $(BIN)/python -m compileall -q mission devices flight vision && \
          $(BIN)/python -m mission.executive.ready missions/v80_blade.yaml

.PHONY: help run test check schema bench campaign clean

help:            ## this list
	@grep -E '^[a-z]+: .*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/'

$(VENV)/.run: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[sim]'
	@$(READY)
	@touch $@

$(VENV)/.dev: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -e '.[dev]'
	@$(READY)
	@touch $@ $(VENV)/.run

run: $(VENV)/.run   ## fly the default mission in the embedded simulator
	$(BIN)/mission run $(MISSION) $(ARGS)

test: $(VENV)/.dev  ## every test, about five minutes on two cores
	$(BIN)/python -m pytest -n 2 --dist loadgroup $(ARGS)

check: $(VENV)/.dev ## formatting, lint and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

schema: $(VENV)/.run ## bring the schema that editors check missions with up to date
	$(BIN)/mission schema > build.schema.json && mv build.schema.json mission/language/mission.schema.json

bench: $(VENV)/.dev ## speed and accuracy, with plots in logs/bench
	$(BIN)/python -m tests.bench $(ARGS)

campaign: $(VENV)/.dev ## many flights: blade angles, wind, faults
	$(BIN)/python -m tests.campaign $(ARGS)

clean:           ## remove the environment and caches
	rm -rf $(VENV) .pytest_cache .mypy_cache .ruff_cache build *.egg-info
	find . -name __pycache__ -prune -exec rm -rf {} +
