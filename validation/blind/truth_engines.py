"""Engines that make truths, by name; each is loaded when it is asked for."""

from __future__ import annotations

from importlib import import_module
from typing import Any, Protocol

from dogshape.validation.blind.mujoco_shift import Draw, Shift
from dogshape.validation.blind.stand import Point, Stand, Truth

#: Module and class of each engine.
ENGINES = {
    "mujoco": ("mujoco_shift", "Engine"),
    "planar": ("planar_shift", "PlanarEngine"),
    "drake": ("drake_discrete_shift", "DiscreteEngine"),
}


class TruthEngine(Protocol):
    """A stand with its truth, ready to shift."""

    def shift(self, point: Point, draw: Draw, keep: bool = False) -> Shift:
        """Simulate one shift; ``keep`` keeps its motion."""
        ...


def engine_of(name: str, stand: Stand, truth: Truth | None = None) -> TruthEngine:
    """Make a stand with its truth in an engine."""
    module, kind = ENGINES[name]
    found: Any = getattr(import_module(f"dogshape.validation.blind.{module}"), kind)
    engine: TruthEngine = found(stand, truth)
    return engine
