"""Forecast of the time that work of several kinds still takes, each weighed by what it has cost.

A search proposes designs, screens them in the compiled engine and simulates some of them in Drake:
three costs that differ by orders of magnitude. A count of shifts alone foresees none of them.

What a kind has cost so far says what the rest of it costs. Of a kind of which nothing is finished
there is a guess. By how much the kinds that were measured cost more or less than theirs, on this
machine and with this clutch, the other guesses are taken more or less, too.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["first", "design", "quick", "shift", "confirm", "fit"]

CLOCK: Callable[[], float] = time.monotonic
#: s of processor time, about, of a design that fills the space, of one that the surrogate proposes,
#: a shift of the compiled engine, one of Drake, and a quick fit. Shifts that confirm are a kind
#: of their own where another engine simulates them.
COST: Mapping[Kind, float] = {
    "first": 0.05, "design": 2.0, "quick": 0.002, "shift": 0.06, "confirm": 0.06, "fit": 10.0
}  # fmt: skip
ALONE: tuple[Kind, ...] = ("first", "design", "fit")  #: kinds that no worker shares
#: Kinds that say how fast shifts go here, whatever their engine.
SHIFTS: tuple[Kind, ...] = ("quick", "shift", "confirm")
#: The same where the study's own shifts are of the compiled engine.
PLANAR: Mapping[Kind, float] = {**COST, "shift": COST["quick"]}
#: How many of a kind that guess counts for, once some were measured.
WEIGHT: Mapping[Kind, float] = {
    "first": 4.0, "design": 1.0, "quick": 200.0, "shift": 20.0, "confirm": 20.0, "fit": 1.0
}  # fmt: skip
#: The same where there is no guess: the work that is done says all.
NO_GUESS: Mapping[Kind, float] = dict.fromkeys(WEIGHT, 0.0)
SURE = 1.0  #: s of shifts for which the guesses themselves stand, before those here say more
ONCE = 0.05  #: share of what is left up to which the first report of a kind is of its start


@dataclass
class Forecast:
    """Foresee the time left from what each kind of work has cost so far.

    Time between two reports belongs to the kind that is reported. A report of none of a kind lets
    its time wait for the next report of some, as the proposals of a round do. ``left`` is what is
    expected of each kind, ``jobs`` the number of workers that share shifts, ``cost`` the first
    guess in s of processor time, ``weight`` how many of a kind that counts for, ``clock`` gives
    seconds.
    """

    left: dict[Kind, float]
    jobs: int = 1
    cost: Mapping[Kind, float] = field(default_factory=lambda: COST)
    weight: Mapping[Kind, float] = field(default_factory=lambda: WEIGHT)
    clock: Callable[[], float] = field(default_factory=lambda: CLOCK)
    done: dict[Kind, float] = field(default_factory=dict, init=False)
    spent: dict[Kind, float] = field(default_factory=dict, init=False)
    _waiting: dict[Kind, float] = field(default_factory=dict, init=False, repr=False)
    _started: set[Kind] = field(default_factory=set, init=False, repr=False)
    _last: float = field(default=0.0, init=False, repr=False)

    def __post_init__(self) -> None:
        self._last = self.clock()

    def report(self, kind: Kind, count: float) -> None:
        """Take that ``count`` of a kind are finished; the time since the last report was theirs.

        Shifts count by what they cost: one that takes twice the mean is two. A small first part of
        them is left out: it has the start of workers and engine in it, which comes once.
        """
        now = self.clock()
        lasted, self._last = now - self._last, now
        self._waiting[kind] = self._waiting.get(kind, 0.0) + lasted
        if count:
            took = self._waiting.pop(kind)
            if kind in self._started or kind in ALONE or count > ONCE * self.left.get(kind, 0.0):
                self.spent[kind] = self.spent.get(kind, 0.0) + took
                self.done[kind] = self.done.get(kind, 0.0) + count
            self._started.add(kind)
            self.left[kind] = max(0.0, self.left.get(kind, 0.0) - count)

    def skip(self, kind: Kind, count: float) -> None:
        """Take that ``count`` of a kind were finished by an earlier run: they cost nothing."""
        self.left[kind] = max(0.0, self.left.get(kind, 0.0) - count)

    def expect(self, left: Mapping[Kind, float]) -> None:
        """Expect so much of each kind from now on, whatever was expected before."""
        self.left = dict(left)

    def guess(self, kind: Kind) -> float:
        """Return the first guess of the time that one of a kind takes, s, on this machine."""
        if kind in ALONE:
            return self.cost[kind]
        return self.cost[kind] / max(1, self.jobs) * self.pace

    @property
    def pace(self) -> float:
        """Cost of the shifts that were measured over their guesses; 1 before any were."""
        jobs = max(1, self.jobs)
        spent = sum(self.spent.get(kind, 0.0) for kind in SHIFTS)
        guessed = sum(self.done.get(kind, 0.0) * self.cost[kind] for kind in SHIFTS) / jobs
        return (spent + SURE) / (guessed + SURE)

    def each(self, kind: Kind) -> float:
        """Return the time that one of a kind takes, s: measured, with the guess at first."""
        spent, done = self.spent.get(kind, 0.0), self.done.get(kind, 0.0)
        weight = self.weight[kind] if done else 1.0
        return (spent + weight * self.guess(kind)) / (done + weight)

    @property
    def seconds(self) -> float:
        """Time left, s."""
        return sum(count * self.each(kind) for kind, count in self.left.items())
