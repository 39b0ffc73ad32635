# Everything lives in .venv inside this checkout; the first call of any target creates it.
PYTHON ?= python3
WORKERS ?= 2
MINUTES ?= 10
SHARE ?= 1/1

VENV := .venv
BIN := $(VENV)/bin
RUN := $(BIN)/python
READY := $(VENV)/.ready
PACKAGES := stickslip corexy_jax experiments
PEERS := numba heyoka xpplab
# A file stays on one worker, whose caches and shared fits it fills once; the longest come first.
SUITE := $(RUN) -m pytest -q -n $(WORKERS) --dist loadfile --no-loadscope-reorder
# Shapes and types are checked at call time; a sixth of the time, so not in the quick suite.
TYPED := --jaxtyping-packages=stickslip,corexy_jax,beartype.beartype
# What a user's shell may hold that would let another installation leak into ours.
unexport PYTHONPATH PYTHONHOME PIP_TARGET PIP_PREFIX PIP_USER
# Without bytecode every process of the tests would compile all libraries for six seconds.
unexport PYTHONDONTWRITEBYTECODE
# The interpreters of a checkout keep their own side files in .venv too, not in the home directory.
export IPYTHONDIR := $(CURDIR)/$(VENV)/ipython
export JUPYTER_RUNTIME_DIR := $(CURDIR)/$(VENV)/jupyter
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export PIP_NO_INPUT := 1

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help setup demo figures results notebooks docs test test-more test-all faults attack bench lint lock clean distclean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## */  make \1\t/' | expand -t 20
	@echo
	@echo "PYTHON=python3.12 chooses the interpreter on first use, WORKERS=4 the test processes."

# An interpreter asked for by name must be the one that runs; without a name, an existing .venv is kept.
setup: $(READY) ## create or refresh .venv
ifneq ($(origin PYTHON),file)
	@wanted=$$($(PYTHON) -c 'import sys; print(sys.version.split()[0])') || exit 1; \
	found=$$($(RUN) -c 'import sys; print(sys.version.split()[0])'); \
	[ "$$wanted" = "$$found" ] || { \
	    echo "PYTHON=$(PYTHON) is Python $$wanted, but $(VENV) was made with $$found: run 'make distclean' first." >&2; exit 1; }
endif

$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	    echo "Python 3.11 or newer is needed, but '$(PYTHON)' is not: try 'make PYTHON=/path/to/python3.12 ...'." >&2; exit 1; }
	@echo "Installing into $(VENV), once (a minute or two) ..."
	@$(RUN) -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv --clear $(VENV)
	@$(RUN) -m pip install --quiet --no-compile --no-deps -r requirements.lock
	@$(RUN) -m pip install --quiet --no-deps --no-build-isolation -e .
	@touch $@

demo: setup ## the bifurcation diagram of the block on a belt: data and picture
	@$(RUN) -m experiments demo

figures: setup ## every figure of the papers at full resolution; resumes where it stopped
	@$(RUN) -m experiments all

results: setup ## take full runs from results/ into the repository, and write the pages from them
	@$(RUN) -m experiments record

notebooks: setup ## execute notebooks/*.py into notebooks/*.ipynb, all if the packages have changed; half an hour
	@$(RUN) notebooks/_site/execution.py

docs: setup ## the site, into build/docs: notebooks as `make notebooks` left them, else at quick size
	@$(RUN) -m sphinx -W --keep-going -n -q -j 1 -c notebooks/_site -d build/doctrees notebooks build/docs
	@echo "build/docs/index.html"

test: setup ## the quick suite
	@$(SUITE) -m "not slow and not more"

test-more: setup ## the quick suite and more, with shapes and types checked; SHARE=2/5 of the further tests
	@$(SUITE) -m "not slow" $(TYPED) --share=$(SHARE)

test-all: setup ## every test, the slow ones too, with shapes and types checked at call time
	@$(SUITE) $(TYPED)

faults: setup ## plant the faults of tests/faults one by one and say which the quick tests catch
	@$(RUN) -m tests.faults $(addprefix --only=,$(ONLY))

attack: setup ## random machines against a slow reference: SEED=1 MINUTES=10 WORKERS=2
	@$(RUN) -m tests.attack --minutes $(MINUTES) --workers $(WORKERS) $(addprefix --seed=,$(SEED)) $(addprefix --only=,$(ONLY))

bench: setup ## compare with the peers; those that cannot be installed are reported as absent
	@for peer in $(PEERS); do \
	    $(RUN) -m pip install --quiet --constraint requirements.lock "$$peer" \
	        || echo "$$peer could not be installed; going on without it." >&2; \
	done
	@$(RUN) -m experiments.benchmarks

lint: setup ## ruff and pyright
	@$(RUN) -m ruff check .
	@$(RUN) -m ruff format --check .
	@PYRIGHT_PYTHON_CACHE_DIR=$(CURDIR)/$(VENV)/pyright $(RUN) -m pyright

lock: setup ## resolve requirements.lock anew
	@$(RUN) -m pip install --quiet uv
	@$(BIN)/uv pip compile pyproject.toml --universal --python-version 3.11 --upgrade --quiet \
	    --extra test --extra notebooks --extra lint --extra docs --group build \
	    --no-emit-index-url --custom-compile-command "make lock" --output-file requirements.lock

clean: ## remove caches, keep .venv and results
	@rm -rf .pytest_cache .hypothesis .ruff_cache build dist
	@find $(PACKAGES) tests notebooks -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true

distclean: clean ## clean, and remove .venv
	@rm -rf $(VENV)
