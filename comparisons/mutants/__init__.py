"""Does the suite catch errors? The solver broken in named ways, one at a time: `make mutants`."""
