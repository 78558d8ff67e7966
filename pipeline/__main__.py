"""Entry of the command line: quiet on Ctrl-C, one sentence for a wrong option."""

from __future__ import annotations

import sys


def main() -> None:
    """Load and run the command line; exits with the status of the contract."""
    try:
        from pipeline.cli import app  # noqa: PLC0415

        status = app(sys.argv[1:] or ["--help"], standalone_mode=False)
    except KeyboardInterrupt:
        print("dogshape: stopped", file=sys.stderr)
        sys.exit(130)
    except Exception as error:
        # Typer brings its own copy of click, whose errors are known by this method.
        message = getattr(error, "format_message", None)
        if message is None:
            raise
        sentence = message().strip().rstrip(".")
        print(f"dogshape: {sentence}; see 'dogshape --help'", file=sys.stderr)
        sys.exit(2)
    sys.exit(status or 0)


if __name__ == "__main__":
    main()
