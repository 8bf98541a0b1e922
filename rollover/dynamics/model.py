"""Scenario -> Exudyn system: bodies, pivot or guide, gravity; everything else enters as one generalised force.

The kernels' forces and the co-moving masses of the elements reach the solver through one ObjectGenericODE2 that
shares the bodies' nodes. The generalised-alpha solver evaluates them several times within a step; the contact set
and all memory are frozen meanwhile and move on once, after the step.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rollover.dynamics import interrupts
from rollover.dynamics.bodies import Body
from rollover.dynamics.placement import Start
from rollover.dynamics.recorder import Live
from rollover.dynamics.setup import Hinge
from rollover.kernels.forces import added_mass, generalised_forces
from rollover.kernels.jacobian import stiffness
from rollover.kernels.tables import ACTIVE, PIVOT, Tables
from rollover.spec.frames import matrices

os.environ.setdefault("EXUDYN_NO_USER_SETTINGS", "1")  # a user's settings file must not change results

import exudyn as exu
from exudyn.itemInterface import (
    GenericJoint,
    LoadMassProportional,
    MarkerBodyMass,
    MarkerBodyRigid,
    NodeGenericODE2,
    NodeRigidBodyRotVecLG,
    ObjectGenericODE2,
    ObjectGround,
    ObjectRigidBody,
)

exu.config.printToConsole = False
exu.config.suppressWarnings = True


@dataclass
class _Shared:
    """What the callbacks share."""

    time: float = 0.0  # of the last accepted step
    tried: float = 0.0  # time at which forces were last tried
    error: BaseException | None = None


def solve(
    *,
    bodies: tuple[Body, ...],
    live: Live,
    start: Start,
    gravity: float,
    step: float,
    steps: int,
    spectral_radius: float,
    held: tuple[int, ...] = (),
    hinges: tuple[Hinge, ...] = (),
    after_step: Callable[[float, Any, Any, Any], bool],
) -> str:
    """Run the time loop; returns "" or why the solver gave up.

    `after_step(time, q, qd, qdd)` is called once for the start and after each accepted step with views on the
    state, which it may write; False ends the run. Its exceptions are raised here.
    """
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    nodes, handles = [], []
    for b, body in enumerate(bodies):
        node = mbs.AddNode(
            NodeRigidBodyRotVecLG(
                referenceCoordinates=[0.0] * 6,
                initialCoordinates=start.q[6 * b : 6 * b + 6].tolist(),
                initialVelocities=start.qd[6 * b : 6 * b + 6].tolist(),
            )
        )
        J = live.tables.mass[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6]  # without wheels that turn
        inertia = [J[0, 0], J[1, 1], J[2, 2], J[1, 2], J[0, 2], J[0, 1]]
        handle = mbs.AddObject(ObjectRigidBody(mass=body.inertia.mass, inertia=inertia, nodeNumber=node))
        marker = mbs.AddMarker(MarkerBodyMass(bodyNumber=handle))
        mbs.AddLoad(LoadMassProportional(markerNumber=marker, loadVector=[0.0, 0.0, -gravity]))
        nodes.append(node)
        handles.append(handle)
    _add_joints(mbs, live.tables, handles, start)
    _add_stand(mbs, handles, start, held, hinges)

    n = len(live.tables.spin_mass)
    if turning := n - 6 * len(bodies):
        spins = start.qd[-turning:].tolist()
        angles = [0.0] * turning
        nodes.append(
            mbs.AddNode(
                NodeGenericODE2(
                    numberOfODE2Coordinates=turning,
                    referenceCoordinates=angles,
                    initialCoordinates=angles,
                    initialCoordinates_t=spins,
                )
            )
        )
    Q, M, K = np.zeros(n), live.tables.spin_mass.copy(), np.zeros((n, n))
    added = exu.MatrixContainer()
    added.SetWithDenseMatrix(M, useDenseMatrix=True)
    newton = exu.MatrixContainer()
    newton.SetWithDenseMatrix(M, useDenseMatrix=True)
    views: list[Any] = []
    shared = _Shared()

    clock, zero = live.tables.clock, start.time

    def force(_mbs: Any, t: float, _item: int, _q: Any, _qd: Any) -> list[float]:
        if t < shared.tried:
            clock[2] += 1.0  # Newton's iteration failed: once more, with half the step
        shared.tried = t
        clock[0], clock[1] = t - shared.time, zero + t
        generalised_forces(live.handle, views[0], views[1], Q)
        return Q.tolist()

    def mass(_mbs: Any, _t: float, _item: int, _q: Any, _qd: Any) -> Any:
        return added

    def jacobian(_mbs: Any, _t: float, _item: int, _q: Any, _qd: Any, fq: float, fqd: float) -> Any:
        stiffness(live.handle, fq, fqd, K)
        newton.SetWithDenseMatrix(K, useDenseMatrix=True)
        return newton

    def after(_mbs: Any, t: float) -> bool:
        if waiting:
            return False
        try:
            goes_on = after_step(t, views[0], views[1], views[2])
            shared.time, clock[2] = t, 0.0
            # like the contact set, the soil's mass matrix is that of the step's start
            if live.tables.counts[ACTIVE] > 0 or M.any():
                added_mass(live.handle, views[0], M)
                added.SetWithDenseMatrix(M, useDenseMatrix=True)
            return goes_on
        except BaseException as error:
            shared.error = error
            return False

    mbs.AddObject(
        ObjectGenericODE2(
            nodeNumbers=nodes,
            massMatrix=np.zeros((n, n)),
            forceUserFunction=force,
            massMatrixUserFunction=mass,
            jacobianUserFunction=jacobian,
        )
    )
    mbs.SetPostStepUserFunction(after)
    mbs.Assemble()
    data = mbs.systemData
    # views, fetched once: their addresses stay; the joints have no coordinates of this kind
    views += [data.GetODE2Coordinates(copy=False), data.GetODE2Coordinates_t(copy=False)]
    views += [data.GetODE2Coordinates_tt(copy=False)]

    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.startTime = 0.0
    settings.timeIntegration.endTime = steps * step
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.newton.relativeTolerance = 1e-5
    settings.timeIntegration.newton.absoluteTolerance = 1e-5
    # contacts come and go with every step: one new Jacobian a step halves the iterations
    settings.timeIntegration.newton.modifiedNewtonJacUpdatePerStep = True
    settings.timeIntegration.generalizedAlpha.lieGroupAddTangentOperator = False  # only speeds up Newton on large turns
    settings.timeIntegration.generalizedAlpha.spectralRadius = spectral_radius
    settings.solution.file.write = False
    settings.linearSolver.solverType = exu.LinearSolverType.EigenDense  # at some twenty coordinates
    failure = ""
    try:
        with interrupts.held() as waiting:
            mbs.SolveDynamic(
                settings, solverType=exu.DynamicSolverType.GeneralizedAlpha, showHints=False, storeSolver=False
            )
    except (ValueError, RuntimeError) as error:  # what exudyn's own errors derive from
        said = " ".join(str(error).split())[:300]
        failure = "Newton's iteration does not converge, even at a shorter step" if "terminated" in said else said
    finally:
        # callbacks hold mbs and mbs holds them: without this every run would leak
        mbs.SetPostStepUserFunction(0)  # type: ignore[arg-type]
        views.clear()
        mbs.Reset()
        container.Reset()
    if shared.error is not None:
        raise shared.error
    return failure


def _add_joints(mbs: Any, t: Tables, handles: list[int], start: Start) -> None:
    for j in range(len(t.joint_i)):
        kind, a, b = (int(k) for k in t.joint_i[j])
        if kind == PIVOT:
            markers = [
                mbs.AddMarker(MarkerBodyRigid(bodyNumber=handles[body], localPosition=t.joint_f[j, k : k + 3].tolist()))
                for body, k in ((a, 0), (b, 3))
            ]
            mbs.AddObject(GenericJoint(markerNumbers=markers, constrainedAxes=[1, 1, 1, 0, 1, 1]))
        else:
            ground = mbs.AddObject(ObjectGround(referencePosition=start.q[6 * a : 6 * a + 3].tolist()))
            markers = [
                mbs.AddMarker(MarkerBodyRigid(bodyNumber=body, localPosition=[0.0, 0.0, 0.0]))
                for body in (ground, handles[a])
            ]
            mbs.AddObject(GenericJoint(markerNumbers=markers, constrainedAxes=[1, 1, 0, 1, 1, 1]))


def _add_stand(mbs: Any, handles: list[int], start: Start, held: tuple[int, ...], hinges: tuple[Hinge, ...]) -> None:
    """Bodies that a test stand holds as they stand, and those that turn about an axis of it."""
    for b in held:
        place, R = start.q[6 * b : 6 * b + 3], matrices(start.q[None, 6 * b + 3 : 6 * b + 6])[0]
        ground = mbs.AddObject(ObjectGround(referencePosition=place.tolist()))
        markers = [mbs.AddMarker(MarkerBodyRigid(bodyNumber=body)) for body in (ground, handles[b])]
        mbs.AddObject(GenericJoint(markerNumbers=markers, constrainedAxes=[1] * 6, rotationMarker0=R))
    for hinge in hinges:
        at = 6 * hinge.body
        R = matrices(start.q[None, at + 3 : at + 6])[0]
        pivot = start.q[at : at + 3] + R @ np.array(hinge.point)
        ground = mbs.AddObject(ObjectGround(referencePosition=pivot.tolist()))
        markers = [
            mbs.AddMarker(MarkerBodyRigid(bodyNumber=ground)),
            mbs.AddMarker(MarkerBodyRigid(bodyNumber=handles[hinge.body], localPosition=list(hinge.point))),
        ]
        free = [1, 1, 1, 1, 1, 1]
        free[3 + hinge.axis] = 0
        mbs.AddObject(GenericJoint(markerNumbers=markers, constrainedAxes=free))
