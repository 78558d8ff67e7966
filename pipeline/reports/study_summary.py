"""The result of a study in a sentence, tables and facts, for console and page."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.record import Bad, Table, percent
from dogshape.pipeline.reports.data_sheet import (
    ENGAGED,
    HANGS,
    STATISTICAL_MARGIN,
    TIME,
    WORST_MARGIN,
    hang_share,
    words_of,
)
from dogshape.pipeline.reports.design_record import (
    DesignSheet,
    largest_loss,
    point_differences,
    searched_sheet,
    searched_verdict,
    time_difference,
)
from dogshape.pipeline.reports.designs import (
    MARGIN,
    OWN_DOG,
    UNCLEAR,
    Goal,
    confirmation_of,
    confirmed_designs,
    design_head,
    design_name,
    engaged_shifts,
    goals_of,
    margins_of,
    nearest_records,
    objection,
    out_at_new_angles,
)
from dogshape.pipeline.reports.headline import (
    Pair,
    compare_objectives,
    failing_checks,
    is_unclear,
    sides_of,
)
from dogshape.pipeline.reports.text import (
    axis,
    check_name,
    engaged_text,
    hang_words,
    in_ms,
    label,
    margin_cell,
    minus,
    ms_with_error,
    place_name,
    quantile_words,
    value,
)
from dogshape.pipeline.search.study_record import (
    Confirmation,
    ConfirmedDesign,
    DesignRow,
    OtherShape,
    RemainingGain,
    StudyRecord,
)
from dogshape.pipeline.simulate.design import SIMULATED, SUMMARIES
from dogshape.pipeline.store.check_records import CheckRow, VerdictRow

MAX_DESIGNS = 10  #: columns of designs in a table of margins
RANGE_END = 0.01  #: share of a search range within which a value lies at its end
LANDING = "_impact"  #: end of the names of the checks of a landing
VERDICT = "verdict"
VERDICT_COLUMNS = (3, 4)  #: columns of text in the table of alternatives
UNCLEAR_NOTE = " (within two standard errors)"


def summary_tables(study: Setup, result: StudyRecord) -> list[Table]:
    """Tabulate the alternative designs, and the facts on the chosen design.

    If no design passes: the nearest designs, the checks that they fail, and facts.
    """
    if result.best is not None:
        tables = alternatives_tables(study, result, result.best)
        facts = list(facts_of(study, result)) if result.confirmation else []
    elif result.trials:
        tables = [nearest_table(study, result), barriers_table(result)]
        facts = list(nearest_facts(study, result))
    else:
        return []
    if facts:
        tables.append(Table(("", ""), facts))
    return tables


def alternatives_tables(study: Setup, result: StudyRecord, best: DesignRow) -> list[Table]:
    """Tabulate the chosen design, the own dog, and others of the front that pass every check.

    ``best`` is the chosen design. The first table has a row for each design with the five answers
    of a choice, the second a column for each with all the rest. Costs are differences to the chosen
    design, ± one standard error.
    """
    columns = {SIMULATED, MARGIN, *study.variables}
    goals = [goal for goal in goals_of(result, SIMULATED) if goal.name not in columns]
    own_dogs = [design for design in result.trials if design.prototype]
    designs = {design.trial: design for design in (best, *result.front, *own_dogs)}
    sheets = {trial: searched_sheet(study, result, design) for trial, design in designs.items()}
    chosen = sheets[best.trial]

    def rank(trial: int) -> tuple[bool, bool, float]:
        sheet = sheets[trial]
        time = sheet.simulated.expected_shift_time_s or math.inf
        return sheet is not chosen, not sheet.prototype, time

    answers = []
    columns_of_rest = {}
    for trial in sorted(sheets, key=rank):
        sheet = sheets[trial]
        if sheet is not chosen and not sheet.prototype and not _is_alternative(result, sheet):
            continue
        cost = ""
        if sheet is not chosen:
            cost = _difference_words(time_difference(chosen.simulated, sheet.simulated))
        design = designs[trial]
        words = words_of(sheet)
        head = design_head(design)
        answers.append([head, words[TIME], cost, words["state"], words[WORST_MARGIN]])
        goal_words = {goal.title: _goal_cell(goal, result, design) for goal in goals}
        columns_of_rest[head] = {
            **_param_words(study, design),
            ENGAGED: words[ENGAGED],
            HANGS: words[HANGS],
            **goal_words,
            "worst point minus own dog, ms": _loss_cell(sheet),
            "margin at statistical tolerances": words[STATISTICAL_MARGIN],
        }
    looks = {0: "best"}
    looks |= {row: "prototype" for row, answer in enumerate(answers) if answer[0] == OWN_DOG}
    heads = ("design", TIME, "minus chosen, ms", "verdict", "margin at worst-case tolerances")
    note = (
        "Designs of the front without a negative margin at the new angles, and your own dog; ± one "
        "standard error, that of the expected time with the error of hangs. Smallest margins, that "
        "of the landing at nominal size."
    )
    alternatives = Table(heads, answers, looks, VERDICT_COLUMNS, note)
    labels = next(iter(columns_of_rest.values()))
    rest = [[label, *(words[label] for words in columns_of_rest.values())] for label in labels]
    return [alternatives, Table(("", *columns_of_rest), rest)]


def _param_words(study: Setup, design: DesignRow) -> dict[str, str]:
    """Print the searched keys of a design by their label with unit."""
    params = design.params(study.variables)
    return {axis(name): minus(f"{param:.4g}") for name, param in params.items()}


def _loss_cell(sheet: DesignSheet) -> str:
    """Print the largest loss of a design on the own dog at an operating point, ms."""
    worst = sheet.simulated.worst_against_prototype
    if worst is None:
        return "-"
    return ms_with_error(worst.difference_s, worst.standard_error_s, "+")


def _is_alternative(result: StudyRecord, sheet: DesignSheet) -> bool:
    """Check whether a design of the front passes, at new angles once there is a confirmation."""
    chosen_prototype = result.best is not None and result.best.prototype
    if chosen_prototype or sheet.verdict.failed:
        return False
    return sheet.confirmed == (result.confirmation is not None)


def _goal_cell(goal: Goal, result: StudyRecord, design: DesignRow) -> str:
    """Print an objective of a design with its error, at new angles if it was simulated there."""
    if design.value(goal.name) is None:
        return "-"
    confirmed = confirmation_of(result, design)
    if confirmed is not None and goal.name in confirmed.estimates:
        return goal.pair(*goal.estimate(confirmed.estimates))
    return goal.pair(goal.printed_value(design), goal.error(design))


def _difference_words(difference: Pair | None) -> str:
    """Print a difference of times, s, in ms with sign and standard error; a dash without one."""
    return "-" if difference is None else ms_with_error(*difference, "+")


def single_margins(design: DesignRow) -> dict[str, float]:
    """Select the margins of a design by check, without limits that sum up other checks."""
    return {name: m for name, m in design.margins.items() if name not in SUMMARIES}


def _confirmed_row(result: StudyRecord, design: DesignRow) -> DesignRow:
    """Replace time and margins of a design by those at new angles, if it has any."""
    confirmed = confirmation_of(result, design)
    if confirmed is None:
        return design
    changes = {
        SIMULATED: confirmed.expected_shift_time_s,
        "margins": margins_of(design.margins, confirmed),
    }
    return design.model_copy(update=changes)


def nearest_designs(result: StudyRecord) -> list[DesignRow]:
    """List the designs with the largest margin of their worst check, the own dog last."""
    rows = [row for row in result.trials if row.margins]
    rows.sort(key=lambda row: (-min(row.margins.values()), row.trial))
    designs = [row for row in rows if not row.prototype]
    prototypes = [row for row in rows if row.prototype]
    return [*designs[:MAX_DESIGNS], *prototypes]


def nearest_table(study: Setup, result: StudyRecord) -> Table:
    """Tabulate the designs nearest to passing, with the checks that they fail."""
    rows = nearest_designs(result)
    cells = []
    for row in rows:
        confirmed = confirmation_of(result, row)
        words = _search_objection(row) if confirmed is None else objection(confirmed)
        if "engines" in row.failed:
            words = f"{words}, engines disagree" if words else "engines disagree"
        simulated = confirmed or row
        cells.append(
            [
                design_head(row),
                *_param_words(study, row).values(),
                ms_with_error(simulated.expected_shift_time_s, simulated.standard_error_s),
                ms_with_error(simulated.engaged_mean_s, simulated.engaged_standard_error_s),
                hang_share(simulated),
                Bad(words) if words else "passes",
            ]
        )
    heads = ("design", *map(axis, study.variables), TIME, ENGAGED, HANGS, VERDICT)
    looks = {k: "prototype" for k, row in enumerate(rows) if row.prototype}
    note = (
        "The designs whose worst check is short by least, at new angles where they were simulated "
        "there; ± is one standard error. A dash: not simulated, as a check fails before."
    )
    return Table(heads, cells, looks, (heads.index(VERDICT),), note)


def _search_objection(design: DesignRow) -> str:
    """Compose the checks that a design fails by the margins of its search, smallest first."""
    failed = sorted((m, name) for name, m in design.margins.items() if m < 0.0)
    words = ", ".join(f"{check_name(name)} ({percent(margin)})" for margin, name in failed)
    return f"fails {words}" if words else ""


def barriers_table(result: StudyRecord) -> Table:
    """Tabulate the failed checks with the number of designs, and the cost in shift time.

    The cost is the time of the fastest design that passes the check, less that of the fastest
    design of all; either may fail other checks.
    """
    rows = [_confirmed_row(result, row) for row in result.trials if row.margins]
    timed: list[tuple[float, DesignRow]] = []
    for row in rows:
        if row.expected_shift_time_s is not None:
            timed.append((row.expected_shift_time_s, row))
    timed.sort(key=lambda pair: pair[0])
    failures = []
    for row in rows:
        margins = single_margins(row)
        failures.append({name: margin for name, margin in margins.items() if margin < 0.0})
    counts = Counter(name for failed in failures for name in failed)
    cells = []
    for name, count in counts.most_common():
        failing = [failed for failed in failures if name in failed]
        alone = sum(len(failed) == 1 for failed in failing)
        nearest = max(failed[name] for failed in failing)
        passing = (pair for pair in timed if pair[1].margins.get(name, -1.0) >= 0.0)
        fastest = next(passing, None)
        design = "none passes"
        price = None
        if fastest is not None:
            time, row = fastest
            design = f"{in_ms(time)} ({design_name(row)})"
            price = time - timed[0][0]
        cells.append(
            [
                check_name(name),
                f"{count} of {len(rows)}",
                str(alone),
                percent(nearest),
                design,
                in_ms(price),
            ]
        )
    heads = (
        "check",
        "designs that fail it",
        "fail it alone",
        "nearest of them",
        "fastest that passes it, ms",
        "costs, ms",
    )
    note = (
        "Costs: fastest simulated design that passes the check, less the fastest of all, whatever "
        "other checks they fail. Where none passes, widen [variables] or the limit."
    )
    return Table(heads, cells, {}, (4,), note)


def nearest_verdict(study: Setup, result: StudyRecord) -> VerdictRow | None:
    """Return the verdict on the nearest design at new angles; None if it has none there."""
    rows = nearest_designs(result)
    if not rows:
        return None
    confirmed = confirmation_of(result, rows[0])
    if confirmed is None:
        return None
    params = rows[0].params(study.variables)
    return searched_verdict(study, params, rows[0].margins, confirmed)


def nearest_facts(study: Setup, result: StudyRecord) -> Iterator[tuple[str, str]]:
    """List the hangs of own dog and nearest designs, shafts and actuator, as name and words."""
    records = nearest_records(result)
    for row in nearest_designs(result):
        confirmed = records.get(row.trial)
        if confirmed is None:
            continue
        yield f"hangs, {design_name(row)}", hang_words(confirmed)
        yield from _worst_hang_facts(design_name(row), confirmed)
    yield "shafts", study.clutch.drive.text
    if study.clutch.actuator is not None:
        yield "actuator", study.clutch.actuator.text


def facts_of(study: Setup, result: StudyRecord) -> Iterator[tuple[str, str]]:
    """List the facts on a confirmed design as name and words; objections are ``Bad``."""
    confirmation = result.confirmation
    best = result.best
    assert confirmation is not None
    assert best is not None
    verdict = searched_verdict(study, study.prototype, {}, confirmation.prototype)
    yield "verdict on your own dog", _bad_unless(verdict.passes, verdict.line)
    if not best.prototype:
        verdict = chosen_verdict(study, best, confirmation)
        yield f"verdict on {design_name(best)}", _bad_unless(verdict.passes, verdict.line)
    if best.prototype:
        failing = failing_checks(result)
        if failing:
            yield "designs that fail", failing
    else:
        yield from _gain_facts(study, result, best, confirmation)
    remaining_gain = result.remaining_gain
    if remaining_gain is not None:
        yield "gain of further designs", _remaining_words(goals_of(result)[0], remaining_gain)
    yield "shafts", study.clutch.drive.text
    if study.clutch.actuator is not None:
        yield "actuator", study.clutch.actuator.text
    yield from _margin_facts(confirmation.best.checks)
    yield from _confirmation_facts(result, best, confirmation)
    yield from _engine_facts(study, result, confirmation)


def _remaining_words(goal: Goal, gain: RemainingGain) -> str:
    """Compose the words on the gain in an objective that further designs promise."""
    expected = goal.words(goal.factor * gain.expected)
    upper = goal.words(goal.factor * gain.upper)
    return f"best found; the surrogate expects {expected} more, with 95 % no more than {upper}"


def _bad_unless(good: bool, words: str) -> str:
    """Mark words as an objection unless they are good."""
    return words if good else Bad(words)


def _margin_facts(checks: Sequence[CheckRow]) -> Iterator[tuple[str, str]]:
    """List the smallest margins of landings, and at the ends of ranges."""
    landing_checks = [check for check in checks if check.name.endswith(LANDING)]
    weakest = _weakest_check(landing_checks)
    if weakest is not None:
        words = margin_cell(weakest.name, weakest.margin, weakest.margin_interval)
        yield "smallest margin of a landing, 95 % interval", words
    weakest = _weakest_check([check for check in checks if check.ends])
    if weakest is not None:
        words = f"{margin_cell(weakest.name, weakest.margin)}, at {weakest.ends}"
        yield "at the worst end of ranges", _bad_unless((weakest.margin or 0.0) >= 0.0, words)


def _weakest_check(checks: Sequence[CheckRow]) -> CheckRow | None:
    """Select the check with the smallest margin; None where none has a margin."""
    margins = [(check.margin, k) for k, check in enumerate(checks) if check.margin is not None]
    return checks[min(margins)[1]] if margins else None


def _engine_facts(
    study: Setup, result: StudyRecord, confirmation: Confirmation
) -> Iterator[tuple[str, str]]:
    """List the agreements of Drake with the compiled engine, or why there are none."""
    agreements = {
        "chosen design in Drake": confirmation.best.drake,
        "audit": result.audit,
    }
    for name, agreement in agreements.items():
        if agreement is not None:
            yield name, _bad_unless(agreement.agrees, minus(agreement.text))
        elif study.engine_gap:
            yield name, f"not made: {study.engine_gap}"


def chosen_verdict(study: Setup, best: DesignRow, confirmation: Confirmation) -> VerdictRow:
    """Return the verdict on the chosen design at the new angles."""
    params = best.params(study.variables)
    return searched_verdict(study, params, best.margins, confirmation.best)


def _confirmation_facts(
    result: StudyRecord, best: DesignRow, confirmation: Confirmation
) -> Iterator[tuple[str, str]]:
    """List the objections to other designs of the front, and the designs not confirmed."""
    objections = []
    for trial, words in out_at_new_angles(result).items():
        if trial != best.trial:
            verb = "is " if words.startswith(UNCLEAR) else ""
            objections.append(f"design {trial} {verb}{words}")
    if objections:
        yield "designs out at the new angles", "; ".join(objections)
    for trial, confirmed in confirmed_designs(result).items():
        if confirmed.agrees is False:
            words = f"{confirmed.errors_apart:.1f} standard errors apart"
            yield f"search and new angles of design {trial}", Bad(words)
    if confirmation.left_out:
        trials = ", ".join(map(str, confirmation.left_out))
        yield "designs not confirmed", f"{trials}; raise search.confirm_designs"


def _gain_facts(
    study: Setup, result: StudyRecord, best: DesignRow, confirmation: Confirmation
) -> Iterator[tuple[str, str]]:
    """List the facts that compare the chosen design with the own dog."""
    yield from _objective_facts(result)
    if time_difference(confirmation.prototype, confirmation.best):
        yield "operating points slower than the own dog", _slower_points(confirmation)
    yield from _hang_facts(confirmation)
    engaged, shifts = engaged_shifts(confirmation.best)
    words = "{} of {} shifts; own dog {} of {}".format(
        engaged, shifts, *engaged_shifts(confirmation.prototype)
    )
    yield "engaged at the first try", _bad_unless(engaged >= shifts, words)
    for name, confirmed in sides_of(confirmation).items():
        words = quantile_words(confirmed.quantiles or ())
        if words:
            yield f"shift time over the life, {name}", words
    change = best.time_within_tolerances
    if change:
        words = (
            f"{1e3 * change.root_sum_square_s:.2g} ms by root sum of squares, "
            f"{1e3 * change.worst_case_s:.2g} ms at the worst"
        )
        yield "change of the expected shift time within tolerances", words
    yield from _shape_facts(confirmation)
    ends = _range_ends(study, best)
    if ends:
        yield "at the end of the search range", Bad(f"{', '.join(ends)}; widen [variables]")


def _objective_facts(result: StudyRecord) -> Iterator[tuple[str, str]]:
    """List the gain in each objective, of its value, and whether it is clear."""
    for goal, (before, _), _, (gain, error) in compare_objectives(result):
        words = f"{goal.difference(gain, error)} {goal.unit}".strip()
        if before:
            words += minus(f" ({100 * gain / abs(before):.0f} %)")
        if is_unclear(gain, error):
            words += UNCLEAR_NOTE
        yield f"gain in the {goal.label}", _bad_unless(gain >= 0.0, words)


def _slower_points(confirmation: Confirmation) -> str:
    """Write at how many operating points the chosen design is slower, with the largest loss."""
    differences = point_differences(confirmation.prototype, confirmation.best)
    slower = [point for point in differences if point.difference_s > 0.0]
    words = f"{len(slower)} of {len(differences)}"
    if not slower:
        return words
    clear = [
        point
        for point in slower
        if point.difference_s >= 2.0 * (point.standard_error_s or math.inf)
    ]
    worst = largest_loss(differences)
    loss = ms_with_error(worst.difference_s, worst.standard_error_s)
    words += f" ({len(clear)} clearly), most by {loss} ms at {place_name(worst)}"
    return _bad_unless(not clear, words)


def _range_ends(study: Setup, design: DesignRow) -> list[str]:
    """List the variables of a design that lie at an end of their search range, with values."""
    ends = []
    for name, param in design.params(study.variables).items():
        low, high = study.variables[name]
        distance = min(param - low, high - param)
        tolerance = 0.0 if name == "count" else RANGE_END * (high - low)
        if distance <= tolerance:
            ends.append(f"{label(name)} {value(name, param)}")
    return ends


def _shape_facts(confirmation: Confirmation) -> Iterator[tuple[str, str]]:
    """List the other shapes of the chosen design with their cost in shift time."""
    for shape in confirmation.shapes or ():
        cost = time_difference(confirmation.best, shape)
        if cost:
            note = UNCLEAR_NOTE if is_unclear(*cost) else ""
            words = f"{ms_with_error(*cost, '+')} ms{note}{_shape_state(shape)}"
            yield f"with {shape.shape}", words


def _shape_state(shape: OtherShape) -> str:
    """Print the verdict on another shape unless it passes; old results have no verdict."""
    if shape.verdict:
        return "" if shape.verdict.passes else f", {shape.verdict.line}"
    return "" if shape.feasible else ", fails a check"


def _hang_facts(confirmation: Confirmation) -> Iterator[tuple[str, str]]:
    """List engaged means and hangs of own dog and chosen design; old results have none."""
    for name, confirmed in sides_of(confirmation).items():
        if confirmed.hang_probability is not None:
            yield f"mean of engaged shifts, {name}", engaged_text(confirmed)
            yield f"hangs, {name}", hang_words(confirmed)
        yield from _worst_hang_facts(name, confirmed)


def _worst_hang_facts(name: str, confirmed: ConfirmedDesign) -> Iterator[tuple[str, str]]:
    """List the share of hangs at the worst point with its limits; old results have none."""
    if confirmed.verdict and confirmed.verdict.hangs:
        hangs = confirmed.verdict.hangs
        yield f"most hangs, {name}", hangs.text
