# The two commands of the README. Both set up what is missing first; a second run skips that in under a second.
SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help verify test test-fast test-without-liggghts mutants lint docs setup clean

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /  make \1\t/p' Makefile | expand -t 30

verify: ## compare gpudem with LIGGGHTS and closed forms (standard tier); last line: the report's path
	@bash tools/setup.sh run
	@.venv/bin/gpudem compare --tier standard $(ARGS)

# One worker a core; each file of tests in one worker, the cases' with their one report too. WORKERS= for none.
# A worker that ends (a test beyond its time limit) ends the run: xdist would run that test again in a new worker.
WORKERS = -n logical --maxprocesses 4 --dist loadfile --max-worker-restart 0

test: ## the test suite and the checks of all cases; ARGS="-k scene" to select
	@bash tools/setup.sh test
	@.venv/bin/python -m pytest $(WORKERS) --gpudem-cases comparisons.cases $(ARGS)

test-fast: ## its fast part, some 90 s: no LIGGGHTS, no cases, few kernels to compile
	@bash tools/setup.sh test
	@.venv/bin/python -m pytest $(WORKERS) -m "not (slow or liggghts or cases or long)" $(ARGS)

# As on a machine without the binary: recorded output stands in, what needs more is left out.
test-without-liggghts: ## the quick tier and the tests of the reference code, LIGGGHTS hidden
	@bash tools/setup.sh test
	@GPUDEM_LIGGGHTS=/hidden/liggghts .venv/bin/gpudem compare $(ARGS)
	@GPUDEM_LIGGGHTS=/hidden/liggghts .venv/bin/python -m pytest $(WORKERS) tests/reference tests/comparisons/test_without_liggghts.py

mutants: ## mutation testing: which test detects each known defect? ARGS=--record stores the result
	@bash tools/setup.sh test
	@.venv/bin/python -m comparisons.mutation $(ARGS)

lint: ## ruff, its formatter and the type checker
	@bash tools/setup.sh lint
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/pyright --warnings

docs: ## build the documentation, without a network; last line: its first page
	@bash tools/setup.sh docs
	@.venv/bin/python -m sphinx -q -W --keep-going -b html docs docs/_build/html
	@echo docs/_build/html/index.html

setup: ## everything that verify, test and lint need
	@bash tools/setup.sh run test lint

clean: ## remove the environment and caches; keeps runs/
	rm -rf .venv build dist docs/_build docs/generated *.egg-info .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './runs/*' -prune -exec rm -rf {} +
