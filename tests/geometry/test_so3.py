"""SO(3): group axioms, inverses, and Jacobians against exact series on both sides of the threshold."""

from fractions import Fraction
from math import factorial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.derivatives import central_differences, row_error
from vigauge.geometry import so3

component = st.floats(-1.0, 1.0)
# Angles where implementations break: zero, below and above the series threshold, and pi.
SPECIAL = (0.0, 1e-12, 1e-8, 1e-4, 0.05, so3.SERIES_ANGLE * (1 - 1e-9), so3.SERIES_ANGLE * (1 + 1e-9), 1.0)
NEAR_PI = (np.pi - 1e-3, np.pi - 1e-7, np.pi - 1e-12, np.pi)
angle = st.sampled_from(SPECIAL) | st.floats(0.0, np.pi - 1e-3)


@st.composite
def rotation_vectors(draw, angles=angle):
    """Rotation vectors of any axis, at ordinary and at special angles."""
    axis = np.array([draw(component), draw(component), draw(component)])
    length = np.linalg.norm(axis)
    axis = axis / length if length > 1e-3 else np.array([0.0, 0.6, 0.8])
    return draw(angles) * axis


def exact_series(phi: np.ndarray, coefficient, terms: int = 34) -> np.ndarray:
    """Sum of coefficient(n) hat(phi)^n in rational arithmetic, rounded once at the end."""
    x, y, z = (Fraction(float(value)) for value in phi)
    zero = Fraction(0)
    hat = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    power = [[Fraction(int(i == j)) for j in range(3)] for i in range(3)]
    total = [[zero] * 3 for _ in range(3)]
    for n in range(terms):
        c = coefficient(n)
        total = [[total[i][j] + c * power[i][j] for j in range(3)] for i in range(3)]
        power = [[sum(power[i][k] * hat[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
        # Digits far below double precision only cost time.
        power = [[entry.limit_denominator(10**40) for entry in row] for row in power]
    return np.array([[float(entry) for entry in row] for row in total])


@given(rotation_vectors())
def test_exp_gives_rotations(phi):
    """Catches a coefficient that leaves SO(3): not orthogonal, or a reflection."""
    R = so3.exp(phi)
    assert np.abs(R @ R.T - np.eye(3)).max() < 5e-15
    assert np.linalg.det(R) == pytest.approx(1.0, abs=5e-15)


@given(rotation_vectors(), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_exp_is_a_one_parameter_group(phi, a, b):
    """Catches a wrong sign or angle: Exp(a phi) Exp(b phi) = Exp((a + b) phi), inverse Exp(-phi)."""
    assert np.abs(so3.exp(a * phi) @ so3.exp(b * phi) - so3.exp((a + b) * phi)).max() < 2e-14
    assert np.abs(so3.exp(-phi) - so3.exp(phi).T).max() < 5e-15


@given(rotation_vectors(), rotation_vectors())
def test_adjoint(phi, psi):
    """Catches left and right mixed up: R Exp(phi) R^T = Exp(R phi)."""
    R = so3.exp(psi)
    assert np.abs(R @ so3.exp(phi) @ R.T - so3.exp(R @ phi)).max() < 1e-14


def test_hat_is_the_cross_product():
    """Catches a transposed hat: hat(a) b = a x b."""
    a, b = np.random.default_rng(1).normal(size=(2, 20, 3))
    assert np.allclose(np.einsum("mij,mj->mi", so3.hat(a), b), np.cross(a, b), rtol=0, atol=1e-15)


@given(rotation_vectors())
def test_log_undoes_exp(phi):
    """Catches lost digits of Log near zero and a wrong branch elsewhere."""
    assert np.linalg.norm(so3.log(so3.exp(phi)) - phi) <= 4e-15 + 4e-15 * np.linalg.norm(phi)


@given(rotation_vectors(st.sampled_from(NEAR_PI) | st.floats(np.pi - 1e-3, np.pi)))
def test_exp_undoes_log_near_pi(phi):
    """Catches the singularity of the trace formula at pi; there the axis has two signs."""
    R = so3.exp(phi)
    recovered = so3.log(R)
    assert np.linalg.norm(recovered) <= np.pi + 1e-15
    assert np.abs(so3.exp(recovered) - R).max() < 5e-15


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), -np.eye(3)]))
def test_half_turn_about_an_axis(axis):
    """Catches a division by zero where three quaternion components vanish."""
    assert np.allclose(np.abs(so3.log(so3.exp(np.pi * axis))), np.pi * np.abs(axis), atol=1e-15)


@given(rotation_vectors(angle | st.sampled_from(NEAR_PI)))
def test_quaternion_round_trip(phi):
    """Catches a wrong component order, a non-unit quaternion, or the negative hemisphere."""
    R = so3.exp(phi)
    q = so3.quaternion(R)
    half = 0.5 * np.linalg.norm(phi)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
    assert q[0] >= 0.0
    assert q[0] == pytest.approx(np.cos(half), abs=1e-15)
    assert np.abs(so3.from_quaternion(q) - R).max() < 5e-15


def test_quaternion_follows_hamilton():
    """Catches the other quaternion convention: (w, x, y, z) of a quarter turn about z."""
    root = np.sqrt(0.5)
    assert np.allclose(so3.quaternion(so3.exp([0.0, 0.0, np.pi / 2])), [root, 0.0, 0.0, root])
    assert np.allclose(so3.from_quaternion(np.array([root, 0.0, 0.0, root])) @ [1, 0, 0], [0, 1, 0])


@given(rotation_vectors(angle | st.sampled_from(NEAR_PI)))
def test_left_jacobian_inverse(phi):
    """Catches an inverse that belongs to the other side, or to another angle."""
    assert np.abs(so3.left_jacobian(phi) @ so3.left_jacobian_inverse(phi) - np.eye(3)).max() < 1e-14
    assert np.abs(so3.right_jacobian(phi) @ so3.right_jacobian_inverse(phi) - np.eye(3)).max() < 1e-14


@given(rotation_vectors())
def test_left_and_right_jacobian_are_related(phi):
    """Catches the sign of the right Jacobian: J_l = R J_r."""
    assert np.abs(so3.left_jacobian(phi) - so3.exp(phi) @ so3.right_jacobian(phi)).max() < 1e-14


@pytest.mark.parametrize("size", [*SPECIAL, 0.15, 0.29, 0.31, 2.0, *NEAR_PI])
def test_exp_and_jacobians_against_exact_series(size):
    """Catches a short series or a cancelling closed form: 15 digits on both sides of the threshold."""
    phi = size * np.array([2.0, -1.0, 2.0]) / 3.0
    assert np.abs(so3.exp(phi) - exact_series(phi, lambda n: Fraction(1, factorial(n)))).max() < 2e-15
    J = exact_series(phi, lambda n: Fraction(1, factorial(n + 1)))
    assert np.abs(so3.left_jacobian(phi) - J).max() < 2e-15
    assert np.abs(so3.left_jacobian_inverse(phi) - np.linalg.inv(J)).max() < 5e-15


@pytest.mark.parametrize("function", [so3._cubic_coefficient, so3._inverse_coefficient])
def test_nothing_jumps_at_the_series_threshold(function):
    """Catches two branches that differ: there the optimiser would see a step in its Jacobian."""
    below, above = (so3.SERIES_ANGLE * np.array([1 - 1e-12, 1 + 1e-12])) ** 2
    assert abs(function(above) / function(below) - 1.0) < 2e-12


@given(rotation_vectors())
def test_jacobians_are_the_derivatives(phi):
    """Catches a Jacobian that is exact algebra for the wrong thing: compared with differences of Exp."""
    R = so3.exp(phi)
    left = central_differences(lambda d: so3.log(so3.exp(phi + d) @ R.T), 3)
    right = central_differences(lambda d: so3.log(R.T @ so3.exp(phi + d)), 3)
    assert row_error(so3.left_jacobian(phi), left) < 1e-10
    assert row_error(so3.right_jacobian(phi), right) < 1e-10


def test_batches_are_rows():
    """Catches broadcasting over the wrong axis: a batch of any shape is the single result, stacked."""
    phi = np.random.default_rng(2).normal(size=(2, 5, 3))
    for function in (so3.exp, so3.hat, so3.left_jacobian, so3.left_jacobian_inverse, so3.right_jacobian):
        single = np.array([[function(vector) for vector in row] for row in phi])
        assert np.allclose(function(phi), single, rtol=0, atol=2e-15), function.__name__
    R = so3.exp(phi)
    for function in (so3.log, so3.quaternion):
        single = np.array([[function(matrix) for matrix in row] for row in R])
        assert np.allclose(function(R), single, rtol=0, atol=2e-15), function.__name__
    assert so3.exp(np.zeros((0, 3))).shape == (0, 3, 3)
    assert so3.log(np.zeros((0, 3, 3))).shape == (0, 3)


def test_yaw_turns_about_the_vertical():
    """Catches a turn the wrong way: yaw pi/2 takes x to y and leaves z."""
    R = so3.yaw_rotation(np.pi / 2)
    assert np.allclose(R @ np.eye(3), np.column_stack([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), atol=5e-16)
