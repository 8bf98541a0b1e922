"""What recordings show by themselves, where simulation and recordings do not differ by more than noise and scatter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from rollover.diagnosis.data.dataset import Dataset
from rollover.diagnosis.data.inconsistent import Aside
from rollover.diagnosis.data.phases import Phases, phases_of, whole
from rollover.diagnosis.inference.clipping import clipped_channels
from rollover.diagnosis.inference.coarse_sampling import coarse, digit_sentence
from rollover.diagnosis.inference.lost_samples import loss_sentence, lost
from rollover.diagnosis.result import Named, Place, Verdict
from rollover.diagnosis.settings import SETTINGS
from rollover.recording import Recording


@dataclass(frozen=True, kw_only=True)
class RecordingFault:
    """A verdict on what recordings show by themselves: where, by which effects if any, in one sentence."""

    verdict: Verdict
    effects: tuple[Named, ...]
    places: tuple[Place, ...]
    sentence: str
    p_value: float

    def is_covered_by(self, channels: Iterable[str | None]) -> bool:
        """Whether all of some channels are among those that it shows."""
        return {p.channel for p in self.places}.issuperset(channels)


def intrinsic_faults(
    dataset: Sequence[Dataset], recordings: Mapping[str, Recording], phases: Phases, p_value: float
) -> RecordingFault | None:
    """What recordings show by themselves, that differ from their simulation with `p_value`; None if they are sound."""
    names = [e.name for e in dataset]
    if places := coarse(dataset, phases):  # in coarse steps any top is flat
        return _unexplained(places, digit_sentence(places, dataset), len(dataset), p_value)
    whole = [recordings[name] for name in names]
    effects, places = clipped_channels(names, whole, phases)
    if effects:
        said = agreement_but_for(effects, len(dataset), p_value)
        least = min(p_value, *(e.p_value for e in effects))
        return RecordingFault(verdict="sensor", effects=effects, places=places, sentence=said, p_value=least)
    return truncation_fault(dataset, recordings, phases, p_value)


def truncation_fault(
    dataset: Sequence[Dataset], recordings: Mapping[str, Recording], phases: Phases, p_value: float
) -> RecordingFault | None:
    """Where recordings break off again and again; None if they do not."""
    names = [e.name for e in dataset]
    places = lost(names, [recordings[name] for name in names], phases)
    return _unexplained(places, loss_sentence(places), len(dataset), p_value) if places else None


def misread(inconsistencies: Sequence[Aside], recordings: int, p_value: float) -> RecordingFault | None:
    """What was left aside as no recording of what it states, where all else agrees; None if nothing was."""
    share = 1.0 / max(len(inconsistencies), 1)
    places = tuple(
        whole(inconsistency.dataset, inconsistency.signal, phases_of(inconsistency.dataset), share)
        for inconsistency in inconsistencies
    )
    said = " ".join(dict.fromkeys(inconsistency.summary for inconsistency in inconsistencies))
    return _unexplained(places, said, recordings, p_value) if inconsistencies else None


def agreement_but_for(effects: Sequence[Named], recordings: int, p_value: float) -> str:
    """The sentence on recordings that agree with the simulation but for what they show by themselves."""
    return _otherwise(" ".join(e.statement for e in effects), recordings, _within(p_value))


def _unexplained(places: tuple[Place, ...], said: str, recordings: int, p_value: float) -> RecordingFault:
    agree = _within(p_value) if p_value > SETTINGS.inference.lack_of_fit.p_value else "hardly differ"
    said = _otherwise(said, recordings, agree)
    return RecordingFault(verdict="unexplained", effects=(), places=places, sentence=said, p_value=0.0)


def _otherwise(said: str, recordings: int, agree: str) -> str:
    return f"{said} Otherwise simulation and {recordings} recordings {agree}."


def _within(p_value: float) -> str:
    return f"agree within the noise (p = {p_value:.2g})"
