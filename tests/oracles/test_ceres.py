"""The trust-region loop against Ceres itself, iteration by iteration.

Residuals and Jacobians are ours in both; the loop, the damping, the linear solver (QR of the
whole Jacobian, no elimination) and the retraction (unit quaternions) are those of Ceres.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from support.dense import columns_of, dense_jacobian, dense_residual
from support.simulated import scene, trial
from vigauge.gauge.gauges import FixedGauge, FreeGauge, Gauge, PriorGauge
from vigauge.geometry import so3
from vigauge.model.evaluation import align_first_pose
from vigauge.model.problem import Problem
from vigauge.model.state import State
from vigauge.solver.levenberg_marquardt import Options, Solution, Status, solve
from vigauge.synthetic.scenario import perturbed

pyceres = pytest.importorskip("pyceres")
pytestmark = pytest.mark.oracle

GAUGES = [FixedGauge(), PriorGauge(1e5), FreeGauge()]
CONFIGURATIONS = [(shape, points) for shape in ("sine", "arc", "rec") for points in ("plane", "random")]


class Blocks:
    """The parameters as Ceres holds them: one array a vector, unit quaternions (w, x, y, z) for the
    rotations after the first, the rotation vector of Eq. (9) for the first."""

    def __init__(self, state: State) -> None:
        self.reference = state
        n = state.n_keyframes
        self.position = list(state.p_W.copy())
        self.rotation = [state.dphi_0.copy(), *so3.quaternion(state.R_WB[1:])]
        self.velocity = list(state.v_W.copy())
        self.landmark = list(state.X_W.copy())
        self.kinds = [("position", i) for i in range(n)] + [("rotation", i) for i in range(n)]
        self.kinds += [("velocity", i) for i in range(n)] + [("landmark", j) for j in range(len(state.X_W))]

    def all(self) -> list[np.ndarray]:
        return [*self.position, *self.rotation, *self.velocity, *self.landmark]

    def state(self, arrays: list[np.ndarray]) -> State:
        n = self.reference.n_keyframes
        dphi_0 = np.array(arrays[n])
        R_WB = np.empty((n, 3, 3))
        R_WB[0] = so3.exp(dphi_0) @ self.reference.R_WB0_ref
        R_WB[1:] = so3.from_quaternion(np.array(arrays[n + 1 : 2 * n]))
        return replace(
            self.reference,
            p_W=np.array(arrays[:n]),
            R_WB=R_WB,
            v_W=np.array(arrays[2 * n : 3 * n]),
            X_W=np.array(arrays[3 * n :]),
            dphi_0=dphi_0,
        )


def ambient(by_rotation: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(m, 4) derivative by a quaternion from the (m, 3) one by a left rotation increment.

    Ceres turns by delta to the left with half the angle: q' = (cos|d|, sin|d| d/|d|) q.
    """
    plus = np.vstack([-q[1:], q[0] * np.eye(3) - so3.hat(q[1:])])
    return 2.0 * by_rotation @ plus.T


class WholeCost(pyceres.CostFunction):
    """All residuals of a problem, and those of the gauge's prior, as one block."""

    def __init__(self, problem: Problem, gauge: Gauge, blocks: Blocks) -> None:
        super().__init__()
        self.problem, self.gauge, self.blocks = problem, gauge, blocks
        self.set_num_residuals(len(self.residual(problem.initial)))
        self.set_parameter_block_sizes([len(block) for block in blocks.all()])

    def residual(self, state: State) -> np.ndarray:
        prior = self.gauge.prior(state, self.problem.initial)
        extra = [] if prior is None else prior.residual
        return np.concatenate([dense_residual(self.problem, state), extra])

    def jacobian(self, state: State) -> np.ndarray:
        J = dense_jacobian(self.problem, state)
        prior = self.gauge.prior(state, self.problem.initial)
        if prior is None:
            return J
        extra = np.zeros((4, J.shape[1]))
        extra[:, prior.columns] = prior.jacobian
        return np.vstack([J, extra])

    def Evaluate(self, parameters, residuals, jacobians) -> bool:
        state = self.blocks.state(parameters)
        residuals[:] = self.residual(state)
        if jacobians is None:
            return True
        J = self.jacobian(state)
        for (kind, index), values, out in zip(self.blocks.kinds, parameters, jacobians, strict=True):
            if out is not None:
                part = J[:, columns_of(state, kind, index)]
                out[:] = (ambient(part, values) if len(values) == 4 else part).ravel()
        return True


class Recorder(pyceres.IterationCallback):
    def __init__(self) -> None:
        super().__init__()
        self.rows: list[tuple[float, float, bool]] = []

    def __call__(self, summary):
        self.rows.append((summary.cost, summary.trust_region_radius, summary.step_is_successful))
        return pyceres.CallbackReturnType.SOLVER_CONTINUE


@dataclass
class CeresSolution:
    converged: bool
    state: State
    cost: float
    iterations: int
    rows: list[tuple[float, float, bool]]


def solve_with_ceres(problem: Problem, gauge: Gauge, **changes: float) -> CeresSolution:
    """The same problem and gauge, solved by Ceres with its defaults but for the given options."""
    blocks = Blocks(problem.initial)
    arrays = blocks.all()
    ceres_problem = pyceres.Problem()
    cost_function = WholeCost(problem, gauge, blocks)
    ceres_problem.add_residual_block(cost_function, None, arrays)
    for q in blocks.rotation[1:]:
        ceres_problem.set_manifold(q, pyceres.QuaternionManifold())
    if len(gauge.held(problem.initial)):
        ceres_problem.set_parameter_block_constant(blocks.position[0])
        ceres_problem.set_manifold(blocks.rotation[0], pyceres.SubsetManifold(3, [2]))
    options = pyceres.SolverOptions()
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_QR
    options.logging_type = pyceres.LoggingType.SILENT
    options.num_threads = 1
    for name, value in changes.items():
        setattr(options, name, value)
    recorder = Recorder()
    options.callbacks = [recorder]
    summary = pyceres.SolverSummary()
    pyceres.solve(options, ceres_problem, summary)
    return CeresSolution(
        converged=summary.termination_type == pyceres.TerminationType.CONVERGENCE,
        state=blocks.state(arrays),
        cost=summary.final_cost,
        iterations=summary.num_successful_steps + summary.num_unsuccessful_steps,
        rows=recorder.rows,
    )


def assert_same_run(ours: Solution, ceres: CeresSolution, tolerance: float = 1e-6) -> None:
    """Same end, same count, and in every iteration the same radius, verdict and cost."""
    assert ours.converged == ceres.converged
    assert ours.iterations == ceres.iterations == len(ceres.rows)
    for row, (cost, radius, accepted) in zip(ours.trace, ceres.rows, strict=True):
        assert row.accepted == accepted
        assert row.radius == pytest.approx(radius, rel=tolerance)
        if accepted:
            assert row.cost == pytest.approx(cost, rel=tolerance)
    assert ours.cost == pytest.approx(ceres.cost, rel=tolerance)


def assert_same_state(ours: State, theirs: State, tolerance: float) -> None:
    assert np.abs(ours.p_W - theirs.p_W).max() < tolerance
    assert np.abs(so3.log(ours.R_WB @ theirs.R_WB.swapaxes(1, 2))).max() < tolerance
    assert np.abs(ours.v_W - theirs.v_W).max() < tolerance
    assert np.abs(ours.X_W - theirs.X_W).max() < 10.0 * tolerance


def test_jacobian_is_what_ceres_differentiates():
    """Catches an oracle that checks itself: Ceres' own quaternion tangent by differences."""
    problem = trial(n_landmarks=20)
    q = so3.quaternion(problem.initial.R_WB[2])
    steps = 1e-6 * np.eye(3)
    for axis in range(3):
        turned = so3.quaternion(so3.exp(2.0 * steps[axis]) @ so3.from_quaternion(q))
        assert np.allclose((turned - q) @ ambient(np.eye(3), q).T / 2.0, steps[axis], atol=1e-12)


@pytest.mark.parametrize("gauge", GAUGES, ids=lambda gauge: gauge.name)
@pytest.mark.parametrize(("shape", "points"), CONFIGURATIONS)
def test_same_run_as_ceres(shape, points, gauge):
    """Catches any difference of policy: scaling, damping, acceptance, radius, tolerances, counting."""
    for number in range(3):
        problem = trial(number, shape, points)
        ours, ceres = solve(problem, gauge), solve_with_ceres(problem, gauge)
        assert ours.converged
        assert_same_run(ours, ceres)
        assert_same_state(ours.state, ceres.state, 1e-6)


@pytest.mark.parametrize("weight", [0.0, 10.0, 100.0, 500.0, 5e3, 1e8])
def test_same_run_for_all_prior_weights(weight):
    """Catches a damping that is not Ceres': small weights are slow only against it (Fig. 5)."""
    problem = trial(1, "sine", "plane")
    gauge = PriorGauge(weight)
    ours, ceres = solve(problem, gauge), solve_with_ceres(problem, gauge)
    assert_same_run(ours, ceres, 1e-5)


@pytest.mark.parametrize("gauge", GAUGES, ids=lambda gauge: gauge.name)
def test_same_run_from_a_bad_start(gauge):
    """Catches the handling of rejected steps: from far away some steps are refused by both."""
    refused = 0
    for seed in range(3):
        world = scene("sine", "random")
        far = replace(
            world.settings,
            perturb_position_m=0.6,
            perturb_rotation_deg=18.0,
            perturb_velocity_mps=0.5,
            perturb_landmark_m=1.2,
        )
        start = perturbed(world.truth, far, np.random.default_rng(seed))
        problem = trial(0, "sine", "random").with_initial(start)
        ours, ceres = solve(problem, gauge), solve_with_ceres(problem, gauge)
        refused += sum(not row.accepted for row in ours.trace)
        assert_same_run(ours, ceres, 1e-4)
    assert refused > 0


@pytest.mark.parametrize("tolerance", [3e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("gauge", GAUGES, ids=lambda gauge: gauge.name)
def test_same_parameter_tolerance(gauge, tolerance):
    """Catches another norm of step or state than Ceres', which has quaternions in it: with the
    function tolerance off, both end by the size of the step, at the same iteration."""
    for number in range(3):
        problem = trial(number, "arc", "plane")
        options = Options(function_tolerance=0.0, parameter_tolerance=tolerance)
        ours = solve(problem, gauge, options)
        ceres = solve_with_ceres(problem, gauge, function_tolerance=0.0, parameter_tolerance=tolerance)
        assert ours.status is Status.PARAMETER_TOLERANCE
        assert_same_run(ours, ceres)


def test_all_gauges_of_ceres_end_on_our_orbit():
    """Catches estimates that differ by more than the gauge."""
    problem = trial(2, "arc", "random")
    free = solve(problem, FreeGauge()).state
    for gauge in GAUGES:
        aligned = align_first_pose(solve_with_ceres(problem, gauge).state, free)
        assert_same_state(aligned, free, 2e-3)
