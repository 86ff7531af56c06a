"""The exceptions of carom. Their messages are those of the command line."""


class CaromError(Exception):
    """Base class of all exceptions of carom, except ``TypeError`` for arguments of a wrong type."""


class ChainError(CaromError, ValueError):
    """A request that the robot cannot answer: an unknown frame or joint, massless links, a singular mass matrix."""


class UrdfError(ChainError):
    """A URDF that cannot be read, or that breaks a rule; the message names file, line, element and rule."""


class StateError(ChainError):
    """Numbers of a wrong shape, numbers that are not finite, or a quaternion that is not a unit quaternion."""


class ImpactError(CaromError, ValueError):
    """An impact that is refused, or that a law has no solution for."""


class SimulationError(CaromError, ValueError):
    """A scene or a simulation that is refused, or that cannot be continued."""


class StudyError(CaromError, ValueError):
    """A study that breaks a rule, or a map that cannot be written."""


class FitError(CaromError, ValueError):
    """Measurements or options to which no coefficients can be fitted."""


class RecordError(CaromError):
    """A recording that cannot be written, or a package that is built without recordings."""
