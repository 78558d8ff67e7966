"""Draw the dogs of the prototype with the name of each quantity, for the glossary.

python -m benchmarks.named_dog > docs/dog.svg
"""

from __future__ import annotations

from benchmarks.common import paper_study
from benchmarks.named_drawing import named_svg

if __name__ == "__main__":
    print(named_svg(paper_study().clutch.dog), end="")
