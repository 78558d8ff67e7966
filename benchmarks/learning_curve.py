"""The surrogate against the number of simulated shifts, and where it is wrong.

Takes what ``make one-level`` simulated: the first designs of its filling, more and
more of them, each time judged by the same references.
"""

from __future__ import annotations

import numpy as np

from benchmarks.space import space
from dogshape.pipeline.train.training import FILLED
from dogshape.surrogate.fitting import Effort
from dogshape.surrogate.learning import fit
from dogshape.surrogate.references import Reference
from dogshape.surrogate.validation_figures import Prediction, figures, predict, ranked

DESIGNS = (40, 80, 160, 320, 500)


def main() -> None:
    """Print the learning curve, then errors by operating point."""
    kept = space()
    reference, best = kept.references
    print(f"{len(reference)} references that fill the space, {len(best)} of the best tenth")
    print("designs  shifts  Q2     rmse,ms  bias,ms  in 95 %  Q2 points  in 95 %  rank of best")
    for count in DESIGNS:
        data = kept.first(count)
        model = fit(data, kept.form, effort=Effort(FILLED))
        prediction = predict(model, reference.x, kept.mix)
        v = figures(reference, prediction, "references", data.shifts)
        v = ranked(v, best, predict(model, best.x, kept.mix).time)
        rank = "-" if v.rank_best is None else f"{v.rank_best:.2f}"
        print(
            f"{count:7d}  {v.shifts:6d}  {v.q2:.3f}  {v.rmse_s * 1e3:7.2f}  {v.bias_s * 1e3:+7.2f}"
            f"  {v.coverage_95:7.0%}  {v.q2_points:9.3f}  {v.coverage_points:7.0%}  {rank:>12s}",
            flush=True,
        )
    _where(kept.mix.points, reference, prediction)


def _where(points: np.ndarray, reference: Reference, prediction: Prediction) -> None:
    """Print the error of the mean by mismatch, over designs and forces."""
    error = np.log(prediction.means / reference.means)
    print()
    print("where it is wrong, all designs: root mean square of the relative error")
    print("mismatch, 1/min  error  of it noise of the reference  foretold  largest miss")
    for mismatch in np.unique(points[:, 0]):
        here = points[:, 0] == mismatch
        noise = (reference.errors / reference.means)[:, here]
        found = error[:, here]
        worst = np.unravel_index(np.argmax(np.abs(found)), found.shape)
        at = points[here][worst[1]]
        asked, true = (v[:, here][worst] * 1e3 for v in (prediction.means, reference.means))
        print(
            f"{mismatch:15.0f}  {_rms(found):.3f}  {_rms(noise):27.3f}  "
            f"{_rms(prediction.relative[:, here]):8.3f}  "
            f"{asked:.0f} for {true:.0f} ms at {at[1]:.1f} N"
        )


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt((values**2).mean()))


if __name__ == "__main__":
    main()
