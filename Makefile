PYTHON ?= python3.11
BIN := .venv/bin
STAMP := .venv/.installed

.PHONY: run test test-long lint setup lock bench clean bench-solver bench-paper

run: setup  ## plan, execute and measure the four-rooms mission
	$(BIN)/sva-bench run worlds/four-rooms.yaml

test: setup  ## the default test suite
	$(BIN)/python -m pytest -n 2

test-long: setup  ## everything, sweeps included
	$(BIN)/python -m pytest -n 2 -m "long or not long"

lint: setup
	$(BIN)/ruff check .
	$(BIN)/mypy

setup: $(STAMP)

$(STAMP): requirements.lock pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	# Compile the solver once, before many processes want it at a time; smaller instances never get to its pricing.
	$(BIN)/sva-bench instance random --family B --pois 12 -o .venv/warm.json
	$(BIN)/sva-bench plan .venv/warm.json -o .venv/warm-plan.json
	touch $@

lock: setup  ## pin the dependencies anew
	$(BIN)/python -m pip install --quiet --disable-pip-version-check pip-tools
	$(BIN)/pip-compile --quiet --extra dev --all-build-deps --allow-unsafe --generate-hashes --strip-extras \
	  --no-emit-index-url --no-emit-trusted-host --no-emit-find-links --no-annotate --no-header \
	  --output-file requirements.lock pyproject.toml

clean:
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .hypothesis

bench-solver: setup  ## the speed that the solver promises, by class: takes an hour
	$(BIN)/python -m benchmarks.solver.classes

bench-paper: setup  ## a part of the paper's own table of runtimes: under ten minutes on an idle core
	$(BIN)/sva-bench reproduce runtimes

bench: setup  ## figures of the README; see benchmarks/
	for file in travel_times physics maps recording solver_small batch; do $(BIN)/python benchmarks/$$file.py || exit 1; done
	$(BIN)/python -m benchmarks.planners
	time $(BIN)/sva-bench run worlds/four-rooms.yaml
