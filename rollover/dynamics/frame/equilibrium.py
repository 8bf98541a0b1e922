"""Internal forces and stiffness of a meshed frame on its supports, with the memory of its fibres.

Elements are Euler beams of cubic shape with fibre sections at both ends and in the middle (Simpson). With the chord's
turn in the axial strain (von Karman),

    e = (u_2 - u_1)/L + ((v_2 - v_1)^2 + (w_2 - w_1)^2)/(2 L^2),   fibre strain e - p v'' - r w'',

so that a load that leans with the frame is taken at its lean. Torsion yields by itself at T_pl; shear deflection and
the interaction of torsion with bending are left out. In a step that takes a time, what has a rate factor yields
higher; of torsion the rate of strain is that which does the same work at f_y all over the section, T_pl t'/(f_y A).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve_banded
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

from rollover.dynamics.frame.fibres import Law, fibres
from rollover.dynamics.frame.mesh import Mesh
from rollover.spec.connector import Connector

Array = NDArray[np.float64]
STATIONS = np.array([0.0, 0.5, 1.0])
WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0


@dataclass(frozen=True, kw_only=True)
class Support:
    """A node that is held: by a spring on each axis of a connector, or clamped where there is none."""

    name: str
    node: int
    connector: Connector | None = None


@dataclass(frozen=True, kw_only=True)
class Memory:
    """Laws of fibres (m, 3, n), of torsion (m,) and of supports (k, 6), with what is plastic of each."""

    fibre: Law
    torsion: Law
    support: Law


@dataclass(frozen=True, kw_only=True)
class Tried:
    """What a deflection gives: forces on the nodes (d,), stiffness band, section forces, greatest strains, memory left.

    `sections` (m, 3, 3) are N, M along depth, M along width at each station; `twist` (m,) is T; `strain` (m, 3).
    """

    force: Array
    band: Array
    sections: Array
    twist: Array
    strain: Array
    memory: Memory


class Frame:
    """A mesh on its supports; says what a deflection costs, and remembers nothing."""

    def __init__(self, mesh: Mesh, supports: Sequence[Support]) -> None:
        self.mesh = mesh
        self.springs = [s for s in supports if s.connector is not None]
        m = len(mesh.ends)
        self.L = mesh.length
        turn = mesh.axes
        self.T = np.zeros((m, 12, 12))
        for k in range(4):
            self.T[:, 3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = turn
        self.dofs = (6 * mesh.ends[:, :, None] + np.arange(6)).reshape(m, 12)
        self._order(supports)
        self._fibres()
        self._shapes()

    def _order(self, supports: Sequence[Support]) -> None:
        """Free displacements in an order in which the stiffness is a narrow band, and where each element's goes."""
        size, ends = 6 * len(self.mesh.nodes), self.mesh.ends
        graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(size // 6, size // 6))
        nodes = reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True)
        held = [6 * s.node + k for s in supports if s.connector is None for k in range(6)]
        order = (6 * nodes[:, None] + np.arange(6)).ravel()
        self.free = order[~np.isin(order, held)]
        place = np.full(size, -1)
        place[self.free] = np.arange(len(self.free))
        springs = [6 * s.node + np.arange(6) for s in self.springs]
        dofs = [self.dofs.repeat(12, axis=1).ravel(), np.tile(self.dofs, (1, 12)).ravel()]
        row, column = (place[np.concatenate([d, *springs])] for d in dofs)
        self.kept = (row >= 0) & (column >= 0)
        row, column = row[self.kept], column[self.kept]
        self.half = int(np.abs(row - column).max())
        self.slot = (self.half + row - column) * len(self.free) + column

    def solved(self, band: Array, right: Array) -> Array:
        """Displacements (free, k) under forces (free, k). Raises ``ArithmeticError`` where nothing holds the frame."""
        try:
            found = solve_banded((self.half, self.half), band, right, overwrite_b=True, check_finite=False)
        except LinAlgError:
            raise ArithmeticError("nothing holds a part of the frame: a joint or mount leaves it free") from None
        if not np.isfinite(found).all():
            raise ArithmeticError("no balance beyond here: the frame collapses")
        return np.asarray(found)

    def _fibres(self) -> None:
        beams, owner = self.mesh.beams, self.mesh.beam
        each = [fibres(b.section) for b in beams]
        most = max(len(p) for p, _, _ in each)
        padded = [[np.pad(x, (0, most - len(x))) for x in group] for group in each]
        self.p, self.r, self.area = (np.array([g[k] for g in padded])[owner] for k in range(3))
        self.D = np.stack([np.ones_like(self.p), -self.p, -self.r], axis=-1)  # (m, n, 3)
        self.AD = self.area[:, :, None] * self.D
        self.ADD = (self.AD[:, :, :, None] * self.D[:, :, None, :]).reshape(*self.p.shape, 9)
        E, fy, tangent, G, J, twist, A, D, q = (
            np.array(x, dtype=float)[owner]
            for x in zip(
                *(
                    (
                        b.material.youngs_modulus,
                        b.material.yield_strength,
                        b.material.tangent,
                        b.material.shear_modulus,
                        b.section.properties.torsion,
                        b.plastic_resistance[3],
                        b.section.properties.area,
                        b.material.rate_factor.rate if b.material.rate_factor is not None else 0.0,
                        b.material.rate_factor.exponent if b.material.rate_factor is not None else 1.0,
                    )
                    for b in beams
                ),
                strict=True,
            )
        )
        m, n = self.p.shape
        wide = (slice(None), None, None)
        fibre = Law.of(E[wide], fy[wide], (tangent / E)[wide], (m, 3, n), D[wide], q[wide])
        torsion = Law.of(G * J, twist, tangent / E, (m,), D * fy * A / twist, q)
        springs = [s.connector.row for s in self.springs if s.connector is not None]
        table = np.array(springs).reshape(-1, 37)
        k, limit, H = table[:, 0:6], table[:, 12:18], table[:, 18:24]
        ratio = np.divide(H, k + H, out=np.zeros_like(H), where=k + H > 0.0)
        support = Law.of(k, limit, ratio, k.shape, table[:, 30:36], table[:, 36:])
        self.start = Memory(fibre=fibre, torsion=torsion, support=support)

    def _shapes(self) -> None:
        """Strain of the axis and both curvatures at each station by the element's own displacements, (m, 3, 3, 12)."""
        L, x = self.L[:, None], STATIONS[None]
        B = np.zeros((len(self.L), 3, 3, 12))
        B[:, :, 0, 0], B[:, :, 0, 6] = -1.0 / L, 1.0 / L
        bend = (-6.0 + 12.0 * x) / L**2, (-4.0 + 6.0 * x) / L, (6.0 - 12.0 * x) / L**2, (-2.0 + 6.0 * x) / L
        for k, (v, turn, sign) in enumerate(((1, 5, 1.0), (2, 4, -1.0)), start=1):
            B[:, :, k, v], B[:, :, k, turn] = bend[0], sign * bend[1]
            B[:, :, k, 6 + v], B[:, :, k, 6 + turn] = bend[2], sign * bend[3]
        self.B = B
        self.way = np.zeros((2, 12))
        for k, v in enumerate((1, 2)):
            self.way[k, v], self.way[k, 6 + v] = -1.0, 1.0

    def tried(self, u: Array, memory: Memory, h: float = np.inf) -> Tried:
        """Forces and stiffness at the displacements `u` (6 n,), `h` (s) after what is plastic in `memory`."""
        own = np.einsum("mij,mj->mi", self.T, u[self.dofs])
        L = self.L
        chord = np.einsum("ki,mi->mk", self.way, own) / L[:, None]
        B = self.B.copy()
        B[:, :, 0] += (np.einsum("mk,ki->mi", chord, self.way) / L[:, None])[:, None]
        strains = np.einsum("msci,mi->msc", self.B, own)
        strains[:, :, 0] += 0.5 * np.sum(chord**2, axis=1)[:, None]
        fibre = strains @ self.D.transpose(0, 2, 1)
        stress, slope, plastic = memory.fibre.tried(fibre, h)
        sections = stress @ self.AD
        m = len(L)
        stiff = (slope @ self.ADD).reshape(m, 3, 3, 3)
        weight = WEIGHTS[None] * L[:, None]
        whole_B = B.reshape(m, 9, 12)
        force = np.einsum("mci,mc->mi", whole_B, (weight[:, :, None] * sections).reshape(m, 9))
        K = whole_B.transpose(0, 2, 1) @ ((weight[:, :, None, None] * stiff) @ B).reshape(m, 9, 12)
        axial = np.einsum("s,ms->m", WEIGHTS, sections[:, :, 0])
        K += np.einsum("m,ki,kj->mij", axial / L, self.way, self.way)
        twist, twists, twisted = memory.torsion.tried((own[:, 9] - own[:, 3]) / L, h)
        force[:, 3] -= twist
        force[:, 9] += twist
        for i, j, sign in ((3, 3, 1.0), (9, 9, 1.0), (3, 9, -1.0), (9, 3, -1.0)):
            K[:, i, j] += sign * twists / L
        whole = np.zeros(len(u))
        np.add.at(whole, self.dofs, np.einsum("mji,mj->mi", self.T, force))
        K = self.T.transpose(0, 2, 1) @ K @ self.T
        held, held_slope, held_plastic = memory.support.tried(self._at_supports(u), h)
        for spring, f in zip(self.springs, held, strict=True):
            whole[6 * spring.node : 6 * spring.node + 6] += f
        values = np.concatenate([K.ravel(), held_slope.ravel()])[self.kept]
        count = (2 * self.half + 1) * len(self.free)
        band = np.asarray(np.bincount(self.slot, weights=values, minlength=count), dtype=float)
        band = band.reshape(-1, len(self.free))
        left = replace(
            memory,
            fibre=memory.fibre.left(plastic),
            torsion=memory.torsion.left(twisted),
            support=memory.support.left(held_plastic),
        )
        used = self.area[:, None, :] > 0.0
        strain = np.abs(np.where(used, fibre, 0.0)).max(axis=2)
        return Tried(force=whole, band=band, sections=sections, twist=twist, strain=strain, memory=left)

    def _at_supports(self, u: Array) -> Array:
        return np.array([u[6 * s.node : 6 * s.node + 6] for s in self.springs]).reshape(-1, 6)

    def pattern(self, nodes: Mapping[int, float], direction: Sequence[float]) -> Array:
        """A load of 1 N along a direction, by shares of nodes, (6 n,); its product with u is the way that it goes."""
        c = np.zeros(6 * len(self.mesh.nodes))
        for node, share in nodes.items():
            c[6 * node : 6 * node + 3] += share * np.asarray(direction, dtype=float)
        return c
