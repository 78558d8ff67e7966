"""Schema of ``gap.json``: every key with its type, unit and meaning; unknown keys are refused.

``dogshape gap --json`` prints the same record with what stands beside the inference
(``DiagnosisRecord``). Keys that earlier versions did not write may be absent.
"""

from __future__ import annotations

from typing import Any, Literal

from dogshape.pipeline.store.result_schema import SHARE, key
from dogshape.sim.clutch_tables import Section, validate


class IntervalRow(Section):
    """Mean and central 90 % interval of a parameter, in the unit that its name ends in."""

    mean: float = key("posterior mean")
    low: float = key("lower end of the interval")
    high: float = key("upper end of the interval")


class HypothesisRow(Section):
    """A hypothesis: a set of effects, none, or ``unknown``, which has no evidence of its own."""

    effects: list[str] = key("effects by name; empty for none")
    title: str = key("the hypothesis as reports say it")
    probability: float = key("posterior probability", SHARE)
    parameters: dict[str, IntervalRow] = key("parameters of the effects, by name")
    evidence_probability: float = key("probability by evidence, before any check", SHARE)
    log_evidence: float | None = key("logarithm of the evidence", "1", None)
    log_evidence_error: float | None = key(
        "its standard error; null where the hypothesis was left early", "1", None
    )
    predictive_p: float | None = key(
        "posterior predictive p-value; absent where the hypothesis is not plausible", SHARE, None
    )


class GapRow(Section):
    """Root-mean-square gaps of the mean shift time over all operating points."""

    hypothesis: list[str] = key("leading hypothesis")
    baseline_rmse_s: float | None = key("gap of the simulation without any effect", "s")
    heldout_rmse_s: float | None = key("gap at operating points left out of the fit", "s")
    floor_rmse_s: float | None = key("gap that scatter and numerics alone would make", "s")
    leading_floor_rmse_s: float | None = key("the same under the leading hypothesis", "s")
    shrink: float | None = key("share of the gap above the floor that is gone", "1")
    rival: list[str] | None = key("best other hypothesis; null without one")
    rival_heldout_rmse_s: float | None = key("gap that the rival leaves", "s")
    rival_shrink: float | None = key("share of the gap that is gone with the rival", "1")


class PointRow(Section):
    """Gap at an operating point, bench less simulation without any effect."""

    mismatch_rpm: float = key("speed of ring against ring before the shift", "1/min")
    force_N: float = key("final shift force", "N")
    gap_s: float | None = key("gap of the mean shift time; null without a time", "s")
    z: float | None = key("gap in standard errors", "1")


class RangeRow(Section):
    """Posterior median, and the ends of the central 90 %."""

    median: float = key("posterior median")
    low: float = key("lower end of the interval")
    high: float = key("upper end of the interval")


class DiscrepancyRow(Section):
    """Gap without scatter beside its margin, and the part that no effect of a hypothesis makes."""

    margin_share: float = key("margin as share of the mean time", "1")
    margin_least_s: float = key("least margin", "s")
    within_margin: float = key("probability that the gap is within the margin", SHARE)
    gap_rms_s: RangeRow = key("gap without scatter, root mean square", "s")
    left_rms_s: RangeRow = key("part of it that is the model's discrepancy", "s")
    amplitude: RangeRow = key("amplitude of the discrepancy over the mean time", "1")


class DriftRow(Section):
    """Trend of the shift times over the series in which they were measured."""

    share: RangeRow = key("drift over the whole series, of the mean time", "1")
    slope_s: RangeRow = key("the same of the mean of all shifts", "s")
    direction: float = key("probability that it has the sign of its median", SHARE)
    significant: bool = key("whether that is enough for it to be said")
    rank_correlation: dict[str, float] = key(
        "of the order of the shifts with mismatch and force, where these vary", "1"
    )
    in_order_of: list[str] = key(
        "what the operating points were run in the order of, so that a drift cannot be told from "
        "an effect over it"
    )
    sentence: str = key("the drift in words")


class CellInfluenceRow(Section):
    """Influence of an operating point on the answer, given all others."""

    mismatch_rpm: float = key("speed of ring against ring before the shift", "1/min")
    force_N: float = key("final shift force", "N")
    log_bayes_factor: float = key(
        "what it adds to the log Bayes factor of the leading hypothesis over the rival; left out, "
        "that is less by so much",
        "nat",
    )
    log_bayes_factor_error: float = key("standard error of that sum", "nat")
    elpd: float = key("log predictive density of its data by the leading hypothesis", "nat")
    rival_elpd: float = key("the same by the rival", "nat")
    probability_without: float = key("probability of the leading hypothesis without it", SHARE)
    most_probable_without: list[str] = key("most probable hypothesis without it")
    verdict_without: Literal["effect", "none", "unknown", "ambiguous"] = key("verdict without it")
    causes_without: list[str] = key("causes by that verdict")
    effective_draws: float = key("effective draws of the leading hypothesis without it")
    k_hat: float | None = key(
        "shape of the tail of their weights, uneven above 0.7; null for a quadrature", "1"
    )
    refitted: bool = key("whether the evidence was computed anew without it")


class InfluenceRow(Section):
    """Influence of the operating points, each left out in turn."""

    sentence: str = key("finding in words")
    leading: list[str] = key("leading hypothesis")
    rival: list[str] = key("its best rival")
    elpd: float = key("sum over the points by the leading hypothesis", "nat")
    rival_elpd: float = key("the same by the rival", "nat")
    elpd_difference: float = key("leading less rival", "nat")
    elpd_difference_error: float | None = key("its standard error; null for one point", "nat")
    verdict_holds: bool = key("whether the verdict is the same without any one point")
    cells: list[CellInfluenceRow] = key("operating points that have data, in their order")


class NominalErrorsRow(Section):
    """Errors of nominal force and mismatch in the mean times, root mean square over the points."""

    systematic_rms_s: float = key("by errors that all operating points share", "s")
    each_point_rms_s: float = key("by errors of each setting", "s")
    u_input_rms_s: float = key("both together, u_input of ASME V&V 20", "s")
    sentence: str = key("the errors in words, with what the data set cannot propagate")


class PredictedMeansCellRow(Section):
    """Mean time that a hypothesis predicts of an operating point from all others."""

    mismatch_rpm: float = key("speed of ring against ring before the shift", "1/min")
    force_N: float = key("final shift force", "N")
    quantiles_s: list[float] = key("5, 25, 50, 75 and 95 % of the mean of as many shifts", "s")
    below: float = key("share of the distribution below the measured mean", SHARE)


class PredictedMeansRow(Section):
    """Means that a hypothesis predicts, discrepancy included."""

    effects: list[str] = key("effects by name; empty for none")
    within_90: int = key("measured means that lie within 5 to 95 %")
    of: int = key("measured means that are compared")
    cells: list[PredictedMeansCellRow] = key("operating points that have a time")


class PredictedRow(Section):
    """Outcome of a test that a hypothesis predicts."""

    effects: list[str] = key("effects by name; empty for none")
    mean: list[float] = key("predicted outcome: shares of the priors, or s for shifts and traces")
    sd: list[float] = key("standard deviation, in the same unit")
    share: float | None = key(
        "share of the hypothesis that predicts this; absent where it is all of it", SHARE, None
    )
    covariance: list[list[float]] | None = key("covariance of the marks of traces", "s^2", None)
    imitator_odds: float | None = key(
        "odds of something outside the list that looks like the hypothesis in shifts, but predicts "
        "what `unknown` does; absent where it predicts the same as the hypothesis",
        "1",
        None,
    )


class NextTestRow(Section):
    """The advised test; a direct test has parameters, any other one an operating point."""

    name: str = key("name of the test")
    kind: Literal["direct", "shifts", "traces"] = key("`direct`, `shifts` or `traces`")
    parameters: list[str] | None = key("parameters that a direct test measures", "", None)
    mismatch_rpm: float | None = key("mismatch of shifts or traces", "1/min", None)
    force_N: float | None = key("shift force of shifts or traces", "N", None)
    shifts: int | None = key("number of shifts", "", None)
    misleads: float | None = key(
        "chance that something wrong is named afterwards; absent in earlier versions, and where "
        "nothing is predicted",
        SHARE,
        None,
    )
    foretold: list[PredictedRow] | None = key(
        "outcome that each plausible hypothesis predicts, in rows of normal densities; absent "
        "where none can",
        "",
        None,
    )
    why: str = key("reason of the choice, in words")


class MenuRow(Section):
    """A test of the menu, best first."""

    name: str = key("name of the test")
    information_nats: float | None = key("expected information about the cause", "nat")
    chance_to_settle: float | None = key("chance that the decision is settled afterwards", SHARE)
    misleads: float | None = key(
        "chance that something wrong is named afterwards; absent in earlier versions", SHARE, None
    )
    hours: float = key("work", "h")


class SenseHypothesisRow(Section):
    """A hypothesis given a sense of rotation."""

    effects: list[str] = key("effects by name, without the sense")
    probability: float = key("probability given the sense", SHARE)
    parameters: dict[str, IntervalRow] = key("parameters of the effects, by name")


class SenseRow(Section):
    """Answer given one sense of rotation."""

    reversed: bool = key("whether the sense is the other one than that of the table")
    probability: float = key("probability of the sense", SHARE)
    inclusion: dict[str, float] = key("probability of each effect to be part of the cause", SHARE)
    hypotheses: list[SenseHypothesisRow] = key("most probable hypotheses")


class BoundRow(Section):
    """Range of an effect's first parameter that the data leave, with 95 %."""

    parameter: str = key("name of the parameter")
    low: float = key("lower end, in the unit of the parameter")
    high: float = key("upper end")
    informed: bool = key("whether the data see the effect; else the range is the prior's")


class FactRow(Section):
    """A fact about an effect from readings of the stand at rest."""

    effect: str = key("effect by name")
    parameter: str = key("parameter that was read")
    value: float = key("reading, in the unit of the parameter")
    low: float = key("lower end of its range")
    high: float = key("upper end of its range")
    sentence: str = key("the fact in words, with its agreement with the shifts")


class ReadingRow(Section):
    """Probability of a hypothesis under another prior or another count."""

    effects: list[str] = key("effects by name; empty for none")
    probability: float = key("posterior probability", SHARE)


class TogetherRow(Section):
    """Effects that were simulated together, because they may be the cause together."""

    effects: list[str] = key("names")
    levels: int = key("numbers of values at which they were")


class RangeEndRow(Section):
    """A size at the end of the range held possible before, and what was done about it."""

    effect: str = key("effect by name")
    parameter: str = key("its parameter")
    end: float = key("end of the range, in the unit of the parameter")
    upper: bool = key("true for the upper end")
    probability: float = key("probability that the size lies there", SHARE)
    remedy: Literal["widened", "bound", "left"] = key(
        "`widened`: the data were diagnosed again; `bound`: nothing physical lies beyond; `left`: "
        "widened as often as allowed"
    )
    moved: float = key("that end afterwards")
    alone: bool | None = key(
        "whether it lies there where the effect acts alone, while others lead", default=None
    )


class InferenceRecord(Section):
    """The whole record, ``gap.json``."""

    bench: str = key("name of the data set")
    engine: str | None = key(
        "engine of the simulations, `drake` or `planar`; absent in earlier versions", "", None
    )
    verdict: Literal["effect", "none", "unknown", "ambiguous"] = key("decision")
    causes: list[str] = key("effects that are part of the cause by the verdict")
    noise: float = key("Monte Carlo standard error of the leading probability", SHARE)
    headline: str = key("verdict in a line")
    summary: str = key("finding in a paragraph")
    hypotheses: list[HypothesisRow] = key("all hypotheses, most probable first")
    confusable: list[list[str]] = key("classes of several hypotheses, and effects with aliases")
    classes: list[list[list[str]]] | None = key(
        "the same classes, each hypothesis as its effects; absent in earlier versions", "", None
    )
    gap: GapRow = key("gaps before and after")
    margin_s: float | None = key(
        "gap below which nothing needs doing, root mean square; absent in earlier versions",
        "s",
        None,
    )
    discrepancy: DiscrepancyRow | None = key(
        "gap without scatter beside the margin; absent in earlier versions", "", None
    )
    drift: DriftRow | None = key(
        "trend over the series; absent where the order of the shifts is not known", "", None
    )
    nominal_errors: NominalErrorsRow | None = key(
        "errors of nominal values; absent where the data set states none", "", None
    )
    where: list[PointRow] = key("gap at each operating point")
    influence: InfluenceRow | None = key(
        "influence of each operating point; null for a single one, absent in earlier versions",
        "",
        None,
    )
    foretold: list[PredictedMeansRow] | None = key(
        "means that the leading hypothesis, its best rival and none predict of each operating "
        "point; absent in earlier versions",
        "",
        None,
    )
    next_test: NextTestRow = key("advised test")
    tests: list[MenuRow] = key("best tests of the menu")
    inclusion: dict[str, float] = key("probability of each effect to be part of the cause", SHARE)
    senses: list[SenseRow] = key("answers given either sense of rotation, if it is unknown")
    credible_set: list[list[str]] = key("hypotheses that have 0.9 together")
    class_probability: float = key("probability of the class of the leading hypothesis", SHARE)
    no_information: list[str] = key("effects of which the data tell nothing")
    hidden_share: dict[str, float] = key("share of each prior that looks like no effect", SHARE)
    bounds: dict[str, BoundRow] = key("bound of each effect on its own")
    facts: list[FactRow] = key("facts from readings at rest")
    sensitivity: dict[str, list[ReadingRow]] = key("answers under other priors and counts")
    together: list[TogetherRow] | None = key(
        "effects that were simulated together for this diagnosis; absent in earlier versions",
        "",
        None,
    )
    range_ends: list[RangeEndRow] | None = key(
        "sizes of the leading hypothesis at the end of their range; absent in earlier versions",
        "",
        None,
    )
    settings: dict[str, dict[str, Any]] | None = key(
        "constants that the answer was decided with, by section (`docs/diagnosis_model.md`); "
        "absent in earlier versions",
        "",
        None,
    )


class FindingRow(Section):
    """A probable slip of units or axes in the data set."""

    quantity: str = key("quantity of the slip")
    found: str = key("observation")
    looks_like: str = key("probable explanation")
    correction: str | None = key("correction that would mend it; null without one")
    sentence: str = key("finding and remedy in words")


class CandidateRow(Section):
    """A design with its expected shift time without and with the cause."""

    name: str = key("`prototype`, or the design by its trial")
    chamfer_deg: float | None = key("chamfer angle, where it is searched", "deg", None)
    traction_deg: float | None = key("traction flank, where it is searched", "deg", None)
    braking_deg: float | None = key("braking flank, where it is searched", "deg", None)
    height_mm: float | None = key("height of the dogs, where it is searched", "mm", None)
    count: int | None = key("number of dogs of a ring, where it is searched", "", None)
    without_s: float = key("expected shift time without the cause", "s")
    without_standard_error_s: float | None = key("its standard error", "s")
    with_s: float = key("expected shift time with the cause", "s")
    with_standard_error_s: float | None = key("its standard error", "s")
    without_landing_margin: float = key("least margin of its landings in these few shifts, without")
    with_landing_margin: float = key("least margin of its landings in these few shifts, with it")
    with_landing_check: str = key("check of landings that has that margin")


class ConsequenceRow(Section):
    """Cost of ignoring the cause in the choice of a design."""

    study: str = key("name of the study")
    effects: list[str] = key("effects of the cause")
    values: list[float] = key("values of their parameters, effect by effect")
    candidates: list[CandidateRow] = key("prototype, the study's choice, and other best designs")
    best_without: str = key("choice without the cause")
    best_with: str = key("best design with the cause")
    regret_s: float = key("time that ignoring the cause costs", "s")
    regret_standard_error_s: float | None = key("its standard error", "s")
    sentence: str = key("consequence in words")


class DiagnosisRecord(InferenceRecord):
    """The record that ``dogshape gap --json`` prints: ``gap.json`` with more."""

    corrections: list[str] = key("corrections that were asked for and made")
    warnings: list[FindingRow] = key("probable slips that are left")
    so_what: ConsequenceRow | None = key("cost of ignoring the cause; null where none was asked")
    report: str | None = key("path of the report; null where none was written")


def require_gap(data: dict[str, Any], source: str) -> None:
    """Check a record against the schema of ``gap.json``, or of ``--json`` if it has ``report``.

    Raises InputError that names ``source``, and each key that is unknown, missing or mistyped.
    """
    validate(DiagnosisRecord if "report" in data else InferenceRecord, data, source)
