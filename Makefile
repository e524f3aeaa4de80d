# `make demo` runs the main job, `make test` the tests; each sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.ready

.PHONY: setup demo test test-oldest lint docs fuzz kill pathtraced clean

setup: $(STAMP)

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else f"epinet needs Python 3.11 or newer, {sys.executable} is {v[0]}.{v[1]}; try make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev,render,train]'
	@touch $@

demo: setup
	$(BIN)/epinet demo -o out/demo

# A process on each core, whose files' tests share what they prepare; torch on one thread in each.
test: setup
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest --numprocesses auto --dist loadfile

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The site, into build/site; `make docs` again after a change.
docs: setup
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo look at build/site/index.html

# Fast tests with the oldest versions that pyproject.toml allows, in an environment of its own (5 GB).
OLDEST := .venv-oldest
FAST := tests/commands/test_once.py tests/test_documents.py tests/test_terminal.py \
	tests/io/test_images.py tests/io/test_round_trip.py tests/io/test_camera_file.py tests/geometry \
	tests/effects tests/metrics tests/networks/test_weights.py tests/networks/test_epinet.py \
	tests/refine tests/predict/test_estimator.py tests/predict/test_result.py tests/benchmark/test_report.py

test-oldest: $(OLDEST)/.ready
	$(OLDEST)/bin/python -m pytest --disable-warnings $(FAST)

$(OLDEST)/.ready: pyproject.toml constraints-oldest.txt
	$(PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints-oldest.txt --editable . pytest hypothesis imageio opencv-python-headless
	@touch $@

# The long run of tests/fuzz, and kill -9 at random moments: docs/safety.md tells more.
fuzz: setup
	PYTHONPATH=.:tests/raw $(BIN)/python -m tests.fuzz $(FUZZ)

kill: setup
	$(BIN)/python -m tests.kill $(KILL)

# The second validation set, path-traced from free models; hours on 2 cores, continues where it stopped.
CACHE := $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/epinet
ASSETS := $(CACHE)/assets

pathtraced: setup
	mkdir -p $(ASSETS)
	$(BIN)/python -m pip download --quiet --no-deps --only-binary=:all: --python-version 3.11 --dest $(ASSETS) robosuite==1.5.2 scikit-image==0.26.0
	cd $(ASSETS) && { ls sweethome3d-furniture_*.deb >/dev/null 2>&1 || apt-get download sweethome3d-furniture; }
	$(BIN)/python -m epinet.synth.pathtraced $(CACHE)/pathtraced --assets $(ASSETS)

clean:
	rm -rf $(VENV) $(OLDEST) build out .pytest_cache .mypy_cache .ruff_cache
