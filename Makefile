# Two targets do everything on a fresh Debian 12 with Python 3.11:
#   make study   environment, default study, report
#   make test    environment, lint, types, tests (ten minutes on two idle cores)
# make test-fast runs tests/unit alone: no server, browser or study (two minutes on two idle cores).
# make surrogate simulates and fits the surrogate that the package brings (minutes), with the table
# that judges surrogates of three clutches (half an hour).
# make bank simulates the bank that the package brings for the published data sets, with the
# flights of traces (ten minutes).
# make studies runs all bundled studies and keeps their results in studies/ (half an hour).
# make samplers compares samplers on six studies (an hour and a half).
# make evidence runs the slow tests and writes the tables of docs/evidence again (an hour).
# make blind makes, diagnoses and scores data whose effect is withheld (half an hour on two cores);
# stopped, it goes on.
# make gaps diagnoses the bundled bench tables and keeps the records in docs/evidence (minutes).
# make figures writes the tables and drawings of README.md, docs and paper from kept results and docs/evidence.
# make docs builds the pages of docs and the API as a site in build/site, without a network.
# make docs-versions builds the pages of the clone and of the last release, or of TAG, in build/versions, with
# a menu of both.
# make history measures the computing times of this version for docs/evidence/history.csv (two minutes).
# make processors repeats the diagnosis of the stand with the vector instructions, kernels of linear
# algebra and threads of other processors (a quarter of an hour).
# make release builds sdist and wheel into dist and tries both in empty environments; OFFLINE=1 takes
# the libraries of .venv.
# make golden writes the JSON of the main verbs into GOLDEN, for diff -r before and after a change.
# make picture draws docs/report.png again; it needs Chromium and a study.
# make moving draws docs/shift.webp, docs/live.webp and docs/shift.png again (minutes); it needs Chromium.
# make plotly fetches the code of Plotly that the pages have, of the version of plotly; it needs npm.
# make gallery runs the notebooks of docs/gallery and keeps their outputs (minutes); it needs Chromium.
# make tutorial runs the commands of docs/tutorial.md and docs/howto/own_driveline.md and draws their pictures
# again; it needs Chromium.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
OUT ?= results/mq200
CHROMIUM ?= chromium
EXTRAS := blind,cad,docs,dxf,fem,fmu,machines,mdf,nested,tdms

# What Debian must bring beside Python itself: venv, and a library that Drake loads.
DEBIAN := python3.11-venv libglib2.0-0
SYSTEM_OK := $(PYTHON) -c 'import ensurepip, ctypes; ctypes.CDLL("libglib-2.0.so.0")'

.PHONY: study test test-fast lint docs docs-versions evidence blind surrogate bank studies samplers gaps history processors figures golden release picture moving plotly gallery tutorial constraints system clean

study: $(VENV)/ready
	$(BIN)/dogshape search studies/mq200 --out $(OUT) --resume

# A process for each core, and no threads of linear algebra beside it. Files are taken in their
# order: the long ones of tests/acceptance and tests/integration first.
PYTEST := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto \
  --dist loadfile --no-loadscope-reorder

test: $(VENV)/complete lint
	$(PYTEST)

test-fast: $(VENV)/complete
	$(PYTEST) tests/unit

lint: $(VENV)/complete
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy -p dogshape

# BLIND is the folder of the set; SEED draws one of its own.
BLIND ?= results/blind

blind: $(VENV)/complete
	test -f $(BLIND)/manifest.json || $(BIN)/dogshape blind make $(BLIND) $(if $(SEED),--seed $(SEED))
	$(BIN)/dogshape blind run $(BLIND)
	$(BIN)/dogshape blind score $(BLIND)

EVIDENCE := convergence work_precision expectation second_engine adams engines mechanisms root_stress dog_stiffness scale \
  impact_force blind_engines law_errors pair_rule self_consistency valid_range

# What scripts print, with the command before it, in docs/evidence; a script that fails leaves
# the old table.
define print_tables
mkdir -p build
for name in $(1); do \
  echo "$$name"; echo "$$ python -m benchmarks.$$name" > build/evidence.txt; \
  $(BIN)/python -m benchmarks.$$name >> build/evidence.txt || exit 1; \
  mv build/evidence.txt docs/evidence/$$name.txt; done
endef

evidence: $(VENV)/complete
	$(BIN)/python -m pytest -m slow
	$(call print_tables,$(EVIDENCE))

# The surrogate that the package brings, as anybody makes one (minutes), and the table that judges
# surrogates (half an hour): what it learns from is simulated into results/mq200_paper-space, where
# a run that was stopped goes on.
surrogate: $(VENV)/ready
	$(BIN)/dogshape fit mq200_paper
	cp results/mq200_paper-space/surrogate.json studies/mq200_paper/surrogate.json
	$(call print_tables,surrogate_validation)

# The bank of the published clutch in both senses of rotation; goes on from BANK where that has
# finished shifts, and simulates nothing where the bundled file has all.
BANK ?= results/bank
bank: $(VENV)/ready
	$(BIN)/python -m benchmarks.bundled_bank --bank $(BANK)

# The studies that are bundled, with the results that are kept of them, and what their best
# designs gain under other contact and bear as a gearbox loads them (half an hour).
STUDIES := mq200 mq200_actuation mq200_both mq200_paper mq200_robust mq200_three amt ev_disconnect motorcycle
studies: $(VENV)/ready
	for name in $(STUDIES); do \
	  $(BIN)/dogshape search studies/$$name --out results/$$name --resume || exit 1; \
	  cp results/$$name/result.json results/$$name/designs.csv studies/$$name/ || exit 1; done
	$(call print_tables,contact_sets gearbox_loads)

# Computing times of this version, beside those of earlier ones (two minutes).
history: $(VENV)/complete
	$(BIN)/python -m benchmarks.history
	$(BIN)/python -m benchmarks.figures

# Samplers compared, with torch, which nothing else wants (a quarter of an hour).
samplers: $(VENV)/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[gp]"
	$(call print_tables,samplers)

# The diagnoses that README.md quotes, with what ignoring the stand's causes would cost.
gaps: $(VENV)/ready
	mkdir -p build
	$(BIN)/dogshape diagnose mq200_stand --study mq200_paper --json > build/gap_stand.json
	$(BIN)/dogshape diagnose mq200_adams --json > build/gap_adams.json
	mv build/gap_stand.json build/gap_adams.json docs/evidence/

# Each setting: features that numpy leaves out, kernel and threads of OpenBLAS.
PROCESSORS := :SkylakeX:2 X86_V4,AVX512_ICL,AVX512_SPR:Haswell:1 \
  X86_V3,X86_V4,AVX512_ICL,AVX512_SPR:Nehalem:2

processors: $(VENV)/complete
	for setting in $(PROCESSORS); do \
	  IFS=: read -r features kernel threads <<< "$$setting"; echo "$$setting"; \
	  NPY_DISABLE_CPU_FEATURES=$$features OPENBLAS_CORETYPE=$$kernel OPENBLAS_NUM_THREADS=$$threads \
	    $(BIN)/python -m pytest -q -W ignore::ImportWarning tests/acceptance/test_gap_verb.py || exit 1; \
	done
processors: SHELL := /bin/bash

figures: $(VENV)/ready
	$(BIN)/python -m benchmarks.figures
	$(BIN)/python -m benchmarks.drawings

GOLDEN ?= build/golden
golden: $(VENV)/ready
	$(BIN)/python -m benchmarks.golden $(GOLDEN)

release: $(VENV)/complete
	.ci/release

docs: $(VENV)/complete
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

docs-versions: $(VENV)/complete
	TAG=$(TAG) .ci/docs_versions

SHOOT := $(CHROMIUM) --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader \
  --no-first-run --user-data-dir=build/chromium --hide-scrollbars --virtual-time-budget=8000

$(OUT)/report.html:
	$(MAKE) study

# The first screen of a report, drawn without a screen.
picture: $(VENV)/ready $(OUT)/report.html
	mkdir -p build
	$(SHOOT) --window-size=1220,1330 --force-device-scale-factor=0.75 \
	  --screenshot=docs/report.png "file://$(abspath $(OUT))/report.html"

# The moving pictures of the README, and the page that its Python block writes.
moving: $(VENV)/complete
	$(BIN)/python -m benchmarks.moving_pictures docs

# Plotly of lines, bars and maps: a third of the whole, so that pages stay small.
PLOTLY := pipeline/reports/templates/plotly-cartesian.min.js.gz
plotly: $(VENV)/ready
	mkdir -p build
	version=$$($(BIN)/python -c 'from plotly.offline import get_plotlyjs_version as v; print(v())'); \
	archive=$$(cd build && npm pack --silent plotly.js-cartesian-dist-min@$$version) && \
	tar xzOf build/$$archive package/plotly-cartesian.min.js | gzip -9n > build/plotly.gz
	mv build/plotly.gz $(PLOTLY)

# The notebooks of the gallery; NOTEBOOKS names some of them, such as "mq200 amt".
gallery: $(VENV)/complete
	$(BIN)/python -m benchmarks.gallery $(NOTEBOOKS)

# Tutorial and driveline guide, command by command, and their pictures (two minutes; it needs Chromium).
tutorial: $(VENV)/complete
	rm -rf build/tutorial build/own_driveline
	$(BIN)/python -m benchmarks.pages docs/tutorial.md build/tutorial docs/tutorial
	$(BIN)/python -m benchmarks.pages docs/howto/own_driveline.md build/own_driveline docs/howto

$(VENV)/ready: pyproject.toml constraints.txt | system
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

# Requirements of the dependency group dev; pip before 25.1 has no --group.
DEV := $(VENV)/dev.txt
LIST_DEV = $(BIN)/python -c 'import tomllib; \
  print(*tomllib.load(open("pyproject.toml", "rb"))["dependency-groups"]["dev"], sep="\n")' > $(DEV)

# What tests and evidence want besides: linters, the second engine, CAD, finite elements, and
# what connects machines.
$(VENV)/complete: $(VENV)/ready
	$(LIST_DEV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -r $(DEV) -e ".[$(EXTRAS)]"
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
	$(LIST_DEV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r $(DEV) -e ".[$(EXTRAS),gp]"
	$(BIN)/python -m pip freeze --all --exclude-editable --exclude pip | sed 's/+cpu//' > constraints.txt
	touch $(VENV)/ready $(VENV)/complete

clean:
	rm -rf $(VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
