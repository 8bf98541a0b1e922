"""Concealed overturns for the blind proof: what is independent of the diagnosis, and what is not.

Independent: every effect is written into the scenario as numbers (a yield force, a tyre, a surface), never switched on
as the effect of the same name, with the exception below; sensors' faults, filters and noise are the proof's own. The
overturn is solved in shorter steps with another damping of generalised-alpha, on a finer grid of elements that lies
elsewhere, with contact points nearer to each other: where contacts are many, that alone makes another overturn.

Not independent: equations of motion, laws of soil, tyre and joint are the project's own, and so are the terms of a
load that slides, a liquid that sloshes, a spinning rotor, a layer and the air. For those the proof shows that the
diagnosis finds what is there, not that the term is right; the drops are made by a solver of their own.
"""
