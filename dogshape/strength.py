"""Strength, self-locking and manufacturability of one design, with its hardest landing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from dogshape.check import Checked
from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Table
from dogshape.pipeline.simulate.design import design_of, margins_within
from dogshape.pipeline.simulate.evaluation import evaluate
from dogshape.pipeline.store.result_records import check_table
from dogshape.running import Where
from dogshape.sim.strength.checks import feasible
from dogshape.sim.strength.dog_strength import UNJUDGED, strike_force, strike_torque
from dogshape.sim.strength.manufacture import manufacturing_checks
from dogshape.sim.units import MPA, RPM


@dataclass(frozen=True, repr=False)
class Strength(Checked):
    """Every check of one design under its load, and its landing in ``shifts``, 0 without."""

    shifts: int = 0

    @property
    def facts(self) -> dict[str, str]:
        """Verdict, smallest margin, and what the blocking mechanism has to hold."""
        return {**self.verdict, "blocking mechanism holds": f"{self.blocking_force_N:.0f} N"}

    @property
    def load_sharing(self) -> float | None:
        """Load sharing under the design torque by number and accuracy; None where it is fixed."""
        load, dog = self.config.limits.load, self.config.clutch.dog
        return None if load.scatter(dog) is None else load.sharing(dog, load.design_torque)

    @property
    def strikes(self) -> list[dict[str, Any]]:
        """Flank strikes: speed, torque, and force on the dog that bears most, by flank."""
        dog, limits = self.config.clutch.dog, self.config.limits
        strike = limits.strike
        if strike is None:
            return []
        return [
            {
                "flank": flank,
                "mismatch_rpm": strike.speed(flank) / RPM,
                "torque_Nm": strike_torque(dog, limits, strike, flank),
                "force_per_dog_N": strike_force(dog, limits, strike, flank),
            }
            for flank in strike.flanks
        ]

    @property
    def parts(self) -> list[str | Table]:
        """Checks, and in words the landing, load sharing and flank strikes of the study."""
        sharing = self.load_sharing
        return [
            *self.check_parts,
            *self.landing_of(self.shifts, self.config.clutch.solver.engine),
            *([] if sharing is None else [f"load sharing by number and accuracy: {sharing:.2f}"]),
            *(
                f"{one['flank']} flanks that strike at {one['mismatch_rpm']:.4g} 1/min make "
                f"{one['torque_Nm']:.0f} N m, {one['force_per_dog_N']:.0f} N on one dog"
                for one in self.strikes
            ),
        ]

    @property
    def explained(self) -> list[str | Table]:
        """Meaning, formula, source and key of each check, and the checks that the study lacks."""
        made = {row.name for row in self.rows}
        left = [(name, keys) for name, keys in UNJUDGED.items() if name not in made]
        return [
            check_table(self.rows, "name", "meaning", "formula", "source", "limit_key"),
            *(f"not judged: {name}; give {keys}" for name, keys in left),
        ]

    def to_dict(self) -> dict[str, Any]:
        """Give every check, the load and the material's limits, in the edge's units."""
        limits, dog = self.config.limits, self.config.clutch.dog
        sharing = {} if self.load_sharing is None else {"load_sharing": self.load_sharing}
        return {
            "engine": self.config.clutch.solver.engine,
            **self.record,
            "warnings": list(self.notes),
            "load": {
                **self.config.file.load.model_dump(),
                **sharing,
                "force_per_dog_N": limits.load.force_per_dog(dog),
                "blocking_force_N": self.blocking_force_N,
            },
            "material": {
                "set": limits.material.name,
                "source": limits.material.source,
                "allowable_stress_MPa": limits.allowable_stress / MPA,
                "fatigue_stress_MPa": limits.fatigue_stress / MPA,
            },
            **({"strikes": self.strikes} if self.strikes else {}),
        }


def check_strength(config: Setup, where: Where, *, simulate: bool = True) -> Strength:
    """Check the strength of a study's design.

    Parameters
    ----------
    where : where the shifts run, and are kept.
    simulate : whether to simulate the hardest landing, dog on dog, of the study's operating points
        and angles; a dog that cannot be made is not simulated.
    """
    config = config.working
    dog, settings = config.clutch.dog, config.file.expectation
    shifts = len(config.points) * settings.angles if simulate else 0
    measured = None
    if simulate and feasible(manufacturing_checks(dog, config.limits.manufacturing)):
        with where.executor("strength", (config.config_hash,), shifts) as running:
            (found,) = evaluate(config, [{}], running.executor, settings.angles, settings.seed)
        measured = found.measured
    design = design_of(config, {}, measured)
    return Strength(config, design, margins_within(config, design), shifts)
