"""Effects by laws of the literature that are not those of the product: which there are, and a draw among them.

Every effect that acts by a law has at least three. A mass, a speed and a clock have no law to differ in. The law in
the docstring of a draw is what counts; sources are recalled, source not checked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from rollover.proof.foreign_ground import GROUND
from rollover.proof.foreign_sensors import SENSORS
from rollover.proof.foreign_soil import SOIL
from rollover.proof.foreign_striker import STRIKER
from rollover.proof.forms import Form
from rollover.proof.library import Change, Random, Setting

FORMS: dict[str, tuple[Form, ...]] = {**GROUND, **SOIL, **STRIKER, **SENSORS}


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A draw of one effect in one of its forms, each as likely as the others."""

    id: str

    def __call__(self, random: Random, setting: Setting) -> Change:
        """The effect at a random strength, by the form that fell."""
        forms = FORMS[self.id]
        return made(self.id, forms[int(random.integers(len(forms)))], random, setting)


def made(id: str, form: Form, random: Random, setting: Setting) -> Change:
    """The effect by this form at a random strength."""
    return replace(form.draw(random, setting, id), form=form.name, source=form.source)


EFFECTS: dict[str, Callable[[Random, Setting], Change]] = {id: Drawn(id=id) for id in FORMS}
