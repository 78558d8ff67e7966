r"""Error of each effect's law: change of the shift time in MuJoCo against the compiled engine.

    python -m benchmarks.law_errors

Each effect that acts on a shift has half and nine tenths of its prior, to either side where it has
two. At every second operating point of ``mq200_adams`` and 24 even angles both engines of the blind
check (``validation.blind``) simulate the change :math:`c` of the logarithm of the mean, without
late shifts; :math:`d` is MuJoCo's less the other's. The likeliest errors of

.. math:: d \sim N(0,\ a^2 + s^2 c^2 + \min(|c|, l_e)^2)

are the law :math:`l_e` of each effect and the rest :math:`a`, common to all: angles that end in
another slot and the contact of the stand. The share :math:`s` is that of the settings, which have
these laws too. Ten minutes of processor time.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping

import numpy as np
from scipy.optimize import minimize

from dogshape.diagnosis.settings import USUAL
from dogshape.sim.elementwise import Array
from dogshape.sim.versions import bundled_root
from dogshape.validation.blind.cases import READING_EFFECTS
from dogshape.validation.blind.data import Draw, engine_of, mask_late
from dogshape.validation.blind.stand import Point, Stand, read_points, read_stand
from dogshape.validation.blind.true_effects import RANGES, Values, truth_of

ANGLES = 24
STRENGTHS = ((0.5, True), (0.9, True), (0.9, False))  #: share of the prior, and whether upwards
PLACE = 0.4  #: share of the range of a parameter that is a place or a mass, not a strength
ENGINES = ("planar", "mujoco")
FIRST_LAW, FIRST_REST = 0.03, 0.02  #: where the fit of both errors begins
MIN_LAW, MAX_LAW = 0.001, 0.3


def effect_values(effect: str, strength: float, *, upwards: bool) -> Values:
    """Compute the parameters of an effect at a strength."""
    values = {}
    for parameter in RANGES[effect]:
        if parameter.by_strength:
            values[parameter.name] = parameter.value_at(strength, upwards)
        elif parameter.log:
            ratio = parameter.high / parameter.low
            values[parameter.name] = parameter.low * ratio**PLACE
        else:
            values[parameter.name] = parameter.low + PLACE * (parameter.high - parameter.low)
    return values


def benches() -> Iterator[tuple[str, Values]]:
    """List effects with their values, each once."""
    for effect in sorted({*RANGES} - {*READING_EFFECTS}):
        tried: list[Values] = []
        for strength, upwards in STRENGTHS:
            values = effect_values(effect, strength, upwards=upwards)
            if values not in tried:
                tried.append(values)
                yield effect, values


def log_means(
    engine: str, stand: Stand, points: list[Point], parameters: Mapping[str, Values]
) -> Array:
    """Simulate the logarithm of the mean time at operating points, (n,)."""
    truth = truth_of(parameters, {}, {}, "sleeve")
    simulator = engine_of(engine, stand, truth)
    turns = (np.arange(ANGLES) + 0.25) / ANGLES
    draws = [Draw(turn * stand.pitch, 0.0, 0.0) for turn in turns]
    times = [[simulator.shift(point, draw).time for draw in draws] for point in points]
    waits = np.array([min(stand.timeout, stand.pitch / abs(point.mismatch)) for point in points])
    return np.log(np.nanmean(mask_late(np.array(times, dtype=float), waits), axis=1))


def fit_laws(changes: Mapping[str, Array], differences: Mapping[str, Array]) -> tuple[float, Array]:
    """Fit the rest and the law of each effect, (e,), to changes and differences, (n,) each."""
    effects = [*changes]

    def loss(logs: Array) -> float:
        """Compute the negative log likelihood."""
        rest, *laws = np.exp(2.0 * logs)
        total = 0.0
        for effect, law in zip(effects, laws, strict=True):
            square = changes[effect] ** 2
            variance = rest + USUAL.law**2 * square + np.minimum(square, law)
            total += 0.5 * float((np.log(variance) + differences[effect] ** 2 / variance).sum())
        return total

    start = np.log([FIRST_REST, *[FIRST_LAW] * len(effects)])
    bounds = [(-6.0, 0.0), *[(np.log(MIN_LAW), np.log(MAX_LAW))] * len(effects)]
    fitted = np.exp(minimize(loss, start, method="L-BFGS-B", bounds=bounds).x)
    return float(fitted[0]), fitted[1:]


def main() -> None:
    """Simulate, fit and print."""
    folder = bundled_root() / "bench" / "mq200_adams"
    stand = read_stand(folder)
    points = list(read_points(folder)[::2])
    baseline = {engine: log_means(engine, stand, points, {}) for engine in ENGINES}
    changes: dict[str, list[Array]] = {}
    differences: dict[str, list[Array]] = {}
    for effect, values in benches():
        planar, mujoco = (
            log_means(engine, stand, points, {effect: values}) - baseline[engine]
            for engine in ENGINES
        )
        changes.setdefault(effect, []).append(planar)
        differences.setdefault(effect, []).append(mujoco - planar)
        print(f"{effect} {values}", file=sys.stderr, flush=True)
    all_changes = {effect: np.concatenate(parts) for effect, parts in changes.items()}
    all_differences = {effect: np.concatenate(parts) for effect, parts in differences.items()}
    rest, laws = fit_laws(all_changes, all_differences)
    print(f"rest {rest:.3f}, of ln time")
    print(f"{'effect':22s}   law  change  difference")
    for effect, law in zip(all_changes, laws, strict=True):
        sizes = [
            np.sqrt(np.square(table[effect]).mean()) for table in (all_changes, all_differences)
        ]
        print(f"{effect:22s} {law:5.3f}   {sizes[0]:5.3f}       {sizes[1]:5.3f}")


if __name__ == "__main__":
    main()
