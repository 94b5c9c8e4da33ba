# SPDX-License-Identifier: GPL-3.0-or-later
.DEFAULT_GOAL := help
.PHONY: help setup demo figures docs test pytest soak fuzz validation bench lint format clean fresh kicad ngspice46 verilog-a firmware webassembly windows

PY := .venv/bin/python
JOBS ?= 3
RELEASE ?=
TARGETS ?= demo test

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z0-9-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: ## install ngspice and, in .venv, the package with its test tools; skip what is there
	@sh scripts/setup.sh test dev

demo: ## run the motor and plot the results into demo/
	@echo "demo: about two minutes on an idle machine; before, what is missing is installed, once, in a minute or two"
	@sh scripts/setup.sh
	@$(PY) figures/demo.py --output demo

figures: setup ## plot every figure of figures/ again
	@set -e; for script in $(filter-out %/diagram.py %/style.py %/demo.py,$(wildcard figures/*.py)); do echo "$$script:"; $(PY) $$script; done

docs: ## build the documentation site in site/, and check its pages
	@sh scripts/setup.sh test docs
	@NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict --quiet
	@$(PY) -m pytest -q tests/docs/built_site.py
	@echo "site/index.html"

test: setup ## run the linters beside the tests, including those of the wheel
	@$(MAKE) --no-print-directory -j 2 lint pytest

pytest: setup
	$(PY) -m pytest -n $(JOBS) --dist loadgroup

fuzz: setup ## run all tests of invalid input, and 10,000 random inputs at every entry point (20 minutes)
	$(PY) -m pytest -n $(JOBS) -m fuzz
	$(PY) -m validation.fuzz

soak: setup ## run all further cases of tests, 2,000 random motors, and 200 drivers and trackers (two hours; the random ones can be resumed)
	$(PY) -m pytest -n $(JOBS) -m soak
	$(PY) -m validation.soak --workers $(JOBS)
	$(PY) -m validation.soak electronics --workers $(JOBS)

validation: setup ## compare random motors, contacts and drives with independent references (two hours; can be resumed)
	$(PY) -m validation.hammering
	$(PY) -m validation.engines
	$(PY) -m validation.live_page
	$(PY) -m validation.runs
	$(PY) -m validation.contacts
	$(PY) -m validation.losses
	$(PY) -m validation.contradictions
	$(PY) -m validation.held_points
	$(PY) -m validation.lock
	$(PY) -m validation.recovery
	$(PY) -m validation.loops
	$(PY) -m validation.trust
	$(PY) -m validation.hidden --workers $(JOBS)
	$(PY) -m validation.faults

bench: ## measure speed, accuracy and memory (minutes, on an otherwise idle machine)
	@sh scripts/setup.sh test dev bench
	@$(PY) benchmarks/run.py

kicad: setup ## open, check and run the KiCad example in KiCad 9, unpacked into .tools (110 MB)
	@sh scripts/backports.sh kicad
	$(PY) -m pytest tests/tools/kicad.py

ngspice46: setup ## run decks and engine in ngspice 46, unpacked into .tools beside the system's
	@sh scripts/backports.sh ngspice
	PATH="$$PWD/.tools/ngspice/bin:$$PATH" $(PY) -m pytest -n $(JOBS) tests/spice tests/steady/test_steady.py tests/control/test_simulate.py tests/spice/test_library.py tests/circuit/test_decks.py tests/circuit/test_parameters.py tests/docs/test_limits_page.py tests/tools/ngspice46.py

verilog-a: ## compile the Verilog-A motor and run it in ngspice 46 and VACASK, beside the subcircuits (100 MB)
	@sh scripts/setup.sh test dev compiled
	@sh scripts/backports.sh ngspice
	$(PY) -m pytest -n $(JOBS) tests/tools/verilog_a.py tests/tools/vacask.py

firmware: ## compile the example of firmware for a Cortex-M4, and run it in qemu beside this computer (600 MB)
	@sh scripts/setup.sh target test dev
	$(PY) -m pytest -s tests/tools/firmware.py

webassembly: setup ## run the tests of the engine in ngspice as WebAssembly
	PIEZOMOTOR_ENGINE=wasm $(PY) -m pytest -n $(JOBS) tests/spice tests/steady/test_steady.py tests/control/test_simulate.py

windows: ## run the Functional Mock-up Unit's binary for Windows under wine (500 MB)
	@sh scripts/setup.sh windows test dev
	$(PY) -m pytest -s tests/tools/windows.py

fresh: ## run `make demo` and `make test` on a minimal Debian in a chroot, as root: RELEASE=trixie or bookworm
	@sh scripts/fresh.sh "$(RELEASE)" $(TARGETS)

lint: setup ## check style, format and types of the sources
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy

format: setup ## format the sources
	$(PY) -m ruff check --fix .
	$(PY) -m ruff format .

clean: ## remove .venv, build results and caches
	rm -rf .venv build dist site .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
