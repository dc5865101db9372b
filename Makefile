# Every target works on a fresh checkout with Python 3.11+ and nothing else installed by hand.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
ARGS ?=
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check
# uv takes a tenth of pip's time for the same packages; where it, or the index it asks, is not to be had, pip installs them.
UV := UV_HTTP_TIMEOUT=20 UV_HTTP_RETRIES=1 $(BIN)/uv pip install --python $(BIN)/python

.PHONY: install demo test lint docs bench lock format
install: $(VENV)/.installed

$(VENV)/.installed: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "impactcell needs Python 3.11 or newer; set PYTHON=...")'
	$(PYTHON) -m venv $(VENV)
	@$(PIP) --retries 0 --timeout 20 uv || true
	$(UV) -r requirements.lock || $(PIP) -r requirements.lock
	$(UV) --no-deps --editable . || $(PIP) --no-deps --editable .
	@touch $@

# Ctrl-C is how it ends: the exit code for that is no error to report.
demo: install
	@trap : INT; $(BIN)/impactcell demo $(ARGS) || { code=$$?; [ $$code -eq 130 ] || exit $$code; }

# Each worker, and each process that a test starts, would compile all sources anew where bytecode is not kept.
test: export PYTHONDONTWRITEBYTECODE =
test: install
	$(BIN)/python -m pytest -n auto --maxprocesses 4 --dist worksteal $(ARGS)

lint: install
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d docs/_build/doctrees docs docs/_build/html
	@echo docs/_build/html/index.html

$(VENV)/.docs: $(VENV)/.installed docs/requirements.lock
	$(UV) -r docs/requirements.lock || $(PIP) -r docs/requirements.lock
	@touch $@

format: install
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

bench: install
	$(BIN)/python -m tests.benchmarks $(ARGS)

# Written anew only when pyproject.toml changes its bounds.
lock: install
	$(PIP) uv
	$(BIN)/uv pip compile --universal --python-version 3.11 --extra dev --upgrade --no-header \
		--no-emit-index-url --no-emit-find-links pyproject.toml -o requirements.lock
	$(BIN)/uv pip compile --universal --python-version 3.11 --extra docs --upgrade --no-header \
		--no-emit-index-url --no-emit-find-links -c requirements.lock pyproject.toml -o docs/requirements.lock
