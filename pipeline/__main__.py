"""Run the command line: ``python -m dogshape.pipeline``."""

from dogshape.cli.entry import main

if __name__ == "__main__":
    main()
