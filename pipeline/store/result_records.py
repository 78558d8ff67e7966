"""Records that several results share: expected times, checks, agreement of engines, gaps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dogshape.pipeline.record import (
    SHARE,
    Bad,
    Record,
    Table,
    key,
    number_or_none,
    percent,
    tabulate,
)
from dogshape.sim.statistics.expectation import Expectation, PointExpectation
from dogshape.sim.statistics.hangs import HangPrior
from dogshape.sim.statistics.shiftability import SpeedLimit, speed_limits
from dogshape.sim.strength.checks import GROUPS, RULES, Check, safety_factor
from dogshape.sim.strength.verdict import STANDARD
from dogshape.sim.units import RPM, short

if TYPE_CHECKING:
    from dogshape.diagnosis.bench.comparison import PointGap


IN_MS: dict[str, Any] = {"scale": 1e3, "form": ".1f"}  #: how a time is shown


class Shiftability(Record):
    """Entry at the first try; intervals are Wilson's, of 95 %, and even angles err less."""

    engaged_interval: list[float] = key("ends of the interval of `engaged`", SHARE)
    direct: float = key("share of the shifts that enter a slot without touching a face", SHARE)
    direct_interval: list[float] = key("ends of its interval", SHARE)
    direct_closed_form: float | None = key(
        "`direct` of flat tips in closed form; null for tips that slope", SHARE, late=True
    )
    first_window: float | None = key(
        "share of the shifts that engage and are carried past no slot", SHARE, late=True
    )
    by_angle: list[list[int]] = key(
        "shifts by bin of a pitch, from dogs facing dogs: direct, after face contact, not engaged"
    )

    @classmethod
    def of(cls, p: PointExpectation) -> Shiftability:
        """Record the entries of an operating point."""
        from scipy.stats import binomtest  # noqa: PLC0415  slow to load

        direct, late, _ = map(sum, zip(*p.by_angle, strict=True))
        tests = (binomtest(count, p.n) for count in (direct + late, direct))
        engaged, own = ([*one.proportion_ci(method="wilson")] for one in tests)
        return cls(
            engaged_interval=engaged,
            direct=direct / p.n,
            direct_interval=own,
            direct_closed_form=p.direct_share,
            first_window=None if p.first_window is None else p.first_window / p.n,
            by_angle=[list(one) for one in p.by_angle],
        )


class QuantileRow(Record):
    """A quantile of the time of all shifts over the mix, as over a life; retries included."""

    share: float = key("share of all shifts that engage within the time", SHARE)
    time_s: float | None = key("that time; null where fewer than one shift lies beyond", "s")
    standard_error_s: float | None = key("its standard error (Woodruff)", "s")


class PlaceRow(Record):
    """An operating point of a result."""

    mismatch_rpm: float = key("mismatch before the shift", "1/min", head="mismatch, 1/min")
    force_N: float = key("final shift force", "N", head="force, N", form=".1f")


class HangPriorRow(Record):
    """Prior of the probability that a shift of an operating point hangs."""

    rate: float = key("mean of rare hangs", SHARE)
    strength: float = key("number of shifts that the rate counts for", "1")
    blocked_share: float = key("probability that the shape blocks there", SHARE)

    @classmethod
    def of(cls, prior: HangPrior | None) -> HangPriorRow | None:
        """Record a prior."""
        return None if prior is None else cls(**vars(prior))


class PointRow(PlaceRow):
    """An operating point of an expected shift time."""

    mean_s: float | None = key(
        "mean with retries; null if under half engage",
        "s",
        head="with retries, ms",
        scale=1e3,
        form=".2f",
    )
    mean_engaged_s: float | None = key("mean time of the shifts that engaged", "s")
    standard_error_s: float | None = key(
        "standard error of `mean_s`", "s", head="s.e., ms", scale=1e3, form=".2f"
    )
    engaged_mean_s: float | None = key(
        "mean time of the shifts that engage or are freed",
        "s",
        late=True,
        head="engaged mean, ms",
        scale=1e3,
        form=".2f",
    )
    engaged_standard_error_s: float | None = key(
        "standard error of `engaged_mean_s`",
        "s",
        late=True,
        head="s.e., ms",
        scale=1e3,
        form=".2f",
    )
    hang_probability: float | None = key(
        "probability that a shift hangs and is tried again",
        SHARE,
        late=True,
        head="hangs",
        form=".2%",
    )
    hang_prior: HangPriorRow | None = key("prior of that probability", late=True)
    sd_s: float = key("standard deviation of the time of a shift", "s", head="sd, ms", **IN_MS)
    engaged: float = key("share of the shifts that engaged", SHARE, head="engaged", form="z.0%")
    n: int = key("number of shifts", head="n", form="d")
    held_dog_on_dog: int | None = key("shifts that friction held dog on dog", late=True)
    shiftability: Shiftability | None = key("how shifts enter; null without any", late=True)

    @classmethod
    def of(cls, p: PointExpectation) -> PointRow:
        """Record an operating point; where too few shifts engage there is no time."""
        return cls(
            mismatch_rpm=p.point.mismatch / RPM,
            force_N=p.point.profile.force,
            mean_s=p.time,
            mean_engaged_s=p.mean_engaged,
            standard_error_s=number_or_none(p.standard_error if p.engages else None),
            engaged_mean_s=None if p.silent else p.engaged_mean,
            engaged_standard_error_s=None if p.silent else number_or_none(p.engaged_error),
            hang_probability=p.hang.mean,
            hang_prior=HangPriorRow.of(p.prior),
            sd_s=p.sd,
            engaged=p.engaged,
            n=p.n,
            held_dog_on_dog=p.blocked,
            shiftability=Shiftability.of(p) if p.n and p.by_angle else None,
        )


class HangKeys(Record):
    """Both parts of an expected shift time: mean of engaged shifts, and retries of hangs."""

    engaged_mean_s: float | None = key(
        "mean time of the shifts that engage at the first try or are freed by a set-point",
        "s",
        late=True,
    )
    engaged_standard_error_s: float | None = key("its standard error", "s", late=True)
    hang_probability: float | None = key(
        "probability that a shift hangs and is tried again, posterior mean", SHARE, late=True
    )
    hang_probability_low: float | None = key("lower end of its 95 % interval", SHARE, late=True)
    hang_probability_high: float | None = key("upper end", SHARE, late=True)
    retries_s: float | None = key("expected time of retries", "s", late=True)
    retries_error_s: float | None = key("its standard error", "s", late=True)


def hang_keys(found: Expectation) -> dict[str, float | None]:
    """Give both parts of an expected time by the keys of ``HangKeys``."""
    silent, (low, high) = any(p.silent for p in found.points), found.hang_interval
    return {
        "engaged_mean_s": None if silent else found.engaged_mean,
        "engaged_standard_error_s": None if silent else number_or_none(found.engaged_error),
        "hang_probability": found.hang_probability,
        "hang_probability_low": low,
        "hang_probability_high": high,
        "retries_s": found.retries if found.engages else None,
        "retries_error_s": found.retries_error if found.engages else None,
    }


class LimitRow(Record):
    """Limit engagement speed: largest mismatch at which a share engages in the first window."""

    sense: int = key("sense of the mismatch, 1 or -1", head="mismatch", form="+d")
    force_N: float = key("final shift force", "N", head="force, N", form=".1f")
    share: float = key("share that engages", SHARE, head="in the first window", form="z.0%")
    limit_engagement_speed_rpm: float | None = key(
        "median; 0: no tested mismatch reaches the share, null: the largest tested one does",
        "1/min",
        head="limit engagement speed, 1/min",
    )
    limit_engagement_speed_low_rpm: float | None = key(
        "end of the 95 % interval; 0 and null as for the median", "1/min"
    )
    limit_engagement_speed_high_rpm: float | None = key("its other end", "1/min")
    tested_rpm: float = key("largest tested mismatch in that sense", "1/min")

    @classmethod
    def of(cls, limit: SpeedLimit, share: float) -> LimitRow:
        """Record a limit."""
        speeds = (limit.speed, limit.low, limit.high)
        middle, low, high = (number_or_none(speed / RPM) for speed in speeds)
        return cls(
            sense=limit.sense,
            force_N=limit.force,
            share=share,
            tested_rpm=limit.tested / RPM,
            limit_engagement_speed_rpm=middle,
            limit_engagement_speed_low_rpm=low,
            limit_engagement_speed_high_rpm=high,
        )

    def cell(self, name: str) -> str:
        """Print a value: the limit with its interval, or that it lies over what was tested."""
        if name != "limit_engagement_speed_rpm":
            return super().cell(name)
        ends = (self.limit_engagement_speed_low_rpm, self.limit_engagement_speed_high_rpm)
        low, high = map(self._speed_text, ends)
        middle = self._speed_text(self.limit_engagement_speed_rpm)
        return middle if low == high else f"{middle} ({low} to {high})"

    def _speed_text(self, speed: float | None) -> str:
        return f"over {self.tested_rpm:.4g}" if speed is None else f"{speed:.3g}"


class ExpectedTime(HangKeys):
    """Expected shift time over operating points and relative angles."""

    expected_shift_time_s: float | None = key(
        "`engaged_mean_s` and `retries_s`; null where too few engage", "s"
    )
    standard_error_s: float | None = key("its standard error, of both parts", "s")
    numerical_error_s: float | None = key("by finer integration; null where not computed", "s")
    engages: bool = key("whether at least half of the shifts engage at each operating point")
    engaged: float = key("least share of the shifts that engaged at a point", SHARE)
    mean_engaged_s: float | None = key("mean time of the shifts that engaged", "s", late=True)
    shifts: int | None = key("number of shifts", late=True)
    not_engaged: int | None = key("shifts that did not engage", late=True)
    held_dog_on_dog: int | None = key("shifts that friction held dog on dog", late=True)
    quantiles: list[QuantileRow] | None = key("quantiles of the time", late=True)
    points: list[PointRow] = key("the operating points")
    engagement_limits: list[LimitRow] | None = key(
        "limit engagement speeds by force and sense of the mismatch", late=True
    )

    @classmethod
    def of(cls, found: Expectation) -> ExpectedTime:
        """Record an expectation; where too few shifts engage there is no time, nor its error."""
        none, quantiles = not found.engages, list[QuantileRow]()
        for share, one in found.quantiles.items():
            known = not none and (1.0 - share) * found.shifts >= 1.0
            time, error = (one.value, one.standard_error) if known else (None, None)
            quantiles.append(QuantileRow(share=share, time_s=time, standard_error_s=error))
        return cls(
            expected_shift_time_s=found.time,
            standard_error_s=None if none else number_or_none(found.standard_error),
            numerical_error_s=None if none else number_or_none(found.numerical_error),
            engages=found.engages,
            engaged=found.engaged,
            mean_engaged_s=found.mean_engaged,
            **hang_keys(found),
            shifts=found.shifts,
            not_engaged=found.lost,
            held_dog_on_dog=found.blocked,
            quantiles=quantiles,
            points=[PointRow.of(point) for point in found.points],
            engagement_limits=[
                LimitRow.of(limit, found.first_window_share)
                for limit in speed_limits(found.points, found.first_window_share)
            ],
        )


class CheckRow(Record):
    """A check of a design against its limit."""

    name: str = key("name of the check", head="check")
    value: float | None = key("checked value, in `unit`; null where infinite", head="value")
    limit: float | None = key("limit, in `unit`; null where nothing is judged", head="limit")
    unit: str = key("unit of value and limit", head="unit")
    margin: float | None = key(
        "distance to the limit over the limit; at least 0 passes", "1", head="margin"
    )
    passed: bool | None = key("whether the check passes; null: not judged", head="passed")
    group: str = key("kind of check: `make`, `load`, `lock`, `impact` or `tolerance`")
    at_most: bool = key("whether the limit is an upper one")
    meaning: str = key("what is checked", head="meaning")
    formula: str = key("formula of the value", head="formula")
    source: str = key("source of the limit", head="source")
    limit_key: str = key("key of the study file that sets the limit", head="limit set by")
    margin_worst_case: float | None = key(
        "margin at worst-case tolerances; null without any or a dog", "1", None, head="worst case"
    )
    margin_root_sum_square: float | None = key(
        "margin by root sum of squares of the tolerances, at the reject rate",
        "1",
        None,
        head="rss",
    )
    margin_interval: list[float] | None = key(
        "ends of the 95 % interval of the margin; absent where it is exact", "1", None, head="95 %"
    )
    ends: str | None = key(
        "ends of ranges at which the margin is smallest; absent without ranges", "", None
    )
    safety: float | None = key(
        "safety factor, upper limit of a stress or force over its value; null for other checks",
        "1",
        None,
        head="S",
        form=".2f",
    )

    def cell(self, name: str) -> str:
        """Print a value: the limit with its sense, what fails as ``Bad``."""
        if name == "margin_interval":
            return " to ".join(map(percent, self.margin_interval or ())) or "-"
        if self.passed is None:
            return {
                "name": self.name,
                "margin": Bad("not judged"),
                "limit_key": self.limit_key,
                "meaning": self.meaning,
            }.get(name, "-")
        value, margin = getattr(self, name), "margin" in name
        text = super().cell(name) if not margin or value is None else percent(value)
        if name == "limit":
            return f"{'≤' if self.at_most else '≥'} {text}"
        if name == "passed" and not value:
            return Bad("NO")
        return Bad(text) if margin and (value or 0.0) < 0.0 else text


def check_record(check: Check) -> dict[str, Any]:
    """Record a check as JSON takes it."""
    rule = check.rule
    ends: dict[str, Any] = {"ends": check.ends} if check.ends else {}
    if check.margin_interval is not None:
        ends["margin_interval"] = list(check.margin_interval)
    return CheckRow(
        name=check.name,
        value=number_or_none(check.value),
        limit=check.limit,
        unit=rule.unit,
        margin=number_or_none(check.margin),
        passed=check.passed,
        group=rule.group,
        at_most=rule.at_most,
        meaning=rule.meaning,
        formula=rule.formula,
        source=rule.source,
        limit_key=rule.key,
        safety=safety_factor(rule, check.margin),
        **ends,
    ).to_dict()


def check_table(rows: Sequence[CheckRow], *names: str) -> Table:
    """Tabulate checks by group; by default with value, limit, safety factor and margins."""
    interval = ("margin_interval",) if any(row.margin_interval for row in rows) else ()
    columns = names or (
        *("name", "value", "limit", "unit", "safety", "margin"),
        *(*interval, "margin_root_sum_square", "margin_worst_case", "passed"),
    )
    cells, looks = list[Sequence[str]](), dict[int, str]()
    for group, title in GROUPS.items():
        if members := [row for row in rows if row.group == group]:
            looks[len(cells)] = "group"
            cells += [[title], *tabulate(CheckRow, members, *columns).rows]
    words = [k for k, n in enumerate(columns) if n in ("unit", "meaning", "formula", "source")]
    return Table(tabulate(CheckRow, (), *columns).heads, cells, looks, words)


class HingeRow(Record):
    """An assumption that decides a verdict, with its effect on the smallest margin."""

    assumption: str = key("key of the study file", head="assumption")
    value: float = key("its value, in `unit`", head="value")
    range: list[float] = key("ends of its range, in `unit`", head="range")
    unit: str = key("unit of value and range", head="unit")
    source: str = key("source of the range", head="source of the range")
    status: str = key("`standard`, `estimate` or `assumption`", head="status")
    smallest_margin: list[float] = key(
        "smallest margin at either end of the range", "1", head="smallest margin"
    )
    weakest_check: list[str] = key("check with that margin at either end", head="check")
    flips: bool = key("whether the smallest margin changes its sign", head="flips")

    def cell(self, name: str) -> str:
        """Print the ends of a range beside each other; margins below zero as ``Bad``."""
        if name == "range":
            return f"{' to '.join(map(short, self.range))} {self.unit}".rstrip()
        if name == "smallest_margin":
            text = " to ".join(map(percent, self.smallest_margin))
            return Bad(text) if min(self.smallest_margin) < 0.0 else text
        if name == "weakest_check":
            words = (one.replace("_", " ") for one in self.weakest_check)
            return ", ".join(dict.fromkeys(words))
        return super().cell(name)


class NotJudged(Record):
    """A standard check that nobody judged."""

    check: str = key("name of the check")
    key: str = key("key of the study file that judges it")


def not_judged_row(one: NotJudged) -> CheckRow:
    """Give the row of a standard check that nobody judged, with the key that judges it."""
    standard = next(standard for standard in STANDARD if standard.name == one.check)
    return CheckRow(
        name=one.check,
        value=None,
        limit=None,
        unit="",
        margin=None,
        passed=None,
        group=RULES[standard.rules[0]].group,
        at_most=True,
        meaning=standard.reason,
        formula="",
        source="",
        limit_key=one.key,
    )


class VerdictRow(Record):
    """Verdict on a design (`docs/strength.md`)."""

    state: str = key("`passes`, `fails`, `not_judged` or `not_clear`")
    line: str = key("the verdict in a sentence")
    failed: list[str] = key("checks with a negative margin")
    not_clear: list[str] = key("checks whose interval of 95 % holds the limit")
    not_judged: list[NotJudged] = key("standard checks that nobody judged")
    hangs_on: list[HingeRow] = key("assumptions with an effect, the strongest first")


def hinge_table(rows: Sequence[HingeRow], *names: str) -> Table:
    """Tabulate the assumptions of a verdict, the strongest first; by default with their sources."""
    names = names or (
        *("assumption", "value", "range", "smallest_margin", "weakest_check", "flips"),
        *("status", "source"),
    )
    words = [
        place for place, name in enumerate(names) if name in ("weakest_check", "status", "source")
    ]
    note = (
        "Smallest margin at either end of the range of an assumption, the others as given, by the "
        "closed forms; landings scale with the root of the contact's stiffness."
    )
    return Table(
        tabulate(HingeRow, (), *names).heads, tabulate(HingeRow, rows, *names).rows, {}, words, note
    )


class EngineAgreement(Record):
    """Shifts of the compiled engine that Drake simulated again."""

    shifts: int = key("shifts that both engines simulated")
    outcome_same: int = key("shifts that end as in Drake")
    median_deviation: float = key("median size of a shift time's deviation from Drake's", "1")
    worst_deviation: float = key("largest size of that deviation", "1")
    mean_deviation: float = key("mean time less Drake's over Drake's, if both engage", "1")
    standard_error: float = key("standard error of `mean_deviation`", "1")
    agrees: bool = key("whether the engines agree (`docs/search.md`)")

    @property
    def text(self) -> str:
        """The agreement as a clause."""
        return (
            f"{self.outcome_same} of {self.shifts} shifts end as in Drake; deviation of the mean "
            f"time {100 * self.mean_deviation:+z.2f} ± {100 * self.standard_error:.2f} %, "
            f"of single times {100 * self.median_deviation:.2f} % (median) and "
            f"{100 * self.worst_deviation:.1f} % (largest)"
        )


class BenchPoint(PlaceRow):
    """An operating point of a bench data set beside its simulation."""

    bench_s: float | None = key("mean time on the bench", "s", head="bench, ms", **IN_MS)
    simulated_s: float | None = key("mean of engaged shifts", "s", head="simulated, ms", **IN_MS)
    standard_error_s: float | None = key("s.e. of the difference", "s", head="s.e., ms", **IN_MS)
    z: float | None = key("bench less simulated over standard error", "1", head="z", form="+.1f")
    engaged: float = key("simulated share that engaged", SHARE, head="engaged", form="z.0%")
    n: int = key("simulated shifts", head="n", form="d")

    @classmethod
    def of(cls, d: PointGap) -> BenchPoint:
        """Record one operating point of a comparison."""
        return cls(
            mismatch_rpm=d.cell.point.mismatch / RPM,
            force_N=d.cell.point.profile.force,
            bench_s=d.cell.time,
            simulated_s=d.mean,
            standard_error_s=d.standard_error,
            z=d.z,
            engaged=d.engaged,
            n=d.n,
        )
