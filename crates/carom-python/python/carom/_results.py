"""Results with names."""

import typing


class Energies(typing.NamedTuple):
    """Energies of the robot, J: numbers for one state, arrays of shape (B,) for a batch."""

    kinetic: typing.Any
    """Kinetic energy, J."""
    potential: typing.Any
    """Potential energy, J; zero at the world's origin."""
