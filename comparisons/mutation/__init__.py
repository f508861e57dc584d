"""Mutation testing: the solver with one known defect at a time; do the tests detect it? `make mutants`."""
