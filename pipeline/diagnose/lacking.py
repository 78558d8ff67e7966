"""Why a diagnosis has to simulate: what of a data set the bundled simulations do not have."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from dogshape.diagnosis.bench.bench_data import Bench, load_bench
from dogshape.sim.bundled import bundled_root
from dogshape.sim.shift.clutch import OperatingPoint
from dogshape.sim.units import RPM

SAME = 1e-6  #: relative difference below which two numbers of operating points are the same


def reason(bench: Bench, own_effects: Collection[str] = (), wider: Collection[str] = ()) -> str:
    """Explain why simulations are lacking, compared with those that the package brings.

    ``own_effects`` are names of effects that the package does not know, ``wider`` of those whose
    ranges were widened. Empty where the bundled
    simulations have clutch and operating points, and another run has not finished.
    """
    quick = replace(bench, clutch=bench.clutch.with_engine("planar"))
    known = _nearest(quick)
    if known is None:
        return "no simulations of this clutch come with the package"
    if quick.clutch != bench.clutch:
        return "those that the package brings of this clutch are of the compiled engine"
    there = [cell.point for cell in known.cells]
    lacking = [cell.point for cell in bench.cells if not _among(cell.point, there)]
    said = []
    if lacking:
        rises = [(point, at) for point in lacking for at in there if _rises_otherwise(point, at)]
        if rises:
            point, at = rises[0]
            said.append(
                f"other rise times of the force than the bundled ones ({point.profile.rise:g} s "
                f"instead of {at.profile.rise:g} s at {point.profile.force:g} N)"
            )
        else:
            point = lacking[0]
            count = "one operating point" if len(lacking) == 1 else f"{len(lacking)} points"
            said.append(
                f"{count} that no bundled data set has (such as {point.mismatch / RPM:g} 1/min "
                f"with {point.profile.force:g} N)"
            )
    if own_effects:
        said.append(f"effects of your own ({', '.join(sorted(own_effects))})")
    if wider:
        names = ", ".join(sorted(wider))
        said.append(f"wider ranges than those of the bundled simulations ({names})")
    return " and ".join(said)


def _nearest(bench: Bench) -> Bench | None:
    """Return the bundled data set of this clutch, whose bank is the compiled engine's, or None."""
    for folder in sorted(Path(bundled_root() / "bench").iterdir()):
        if (folder / "bench.toml").is_file():
            known = load_bench(folder)
            if known.clutch.with_engine("planar") == bench.clutch:
                return known
    return None


def _among(point: OperatingPoint, there: Collection[OperatingPoint]) -> bool:
    return any(_alike(point, at) and not _rises_otherwise(point, at) for at in there)


def _alike(point: OperatingPoint, at: OperatingPoint) -> bool:
    """Test that mismatch and force are the same."""
    pairs = (point.mismatch, at.mismatch), (point.profile.force, at.profile.force)
    return all(math.isclose(one, other, rel_tol=SAME) for one, other in pairs)


def _rises_otherwise(point: OperatingPoint, at: OperatingPoint) -> bool:
    rises = point.profile.rise, at.profile.rise
    return _alike(point, at) and not math.isclose(*rises, rel_tol=SAME)
