"""Series and cells as benches leave them: places, spreads, unequal numbers, missing points."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.bench.bench_data import Bench, Reading, gather, load_bench
from dogshape.diagnosis.likelihood.likelihood import Likelihood
from dogshape.diagnosis.likelihood.observed import observe
from dogshape.diagnosis.prediction.building import build_models
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import NONE
from dogshape.pipeline.diagnose.gap_update import join_readings, keep_data, read_request
from dogshape.sim.errors import DataError
from dogshape.sim.versions import bundled_root
from tests.analytic import simulate_analytic
from tests.diagnoses import EFFECTS, simulated_bench, simulated_diagnosis

HEAD = "mismatch_rpm,force_N,force_rise_s,n_shifts,shift_time_s"
Write = Callable[[str, Sequence[str]], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write the table of a data set below a head, and return its folder."""
    target = tmp_path / "set"
    shutil.copytree(bundled_root() / "bench" / "mq200_stand", target)

    def written(more: str, rows: Sequence[str]) -> Path:
        head = f"{HEAD},{more}" if more else HEAD
        (target / "shifts.csv").write_text("\n".join([head, *rows]) + "\n")
        return target

    return written


def _places(folder: Path) -> list[float | None]:
    return [reading.place for reading in load_bench(folder).readings]


def test_places_are_an_order_or_else_time_stamps(write: Write) -> None:
    row, stamps = "50,469,0.1766,1,0.05", ("2024-05-31T14:05:09", "2024-05-31 16:05:10+02:00")
    assert _places(write("order", [f"{row},2", f"{row},1", "9,469,0.1766,1,,"])) == [2.0, 1.0, None]
    first, second = _places(write("timestamp", [f"{row},{s}" for s in stamps]))
    assert (second or 0.0) - (first or 0.0) == 1.0
    assert _places(write("timestamp", [f"{row},{s}" for s in (7, 8.5)])) == [7.0, 8.5]
    both = [f"{row},{k},{stamp}" for k, stamp in zip((3, 1), stamps, strict=True)]
    assert _places(write("order,timestamp", both)) == [3.0, 1.0]


@pytest.mark.parametrize(
    ("more", "cells", "words"),
    [
        ("order", ("1", ""), "row 3, column order is '', but it must be filled"),
        ("order", ("1", "b"), "row 3, column order is 'b', but it must be a number"),
        ("timestamp", ("1", "noon"), "row 3, column timestamp is 'noon', but it must be a date"),
        ("timestamp", ("5", "2024-05-31"), "row 2, column timestamp is '5', but it must be a date"),
        ("shift_time_sd_s", ("", "0.01"), "column shift_time_sd_s is '0.01', but it must be empty"),
        ("shift_time_sd_s", ("", "nan"), "row 3, column shift_time_sd_s is 'nan'"),
    ],
)
def test_broken_cells(write: Write, more: str, cells: tuple[str, str], words: str) -> None:
    rows = [f"50,469,0.1766,1,0.05,{cell}" for cell in cells]
    with pytest.raises(DataError) as refused:
        load_bench(write(more, rows))
    assert words in str(refused.value)


def test_a_spread_of_no_times_is_refused_and_a_slip_of_units_corrected(write: Write) -> None:
    for sd in ("-0.01", "5"):
        with pytest.raises(DataError, match="row 2, column shift_time_sd_s is"):
            load_bench(write("shift_time_sd_s", [f"50,469,0.1766,10,0.05,{sd}"]))
    folder = write("shift_time_sd_s", ["50,469,0.1766,10,50,8", "100,469,0.1766,10,60,9"])
    first, second = load_bench(folder, ["time=ms"]).readings
    assert first.time == pytest.approx(0.05)
    assert (first.sd, second.sd) == (pytest.approx(0.008), pytest.approx(0.009))


@pytest.mark.parametrize("joins", [True, False])
def test_new_readings_continue_or_end_the_series(write: Write, tmp_path: Path, joins: bool) -> None:
    folder = write("order", ["50,469,0.1766,1,0.05,1", "100,469,0.1766,1,0.06,2"])
    out = tmp_path / "out"
    out.mkdir()
    keep_data(load_bench(folder), out, None)
    new = tmp_path / "new.csv"
    more, cell = (",order", ",1") if joins else ("", "")
    new.write_text(f"{HEAD}{more}\n149,469,0.1766,1,0.04{cell}\n")
    found, _ = join_readings(out, new, read_request(out))
    assert [r.place for r in found.readings] == ([1.0, 2.0, 3.0] if joins else [None] * 3)


#: Without late shifts, as nothing else separates a mean from its shifts.
RARE = replace(USUAL, late_least=1e-9)


def _likelihood(bench: Bench, settings: Settings = RARE) -> Likelihood:
    """Build the likelihood of a bench of the closed form, without an effect."""
    few = {"sleeve_friction": EFFECTS["sleeve_friction"]}
    (model,) = build_models(bench, few, USUAL, simulate_analytic).values()
    return Likelihood(bench, observe(bench, model), model, settings)


def _log(bench: Bench, sd: float) -> float:
    """Compute the log likelihood of the baseline with a spread in s and no late shifts."""
    likelihood = _likelihood(bench)
    p = likelihood.model.predict(NONE, np.zeros((1, 0)))
    return float(
        likelihood.terms(
            replace(p, sd=np.full_like(p.sd, sd), late_share=0.0 * p.late_share)
        ).log_likelihood[0]
    )


def _shifts(bench: Bench, scatter: float, count: int = 12, seed: int = 3) -> Bench:
    """Put single shifts around each mean time."""
    generator = np.random.default_rng(seed)
    rows = [
        Reading(2, cell.point, 1, (cell.time or 0.0) + float(off), engaged=True)
        for cell in bench.cells
        for off in generator.normal(0.0, scatter, count)
    ]
    return replace(bench, cells=gather([replace(r, row=k) for k, r in enumerate(rows, 2)]))


def _summed(bench: Bench) -> Bench:
    """Put the single shifts of each point into one mean with their spread."""
    rows = [
        Reading(k, cell.point, cell.n, cell.time, True, sd=float(cell.times.std(ddof=1)))
        for k, cell in enumerate(bench.cells, start=2)
    ]
    return replace(bench, cells=gather(rows))


def test_spreads_beside_means_are_pooled_with_those_of_single_shifts(write: Write) -> None:
    means = ["50,469,0.1766,4,0.05,0.008", "50,469,0.1766,9,0.06,0.011"]
    times = (0.05, 0.055, 0.061, 0.058)
    singles = [f"50,469,0.1766,1,{t}," for t in times]
    bench = load_bench(write("shift_time_sd_s", [*means, *singles]))
    record = bench.record.model_copy(update={"displacement_at": "sleeve", "sense": "known"})
    seen = _likelihood(replace(bench, record=record)).observed
    squares = 3 * 0.008**2 + 8 * 0.011**2 + 3 * float(np.var(times, ddof=1))
    assert seen.freedom[0] == 14
    assert seen.variance[0] == pytest.approx(squares / 14)
    assert seen.count[0] == 17
    assert seen.hides_late[0]


def test_a_mean_with_its_spread_has_the_likelihood_of_its_shifts() -> None:
    """Mean and standard deviation are all that counts of single shifts without late ones."""
    single = _shifts(simulated_bench({}), 0.004)
    mean = _summed(single)
    # Each point may be odd in the mean as in the shifts; what is left is the share of late ones.
    assert _log(mean, 0.004) == pytest.approx(_log(single, 0.004), abs=1e-3)


def test_a_late_shift_in_a_spread_is_no_other_spread() -> None:
    """One late shift of ten makes the standard deviation; with its share known the set fits."""
    plain = simulated_bench({})
    likelihood = _likelihood(plain)
    behind = likelihood.model.baseline.late_delay.mean
    rows = []
    for k, (cell, late) in enumerate(zip(plain.cells, behind.tolist(), strict=True), start=2):
        times = (cell.time or 0.0) + np.append(0.004 * np.linspace(-1, 1, 9), late)
        mean, sd = float(times.mean()), float(times.std(ddof=1))
        rows.append(Reading(k, cell.point, 10, mean, True, sd=sd))
    found = _likelihood(replace(plain, cells=gather(rows)))
    p = found.model.predict(NONE, np.zeros((1, 0)))
    p = replace(p, sd=np.full_like(p.sd, 0.003))
    shares = (replace(p, late_share=np.full_like(p.late_share, share)) for share in (0.1, 0.0))
    some, none = (found.terms(one).log_likelihood[0] for one in shares)
    assert some > none + 10.0


def _with(counts: Sequence[int]) -> Bench:
    """Make so many shifts with a delay at each point; 0 leaves a point out."""
    bench = simulated_bench({"actuation_delay": {"delay_s": 0.08}})
    cells = zip(bench.cells, counts, strict=True)
    rows = [replace(r, n=n) for cell, n in cells for r in cell.readings if n]
    return replace(bench, cells=gather(rows))


@pytest.mark.parametrize(
    "counts",
    [[3] * 12, [1, 2, 7, 40] * 3, [0, 10, 0, 3, 10, 10] * 2, [500] + [3] * 11],
    ids=["few", "unequal", "missing points", "one of many"],
)
def test_any_number_of_shifts_at_any_points_leads_to_the_cause(counts: list[int]) -> None:
    found = simulated_diagnosis(_with(counts))
    assert found.leading == ("actuation_delay",)
    size = found.sizes["actuation_delay"]["delay_s"]
    assert size.low - 0.01 < 0.08 < size.high + 0.01


def test_a_mean_counts_by_its_number() -> None:
    """Three rows of one point are their weighted mean, with the number of all their shifts."""
    bench = simulated_bench({})
    point, parts = bench.cells[-1].point, [(1, 0.021), (2, 0.024), (7, 0.023)]
    whole = sum(n * time for n, time in parts) / 10
    rows = [Reading(k, point, n, t, True) for k, (n, t) in enumerate(parts, 2)]
    apart, together = (
        _likelihood(replace(bench, cells=gather(some)), USUAL)
        for some in (rows, [Reading(2, point, 10, whole, True)])
    )
    assert apart.observed.mean[0] == pytest.approx(whole)
    assert apart.observed.count[0] == together.observed.count[0] == 10
    logs = [
        one.terms(one.model.predict(NONE, np.zeros((1, 0)))).log_likelihood
        for one in (apart, together)
    ]
    assert logs[0] == pytest.approx(logs[1])


def test_an_error_of_the_simulation_does_not_average_out() -> None:
    """More shifts at one point make it no surer than the error of any simulation."""
    bench, logs = simulated_bench({}), []
    for n in (10, 1000, 100_000):
        row = Reading(2, bench.cells[-1].point, n, 0.03, engaged=None)
        one = _likelihood(replace(bench, cells=gather([row])))
        p = one.model.predict(NONE, np.zeros((1, 0)))
        p = replace(p, late_share=0.0 * p.late_share)
        own = one.mean_variance(p)[0, 0]
        assert own > (USUAL.model_error * p.mean[0, 0]) ** 2 * (1.0 - 1e-9)
        logs.append(float(one.terms(p).log_likelihood[0]))
    assert logs[1] == pytest.approx(logs[2], abs=0.1)
