"""Findings in words: probable slips of units or axes in bench data."""

from __future__ import annotations

from dataclasses import dataclass

from dogshape.diagnosis.bench.corrections import GIVEN


@dataclass(frozen=True)
class Finding:
    """Probable slip in bench data.

    ``found`` says what the data have and what speaks against it, ``looks_like`` what explains
    it. ``way`` is the correction of ``quantity`` that would make it right, None where there is
    none. A ``certain`` one cannot be true as it stands and is refused; ``arguable`` tells
    whether a user may say that it is right nevertheless. ``remedy`` is what to do where neither
    a correction nor the data set is.
    """

    quantity: str
    found: str
    looks_like: str
    way: str | None = None
    certain: bool = False
    arguable: bool = True
    remedy: str = ""

    @property
    def correction(self) -> str | None:
        """The correction as it is written, such as ``time=ms``."""
        return None if self.way is None else f"{self.quantity}={self.way}"

    @property
    def sentence(self) -> str:
        """Finding, probable cause and remedy in a sentence."""
        return self.with_remedy(self.remedy or self._remedy)

    def with_remedy(self, remedy: str) -> str:
        """Return finding, probable cause and a remedy in a sentence."""
        return f"{self.found}; this looks like {self.looks_like}; {remedy}"

    @property
    def _remedy(self) -> str:
        ways = [f"--correct {self.correction} takes it as that"] if self.way else []
        if self.arguable:
            ways.append(f"--correct {self.quantity}={GIVEN} takes it as it stands")
        return ", or ".join(["correct the data set", *ways])
