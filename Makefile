# Python 3.11, 3.12 or 3.13: the first that is here, or one's own choice (make test PYTHON=python3.13). The default's
# environment is .venv, that of another .venv-3.13 and so on.
DEFAULT := $(firstword $(foreach python,python3.11 python3.12 python3.13,$(shell $(python) -c 'print("$(python)")' 2>&-)))
PYTHON ?= $(DEFAULT)
VERSION := $(shell $(PYTHON) -c 'import sys; print("%d.%d" % sys.version_info[:2])')
ifeq ($(filter 3.11 3.12 3.13,$(VERSION)),)
$(error Python 3.11, 3.12 or 3.13 is wanted, and $(or $(PYTHON),none of them) is $(or $(VERSION),not to be started): say which with PYTHON=python3.12)
endif
VENV := .venv$(if $(filter python$(VERSION),$(DEFAULT)),,-$(VERSION))
BIN := $(VENV)/bin
LOCK := requirements-$(VERSION).lock
STAMP := $(VENV)/lib/python$(VERSION)/.installed

.PHONY: run help test test-long lint docs setup lock bench clean bench-solver bench-paper

run: setup  ## plan, execute and measure the four-rooms mission
	$(BIN)/sva-bench run worlds/four-rooms.yaml

help:  ## these lines
	@sed -n 's/^\([a-z-]*\):[^#]*## \(.*\)/make \1\t\2/p' $(firstword $(MAKEFILE_LIST)) | expand -t 20

test: setup  ## the default test suite
	$(BIN)/python -m pytest -n 2

test-long: setup  ## everything, sweeps included
	$(BIN)/python -m pytest -n 2 -m "long or not long"

lint: setup  ## ruff and mypy
	$(BIN)/ruff check .
	$(BIN)/mypy

# Material's notice of its successor would stand above everything else: docs/development.md has it.
docs: setup  ## the pages of docs/ as a site, in site/; a broken link is an error
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

setup: $(STAMP)  ## the environment in .venv, and compiled code: three to six minutes, once

$(STAMP): $(LOCK) pyproject.toml
	$(PYTHON) -m venv $(if $(wildcard $(VENV)/lib/python$(VERSION)),,--clear) $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement $(LOCK)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@echo "compiling what is compiled, once: two to three minutes"
	# Before many processes want it at a time, and while no time limit waits for it: one mission and three instances
	# between them need every kernel but a few small ones.
	$(BIN)/sva-bench instance random --family B --pois 12 -o $(VENV)/warm-b.json
	$(BIN)/sva-bench instance random --pois 8 --directed | sed 's/"failure": "mission"/"failure": "per_leg"/' \
	  > $(VENV)/warm-legs.json
	$(BIN)/sva-bench instance random --pois 76 --seed 2 -o $(VENV)/warm-long.json
	(for kind in b legs long; do \
	  $(BIN)/sva-bench plan $(VENV)/warm-$$kind.json -o $(VENV)/warm-plan.json || exit 1; done) & \
	$(BIN)/sva-bench run worlds/three-robots.yaml --scenario S3 --interaction shared --policy resolve --trials 2 \
	  --rollouts 1 --workers 1 --out $(VENV)/warm-runs > $(VENV)/warm.log && wait $$!
	touch $@

lock:  ## pin the dependencies anew, for one Python: make lock PYTHON=python3.13
	$(PYTHON) -m venv --clear $(VENV)-lock
	$(VENV)-lock/bin/python -m pip install --quiet --disable-pip-version-check pip-tools
	$(VENV)-lock/bin/pip-compile --quiet --upgrade --extra dev --all-build-deps --allow-unsafe --generate-hashes \
	  --strip-extras --no-emit-index-url --no-emit-trusted-host --no-emit-find-links --no-annotate --no-header \
	  --output-file $(LOCK) pyproject.toml
	rm -r $(VENV)-lock

clean:  ## remove environments and caches
	rm -rf .venv .venv-* .mypy_cache .ruff_cache .pytest_cache .hypothesis

bench-solver: setup  ## the speed that the solver promises, by class: takes an hour
	$(BIN)/python -m benchmarks.solver.heuristic
	$(BIN)/python -m benchmarks.solver.classes

bench-paper: setup  ## a part of the paper's own table of runtimes: under ten minutes on an idle core
	$(BIN)/sva-bench reproduce runtimes

bench: setup  ## figures of docs/measured.md; see benchmarks/
	for file in travel_times physics maps recording solver_small batch; do $(BIN)/python benchmarks/$$file.py || exit 1; done
	$(BIN)/python -m benchmarks.noise --speed
	$(BIN)/python -m benchmarks.planners
	time $(BIN)/sva-bench run worlds/four-rooms.yaml
