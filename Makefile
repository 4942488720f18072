# What a newcomer types: `make demo` and `make test` do all set-up themselves; `make help` lists the rest.
SHELL       := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

PYTHON  ?= python3
VENV    ?= .venv
JOBS    ?= 2
PY      := $(VENV)/bin/python
PIP     := $(PY) -m pip --disable-pip-version-check
SUDO    := $(shell [ "$$(id -u)" = 0 ] || echo sudo)
LOGS    := build/logs
PRESET  := -DPython_EXECUTABLE=$(abspath $(PY))

export CMAKE_BUILD_PARALLEL_LEVEL := $(JOBS)
export CMAKE_CXX_COMPILER_LAUNCHER = $(shell command -v ccache)
ifndef MGDD_DATA_DIR
  ifneq ($(wildcard ../shared/data),)
    export MGDD_DATA_DIR := $(abspath ../shared/data)
  endif
endif

# --- set-up -------------------------------------------------------------------------------------------------
# Each test looks for the thing itself, so a compiler or a Python from elsewhere is as good as Debian's.
define INSTALL_MISSING
[ -z "$$missing" ] && exit 0; \
command -v apt-get >/dev/null || { echo "please install what Debian calls:$$missing" >&2; exit 1; }; \
echo "installing:$$missing"; \
$(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get update -qq; \
$(SUDO) env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $$missing >/dev/null
endef

.PHONY: system system-test
system:
	@missing=""; \
	command -v g++ >/dev/null || missing+=" build-essential"; \
	command -v cmake >/dev/null || missing+=" cmake"; \
	command -v ninja >/dev/null || missing+=" ninja-build"; \
	command -v $(PYTHON) >/dev/null || missing+=" python3"; \
	$(PYTHON) -c "import venv, ensurepip" 2>/dev/null || missing+=" python3-venv"; \
	$(PYTHON) -c "import sysconfig; open(sysconfig.get_path('include') + '/Python.h')" 2>/dev/null \
	  || missing+=" python3-dev"; \
	$(INSTALL_MISSING)

system-test: system
	@missing=""; \
	for package in libeigen3-dev libgtest-dev libbenchmark-dev; do \
	  dpkg -s $$package >/dev/null 2>&1 || missing+=" $$package"; \
	done; \
	$(INSTALL_MISSING)

$(VENV)/.stamp-build: pyproject.toml | system
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'Python 3.11 or newer is needed')"
	[ -x $(PY) ] || $(PYTHON) -m venv $(VENV)
	$(PIP) install -q "pip>=25.1"
	$(PIP) install -q --group build
	touch $@

$(VENV)/.stamp-test: $(VENV)/.stamp-build | system-test
	$(PIP) install -q --group test --group lint --group docs
	touch $@

# The package is installed again whenever a file that it is made of is new, changed or gone.
SOURCES := CMakeLists.txt pyproject.toml README.md \
           $(shell find cpp/include cpp/src cpp/systems cpp/bindings cmake python -type f \
             -not -path '*/__pycache__/*' -not -name '*.so' 2>/dev/null | sort)
MANIFEST := $(VENV)/.manifest
.PHONY: always
$(MANIFEST): always
	@mkdir -p $(@D); printf '%s\n' $(SOURCES) | cmp -s - $@ || printf '%s\n' $(SOURCES) > $@

$(VENV)/.stamp-mgdd: $(SOURCES) $(MANIFEST) $(VENV)/.stamp-build
	$(PIP) install -q --no-build-isolation .
	touch $@

.PHONY: install
install: $(VENV)/.stamp-mgdd ## build and install the package into .venv

# --- the two commands ---------------------------------------------------------------------------------------
.PHONY: demo test
demo: $(VENV)/.stamp-mgdd ## set up, then run the main job on the measured traces
	$(VENV)/bin/mgdd demo

test: $(VENV)/.stamp-mgdd $(VENV)/.stamp-test ## set up, then run every test of both languages
	@mkdir -p $(LOGS); rm -f $(LOGS)/*.log; failed=""; \
	{ cmake --preset dev $(PRESET) && cmake --build --preset dev -j$(JOBS) && ctest --preset dev -j$(JOBS); } \
	  2>&1 | tee $(LOGS)/ctest.log || failed+=" ctest"; \
	$(PY) -m pytest 2>&1 | tee $(LOGS)/pytest.log || failed+=" pytest"; \
	$(MAKE) --no-print-directory lint 2>&1 | tee $(LOGS)/lint.log || failed+=" lint"; \
	echo; echo "--- summary ---"; \
	echo "ctest:  $$(grep -h 'tests passed' $(LOGS)/ctest.log | tail -n 1)"; \
	echo "pytest: $$(tail -n 1 $(LOGS)/pytest.log)"; \
	[ -z "$$failed" ] || { echo "FAILED:$$failed"; exit 1; }

# --- quality ------------------------------------------------------------------------------------------------
CPP_FILES = $(shell find cpp tests/cpp -name '*.hpp' -o -name '*.cpp')
STUBGEN   = $(PY) -m pybind11_stubgen mgdd._core

.PHONY: lint format stubs asan tidy bench docs
lint: $(VENV)/.stamp-test ## ruff, mypy --strict, clang-format, codespell: look, change nothing
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/clang-format --dry-run -Werror $(CPP_FILES)
	$(VENV)/bin/codespell

format: $(VENV)/.stamp-test ## put every file into the house style
	$(VENV)/bin/ruff check --fix-only -q .
	$(VENV)/bin/ruff format .
	$(VENV)/bin/clang-format -i $(CPP_FILES)

stubs: $(VENV)/.stamp-mgdd $(VENV)/.stamp-test ## write python/mgdd/_core.pyi from the built module
	rm -rf build/stubs
	$(STUBGEN) -o build/stubs
	rm -rf python/mgdd/_core python/mgdd/_core.pyi
	cp -r build/stubs/mgdd/_core* python/mgdd/

# Both libraries must come first: libasan alone dies at the first C++ exception.
asan: $(VENV)/.stamp-mgdd $(VENV)/.stamp-test ## ctest and pytest under AddressSanitizer and UBSan
	cmake --preset asan $(PRESET)
	cmake --build --preset asan -j$(JOBS)
	ctest --preset asan -j$(JOBS)
	PYTHONPATH=$(abspath build/asan/python) PYTHONMALLOC=malloc ASAN_OPTIONS=detect_leaks=0 \
	  UBSAN_OPTIONS=print_stacktrace=1 \
	  LD_PRELOAD="$$(g++ -print-file-name=libasan.so) $$(g++ -print-file-name=libstdc++.so)" \
	  $(PY) -m pytest -m "not docs"

tidy: $(VENV)/.stamp-test ## clang-tidy over the core and its tests
	$(PIP) install -q --group tidy
	PATH="$(abspath $(VENV))/bin:$$PATH" cmake --preset tidy
	PATH="$(abspath $(VENV))/bin:$$PATH" cmake --build --preset tidy -j$(JOBS)

bench: $(VENV)/.stamp-mgdd $(VENV)/.stamp-test ## C++ benchmarks, then the Python ones against peers
	$(PIP) install -q --group bench
	cmake --preset bench
	cmake --build --preset bench -j$(JOBS)
	for program in build/bench/bench/*; do $$program; done
	for script in benchmarks/*.py; do [ ! -e $$script ] || $(PY) $$script; done

.PHONY: mutants
MODULE ?= throttle
mutants: $(VENV)/.stamp-test ## changed lines that the tests notice: make mutants MODULE=throttle (Python: mgdd.throttle)
	PATH="$(abspath $(VENV))/bin:$$PATH" $(PY) tools/mutate.py $(MODULE) --jobs $(JOBS) $(MUTANTS)

docs: $(VENV)/.stamp-mgdd $(VENV)/.stamp-test ## documentation with executed notebooks, docs/_build/html
	MGDD_DOCS_EXECUTE=cache $(PY) -m sphinx -W -n --keep-going -q -b html docs docs/_build/html

.PHONY: clean help
clean: ## remove what these commands made
	rm -rf build $(VENV) docs/_build docs/generated docs/notebooks mgdd-report

help: ## this list
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /\1\t/' | expand -t 10
