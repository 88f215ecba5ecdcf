"""The cost with its gradient, in the hands of other optimisers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import check_grad, minimize

import palpate


@pytest.fixture(scope="module")
def problem(seen: palpate.Scene) -> palpate.Problem:
    return palpate.Problem(seen, backend="cpu")


@pytest.fixture(scope="module")
def scaled(seen: palpate.Scene) -> palpate.Problem:
    return palpate.Problem(seen, backend="cpu", scaled=True)


def test_it_knows_its_names_and_ranges(problem: palpate.Problem, scaled: palpate.Problem) -> None:
    assert problem.names == ["material.youngs_modulus"]
    assert problem.units == ["Pa"]
    assert problem.x0.tolist() == [2e4]
    assert problem.bounds == [(1e3, 1e6)]
    # A logarithm.
    assert np.ptp(scaled.bounds) == pytest.approx(np.log(1e3))
    assert scaled.values(scaled.x0) == pytest.approx([2e4], rel=1e-14)
    assert scaled.coordinates([2e4]) == pytest.approx(scaled.x0, rel=1e-14)


def test_the_gradient_is_that_of_the_cost(problem: palpate.Problem, scaled: palpate.Problem) -> None:
    # Central differences err by the third derivative times 1e-8 and by the rounding of Newton's method over 1e-4.
    assert problem.check_gradient([3e4]) < 1e-4
    x = scaled.coordinates([3e4])
    cost, gradient = scaled.value_and_gradient(x)
    assert cost == scaled(x) == scaled.value(x)
    assert np.array_equal(gradient, scaled.gradient(x))
    # dJ/d(ln E) = E dJ/dE.
    assert gradient[0] == pytest.approx(3e4 * problem.gradient([3e4])[0], rel=1e-9)
    # Forward differences of SciPy, with a step of 1.5e-8.
    assert check_grad(scaled, scaled.gradient, x) < 1e-3 * abs(gradient[0])


def test_the_curvature_is_positive(scaled: palpate.Problem) -> None:
    h = scaled.curvature(scaled.coordinates([2e4]))
    assert h.shape == (1, 1)
    assert h[0, 0] > 0


def test_scipy_finds_what_the_fit_finds(scaled: palpate.Problem, seen: palpate.Scene) -> None:
    start = scaled.coordinates([8e4])
    found = minimize(scaled.value_and_gradient, start, jac=True, bounds=scaled.bounds, method="L-BFGS-B")
    own = palpate.fit(seen, backend="cpu", grid_check=False)
    # Both stop where the cost falls by less than a part in some 1e9: within a thousandth of a standard error.
    error = own.errors["material.youngs_modulus"]
    assert error is not None
    assert abs(scaled.values(found.x)[0] - own.values["material.youngs_modulus"]) < 0.01 * error
    assert found.fun == pytest.approx(own.result["cost"]["final"], rel=1e-6)


def test_torch_differentiates_through_it(scaled: palpate.Problem) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed: its wheel is larger than all else here together")
    cost = scaled.torch()
    x = torch.tensor(scaled.coordinates([3e4]), requires_grad=True)
    y = (3.0 * cost(x)) ** 2
    y.backward()
    value, gradient = scaled.value_and_gradient(x.detach().numpy())
    assert y.item() == pytest.approx(9 * value**2, rel=1e-14)
    assert np.allclose(x.grad.numpy(), 18 * value * gradient, rtol=1e-14)
    # An optimiser of PyTorch follows it.
    optimizer = torch.optim.LBFGS([x], max_iter=30, line_search_fn="strong_wolfe")

    def closure():  # type: ignore[no-untyped-def]
        optimizer.zero_grad()
        loss = cost(x)
        loss.backward()
        return loss

    optimizer.step(closure)
    assert scaled.values(x.detach().numpy())[0] == pytest.approx(2e4, rel=0.02)


def test_wrong_points_are_refused(problem: palpate.Problem) -> None:
    with pytest.raises(palpate.ArgumentError, match=r"x: has shape \(2,\), expected \(1,\)"):
        problem([1.0, 2.0])
    with pytest.raises(palpate.ArgumentError, match="material.youngs_modulus is NaN, which is not finite"):
        problem([np.nan])
    with pytest.raises(palpate.ComputationError):
        problem([-1e4])
    # What failed leaves nothing behind.
    assert np.isfinite(problem([2e4]))


def test_several_scenes_share_a_value(seen: palpate.Scene, problem: palpate.Problem) -> None:
    other = seen.with_values({"world.gravity.z": -9.8})
    both = palpate.Problem([seen, other], backend="cpu")
    assert both.names == problem.names
    # As many readings in each: the mean of both.
    mean = 0.5 * (problem([3e4]) + palpate.Problem(other, backend="cpu")([3e4]))
    assert both([3e4]) == pytest.approx(mean, rel=1e-12)
