"""A diagnosis in words: the answer in one line, names for people; the page and the recording say the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rollover.diagnosis import Diagnosis
from rollover.diagnosis.overlay import Overlay, Track
from rollover.diagnosis.settings import SETTINGS
from rollover.spec.channels import is_known
from viz.content.blocks import State
from viz.content.entities import series

STATES: Mapping[str, State] = {
    "no-mismatch": "pass",
    "parameter": "warn",
    "sensor": "warn",
    "missing-physics": "warn",
    "unexplained": "fail",
    "cannot-tell": "muted",
}
ANSWERS: Mapping[str, str] = {
    "no-mismatch": "Simulation and recordings agree within the noise.",
    "parameter": "A value of the scenario is wrong.",
    "sensor": "A sensor is faulty.",
    "missing-physics": "Physics is missing from the scenario.",
    "unexplained": "There is an unexplained residual: no candidate explains the mismatch.",
    "cannot-tell": "These recordings are too weak for a statement.",
}

TOLERATED = "Simulation and recordings differ by more than noise, but by no more than is tolerated."


def answer(found: Diagnosis) -> str:
    """The verdict in one line, with the names of what was found."""
    line = ANSWERS[found.verdict]
    if found.verdict == "no-mismatch" and found.p_value < SETTINGS.inference.lack_of_fit.p_value:
        return TOLERATED
    if not found.effects:
        return line
    return f"{line.removesuffix('.')}: {', and '.join(named(e.id, e.channel) for e in found.effects)}."


def named(id: str, channel: str | None) -> str:
    """An effect, with the channel of a sensor's."""
    return id if channel is None else f"{id} of {channel}"


def label_of(quantity: str) -> str:
    """What a residual may depend on, for people."""
    words = {
        "striker/velocity_z": "speed",
        "striker/acceleration_z": "acceleration",
        "ground/sinkage": "depth",
        "time": "time",
    }
    return words.get(quantity, series(quantity).name if is_known(quantity) else quantity)


def predicted_as(found: Diagnosis, recording: str) -> str:
    """Whether what is left of a recording was left out of the fit that says it."""
    return "held out" if recording in found.held_out else "fitted"


def markdown(found: Diagnosis) -> str:
    """The answer as a document: verdict, parameters, where, what to measure next."""
    lines = [f"# {answer(found)}", "", found.sentence, ""]
    for e in found.effects:
        lines += [f"## {named(e.id, e.channel)}", "", "| parameter | value | 95 % from | to | unit |", "|-|-|-|-|-|"]
        for name, i in e.parameters.items():
            lines.append(f"| {name} | {i.value:.4g} | {i.low:.4g} | {i.high:.4g} | {i.unit} |")
        lines.append("")
        if e.indistinguishable_from:
            lines += [f"Not distinguishable from {', '.join(e.indistinguishable_from)}.", ""]
            lines += [f"Measure next: {e.discriminating_test}.", ""] if e.discriminating_test else []
            lines += [f"Judging by these recordings, {e.next_test.message()}.", ""] if e.next_test is not None else []
    if found.where:
        lines += ["## Where", "", "| recording | channel | phase | share |", "|-|-|-|-|"]
        lines += [f"| {p.recording} | {p.channel} | {p.phase} | {100.0 * p.share:.0f} % |" for p in found.where[:6]]
        lines.append("")
    if found.per_recording:
        lines += ["## Misfit over the noise", "", "| recording | predicted as | before | after |", "|-|-|-|-|"]
        lines += [f"| {name} | {predicted_as(found, name)} | {a:.3g} | {b:.3g} |" for name, a, b in found.per_recording]
        lines.append("")
    lines += [f"- {note}" for note in found.notes]
    return "\n".join(lines)


def ranked(found: Diagnosis, overlays: Sequence[Overlay]) -> list[tuple[Overlay, list[Track]]]:
    """Recordings and their channels by share of the misfit, the largest first; where there is none, as they came."""
    share: dict[tuple[str, str], float] = {}
    for p in found.where:
        share[p.recording, p.channel] = share.get((p.recording, p.channel), 0.0) + p.share

    def tracks(one: Overlay) -> list[Track]:
        return sorted(one.tracks, key=lambda t: -share.get((one.recording, t.channel), 0.0))

    total = {t.recording: sum(s for (name, _), s in share.items() if name == t.recording) for t in overlays}
    return [(one, tracks(one)) for one in sorted(overlays, key=lambda t: -total[t.recording])]
