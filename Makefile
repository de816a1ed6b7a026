# Everything a newcomer needs: `make demo` and `make test` set up .venv by themselves.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# Tests run on every core; those of one xdist_group share what they have flown, in one process.
PYTEST := $(BIN)/python -m pytest --numprocesses logical --maxprocesses 8 --dist loadgroup

.PHONY: setup demo test test-slow test-all coverage mutants lint bench docs site clean

setup: $(READY)

$(READY): pyproject.toml requirements.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "swarmctl needs Python 3.11 or later; name one with make PYTHON=python3.11"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || \
	    { echo "Python's venv module is missing: apt install python3-venv"; exit 1; }
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

demo: setup
	$(BIN)/swarmctl demo

# A few minutes: all but Monte Carlo, many seeds and most whole flights.
test: setup
	$(PYTEST) -m "not slow"

# What `make test` leaves out. Whole flights in real time have the machine for themselves.
test-slow: setup
	$(PYTEST) -m "slow and not live"
	$(BIN)/python -m pytest -m "slow and live"

test-all: test test-slow

# The files that the quick tests do not cover wholly, with the lines and branches left out.
coverage: setup
	$(PYTEST) -m "not slow" --cov --cov-report=term-missing:skip-covered

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest tests/test_imports.py

bench: setup
	$(BIN)/python -m tests.benchmarks.bench_in_memory
	$(BIN)/python -m tests.benchmarks.bench_link
	$(BIN)/python -m tests.benchmarks.bench_backends
	$(BIN)/python -m tests.benchmarks.bench_filters
	$(BIN)/python -m tests.benchmarks.bench_tracker
	$(BIN)/python -m tests.benchmarks.bench_study
	$(BIN)/python -m tests.benchmarks.bench_designs
	$(BIN)/python -m tests.benchmarks.bench_vehicles

# Whether the quick tests notice changes in five critical modules: ten minutes on one core.
mutants: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --editable ".[mutants]"
	$(BIN)/python -m tests.mutants

docs: setup
	$(BIN)/python docs/generate.py
	rm -rf build/demo
	$(BIN)/swarmctl demo --in-memory --seed 1 --out build/demo
	cp build/demo/map.png docs/images/demo-map.png
	cp build/demo/error.png docs/images/demo-error.png
	for design in uniform paper regression worst_case optimal; do \
	    $(BIN)/swarmctl design --n 4 --design $$design --plot docs/images/design-$$design.png; \
	done
	$(BIN)/swarmctl study table1 --runs 200 --seed 0 --out build/table1
	cp build/table1/fig2_information.png docs/images/table1-fig2.png
	cp build/table1/fig5_position_error_std.png docs/images/table1-fig5.png
	cp build/table1/fig8_position_nrmse.png docs/images/table1-fig8.png
	cp build/table1/nees.png docs/images/table1-nees.png

site: setup
	$(BIN)/python -m sphinx -q -W --keep-going -E -b html docs build/site
	@echo "build/site/index.html"

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis .coverage .coverage.*
