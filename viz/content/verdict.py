"""The answer in words, for the first page of a recording: how high the loads were, and when. Markdown only."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ground.law import Domain
from rollover.assessment.ledger import closure
from rollover.assessment.stand_results import findings
from rollover.dynamics.result import Run
from rollover.spec.stand import TiltTable
from rollover.system.numbers import percent
from viz.content.differences import differences_lines
from viz.content.entities import series, shown


class Peak(Protocol):
    """Peak of one load, SI; what is unknown is None or NaN."""

    @property
    def channel(self) -> str:
        """Channel it is the peak of."""

    @property
    def unit(self) -> str:
        """SI unit of `raw` and `filtered`."""

    @property
    def raw(self) -> float:
        """Largest value as computed, with its sign."""

    @property
    def raw_time(self) -> float:
        """When, s."""

    @property
    def filtered(self) -> float | None:
        """Largest value after the filter."""

    @property
    def filtered_time(self) -> float | None:
        """When, s."""

    @property
    def cfc(self) -> int | None:
        """Filter class."""

    @property
    def impulse(self) -> float | None:
        """Momentum that collisions took on this path and no force history shows, N s."""

    @property
    def domain_flags(self) -> Sequence[str]:
        """Why the load lies outside the ground law's calibrated domain."""

    @property
    def half_step_change(self) -> float | None:
        """Relative change of the filtered peak with half the time step, 0.01 for one per cent."""


@dataclass(frozen=True, kw_only=True)
class RawPeak:
    """Peak read off a channel, where nobody gave a better one."""

    channel: str
    unit: str
    raw: float
    raw_time: float
    filtered: float | None = None
    filtered_time: float | None = None
    cfc: int | None = None
    impulse: float | None = None
    domain_flags: Sequence[str] = ()
    half_step_change: float | None = None


SMALL = 100.0  # N, below which a force is told in N and not in kN
_ALSO = ("rops/deflection", "ground/sinkage")


def ranked(run: Run, peaks: Sequence[Peak]) -> tuple[Peak, ...]:
    """The given peaks, or those of the channels if none are given; what an engineer asks for first comes first.

    Deflection and sinkage are always among them: they are no loads, but are asked for in the same breath.
    """
    given = {p.channel for p in peaks}
    found = [*peaks, *(p for p in _of_channels(run) if not given or p.channel in {*_ALSO} - given)]
    if run.tests:  # on a test stand the ground need not touch a ROPS, nor a device push
        found = [p for p in found if p.raw]
    order = (
        "device/force",
        "rops/force",
        "ground/force_normal",
        "rops/mount/",
        "rops/force_",
        "rops/",
        "ground/",
        "wheel/",
        "",
    )

    def place(peak: Peak) -> tuple[int, str]:
        same = next((i for i, p in enumerate(order) if peak.channel == p), None)
        begins = next(i for i, p in enumerate(order) if p not in order[:3] and peak.channel.startswith(p))
        return (begins if same is None else same, peak.channel)

    return tuple(sorted(found, key=place))


def _of_channels(run: Run) -> list[Peak]:
    found: list[Peak] = []
    for channel, values in run.recording.channels.items():
        unit = {"kN": "N", "mm": "m"}.get(series(channel).unit)
        # nothing but gaps and zeros is left out, unless it is the load that is asked for
        if unit is None or (channel != "rops/force" and not np.any(np.abs(values) > 0.0)):
            continue
        at = int(np.argmax(np.nan_to_num(np.abs(values))))
        found.append(RawPeak(channel=channel, unit=unit, raw=float(values[at]), raw_time=float(run.recording.time[at])))
    return found


def amount(value: float, unit: str, factor: float = 1.0) -> str:
    """A number for people, three figures and the unit: ``amount(63210.0, "kN", 1e-3) == "63.2 kN"``."""
    number = value * factor
    digits = max(0, 2 - math.floor(math.log10(abs(number)))) if number and math.isfinite(number) else 0
    text = f"{number:.{min(digits, 3)}f}" if digits < 5 else f"{number:.2g}"
    return f"{text} {unit}".rstrip()


def newtons(value: float) -> str:
    """A force, from N; a small one in N."""
    return amount(value, "N") if abs(value) < SMALL else amount(value, *shown("N"))


def joules(value: float) -> str:
    """An energy, from J; small ones in J, so that a residual does not read as zero."""
    return amount(value, "J") if abs(value) < 1e3 else amount(value, *shown("J"))


def high(peak: Peak, value: float) -> str:
    """A value of a load in the unit in which its channel is plotted."""
    s = series(peak.channel)
    if s.unit == "kN":
        return newtons(value)
    return amount(value, s.unit, s.factor) if s.unit else amount(value, *shown(peak.unit))


def raw(peak: Peak) -> str:
    """How high and when: ``63.2 kN at 1.362 s``."""
    if peak.raw == 0.0:
        return "none"
    return f"{high(peak, peak.raw)} at {peak.raw_time:.3f} s"


def filtered(peak: Peak) -> str:
    """The same after the filter; empty if it was not filtered."""
    if peak.filtered is None or peak.filtered_time is None or not known(peak.filtered) or not peak.raw:
        return ""
    return f"{high(peak, peak.filtered)} at {peak.filtered_time:.3f} s"


def known(value: float | None) -> bool:
    """Whether there is a number."""
    return value is not None and math.isfinite(value)


def title_of(peak: Peak) -> str:
    """Name of the load, as a heading begins."""
    name = series(peak.channel).name
    return name[:1].upper() + name[1:]


def verdict(run: Run, peaks: Sequence[Peak], scales: Sequence[str] = ()) -> str:
    """The first page: the load that matters and when, all peaks, what they are worth, the energy ledger."""
    found = ranked(run, peaks)
    lines = [*_headline(run, found), *differences_lines(run.scenario)]
    if found:
        lines += _table(found)
        lines += _domain(run, found)
    lines += _ledger(run)
    if run.status == "done":
        lines += [f"**{run.scenario.title}:** {run.sentence or 'done'}.", ""]
    if scales:
        lines += [f"**To read the picture:** {'; '.join(scales)}.", ""]
    lines += ["Numbers are taken from the channels, never from a plot."]
    return "\n".join(lines) + "\n"


def _headline(run: Run, found: Sequence[Peak]) -> list[str]:
    lines = []
    if run.status == "failed":
        lines += [f"# Run failed at {run.stop_time:.3f} s", "", f"**{run.sentence or 'no reason given'}**", ""]
        lines += ["What follows holds until then.", ""]
    if not found:
        return [*lines, "# No load was recorded", "", f"{run.scenario.title}.", ""]
    first, stand = found[0], findings(run.tests)
    if stand is not None and isinstance(run.scenario.initiation, TiltTable):
        return [*lines, f"# {stand.sentence}", ""]  # what turns there is the weight: no load answers the question
    lines += [f"# {title_of(first)}: {raw(first)}", ""]
    if not first.raw and "striker/position_z" in run.recording.channels:  # it never landed: how far it fell answers
        z, v = run.recording["striker/position_z"], run.recording["striker/velocity_z"]
        lines += [f"It fell from {z[0]:.4g} m to {z[-1]:.4g} m and ends at {v[-1]:.4g} m/s.", ""]
    if stand is not None:
        lines += [f"{stand.sentence}.", ""]
    worth = []
    if filtered(first):
        worth.append(f"CFC {first.cfc}: **{filtered(first)}**")
    count = len({*run.domain_flags, *(flag for p in found for flag in p.domain_flags)})
    if count:
        ways = f"outside the calibrated domain in {count} {'ways' if count > 1 else 'way'}"
        calibrated = "uncalibrated" not in run.domain_flags
        worth.append(f"{ways if calibrated else 'the ground law is not calibrated'}, see below")
    if worth:
        lines += ["; ".join(worth) + ".", ""]
    return lines


def _table(found: Sequence[Peak]) -> list[str]:
    classes = sorted({p.cfc for p in found if p.cfc is not None and known(p.filtered)})
    heading = "CFC " + "/".join(str(c) for c in classes) if classes else "filtered"
    columns = ["load", "raw peak"]
    shows_filtered = any(known(p.filtered) for p in found)
    shows_impulse = any(known(p.impulse) for p in found)
    shows_change = any(known(p.half_step_change) for p in found)
    columns += [heading] if shows_filtered else []
    columns += ["collision impulse"] if shows_impulse else []
    columns += ["change at half step"] if shows_change else []
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    for p in found:
        row = [title_of(p), raw(p)]
        if shows_filtered:
            row.append(filtered(p))
        if shows_impulse:
            row.append(amount(p.impulse, "N s") if p.impulse is not None and known(p.impulse) else "")
        if shows_change:
            change = p.half_step_change
            row.append(f"{100.0 * change:.1f} %" if change is not None and known(change) else "")
        lines.append("| " + " | ".join(row) + " |")
    return [*lines, ""]


def standing(flags: Collection[str]) -> str:
    """How a load stands to what the ground law was measured for, from its domain flags."""
    if "uncalibrated" in flags:
        deep = ", and its sinkage is beyond the law's range" if "deep-sinkage" in flags else ""
        return f"the ground law is not calibrated{deep}"
    return "outside the ground law's calibrated domain" if flags else "inside the calibrated domain"


def rests_on_ground(run: Run) -> bool:
    """Whether any element of the ground was touched: else its law took no part."""
    return bool(np.any(run.recording["ground/force_normal"] > 0.0)) or bool(run.domain_flags)


def _domain(run: Run, found: Sequence[Peak]) -> list[str]:
    """Domain flags in words, each with the loads it concerns."""
    concerned: dict[str, list[str]] = {flag: [] for flag in run.domain_flags}
    for p in found:
        for flag in p.domain_flags:
            concerned.setdefault(flag, []).append(title_of(p))
    if not concerned:
        if not rests_on_ground(run):
            return ["No element of the ground was touched: its law took no part.", ""]
        return ["All loads lie within the domain in which the ground law was calibrated.", ""]
    known = "uncalibrated" not in concerned
    heading = (
        "Outside the domain in which the ground law was calibrated" if known else "The ground law is not calibrated"
    )
    lines = [f"**{heading}:**", ""]
    flagged = [title_of(p) for p in found if p.domain_flags]
    for flag, loads in concerned.items():
        # naming all of them would say nothing
        where = f" ({', '.join(loads)})" if loads and loads != flagged else ""
        lines.append(f"- {in_words(flag, run.scenario.ground.law.domain)}{where}")
    return [*lines, ""]


def in_words(flag: str, domain: Domain) -> str:
    """A domain flag as a sentence, with the bound that was crossed."""
    words: Mapping[str, str] = {
        "impact-speed": f"impact speed outside {domain.speed_least:g} to {domain.speed_most:g} m/s",
        "momentum": f"momentum of the striking mass above {domain.momentum_most:.3g} N s",
        "contact-area": f"contact area unlike the tested face of {1e4 * domain.area:.3g} cm\N{SUPERSCRIPT TWO}",
        "second-hit": "a second hit on the same rut; virgin soil was tested",
        "oblique-impact": f"impact more than {math.degrees(domain.obliquity_most):.3g} deg off the ground's normal",
        "uncalibrated": "no measurement stands behind the ground law's numbers (calibration: null, no own domain)",
        "deep-sinkage": "sinkage beyond the range of the ground law"
        + (f", {1e3 * domain.sinkage_most:.3g} mm" if math.isfinite(domain.sinkage_most) else " in a patch"),
    }
    return words.get(flag, flag.replace("-", " "))


def _ledger(run: Run) -> list[str]:
    if not run.ledger:
        return []
    residual, closed = run.ledger.get("residual", math.nan), closure(run)
    share = abs(residual) / run.released if run.released > 0.0 else math.nan
    judged = f", {percent(share)} of the {joules(run.released)} released" if math.isfinite(closed.end) else ""
    names = [name for name, value in run.ledger.items() if name != "residual" and value]
    lines = [f"**Energy:** {joules(residual)} unaccounted for{judged}.", ""]
    if closed.is_wide:
        lines += [f"**\N{WARNING SIGN} {closed.warning[0].upper()}{closed.warning[1:]}.**", ""]
    elif closed.sentence:
        lines += [f"{closed.sentence}.", ""]
    lines += ["| " + " | ".join(names) + " |", "|" + "---|" * len(names)]
    return [*lines, "| " + " | ".join(joules(run.ledger[name]) for name in names) + " |", ""]
