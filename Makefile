# What a newcomer types: `make demo` and `make test` do all set-up themselves; `make help` lists the rest.
SHELL       := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

PYTHON  ?= python3
VENV    ?= .venv
JOBS    ?= 2
PY      := $(VENV)/bin/python
PIP     := $(PY) -m pip --disable-pip-version-check
# What is never imported need not be compiled: three quarters of the time of an installation.
FETCH   := $(PIP) install --no-compile
LOGS    := build/logs
ALOUD   := tools/aloud.sh
# The package as it stands in the tree: links to the Python sources, beside the module of build/dev.
DEV     := PYTHONPATH=$(CURDIR)/build/dev/python PYTHONUNBUFFERED=1

BARE_PATH := $(PATH)
export PATH := $(abspath $(VENV))/bin:$(PATH)
export CMAKE_BUILD_PARALLEL_LEVEL := $(JOBS)
# What is fetched is compiled when it is first imported: with this set, at every start of Python.
unexport PYTHONDONTWRITEBYTECODE
# Looked for in every recipe: the first one may have installed it. Paths are hashed relative to the repository.
export CMAKE_CXX_COMPILER_LAUNCHER = $(shell command -v ccache)
export CCACHE_BASEDIR := $(CURDIR)
export CCACHE_SLOPPINESS := pch_defines,time_macros
ifndef MGDD_DATA_DIR
  ifneq ($(wildcard ../shared/data),)
    export MGDD_DATA_DIR := $(abspath ../shared/data)
  endif
endif

NOT_FETCHED := { echo "mgdd: pip failed, see above: is there a network, and room on the disk?" >&2; exit 1; }

# --- set-up -------------------------------------------------------------------------------------------------
.PHONY: system system-test
system:
	@PYTHON=$(PYTHON) tools/system_packages.sh build
system-test:
	@PYTHON=$(PYTHON) tools/system_packages.sh build test

# In three parts, so that the module compiles while the rest is fetched: what builds it, what it imports, what tests it.
$(VENV)/.stamp-build: pyproject.toml | system
	[ -x $(PY) ] || $(PYTHON) -m venv $(VENV)
	$(ALOUD) $(FETCH) "pip>=25.1" || $(NOT_FETCHED)
	$(ALOUD) $(FETCH) --group build || $(NOT_FETCHED)
	touch $@

$(VENV)/.stamp-run: pyproject.toml | $(VENV)/.stamp-build
	$(PY) -c "import tomllib as t; print(*t.load(open('$<', 'rb'))['project']['dependencies'], sep='\n')" > $@
	$(ALOUD) $(FETCH) -r $@ || { rm -f $@; $(NOT_FETCHED); }

$(VENV)/.stamp-test: pyproject.toml | $(VENV)/.stamp-run
	$(ALOUD) $(FETCH) --group dev || $(NOT_FETCHED)
	touch $@

# --- build --------------------------------------------------------------------------------------------------
CONFIGURE = cmake -DPython_EXECUTABLE=$(abspath $(PY)) -DCMAKE_CXX_COMPILER_LAUNCHER=$(CMAKE_CXX_COMPILER_LAUNCHER) \
  -DCMAKE_PREFIX_PATH="$$($(PY) -c 'import sysconfig; print(sysconfig.get_path("purelib"))')" --preset
BUILD     = $(ALOUD) cmake --build --preset

.PHONY: module dev
module: $(VENV)/.stamp-build ## compile the module alone, build/dev/python
	[ -f build/dev/build.ninja ] || $(CONFIGURE) dev -DMGDD_BUILD_TESTS=OFF
	$(BUILD) dev --target _core

dev: $(VENV)/.stamp-build | system-test ## compile the module and the C++ tests, build/dev
	$(CONFIGURE) dev -DMGDD_BUILD_TESTS=ON
	$(BUILD) dev

# --- the two commands ---------------------------------------------------------------------------------------
.PHONY: demo test test-all ready wheel-check
demo: $(VENV)/.stamp-build ## set up, then run the main job on the measured traces
	@$(MAKE) --no-print-directory -j2 module $(VENV)/.stamp-run
	$(DEV) $(PY) -m mgdd demo

ready: $(VENV)/.stamp-build | system-test
	@$(MAKE) --no-print-directory -j2 dev $(VENV)/.stamp-test

test: MARKED := not slow and not study
test: ready ## set up, then run the tests of both languages, but studies and those marked slow
	@$(RUN_TESTS); echo "left out: studies and tests marked slow, which \`make test-all\` runs too"

test-all: MARKED :=
test-all: ready ## lint, then all tests
	@tools/system_packages.sh browser
	@$(MAKE) --no-print-directory lint
	@$(RUN_TESTS)

define RUN_TESTS
	mkdir -p $(LOGS); rm -f $(LOGS)/*.log; failed=""; \
	$(ALOUD) ctest --preset dev -j$(JOBS) | tee $(LOGS)/ctest.log || failed+=" ctest"; \
	$(DEV) $(ALOUD) $(PY) -m pytest -n $(JOBS) --dist worksteal -m "$(MARKED)" | tee $(LOGS)/pytest.log || failed+=" pytest"; \
	echo; echo "--- summary ---"; \
	echo "ctest:  $$(grep -h 'tests passed' $(LOGS)/ctest.log | tail -n 1)"; \
	echo "pytest: $$(tail -n 1 $(LOGS)/pytest.log)"; \
	[ -z "$$failed" ] || { echo "FAILED:$$failed"; exit 1; }
endef

# As a user does: an empty environment outside the repository, plain `pip install .`. The two settings let the compiler
# cache know the objects of build/dev again.
wheel-check: ready ## install the package as a user does, and try it from Python, the command line and C++
	@mkdir -p $(LOGS); rm -f $(LOGS)/wheel.log; folder="$$(mktemp -d)"; trap 'rm -rf "$$folder"' EXIT; \
	$(PYTHON) -m venv "$$folder/venv"; \
	compiler="$$(sed -n 's/^CMAKE_CXX_COMPILER:[A-Z]*=//p' build/dev/CMakeCache.txt)"; \
	PATH="$(BARE_PATH)" CXX="$$compiler" SKBUILD_CMAKE_DEFINE="MGDD_WERROR=ON" \
	  $(ALOUD) "$$folder/venv/bin/python" -m pip --disable-pip-version-check install .; \
	MGDD_INSTALLED="$$folder/venv" $(ALOUD) $(PY) -m pytest -v -n $(JOBS) --dist loadfile tests/installed | tee $(LOGS)/wheel.log

.PHONY: install examples
install: $(VENV)/.stamp-run ## install the package into .venv, as `pip install .` does
	$(ALOUD) $(PIP) install --no-build-isolation .

examples: dev ## install the C++ library into build/prefix, build and run the programs of cpp/examples against it
	cmake --install build/dev --component dev --prefix build/prefix
	cmake -G Ninja -S cpp/examples -B build/examples -DCMAKE_PREFIX_PATH="$(CURDIR)/build/prefix" \
	  -DEigen3_DIR="$$(sed -n 's/^Eigen3_DIR:[A-Z]*=//p' build/dev/CMakeCache.txt)"
	$(ALOUD) cmake --build build/examples
	for source in cpp/examples/*.cpp; do echo "--- $$source"; build/examples/$$(basename $$source .cpp); done

# --- quality ------------------------------------------------------------------------------------------------
CPP_FILES = $(shell find cpp tests -name '*.hpp' -o -name '*.cpp')
STUBGEN   = $(DEV) $(PY) tools/stubs.py mgdd._core

.PHONY: lint format stubs asan tsan clang mingw-check tidy bench docs
lint: $(VENV)/.stamp-test ## ruff, mypy --strict, clang-format, codespell, changelog.d: look, change nothing
	ruff check .
	ruff format --check .
	$(ALOUD) mypy
	@echo "clang-format of every C++ file"; clang-format --dry-run -Werror $(CPP_FILES)
	codespell
	@echo "names of the fragments in changelog.d"; towncrier build --draft --version next >/dev/null

format: $(VENV)/.stamp-test ## put every file into the house style
	ruff check --fix-only -q .
	ruff format .
	clang-format -i $(CPP_FILES)

stubs: ready ## write python/mgdd/_core/*.pyi from the built module
	rm -rf build/stubs
	$(STUBGEN) -o build/stubs
	rm -rf python/mgdd/_core
	cp -r build/stubs/mgdd/_core* python/mgdd/

# Both libraries must come first: libasan alone dies at the first C++ exception.
asan: MARKED ?= not slow and not docs and not study
asan: $(VENV)/.stamp-test | system-test ## ctest and pytest under AddressSanitizer and UBSan; all: MARKED="not docs"
	$(CONFIGURE) asan
	$(BUILD) asan
	$(ALOUD) ctest --preset asan -j$(JOBS)
	PYTHONPATH=$(CURDIR)/build/asan/python PYTHONUNBUFFERED=1 PYTHONMALLOC=malloc ASAN_OPTIONS=detect_leaks=0 \
	  UBSAN_OPTIONS=print_stacktrace=1 \
	  LD_PRELOAD="$$(g++ -print-file-name=libasan.so) $$(g++ -print-file-name=libstdc++.so)" \
	  $(PY) -m pytest -n $(JOBS) --dist worksteal -m "$(MARKED)"

tsan: $(VENV)/.stamp-build | system-test ## the C++ tests under ThreadSanitizer
	$(CONFIGURE) tsan
	$(BUILD) tsan
	$(ALOUD) ctest --preset tsan -j$(JOBS)

clang: $(VENV)/.stamp-build | system-test ## the module and the C++ tests by clang++
	@tools/system_packages.sh clang
	$(CONFIGURE) clang
	$(BUILD) clang
	$(ALOUD) ctest --preset clang -j$(JOBS)

mingw-check: $(VENV)/.stamp-build ## compile the core for Windows
	@tools/system_packages.sh mingw
	$(CONFIGURE) mingw
	$(BUILD) mingw

tidy: $(VENV)/.stamp-build | system-test ## clang-tidy over the core and its tests
	$(ALOUD) $(PIP) install --group tidy
	$(CONFIGURE) tidy
	$(BUILD) tidy

NEVERGRAD := build/bench-nevergrad/bin/python
bench: ready ## C++ benchmarks, then the Python ones against peers
	@tools/system_packages.sh bench
	$(ALOUD) $(PIP) install --group bench
	[ -x $(NEVERGRAD) ] || $(PYTHON) -m venv build/bench-nevergrad
	$(ALOUD) $(NEVERGRAD) -m pip --disable-pip-version-check install "pip>=25.1"
	$(ALOUD) $(NEVERGRAD) -m pip --disable-pip-version-check install -r $(VENV)/.stamp-run --group bench-nevergrad
	$(CONFIGURE) bench
	$(BUILD) bench
	for program in build/bench/bench/*; do $$program; done
	for script in benchmarks/*.py; do \
	  case $$script in */seekers_vs_peers.py) python=$(NEVERGRAD);; *) python=$(PY);; esac; \
	  [ ! -e $$script ] || $(DEV) $$python $$script; \
	done

.PHONY: fuzz
RUNS ?= 10000000
fuzz: $(VENV)/.stamp-build | system-test ## mutated records and random layouts under sanitizers: make fuzz RUNS=10000000
	$(CONFIGURE) dev -DMGDD_BUILD_TESTS=ON
	$(BUILD) dev --target mgdd_fuzz
	build/dev/mgdd_fuzz $(RUNS) $(SEED)

.PHONY: mutants
MODULE ?= throttle
mutants: ready ## changed lines that the tests notice: make mutants MODULE=throttle (Python: mgdd.throttle)
	$(ALOUD) $(PY) tools/mutate.py $(MODULE) --jobs $(JOBS) $(MUTANTS)

docs: SITE ?= docs/_build/html
docs: ready ## documentation, docs/_build/html; one version of a site: SITE=FOLDER/0.1.0
	$(DEV) $(ALOUD) $(PY) -m sphinx -W -n --keep-going -q -b html docs $(SITE)

.PHONY: changelog
changelog: $(VENV)/.stamp-test ## gather changelog.d into CHANGELOG.md, under the version of CMakeLists.txt
	towncrier build --yes --version "$$(sed -n 's/^ *VERSION \([0-9.]*\)$$/\1/p' CMakeLists.txt)"

.PHONY: clean help
clean: ## remove what these commands made
	rm -rf build $(VENV) docs/_build docs/generated docs/notebooks mgdd-report

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /\1\t/' | expand -t 14
