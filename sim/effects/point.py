"""Effects of the operating point: shift force over time, mismatch and its sense, relative angles.

A dead time moves nothing meanwhile: every time grows by the same, and no simulation is needed. A
loss acts at rest as in motion, unlike Coulomb friction. Scaled or reduced, the force keeps its rise
time. An offset of the mismatch counts along the nominal one: a negative one makes it smaller. A
reversed sense has no strength: traction flanks meet where braking flanks were to. Relative angles
that are not uniform change how often each comes: weights, and no simulation.
"""

from __future__ import annotations

import math
from dataclasses import replace

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting
from dogshape.sim.units import to_si


def _with_profile(setting: Setting, **fields: float) -> Setting:
    return setting.with_point(profile=replace(setting.point.profile, **fields))


def _with_mismatch(setting: Setting, values: Values) -> Setting:
    nominal = setting.point.mismatch
    offset = to_si("offset_rpm", values["offset_rpm"]) * math.copysign(1.0, nominal)
    return setting.with_point(mismatch=values["mismatch_factor"] * nominal + offset)


def _with_angles(setting: Setting, values: Values) -> Setting:
    if values["concentration"] == 0.0:
        return setting
    centre = values["centre_pitch"] % 1.0
    return replace(setting, concentration=values["concentration"], centre=centre)


EFFECTS = (
    Effect(
        "actuation_delay", title="dead time of the actuation",
        meaning="the force starts some time after time zero",
        parameters=(Parameter(
            "delay_s", neutral=0.0, low=0.0, high=0.4, scale="uniform", least=0.0, most=1.0,
            ordinary=(0.15, "valve, pipe and filling of a cylinder"),
            source="valve, pipe and filling of a pneumatic cylinder take 10 to 150 ms; a time "
            "zero set by hand or by another clock errs by as much again; uniform, since a shifted "
            "zero has no scale",
        ),),
        change=lambda setting, values: replace(setting, delay=setting.delay + values["delay_s"]),
        test=BenchTest("force at the sleeve over time",
            "Record the trigger and the force at the shift fork on one clock: the force must begin "
            "to rise at time zero."),
        aliases=("a shifted time zero of the record",),
    ),
    Effect(
        "actuation_lag", title="slow rise of the shift force",
        meaning="the force nears its nominal course with a lag of first order",
        parameters=(Parameter(
            "lag_s", neutral=0.0, low=0.003, high=0.45, scale="log-uniform", most=1.0,
            ordinary=(0.3, "a cylinder behind its valve"),
            source="a cylinder of 0.1 to 1 litre behind a valve of some hundred litres a minute "
            "fills with time constants of 10 to 300 ms; a throttled one up to half a second",
        ),),
        change=lambda setting, values: _with_profile(
            setting, lag=values["lag_s"] or setting.point.profile.lag
        ),
        test=BenchTest("force at the sleeve over time",
            "Record the force at the shift fork while the ring is blocked: its course after the "
            "nominal rise shows the lag."),
    ),
    Effect(
        "force_rise", title="rise time of the shift force off nominal",
        meaning="the force rises to its final value in a factor of the nominal time",
        parameters=(Parameter(
            "rise_factor", neutral=1.0, low=0.4, high=2.5, scale="log-uniform",
            least=0.05, most=20.0,
            source="a rise read from 10 to 90 percent of a cubic step is 0.61 of the whole, up to "
            "another threshold down to 0.4; a supply or throttle of half the flow takes twice as "
            "long, a longer hose some ten percent more",
        ),),
        change=lambda setting, values: _with_profile(
            setting, rise=setting.point.profile.rise * values["rise_factor"]
        ),
        test=BenchTest("force at the sleeve over time",
            "Record the force at the shift fork while the ring is blocked: from its first rise to "
            "its final value is the rise time."),
    ),
    Effect(
        "force_scale", title="shift force off nominal",
        meaning="the force at the sleeve is a factor of the nominal one",
        parameters=(Parameter(
            "force_factor", neutral=1.0, low=0.5, high=1.5, scale="uniform",
            least=0.05, most=3.0,
            source="an assumed efficiency of 0.8 may be 0.5 to 1 with a bent or dry cable; ratios "
            "from a static calibration err by up to 10 percent more, a piston's area by 15",
        ),),
        change=lambda setting, values: _with_profile(
            setting, force=setting.point.profile.force * values["force_factor"]
        ),
        test=BenchTest("static force at the sleeve",
            "Block the ring and measure the force at the shift fork with a load cell at each "
            "pressure."),
    ),
    Effect(
        "force_loss", title="constant loss of shift force",
        meaning="the force at the sleeve is smaller than nominal by a constant",
        parameters=(Parameter(
            "loss_N", neutral=0.0, low=2.0, high=150.0, scale="log-uniform", most=1000.0,
            ordinary=(50.0, "return spring and seals of a cylinder"),
            source="a gauge read to 10 mbar on a piston of 20 cm2 errs by 2 N; return springs and "
            "preloaded seals of such cylinders hold 10 to 50 N, springs of a fork up to 150 N",
        ),),
        change=lambda setting, values: _with_profile(
            setting, loss=setting.point.profile.loss + values["loss_N"]
        ),
        test=BenchTest("static force at the sleeve",
            "Block the ring and measure the force at the shift fork with a load cell at each "
            "pressure: the same difference from nominal at all of them is a loss."),
    ),
    Effect(
        "mismatch_speed", title="mismatch off nominal",
        meaning="the true mismatch is a factor of the nominal one, and an offset",
        parameters=(
            Parameter(
                "offset_rpm", neutral=0.0, low=-4.0, high=4.0, scale="uniform",
                source="a flywheel with 5 to 20 N m of friction loses 0.5 to 3 1/min within a "
                "shift; speeds are set to a few 1/min, below the least nominal one",
            ),
            Parameter(
                "mismatch_factor", neutral=1.0, low=0.75, high=1.25, scale="uniform",
                least=0.05, most=3.0,
                source="a tooth miscounted in a ratio of some ten to twenty gives 5 to 10 "
                "percent, a neighbouring ratio of a gearbox or a slipping belt up to 25",
            ),
        ),
        change=_with_mismatch,
        test=BenchTest("both speeds at the first touch",
            "Record the speeds of both rings with encoders on the clock of the displacement and "
            "read them at the first touch."),
    ),
    Effect(
        "reversed_mismatch", title="reversed sense of rotation",
        meaning="the rings turn past each other the other way round than the table says",
        parameters=(),
        # Nought stays +0, so that the point keeps its key.
        change=lambda setting, _: setting.with_point(mismatch=0.0 - setting.point.mismatch),
        test=BenchTest("sense of rotation at the rig",
            "Look which way the driven ring turns, or which flanks of the dogs are marked after "
            "some shifts: the traction flanks where the mismatch has the sign of the table."),
    ),
    Effect(
        "relative_angle", title="uneven relative angles",
        meaning="some relative angles come more often than others",
        parameters=(
            Parameter(
                "concentration", neutral=0.0, low=0.1, high=10.0, scale="log-uniform", most=100.0,
                source="from a preference that hardly shows (0.1) to all within a tenth of the "
                "pitch (10), as with a stand that stops at one place",
            ),
            Parameter(
                "centre_pitch", neutral=0.0, low=0.0, high=1.0, scale="uniform",
                least=0.0, most=1.0, source="any place in the pitch; 0 is dogs facing dogs",
            ),
        ),
        change=_with_angles,
        test=BenchTest("angle of each shift",
            "Record the relative angle at the trigger with encoders of both rings, for some thirty "
            "shifts."),
    ),
)  # fmt: skip
