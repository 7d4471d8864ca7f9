# make demo    build, run a column of packings and the same grains one by one, and draw both: out/*.png
# make learn   train a small network on columns of discs, let it predict another: out/learn
# make test    the whole test suite; TORCH=1 includes dempm.torch, a download of some gigabytes
# make lint    links, formatting, clippy, licences and crate documentation, as the continuous
#              integration does
# make doc     documentation of the crates: target/doc
# make docs    the documentation as a book: target/book/index.html
# make build   all programs
# make completions  completions of shells and manual pages: out/dist, or DIST=folder
# make wheel   the Python package, for Python 3.9 and later: target/wheels
# make dist    programs and Python package for Debian 11 and later, with checksums: target/dist

# Programs of the workspace, one crate each.
PROGRAMS := dempm surrogate validation

# HDF5 is built from source, for which scripts/with-cmake sees to a recent CMake.
CARGO := scripts/with-cmake cargo
# Not by package, whose dependencies would have other features than in the tests and be compiled twice.
RUN := $(CARGO) run --release --quiet --bin

.PHONY: demo learn test lint doc docs build completions wheel dist
.DELETE_ON_ERROR:

demo: build-dempm
	$(RUN) dempm -- run scenes/discs.toml -o out/discs.h5 --overwrite
	$(RUN) dempm -- run scenes/column.toml -o out/column.h5 --overwrite
	$(RUN) dempm -- plot out/discs.h5 --grains -o out/grains.png
	$(RUN) dempm -- plot out/discs.h5 out/column.h5 -o out/column.png

LEARN := out/learn

learn: build-dempm build-surrogate
	$(RUN) dempm -- dataset scenes/dataset/discs-tiny.toml -o $(LEARN)/data --resume \
		--only train --only valid --only 'test/at-rest-000*'
	$(RUN) surrogate -- train configs/discs-tiny.toml --data $(LEARN)/data -o $(LEARN)/run --overwrite
	$(RUN) surrogate -- rollout $(LEARN)/run/best.safetensors --scene scenes/discs.toml \
		-o $(LEARN)/column.h5 --overwrite
	$(RUN) dempm -- plot $(LEARN)/column.h5 -o $(LEARN)/column.png
	$(RUN) surrogate -- eval $(LEARN)/run/best.safetensors --data $(LEARN)/data/test --truth -o $(LEARN)/eval

test:
	$(CARGO) test --workspace --release
	$(MAKE) wheel
	scripts/test-python

lint:
	python3 scripts/check_links.py
	python3 scripts/check_reference.py
	python3 scripts/python_reference.py --check
	cargo fmt --all --check
	$(CARGO) clippy --workspace --all-targets --release -- -D warnings
	scripts/deny
	$(MAKE) doc

# Mathematics is rendered in the browser by KaTeX.
doc:
	RUSTDOCFLAGS="-D warnings --html-in-header $(CURDIR)/docs/katex-header.html" \
		$(CARGO) doc --workspace --no-deps --release

docs:
	@command -v mdbook >/dev/null || { echo 'mdbook is missing: cargo install mdbook --locked'; exit 1; }
	mdbook build

DIST := out/dist

completions: build
	for program in $(PROGRAMS); do target/release/$$program --quiet shell-files $(DIST) || exit 1; done

build: $(PROGRAMS:%=build-%)

build-%:
	$(CARGO) build --release --bin $*

# `maturin` is the only tool that this needs besides those of a build.
MATURIN := target/python-build/bin/maturin

wheel: $(MATURIN)
	rm -rf target/wheels
	scripts/with-cmake $(MATURIN) build --release --manifest-path python/Cargo.toml --compatibility linux

$(MATURIN):
	python3 -m venv target/python-build
	target/python-build/bin/pip install --quiet 'maturin>=1.9,<2'

dist:
	scripts/dist
