# The project's commands; `make help` lists them.
#
# Needed: make, and Python 3.11, 3.12 or 3.13 with its venv module, on Linux (x86-64) or macOS (arm64).
# No compiler. Everything is installed into .venv, from wheels whose hashes requirements.lock holds.
#
#   make paper CORES=8          more jobs at a time
#   make test PYTHON=python3.12 this interpreter for .venv
#   make bench SIZES=small      the shorter problems only (small, medium, all, or keyframes: 10,100)

CORES ?= 2
INPUTS ?= 100000
PYTHON ?= python3 python3.13 python3.12 python3.11
UV ?= uv
LOCK_FLAGS ?=
SIZES ?= all

VENV := .venv
BIN := $(VENV)/bin
# The workflow's rules and Snakemake's own jobs call `python`: it must be the one in .venv.
RUN := PATH="$(CURDIR)/$(BIN):$$PATH"
SET_UP := $(VENV)/.installed

.PHONY: help setup paper check-results recovery test test-all test-slurm fuzz bench bench-paper docs lint format lock clean distclean
.DEFAULT_GOAL := help

help:
	@echo "make paper          make every table and figure, into paper_figures/ (CORES=$(CORES)); takes up a stopped run"
	@echo "make check-results  compare paper_figures/ with the expected values, data/expected.csv"
	@echo "make test           run the checks of 'make lint', then the tests"
	@echo "make test-all       run also the tests that build the workflow several times (half an hour)"
	@echo "make test-slurm     run the smoke configuration on a Slurm that it starts itself, as root (docs/slurm.md)"
	@echo "make docs           build the site, build/docs/index.html, and draw the pictures in docs anew"
	@echo "make bench          race vigauge against its peers (SIZES=$(SIZES)): benchmarks/README.md"
	@echo "make bench-paper    run the whole workflow anew and print where the time goes"
	@echo "make recovery       kill the workflow at random moments, start it again, compare (docs/recovery.csv)"
	@echo "make fuzz           feed every reader up to $(INPUTS) malformed files in ten minutes (docs/fuzzing.csv)"
	@echo "make lint           check format, lint, types and rule files; changes nothing"
	@echo "make format         rewrite Python and rule files in the project's format"
	@echo "make setup          install .venv from requirements.lock; most targets do this first"
	@echo "make lock           write requirements.lock anew from pyproject.toml (needs uv; LOCK_FLAGS=--upgrade)"
	@echo "make clean          delete what the workflow made, and caches"
	@echo "make distclean      also delete .venv"

setup: $(SET_UP)

# Two stamps: a new lock rebuilds .venv from nothing; a new pyproject.toml only installs vigauge again.
# Only one package of the lock has no wheel, connection-pool, and it is pure Python.
$(VENV)/.locked: requirements.lock
	@found=; \
	for python in $(PYTHON); do \
	    if "$$python" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' >/dev/null 2>&1; then \
	        found="$$python"; break; \
	    fi; \
	done; \
	if [ -z "$$found" ]; then \
	    echo "vigauge needs Python 3.11, 3.12 or 3.13, which none of these is: $(PYTHON); name one with 'make PYTHON=...'." >&2; \
	    exit 1; \
	fi; \
	echo "setting up $(VENV) with $$found from requirements.lock (a minute or two)"; \
	"$$found" -m venv --clear $(VENV)
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --require-hashes \
	    --only-binary :all: --no-binary connection-pool --requirement requirements.lock
	@touch $@

$(SET_UP): $(VENV)/.locked pyproject.toml
	@$(BIN)/python -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

paper: $(SET_UP)
	$(RUN) python -m vigauge_paper.commands.resume --cores $(CORES)

check-results: $(SET_UP)
	$(RUN) python -m vigauge_paper.commands.check_results

# Minutes for the smoke configuration, an hour or more for the full one.
recovery: $(SET_UP)
	$(RUN) python tests/recovery/kill.py --config smoke --kills 20 --kills-per-run 5 --record docs/recovery.csv
	$(RUN) python tests/recovery/kill.py --config full --kills 5 --kills-per-run 5 --record docs/recovery.csv

test: lint
	$(RUN) pytest

test-all: lint
	$(RUN) pytest -m ""

test-slurm: $(SET_UP)
	$(RUN) tests/slurm/run.sh docs/slurm.csv

fuzz: $(SET_UP)
	PYTHONPATH=.:tests $(BIN)/python -m fuzz.run --inputs $(INPUTS) --record docs/fuzzing.csv

# Wants an otherwise idle machine. Installs nothing: without g++ and libceres-dev it says so and goes on.
# Memory that a solver gives back stays in its process, for all of them alike: pages asked for anew cost
# as much as a linearisation.
bench: $(SET_UP)
	MALLOC_MMAP_THRESHOLD_=1073741824 MALLOC_TRIM_THRESHOLD_=1073741824 \
	    $(RUN) python -m benchmarks --sizes $(SIZES)
	MALLOC_MMAP_THRESHOLD_=1073741824 MALLOC_TRIM_THRESHOLD_=1073741824 $(RUN) python -m benchmarks.foreign

bench-paper: $(SET_UP)
	$(RUN) python -m benchmarks.paper_time --cores $(CORES)

docs: $(SET_UP)
	$(RUN) python -m docs.picture
	$(RUN) python -m sphinx --quiet --fail-on-warning --doctree-dir build/doctrees docs build/docs
	@echo "build/docs/index.html is the site; external_links.txt beside it lists the addresses that it names"

lint: $(SET_UP)
	$(RUN) ruff check .
	$(RUN) ruff format --check .
	$(RUN) mypy
	$(RUN) snakefmt --check Snakefile workflow
	$(RUN) snakemake --lint

format: $(SET_UP)
	$(RUN) ruff check --fix .
	$(RUN) ruff format .
	$(RUN) snakefmt Snakefile workflow

lock:
	@command -v $(UV) >/dev/null || { echo "make lock needs uv (python -m pip install uv)" >&2; exit 1; }
	$(UV) pip compile pyproject.toml --all-extras --group build --universal --fork-strategy fewest \
	    --python-version 3.11 --generate-hashes --no-annotate --no-emit-index-url --no-emit-find-links \
	    --custom-compile-command "make lock" --quiet --output-file requirements.lock $(LOCK_FLAGS)

clean:
	@if [ -x $(BIN)/snakemake ]; then $(RUN) snakemake --cores 1 --delete-all-output; fi
	rm -rf .snakemake .pytest_cache .ruff_cache .mypy_cache .hypothesis build dist
	find src tests workflow benchmarks docs -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)
