"""Change of the reading of a shift by an effect: dead time, uneven relative angles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from dogshape.diagnosis.prediction.simulations import extremes
from dogshape.sim.effect import Effect
from dogshape.sim.errors import DogshapeError
from dogshape.sim.setting import Setting


class ReadingChange(NamedTuple):
    """Change of the reading of a shift by an effect."""

    delay: float  #: s
    concentration: float  #: of the relative angles
    centre: float  #: of the relative angles, pitches


def reading_effects_of(
    effects: Mapping[str, Effect], settings: Sequence[Setting]
) -> frozenset[str]:
    """List the effects that change only the reading of a shift, by name."""
    ends = extremes(settings)
    pairs = effects.items()
    return frozenset(name for name, effect in pairs if _changes_only_reading(effect, ends))


def _changes_only_reading(effect: Effect, settings: Sequence[Setting]) -> bool:
    """Check that an effect changes only the reading of a shift, equally at all settings."""
    for share in (0.3, 0.9):
        values = {p.name: p.at(share) for p in effect.parameters}
        changes = set()
        for setting in settings:
            try:
                changed_setting = effect.apply(setting, values)
            except DogshapeError:
                return False
            if (changed_setting.clutch, changed_setting.point) != (setting.clutch, setting.point):
                return False
            changes.add(reading_change(effect, list(values.values()), setting))
        if len(changes) > 1:
            return False
    return True


def reading_change(effect: Effect, row: Sequence[float], setting: Setting) -> ReadingChange:
    """Compute the change of the reading by an effect at values (p,), 0 for no bench."""
    names = [p.name for p in effect.parameters]
    try:
        changed_setting = effect.apply(setting, dict(zip(names, row, strict=True)))
    except DogshapeError:
        return ReadingChange(delay=0.0, concentration=0.0, centre=0.0)
    return ReadingChange(
        delay=changed_setting.delay - setting.delay,
        concentration=changed_setting.concentration,
        centre=changed_setting.centre,
    )
