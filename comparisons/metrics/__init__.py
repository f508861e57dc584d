"""What is measured on a run: pure functions of arrays, the same for every code."""
