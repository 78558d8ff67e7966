"""Headline of a study: its chosen design against the prototype, with objections."""

from __future__ import annotations

from dogshape.pipeline.reports.designs import (
    OWN_DOG,
    Goal,
    confirmed_verdict,
    design_name,
    engaged_shifts,
    goals_of,
    nearest_records,
    objection,
)
from dogshape.pipeline.reports.text import check_name
from dogshape.pipeline.search.study_record import Confirmation, ConfirmedDesign, StudyRecord
from dogshape.pipeline.simulate.design import SIMULATED, WITHIN, WITHIN_WORDS, failing_words

Pair = tuple[float, float]  #: a value and its standard error


def sides_of(confirmation: Confirmation) -> dict[str, ConfirmedDesign]:
    """Return own dog and chosen design of a confirmation by their names."""
    return {OWN_DOG: confirmation.prototype, "chosen": confirmation.best}


def headline(result: StudyRecord) -> str:
    """Compose the headline of a study: the leading objective of its best design, or objections."""
    best = result.best
    confirmation = result.confirmation
    if best is None:
        failing = failing_checks(result)
        reason = f": {failing}" if failing else ""
        sentence = f"No design of this search passes every check{reason}."
        return sentence + _nearest_sentences(result)
    lead = goals_of(result)[0]
    if confirmation is None:
        words = "no time"
        if best.expected_shift_time_s is not None:
            words = lead.words(lead.printed_value(best), lead.error(best))
        return f"Best so far, not confirmed: {design_name(best)}, {lead.label} {words}."
    if best.prototype:
        return _prototype_headline(lead, confirmation.best)
    name = design_name(best).capitalize()
    words = " engages in {} of {} shifts".format(*engaged_shifts(confirmation.best))
    comparisons = compare_objectives(result)
    if comparisons and comparisons[0][0] == lead:
        words = _gain_words(confirmation.prototype, *comparisons[0])
    return f"{name}{words}.{_verdict_sentence(name, confirmation.best)}"


def _gain_words(
    prototype: ConfirmedDesign, goal: Goal, before: Pair, after: Pair, gain: Pair
) -> str:
    """Compose the words on an objective of the chosen design, and of the prototype before."""
    words = f": {goal.label} {goal.words(*after)}"
    prototype_words = goal.words(*before)
    state = confirmed_verdict(prototype).state
    if state == "fails":
        return f"{words}; your own dog has {prototype_words}, but {objection(prototype)}"
    if state == "not_clear":
        return f"{words}; your own dog has {prototype_words} and is {objection(prototype)}"
    link = ", not clearly better than" if is_unclear(*gain) else " instead of"
    return f"{words}{link} {prototype_words} of your own dog"


def _nearest_sentences(result: StudyRecord) -> str:
    """Compose a sentence on each nearest design that fails nothing; each starts with a blank."""
    words = ""
    designs = {design.trial: design for design in result.trials}
    for trial, confirmed in nearest_records(result).items():
        state = confirmed_verdict(confirmed).state
        name = "Your own dog" if designs[trial].prototype else f"Design {trial}"
        if state == "not_clear":
            words += _verdict_sentence(name, confirmed)
        elif state != "fails":
            words += f" {name} fails no check at the new angles; raise expectation.angles."
    return words


def _prototype_headline(lead: Goal, confirmed: ConfirmedDesign) -> str:
    """Compose the headline of a study whose best design is the prototype."""
    verdict = confirmed_verdict(confirmed)
    if verdict.state == "fails":
        words = "No design of this search is chosen before your own dog."
    else:
        superlative = "fastest" if lead.unit == "ms" else "best"
        clause = " that passes" if verdict.passes else ""
        time = lead.words(*lead.estimate(confirmed.estimates))
        words = f"Your own dog is the {superlative}{clause}: {lead.label} {time}."
    return words + _verdict_sentence("Your own dog", confirmed)


def _verdict_sentence(subject: str, confirmed: ConfirmedDesign) -> str:
    """Compose the objection to a confirmed design as a sentence that starts with a blank."""
    words = objection(confirmed)
    if not words:
        return ""
    state = confirmed_verdict(confirmed).state
    if state == "not_judged":
        return f" {words.capitalize()}."
    return f" {subject} {words}." if state == "fails" else f" {subject} is {words}."


def is_unclear(gain: float, error: float) -> bool:
    """Check whether a difference is less than two of its standard errors."""
    return abs(gain) < 2.0 * error


def compare_objectives(result: StudyRecord) -> list[tuple[Goal, Pair, Pair, Pair]]:
    """Compare the simulated objectives of prototype and chosen design.

    Returns objective, value of the prototype, value of the chosen design and gain, each with its
    standard error in the printed unit. The gain is positive if the chosen design is better. Empty
    before the confirmation; without times if a design does not engage.
    """
    confirmation = result.confirmation
    best = result.best
    if confirmation is None or best is None or best.prototype:
        return []
    gains = confirmation.gains
    before = confirmation.prototype.estimates
    after = confirmation.best.estimates
    sides = sides_of(confirmation).values()
    timed = all(confirmed.expected_shift_time_s is not None for confirmed in sides)
    return [
        (goal, goal.estimate(before), goal.estimate(after), goal.estimate(gains))
        for goal in goals_of(result, SIMULATED)
        if goal.name in gains and (timed or goal.unit != "ms")
    ]


def failing_checks(result: StudyRecord) -> str:
    """Compose the checks that most designs fail, with the margin of the nearest design.

    A limit of the smallest margin within tolerances has the name of its weakest check, if stored.
    """
    designs = []
    for row in result.trials:
        names = {}
        for name, kind in WITHIN.items():
            weakest = row.weakest_within(kind) or name
            names[name] = f"{check_name(weakest)} {WITHIN_WORDS[name]}"
        margins = row.margins.items()
        designs.append({names.get(name, check_name(name)): margin for name, margin in margins})
    return failing_words(designs)
