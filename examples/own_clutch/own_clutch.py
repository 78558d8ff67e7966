"""Simulate a clutch of one's own: one shift, its expected time, and a variant.

python examples/own_clutch/own_clutch.py
"""

from __future__ import annotations

from pathlib import Path

import dogshape as ds

CLUTCH = Path(__file__).parent / "clutch.toml"


def main(angles: int = 8) -> dict[str, float]:
    """Simulate the study and a variant at ``angles`` relative angles; give both times in s."""
    study = ds.Study(CLUTCH)
    shift = study.shift(mismatch_rpm=100, force_N=600, angle_deg=5)
    print(shift)  # shift.plot() draws it, shift.report("shift.html") writes its page

    expected = study.expect(angles=angles, jobs=1)
    print(expected)
    print(expected.to_frame()[["mismatch_rpm", "force_N", "mean_s", "standard_error_s"]])

    steeper = ds.Study(CLUTCH, chamfer_deg=14)
    variant = steeper.expect(angles=angles, jobs=1)
    print(f"with a chamfer of 14 degrees: {variant}")
    # The search over [variables]: study.search(out="results/mine"), or
    # dogshape study examples/own_clutch/clutch.toml --out results/mine
    return {"expected_s": expected.time_s, "variant_s": variant.time_s}


if __name__ == "__main__":
    main()
