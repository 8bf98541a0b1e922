"""The drop-test striker of Ye 2006, Fig. 5, that the laws' forces are per."""

from __future__ import annotations

REFERENCE_WIDTH = 0.045  # m, the shorter side of its face
REFERENCE_AREA = 0.140 * REFERENCE_WIDTH  # m2, of its face
REFERENCE_MASS = 132.0  # kg
