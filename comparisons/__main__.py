"""`python -m comparisons`: the command line."""

from comparisons.cli import entry

if __name__ == "__main__":
    entry()
