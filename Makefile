# SPDX-License-Identifier: GPL-3.0-or-later
.DEFAULT_GOAL := help
.PHONY: help setup demo figures docs test soak fuzz bench lint format clean

PY := .venv/bin/python
JOBS ?= 2

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-8s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## install what is missing: ngspice, and the package with its test tools in .venv
	@sh scripts/setup.sh test dev

demo: ## run the motor and draw what it does
	@sh scripts/setup.sh report
	@$(PY) figures/demo.py --output demo

figures: setup ## draw every figure of figures/ anew
	@set -e; for script in $(filter-out %/style.py %/demo.py,$(wildcard figures/*.py)); do echo "$$script:"; $(PY) $$script; done

docs: setup ## build the documentation site into site/
	@NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict --quiet
	@echo "site/index.html"

test: lint ## lint, then run every test, the wheel's included
	$(PY) -m pytest -n $(JOBS) --dist loadgroup

fuzz: setup ## give every door of the package 10,000 inputs gone wrong (a quarter of an hour)
	$(PY) -m tests.fuzz

soak: setup ## run 2,000 random motors (a quarter of an hour; goes on where it was interrupted)
	$(PY) -m tests.soak

bench: ## measure speed, accuracy and memory (minutes; nothing else should run meanwhile)
	@sh scripts/setup.sh test dev bench
	@$(PY) benchmarks/run.py

lint: setup ## check style, format and types
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy

format: setup ## put the sources into the project's format
	$(PY) -m ruff check --fix .
	$(PY) -m ruff format .

clean: ## remove .venv, build products and caches
	rm -rf .venv build dist site .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
