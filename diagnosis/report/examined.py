"""Record of the findings and corrections of a data set."""

from __future__ import annotations

from typing import Any

from dogshape.diagnosis.bench.bench_data import Bench


def examined_record(bench: Bench) -> dict[str, Any]:
    """List what was corrected in a data set and what looks odd in it."""
    return {
        "corrections": [str(correction) for correction in bench.corrections],
        "warnings": [
            {
                "quantity": finding.quantity,
                "found": finding.found,
                "looks_like": finding.looks_like,
                "correction": finding.correction,
                "sentence": finding.sentence,
            }
            for finding in bench.warnings
        ],
    }
