"""The cost of a fit for other optimisers: SciPy and PyTorch."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np

from . import _palpate


class Problem(_palpate.Problem):
    """What a fit of one or several scenes minimises, as a function of x.

    ``scipy.optimize.minimize(problem.value_and_gradient, problem.x0, jac=True, bounds=problem.bounds)`` minimises it. With ``scaled=True`` x is
    what palpate's own optimisers see (of order one, logarithms of what is positive): gradients are of order one as well, and optimisers that
    know nothing of units do better. ``problem.values(x)`` are the values in SI units.
    """

    def torch(self) -> Callable[[Any], Any]:
        """The cost as a function of a tensor [q], through which PyTorch differentiates; it needs the package ``torch``."""
        import torch

        problem = self

        class Cost(torch.autograd.Function):  # type: ignore[misc, name-defined, unused-ignore]
            @staticmethod
            def forward(ctx: Any, x: Any) -> Any:
                cost, gradient = problem.value_and_gradient(x.detach().cpu().double().numpy())
                ctx.save_for_backward(torch.from_numpy(gradient).to(dtype=x.dtype, device=x.device))
                return x.new_tensor(cost)

            @staticmethod
            @torch.autograd.function.once_differentiable
            def backward(ctx: Any, upstream: Any) -> Any:
                (gradient,) = ctx.saved_tensors
                return upstream * gradient

        def cost(x: Any) -> Any:
            return Cost.apply(x)

        return cost

    def check_gradient(self, x: Any, *, step: float = 1e-4) -> float:
        """Largest difference between the gradient at x [q] and central differences, over the largest component of the gradient.

        ``step`` is relative to each component of x (absolute where that is zero).
        """
        x = np.asarray(x, dtype=float)
        exact = self.gradient(x)
        differences = np.empty_like(exact)
        for i, value in enumerate(x):
            h = step * (abs(value) or 1.0)
            ahead, behind = x.copy(), x.copy()
            ahead[i] += h
            behind[i] -= h
            differences[i] = (self(ahead) - self(behind)) / (2.0 * h)
        return float(np.max(np.abs(exact - differences)) / np.max(np.abs(exact)))
