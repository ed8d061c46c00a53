# lidarlift: `make` lists the targets. Everything is installed into .venv; no need to activate it.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Stamps: what each target needs is installed once, and the runtime comes along with everything else.
RUNTIME := $(VENV)/.ready-runtime
DEV := $(VENV)/.ready-dev
DOCS := $(VENV)/.ready-docs
BENCHMARKS := $(VENV)/.ready-benchmarks
# Peers that want other versions than lidarlift, in environments of their own. All versions: benchmarks/peers.txt.
PEERS := kiss-slam rko-lio ouster-sdk
OWN := $(PEERS:%=.peers/%/.ready)
# Compiled kernels, again when the code of one has changed.
KERNELS := $(VENV)/.ready-kernels

PYTEST := $(BIN)/pytest -n 2 --dist loadfile

# What numpy, OpenBLAS, numba, PyTorch, OpenCV and the C library choose where a CPU has nothing newer than SSE. ONNX
# Runtime and Embree have no such switch.
SIMD := import numpy; print(*numpy.show_config("dicts")["SIMD Extensions"].get("found", []))
PLAIN := NUMBA_CPU_NAME=generic NUMBA_CPU_FEATURES= NUMBA_CACHE_DIR="$(CURDIR)/.pytest_cache/numba" \
    OPENBLAS_CORETYPE=Prescott MKL_ENABLE_INSTRUCTIONS=SSE4_2 ATEN_CPU_CAPABILITY=default ONEDNN_MAX_CPU_ISA=SSE41 \
    OPENCV_CPU_DISABLE=AVX512-SKX,AVX2,AVX,FP16,FMA3 GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-AVX

# Packages come without byte code (see pip below): what is imported is compiled once, whatever the environment says.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup demo test portable lint docs wheel benchmark results peers clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

setup: $(KERNELS) ## install into .venv what lidarlift runs with: Debian packages, Python packages, the command

demo: $(RUNTIME) ## no data needed: simulate a sequence, run it at 16 and 64 channels, compare (ARGS="--quick": a part)
	@$(BIN)/lidarlift demo $(ARGS)

test: $(DEV) ## run the tests (ARGS="-k ndt" for some of them; recorded sequences: see CONTRIBUTING.md)
	@$(PYTEST) $(ARGS)

portable: $(DEV) ## run the tests with the plainest kernels of every library: none may depend on how a CPU rounds
	@env NPY_DISABLE_CPU_FEATURES="$$($(BIN)/python -c '$(SIMD)')" $(PLAIN) $(PYTEST) $(ARGS)

lint: $(DEV) ## check style, types and the import contract
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

docs: $(DOCS) ## build the documentation site into build/site; a broken link is an error
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build
	@echo "build/site/index.html"

wheel: $(DEV) ## build the wheel into dist, and try it in an environment of its own
	@$(BIN)/python .ci/wheel.py dist

benchmark: $(BENCHMARKS) ## measure in comparison with the peers: make benchmark DATASETS="SEQUENCE [SEQUENCE ...]"
	@test -n "$(DATASETS)" || { echo 'Which sequences? make benchmark DATASETS="path/to/sequence ..."' >&2; exit 2; }
	@$(BIN)/python -m benchmarks.odometry.frame_rate $(DATASETS)

results: $(BENCHMARKS) ## make all tables and pictures again, on what data is there (ARGS="--list", "--data FOLDER TOPIC")
	@$(BIN)/python -m benchmarks.regenerate $(ARGS)

peers: $(BENCHMARKS) $(OWN) ## install the systems that we compare with: into .venv, or .peers if their versions conflict

clean: ## remove .venv, .peers and what builds and tools left
	rm -rf $(VENV) .peers build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# What Debian has to bring: libusb-1.0 for open3d, and venv's ensurepip where python3 comes without it.
# ldconfig lies in /sbin, which is not on everyone's PATH; other systems have none and need nothing of this.
$(RUNTIME) $(DEV) $(DOCS) $(BENCHMARKS): pyproject.toml constraints.txt benchmarks/peers.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || { \
	    echo "lidarlift needs Python 3.11 or newer, '$(PYTHON)' is not: make setup PYTHON=python3.12" >&2; exit 1; }
	@PATH="$$PATH:/usr/sbin:/sbin"; missing=; \
	if command -v ldconfig >/dev/null && ! ldconfig -p | grep libusb-1.0 >/dev/null; then missing=libusb-1.0-0; fi; \
	if ! test -x $(BIN)/python && ! $(PYTHON) -c 'import ensurepip' 2>/dev/null; then \
	    missing="$$missing $$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')"; fi; \
	test -z "$$missing" && exit; \
	as_root=; test "$$(id -u)" = 0 || as_root=sudo; \
	if command -v apt-get >/dev/null && { test -z "$$as_root" || command -v sudo >/dev/null; }; then \
	    echo "Installing Debian packages: $$missing"; \
	    $$as_root apt-get -qq update || true; \
	    $$as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends $$missing && exit; \
	fi; \
	echo "Please install with your system's packages (names as in Debian), then run make again: $$missing" >&2
	@test -x $(BIN)/python -a -x $(BIN)/pip || $(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
	    echo "No virtual environment: '$(PYTHON)' has no working venv (Debian: apt-get install python3-venv)" >&2; exit 1; }
	@echo "Installing Python packages into $(VENV) ($(SIZE)): some minutes the first time"
	@# --no-compile: Python compiles what is imported, and that is a small part
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt \
	    -c benchmarks/peers.txt -e '.$(EXTRAS)'
	@$(BIN)/python -c 'import open3d' >/dev/null || { \
	    echo "open3d does not start: see the error above (on Debian it needs libusb-1.0-0)" >&2; exit 1; }
	@touch $(RUNTIME) $@

$(KERNELS): $(RUNTIME) $(wildcard */*/kernels.py */*/*/kernels.py slam/simulation/shading.py)
	@echo "Compiling kernels: about a minute, once"
	@$(BIN)/python -m lidarlift.preparing || true
	@touch $@

$(OWN): .peers/%/.ready: $(BENCHMARKS)
	@echo "Installing $* into .peers/$*"
	@test -x $(@D)/bin/pip || $(BIN)/python -m venv $(@D)
	@$(@D)/bin/python -m pip install --quiet --disable-pip-version-check --no-compile -c benchmarks/peers.txt $* $(ALSO)
	@touch $@

.peers/kiss-slam/.ready: ALSO := pillow
$(RUNTIME): SIZE := 1.5 GB
$(DOCS): EXTRAS := [docs]
$(DOCS): SIZE := 1.6 GB
$(DEV): EXTRAS := [dev,benchmarks]
$(DEV): SIZE := 3 GB
$(BENCHMARKS): EXTRAS := [benchmarks]
$(BENCHMARKS): SIZE := 2 GB
