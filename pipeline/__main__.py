"""Entry of the command line, light enough that Ctrl-C while it loads is quiet."""

from __future__ import annotations

import sys


def main() -> None:
    """Load and run the command line."""
    try:
        from pipeline.cli import app  # noqa: PLC0415
    except KeyboardInterrupt:
        print("dogshape: stopped", file=sys.stderr)
        sys.exit(130)
    app()


if __name__ == "__main__":
    main()
