"""Records that several results share: expected times, agreement of engines, gaps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dogshape.pipeline.record import SHARE, Record, number_or_none
from dogshape.sim.clutch_tables import key
from dogshape.sim.statistics.expectation import MixExpectation, PointExpectation
from dogshape.sim.statistics.hangs import HangPrior
from dogshape.sim.statistics.shiftability import EngagementLimit, speed_limits, torque_limits
from dogshape.sim.units import RPM

if TYPE_CHECKING:
    from dogshape.diagnosis.comparison import PointGap


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
    def of(cls, result: PointExpectation) -> Shiftability:
        """Record the entries of an operating point."""
        direct, after_contact, _ = (sum(counts) for counts in zip(*result.by_angle, strict=True))
        first_window = result.first_window
        return cls(
            engaged_interval=_wilson_interval(direct + after_contact, result.n),
            direct=direct / result.n,
            direct_interval=_wilson_interval(direct, result.n),
            direct_closed_form=result.direct_share,
            first_window=None if first_window is None else first_window / result.n,
            by_angle=[list(counts) for counts in result.by_angle],
        )


def _wilson_interval(count: int, total: int) -> list[float]:
    """Compute the ends of Wilson's interval of 95 % of a share."""
    from scipy.stats import binomtest  # noqa: PLC0415  slow to load

    return [*binomtest(count, total).proportion_ci(method="wilson")]


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
    def of(cls, result: PointExpectation) -> PointRow:
        """Record an operating point; where too few shifts engage there is no time."""
        standard_error = result.standard_error if result.engages else None
        has_entries = result.n and result.by_angle
        return cls(
            mismatch_rpm=result.point.mismatch / RPM,
            force_N=result.point.profile.force,
            mean_s=result.time,
            mean_engaged_s=result.unaided_mean,
            standard_error_s=number_or_none(standard_error),
            engaged_mean_s=None if result.silent else result.engaged_mean,
            engaged_standard_error_s=(
                None if result.silent else number_or_none(result.engaged_error)
            ),
            hang_probability=result.hang.mean,
            hang_prior=HangPriorRow.of(result.prior),
            sd_s=result.sd,
            engaged=result.engaged,
            n=result.n,
            held_dog_on_dog=result.blocked,
            shiftability=Shiftability.of(result) if has_entries else None,
        )


#: Standard error of the time of retries over the mean of engaged shifts, above which the shifts
#: were too few to judge hangs: the prior decides the time (judged).
MAX_RETRIES_ERROR = 0.1


class HangKeys(Record):
    """Terms of an expected shift time: mean of engaged shifts, and retries of hangs."""

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

    @property
    def judges_hangs(self) -> bool:
        """Whether the shifts were enough to say what hangs add to the mean."""
        if self.retries_error_s is None or self.engaged_mean_s is None:
            return True
        return self.retries_error_s <= MAX_RETRIES_ERROR * self.engaged_mean_s


def hang_keys(expectation: MixExpectation | None) -> HangKeys:
    """Record both terms of an expected time; without one, null each."""
    if expectation is None:
        return HangKeys(**dict.fromkeys(HangKeys.model_fields))
    has_silent_point = any(point.silent for point in expectation.points)
    engaged_mean = None if has_silent_point else expectation.engaged_mean
    engaged_error = None if has_silent_point else number_or_none(expectation.engaged_error)
    low, high = expectation.hang_interval
    return HangKeys(
        engaged_mean_s=engaged_mean,
        engaged_standard_error_s=engaged_error,
        hang_probability=expectation.hang_probability,
        hang_probability_low=low,
        hang_probability_high=high,
        retries_s=expectation.retries if expectation.engages else None,
        retries_error_s=expectation.retries_error if expectation.engages else None,
    )


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
    def of(cls, limit: EngagementLimit, share: float) -> LimitRow:
        """Record a limit engagement speed and the ``share`` that it is of."""
        return cls(
            sense=limit.sense,
            force_N=limit.force,
            share=share,
            limit_engagement_speed_rpm=number_or_none(limit.median / RPM),
            limit_engagement_speed_low_rpm=number_or_none(limit.low / RPM),
            limit_engagement_speed_high_rpm=number_or_none(limit.high / RPM),
            tested_rpm=limit.tested / RPM,
        )

    def cell(self, name: str) -> str:
        """Print a value, the limit with its interval or as over the tested speeds."""
        if name != "limit_engagement_speed_rpm":
            return super().cell(name)
        interval = (self.limit_engagement_speed_low_rpm, self.limit_engagement_speed_high_rpm)
        return _limit_text(self.limit_engagement_speed_rpm, interval, self.tested_rpm)


def _limit_text(
    limit: float | None, interval: tuple[float | None, float | None], tested: float
) -> str:
    """Print a limit of engagement with its interval; None lies over what was tested."""
    low, middle, high = (
        f"over {tested:.4g}" if value is None else f"{value:.3g}"
        for value in (interval[0], limit, interval[1])
    )
    return middle if low == high else f"{middle} ({low} to {high})"


class TorqueLimitRow(Record):
    """Limit engagement torque: largest torque on a side at which a share engages at first try."""

    sense: int = key(
        "sense of the torque, 1 as the engine turns, -1 against it", head="torque", form="+d"
    )
    force_N: float = key("final shift force", "N", head="force, N", form=".1f")
    share: float = key("share that engages", SHARE, head="engages at first try", form="z.0%")
    limit_engagement_torque_Nm: float | None = key(
        "median; 0: the share is not reached without a torque, null: it is with the largest one",
        "N m",
        head="limit engagement torque, N m",
    )
    limit_engagement_torque_low_Nm: float | None = key(
        "end of the 95 % interval; 0 and null as for the median", "N m"
    )
    limit_engagement_torque_high_Nm: float | None = key("its other end", "N m")
    tested_Nm: float = key("largest tested torque in that sense", "N m")

    @classmethod
    def of(cls, limit: EngagementLimit, share: float) -> TorqueLimitRow:
        """Record a limit."""
        middle, low, high = map(number_or_none, (limit.median, limit.low, limit.high))
        return cls(
            sense=limit.sense,
            force_N=limit.force,
            share=share,
            tested_Nm=limit.tested,
            limit_engagement_torque_Nm=middle,
            limit_engagement_torque_low_Nm=low,
            limit_engagement_torque_high_Nm=high,
        )

    def cell(self, name: str) -> str:
        """Print a value: the limit with its interval, or that it lies over what was tested."""
        if name != "limit_engagement_torque_Nm":
            return super().cell(name)
        ends = (self.limit_engagement_torque_low_Nm, self.limit_engagement_torque_high_Nm)
        return _limit_text(self.limit_engagement_torque_Nm, ends, self.tested_Nm)


class ExpectedTime(HangKeys):
    """Expected shift time over operating points and relative angles."""

    expected_shift_time_s: float | None = key(
        "`engaged_mean_s` and `retries_s`; null where too few engage", "s"
    )
    standard_error_s: float | None = key("its standard error, of both parts", "s")
    numerical_error_s: float | None = key(
        "of the time, by shifts repeated at a finer tolerance; null where not computed", "s"
    )
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
    engagement_torque_limits: list[TorqueLimitRow] | None = key(
        "limit engagement torques by force and sense of the torque, where torques are given",
        late=True,
    )

    @classmethod
    def of(cls, expectation: MixExpectation) -> ExpectedTime:
        """Record an expectation; where too few shifts engage there is no time, nor its error."""
        standard_error = expectation.standard_error if expectation.engages else None
        numerical_error = None
        if expectation.engages and expectation.numerical_error is not None:
            numerical_error = expectation.numerical_error.size
        record = cls(
            expected_shift_time_s=expectation.time,
            standard_error_s=number_or_none(standard_error),
            numerical_error_s=number_or_none(numerical_error),
            engages=expectation.engages,
            engaged=expectation.engaged,
            mean_engaged_s=expectation.unaided_mean,
            **hang_keys(expectation).to_dict(),
            shifts=expectation.shifts,
            not_engaged=expectation.lost,
            held_dog_on_dog=expectation.blocked,
            quantiles=_quantile_rows(expectation),
            points=[PointRow.of(point) for point in expectation.points],
            engagement_limits=[
                LimitRow.of(limit, expectation.first_window_share)
                for limit in speed_limits(expectation.points, expectation.first_window_share)
            ],
        )
        if not expectation.by_torque:
            return record
        share = expectation.first_window_share
        limits = torque_limits(expectation.points, expectation.by_torque, share)
        rows = [TorqueLimitRow.of(limit, share) for limit in limits]
        return record.model_copy(update={"engagement_torque_limits": rows})


def _quantile_rows(expectation: MixExpectation) -> list[QuantileRow]:
    """Record the quantiles; one with less than one shift beyond it has no time."""
    rows = []
    for share, quantile in expectation.quantiles.items():
        row = QuantileRow(share=share, time_s=None, standard_error_s=None)
        if expectation.engages and (1.0 - share) * expectation.shifts >= 1.0:
            row = QuantileRow(
                share=share, time_s=quantile.value, standard_error_s=quantile.standard_error
            )
        rows.append(row)
    return rows


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
        shown = self.standard_error >= 5e-5  # below, it would read zero
        error = f" ± {100 * self.standard_error:.2f}" if shown else ""
        return (
            f"{self.outcome_same} of {self.shifts} shifts end as in Drake; deviation of the mean "
            f"time {100 * self.mean_deviation:+z.2f}{error} %, "
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
    def of(cls, gap: PointGap) -> BenchPoint:
        """Record one operating point of a comparison."""
        return cls(
            mismatch_rpm=gap.cell.point.mismatch / RPM,
            force_N=gap.cell.point.profile.force,
            bench_s=gap.cell.time,
            simulated_s=gap.mean,
            standard_error_s=gap.standard_error,
            z=gap.z,
            engaged=gap.engaged,
            n=gap.n,
        )
