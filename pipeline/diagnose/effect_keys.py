"""The keys of a study that say what an effect of the diagnosis says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dogshape.pipeline.config.mechanism import keys_changed
from dogshape.sim import effects as registry
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting
from dogshape.sim.units import from_si

#: Keys of the dog by the field that an effect changes.
DOG = {
    "dog.count": "count",
    "dog.chamfer": "chamfer_deg",
    "dog.traction": "traction_deg",
    "dog.braking": "braking_deg",
    "dog.height": "height_mm",
    "dog.outer_diameter": "outer_diameter_mm",
    "dog.inner_diameter": "inner_diameter_mm",
    "dog.axial_gap": "axial_gap_mm",
}
TABLES = ("mechanism", "contact", "sliding")


@dataclass(frozen=True)
class EffectKeys:
    """Keys of a study for effects.

    Parameters
    ----------
    base : setting of the study without them, at the point where effects show what they change.
    known : effects that the program brings, which ``[effects]`` takes by name; those of a user's
        own become keys of the mechanism.
    """

    base: Setting
    known: frozenset[str]

    def takes(self, effect: Effect) -> bool:
        """Decide whether a study has keys for an effect."""
        touched = self.touched(effect)
        tables = {key.partition(".")[0] for key in touched}
        return bool(touched) and tables <= {*TABLES, "dog"} and touched <= self._writable(effect)

    def _writable(self, effect: Effect) -> set[str]:
        touched = self.touched(effect)
        if effect.name in self.known:
            return touched
        # A rise that an own effect sets in seconds is no factor of another study's.
        mine = {key for key in touched if key in DOG or key.startswith("mechanism.")}
        return mine - {"mechanism.rise_factor"}

    def touched(self, effect: Effect) -> set[str]:
        """List the keys that an effect changes at any of some values."""
        found: set[str] = set()
        for share in (0.2, 0.4, 0.6, 0.8):
            values = {p.name: p.at(share) for p in effect.parameters}
            try:
                found |= keys_changed(effect, values, self.base)
            except DogshapeError:
                continue  # values of which there is no bench
        return found

    def touched_by_name(self, name: str) -> set[str]:
        """List the keys that an effect of the program changes; none for another name."""
        effect = registry.load().get(name)
        return self.touched(effect) if effect else set()

    def settings(self, effect: Effect, values: Mapping[str, float]) -> dict[str, Any]:
        """Return an effect as dotted keys of a study with their values.

        Raises DogshapeError for values of which there is no such clutch.
        """
        touched = self.touched(effect)
        after = effect.apply(self.base, values)
        if any(key in DOG for key in touched):
            dog = {name: getattr(after.clutch.dog, key[4:]) for key, name in DOG.items()}
            return {
                f"dog.{name}": dog[name] if name == "count" else _short(from_si(name, dog[name]))
                for key, name in DOG.items()
                if key in touched
            }
        if effect.name in self.known:
            if len(values) == 1:
                return {f"effects.{effect.name}": _short(*values.values())}
            return {f"effects.{effect.name}.{name}": _short(v) for name, v in values.items()}
        record = after.clutch.mechanism.record | {
            "mechanism_delay_s": after.delay + after.point.profile.delay,
            "mechanism_lag_s": getattr(after.point.profile, "lag", 0.0),
            "mechanism_force_loss_N": after.point.profile.loss,
            "mechanism_force_factor": after.point.profile.force / self.base.point.profile.force,
        }
        return {key: _short(record.get(key.replace(".", "_"), 0.0)) for key in sorted(touched)}


def _short(value: float) -> float:
    """Round a number to six significant digits."""
    return float(f"{value:.6g}")
