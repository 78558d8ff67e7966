"""Engines that make truths, by name; each is loaded when it is asked for."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Protocol

from dogshape.sim.errors import InputError, did_you_mean
from dogshape.validation.blind.mujoco_shift import Draw, Shift
from dogshape.validation.blind.stand import Point, Stand, Truth

#: Where each engine is, and the kinds of sets that it can make.
ENGINES: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "mujoco": ("mujoco_shift", "Engine", ("published", "tuning")),
    "planar": ("planar_shift", "PlanarEngine", ("wide",)),
    "drake": ("drake_discrete_shift", "DiscreteEngine", ()),
}


class TruthEngine(Protocol):
    """A stand with its truth, ready to shift."""

    def shift(self, point: Point, draw: Draw, keep: bool = False) -> Shift:
        """Simulate one shift; ``keep`` keeps its motion."""
        ...


def require_engine(name: str, which: str) -> None:
    """Raise InputError for an unknown engine, or one that cannot make a kind of set."""
    if name not in ENGINES:
        raise InputError(f"--engine is '{name}', which there is not; {did_you_mean(name, ENGINES)}")
    kinds = ENGINES[name][2]
    if not kinds:
        raise InputError(f"--engine {name} makes a part of field sets only; give --which field")
    if which not in kinds:
        raise InputError(
            f"--which is '{which}', but the engine {name} makes {' or '.join(kinds)} sets only; "
            f"give --which {kinds[0]}"
        )


def engine_of(name: str, stand: Stand, truth: Truth | None = None) -> TruthEngine:
    """Make a stand with its truth in an engine."""
    module, kind, _ = ENGINES[name]
    found: Any = getattr(import_module(f"dogshape.validation.blind.{module}"), kind)
    engine: TruthEngine = found(stand, truth)
    return engine
