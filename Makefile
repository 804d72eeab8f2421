# make setup | dev | demo | serve | test | robustness | format | openapi | lock | docs | dist | bench | world | franka | clean
PYTHON ?= python3
# Modules are compiled when they are first imported: most never are, and all of them take a minute.
NO_COMPILE := --no-compile
BIN := .venv/bin
# uv installs in a fifth of pip's time. It does not read pip's settings: where it does not reach a registry, pip installs.
install = UV_HTTP_TIMEOUT=10 UV_HTTP_RETRIES=1 $(BIN)/uv pip install --quiet --python $(BIN)/python --require-hashes --requirement $(1) \
	2> /dev/null || $(BIN)/python -m pip install --quiet $(NO_COMPILE) --require-hashes --requirement $(1)
STAMP := .venv/.installed
DEV_STAMP := .venv/.installed-dev

# Some machines forbid it: then each of the many processes that tests start compiles the whole app, half a second each.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: setup dev demo serve test robustness format openapi lock docs dist bench world franka clean

setup: $(STAMP)

$(STAMP): requirements.lock pyproject.toml client/pyproject.toml
	@echo "1 of 3: makes the virtual environment .venv"
	@$(PYTHON) -m venv .venv
	@echo "2 of 3: installs the $$(grep -c == requirements.lock) packages of requirements.lock, up to two minutes"
	@sed -n '/^uv==/,/[^\\]$$/p' requirements-dev.lock > .venv/uv.lock
	@$(BIN)/python -m pip install --quiet $(NO_COMPILE) --require-hashes --requirement .venv/uv.lock || true
	@$(call install,requirements.lock)
	@echo "3 of 3: installs RoboPrompt itself"
	@$(BIN)/python -m pip install --quiet $(NO_COMPILE) --no-deps --no-build-isolation --editable ./client
	@$(BIN)/python -m pip install --quiet $(NO_COMPILE) --no-deps --no-build-isolation --editable .
	@touch $(STAMP)

dev: $(DEV_STAMP)

$(DEV_STAMP): requirements-dev.lock $(STAMP)
	@echo "For developers: installs what requirements-dev.lock has beyond it, a minute"
	@$(call install,requirements-dev.lock)
	@touch $(DEV_STAMP)

demo: setup
	$(BIN)/roboprompt demo

serve: setup
	$(BIN)/roboprompt serve

# What takes long and fails seldom: hostile requests and files, trouble and crashes, several workers and LLM processes, everyday objects
# in pictures, files of models, benchmarks, container and supply chain checks. The longest files first, so that none is left at the end.
ROBUSTNESS := tests/perception/registered/test_find.py tests/llm/test_one_answer.py \
	tests/llm/test_embedded.py tests/llm/test_anthropic.py tests/sim/test_cameras.py \
	tests/evaluation/test_composition.py tests/test_wheels.py tests/evaluation/test_vision.py tests/evaluation/test_sweep_run.py \
	tests/e2e/test_workers.py tests/llm/test_weights.py tests/llm/test_vocabulary.py \
	tests/e2e/test_labels.py tests/perception/registered/test_learn.py \
	benchmarks tests/reliability tests/e2e/test_extremes.py tests/test_docker.py tests/test_no_pickles.py \
	tests/test_supply_chain.py  tests/e2e/test_secrets.py
# One process more than cores, as some tests wait; each takes up to 1.5 GB of memory.
PROCESSES := $(shell cores=$$(nproc 2> /dev/null || echo 2); echo $$((cores < 7 ? cores + 1 : 8)))
PYTEST := $(BIN)/python -m pytest --numprocesses $(PROCESSES) --dist loadfile --no-loadscope-reorder

# Types are checked beside the tests, which wait for other processes now and then. Tests are collected once beforehand where nothing is
# compiled yet: each of the processes would compile it all.
test: dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@test -d tests/__pycache__ || $(BIN)/python -m pytest --collect-only --quiet > /dev/null
	@$(BIN)/mypy & types=$$!; $(PYTEST) $(ROBUSTNESS:%=--ignore=%); tests=$$?; wait $$types && exit $$tests

robustness: dev docs
	$(PYTEST) $(ROBUSTNESS)

# The site that the service has at /docs/guide. Fails where a link leads nowhere (not with --quiet: then warnings are lost).
# The same commit gives the same bytes.
COMMIT_TIME = $(shell git log -1 --format=%ct 2> /dev/null || echo 315532800)

docs: dev
	@SOURCE_DATE_EPOCH=$(COMMIT_TIME) $(BIN)/properdocs build --strict

# Both wheels, what they consist of, and from what they were built: docs/supply-chain.md.
dist: dev docs
	$(BIN)/python .ci/dist

format: dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

openapi: setup
	$(BIN)/python -c "import json; from app.asgi import app; print(json.dumps(app.openapi(), indent=2, sort_keys=True))" \
		> openapi/openapi.json

# Versions and hashes only: the lock names no package registry, and not our own package in client/. Pins stay where they are
# unless UPGRADE=--upgrade says otherwise.
COMPILE := $(BIN)/uv pip compile --universal --python-version 3.11 --generate-hashes --no-annotate --no-header \
	--no-emit-index-url --no-emit-package roboprompt-client --quiet $(UPGRADE)
LOCK := $(COMPILE) pyproject.toml --extra sim --extra datasets --group editable

lock:
	$(LOCK) --group dev --output-file requirements-dev.lock
	$(LOCK) --constraint requirements-dev.lock --output-file requirements.lock
	$(COMPILE) pyproject.toml --extra postgres --extra s3 --constraint requirements-dev.lock \
		--output-file docker/server.lock
	$(COMPILE) docker/build.in --constraint requirements-dev.lock --output-file docker/build.lock
	for world in $(WORLDS); do $(COMPILE) client/pyproject.toml benchmarks/$$world/requirements.in \
		--output-file benchmarks/$$world/requirements.txt || exit 1; done
	$(COMPILE) client/tests/libfranka/requirements.in --constraint requirements-dev.lock \
		--output-file client/tests/libfranka/requirements.txt
	$(COMPILE) client/tests/realsense/requirements.in --output-file client/tests/realsense/requirements.txt

bench: dev
	$(BIN)/python -m benchmarks.bench

# Benchmarks of others, each in an environment of its own: they pin another mujoco or numpy than the simulated Panda needs.
# make world WORLD=metaworld OPTIONS="--task push --method nearest"; WORLD is one of WORLDS.
# Recordings of people: ROBOSUITE_RECORDINGS=folder make world WORLD=robosuite OPTIONS="--task lift_by_people --demos 8"
WORLDS := metaworld robosuite fetch libero
WORLD := metaworld

benchmarks/%/.venv/.installed: benchmarks/%/requirements.txt
	$(PYTHON) -m venv benchmarks/$*/.venv
	benchmarks/$*/.venv/bin/python -m pip install --quiet --require-hashes --requirement $<
	touch $@

world: setup benchmarks/$(WORLD)/.venv/.installed
	$(BIN)/python -m app.cli eval --world benchmarks.$(WORLD).world $(OPTIONS)

# A Franka arm through libfranka's own protocol, simulated, and a RealSense camera on librealsense's own software device (on
# Debian it needs libusb-1.0-0). What they need is installed beside the rest.
DEVICES := client/tests/libfranka client/tests/realsense

franka: dev
	@for device in $(DEVICES); do \
		$(BIN)/python -m pip install --quiet $(NO_COMPILE) --require-hashes --requirement $$device/requirements.txt || exit 1; done
	$(BIN)/python -m pytest --config-file client/pyproject.toml $(DEVICES)

clean:
	rm -rf .venv $(WORLDS:%=benchmarks/%/.venv) .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
