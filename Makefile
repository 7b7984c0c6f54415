# make demo    install and linearize the simulated LT40
# make test    install what tests need, then lint, types, import rules and tests
# make test-slow, make bench, make data SOURCE=DIR, make constraints

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCE ?= ../shared/data

.PHONY: demo test test-slow lint bench data constraints clean

demo: $(VENV)/.run
	$(BIN)/labdrive run recipes/optimize.yaml

test: lint data
	$(BIN)/pytest -n 2 -m "not slow"

test-slow: $(VENV)/.dev data
	$(BIN)/pytest -m slow

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.dev
	for file in benchmarks/*.py; do $(BIN)/python $$file || exit 1; done

# The stamps are written last, so that a half-done installation is done again by the next make.
$(VENV)/.run: pyproject.toml constraints.txt
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet -c constraints.txt -e .
	touch $@

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/.run
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[dev]'
	touch $@

# Real recordings are not ours to ship: link them where the recipes look, if they are at hand.
data:
	@for folder in odrive phd2 laas nmm; do \
	  if [ -d "$(SOURCE)/$$folder" ]; then \
	    ln -sfn "$$(cd "$(SOURCE)/$$folder" && pwd)" recipes/data/$$folder; \
	  elif [ ! -e recipes/data/$$folder ]; then \
	    echo "recipes/data/$$folder is missing: see recipes/data/README.md"; \
	  fi; \
	done

constraints: $(VENV)/.dev
	uv pip compile --universal --all-extras --no-emit-index-url --no-header \
	  --python-version 3.11 pyproject.toml -o constraints.txt

clean:
	rm -rf $(VENV) dist
