SHELL := /bin/bash
# Not -u: the scripts that colcon makes read unset variables.
.SHELLFLAGS := -e -o pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
MAKEFLAGS += --no-print-directory

CASE ?= 3
DURATION ?= 60
SEED ?= 1
SCENARIO ?=
GRAPH ?=
RECORD ?=
FAULT ?=
PACKETS ?= 1000000
PYTHON ?=
export PYTHON

.PHONY: help demo test lint bench faults pose-faults fuzz heads clean setup build FORCE

help:
	@printf '%s\n' \
	  'make demo    the paper'"'"'s experiment on a mock robot through real ROS 2 messages; results in out/demo' \
	  '             CASE=1|2|3 (default 3)  DURATION=seconds (default 60)  SEED=n (default 1)' \
	  '             RECORD=1 for a recording of all topics too, out/demo/demo.mcap (docs/see_it.md)' \
	  'make test    lint, then all tests' \
	  'make lint    style, types and the import rules' \
	  'make bench   time control step, dynamics and lockstep; results in out/bench.json' \
	  'make faults  try driver and mock with every fault; table in out/faults.md  SCENARIO=name for one' \
	  'make pose-faults  the same for the motion capture; table in out/pose_faults.md  FAULT=part-of-name' \
	  'make heads   200 head trajectories and 100 hostile references in lockstep; table in out/heads.md' \
	  '             GRAPH=1: some of them through all nodes, by the wall clock' \
	  'make fuzz    a million random packets against the mock and the driver  PACKETS=n' \
	  'make clean   remove all that the others made' \
	  '' \
	  'Each does the set-up that it needs, once: packages in .venv, messages in install.' \
	  'PYTHON=path chooses the Python (3.11, 3.12 or 3.13). Where ROS 2 Jazzy is sourced, it is used.' \
	  'For a shell with all of it:  source scripts/env.sh  (then colcon build, colcon test, python -m ...)'

ifneq ($(filter-out help clean,$(MAKECMDGOALS)),)
WORLD := $(shell bash scripts/world.sh)
ifeq ($(WORLD),)
$(error no usable ROS 2, see above)
endif
# Another ROS, another folder or another PYTHON than last time: set up again.
ifneq ($(WORLD) $(CURDIR) $(or $(PYTHON),any),$(shell cat .venv/world 2>/dev/null) $(if $(PYTHON),$(shell cat .venv/python 2>/dev/null),any))
.venv/ready: FORCE
endif
endif

.venv/ready: requirements/runtime.txt requirements/dev.txt requirements/ros.txt \
             scripts/setup.sh scripts/localise_cmake.py
	@bash scripts/setup.sh $(WORLD)
	@touch $@

INTERFACES := $(wildcard snake_interfaces/*.* snake_interfaces/*/*)
PACKAGE := package.xml setup.py setup.cfg colcon_defaults.yaml \
           $(wildcard config/*.yaml config/*.rviz config/layouts/* launch/*.py resource/*) \
           $(shell find snake_control -name '*.py')

build/ready: .venv/ready $(INTERFACES) $(PACKAGE)
	@bash scripts/build.sh
	@touch $@

setup: .venv/ready

build: build/ready

demo: build/ready
	@. scripts/env.sh && exec python -m snake_control.cli.demo \
	  --case $(CASE) --duration $(DURATION) --seed $(SEED) --out out/demo $(if $(filter-out 0,$(RECORD)),--record)

test: lint build/ready
	@exec bash scripts/test.sh

lint: .venv/ready
	@bash scripts/lint.sh

.venv/bench: .venv/ready requirements/bench.txt
	@bash scripts/quietly.sh .venv/bench.log "Installing what the benchmarks compare with" \
	  .venv/bin/python -m pip install --disable-pip-version-check --no-input --no-deps \
	  -r requirements/bench.txt
	@touch $@

bench: build/ready .venv/bench
	@. scripts/env.sh && python -m benchmarks.run

faults: build/ready
	@. scripts/env.sh && PYTHONPATH=.:test:$$PYTHONPATH exec python -m faults.campaign $(SCENARIO)

pose-faults: build/ready
	@. scripts/env.sh && PYTHONPATH=.:test:$$PYTHONPATH exec python -m poses.campaign $(FAULT)

fuzz: build/ready
	@. scripts/env.sh && PYTHONPATH=.:test:$$PYTHONPATH exec python -m fuzz.run --packets $(PACKETS)

heads: build/ready
	@. scripts/env.sh && PYTHONPATH=.:test:$$PYTHONPATH exec python -m heads.$(if $(GRAPH),in_graph,campaign)

clean:
	rm -rf .venv build install log out .pytest_cache .ruff_cache .mypy_cache \
	  .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
