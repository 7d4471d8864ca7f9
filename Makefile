# make demo    build, run a first collapse and draw it: out/column.h5, out/column.png
# make test    the whole test suite
# make lint    formatting and clippy, as the continuous integration does
# make build   all programs

# Programs of the workspace, one crate each.
PROGRAMS := dempm surrogate validation

# HDF5 is built from source, for which scripts/with-cmake sees to a recent CMake.
CARGO := scripts/with-cmake cargo
RUN := $(CARGO) run --release --quiet --package

.PHONY: demo test lint build
.DELETE_ON_ERROR:

demo: build-dempm
	$(RUN) dempm -- run scenes/column.toml -o out/column.h5 --overwrite
	$(RUN) dempm -- plot out/column.h5 -o out/column.png

test:
	$(CARGO) test --workspace --release

lint:
	cargo fmt --all --check
	$(CARGO) clippy --workspace --all-targets --release -- -D warnings

build: $(PROGRAMS:%=build-%)

build-%:
	$(CARGO) build --release --package $*
