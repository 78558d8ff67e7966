"""Constants that decide an answer of the diagnosis, each with unit, meaning, status and source.

A diagnosis takes its settings as one value and keeps them with its result. Constants of their
modules are numbers of angles, draws and nodes with the errors that follow from them, guards of a
division, limits of cost and of wording, and the hours of tests, which a data set may state.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from dogshape.diagnosis.terms import Hypothesis, strip_sense

Status = Literal["measured", "judged"]


def constant(default: Any, unit: str, meaning: str, status: Status, source: str) -> Any:
    """Declare a field of the settings with its documentation."""
    metadata = {"unit": unit, "meaning": meaning, "status": status, "source": source}
    if isinstance(default, dict):
        return field(default_factory=lambda: dict(default), metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Settings:
    """All settings of a diagnosis."""

    # fmt: off
    # errors of the simulation
    model_error: float = constant(
        0.01, "of the mean", "error of any simulated mean by itself", "judged",
        "mesh, contact and rigid bodies; small beside the discrepancy")
    least_error: float = constant(
        5e-4, "s", "the same, at least", "judged", "resolution of a shift time")
    discrepancy: float = constant(
        0.05, "of the predicted mean",
        "scale of the half-normal prior of the discrepancy's amplitude", "measured",
        "`docs/evidence/blind_engines.txt`: MuJoCo against Drake without any effect")
    discrepancy_shape: tuple[float, float, float] = constant(
        (0.4, 0.4, 0.2), "of the variance",
        "constant, curve over the mismatch, slope over the force", "measured",
        "`docs/evidence/blind_engines.txt`: one-sided, smooth over the mismatch")
    discrepancy_length: float = constant(
        1.0, "of ln mismatch", "length over which the discrepancy is alike", "measured",
        "`docs/evidence/blind_engines.txt`")
    law: float = constant(
        0.03, "of the change of ln time", "error of an effect's law at one operating point",
        "judged", "an effect is one law of several that a stand may have")
    laws: Mapping[str, float] = constant(
        {"actuation_lag": 0.033, "axial_gap": 0.017, "chamfer_angle": 0.001,
         "contact_friction": 0.031, "detent_force": 0.031, "drag_torque": 0.017,
         "force_loss": 0.001, "force_rise": 0.032, "force_scale": 0.026, "free_play": 0.001,
         "linkage_compliance": 0.039, "mismatch_speed": 0.04, "moving_mass": 0.017,
         "sleeve_friction": 0.018, "sliding_inertia": 0.113, "spline_friction": 0.061,
         "viscous_damping": 0.019},
        "of ln time", "further error of an effect's law, at most the change itself",
        "measured", "`docs/evidence/law_errors.txt`: MuJoCo against the compiled engine")
    range_extension: float = constant(
        0.5, "of the range", "by which the range of a prior is widened at either end", "judged",
        "a size beyond its usual range is found where such a bench exists")
    pair_error: float = constant(
        0.6, "of the time from the closed gap, and of the product of both changes of its ln",
        "error of the rule for two effects, at each point and in common", "measured",
        "`docs/evidence/pair_rule.txt`: likeliest over simulations with two effects")
    pair_spread_error: float = constant(
        0.4, "of the root of that product", "error of ln of the spread with two effects",
        "measured", "`docs/evidence/pair_rule.txt`")
    spread_share: float = constant(
        0.2, "of the spread", "error of a simulated spread of single shifts", "judged",
        "opened cases of a foreign engine")
    spread_error: float = constant(
        0.025, "of the mean", "further error of that spread", "judged",
        "opened cases of a foreign engine")
    odd_spread: float = constant(
        0.1, "probability", "that a spread is off by a factor of e, whatever the cause", "judged",
        "without it p-values of right answers are below 0.01 in 10 % of self-consistent sets")
    late_known: float = constant(
        24.0, "shifts", "number of shifts that a simulated share of late or engaged ones counts as",
        "judged", "opened cases of a foreign engine")
    late_least: float = constant(0.003, "probability", "least share of late shifts", "judged", "")
    late_most: float = constant(0.9, "probability", "largest share of late shifts", "judged", "")
    late_slots: float = constant(
        5.0, "slots", "that a late shift passes where too few simulated ones are late", "judged",
        "")
    late_pooled: float = constant(
        10.0, "shifts", "that the share of late ones at all levels counts as at each level",
        "judged", "")
    engaged_range: tuple[float, float] = constant(
        (0.01, 0.99), "probability", "range of a share that engages", "judged",
        "no simulation excludes an outcome")
    engaged_error: float = constant(
        0.02, "probability", "error of a simulated share that engages", "judged",
        "one shift of 48 angles")
    drift: float = constant(
        0.1, "of the mean time", "prior standard deviation of a drift over the whole series",
        "judged", "")
    odd_share: float = constant(
        0.005, "probability", "share of operating points whose mean is off, whatever the cause",
        "judged", "in a checked table an entry in some hundred is wrong")
    odd_size: float = constant(
        0.5, "of the mean", "standard deviation of what such a mean is off by", "judged", "")
    nuisance: Mapping[str, float] = constant(
        {"contact_creep": 1.15, "contact_dissipation": 3.0, "contact_stiffness": 3.0},
        "factor", "within which stiction velocity, dissipation and stiffness of the contact are "
        "known (one standard deviation of the logarithm); no data set of shifts may name them",
        "judged", "the stiction velocity is stated with the contact, which leaves a quarter; oil "
        "film damps up to 10 times more, edge contact is up to 30 times softer than a flank")
    odd_contact: float = constant(
        2.0, "standard deviations of ln factor", "beyond which stiffness, dissipation or stiction "
        "velocity of the contact is said to be odd, if that is as sure as a part of the cause",
        "judged", "usual level")
    static_error: float = constant(
        0.05, "of the value", "least error of static readings of the actuator", "judged", "")
    # errors of the marks of traces
    flight_freedom: float = constant(
        5.0, "degrees of freedom", "of the Student distribution of a profile's marks", "judged",
        "one odd profile decides nothing alone")
    flight_law: float = constant(
        0.02, "of the change of a mark", "error of an effect's law in free flight", "judged", "")
    flight_creep: float = constant(
        1.8, "of the creep of the smooth law", "error of the start of a held ring, by the speed at "
        "the mark", "judged", "")
    flight_triple: float = constant(
        0.5, "of the largest change by two effects beyond their sum",
        "error of a mark with three effects", "judged", "")
    flight_touch: float = constant(
        0.02, "s", "error of a mark behind the first touch", "judged", "")
    offset_sizes: tuple[float, ...] = constant(
        tuple(np.geomspace(1e-3, 0.2, 10).tolist()), "s",
        "offsets of marks by an unknown cause, as probable as each other", "judged",
        "from the step of a recording to a long shift")
    offset_length: float = constant(
        1.5, "of ln force and ln share", "length over which offsets are alike", "judged", "")
    offset_smooth: float = constant(
        0.9, "of the variance", "share of it that neighbouring offsets have in common", "judged",
        "")
    face_radius: float = constant(
        0.25, "of the way from inner to mean radius", "where faces meet", "judged",
        "turned against each other, rigid ones meet at the inner radius, those of the compiled "
        "engine up to half way")
    face_law: float = constant(
        0.06, "of friction and chamfer", "error of slope and acceleration on faces in common",
        "judged", "")
    face_single: float = constant(
        0.05, "of friction and chamfer", "error of each face by itself", "judged", "")
    face_end: float = constant(
        5e-5, "m", "error of the displacement where faces part", "judged", "")
    balance_law: float = constant(
        0.02, "of the sliding side's gain", "error of the balance of both rings in common",
        "judged", "")
    balance_held: float = constant(
        0.5, "of the drag's part in a balance", "error of each balance", "judged",
        "a held ring shows no sense")
    speed_error: float = constant(
        0.01, "of a mismatch", "least error of a nominal value beside a stated one", "judged", "")
    contact_factors: tuple[float, ...] = constant(
        (3.0, 10.0, 30.0, 100.0), "", "of all errors of the contact's marks where something "
        "unknown acts, as probable as each other", "judged", "")
    # priors
    included: Mapping[str, float] = constant(
        {"actuation_delay": 0.3, "sleeve_friction": 0.3, "linkage_compliance": 0.1},
        "probability", "that an effect is part of the cause", "judged",
        "every actuator has a dead time, every ring rubs on its shaft, cables and levers give way")
    rare: float = constant(
        0.03, "probability", "the same of any other effect", "judged",
        "of fifteen such effects one acts on every other stand")
    most: int = constant(3, "effects", "that act at once", "judged", "of four some always fit")
    unlisted: float = constant(
        0.15, "probability", "of *unknown*", "judged", "no list of effects is complete")
    unlisted_sizes: tuple[float, ...] = constant(
        (0.1, 0.2, 0.4, 0.8), "of the predicted mean",
        "amplitudes of what no effect explains, as probable as each other", "judged",
        "above the discrepancy of honest engines")
    unlisted_smooth: float = constant(
        0.7, "of the variance", "share of it that neighbouring points have in common", "judged", "")
    unlisted_lengths: tuple[float, ...] = constant(
        (1.0,), "of ln force and ln mismatch", "lengths over which that is alike", "judged",
        "from a neighbour to the whole table")
    unlisted_stretches: tuple[float, ...] = constant(
        (1.0, 2.0), "", "factors of all spreads where something unlisted acts, as probable as each "
        "other", "judged", "")
    reversed_known: float = constant(
        0.02, "probability", "of the reversed sense of rotation where it was noted", "judged",
        "one entry in some hundred is wrong")
    reversed_unknown: float = constant(
        0.5, "probability", "the same where nobody noted it", "judged", "")
    zero_at_force: float = constant(
        0.5, "probability", "that times start with the force where nobody noted it", "judged", "")
    left_out: float = constant(
        0.05, "probability", "of just these rows without a time, where their shifts were not made",
        "judged", "operators leave out a corner or an edge of a plan, which has some twenty")
    floor: float = constant(
        0.01, "probability", "that the data say nothing, since they are unlike the model of errors",
        "judged", "one data set in a hundred; no answer is surer")
    imitated: float = constant(
        0.5, "probability", "that something unlisted acts on shift times as an effect does",
        "judged", "of what is not on the list, half looks like something on it")
    hour: float = constant(
        0.04, "probability", "gain of a bench test that an hour of work has to earn", "judged", "")
    # computation
    seed: int = constant(
        1, "", "seed of all random draws of an inference", "judged",
        "another seed repeats the inference independently")
    emulated_nats: float = constant(
        2.0, "nats", "error of a log evidence by emulated times, before any further bench",
        "measured", "changes by the first benches on the published stand and opened cases")
    emulated_decay: float = constant(
        1.5, "", "power of 1 + rounds of benches by which that error falls", "measured",
        "changes by the second to tenth round on the same data")
    emulated_floor: float = constant(
        0.3, "nats", "error of a log evidence by emulated times that no bench removes", "measured",
        "standard deviation over five seeds on the published stand: 0.14 to 0.36 for eight of ten "
        "hypotheses above 0.1 %, 0.5 with a lag, 0.8 with a linkage")
    rule_nats: float = constant(
        25.0, "nats", "that the rule for two effects may cost a hypothesis at its true sizes",
        "measured", "10 to 25 at the truth of three of six opened pairs of a foreign engine")
    prospect_reach: float = constant(
        2.0, "standard errors", "by which emulated means may be wrong in favour of a hypothesis",
        "judged", "stated errors of two effects together are too small by up to 2")
    prospect_share: float = constant(
        0.5, "of the gain by such means", "that counts as an error of the log evidence", "judged",
        "hardly any gain is found wholly")
    converged: float = constant(
        0.004, "probability", "that the error of an evidence may move, without further benches",
        "judged", "between 0.01, with which one seed of five misses a mismatch of 5 % on the "
        "published stand, and 0.002, which doubles the benches of a foreign clutch")
    decided: float = constant(
        2.0, "standard errors", "of all log evidences, within which the leading hypothesis has to "
        "be named before no further bench is simulated", "judged", "usual level")
    simulations_each: int = constant(
        10, "rounds of four benches", "for one hypothesis at most", "judged",
        "24 move no probability of the published stand by more than its stated error")
    # limits of the answer
    named: float = constant(
        0.8, "probability", "from which a hypothesis, *none* or *unknown* is said", "judged",
        "wrong once in five at most, if probabilities hold")
    excluded: float = constant(
        0.5, "share of the prior odds of effects",
        "that data must exclude before *none* is said by its probability", "judged",
        "data that show nothing exclude nothing and leave all to effects too weak to be seen")
    named_at_once: int = constant(
        2, "effects", "of a hypothesis that names the cause or its parts", "judged",
        "of three some always fit")
    part: float = constant(
        0.95, "probability", "from which an effect is part of the cause, whatever else is",
        "judged", "usual level")
    credible: float = constant(
        0.9, "probability", "of the set that is given where nothing is named", "judged",
        "usual level")
    adequate: float = constant(
        0.01, "p-value", "below which a hypothesis is not named", "judged", "usual level")
    visible: float = constant(
        4.0, "squared standard errors", "below which two predictions are indistinguishable",
        "judged", "two standard errors in all")
    presence_error: float = constant(
        0.2, "of 1", "error of a look whether an effect acts", "judged", "wrong once in 160")
    end_distance: float = constant(
        0.2, "of the range", "mean distance of sizes from an end of their range, below which they "
        "lie there", "judged", "")
    end_distance_sds: float = constant(
        1.5, "standard deviations of the sizes", "the same", "judged",
        "1 for an exponential density, 1.3 for half a normal one, 1.7 where data say nothing")
    engaged_margin: float = constant(
        0.05, "share engaged", "margin of a share engaged", "judged", "one shift in twenty")
    # fmt: on

    def is_nameable(self, hypothesis: Hypothesis) -> bool:
        """Check that a hypothesis may name the cause or a part of it, however probable it is."""
        return len(strip_sense(hypothesis)) <= self.named_at_once

    def names(self, hypothesis: Hypothesis, probability: float) -> bool:
        """Check that a hypothesis of a probability is named."""
        return probability > self.named and self.is_nameable(hypothesis)

    def prior(self, name: str) -> float:
        """Look up the probability that an effect is part of the cause."""
        return self.included.get(name, self.rare)


USUAL = Settings()
