# `make` lists what there is. Everything is written into the checkout, the cache (~/.cache/rosops-fleet, or under
# XDG_CACHE_HOME) and what package managers, podman and Ansible (~/.ansible/tmp) own.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
MAKEFLAGS += --no-print-directory
.DEFAULT_GOAL := help

LAB := tests/lab/lab
VENV := .venv/bin
INVENTORY := inventories/lab

# This checkout and its tools first: a version manager's shims may come earlier in the caller's PATH.
export PATH := $(CURDIR)/.venv/bin:$(PATH)
# By name, because Ansible ignores the file in a world-writable directory; its own files go into the checkout, too.
export ANSIBLE_CONFIG := $(CURDIR)/ansible.cfg
export ANSIBLE_HOME := $(CURDIR)/.ansible
export ANSIBLE_COLLECTIONS_PATH := $(CURDIR)/.ansible/collections
export PYTHONDONTWRITEBYTECODE := 1
# Ansible refuses to start without a UTF-8 locale; this one is part of Debian.
export LC_ALL := C.UTF-8

.PHONY: help
help: ## List the targets, with the times that a run wrote (two cores; `make times`)
	@"$$(tests/lab/find_python)" tests/tools/times.py help

.PHONY: setup
setup: ## Install missing Debian packages, make .venv, link the collection
	@$(LAB) setup

.PHONY: setup-tests
setup-tests: ## The same, with the Debian packages that only tests need (ROS nodes, a browser)
	@$(LAB) setup --tests

.PHONY: artifacts
artifacts: setup ## Build what is missing of the lab's images and k3s
	@$(LAB) artifacts

.PHONY: lab-up
lab-up: setup ## Start the lab's hosts (edge1, robot1, robot2)
	@$(LAB) up

.PHONY: lab-down
lab-down: ## Remove every lab of this checkout
	@$(LAB) down --all

.PHONY: demo
demo: ## From nothing to a fleet: set-up, lab, site.yml, status.yml (OBSERVABILITY=yes: with what watches it)
	@SECONDS=0; \
	$(MAKE) artifacts; \
	$(if $(OBSERVABILITY),$(LAB) artifacts --observability;) \
	$(MAKE) lab-up; \
	ansible-playbook -i $(INVENTORY) playbooks/site.yml $(if $(OBSERVABILITY),-e lab_observability=true); \
	ansible-playbook -i $(INVENTORY) playbooks/status.yml; \
	$(LAB) status; \
	echo "demo: ready after $$((SECONDS / 60)) min $$((SECONDS % 60)) s"

.PHONY: status
status: ## How the demo's fleet stands (TABLES=yes: with tables of hosts, nodes, masters, apps, topics and claims)
	@$(LAB) status
	@ansible-playbook $(if $(TABLES),-v) -i $(INVENTORY) playbooks/status.yml

# What needs no host, beside what works on them.
HOSTLESS := lint docs test-unit test-playbooks sanity dist test-bad-input test-browser test-ros

.PHONY: test
test: ## What needs no host, and on hosts one case for most promises; FRESH=1: also what passed before with the same files
	@ROSOPS_TEST_CASES=promises "$$(tests/lab/find_python)" tests/run_stages.py $(if $(FRESH),--fresh) --first setup-tests \
	    --lane artifacts molecule-update \
	    --lane $(HOSTLESS) molecule-default

.PHONY: test-all
test-all: ## Every case of every scenario, but for those that take hours (test-faults)
	@ROSOPS_TEST_ALL=1 "$$(tests/lab/find_python)" tests/run_stages.py $(if $(FRESH),--fresh) --first setup-tests \
	    --lane artifacts molecule-default molecule-fleet molecule-update molecule-observability \
	    --lane $(subst sanity,sanity-all,$(HOSTLESS)) test-go units-all

.PHONY: check
check: ruff mypy ## In a minute or two, without a host: lint, and the unit tests near what changed since main
	@yaml=$$(python tests/tools/affected.py yaml); \
	    [ -z "$$yaml" ] || { yamllint --strict $$yaml; ansible-lint --offline --profile production $$yaml; }
	@python -m pytest -n 2 -q $$(python tests/tools/affected.py tests)

.PHONY: lint
lint: ruff mypy yamllint shellcheck ansible-lint lint-changelog lint-docs lint-workflows ## All that reads code and runs none

.PHONY: ruff
ruff: ## Python: style and mistakes
	ruff check .
	ruff format --check .

.PHONY: mypy
mypy: ## Python: types, those of hosts and pods for Python 3.8, too, of benchmarks, and of the tests that need a lab
	mypy plugins
	mypy --python-version 3.8 plugins/module_utils plugins/modules
	mypy --python-version 3.8 playbooks/files/rosops-may
	MYPYPATH=tests/lab mypy tests/lab/lablib
	MYPYPATH=benchmarks:tests/lab:tests/apps mypy benchmarks/bench_update.py benchmarks/bench_site.py
	MYPYPATH=tests/update:tests/apps:tests/tools mypy tests/update
	MYPYPATH=tests/observability:tests/update:tests/apps:tests/tools:tools mypy tests/observability

.PHONY: yamllint
yamllint: ## YAML: style
	yamllint --strict .

.PHONY: shellcheck
shellcheck: ## Shell scripts (from Debian's package, which setup-tests installs)
	git -c safe.directory="$(CURDIR)" ls-files -z | xargs -0 grep --directories=skip --files-with-matches --null -E '^#!.*\b(ba|da)?sh\b' | xargs -0 shellcheck

.PHONY: ansible-lint
ansible-lint: ## Roles and playbooks
	ansible-lint --offline --profile production

.PHONY: lint-changelog
lint-changelog: ## The fragments of the changelog
	antsibull-changelog lint

.PHONY: lint-docs
lint-docs: ## Documentation of modules, plugins and roles, and all that it refers to
	@# it copies collections that ours needs as git knows them; those in .venv are none of this repository
	GIT_CEILING_DIRECTORIES=$$(realpath .venv) antsibull-docs lint-collection-docs --plugin-docs .

.PHONY: docs
docs: ## All pages as HTML, with the reference of modules and roles: .cache/docs/html
	rm -rf .cache/docs
	mkdir -p .cache/docs/source/reference
	cp --parents -r README.md CONTRIBUTING.md CHANGELOG.md docs roles/*/README.md tests/apps/README.md tests/lab/README.md .cache/docs/source
	antsibull-docs collection --use-current --fail-on-error --squash-hierarchy --dest-dir .cache/docs/source/reference rosops.fleet
	sphinx-build --fail-on-warning --keep-going --quiet -c tools/docs -d .cache/docs/doctrees .cache/docs/source .cache/docs/html

.PHONY: lint-workflows
lint-workflows: ## What GitHub runs (that the targets it names exist: tests/unit/test_workflows.py)
	check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml playbooks/files/repository/dot-github/workflows/*.yml
	check-jsonschema --builtin-schema vendor.github-actions .github/actions/*/action.yml

.PHONY: package
package: ## Build the collection's package into .cache/package (what it holds: tests/unit/test_package.py)
	@rm -rf .cache/package
	ansible-galaxy collection build --output-path .cache/package .

.PHONY: sbom
sbom: ## What a release needs to run, as CycloneDX, beside the package
	@mkdir -p .cache/package
	python tools/sbom.py > .cache/package/rosops-fleet.cdx.json

.PHONY: dist
dist: package ## The package through Galaxy's importer, installed into an empty place, and run from there
	ROSOPS_IMPORTER_PYTHON=$$($(LAB) python importer) ROSOPS_OLD_PYTHON=$$($(LAB) python old-core) python -m pytest -n 0 tests/dist

.PHONY: release-notes
release-notes: ## The changelog's part of the latest release, into .cache/release-notes.md
	antsibull-changelog generate --only-latest --output .cache/release-notes.md --output-format md

.PHONY: support
support: ## Warn of pinned parts whose support has ended (docs/versions.md)
	@python tests/tools/support.py

.PHONY: ee
ee: package ## The execution environment's image (podman; needs the registries of its base image and of Galaxy)
	@mkdir -p .cache/ee
	cp .cache/package/rosops-fleet-*.tar.gz .cache/ee/rosops-fleet.tar.gz
	ansible-builder build --container-runtime podman --file execution-environment/execution-environment.yml --context .cache/ee/context

.PHONY: test-unit
test-unit: ## Unit tests but for those of playbooks (TESTS="--lf": those that failed last)
	python -m pytest -n 3 --dist worksteal --durations 20 $(or $(TESTS),--ignore tests/unit/playbooks tests/unit)

.PHONY: test-playbooks
test-playbooks: ## The collection's playbooks, run against stand-ins of hosts, clusters and AWX
	python -m pytest -n 3 --dist worksteal --durations 20 tests/unit/playbooks

.PHONY: test-bad-input
test-bad-input: ## Every malformed input through site.yml: refused before a host is touched
	python -m pytest -n 2 tests/bad_input

.PHONY: test-go
test-go: ## Unit tests of labk3s's own packages
	@$(LAB) go vet ./...
	@# `go test` would vet again, all of Kubernetes for its types with it
	@$(LAB) go test -vet=off ./...

.PHONY: test-ros
test-ros: ## Probes, stop hook, keeper and gates on real ROS nodes (skipped, with the reason, where Debian's rospy is missing)
	python -m pytest -n 2 --dist worksteal -rs tests/ros

.PHONY: test-browser
test-browser: ## The status page in a headless browser (skipped, with the reason, where chromium is missing)
	python -m pytest -n 0 -rs tests/browser

.PHONY: mutation
mutation: ## What mistakes in the code that decides would its tests not notice? (an hour; FILES="gate contract": some only)
	python tests/tools/mutation.py $(FILES)

.PHONY: sanity
sanity: ## ansible-test sanity on what the package holds (CORE=2.21: by another ansible-core than .venv's)
	@tests/ansible_test.sh sanity

.PHONY: units
units: ## ansible-test units: the plugins' tests, as Ansible runs them (CORE=2.21)
	@tests/ansible_test.sh units tests/unit/plugins/

# The ansible-cores that are supported beside that of .venv.
CORES := 2.20 2.21

.PHONY: sanity-all
sanity-all: sanity ## On every ansible-core that is supported (others than .venv's need Python 3.12)
	@for core in $(CORES); do echo "ansible-core $$core"; CORE=$$core tests/ansible_test.sh sanity; done

.PHONY: units-all
units-all: units ## The same
	@for core in $(CORES); do echo "ansible-core $$core"; CORE=$$core tests/ansible_test.sh units tests/unit/plugins/; done

.PHONY: molecule-default
molecule-default: artifacts ## Molecule: one host, from bare to ready
	molecule test --scenario-name default

.PHONY: molecule-fleet
molecule-fleet: artifacts ## Molecule: three hosts
	molecule test --scenario-name fleet

.PHONY: molecule-update
molecule-update: artifacts ## Molecule: updates, bad versions, busy and absent robots, killed control nodes (ROSOPS_TEST_CASES=promises: fewer)
	molecule test --scenario-name update

.PHONY: molecule-observability
molecule-observability: artifacts ## Molecule: a fleet and what watches it (builds Prometheus, Loki and others the first time)
	molecule test --scenario-name observability

.PHONY: test-faults
test-faults: artifacts ## As molecule-update and molecule-observability, with the cases that take long (hours)
	ROSOPS_TEST_CASES=faults python -m pytest -q -n 2 tests/unit/test_hostile.py
	ROSOPS_TEST_CASES=faults molecule test --scenario-name update
	ROSOPS_TEST_CASES=faults molecule test --scenario-name observability

.PHONY: screens
screens: test-browser ## Put the picture that test-browser takes of the status page into docs/screens
	cp tests/output/browser/fleet-status.png docs/screens/

.PHONY: dashboards
dashboards: ## Write the shipped Grafana dashboards anew from tools/dashboards
	@PYTHONPATH=tools python -m dashboards

.PHONY: bench
bench: ## The dissertation's experiment, plain Kubernetes beside update.yml; goes on where it was cut off (hours; MINUTES=30: a part of it)
	python benchmarks/bench_update.py $(if $(MINUTES),--minutes $(MINUTES)) $(BENCH)
	@$(MAKE) bench-docs

.PHONY: bench-docs
bench-docs: ## docs/benchmarks.md and its pictures, out of the finished trials
	python benchmarks/bench_docs.py

.PHONY: bench-probe
bench-probe: ## What ours costs a robot: at rest per part, with ten apps, and per call of a start and a stop
	python benchmarks/bench_probe.py $(BENCH)

.PHONY: bench-exporter
bench-exporter: ## What the ROS exporter costs with 20 nodes, and how true its rates are
	python benchmarks/bench_exporter.py

.PHONY: bench-ready
bench-ready: ## How fast ros_ready answers
	python benchmarks/bench_ready.py

.PHONY: bench-look
bench-look: ## What a look costs at graphs of 10, 30 and 100 robots that share a master
	python benchmarks/bench_look.py $(BENCH)

.PHONY: bench-fleet
bench-fleet: ## What the engine costs per robot, in simulated fleets of 10, 30 and 100 robots with 12 apps
	python benchmarks/bench_fleet.py $(BENCH)

.PHONY: bench-site
bench-site: ## What site.yml and update.yml cost, in seconds and processor time (BENCH="--before DIR --rounds 3": beside another checkout)
	python benchmarks/bench_site.py $(BENCH)

.PHONY: times
times: ## Keep the times of the last whole run: in tests/times.json, docs/developing.md and `make help` (WHOLE=test-all: it was of that)
	@python tests/tools/times.py keep $(or $(WHOLE),test)

.PHONY: clean
clean: lab-down ## Remove what make wrote into the checkout; the cache stays
	rm -rf .ansible .cache .lab .venv .mypy_cache .ruff_cache .hypothesis reports tests/output
