# One command each; every target sets up .venv first when it is missing or its inputs changed.
#   make cell    one recorded episode of the hard peg in a cell that differs from its model (INSTANCE);
#                INSTANCE=nominal TASK=peg_insertion is the cell that is its model
#   make test    check, then fast tests; THOROUGH=1: the thorough ones among them, as before a release
#   make check   ruff, ty (types)                       make slow   the slow tests
#   make thorough  tests of some seconds each that make test leaves out
#   make fuzz    100,000 damaged inputs over all readers (FUZZ: their number, SEED; JOBS: readers at once)
#   make faults  faults x moments over the live graph (ONLY: faults whose name holds this; root for two hosts,
#                and for JOBS whole cells at once, of three cores each)
#   make bench   the cell's benchmark                  make docs   documents generated from code
#   make soak    episodes of all tasks in turn (HOURS) in SOAK; again, an interrupted soak goes on
#   make bench-model   the model beside its peers, which it installs (Mitsuba needs Debian's libllvm19)
#   make clean   remove .venv and caches (recordings in out/ stay)
# Variables: PYTHON (3.11, or 3.12 with a self-built pybullet), TASK, INSTANCE, SEED, EPISODES, WORKERS (of
# the tests).

PYTHON   ?= $(shell command -v python3.11 || command -v python3)
TASK     ?= peg_insertion_hard
INSTANCE ?= typical:1
SEED     ?= 0
EPISODES ?= 1
FUZZ     ?= 100000
ONLY     ?=
JOBS     ?= 1
HOURS    ?= 2
THOROUGH ?=
SOAK     ?= out/soak
WORKERS  ?= $(shell n=$$(env -u OMP_NUM_THREADS nproc); echo $$((n < 8 ? n : 8)))

VENV  := .venv
BIN   := $(VENV)/bin
STAMP := $(VENV)/.installed
BUILT := $(VENV)/.interfaces
PIP   := $(BIN)/python -m pip --disable-pip-version-check
TORCH := $(shell grep '^torch==' constraints.txt)

# A build of torch that pip cannot find where it is configured to look is fetched from torch's own CPU index.
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu

# Files with a test of that marker: the others need not be imported (10 s).
MARKED = $(shell grep -rl --include='test_*.py' 'mark\.$(1)' tests)

INTERFACES := $(wildcard msgs_docs/*/msg/*.msg msgs_docs/*/srv/*.srv samrl_ros/interfaces/*.py)

# `ros2 run` and the nodes look for packages here; a sourced ROS 2 workspace stays visible behind it.
export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)$(if $(AMENT_PREFIX_PATH),:$(AMENT_PREFIX_PATH))

# A test run starts some hundred processes: where images forbid bytecode, each compiles the same modules again.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: setup cell test unit thorough live check slow fuzz faults soak bench bench-model docs clean
.DELETE_ON_ERROR:

setup: $(BUILT)

$(STAMP): pyproject.toml constraints.txt package.xml $(wildcard samrl_ros/ament/*)
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13))' || \
	  { echo "samrl needs Python 3.11 (or 3.12); make PYTHON=/path/to/python3.11 after make clean"; exit 2; }
	$(PIP) install -q --no-deps "$(TORCH)" || $(PIP) install -q --no-deps --extra-index-url $(TORCH_INDEX) "$(TORCH)"
	$(PIP) install -q -c constraints.txt -e ".[ros,dev]"
	touch $@

$(BUILT): $(STAMP) $(INTERFACES)
	$(BIN)/python msgs_docs/build_interfaces.py
	touch $@

# The first of out/cell-1, out/cell-2, ... that does not exist yet: a recording is never overwritten.
cell: $(BUILT)
	@n=1; while [ -e out/cell-$$n ]; do n=$$((n + 1)); done; mkdir -p out; \
	set -- samrl cell --task $(TASK) --instance $(INSTANCE) --episodes $(EPISODES) --seed $(SEED) \
	  --out out/cell-$$n; echo "$$@"; exec $(BIN)/"$$@"

# The tests over DDS come last and alone: they need the cores.
test: $(BUILT)
	$(MAKE) check
	$(MAKE) unit
	$(MAKE) live

unit: $(BUILT)
	$(BIN)/python -m pytest -q -m "not slow and not live$(if $(THOROUGH),, and not thorough)" -n $(WORKERS) \
	  --dist worksteal

thorough: $(BUILT)
	$(BIN)/python -m pytest -q -m "thorough and not slow and not live" -n $(WORKERS) --dist worksteal $(call MARKED,thorough)

live: $(BUILT)
	$(BIN)/python -m pytest -q -m "live and not slow and not thorough" $(call MARKED,live)

check: $(BUILT)
	$(BIN)/ruff check .
	$(BIN)/ty check --python $(BIN)/python

slow: $(BUILT)
	$(BIN)/python -m pytest -q -m slow

fuzz: $(BUILT)
	$(BIN)/python -m tests.fuzz.attack --count $(FUZZ) --seed $(SEED) --jobs $(JOBS)

faults: $(BUILT)
	$(BIN)/python -m tests.faults.bench --only "$(ONLY)" --jobs $(JOBS)

soak: $(BUILT)
	$(BIN)/samrl bench soak --out $(SOAK) --hours $(HOURS)

bench: $(BUILT)
	@mkdir -p out
	$(BIN)/samrl bench cell --out out/bench-$$(date +%Y%m%d-%H%M%S)

bench-model: $(BUILT)
	$(PIP) install -q -c constraints.txt -e ".[bench]"
	@n=1; while [ -e out/bench-model-$$n ]; do n=$$((n + 1)); done; \
	for part in emd physics renderer; do \
	  $(BIN)/samrl bench $$part --out out/bench-model-$$n || exit; done

docs: $(BUILT)
	$(BIN)/python -m samrl_ros.docs

clean:
	rm -rf $(VENV) .pytest_cache .ruff_cache build dist
	find . -name __pycache__ -not -path './.git/*' -prune -exec rm -rf {} +
