"""What the tests share. They run over the installed wheel."""

import pathlib

import numpy as np
import pytest

import carom

ROOT = pathlib.Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def arm():
    """Two links in a plane."""
    return carom.Chain.from_urdf(ROOT / "robots/planar2.urdf")


@pytest.fixture(scope="session")
def arm7():
    """Seven joints."""
    return carom.Chain.from_urdf(ROOT / "robots/arm7.urdf")


@pytest.fixture
def rng():
    return np.random.default_rng(20)


def states(chain, rng, count):
    """Random configurations and velocities."""
    return chain.random_configuration(rng, count), rng.normal(size=(count, chain.nv))


def close(found, expected, tolerance=1e-10):
    """Equal within `tolerance` of the largest number expected: each is a sum of terms of that size."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    scale = max(1.0, np.abs(expected).max(initial=0.0))
    assert np.abs(found - expected).max(initial=0.0) <= tolerance * scale
