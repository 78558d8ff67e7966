# Two targets do everything on a fresh Debian 12 with Python 3.11:
#   make study   environment, default study, report
#   make test    environment, lint, types, tests
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
OUT ?= results/mq200

.PHONY: study test lint evidence constraints clean

study: $(VENV)/ready
	$(BIN)/dogshape study studies/mq200 --out $(OUT) --resume

test: $(VENV)/ready lint
	$(BIN)/python -m pytest -m "not slow"

lint: $(VENV)/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy sim surrogate diagnosis pipeline

# Slow evidence: minutes to hours, not part of 'make test'.
evidence: $(VENV)/ready
	$(BIN)/python -m pytest -m slow

$(VENV)/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	touch $@

# Resolve the newest versions that pyproject.toml allows and pin them.
constraints:
	rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e ".[dev]"
	$(BIN)/python -m pip freeze --all --exclude-editable --exclude pip > constraints.txt
	touch $(VENV)/ready

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
