"""What a diagnosis says in words: units of the channel itself, phases without a depth gauge, small but sure."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rollover.diagnosis import reported, statements
from rollover.diagnosis.asked import finding_lines
from rollover.diagnosis.data.dataset import dataset_of
from rollover.diagnosis.data.phases import drop_phases
from rollover.diagnosis.fit.cross_validation import HeldOutMisfit
from rollover.diagnosis.fit.jobs import Executor
from rollover.diagnosis.fit.linearisation import Fitted, ResidualBlock
from rollover.diagnosis.forward.forward_model import simulator_of
from rollover.diagnosis.inference.scores import misfit_before_impact
from rollover.diagnosis.noise.ensemble import HeavyTail
from rollover.diagnosis.prepared import prepared
from rollover.diagnosis.result import Interval, Named, NextTest, Score, Share
from rollover.diagnosis.statements import discriminating_test, sentence
from rollover.effects import EFFECTS, units_of
from rollover.effects.sensor import SensorBias, SensorClipping
from rollover.recording.checks import Finding
from tests.diagnosis.drops import ACCELERATION, DEPTH, FORCE, recorded, scenario


def test_a_limit_and_an_offset_are_in_the_unit_of_their_channel() -> None:
    assert "2,840 N:" in SensorClipping(channel=FORCE, limit=2840.0).statement()
    assert "0.01 m" in SensorBias(channel=DEPTH, bias=0.01).statement()
    assert "1,000 N:" in SensorClipping(channel=FORCE, limit=999.7).statement()
    assert units_of(EFFECTS["sensor-bias"], ACCELERATION)["bias"] == "m/s2"
    assert units_of(EFFECTS["soil-layer"])["depth"] == "m"


def test_nearly_all_is_not_said_to_be_all() -> None:
    assert Share(share=0.9986, low=0.9969, high=1.0).message().startswith("99.8% (99.6% to 100%) of")
    assert Share(share=0.942, low=-0.3, high=0.99999).message().startswith("94% (0% to 99.9%) of")
    little = Share(share=0.0004, low=-0.0001, high=0.02)
    assert little.message(alone=False) == "below 0.5% (0% to 2%) of the held-out mismatch, beyond the others"


@pytest.mark.parametrize(("rate", "said"), [(1000.0, ()), (5000.0, ("means of 3 neighbouring samples",))])
def test_means_of_samples_are_said_to_be_compared(rate: float, said: tuple[str, ...]) -> None:
    """Of 0.35 s at 5 kHz are 1,750 samples, by threes no fewer than 500 rows."""
    _, notes = prepared(scenario(), recorded({}, noise=0.02, rate=rate, until=0.35), Executor())
    assert ["means of" in n for n in notes] == [True] * len(said)
    assert all(part in n for part, n in zip(said, notes, strict=True))


@pytest.mark.parametrize(("reference_speed", "is_planned"), [(0.05, False), (0.01, True)])
def test_no_drop_is_advised_for_what_no_drop_tells(
    reference_speed: float, is_planned: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rate law at another v_0 is the usual one on softer ground: the ground's stiffness alone is no rival of it."""
    values = {"per_decade": 0.2, "reference_speed": reference_speed}
    effect = Named(
        id="soil-rate-hardening",
        kind="physics",
        statement="",
        parameters={},
        settings=values,
        channel=None,
        p_value=0.0,
        indistinguishable_from=("soil-stiffness",),
        discriminating_test="",
    )
    rival = SimpleNamespace(candidates=[SimpleNamespace(id="soil-stiffness")], chi2=1.0)
    explanation = SimpleNamespace(
        parts=[SimpleNamespace(rivals=[rival])], fitted=SimpleNamespace(candidates=[SimpleNamespace()])
    )
    concluded: Any = SimpleNamespace(
        asked=SimpleNamespace(scenario=scenario()),
        effects=(effect,),
        recording_fault=None,
        explanation=explanation,
        problem=SimpleNamespace(dataset=[]),
    )
    advice = NextTest(path="initiation.speed", value=1.4, unit="m/s", channels=(FORCE,), rate=1e3, probability=1.0)
    monkeypatch.setattr(reported, "next_test", lambda *_: advice)
    (found,) = reported._with_next_test(concluded)
    assert (found.next_test is not None) is is_planned


def test_a_discriminating_test_is_that_of_the_rival() -> None:
    """Not that of another look-alike, where none is listed for the two."""
    bias = f"sensor-bias:{ACCELERATION}"
    assert discriminating_test(bias, []) == EFFECTS["sensor-bias"].rivals["sensor-gain"]
    assert discriminating_test(bias, ["soil-adhesion"]) == EFFECTS["sensor-bias"].rivals["soil-adhesion"]
    assert discriminating_test("slope", ["ground-friction"]) == EFFECTS["ground-friction"].rivals["slope"]
    assert f"--between {bias},air-drag`" in discriminating_test(bias, ["air-drag"])


def test_phases_need_no_depth_gauge() -> None:
    """The deepest point is that of the scenario where no channel tells it, and near that of the depth gauge."""
    speeds = {"speeds": (2.0,), "channels": (FORCE, ACCELERATION, DEPTH), "rate": 1000.0}
    (name, r), *_ = recorded({}, 4, **speeds)  # type: ignore[arg-type]
    blind = recorded({}, 4, **{**speeds, "channels": (FORCE, ACCELERATION)})[0][1]  # type: ignore[arg-type]
    found = [dataset_of(name, one, simulator_of(scenario(), one)) for one in (r, blind)]
    with_depth, without = ({n: at for at, n in drop_phases(e)} for e in found if e is not None)
    assert list(without) == ["free-fall", "first-contact", "loading", "peak", "unloading", "rest"]
    assert without["peak"] == pytest.approx(with_depth["peak"], rel=0.05)


@pytest.mark.parametrize(
    ("p", "said"),
    [(0.3, "agree within the noise (p = 0.3)"), (1e-9, "less than 0.1%"), (0.0, "more than noise (p < 1e-12)")],
)
def test_a_sure_but_negligible_effect_is_not_called_noise(p: float, said: str) -> None:
    nothing = HeldOutMisfit(chi2=np.ones(1), count=np.ones(1))
    assert said in sentence("no-mismatch", (), p, nothing, nothing, [])


def test_what_lies_within_a_tolerance_is_not_said_to_be_small() -> None:
    """5 % of a range for a noise of 0.1 %: a misfit of 4 % is tolerated."""
    nothing = HeldOutMisfit(chi2=np.ones(1), count=np.ones(1))
    ((name, r),) = recorded({}, 4, speeds=(2.0,), channels=(FORCE,), noise=1e-3)
    exact = dataset_of(name, r, simulator_of(scenario(), r))
    assert exact is not None
    for e, ends in ((exact, "channel's range."), (replace(exact, model_error=0.05), "tolerated or repeats differ by.")):
        assert sentence("no-mismatch", (), 1e-9, nothing, nothing, [e]).endswith(ends)


def test_what_scattering_runs_miss_before_the_impact_is_said() -> None:
    """3 and 4 times the noise before the impact, nearly nothing behind: sqrt((9 + 16)/2), whatever counts how much."""
    early = np.arange(80) < 40
    none: Any = {"J": np.zeros((80, 0)), "slope": np.zeros(80), "shift": 0.0, "prior": 1e-3}
    samples = np.where(early, 0.5, 0.1)
    other = HeavyTail(samples=samples, share=0.1, more=0.0)
    blocks = (
        ResidualBlock(residual=np.where(early, 3.0, 0.01), **none),
        ResidualBlock(residual=np.where(early, 4.0, 0.01) * samples, heavy_tail=other, **none),
    )
    fitted = Fitted(candidates=(), x=(), blocks=blocks)
    scattering: Any = [SimpleNamespace(expected=50.0, early=early), SimpleNamespace(expected=None, early=early)]
    assert misfit_before_impact(scattering, fitted) == pytest.approx(np.sqrt(12.5))
    assert misfit_before_impact(scattering[1:], fitted) is None  # a drop
    at_once: Any = [SimpleNamespace(expected=50.0, early=~(early | ~early))] * 2
    assert misfit_before_impact(at_once, fitted) is None


@pytest.mark.parametrize(("told", "said"), [(11, None), (12, 3.0)])
def test_of_few_samples_before_the_impact_nothing_is_said(told: int, said: float | None) -> None:
    """Two recordings of so many samples before the impact, and as many at the start, which have no past: 24 in all."""
    early = np.arange(80) < 2 * told
    residual = np.where(np.arange(80) < told, 0.0, 3.0)
    none: Any = {"J": np.zeros((80, 0)), "slope": np.zeros(80), "shift": 0.0, "prior": 1e-3}
    fitted = Fitted(candidates=(), x=(), blocks=(ResidualBlock(residual=residual, **none),) * 2)
    scattering: Any = [SimpleNamespace(expected=50.0, early=early)] * 2
    assert misfit_before_impact(scattering, fitted) == said


def test_a_misfit_with_scatter_or_unexplained_is_reported() -> None:
    first, last = (HeldOutMisfit(chi2=np.array([left]), count=np.ones(1)) for left in (1.44, 0.64))
    tilted = Named(
        id="slope", kind="parameter", statement="The ground is inclined.", parameters={}, settings={}, channel=None,
        p_value=0.0, indistinguishable_from=(), discriminating_test="",
    )  # fmt: skip
    plain = sentence("parameter", [tilted], 0.0, first, last, [])
    assert plain == "The ground is inclined. With it the held-out misfit falls from 1.2 to 0.80 times the noise."
    more = sentence("parameter", [tilted], 0.0, first, last, [], remains=True)
    assert more == plain + " The unexplained residual has structure: these effects are not the whole difference."
    one = sentence("parameter", [tilted], 0.0, first, last, [], cross_validated=False)
    assert one.startswith(plain.replace("held-out ", "") + " With one recording nothing can be held out")
    unexplained = sentence("unexplained", (), 0.0, first, last, [], cross_validated=False)
    assert unexplained.endswith("no candidate explains it.")
    said = sentence("parameter", [tilted], 0.0, first, last, [], (6.94, 1.02))
    assert said.startswith(plain[:-1] + " and the scatter of runs; before the first impact")
    assert said.endswith("where runs do not scatter, it is 1.02 times the noise, without 6.94.")


def test_an_effect_all_of_whose_intervals_hold_null_is_said() -> None:
    def effect(id: str, **ends: tuple[float, float]) -> Named:
        told = {p: Interval(value=0.5 * (a + b), low=a, high=b, unit="") for p, (a, b) in ends.items()}
        return Named(
            id=id, kind="parameter", statement="", parameters=told, settings={}, channel=None, p_value=0.0,
            indistinguishable_from=(), discriminating_test="",
        )  # fmt: skip

    assert statements.is_null_effect(effect("impact-speed", scale=(0.98, 1.09)))
    assert not statements.is_null_effect(effect("impact-speed", scale=(1.01, 1.09)))
    assert statements.is_null_effect(effect("centre-of-mass", height=(-0.1, 0.1), lateral=(-0.2, 0.1)))
    assert statements.is_null_effect(
        effect("soil-adhesion", stress=(0.8, 8800.0), reach=(1e-3, 0.1))
    )  # a hundredth of it
    assert not statements.is_null_effect(effect("soil-adhesion", stress=(30.0, 240.0), reach=(1e-3, 0.1)))
    assert not statements.is_null_effect(effect("centre-of-mass", height=(-0.1, 0.1), lateral=(0.02, 0.1)))
    assert not statements.is_null_effect(effect("rops-plasticity", yield_force=(-1.0, 1e6)))  # a limit has no null
    # an overturn without anything in it had named this, on what its runs make of chance
    growth, faster = effect("soil-added-mass-growth", rate=(0.12, 2118.0)), effect("impact-speed", scale=(1.01, 1.09))
    assert statements.interval_contains_null([growth], True) == {"soil-added-mass-growth"}
    assert statements.interval_contains_null([growth], False) == set()  # a drop has no neighbours to be one of
    assert statements.interval_contains_null([faster, growth], False) == {"soil-added-mass-growth"}
    assert statements.interval_contains_null([faster], True) == set()
    adhesion = effect("soil-adhesion", stress=(0.003, 1.6e9))  # that it acts is sure, how strongly is not
    assert statements.interval_contains_null([adhesion], True) == set()
    assert statements.interval_contains_null([faster, adhesion], True) == {"soil-adhesion"}


def test_an_effect_that_is_named_is_no_rival_of_another(monkeypatch: pytest.MonkeyPatch) -> None:
    def one(id: str) -> Any:
        return SimpleNamespace(id=id, key=id, kind="parameter", channel=None)

    def fit(*ids: str) -> Any:
        effects = tuple(one(i) for i in ids)
        return SimpleNamespace(candidates=effects, effects=effects)

    both = fit("soil-stiffness", "inertia")
    told = [{"scale": SimpleNamespace(value=1.2)}, {"scale": SimpleNamespace(value=0.9)}]
    problem: Any = SimpleNamespace(samples_per_error=1.0, with_noise_model=lambda _: None, dataset=())
    found: Any = SimpleNamespace(
        fitted=both,
        base=None,
        parts=[SimpleNamespace(fitted=fit(i), p_value=0.0) for i in ("soil-stiffness", "inertia")],
    )
    monkeypatch.setattr(statements, "refined_by_ensemble_mean", lambda _, fitted: fitted)
    monkeypatch.setattr(statements, "intervals", lambda *_, **__: told)
    monkeypatch.setattr(
        statements, "confusion_set", lambda *_: [fit("soil-stiffness"), fit("inertia"), fit("soil-crust")]
    )
    monkeypatch.setattr(
        statements, "strongest", lambda *given: one("soil-stiffness" if given[1:] == (None, both) else "inertia")
    )
    each = statements.named(problem, found, ())
    assert [e.id for e in each] == ["soil-stiffness", "inertia"]
    assert all(e.indistinguishable_from == ("soil-crust",) for e in each)


def test_many_findings_alike_are_counted() -> None:
    def found(check: str, k: int) -> tuple[str, Finding]:
        about = {"channel": FORCE, "start": 0.0, "end": 1.0, "value": 2.0, "unit": "N", "error": None}
        return "d1", Finding(check=check, sentence=f"{check} {k}", **about)

    said = list(finding_lines([*(found("stuck", k) for k in range(9)), found("spike", 0)]))
    first = [f"d1: {FORCE}: stuck {k}" for k in range(3)]
    assert said == [*first, f"d1: {FORCE}: 6 more such findings (stuck)", f"d1: {FORCE}: spike 0"]


def tolerant(is_tolerated: bool) -> SimpleNamespace:
    """A recording with one signal, of which 5 % of its range are tolerated or nothing is."""
    return SimpleNamespace(
        signals=(None,), model_error_dominates=lambda _: is_tolerated, model_error_of=lambda _: 0.05 * is_tolerated
    )


@pytest.mark.parametrize(("peak", "told"), [(0.12, True), (-0.12, True), (0.04, False), (None, False)])
def test_a_tolerance_that_lets_a_peak_pass_is_said(peak: float | None, told: bool) -> None:
    score = Score(nrmse=0.8, iso18571=0.9, peak_force_error=peak)
    said = statements.tolerance_clause("no-mismatch", 0.0, score, [tolerant(True)])  # type: ignore[list-item]
    assert said.startswith(" A peak force is off by 12%: what is tolerated may hide") == told
    assert bool(said) == told


@pytest.mark.parametrize(
    ("verdict", "p_value", "iso", "is_tolerated", "told"),
    [
        ("no-mismatch", 0.0, 0.52, True, True),
        ("no-mismatch", 0.0, 0.70, True, False),  # fair
        ("no-mismatch", 0.0, None, True, False),
        ("no-mismatch", 0.0, 0.52, False, False),  # noise alone is no tolerance that could be smaller
        ("no-mismatch", 0.9, 0.52, True, False),
        ("unexplained", 0.0, 0.52, True, False),
    ],
)
def test_a_tolerance_that_lets_poor_curves_pass_is_said(
    verdict: Any, p_value: float, iso: float | None, is_tolerated: bool, told: bool
) -> None:
    dataset: Any = [tolerant(is_tolerated)]
    score = Score(nrmse=0.8, iso18571=iso, peak_force_error=None)
    said = statements.tolerance_clause(verdict, p_value, score, dataset)
    assert ("By ISO 18571 they are poor (0.52): what is tolerated may hide an effect" in said) == told
    assert bool(said) == told
    assert statements.tolerance_clause(verdict, p_value, None, dataset) == ""
    by_references = statements.tolerance_clause(verdict, p_value, score, dataset, source="taught")
    assert ("a model that meets the references better" in by_references) == told
    assert "--tolerance" not in by_references
    beside = statements.tolerance_clause(verdict, p_value, score, dataset, source="estimated")
    assert ("such a background may hide an effect; recordings under other conditions" in beside) == told
    assert "--tolerance" not in beside  # nobody stated one
