# `make help` lists the targets. Python 3.11 and make are all that a machine needs.

FLIGHT  ?= data/flights/acx4
PYTHON  ?= $(shell command -v python3.11 || command -v python3)
PORT    ?= 8000
# Pictures in the flight that ships: at which exposures of blocks 1 and 2, and at what part of the size.
IMAGES  ?= H1-05,H3-04,C2-05
REDUCE  ?= 4
# The notebook of make page; mutated flights for make fuzz.
CHAPTER ?= 11-ten-heads
N       ?= 1000
SEED    ?= 1

$(if $(word 2,$(FLIGHT)),$(error FLIGHT=$(FLIGHT): make takes no folder with a space in its name))

# One folder of results for each flight, however it is called: by the path from here, / written as -.
STUDY   := data/flights/acx4
override FLIGHT := $(patsubst $(CURDIR)/%,%,$(abspath $(FLIGHT)))
NAME    := $(subst /,-,$(FLIGHT))
RESULTS := build/results/$(NAME)
IDEAL   := $(if $(filter $(STUDY),$(FLIGHT)),build/results/data-flights-acx4-ideal)
SITE    := $(if $(filter $(STUDY),$(FLIGHT)),book/_build/html,build/books/$(NAME))
SHIPPED := $(STUDY) data/flights/acx4-ideal
BOOK    := book/_build book/_executed book/_generated

BIN     := .venv/bin
PIP     := $(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -c environment.lock
NOTEBOOKS := $(wildcard notebooks/*.ipynb)
SOURCES := $(shell find src -name '*.py')

# The matrices are small: more threads cost more than they bring.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
# What Python makes of the sources is kept: hundreds of processes load the same ones.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:
.PHONY: help .venv lock check test test-all fuzz mistakes notebooks lab book chapters page release serve bench coverage chain reference-data reference-results clean

help: ## list these targets
	@awk -F ':.*## ' '/^[.a-z-]+:.*## / { printf "  %-18s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@echo "  make book FLIGHT=folder builds the book of another flight than $(STUDY)"

# --- set-up: the only part that needs the network ------------------------------------------

.venv: .venv/.stamp-test ## set up the Python environment (the other targets do it by themselves)

.venv/.stamp: environment.txt environment.lock pyproject.toml
	@'$(PYTHON)' -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	  || { echo "acx4lib needs Python 3.11: make PYTHON=path/to/python3.11" >&2; exit 1; }
	@echo "setting up .venv, which takes a minute or two"
	@'$(PYTHON)' -m venv .venv
	@$(PIP) -r environment.txt
	@$(PIP) --no-deps --no-build-isolation -e .
	@touch $@

.venv/.stamp-%: environment-%.txt .venv/.stamp
	@$(PIP) -r $<
	@touch $@

lock: .venv/.stamp-test .venv/.stamp-lab ## write environment.lock anew from what is installed
	@{ sed -n '/^#/p' environment.lock; \
	   $(BIN)/python -m pip freeze --all --exclude pip --exclude acx4lib; } > .venv/lock
	@mv .venv/lock environment.lock && echo environment.lock

# --- checks --------------------------------------------------------------------------------

check: .venv/.stamp-test ## style, types, layers, notebooks without outputs, spelling; sizes of the houses
	@$(BIN)/ruff check --quiet
	@$(BIN)/ruff format --check --quiet
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-logo > .venv/layers || { cat .venv/layers >&2; exit 1; }
	@$(BIN)/pytest -q tests/project/test_houses.py > .venv/houses || { cat .venv/houses >&2; exit 1; }
	@$(BIN)/nbstripout --keep-id --verify $(NOTEBOOKS) $(wildcard notebooks/*/*.ipynb)
	@$(BIN)/codespell src notebooks book *.md
	@PYTHONPATH=tests $(BIN)/python -m project.sizes

test: .venv/.stamp-test ## the tests, slow ones included, but not what repeats what a smaller case shows
	@$(BIN)/pytest -q -n 2 --dist worksteal -m 'not repeats'

test-all: .venv/.stamp-test ## all tests
	@$(BIN)/pytest -q -n 2 --dist worksteal

TESTS := @PYTHONPATH=tests nice $(BIN)/python -m

fuzz: .venv/.stamp-test ## read N mutated flights, drawn by SEED
	$(TESTS) support.fuzz.run --cases '$(N)' --seed '$(SEED)'

mistakes: .venv/.stamp-test ## plant every systematic mistake in flights of every size, and count what is named rightly
	$(TESTS) benchmarks.planted_mistakes

bench: .venv/.stamp-test ## time commands, and the adjustment beside Ceres, for data/benchmarks
	@PYTHONPATH=tests $(BIN)/python -m benchmarks.bench
	@PYTHONPATH=tests $(BIN)/python -m benchmarks.adjusting.adjustment
	@PYTHONPATH=tests $(BIN)/python -m benchmarks.adjusting.orders

coverage: .venv/.stamp-test ## errors of simulated flights over their sigma, and their verdicts, for data/benchmarks
	$(TESTS) benchmarks.coverage_flights
	$(TESTS) benchmarks.measured_flights
	$(TESTS) benchmarks.verdicts.flights

chain: .venv/.stamp-test ## adjust simulated flights with and without a synthetic image, for data/benchmarks
	$(TESTS) benchmarks.closed_chain

# --- the notebooks on one flight -----------------------------------------------------------

# The flights that ship are simulated: the same seed, the same bytes. Only the first has pictures.
$(STUDY)/flight.toml: PICTURES = --images '$(IMAGES)' --reduce '$(REDUCE)'
$(SHIPPED:%=%/flight.toml): $(shell find src/acx4sim -name '*.py') | .venv/.stamp
	@rm -rf $(@D) $(@D).truth.json
	@$(BIN)/acx4 simulate $(notdir $(@D)) --out $(@D) $(PICTURES)

# A flight's tables; of those that ship, their settings, which are written last.
tables = $(if $(filter $(SHIPPED),$1),$1/flight.toml,$(wildcard $1/*.toml $1/*.csv $1/*.tif $1/*.gtx $1/*/*.csv))

build/stamps/$(NAME): $(call tables,$(FLIGHT)) $(NOTEBOOKS) $(SOURCES) .venv/.stamp
	@$(BIN)/acx4 run --results '$(RESULTS)' -- '$(FLIGHT)'
	@mkdir -p $(@D) && touch '$@'
	@echo '$(RESULTS)'

# Beside the study's flight, in the same book: the one of an ideal synthetic camera, whose heads are the same.
$(IDEAL:build/results/%=build/stamps/%): data/flights/acx4-ideal/flight.toml $(NOTEBOOKS) $(SOURCES) .venv/.stamp
	@$(BIN)/acx4 run --results '$(IDEAL)' --stages mounting,validation -- $(<D)
	@mkdir -p $(@D) && touch '$@'
	@echo '$(IDEAL)'

notebooks: build/stamps/$(NAME) $(IDEAL:build/results/%=build/stamps/%) ## run the notebooks on FLIGHT

lab: .venv/.stamp-lab $(STUDY)/flight.toml ## open the notebooks in JupyterLab
	@$(BIN)/jupyter lab notebooks

# --- the book ------------------------------------------------------------------------------

chapters: $(IDEAL:build/results/%=build/stamps/%) # beside the notebooks, which leave a processor free
	@$(if $(IDEAL),$(BIN)/python -m acx4book.pages chapters $(IDEAL))

# Chapters that depend on no flight are kept in build/chapters. The book of another flight has none
# of the study's pages, and lies in build/books.
book: notebooks chapters ## build the book strictly, from the notebooks run on FLIGHT
ifneq ($(IDEAL),)
	@rm -rf $(BOOK)
	@$(BIN)/python -m acx4book.pages '$(FLIGHT)' '$(RESULTS)' book $(IDEAL)
	@$(BIN)/jupyter-book build book --toc '$(CURDIR)/book/_generated/_toc.yml' --quiet -W -n --keep-going > /dev/null
	@echo $(SITE)/index.html
else
	@$(BIN)/acx4 book --strict --out '$(SITE)' -- '$(RESULTS)'
endif

page: .venv/.stamp ## build the page of one notebook, as make page CHAPTER=11-ten-heads, in build/page
	@$(BIN)/python -m acx4book.pages chapter '$(CHAPTER)' '$(RESULTS)' build/page
	@echo 'build/page/_executed/$(CHAPTER).html'

# The book is built from the commit that is released, so that it names this one.
release: check book ## check, and make the wheel and the archive of the book, in build/release
	@$(BIN)/python -m acx4book.pages.release book/_build/html build/release

serve: ## show the built book of FLIGHT at localhost:PORT
	@$(BIN)/python -m http.server --bind localhost --directory '$(SITE)' '$(PORT)'

# --- data and cleaning ---------------------------------------------------------------------

reference-data: .venv/.stamp-test ## bring the public measurements of data/reference/index.csv
	@$(BIN)/python -m acx4book.reference.data

reference-results: .venv/.stamp ## compute what the book shows of these anew, and store it; 20 minutes
	@$(BIN)/python -m acx4book.reference && echo data/reference/results data/reference/four-heads
	@PYTHONPATH=tests $(BIN)/python -m benchmarks.imports && echo data/benchmarks/imports.csv

clean: ## remove all that was made, except .venv and the reference data
	@rm -rf build $(BOOK) $(SHIPPED) $(SHIPPED:%=%.truth.json)
	@rm -rf .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
