# make demo    edits the shipped example; make test   runs every test; make bench  measures
# make deps    installs missing Debian packages; make build  compiles; make clean  removes what was built
# Each installs and builds what it needs first.

# A Python from elsewhere on the path breaks catkin.
export PATH := /usr/bin:/bin:/usr/sbin:/sbin
SHELL := /bin/bash

JOBS := $(shell nproc)
SOURCES := $(shell find src -type f)
CATKIN := catkin_make -DCMAKE_BUILD_TYPE=Release -j$(JOBS)

.PHONY: deps build demo test bench lint format clean

deps:
	@scripts/install_dependencies

build: deps
	@$(MAKE) --no-print-directory build/.built

# Asked for only when a source has changed: catkin_make takes its time to find that nothing has.
build/.built: $(SOURCES)
	$(CATKIN)
	@touch $@

# Configured again: the environment in which catkin runs tests then knows the messages' Python modules, which now exist.
build/.tests_built: build/.built
	$(CATKIN) --force-cmake tests
	@touch $@

demo: build
	@scripts/demo

test: build
	@$(MAKE) --no-print-directory build/.tests_built
	@scripts/run_tests

# SCENES="DIR..." and REFERENCES="DIR..." name more cases than the shipped one.
bench: build
	@scripts/run_benchmarks

lint: deps
	catkin_lint src

# As .clang-format says; asks for clang-format, which nothing else needs.
format:
	git ls-files 'src/*.cpp' 'src/*.hpp' 'src/*.inl' | xargs clang-format -i

clean:
	rm -rf build devel out
