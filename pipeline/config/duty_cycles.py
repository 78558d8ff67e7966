"""Operating mixes that the package brings, named by ``operating.set``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from dogshape.sim.errors import InputError, did_you_mean
from dogshape.sim.texts import read_toml
from dogshape.sim.versions import bundled_root

TABLE = "duty_cycles.toml"  #: beside the bundled studies


@dataclass(frozen=True)
class DutyCycle:
    """Operating points of a kind of gearbox with their weights.

    Parameters
    ----------
    name, about : of the set, for a user.
    source : where its rows are from, or what they assume.
    rows : mismatch in 1/min, nominal final shift force in N, and weight, of which the ratio counts.
    """

    name: str
    about: str
    source: str
    rows: tuple[tuple[float, float, float], ...]


@lru_cache(maxsize=1)
def duty_cycles() -> dict[str, DutyCycle]:
    """Read the bundled operating mixes, by name."""
    return {
        name: DutyCycle(
            name,
            entry["about"],
            " ".join(entry["source"].split()),
            tuple((float(m), float(force), float(weight)) for m, force, weight in entry["rows"]),
        )
        for name, entry in read_toml(bundled_root() / TABLE).items()
    }


def duty_cycle(name: str) -> DutyCycle:
    """Return a bundled operating mix; an unknown name raises InputError with the nearest."""
    known = duty_cycles()
    if name not in known:
        hint = did_you_mean(name, known)
        raise InputError(f"operating.set is '{name}', which is not a set of points; {hint}")
    return known[name]
