"""Scalar rotation kernels against the batched NumPy forms, at every size of angle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vigauge import so3
from vigauge.kernels import rotation

ANGLES = [0.0, 1e-300, 1e-12, 1e-8, 1e-4, 0.29999999, 0.3, 0.30000001, 1.0, 3.0, np.pi - 1e-9, np.pi, 6.0]
vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


def filled(function, argument):
    out = np.empty(3 if function is rotation.log else (3, 3))
    function(argument, out)
    return out


PAIRS = [
    (rotation.exp, so3.exp),
    (rotation.left_jacobian, so3.left_jacobian),
    (rotation.right_jacobian_inverse, so3.right_jacobian_inverse),
]


@pytest.mark.parametrize(("compiled", "plain"), PAIRS, ids=lambda function: getattr(function, "__name__", ""))
@pytest.mark.parametrize("angle", ANGLES)
def test_compiled_forms_at_chosen_angles(compiled, plain, angle):
    """Catches a wrong series, a sign, or a jump at the threshold between series and closed form."""
    phi = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    assert np.abs(filled(compiled, phi) - plain(phi)).max() < 2e-14


@pytest.mark.parametrize(("compiled", "plain"), PAIRS, ids=lambda function: getattr(function, "__name__", ""))
@given(phi=vectors)
def test_compiled_forms_anywhere(compiled, plain, phi):
    """Catches mixed-up axes."""
    assert np.abs(filled(compiled, phi) - plain(phi)).max() < 2e-14


@given(phi=vectors)
def test_logarithm(phi):
    """Catches a branch of Shepperd's method with exchanged components."""
    R = so3.exp(phi)
    assert np.abs(so3.exp(filled(rotation.log, R)) - R).max() < 1e-14


@pytest.mark.parametrize("axis", np.eye(3))
@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, np.pi - 1e-7, np.pi])
def test_logarithm_near_half_a_turn(angle, axis):
    """Catches lost digits where the trace of R no longer tells the angle."""
    found = filled(rotation.log, so3.exp(angle * axis))
    assert min(np.abs(found - angle * axis).max(), np.abs(found + angle * axis).max()) < 1e-14


def test_rotations_are_retracted_as_by_the_definitions():
    """Catches the first keyframe moved by a left increment instead of its total, Eqs. (8)-(9)."""
    rng = np.random.default_rng(0)
    R_WB, step = so3.exp(rng.normal(size=(5, 3))), rng.normal(size=(5, 3))
    dphi_0, R_ref = rng.normal(size=3), so3.exp(rng.normal(size=3))
    out = np.empty_like(R_WB)
    rotation.retract_rotations(R_WB, step, dphi_0, R_ref, out)
    assert np.abs(out[0] - so3.exp(dphi_0) @ R_ref).max() < 1e-14
    assert np.abs(out[1:] - so3.exp(step[1:]) @ R_WB[1:]).max() < 1e-14
