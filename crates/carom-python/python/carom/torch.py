"""Impacts and runs as functions for PyTorch: ``loss.backward()`` goes through them.

Needs ``pip install torch``. Tensors are 64-bit numbers on the host; leading axes are batches. Where a derivative does not exist the call
raises with time and reason. Second derivatives are not defined.
"""

from collections.abc import Callable as _Callable
from collections.abc import Sequence as _Sequence
from typing import Any as _Any

import numpy as _np
import torch as _torch

from . import Chain as _Chain
from . import Scene as _Scene
from . import _autodiff

__all__ = ["impact", "run"]


def impact(
    chain: _Chain, frame: str, normal: _Any, law: _Any, *, point: _Any = None, joints: _Any = None
) -> _Callable[..., _torch.Tensor]:
    """The velocities after an impact as a function of the state.

    Args:
        chain, frame, normal, law, point, joints: as of `carom.Chain.impact`.

    Returns:
        A function ``f(q, qd, restitution=None, friction=None)`` that returns qd_plus, shape (nv,) or (B, nv); coefficients that are given
        are used instead of those of the law, and differentiated.
    """

    _autodiff.check_law(law)

    def velocities(q: _Any, qd: _Any, restitution: _Any = None, friction: _Any = None) -> _torch.Tensor:
        given = {"restitution": restitution, "friction": friction}
        function, numbers = _autodiff.function_of_impact(chain, frame, normal, law, point, joints, given)
        return _Function.apply(function, *_double(q, qd, *numbers))[0]

    return velocities


def run(scene: _Scene, wrt: _Sequence[str] = ()) -> _Callable[..., tuple[_torch.Tensor, _torch.Tensor]]:
    """The state at the end of a scene as a function of that at its start and of numbers of the scene.

    Args:
        scene: a `carom.Scene`.
        wrt: paths of keys of the scene, as in `carom.Scene.with_keys`: "contact.restitution", "run.gravity[2]".

    Returns:
        A function ``f(q, qd, *numbers)``, with a number for each of ``wrt``, that returns q and qd at the end, shapes (nq,) and (nv,),
        with the leading axes of the arguments.
    """
    function = _autodiff.Run(scene, wrt)

    def state(q: _Any, qd: _Any, *numbers: _Any) -> tuple[_torch.Tensor, _torch.Tensor]:
        function.check(numbers)
        return _Function.apply(function, *_double(q, qd, *numbers))

    return state


def _double(*arguments):
    return [_torch.as_tensor(it, dtype=_torch.float64, device="cpu") for it in arguments]


class _Function(_torch.autograd.Function):
    @staticmethod
    def forward(context, function, *arguments):
        needed = any(context.needs_input_grad[1:])
        values, by = function([it.detach().numpy() for it in arguments], needed)
        context.by, context.shapes, context.axes = by, [it.shape for it in arguments], function.inputs
        return tuple(_torch.from_numpy(_np.array(it)) for it in values)

    @staticmethod
    @_torch.autograd.function.once_differentiable
    def backward(context, *weights):
        gradients = []
        for k, (shape, axes) in enumerate(zip(context.shapes, context.axes)):
            terms = [(_torch.from_numpy(row[k]).mT @ weight[..., None])[..., 0] for row, weight in zip(context.by, weights)]
            total = sum(terms) if axes else sum(terms)[..., 0]
            gradients.append(total.sum_to_size(shape))
        return (None, *gradients)
