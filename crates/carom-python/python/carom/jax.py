"""Impacts and runs as functions for JAX: ``jax.grad``, ``jax.jacobian``, ``jax.jit`` and ``jax.vmap`` apply to them.

Needs ``pip install jax`` and 64-bit numbers: ``jax.config.update("jax_enable_x64", True)``. The computation itself is on the host.
Where a derivative does not exist the call raises with time and reason. Second derivatives are not defined.
"""

from collections.abc import Callable as _Callable
from collections.abc import Sequence as _Sequence
from typing import Any as _Any

import jax as _jax
import jax.numpy as _jnp

from . import Chain as _Chain
from . import Scene as _Scene
from . import _autodiff

__all__ = ["impact", "run"]


def impact(
    chain: _Chain, frame: str, normal: _Any, law: _Any, *, point: _Any = None, joints: _Any = None
) -> _Callable[..., _jax.Array]:
    """The velocities after an impact as a function of the state.

    Args:
        chain, frame, normal, law, point, joints: as of `carom.Chain.impact`.

    Returns:
        A function ``f(q, qd, restitution=None, friction=None)`` that returns qd_plus, shape (nv,); coefficients that are given are used
        instead of those of the law, and differentiated.
    """

    _autodiff.check_law(law)

    def velocities(q: _Any, qd: _Any, restitution: _Any = None, friction: _Any = None) -> _jax.Array:
        given = {"restitution": restitution, "friction": friction}
        function, numbers = _autodiff.function_of_impact(chain, frame, normal, law, point, joints, given)
        return _differentiable(function)(q, qd, *numbers)[0]

    return velocities


def run(scene: _Scene, wrt: _Sequence[str] = ()) -> _Callable[..., tuple[_jax.Array, _jax.Array]]:
    """The state at the end of a scene as a function of that at its start and of numbers of the scene.

    Args:
        scene: a `carom.Scene`.
        wrt: paths of keys of the scene, as in `carom.Scene.with_keys`: "contact.restitution", "run.gravity[2]".

    Returns:
        A function ``f(q, qd, *numbers)``, with a number for each of ``wrt``, that returns q and qd at the end, shapes (nq,) and (nv,).
    """
    own = _autodiff.Run(scene, wrt)
    function = _differentiable(own)

    def state(q: _Any, qd: _Any, *numbers: _Any) -> tuple[_jax.Array, _jax.Array]:
        own.check(numbers)
        return function(q, qd, *numbers)

    return state


def _differentiable(function):
    @_jax.custom_jvp
    def values(*arguments):
        return _call(function, arguments, False)[0]

    @values.defjvp
    def rule(arguments, changes):
        found, by = _call(function, arguments, True)
        moved = []
        for row in by:
            terms = []
            for slope, change, axes in zip(row, changes, function.inputs):
                terms.append(slope @ change if axes else slope[..., 0] * change)
            moved.append(sum(terms))
        return found, tuple(moved)

    return lambda *arguments: values(*(_double(it) for it in arguments))


def _double(argument):
    argument = _jnp.asarray(argument)
    if not _jax.config.read("jax_enable_x64"):
        raise TypeError('carom computes with 64 bits: call jax.config.update("jax_enable_x64", True) first')
    return argument.astype(_jnp.float64)


def _call(function, arguments, derivatives):
    """The values, and the derivatives of each by each argument, by a callback to the host."""
    of = lambda *shape: _jax.ShapeDtypeStruct(shape, _jnp.float64)  # noqa: E731
    values = tuple(of(size) for size in function.sizes)
    widths = [it.shape[-1] if axes else 1 for it, axes in zip(arguments, function.inputs)]
    by = tuple(tuple(of(size, width) for width in widths) for size in function.sizes) if derivatives else ()

    def host(*arguments):
        found, slopes = function(arguments, derivatives)
        return tuple(found), tuple(tuple(row) for row in slopes or ())

    return _jax.pure_callback(host, (values, by), *arguments, vmap_method="broadcast_all")
