"""Designs that may be proposed: drawn from the allowed space, or all there are of a small one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dogshape.pipeline.search.guide import Guide, Params
from dogshape.pipeline.search.unit_cube import Space
from dogshape.sim.errors import InputError

WIDE = 400  #: candidates of the whole space, where nobody says another number
LISTED = 10_000  #: designs of a space that are listed and not drawn, at most
TRIES = 200  #: draws for a candidate before the allowed space counts as empty


class Pool:
    """Allowed designs of the space that was asked for last, the same for every proposal.

    Most draws may not be allowed, so they are drawn once; again only when all were taken.
    """

    def __init__(self, guide: Guide, seed: int, wide: int = WIDE) -> None:
        self._guide = guide
        self._seed = seed
        self._wide = wide
        self._space = ""
        self._listed: list[dict[str, Any]] | None = None
        self._drawn: list[list[dict[str, Any]]] = []

    def untaken(self, space: Space, taken: Sequence[Params]) -> list[dict[str, Any]]:
        """Return up to ``wide`` allowed designs of a space that were not taken.

        None where every one was. Raises InputError where next to none is allowed.
        """
        self._turn_to(space)
        gone = {space.key(params) for params in taken}
        if self._listed is not None:
            return _not_of(gone, space, self._listed)[: self._wide]
        for pool in self._drawn:
            if left := _not_of(gone, space, pool):
                return left
        # Draw more, and keep them if they are new.
        rng = np.random.default_rng([self._seed, len(self._drawn)])
        more = self.drawn(space, rng, self._wide, None)
        known = {space.key(params) for pool in self._drawn for params in pool}
        if _not_of(known, space, more):
            self._drawn.append(more)
        return _not_of(gone, space, more)

    def first(self, space: Space) -> list[dict[str, Any]]:
        """Return up to ``wide`` allowed designs of a space, taken or not."""
        return self.untaken(space, [])

    def drawn(
        self, space: Space, rng: np.random.Generator, size: int, near: Sequence[Params] | None
    ) -> list[dict[str, Any]]:
        """Draw allowed designs: of the whole space, or near some."""
        found: list[dict[str, Any]] = []
        for _ in range(TRIES * size):
            centre = None if near is None else near[int(rng.integers(len(near)))]
            params = space.drawn(rng, centre)
            if self._guide.allows(params):
                found.append(params)
                if len(found) == size:
                    break
        return self._some(found, f"none of {TRIES * size} designs drawn from the search ranges")

    def _turn_to(self, space: Space) -> None:
        """Forget the designs of another space; list those of a small one."""
        if self._space == (name := repr(space.distributions)):
            return
        self._listed, self._drawn = None, []
        rng = np.random.default_rng(self._seed)
        if (every := space.every(LISTED)) is None:
            self._drawn = [self.drawn(space, rng, self._wide, None)]
        else:
            order = [every[place] for place in rng.permutation(len(every))]
            allowed = [params for params in order if self._guide.allows(params)]
            none_of = f"none of the {len(every)} designs of the search ranges"
            self._listed = self._some(allowed, none_of)
        self._space = name

    def _some(self, found: list[dict[str, Any]], none_of: str) -> list[dict[str, Any]]:
        """Require a design; raise InputError where there is none."""
        if not found:
            raise InputError(self._guide.refusal(none_of))
        return found


def _not_of(gone: set[Any], space: Space, pool: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    return [params for params in pool if space.key(params) not in gone]
