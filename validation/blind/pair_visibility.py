r"""Share of a pair's gap that only one of its effects makes, by two yardsticks.

With :math:`\bar t` the means of the pair and :math:`\bar t_e` those without the effect *e*, at even
angles of the same engine, the size of *e* *beside* its partner is the root mean square over the
operating points of

.. math:: z = (\bar t - \bar t_e) / (\sigma_0 / \sqrt n),

:math:`\sigma_0/\sqrt n` the sampling error of the case's means. This size holds the
partner fixed and does not say whether the effect can be found: with other values the partner alone
can do much the same. The residual after a refit of the partner, in standard errors of all operating
points together, is the second yardstick (``validation.blind.pair_refit``).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dogshape.validation.blind.advised_test import stage_of
from dogshape.validation.blind.case_marks import counted, sampling_error
from dogshape.validation.blind.even_means import ANGLES, even_means
from dogshape.validation.blind.pair_refit import Seen, left_by
from dogshape.validation.blind.sealed import Advance, ignore, manifest_of, pool, read, write
from dogshape.validation.blind.stand import Point, Stand
from dogshape.validation.blind.true_effects import truth_of

Record = dict[str, Any]  #: key of a set, as it is kept in JSON

KEPT = "partners.json"  #: beside the cases


@dataclass(frozen=True)
class Size:
    """Size of an effect of a pair beside its partner, in standard errors.

    Parameters
    ----------
    beside : of a mean, root mean square over the operating points, with the partner held.
    before, after : of all operating points together, without another fit of the partner and with
        the best one (``validation.blind.pair_refit``).
    """

    beside: float
    before: float
    after: float

    def as_dict(self) -> Record:
        """Write the entry of the score."""
        return {
            "beside_in_errors": self.beside,
            "before_refit_in_errors": self.before,
            "after_refit_in_errors": self.after,
            "log_likelihood_ratio_after_refit": 0.5 * self.after**2,
        }


Sizes = dict[str, Size]  #: by effect


def partner_gaps(
    folder: Path,
    key: Record,
    seen: Callable[[Path], Seen],
    jobs: int = 1,
    advance: Advance | None = None,
) -> dict[str, Sizes]:
    """Compute for each pair of a set the size of each effect beside the other.

    It takes 45 s of processor time a pair at 28 operating points. What is finished is kept in the
    folder; ``advance`` counts shifts. ``seen`` says with what the folder of a pair is diagnosed;
    one answer is for all.
    """
    path, seal = folder / KEPT, manifest_of(folder)["key_sha256"]
    found, left = _kept(folder), _left(folder, key)
    if not left:
        return found
    mine = seen(folder / "cases" / next(iter(left)))
    with pool(jobs) as submit:
        pending = {}
        for name, case in left.items():
            stage = stage_of(folder, key, name)
            pending[submit(added_by, stage.stand, stage.points, case["parameters"])] = name
        for future in as_completed(pending):
            name = pending[future]
            found[name] = sizes_of(future.result(), key["cases"][name], key, mine)
            kept = {n: {e: asdict(size) for e, size in sizes.items()} for n, sizes in found.items()}
            write(path, json.dumps({"key": seal, "sizes": kept}, indent=1))
            (advance or ignore)(_shifts(key["cases"][name], key))
    return found


def shifts_left(folder: Path, key: Record) -> int:
    """Count the shifts that ``partner_gaps`` has to make."""
    return sum(_shifts(case, key) for case in _left(folder, key).values())


def _kept(folder: Path) -> dict[str, Sizes]:
    """Read what is known of this set; of another set, or by one yardstick, it tells nothing."""
    path = folder / KEPT
    kept = read(path, "remove it") if path.exists() else {}
    if kept.get("key") != manifest_of(folder)["key_sha256"]:
        return {}
    return {
        name: {effect: Size(**size) for effect, size in sizes.items()}
        for name, sizes in kept["sizes"].items()
        if all(isinstance(size, dict) for size in sizes.values())
    }


def _left(folder: Path, key: Record) -> dict[str, Record]:
    found = _kept(folder)
    cases: dict[str, Record] = key["cases"]
    return {n: case for n, case in cases.items() if case["kind"] == "pair" and n not in found}


def _shifts(case: Record, key: Record) -> int:
    """Return the shifts of a pair with both effects and without either."""
    return (1 + len(case["parameters"])) * len(key["points"]) * ANGLES


def added_by(
    stand: Stand, points: Sequence[Point], every: Mapping[str, Any]
) -> dict[str, np.ndarray]:
    """Simulate what each effect of a pair adds to its partner's mean times, s, (points,).

    ``every`` are the parameters by effect. NaN where no shift engages with either.
    """
    whole = even_means(stand, points, truth_of(every, {}))
    return {
        name: whole
        - even_means(stand, points, truth_of({n: v for n, v in every.items() if n != name}, {}))
        for name in every
    }


def sizes_of(added: Mapping[str, np.ndarray], case: Record, key: Record, seen: Seen) -> Sizes:
    """Compute the size of each effect of a pair from what it adds, s, (points,)."""
    left = left_by(seen, case, key["points"], added)
    return {n: Size(beside(d, case, key), left[n].before, left[n].after) for n, d in added.items()}


def beside(added: np.ndarray, case: Record, key: Record) -> float:
    """Compute the size of what is added to means, s, (points,), in their sampling errors."""
    given = zip(key["reference_s"], case["times_s"], strict=True)
    errors = np.array([sampling_error(free, len(mine)) for free, mine in given])
    z = added / errors
    return float(np.sqrt(counted((z[np.isfinite(z)] ** 2).tolist())))
