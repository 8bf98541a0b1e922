"""What recordings show by themselves, where simulation and recordings do not differ by more than noise and scatter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from rollover.diagnosis.data.dataset import Evidence
from rollover.diagnosis.data.inconsistent import Aside
from rollover.diagnosis.data.phases import phases_of, whole
from rollover.diagnosis.fit.step import Phases
from rollover.diagnosis.inference.clipping import cut_off
from rollover.diagnosis.inference.coarse_sampling import by_digits, coarse
from rollover.diagnosis.inference.lack_of_fit import SURE
from rollover.diagnosis.inference.lost_samples import by_loss, lost
from rollover.diagnosis.result import Named, Place, Verdict
from rollover.recording import Recording


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A verdict on what recordings show by themselves: where, by which effects if any, in one sentence."""

    verdict: Verdict
    effects: tuple[Named, ...]
    places: tuple[Place, ...]
    sentence: str
    p_value: float

    def is_of(self, channels: Iterable[str | None]) -> bool:
        """Whether all of some channels are among those that it shows."""
        return {p.channel for p in self.places}.issuperset(channels)


def by_themselves(
    evidence: Sequence[Evidence], recordings: Mapping[str, Recording], phases: Phases, p_value: float
) -> Shown | None:
    """What recordings show by themselves, that differ from their simulation with `p_value`; None if they are sound."""
    names = [e.name for e in evidence]
    if places := coarse(evidence, phases):  # in coarse steps any top is flat
        return _unexplained(places, by_digits(places, evidence), len(evidence), p_value)
    whole = [recordings[name] for name in names]
    effects, places = cut_off(names, whole, phases)
    if effects:
        said = agreeing_but(effects, len(evidence), p_value)
        least = min(p_value, *(e.p_value for e in effects))
        return Shown(verdict="sensor", effects=effects, places=places, sentence=said, p_value=least)
    return broken_off(evidence, recordings, phases, p_value)


def broken_off(
    evidence: Sequence[Evidence], recordings: Mapping[str, Recording], phases: Phases, p_value: float
) -> Shown | None:
    """Where recordings break off again and again; None if they do not."""
    names = [e.name for e in evidence]
    places = lost(names, [recordings[name] for name in names], phases)
    return _unexplained(places, by_loss(places), len(evidence), p_value) if places else None


def misread(slips: Sequence[Aside], recordings: int, p_value: float) -> Shown | None:
    """What was left aside as no recording of what it states, where all else agrees; None if nothing was."""
    share = 1.0 / max(len(slips), 1)
    places = tuple(whole(slip.evidence, slip.signal, phases_of(slip.evidence), share) for slip in slips)
    said = " ".join(dict.fromkeys(slip.summary for slip in slips))
    return _unexplained(places, said, recordings, p_value) if slips else None


def agreeing_but(effects: Sequence[Named], recordings: int, p_value: float) -> str:
    """The sentence on recordings that agree with the simulation but for what they show by themselves."""
    return _otherwise(" ".join(e.statement for e in effects), recordings, _within(p_value))


def _unexplained(places: tuple[Place, ...], said: str, recordings: int, p_value: float) -> Shown:
    agree = _within(p_value) if p_value > SURE else "hardly differ"
    said = _otherwise(said, recordings, agree)
    return Shown(verdict="unexplained", effects=(), places=places, sentence=said, p_value=0.0)


def _otherwise(said: str, recordings: int, agree: str) -> str:
    return f"{said} Otherwise simulation and {recordings} recordings {agree}."


def _within(p_value: float) -> str:
    return f"agree within the noise (p = {p_value:.2g})"
