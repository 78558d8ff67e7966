"""The command line ``dogshape``: all verbs of the program, in the order of its help.

Exit status 0 done, 1 the answer is no, 2 bad input, 130 stopped by Ctrl-C.
"""

from __future__ import annotations

from pipeline.options import app

from pipeline.verbs import shifts, designs, studies, benches  # isort: skip

__all__ = ["app", "benches", "designs", "shifts", "studies"]
