# Every target has one line after '##'; plain `make` prints them.
SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

PYTHON ?= python3# the interpreter that makes the virtual environment: 3.11 or newer
VENV   ?= .venv

BIN    := $(VENV)/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
STAMPS := $(VENV)/stamps# in the environment, so that both go together
UV     := $(BIN)/uv pip install --quiet --python $(BIN)/python

export PYO3_PYTHON := $(abspath $(BIN)/python)# one interpreter for every cargo call, so that nothing is built twice
export VIRTUAL_ENV := $(abspath $(VENV))# where maturin installs
unexport PYTHONDONTWRITEBYTECODE# hundreds of commands that tests start import the same packages

# With the interpreter's description that maturin leaves, cargo's own calls compile nothing twice.
CARGO   = $(addprefix PYO3_CONFIG_FILE=,$(firstword $(shell ls $(CURDIR)/target/maturin/pyo3-config-*.txt 2> /dev/null))) cargo
TIER   ?= test# of the tests: quick, test or all
SIDE_BY_SIDE = $(MAKE) --no-print-directory --jobs=2 --output-sync
MODULE := $(or $(wildcard $(STAMPS)/release),$(STAMPS)/core)# as it is installed, or for development

.PHONY: help demo quick test test-all check lint types deny format stub test-rust test-python same-bits wheel extras sizes docs bench benchmark chart chart-gpu policies stability torture film pace validate validate-sand orders bits instructions profiles train train-rllib ray ros-peer pins clean

help: ## list the targets (this list)
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: ## set up, drive Rover-v0 to a goal, plot the drive, redraw the report's sections 6.1 and 6.2, write a replay page, under runs/
	@$(SIDE_BY_SIDE) $(STAMPS)/core $(STAMPS)/debian-demo
	$(BIN)/rover report --figures --output runs/report & report=$$!; \
	rm -rf runs/drive && $(BIN)/rover drive --output runs/drive && \
	$(BIN)/rover plot runs/drive/episode-0.h5 --output runs/drive/plots && \
	$(BIN)/rover replay runs/drive/episode-0.h5 --html runs/replay.html && wait $$report

quick: $(STAMPS)/core $(STAMPS)/test ## while editing: formatting, lint of Python, the core's tests and the fastest Python tests (90 seconds once built)
	cargo fmt --all --check
	$(BIN)/ruff check --quiet
	$(BIN)/ruff format --quiet --check
	@$(SIDE_BY_SIDE) test-rust pytest-quick

pytest-quick:
	$(BIN)/pytest --quiet --numprocesses 1 --tier quick

test: ## set up, and run the tests that a change must pass, Rust and Python side by side
	@$(SIDE_BY_SIDE) $(STAMPS)/library $(STAMPS)/test $(STAMPS)/debian-demo $(STAMPS)/debian-test
	@$(SIDE_BY_SIDE) test-rust test-python

# One part goes on after another has failed; the last lines tell how each ended.
PARTS = lint types deny docs test-rust test-python torture same-bits train-rllib

test-all: ## every test there is, as long as it takes, and a table of its parts: before a release, and before an issue is closed
	@failed=0; table=; for part in $(PARTS); do \
	  begin=$$SECONDS; ended=passed; \
	  $(MAKE) --no-print-directory $$part TIER=all TORTURE="--rounds 1 --no-table" || { ended=failed; failed=1; }; \
	  table+=$$(printf '%-12s %s %6d s' $$part $$ended $$((SECONDS - begin)))$$'\n'; \
	done; printf '\n%s' "$$table"; exit $$failed

check: lint types deny ## lint, types, licences and sources, Rust and Python: what the commit hooks call, and with docs .ci/run after the tests

lint: $(STAMPS)/test ## formatting and lint, Rust and Python
	cargo fmt --all --check
	$(CARGO) clippy --workspace --all-targets --locked --quiet -- -D warnings
	$(BIN)/ruff check
	$(BIN)/ruff format --check

types: $(STAMPS)/test $(STAMPS)/core ## mypy, and the stub against the compiled module
	$(BIN)/mypy
	MYPYPATH=envs $(BIN)/stubtest --mypy-config-file rust/python/stubtest.ini --allowlist rust/python/stubtest_allowlist.txt rover_gym._core

deny: ## licences, bans and sources of the crates, without the network, where cargo-deny is installed
	@if command -v cargo-deny > /dev/null; then cargo deny --offline --log-level error check licenses bans sources; \
	else echo "NOT CHECKED: licences, bans and sources of the crates; get cargo-deny with: cargo install --locked cargo-deny"; fi

format: $(STAMPS)/test ## rewrite the sources as the linters want them
	cargo fmt --all
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

stub: $(STAMPS)/test $(STAMPS)/core ## write the stub of the compiled module from its types, rust/python/types.pyi
	$(BIN)/python rust/python/stub.py
	$(BIN)/ruff format --quiet envs/rover_gym/_core.pyi
	$(BIN)/ruff check --quiet --fix envs/rover_gym/_core.pyi

# Properties are tried on the same cases in every fast run, and on new ones in a run of all tests.
SAME_CASES = $(if $(filter all,$(TIER)),,PROPTEST_RNG_SEED=1)
OF_DOCS    = tests/browser/test_manual.py# builds the manual, which make docs does
SAME_DRAWS = $(if $(filter all,$(TIER)),,--hypothesis-seed=1)

test-rust: ## the Rust tests only (of tier all with checks of arithmetic)
	$(if $(filter all,$(TIER)),CARGO_PROFILE_DEV_DEBUG_ASSERTIONS=true CARGO_PROFILE_DEV_OVERFLOW_CHECKS=true) $(SAME_CASES) $(CARGO) test --workspace --tests --locked --quiet -- $(if $(filter all,$(TIER)),--include-ignored)

test-python: $(STAMPS)/test $(STAMPS)/core $(STAMPS)/fmu $(STAMPS)/debian-demo $(STAMPS)/debian-test $(if $(filter all,$(TIER)),ray $(if $(filter Linux-x86_64,$(shell uname -sm | tr ' ' -)),ros-peer)) ## the Python tests only, and the longest ten
	$(BIN)/pytest --numprocesses auto --tier $(TIER) --durations 10 $(SAME_DRAWS) $(if $(filter test,$(TIER)),--ignore $(OF_DOCS))

same-bits: $(STAMPS)/test $(MODULE) ## compare the bits of the development build and of the build that is shipped with the committed ones
	$(MAKE) --no-print-directory $(STAMPS)/core
	$(MAKE) --no-print-directory bits
	$(MAKE) --no-print-directory $(STAMPS)/release
	$(MAKE) --no-print-directory bits

# zig links for TARGET against glibc 2.17 or musl 1.2, which any Linux of that kind has.
CROSS  = $(if $(TARGET),--target $(TARGET)$(if $(findstring gnu,$(TARGET)),.2.17))
# A library for musl is shared only if the C library is.
SHARED = $(if $(findstring musl,$(TARGET)),RUSTFLAGS="-C target-feature=-crt-static")
LINKED = $(if $(TARGET),--zig --target $(TARGET) --compatibility $(if $(findstring musl,$(TARGET)),musllinux_1_2,manylinux2014))

wheel: $(STAMPS)/demo $(if $(TARGET),$(STAMPS)/cross) ## build the wheel, one for every Python from 3.11 on, and the archive of the sources, into dist/ (for another Linux: TARGET=aarch64-unknown-linux-gnu)
	rm -rf dist envs/rover_gym/_fmu $(STAMPS)/fmu
	PATH="$(abspath $(BIN)):$$PATH"; $(SHARED) $(call unit,$(if $(TARGET),$(TARGET)/)release,--release -p rover-fmu $(CROSS))
	$(BIN)/python -m maturin sdist --out dist
	PATH="$(abspath $(BIN)):$$PATH" $(SHARED) CARGO_TARGET_DIR=$(abspath target) $(BIN)/python -m maturin build --release --quiet --out dist $(LINKED)
	$(if $(TARGET),rm -rf envs/rover_gym/_fmu)
	@ls dist/*

extras: $(STAMPS)/test wheel ## install the wheel, without Rust, in an empty environment for every Python and for each extra, and try what it promises
	ROVER_GYM_WHEEL=$$(ls $(abspath dist)/*.whl) $(BIN)/pytest --numprocesses 0 --capture no tests/installing

sizes: $(STAMPS)/test wheel ## measure what an installation takes on disk, and write it into README and manual (SIZES="demo train" for these extras, too)
	ROVER_GYM_WHEEL=$$(ls $(abspath dist)/*.whl) PYTHONPATH=tests $(BIN)/python -m installing.sizes $(SIZES)

docs: $(STAMPS)/test $(STAMPS)/core $(STAMPS)/debian-test ## build the documentation, Rust and Python, warnings denied, and test the manual's pages in a browser
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps --locked --quiet
	$(BIN)/sphinx-build --jobs auto --quiet --fail-on-warning --keep-going docs docs/_build/html
	$(BIN)/pytest --quiet --numprocesses auto $(OF_DOCS)
	@echo "docs/_build/html/index.html"
	@echo "target/doc/rover_core/index.html and target/doc/friction_contact/index.html"

bench: $(STAMPS)/release ## time a step and tell where the time goes, MuJoCo's beside it where it is installed (informs, does not gate)
	$(COMPARE).rollout
	$(COMPARE).exploring_bench
	$(COMPARE).tails
	cargo bench --locked $(addprefix --bench ,step accuracy spheres rays pictures solver disks)
	cargo run --locked --quiet --profile bench -p rover-comparison --example sand_steps
	-$(COMPARE).instructions

train: $(STAMPS)/test $(STAMPS)/release ## train a network for the rocks (minutes) and compare it with the baseline, under runs/
	$(BIN)/rover train rocks
	$(BIN)/python training/evaluate.py runs/train/rocks-seed1 pd scan --difficulty 1

train-rllib: $(STAMPS)/release ray ## train Rover-v0 on a local Ray with 2 workers (two minutes), under runs/
	$(VENV)-rllib/bin/python training/examples/rllib.py --workers 2 --iterations 4

ray: ## make the virtual environment of Ray, which pins other versions: .venv-rllib
	@$(MAKE) --no-print-directory VENV=$(VENV)-rllib $(VENV)-rllib/stamps/ray

ros-peer: ## make the virtual environment of ROS's own packages, with which tests drive a rover: .venv-ros
	@$(MAKE) --no-print-directory VENV=$(VENV)-ros $(VENV)-ros/stamps/ros-peer

# Programs of benchmarks/, some of which use scenes and files of the tests; in a comparison every engine has one thread.
MEASURE := PYTHONPATH="benchmarks$(if $(filter Windows_NT,$(OS)),;,:)tests" $(BIN)/python -m
COMPARE := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(MEASURE) comparison

chart: $(STAMPS)/release $(STAMPS)/peers $(STAMPS)/debian-peers ## error against CPU time beside other engines: docs/comparison/, docs/tables/ (40 minutes; CHART=--quick is shorter and goes to runs/)
	$(COMPARE).chart $(CHART)
	$(COMPARE).presets $(filter --quick,$(CHART))
	$(COMPARE).sphere_scenes $(filter --quick,$(CHART))
	$(COMPARE).exploring_chart $(filter --quick,$(CHART))
	$(COMPARE).surface_scenes $(filter --quick,$(CHART))
	$(if $(filter --quick,$(CHART)),,$(COMPARE).headlines)

policies: $(STAMPS)/release ## success, time and energy of the package's policies: docs/comparison/policies.json, docs/policy-results.md (an hour)
	$(MEASURE) comparison.policies
	$(COMPARE).headlines

benchmark: $(STAMPS)/release ## score the package's policies by `rover benchmark`: their results in envs/, docs/tables/benchmark.md (an hour of one core)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/rover benchmark pd scan anywhere guided $(BENCHMARK) \
		--output envs/rover_gym/data/benchmark/results --page docs/tables/benchmark.md

chart-gpu: $(STAMPS)/test $(MODULE) ## rovers a second and error on a graphics card, where there is one: docs/comparison/gpu.json, docs/many-rovers.md
	$(MEASURE) comparison.gpu_chart
	$(COMPARE).headlines

stability: $(STAMPS)/release $(STAMPS)/peers $(STAMPS)/debian-peers ## the scenes where methods fail, ours and other engines': docs/tables/stability.md (5 minutes)
	$(COMPARE).stability

torture: $(STAMPS)/test $(MODULE) ## tries to break everything: docs/tables/torture.md (5 minutes on two cores; TORTURE="--hours 2", or --regime NAME --case K)
	$(MEASURE) torture $(TORTURE)

film: $(STAMPS)/test $(MODULE) ## the moving picture at the head of the manual, from a page in a browser: docs/pictures/rover.webp (some minutes)
	rm -rf runs/film
	$(BIN)/rover drive --difficulty 1 --policy scan --seed 11 --output runs/film
	$(BIN)/rover replay runs/film/episode-11.h5 --no-open
	PYTHONPATH=tests $(BIN)/python -m browser.film runs/film/episode-11.html docs/pictures/rover.webp --begin 0.6

pace: $(STAMPS)/test $(MODULE) ## how many pictures a second a page of the player draws without a graphics card
	PYTHONPATH=tests $(BIN)/python -m browser.pace

bits: $(STAMPS)/test $(MODULE) ## compare trajectories, bit by bit, with the committed hashes (BITS=--save commits new ones)
	$(COMPARE).bits $(BITS)

instructions: $(STAMPS)/test ## count the instructions of a step under valgrind and compare them with the committed counts (INSTRUCTIONS=--save commits new ones)
	$(COMPARE).instructions $(INSTRUCTIONS)

profiles: $(STAMPS)/test $(STAMPS)/release ## performance profiles of the contact solvers, with Siconos' where it is installed
	$(COMPARE).solver_profiles

validate: $(STAMPS)/release ## grains beside papers and closed forms: docs/tables/validation.md (an hour and a half on two cores; VALIDATE="packing repose" measures some)
	$(MEASURE) validation $(VALIDATE)

validate-sand: $(STAMPS)/test $(STAMPS)/core ## sand beside measurements: docs/validation/sand.md (a minute; the folder of the data in DATA or ROVER_GYM_SOIL_DATA)
	$(MEASURE) validation.sand $(if $(DATA),--data $(DATA))

orders: $(STAMPS)/demo ## measure every time-stepping scheme: order, drift, energy, cost; redraw docs/comparison/orders.png
	cargo run --release --locked --quiet -p rover-comparison --bin orders -- runs/orders.json
	$(BIN)/python benchmarks/comparison/draw_orders.py runs/orders.json docs/comparison/orders.png

pins: $(STAMPS)/venv ## resolve requirements/*.txt anew from pyproject.toml
	$(call pin,demo) --extra demo --group build
	$(call pin,test) --extra test --extra docs --extra train --group build --group lint --constraint requirements/demo.txt
	$(call pin,rllib) --extra rllib --group build
	$(call pin,ros-peer,--group ros-peer)
	$(call pin,cross) --group cross --constraint requirements/demo.txt
	$(call pin,peers) --extra peers --constraint requirements/test.txt

clean: ## remove everything that make made, but for runs/
	rm -rf $(VENV) $(VENV)-rllib $(VENV)-ros target dist docs/_build envs/rover_gym/_core*.so envs/rover_gym/_fmu .mypy_cache .ruff_cache .pytest_cache .hypothesis

# One list for every Python from 3.11 on, versions only.
pin = $(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 --no-annotate \
	--custom-compile-command "make pins" --excludes requirements/without/processor.txt --output-file requirements/$(1).txt $(or $(2),pyproject.toml)

# pip fetches uv, and uv, which is several times faster, the rest.
$(STAMPS)/venv: requirements/demo.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "rover-gym needs Python 3.11 or newer; say which with make PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check "$$(grep '^uv==' $<)"
	@mkdir -p $(@D) && touch $@

# Debian packages: installed where that is allowed, otherwise named; tried once.
$(STAMPS)/debian-%: requirements/debian/%.txt | $(STAMPS)/venv
	@packaging/debian-packages $<
	@touch $@

$(STAMPS)/debian-test: | $(STAMPS)/debian-demo # one apt-get at a time

$(STAMPS)/demo $(STAMPS)/cross: $(STAMPS)/%: requirements/%.txt $(STAMPS)/venv
	$(UV) --requirement $<
	@touch $@

# PyTorch comes from its own index where that can be reached: the build for processors, or for the graphics card that is
# there. Elsewhere it is the one of the list, which loads CUDA's libraries even without a card; a list has those of them
# that it cannot do without.
define with_torch
	@if UV_HTTP_RETRIES=0 UV_HTTP_TIMEOUT=10 $(UV) --dry-run --no-deps --reinstall --torch-backend auto $$(grep '^torch==' $<) > /dev/null 2>&1; then \
	  grep -v '^nvidia-\|^cuda-' $< > $@.txt && $(UV) --torch-backend auto --requirement $@.txt; \
	else $(UV) --no-deps --requirement $<; fi
endef

$(STAMPS)/test: requirements/test.txt $(STAMPS)/venv
	$(with_torch)
	@touch $@

# Ray pins its own Gymnasium, so it has an environment of its own, which finds the package in this folder.
$(STAMPS)/ray: requirements/rllib.txt $(STAMPS)/venv
	$(with_torch)
	@echo $(CURDIR)/envs > $$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/rover_gym.pth
	@touch $@

# The wheels of ROS start the interpreter anew when it starts, so they have an environment of their own.
$(STAMPS)/ros-peer: requirements/ros-peer.txt $(STAMPS)/venv
	$(UV) --requirement $<
	@touch $@

# An engine that cannot be installed is left out of the comparison, which says so.
$(STAMPS)/peers: requirements/peers.txt $(STAMPS)/demo
	$(UV) --requirement $< || for one in $$(grep -o '^[a-z-]*==[^ ;]*' $<); do $(UV) $$one || true; done
	@touch $@

SOURCES := pyproject.toml Cargo.toml Cargo.lock $(shell find rust -type f)

# The library and its own tests need nothing of Python, and compile side by side.
$(STAMPS)/library: $(SOURCES)
	@$(CARGO) test --workspace --tests --locked --quiet --no-run
	@mkdir -p $(@D) && touch $@

# The compiled core and the package itself, editable: built for development, or as it is shipped. One takes the place of
# the other; what cargo has compiled for either stays.
$(STAMPS)/core: PROFILE := dev
$(STAMPS)/release: PROFILE := release
$(STAMPS)/core $(STAMPS)/release: $(SOURCES) | $(STAMPS)/demo
	$(BIN)/python -m maturin develop --profile $(PROFILE) --uv --quiet
	@rm -f $(STAMPS)/core $(STAMPS)/release && touch $@

# The library of co-simulation units, where the package and its wheel look for it. For development it is built beside the
# module's crate: with the same features of the dependencies nothing is compiled twice.
unit = $(CARGO) $(if $(TARGET),zigbuild,build) --locked --quiet $(2) && mkdir -p envs/rover_gym/_fmu && \
	for made in target/$(1)/{lib,}rover_fmu.{so,dylib,dll}; do [ ! -f $$made ] || cp $$made envs/rover_gym/_fmu/rover_fmu.$${made\#\#*.}; done

$(STAMPS)/fmu: $(SOURCES) | $(STAMPS)/core
	@$(call unit,debug,-p rover-module -p rover-fmu)
	@touch $@
