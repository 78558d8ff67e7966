"""How dead an impact of the dogs is: Hunt and Crossley's coefficient."""

from __future__ import annotations

from dogshape.sim.effect import BenchTest, Effect, Parameter, Values
from dogshape.sim.setting import Setting


def _change(setting: Setting, values: Values) -> Setting:
    return setting.with_contact(dissipation=values["dissipation_s_m"])


def _own(setting: Setting) -> float:
    return setting.clutch.contact.dissipation


EFFECT = Effect(
    name="contact_dissipation",
    title="other rebound of the dogs",
    meaning="dogs rebound more or less than assumed",
    parameters=(
        Parameter(
            "dissipation_s_m",
            neutral=_own,
            low=1.0,
            high=300.0,
            scale="log-uniform",
            source="restitution at 0.2 m/s from 0.88 (dry, elastic) to 0.02 (flooded "
            "with oil); validation.impact has the law",
            least=0.1,
            most=3000.0,
        ),
    ),
    change=_change,
    test=BenchTest(
        "drop test of the ring",
        "Drop the ring on the fixed output ring, dog on dog, from some "
        "millimetres and record the rebound.",
    ),
)
