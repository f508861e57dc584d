"""The `gpudem` command, and `python -m comparisons`."""

from __future__ import annotations

import sys

from gpudem.extras import MissingExtraError, from_extra


def main() -> int:
    """Run the command line and return its exit code; without the extra `compare` it is one line."""
    try:
        with from_extra():
            from comparisons import cli
    except MissingExtraError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    return cli.main()


if __name__ == "__main__":
    sys.exit(main())
