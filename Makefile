# Two commands do everything: `make demo` runs the main job, `make test` passes the tests.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.DEFAULT_GOAL := help
.PHONY: help setup demo report readme api docs picture notebook notebook-data notebook-seeds calibrate coverage kills fuzz stress mutations test thorough check lint format types fast lowest versions package container-test lock clean

help: ## Show the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/\t/' | expand -t 16

# --no-compile: Python makes what is imported as it is imported, a tenth of all that is installed
$(READY): pyproject.toml requirements/dev.txt
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if (3, 11) <= v <= (3, 14) else "hybridtof needs Python 3.11 to 3.14; name one with make PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check --require-hashes -r requirements/dev.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $(READY)

setup: $(READY) ## Create .venv with the locked dependencies

demo: $(READY) ## Readings to distances through the running service: a table, out/demo.png
	$(BIN)/hybridtof demo --out out

report: $(READY) ## Error against run time of every method: a table, out/report.html, .md, .json, .png
	$(BIN)/hybridtof report --quick --out out

readme: $(READY) ## Write the table of techniques in docs/techniques.md anew
	$(BIN)/python -m service.technique_table docs/techniques.md

api: $(READY) ## Write docs/api.md from the docstrings anew
	$(BIN)/python docs/make_api.py > docs/api.md

docs: $(READY) ## The documentation as a site, out/docs/docs/index.html; a warning is an error
	$(BIN)/sphinx-build --fail-on-warning --keep-going --fresh-env --quiet -b html -c docs . out/docs
	@echo "out/docs/docs/index.html"

picture: $(READY) report ## Make the README's pictures anew
	$(BIN)/hybridtof demo --out docs
	cp out/report.png docs/report.png

notebook: $(READY) ## Run all notebooks and store their outputs
	$(BIN)/jupyter-execute --inplace notebooks/*.ipynb

notebook-seeds: $(READY) ## Notebooks over 20 seeds: how often their intervals hold the truth; goes on where it stopped
	$(BIN)/python -m benchmarks.notebook_truth --out out/notebooks

notebook-data: $(READY) ## Make the notebook's frames anew
	$(BIN)/hybridtof simulate --scene notebooks/simulated.json --from-m 0.15 --to-m 1.2 --frames 30 --spacing log --seed 7 --output notebooks/frames.csv > /dev/null

calibrate: $(READY) ## Simulation-based calibration: goes on where it stopped, then docs/calibration.png
	$(BIN)/python -m benchmarks.calibration --workers 2

coverage: $(READY) ## Intervals against exact optics, recorded photons and paths: goes on where it stopped
	$(BIN)/python -m benchmarks.coverage --workers 2
	$(BIN)/python -m benchmarks.coverage.path_study --sets 50 --random 500

kills: $(READY) ## Kill services and workers 50 times during 20 posteriors: SQLite, PostgreSQL, Dask
	$(BIN)/python -m benchmarks.kills
	$(BIN)/python -m benchmarks.kills --postgres
	$(BIN)/python -m benchmarks.kills --dask

fuzz: $(READY) ## 2,000 requests a route by schemathesis, 10,000 bodies a route that are nearly valid
	$(BIN)/python -m benchmarks.fuzz

stress: $(READY) ## Extreme and stiff cases against exact arithmetic, 100,000 frames: the table of docs/stability.md
	$(BIN)/python -m benchmarks.stability
	$(BIN)/python -m benchmarks.certified_integrals
	$(BIN)/python -m benchmarks.stress_posteriors --out out/stress

mutations: $(READY) ## Plant faults in a copy of the source, one at a time: which tests notice; goes on where it stopped
	$(BIN)/python -m benchmarks.mutations

# every process of the tests would compile all that it imports: a second more for a service
unexport PYTHONDONTWRITEBYTECODE

# two processes on two cores: a library that starts threads of its own only makes them wait
notebook-seeds calibrate coverage stress test thorough fast: export OPENBLAS_NUM_THREADS = 1

test: $(READY) ## Run the tests
	$(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder

thorough: $(READY) ## Run all tests, with those and all data sets that `make test` leaves out
	TESTS_THOROUGH=1 $(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder

fast: $(READY) ## Run the tests that take seconds
	$(BIN)/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder -m "not slow"

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(READY) ## Format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

types: $(READY)
	$(BIN)/mypy

check: lint types fast ## Lint, types, fast tests

clean: ## Remove what the targets made
	rm -rf $(VENV) build dist out *.egg-info .mypy_cache .ruff_cache .pytest_cache

lowest: ## Run the tests that take seconds with the lowest versions that pyproject.toml states (needs uv)
	uv venv --quiet --clear --python $(PYTHON) out/lowest
	uv pip compile pyproject.toml --python out/lowest/bin/python --all-extras --resolution lowest-direct --quiet --no-header --no-annotate --output-file out/lowest.txt
	uv pip install --quiet --python out/lowest/bin/python --requirements out/lowest.txt
	uv pip install --quiet --python out/lowest/bin/python --no-deps --no-build-isolation --editable .
	NUMBA_CACHE_DIR=$(CURDIR)/out/lowest/kernels out/lowest/bin/python -m pytest -n 2 --dist loadscope --no-loadscope-reorder -m "not slow" $(LOWEST)

versions: ## Run the tests that take seconds on Python 3.11 to 3.14 (needs uv, and finds or fetches these)
	for version in 3.11 3.12 3.13 3.14; do \
		made=out/python-$$version; python=$$made/bin/python; \
		uv venv --quiet --clear --python $$version $$made && \
		uv pip install --quiet --python $$python --require-hashes --requirements requirements/dev.txt && \
		uv pip install --quiet --python $$python --no-deps --no-build-isolation --editable . && \
		NUMBA_CACHE_DIR=$(CURDIR)/$$made/kernels $$python -m pytest -n 2 --dist loadscope --no-loadscope-reorder -m "not slow" || exit 1; \
	done

package: ## Build wheel and sdist, install each where nothing else is, and answer from another folder (needs uv)
	rm -rf out/package
	uv build --quiet --python $(PYTHON) --out-dir out/package
	cp notebooks/frames.csv notebooks/simulated.json out/package
	for made in out/package/*.whl out/package/*.tar.gz; do \
		uv venv --quiet --clear --python $(PYTHON) out/package/env && \
		uv pip install --quiet --python out/package/env/bin/python $$made && \
		(cd out/package && env/bin/python -P -c "import hybridtof; print(hybridtof.__file__)" && \
		env/bin/hybridtof estimate frames.csv --scene simulated.json --quiet) || exit 1; \
	done

container-test: $(READY) ## Build the image, run the suite inside it, and ask it for a first answer (docker, podman or buildah)
	$(BIN)/python -m benchmarks.container $(CONTAINER)

lock: ## Resolve the dependencies anew into requirements/ (needs uv)
	uv pip compile pyproject.toml --extra postgres --extra cluster --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --no-annotate --output-file requirements/runtime.txt
	uv pip compile pyproject.toml --extra postgres --extra plots --extra notebooks --extra cluster --extra docs --extra dev --universal --python-version 3.11 --generate-hashes --no-emit-index-url --no-header --no-annotate --output-file requirements/dev.txt
