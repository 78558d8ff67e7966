"""Diagnoses for tests: of the stand, made by hand, and of a clutch of closed form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from dogshape.bench.bench_data import Bench, Reading, gather, load_bench, setting_of
from dogshape.diagnosis.comparison import PointGap
from dogshape.diagnosis.diagnosis import GapStep, Inference, diagnose
from dogshape.diagnosis.gap_map import describe_gaps
from dogshape.diagnosis.inference.fit import Interval
from dogshape.diagnosis.inference.outcome import NextTest
from dogshape.diagnosis.inference.static_readings import facts_of
from dogshape.diagnosis.inference.verdict import CauseVerdict, inclusion
from dogshape.diagnosis.next_test import rank_tests
from dogshape.diagnosis.prediction.building import build_models
from dogshape.diagnosis.prediction.curve import ParameterSpace
from dogshape.diagnosis.settings import USUAL, Settings
from dogshape.diagnosis.terms import NONE, UNKNOWN, Array, Hypothesis
from dogshape.sim.effects import load
from dogshape.sim.setting import Setting
from tests.analytic import RECORD, mean_time, select_cells, simulate_analytic

EFFECTS = load()
STAND = load_bench("mq200_stand")
DRAWS = 400
NAMED = ("actuation_delay", "drag_torque")
HEAVY = (*NAMED, "moving_mass")
DAMPED = (*NAMED, "viscous_damping")
POSTERIOR = {HEAVY: 0.62, DAMPED: 0.2, NAMED: 0.14, UNKNOWN: 0.02, NONE: 0.02}
#: Mean and standard deviation of each size that a fit may have.
SIZES = {
    "delay_s": (0.078, 0.012),
    "drag_Nm": (1.6, 0.2),
    "added_mass_kg": (20.0, 2.0),
    "damping_Ns_m": (300.0, 40.0),
    "friction_N": (40.0, 6.0),
    "static_friction": (0.35, 0.01),
    "dynamic_friction": (0.28, 0.01),
    "gap_offset_mm": (0.3, 0.05),
    "compliance_mm_kN": (3.9, 0.2),
    "mass_behind_kg": (5.0, 0.5),
}


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis: equally weighted draws of values."""

    space: ParameterSpace
    values: Array
    predicted: Any
    p: float | None

    @property
    def shares(self) -> Array:
        """Values stand for the shares of their ranges."""
        return self.values

    @property
    def intervals(self) -> dict[str, Interval]:
        """Mean and 90 % of each parameter."""
        columns = zip(self.space.parameters, self.values.T, strict=True)
        return {parameter.name: Interval.of(column) for parameter, column in columns}


def fit_of(hypothesis: Hypothesis, times: Array, p: float | None = 0.4) -> Fit:
    """Fit a hypothesis by draws of ``SIZES`` with equal mean times, s, (C,)."""
    generator = np.random.default_rng(len(hypothesis))
    space = ParameterSpace(tuple(EFFECTS[name] for name in hypothesis), setting_of(STAND))
    columns = [generator.normal(*SIZES[parameter.name], DRAWS) for parameter in space.parameters]
    values = np.stack(columns, axis=1) if columns else np.zeros((DRAWS, 0))
    mean = np.tile(times, (DRAWS, 1))
    predicted = SimpleNamespace(mean=mean, sd=0.3 * mean, error=0.01 * mean)
    return Fit(space, values, predicted, p)


def verdict_of(posterior: Mapping[Hypothesis, float]) -> CauseVerdict:
    """Name effects above 0.95, a hypothesis above 0.8, or unknown."""
    top = max(posterior, key=lambda h: posterior[h])
    causes = tuple(sorted(name for name, p in inclusion(posterior).items() if p > 0.95))
    kinds = {NONE: "none", UNKNOWN: "unknown"}
    kind = kinds.get(top, "effect") if posterior[top] > 0.8 else "ambiguous"
    return CauseVerdict(kind, causes, tuple(posterior))


@cache
def stand_diagnosis() -> Any:
    """Diagnose the stand by hand: dead time and drag named, a mass open, a linkage refuted."""
    return diagnosis_of(POSTERIOR)


def diagnosis_of(
    posterior: Mapping[Hypothesis, float], bench: Bench = STAND, **changes: Any
) -> Any:
    """Build a diagnosis of a posterior, whose fits explain all but 10 % of the times."""
    times = np.array([0.2 if cell.time is None else cell.time for cell in bench.cells])
    base = 0.45 * times
    listed = [h for h in posterior if h != UNKNOWN]
    fits = {h: fit_of(h, 0.9 * times) for h in listed if h} | {NONE: fit_of(NONE, base, 1e-5)}
    inclusions = inclusion(posterior)
    verdict = verdict_of(posterior)
    leading = max(listed, key=lambda h: posterior[h])
    rival = next((h for h in listed if h != leading), None)
    gaps = tuple(
        PointGap(cell, mean, 0.02) for cell, mean in zip(bench.cells, base.tolist(), strict=True)
    )
    sizes = {}
    for name in inclusions:
        draws = [f.values[:, f.space.columns(name)] for h, f in fits.items() if name in h]
        columns = zip(EFFECTS[name].parameters, np.concatenate(draws).T, strict=True)
        sizes[name] = {parameter.name: Interval.of(column) for parameter, column in columns}
    diagnosis = SimpleNamespace(
        bench=bench,
        effects=EFFECTS,
        posterior=dict(posterior),
        evidence=dict(posterior),
        fits=fits,
        inclusion=inclusions,
        inclusion_error=dict.fromkeys(inclusions, 0.01),
        verdict=verdict,
        within_margin=0.01,
        gaps=gaps,
        where=describe_gaps(gaps),
        range_ends=(),
        contact={"contact_stiffness": Interval(0.08, 0.04, 0.15)},
        odd_contact=(),
        gap_steps=tuple(GapStep(name, 0.1 / k) for k, name in enumerate(leading, start=1)),
        settings=USUAL,
        leading=leading,
        rival=rival,
        record_meanings=(),
        tests=advised_tests(),
        facts=facts_of(bench, USUAL.static_error),
        margin_s=0.011,
        sizes=sizes,
        leading_error=0.004,
        seconds=4.2,
        observed=SimpleNamespace(mean=times, count=np.array([cell.n for cell in bench.cells])),
        model=SimpleNamespace(  # no effect moves a time
            setting=setting_of(bench),
            effects=EFFECTS,
            nuisances={name: EFFECTS[name] for name in USUAL.nuisance},
            predict=lambda h, shares: SimpleNamespace(mean=np.tile(base, (len(shares), 1))),
        ),
        held_out=SimpleNamespace(
            baseline=0.138,
            held_out=0.021,
            chance=0.018,
            rival=rival,
            rival_held_out=None if rival is None else 0.022,
            mean=0.9 * times,
            sd=0.02 * times,
        ),
    )
    vars(diagnosis).update(changes)
    diagnosis.to_dict = lambda: record_of(diagnosis)
    return diagnosis


def advised_tests() -> tuple[NextTest, ...]:
    """List two tests: traces that settle much, and a cheap run-down."""
    return (
        NextTest(
            name="traces of 10 shifts at 5 1/min and 235.2 N",
            how="Record them.",
            kind="traces",
            hours=2.2,
            information=0.9,
            gain=0.4,
            refutes="A mean time above 40 ms refutes the set.",
            settles=0.55,
            misleads=0.02,
        ),
        NextTest(
            name="run-down of the sliding ring",
            how="Turn it.",
            kind="direct",
            hours=1.0,
            effects=("drag_torque",),
        ),
    )


def record_of(diagnosis: Any) -> dict[str, Any]:
    """Write the keys of ``gap.json`` that pages and updates take."""
    return {
        "bench": diagnosis.bench.name,
        "engine": "planar",
        "verdict": diagnosis.verdict.kind,
        "causes": list(diagnosis.verdict.causes),
        "hypotheses": [
            {"effects": list(h), "probability": p, "evidence_probability": diagnosis.evidence[h]}
            for h, p in diagnosis.posterior.items()
        ],
        "inclusion": diagnosis.inclusion,
        "credible_set": [list(h) for h in diagnosis.verdict.credible],
        "record": {"time_zero": "unknown", "sense": "unknown"},
        "next_test": {"name": diagnosis.tests[0].name, "why": diagnosis.tests[0].why},
    }


def reading(
    key: str, value: str, probability: float, causes: tuple[str, ...], prior: float = 0.5
) -> Any:
    """Make a reading of the record by which some effects are named."""
    verdict = replace(stand_diagnosis().verdict, causes=causes)
    return SimpleNamespace(
        key=key, value=value, prior=prior, probability=probability, verdict=verdict
    )


#: Operating points of the closed form: mismatch in 1/min and force in N.
MISMATCHES_AND_FORCES = [
    (m, force) for m in (10.0, 50.0, 100.0, 249.0) for force in (235.2, 469.0, 641.5)
]
FEW_EFFECTS = ("actuation_delay", "sleeve_friction", "moving_mass", "mismatch_speed", "force_scale")


def simulated_bench(cause: Mapping[str, Mapping[str, float]], seed: int = 1) -> Bench:
    """Make means of twenty shifts of the closed form with a cause, each off by some 2 ms."""
    bench = select_cells(load_bench("mq200_adams"), MISMATCHES_AND_FORCES)
    generator = np.random.default_rng(seed)
    rows = []
    for k, cell in enumerate(bench.cells):
        setting = Setting(bench.clutch, cell.point)
        for name, values in cause.items():
            setting = EFFECTS[name].apply(setting, values)
        time = mean_time(setting.clutch, setting.point) + setting.delay
        error = float(generator.normal(0.0, 0.002))
        rows.append(Reading(k + 2, cell.point, 20, time + error, engaged=True))
    return replace(bench, cells=gather(rows), record=RECORD)


def simulated_diagnosis(
    bench: Bench, settings: Settings = USUAL, *, advise: bool = False
) -> Inference:
    """Diagnose a bench of the closed form, among a few effects."""
    models = build_models(
        bench, {name: EFFECTS[name] for name in FEW_EFFECTS}, settings, simulate_analytic
    )
    diagnosis = diagnose(bench, models, settings)
    return replace(diagnosis, tests=rank_tests(diagnosis)) if advise else diagnosis
