# make demo    two engines play a game that the arm executes; options in ARGS, e.g. make demo ARGS="--pace fast --plies 20"
# make test    all tests, WORKERS (two for each processor: most of them wait for other processes) at once, then one by one those of
#              what has to be punctual; ARGS go to pytest
# make nightly property tests with fresh examples, TIMES (20) rounds; the first failure ends it and says how to repeat it
# make ready   set up what checks and tests need, and nothing else
# make check   format, lint, strict types
# make coverage   line and branch coverage of the controller
# make clean   back to a fresh clone; records in games/ stay
# make constraints   pin the newest versions that the ranges in pyproject.toml admit
# make vendor  fetch the page's libraries anew, as app/page/static/vendor/vendor.json names them (needs npm)
#
# Each target sets up by itself what it needs (.ci/setup).

ARGS ?=
TIMES ?= 20
WORKERS ?= $(shell expr 2 '*' $$(nproc))
# What Numba compiles and pytest rewrites where their caches are empty: once before the workers, each of which would do it
# for itself. Nor need each of the hundreds of processes that tests start read all sources anew, whatever the environment
# says of bytecode; and threads of BLAS that wait for each other on busy processors take several times the work's own time.
COMPILED := controller.loop.server,hardware.sim.process.server,vision.loops app.motion.planner

# Unless ARGS names its own. What has to be punctual has the machine for itself afterwards: where both processors are busy, many
# a host takes them away for 100 ms at a time, and tests that were run again then took longer than all that ran beside them.
PUNCTUAL = $(if $(filter tests/%,$(ARGS)),,$$(grep -rl --include='test_*.py' 'mark\.real_time' tests | sort))

PYTEST = PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 .venv/bin/python -m pytest

.PHONY: ready demo test nightly check clean constraints coverage vendor

ready:
	@bash .ci/setup dev

demo:
	@bash .ci/setup demo
	@.venv/bin/touchmove demo $(ARGS)

test:
	@bash .ci/setup dev
	@for modules in $(COMPILED); do .venv/bin/python -c "import $$modules" & done; \
	    test -e tests/__pycache__ || $(PYTEST) --collect-only -qq >/dev/null & wait
	@$(PYTEST) --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder -m "not real_time" $(ARGS) || [ $$? -eq 5 ]
	@$(PYTEST) -m real_time $(ARGS) $(PUNCTUAL) || [ $$? -eq 5 ]

nightly:
	@bash .ci/setup dev
	@for round in $$(seq $(TIMES)); do \
	    seed=$${SEED:-$$(od -An -N4 -tu4 /dev/urandom | tr -d ' ')}; \
	    echo "round $$round of $(TIMES): seed $$seed"; \
	    .venv/bin/python -m pytest --quiet --numprocesses auto --maxfail 1 -m hypothesis --hypothesis-profile nightly \
	        --hypothesis-seed "$$seed" $(ARGS) $$(grep -rl 'import.* given' tests) || \
	        { echo "again: make nightly TIMES=1 SEED=$$seed"; exit 1; }; \
	done

check:
	@bash .ci/setup dev
	.venv/bin/ruff format --check .
	.venv/bin/ruff check .
	.venv/bin/mypy

clean:
	rm -rf .venv build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

constraints:
	rm -rf .venv
	echo '# Made by "make constraints": all packages of a new environment with the dev extras, as pip freeze lists them.' > constraints.txt
	bash .ci/setup dev
	.venv/bin/python -m pip freeze --all --exclude pip --exclude-editable >> constraints.txt

vendor:
	@python3 .ci/vendor.py

# line and branch coverage of the controller; what is compiled is run once more without, so that its lines count
coverage:
	@bash .ci/setup dev
	@.venv/bin/python -m pytest --cov=controller --cov-branch --cov-report= tests/controller $(ARGS)
	@NUMBA_DISABLE_JIT=1 .venv/bin/python -m pytest --cov=controller --cov-branch --cov-append \
		--cov-report=term-missing:skip-covered tests/controller/protection \
		tests/controller/loop/test_playback.py tests/controller/law/test_force.py $(ARGS)
