# Two targets do everything on a fresh Debian 12 with Python 3.11:
#   make study   environment, default study, report
#   make test    environment, lint, types, tests
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
OUT ?= results/mq200

# What Debian must bring beside Python itself: venv, and a library that Drake loads.
DEBIAN := python3.11-venv libglib2.0-0
SYSTEM_OK := $(PYTHON) -c 'import ensurepip, ctypes; ctypes.CDLL("libglib-2.0.so.0")'

.PHONY: study test lint constraints system clean

study: $(VENV)/ready
	$(BIN)/dogshape study studies/mq200 --out $(OUT) --resume

test: $(VENV)/ready lint
	$(BIN)/python -m pytest

lint: $(VENV)/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy sim surrogate diagnosis pipeline

$(VENV)/ready: pyproject.toml constraints.txt | system
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	touch $@

# Install what is missing where that is possible, and say what to do where it is not.
system:
	@$(SYSTEM_OK) 2>/dev/null || { test "$$(id -u)" = 0 && command -v apt-get >/dev/null && \
	  apt-get update -q && DEBIAN_FRONTEND=noninteractive \
	  apt-get install -y -q --no-install-recommends $(DEBIAN); } || \
	  { echo "Missing system packages; run: sudo apt-get install $(DEBIAN)" >&2; exit 2; }

# Resolve the newest versions that pyproject.toml allows and pin them.
constraints: system
	rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	$(BIN)/python -m pip freeze --all --exclude-editable --exclude pip > constraints.txt
	touch $(VENV)/ready

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
