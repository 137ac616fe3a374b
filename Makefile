# `make help` lists the targets. Python 3.11 and make are all that a machine needs.

FLIGHT  ?= data/flights/acx4
ifeq ($(origin PYTHON),undefined)
PYTHON  := $(shell command -v python3.11 || command -v python3)
endif
PORT    ?= 8000
# What Python makes of the sources is kept: hundreds of processes load the same ones.
unexport PYTHONDONTWRITEBYTECODE
# Pictures in the flight that ships: at which exposures of blocks 1 and 2, and at what part of the size.
IMAGES  ?= H1-05,H3-04,C2-05
REDUCE  ?= 4
# The notebook of make page.
CHAPTER ?= 11-ten-heads
# Mutated flights for make fuzz.
N       ?= 1000
SEED    ?= 1

SHIPPED := data/flights/acx4 data/flights/acx4-ideal

# What is given is a number, a program or a name, and nothing else: make expands nothing in it, and
# refuses what it or a shell would read.
override CHAPTER := $(value CHAPTER)
override FLIGHT := $(value FLIGHT)
override IMAGES := $(value IMAGES)
override PYTHON := $(value PYTHON)
override PORT   := $(value PORT)
override REDUCE := $(value REDUCE)
override N      := $(value N)
override SEED   := $(value SEED)
export FLIGHT
UNSAFE := $$ ; & | < > ( ) * ? [ ] { } ! ~ ' " ` \ \# % : =
unsafe = $(strip $(foreach c,$(UNSAFE),$(findstring $c,$1)))
no_number = $(or $(if $1,,nothing),$(subst 0,,$(subst 1,,$(subst 2,,$(subst 3,,$(subst 4,,$(subst 5,,$(subst 6,,$(subst 7,,$(subst 8,,$(subst 9,,$1)))))))))))
$(foreach v,PORT REDUCE N SEED,$(if $(call no_number,$($v)),$(error $v=$($v): must be a whole number)))
$(if $(word 2,$(IMAGES))$(call unsafe,$(IMAGES)),$(error IMAGES=$(IMAGES): must be names of exposures with commas between them))
$(if $(findstring ',$(PYTHON)),$(error PYTHON=$(PYTHON): must be the path of a program))
$(if $(word 2,$(CHAPTER))$(call unsafe,$(CHAPTER)),$(error CHAPTER=$(CHAPTER): must be the name of a notebook))
$(if $(word 2,$(FLIGHT)),$(error FLIGHT=$(FLIGHT): make takes no folder with a space in its name))
$(if $(call unsafe,$(FLIGHT)),$(error FLIGHT=$(FLIGHT): make takes no folder with $(call unsafe,$(FLIGHT)) in its name))

BIN       := .venv/bin
# One folder of results per flight, however it is called: by the path from here, / written as -.
RESULTS   := build/results/$(shell (cd -- '$(FLIGHT)' 2>/dev/null && pwd || printf '%s\n' '$(FLIGHT)') \
               | sed "s|^$$PWD/||; s|/|-|g")
RAN       := build/stamps/$(notdir $(RESULTS))
# Python compiles what is imported; most of what is installed never is.
PIP       := $(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -c environment.lock
NOTEBOOKS := $(wildcard notebooks/*.ipynb)
SOURCES   := $(shell find src -name '*.py' 2>/dev/null)

# Make removes only what bears a mark: of acx4, which lists its files, or of make.
BOOK      := book/_build book/_executed book/_generated
define REMOVE_BOOK
for made in $(BOOK); do \
  test ! -e $$made || test -e $$made/.made-by-make || \
    { echo "$$made: was not made by make; move it away" >&2; exit 2; }; \
  rm -rf $$made; \
done
endef

STUDY     := data/flights/acx4
SITE      := $(if $(filter $(STUDY),$(FLIGHT)),book/_build/html,build/books/$(notdir $(RESULTS)))
INDEX     := $(SITE)/index.html

# The matrices are small: more threads cost more than they bring.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:
.PHONY: help .venv lock check test test-all fuzz mistakes notebooks lab book page release serve bench coverage chain reference-data reference-results clean

help: ## list these targets
	@awk -F ':.*## ' '/^[.a-z-]+:.*## / { printf "  %-18s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)
	@echo "  make book FLIGHT=folder builds the book of another flight than $(FLIGHT)"

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

.venv/.stamp-lab: environment-lab.txt .venv/.stamp
	@$(PIP) -r environment-lab.txt
	@touch $@

.venv/.stamp-test: environment-test.txt .venv/.stamp
	@$(PIP) -r environment-test.txt
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
	@layers=$$($(BIN)/lint-imports --no-logo) || { echo "$$layers" >&2; exit 1; }
	@houses=$$($(BIN)/pytest -q tests/project/test_houses.py) || { echo "$$houses" >&2; exit 1; }
	@$(if $(NOTEBOOKS),$(BIN)/nbstripout --keep-id --verify $(NOTEBOOKS) $(wildcard notebooks/*/*.ipynb))
	@$(BIN)/codespell src notebooks book *.md
	@PYTHONPATH=tests $(BIN)/python -m project.sizes

test: .venv/.stamp-test ## the tests, slow ones included, but not what repeats what a smaller case shows
	@$(BIN)/pytest -q -n 2 --dist worksteal -m 'not repeats'

test-all: .venv/.stamp-test ## all tests
	@$(BIN)/pytest -q -n 2 --dist worksteal

fuzz: .venv/.stamp-test ## read N mutated flights, drawn by SEED
	@PYTHONPATH=tests nice $(BIN)/python -m support.fuzz.run --cases $(N) --seed $(SEED)

mistakes: .venv/.stamp-test ## plant every systematic mistake in flights of every size, and count what is named rightly
	@PYTHONPATH=tests nice $(BIN)/python -m benchmarks.planted_mistakes

bench: .venv/.stamp-test ## time commands, and the adjustment beside others, for data/benchmarks
	@PYTHONPATH=tests $(BIN)/python -m benchmarks.bench

coverage: .venv/.stamp-test ## errors of simulated flights over their sigma, and their verdicts, for data/benchmarks
	@PYTHONPATH=tests nice $(BIN)/python -m benchmarks.coverage_flights
	@PYTHONPATH=tests nice $(BIN)/python -m benchmarks.measured_flights
	@PYTHONPATH=tests nice $(BIN)/python -m benchmarks.verdicts.flights

chain: .venv/.stamp-test ## adjust simulated flights with and without a synthetic image, for data/benchmarks
	@PYTHONPATH=tests nice $(BIN)/python -m benchmarks.closed_chain

# --- the notebooks on one flight -----------------------------------------------------------

# The flights that ship are simulated: the same seed, the same bytes. Only the first has pictures.
data/flights/acx4/flight.toml: PICTURES = --images '$(IMAGES)' --reduce '$(REDUCE)'
$(SHIPPED:%=%/flight.toml): $(shell find src/acx4sim -name '*.py') | .venv/.stamp
	@rm -rf $(@D)
	@$(BIN)/acx4 simulate $(notdir $(@D)) --out $(@D) $(PICTURES)
	@echo $(@D)

FLIGHT_FILES := $(if $(filter $(SHIPPED),$(FLIGHT)),$(FLIGHT)/flight.toml,$(wildcard \
                  $(foreach f,$(wildcard $(FLIGHT)/*.* $(FLIGHT)/*/*.csv),$(if $(call unsafe,$f),,$f))))

$(RAN): $(FLIGHT_FILES) $(NOTEBOOKS) $(SOURCES) .venv/.stamp
	@$(BIN)/acx4 run --results '$(RESULTS)' -- "$$FLIGHT"
	@mkdir -p $(@D) && touch '$@'
	@echo '$(RESULTS)'

# Beside the study's flight, in the same book: the one of an ideal synthetic camera, whose heads are the same.
ifeq ($(FLIGHT),$(STUDY))
IDEAL := build/results/data-flights-acx4-ideal
build/stamps/$(notdir $(IDEAL)): data/flights/acx4-ideal/flight.toml $(NOTEBOOKS) $(SOURCES) .venv/.stamp
	@$(BIN)/acx4 run --results '$(IDEAL)' --stages mounting,validation -- $(<D)
	@mkdir -p $(@D) && touch '$@'
	@echo '$(IDEAL)'
endif

notebooks: $(RAN) $(IDEAL:build/results/%=build/stamps/%) ## run the notebooks on FLIGHT

lab: .venv/.stamp-lab $(firstword $(SHIPPED))/flight.toml ## open the notebooks in JupyterLab
	@$(BIN)/jupyter lab notebooks

# --- the book ------------------------------------------------------------------------------

# Chapters that depend on no flight are kept in build/chapters. The book of another flight has none
# of the study's pages, and lies in build/books.
ifeq ($(FLIGHT),$(STUDY))
.PHONY: chapters
chapters: build/stamps/$(notdir $(IDEAL)) # beside the notebooks, which leave a processor free
	@$(BIN)/python -m acx4book.pages chapters $(IDEAL)

book: notebooks chapters ## build the book strictly, from the notebooks run on FLIGHT
	@$(REMOVE_BOOK)
	@for made in $(BOOK); do mkdir $$made && touch $$made/.made-by-make; done
	@$(BIN)/python -m acx4book.pages "$$FLIGHT" '$(RESULTS)' book $(IDEAL)
	@$(BIN)/jupyter-book build book --toc '$(CURDIR)/book/_generated/_toc.yml' --quiet -W -n --keep-going > /dev/null
	@echo $(INDEX)
else
book: notebooks
	@$(BIN)/acx4 book --strict --out '$(SITE)' -- '$(RESULTS)'
endif

# Of the book as it is built, whatever its flight; where there is none yet it is built.
$(INDEX): | .venv/.stamp
	@$(MAKE) --no-print-directory book

page: .venv/.stamp ## build the page of one notebook, as make page CHAPTER=11-ten-heads, in build/page
	@$(BIN)/python -m acx4book.pages chapter '$(CHAPTER)' '$(RESULTS)' build/page
	@echo build/page/_executed/$(CHAPTER).html

# The book is built from the commit that is released, so that it names this one.
release: check book ## check, and make the wheel and the archive of the book, in build/release
	@$(BIN)/python -m acx4book.pages.release book/_build/html build/release

serve: ## show the built book of FLIGHT at localhost:PORT
	@$(BIN)/python -m http.server --bind localhost --directory $(SITE) $(PORT)

# --- data and cleaning ---------------------------------------------------------------------

reference-data: .venv/.stamp-test ## bring the public measurements of data/reference/index.csv
	@$(BIN)/python -m acx4book.reference.data

reference-results: .venv/.stamp ## compute what the book shows of these anew, and store it; 20 minutes
	@$(BIN)/python -m acx4book.reference && echo data/reference/results data/reference/four-heads
	@PYTHONPATH=tests $(BIN)/python -m benchmarks.imports && echo data/benchmarks/imports.csv

clean: ## remove all that was made, except .venv and the reference data
	@$(REMOVE_BOOK)
	@rm -rf $(SHIPPED) $(SHIPPED:%=%.truth.json) build/results/data-flights-* build/books/data-flights-*
	@rm -rf build/stamps build/chapters build/release
	@rmdir build/results build/books build data/flights 2> /dev/null || true
	@rm -rf .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache
