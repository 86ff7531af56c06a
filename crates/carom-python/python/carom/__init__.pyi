"""Type stubs of carom. stubs.py writes the docstrings and the types of properties."""

import enum
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Generic, Literal, NamedTuple, Protocol, TypedDict, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import CapsuleType, Never, Self

_Floats = NDArray[np.float64]
_Vector = np.ndarray[tuple[int], np.dtype[np.float64]]
_Matrix = np.ndarray[tuple[int, int], np.dtype[np.float64]]
# One state, and a batch of them: lists, and arrays whose number of axes is known.
_State = Sequence[float] | np.ndarray[tuple[int], np.dtype[Any]]
_Batch = Sequence[Sequence[float]] | Sequence[np.ndarray[tuple[int], np.dtype[Any]]] | np.ndarray[tuple[int, int], np.dtype[Any]]
_Joints = Literal["free", "locked"] | Sequence[str] | Mapping[str, Any]
_Band = tuple[tuple[float, float], tuple[float, float]]
_Number = TypeVar("_Number")
_Path = str | os.PathLike[str]
_Function = Callable[[_Floats, _Floats], ArrayLike]
_AnyLaw = Law | PythonLaw | _Function

class _JointImpulse(TypedDict):
    force: _Vector
    moment: _Vector

class _Loads(TypedDict):
    joint_impulse: _Vector
    bearings: dict[str, _JointImpulse]

class _EventLoads(_Loads):
    motors_minus: _Vector
    motors_plus: _Vector

class _Stream(Protocol):
    """rerun.RecordingStream."""

    def send_chunks(self, chunks: Any) -> None: ...

_Mode = Literal["open", "stick", "slip", "reverse-slip"]

__version__: str

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

class Flags(enum.IntFlag):
    """The bits of ``Impacts.flag_bits``."""
    ENERGY_GAIN = 1
    JAM = 2
    SINGULAR = 4
    GRAZING = 8
    NON_UNIQUE = 16
    NO_APPROACH = 32

class Law:
    """An impact law of carom with its coefficients; the base class of the eight laws. Immutable."""
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def name(self) -> str:
        """Name of the law, as on the command line and in scenes."""
    @property
    def restitution(self) -> float:
        """Coefficient of restitution, as the law defines it."""
    @property
    def friction(self) -> float:
        """Coulomb's coefficient of friction; 0 for a law without one. For Brach's law the size of its impulse ratio."""
    @property
    def tangential_restitution(self) -> float:
        """Coefficient of tangential restitution; 0 for a law without one."""

class Frictionless(Law):
    """The frictionless law; Newton's, Poisson's and Stronge's coefficients are equal without friction.

    Args:
        restitution: 0 to 1.

    Raises:
        ImpactError: a coefficient out of its range.
    """
    def __new__(cls, restitution: float) -> Frictionless: ...

class Whittaker(Law):
    """Whittaker's law: the ratio of normal velocities is `restitution`, and Coulomb's friction acts against the slip after the
    impact. Can gain energy.

    Args:
        restitution: 0 to 1.
        friction: Coulomb's coefficient, 0 or more.

    Raises:
        ImpactError: a coefficient out of its range.
    """
    def __new__(cls, restitution: float, friction: float = 0.0) -> Whittaker: ...

class Newton(Law):
    """Newton's law along the path of the slip: the ratio of normal velocities is `restitution`. Can gain energy.

    Args:
        restitution: 0 to 1.
        friction: Coulomb's coefficient, 0 or more.

    Raises:
        ImpactError: a coefficient out of its range.
    """
    def __new__(cls, restitution: float, friction: float = 0.0) -> Newton: ...

class Poisson(Law):
    """Poisson's law along the path of the slip: the ratio of normal impulses is `restitution`.

    Args:
        restitution: 0 to 1.
        friction: Coulomb's coefficient, 0 or more.

    Raises:
        ImpactError: a coefficient out of its range.
    """
    def __new__(cls, restitution: float, friction: float = 0.0) -> Poisson: ...

class Energetic(Law):
    """Stronge's law along the path of the slip: the ratio of normal works is the square of `restitution`. Never gains energy.

    Args:
        restitution: 0 to 1.
        friction: Coulomb's coefficient, 0 or more.

    Raises:
        ImpactError: a coefficient out of its range.
    """
    def __new__(cls, restitution: float, friction: float = 0.0) -> Energetic: ...

class Smith(Law):
    """Smith's law: friction against a mean of the slips before and after.

    Args:
        restitution: 0 to 1.
        friction: Coulomb's coefficient, 0 or more.

    Raises:
        ImpactError: a coefficient out of its range.
    """
    def __new__(cls, restitution: float, friction: float = 0.0) -> Smith: ...

class ChatterjeeRuina(Law):
    """Chatterjee and Ruina's law: an algebraic law with a coefficient of tangential restitution. Never gains energy.

    Args:
        restitution: 0 to 1.
        friction: Coulomb's coefficient, 0 or more.
        tangential_restitution: -1 (no tangential impulse) to 1 (one that reverses the slip).

    Raises:
        ImpactError: a coefficient out of its range.
    """
    def __new__(
        cls, restitution: float, friction: float = 0.0, tangential_restitution: float = 0.0
    ) -> ChatterjeeRuina: ...

class Brach(Law):
    """Brach's law: an impulse ratio, limited so that no energy is gained.

    Args:
        restitution: 0 to 1.
        friction: size of the impulse ratio, which is directed towards rest; 0 or more.
        impulse_ratio: instead of friction, tangential over normal impulse, negative against the initial slip. Where the ratio
            that ends the slip has the other sign, friction would act away from rest, and the tangential impulse is 0.

    Raises:
        ImpactError: a coefficient out of its range.
    """
    def __new__(
        cls, restitution: float, friction: float | None = None, impulse_ratio: float | None = None
    ) -> Brach: ...

class PythonLaw:
    """An impact law written in Python.

    The function is called as `function(H, u)` with the Delassus matrix H (shape (3, 3), 1/kg) and the contact velocity u
    (shape (3,), m/s) in contact axes: two tangents, then the normal, which points from the environment to the robot, so that an
    approaching contact has u[-1] < 0. It returns the impulse on the robot in the same axes, shape (3,), N s. With
    `carom.law` in the plane the sizes are 2.

    Args:
        function: the law.
        restitution: coefficient of restitution, 0 to 1, that holds in scenes where an impact law does not apply: several
            contacts at once, time steps, compliant contacts.
        friction: Coulomb's coefficient of friction, 0 or more, for the same and for lasting contacts.
        name: name of the law in results; that of the function by default.

    A plain function may be given wherever a law is expected; its coefficients are then zero. A call takes some microseconds and
    needs the GIL: batches are computed one state after another.
    """
    def __new__(
        cls, function: _Function, restitution: float = 0.0, friction: float = 0.0, name: str | None = None
    ) -> PythonLaw: ...
    @property
    def name(self) -> str:
        """Name of the law."""
    @property
    def restitution(self) -> float:
        """Coefficient of restitution where an impact law does not apply."""
    @property
    def friction(self) -> float:
        """Coulomb's coefficient of friction where an impact law does not apply."""

class Energies(NamedTuple, Generic[_Number]):
    """Energies of the robot, J: numbers for one state, arrays of shape (B,) for a batch."""
    kinetic: _Number
    potential: _Number

class Chain:
    """A kinematic chain (a tree of links and joints) read from a URDF; immutable.

    Make one with `Chain.from_urdf` or `Chain.from_robot_description`.

    A state is an array q of shape (nq,) with joint velocities qd of shape (nv,); a batch has the shapes (B, nq) and (B, nv).
    q and qd list the joints in the order of the file, an added floating base first. A floating joint has
    q = x y z qx qy qz qw, and its qd is the linear, then the angular velocity of the child in child axes. Units are SI and
    radians. Vectors and matrices of points are in world axes.

    Batches are computed without the GIL and on all cores.
    """
    def __new__(cls, _: Never, /) -> Self: ...
    @staticmethod
    def from_urdf(
        source: _Path,
        *,
        floating: bool = False,
        meshes: bool = True,
        repair: bool = False,
        strict: bool = False,
        package_dirs: Sequence[_Path] = (),
        rotor_inertia: Mapping[str, float] = ...,
        mass: Mapping[str, float] = ...,
        inertia: Mapping[str, Sequence[float]] = ...,
        xacro: Mapping[str, object] | None = None,
    ) -> Chain:
        """Reads a URDF: the path of a file, or the text of one.

        Args:
            source: path of a file, or a string that begins with "<".
            floating: connects the root link to the world by a floating joint.
            meshes: False leaves missing collision meshes out; True warns of them, and raises an error where one is used.
            repair: changes the robot as little as needed to compute its dynamics; `repairs` lists the changes.
            strict: raises an error for what is otherwise a warning.
            package_dirs: folders in which packages (package://NAME/…) are searched for first.
            rotor_inertia: inertias of motors' rotors reflected to their joints, N² I for the gear ratio N: a dict by joint, kg m² or
                kg. They replace those of the file.
            mass: masses of links instead of those of the file: a dict by link, kg. Rotational inertias change in proportion.
            inertia: rotational inertias of links about their centres of mass, along the axes of the link, instead of those of the file: a dict by
                link of ixx, ixy, ixz, iyy, iyz, izz, kg m².
            xacro: arguments of a xacro file, a dict by name. A file that is xacro is expanded by the package `xacro` (pip install xacro), which
                finds packages as carom does.

        Raises:
            UrdfError: the file cannot be read or breaks a rule; the message names line, element, value and rule. A xacro file, and the
                package `xacro` is not installed, or refuses it.
        """
    @staticmethod
    def from_robot_description(
        name: str,
        *,
        floating: bool = False,
        meshes: bool = True,
        repair: bool = False,
        strict: bool = False,
        package_dirs: Sequence[_Path] = (),
        rotor_inertia: Mapping[str, float] = ...,
        mass: Mapping[str, float] = ...,
        inertia: Mapping[str, Sequence[float]] = ...,
    ) -> Chain:
        """Reads a robot of the package `robot_descriptions`, for example "panda_description", with the arguments that the package gives for
        a xacro file. The other arguments are those of `from_urdf`.

        Raises:
            ImportError: the package is not installed, or has no robot of this name, or cannot download it.
        """
    @staticmethod
    def uniform(links: int, length: float, mass: float) -> Chain:
        """A chain of equal uniform rods on hinges about z, straight along x at q = 0, with the frame "tip" at its end.

        Args:
            links: number of rods, 1 or more.
            length: of the whole chain, m.
            mass: of the whole chain, kg.

        Raises:
            ChainError: a number that is not positive.
        """
    @property
    def name(self) -> str:
        """Name of the robot."""
    @property
    def nq(self) -> int:
        """Length of q."""
    @property
    def nv(self) -> int:
        """Length of qd: the degrees of freedom."""
    @property
    def joints(self) -> list[str]:
        """Names of the joints that have entries in q and qd, in their order."""
    @property
    def frames(self) -> list[str]:
        """Names of the frames, one for each link, in the order of the file."""
    @property
    def total_mass(self) -> float:
        """Sum of the masses of all links, kg."""
    @property
    def massless_links(self) -> list[str]:
        """Names of the links that move without mass. Dynamics are refused if there are any."""
    @property
    def warnings(self) -> list[str]:
        """What loading has found odd in the file, one sentence each."""
    @property
    def repairs(self) -> list[str]:
        """The changes that `repair` has made, one sentence each."""
    @property
    def joint_table(self) -> list[dict[str, Any]]:
        """The joints of the file: a list of dicts with name, type, parent, child, the slices q and v of its entries (None for
        fixed and mimic joints), mimic (None, or joint, multiplier and offset), lower, upper, velocity, effort (None without a
        limit), damping and friction.
        """
    @property
    def lower(self) -> _Vector:
        """Lower limits of the positions, shape (nv,), rad or m; -inf without a limit and for floating and planar joints."""
    @property
    def upper(self) -> _Vector:
        """Upper limits of the positions, shape (nv,), rad or m; inf without a limit and for floating and planar joints."""
    @property
    def velocity_limit(self) -> _Vector:
        """Limits of the speeds, shape (nv,), rad/s or m/s; inf without a limit."""
    @property
    def effort_limit(self) -> _Vector:
        """Limits of the efforts, shape (nv,), N m or N; inf without a limit."""
    def neutral(self) -> _Vector:
        """The configuration in which all coordinates are zero and quaternions are the identity, shape (nq,)."""
    @overload
    def random_configuration(self, rng: np.random.Generator | int | None = None, size: None = None) -> _Vector:
        """Random configurations: uniform within the position limits of the joints, those of mimic joints included, within ±π rad or ±1 m
        without limits; floating joints within ±1 m and with a uniform rotation.

        Args:
            rng: a numpy.random.Generator, or a seed of one.
            size: None for one configuration of shape (nq,), or their number B for the shape (B, nq).

        Raises:
            ChainError: limits of mimic joints that leave a joint no position.
        """
    @overload
    def random_configuration(self, rng: np.random.Generator | int | None = None, *, size: int) -> _Matrix: ...
    @overload
    def random_configuration(self, rng: np.random.Generator | int | None, size: int) -> _Matrix: ...
    def integrate(self, q: ArrayLike, qd: ArrayLike, dt: float = 1.0, *, out: _Floats | None = None) -> _Floats:
        """The configuration after moving from q with the constant velocity qd for dt seconds; shape of q.

        Raises:
            StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
        """
    def q_rate(self, q: ArrayLike, qd: ArrayLike, *, out: _Floats | None = None) -> _Floats:
        """The rate of q at the velocity qd; shape of q. It is qd itself but for floating joints.

        Raises:
            StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
        """
    def difference(self, q_from: ArrayLike, q_to: ArrayLike, *, out: _Floats | None = None) -> _Floats:
        """The constant velocity that moves the chain from q_from to q_to in one second; shape (nv,) or (B, nv).

        Raises:
            StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
        """
    def outside_limits(self, q: ArrayLike) -> list[str]:
        """The positions of joints of one degree of freedom that are outside their limits at q (shape (nq,)), one sentence each."""
    @overload
    def to_pinocchio(self, q: ArrayLike, v: None = None) -> _Floats:
        """q, or the pair (q, v), in the order and the coordinates of a Pinocchio model of the same file: children sorted by the
        names of their joints, continuous joints as (cos, sin), mimic joints with coordinates of their own.

        Raises:
            ChainError: a planar joint, whose axis Pinocchio does not read.
        """
    @overload
    def to_pinocchio(self, q: ArrayLike, v: ArrayLike) -> tuple[_Floats, _Floats]: ...
    @overload
    def from_pinocchio(self, q: ArrayLike, v: None = None) -> _Floats:
        """The inverse of `to_pinocchio`; the positions of mimic joints are ignored."""
    @overload
    def from_pinocchio(self, q: ArrayLike, v: ArrayLike) -> tuple[_Floats, _Floats]: ...
    def mass_matrix(self, q: ArrayLike, *, out: _Floats | None = None) -> _Floats:
        """Mass matrix M, shape (nv, nv) or (B, nv, nv); kg m², kg m, kg.

        Raises:
            StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
        """
    def jacobian(
        self,
        q: ArrayLike,
        frame: str,
        point: ArrayLike | None = None,
        *,
        full: bool = False,
        out: _Floats | None = None,
    ) -> _Floats:
        """Jacobian of the velocity of a point, shape (3, nv) or (B, 3, nv), world axes. With full=True the geometric Jacobian of
        the frame's origin, shape (6, nv): angular rows first, then the linear ones.

        Args:
            frame: name of the link.
            point: the point in the axes of the frame, from its origin, m.
        """
    def pose(self, q: ArrayLike, frame: str, *, out: _Floats | None = None) -> _Floats:
        """Pose of a frame in the world, shape (4, 4) or (B, 4, 4): rotation and position (m) as a homogeneous matrix."""
    def position(
        self, q: ArrayLike, frame: str, point: ArrayLike | None = None, *, out: _Floats | None = None
    ) -> _Floats:
        """Position of a point in the world, shape (3,) or (B, 3), m."""
    def tool_velocity(
        self, q: ArrayLike, frame: str, velocity: ArrayLike, *, point: ArrayLike | None = None,
        motion: Literal["least-energy", "least-norm", "without-rotation"] = "least-energy", out: _Floats | None = None,
    ) -> _Floats:
        """Joint velocities that give a point of a link a velocity, shape (nv,) or (B, nv), rad/s and m/s.

        Args:
            frame: name of the link.
            velocity: velocity of the point, world axes, m/s, shape (3,).
            point: the point in the axes of the link, m; its origin by default.
            motion: "least-energy": those of the least kinetic energy; "least-norm": of the least sum of squares;
                "without-rotation": the link does not turn, and of these the ones of the least kinetic energy.

        Raises:
            ChainError: no joint velocities give the point this velocity; an unknown motion.
        """
    def impact_loads(
        self, q: ArrayLike, change: ArrayLike, frame: str, impulse: ArrayLike, *, point: ArrayLike | None = None
    ) -> _Loads:
        """The loads of an impact on the joints: what their drives, gears and bearings get.

        Args:
            q: configuration, shape (nq,).
            change: change of the joint velocities, qd_plus - qd, shape (nv,).
            frame: name of the link that is hit.
            impulse: impulse on the link, world axes, N s, shape (3,).
            point: contact point in the axes of the link, m; its origin by default.

        Returns:
            A dict of joint_impulse, Jᵀp of shape (nv,), N m s or N s; and bearings, by joint the force (N s) and the moment (N m s)
            of the impulse that its parent link exerts on its child link, in the axes of the child link, about its origin.
        """
    def bias(
        self, q: ArrayLike, qd: ArrayLike, *, gravity: ArrayLike | None = None, out: _Floats | None = None
    ) -> _Floats:
        """Bias force C q̇ + g, shape (nv,) or (B, nv), N m and N.

        Args:
            gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
        """
    def inverse_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        *,
        gravity: ArrayLike | None = None,
        out: _Floats | None = None,
    ) -> _Floats:
        """Inverse dynamics tau = M q̈ + C q̇ + g by the recursive Newton–Euler algorithm, shape (nv,) or (B, nv), N m and N.

        Args:
            qdd: joint accelerations, shape of qd.
            gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
        """
    def inverse_dynamics_derivatives(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        *,
        gravity: ArrayLike | None = None,
        out: _Floats | None = None,
    ) -> _Floats:
        """The derivatives of `inverse_dynamics` by q and by qd, shape (2, nv, nv) or (B, 2, nv, nv): column k of the first is that along the
        motion with unit qd[k], so that a floating joint has six. That by qdd is the mass matrix.

        Args:
            qdd: joint accelerations, shape of qd.
            gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
        """
    def forward_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike | None = None,
        *,
        gravity: ArrayLike | None = None,
        out: _Floats | None = None,
    ) -> _Floats:
        """Forward dynamics q̈ = M⁻¹ (tau − C q̇ − g), shape (nv,) or (B, nv). Damping and friction of the joints are not included.

        Args:
            tau: joint forces, shape of qd, N m and N; zero by default.
            gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.

        Raises:
            ChainError: a singular mass matrix, massless links.
        """
    def delassus(
        self, q: ArrayLike, frame: str, point: ArrayLike | None = None, *, out: _Floats | None = None
    ) -> _Floats:
        """Delassus matrix H = J M⁻¹ Jᵀ of a point (inverse inertia at a contact), shape (3, 3) or (B, 3, 3), world axes, 1/kg.

        Raises:
            ChainError: a singular mass matrix, massless links, a point of a link that is fixed to the world.
        """
    @overload
    def effective_mass(
        self,
        q: _State,
        frame: str,
        normal: ArrayLike,
        point: ArrayLike | None = None,
        *,
        out: None = None,
    ) -> float:
        """Effective mass 1/(nᵀHn) of a point along a direction, a number or shape (B,), kg. inf if no joint moves the point along
        the direction.

        Args:
            normal: the direction, world axes, of any length but zero.
        """
    @overload
    def effective_mass(
        self,
        q: _Batch,
        frame: str,
        normal: ArrayLike,
        point: ArrayLike | None = None,
        *,
        out: _Floats | None = None,
    ) -> _Vector: ...
    @overload
    def energies(
        self,
        q: _State,
        qd: _State,
        *,
        gravity: ArrayLike | None = None,
    ) -> Energies[float]:
        """Kinetic and potential energy, a named pair (`Energies`) of numbers or of arrays (B,), J. The potential energy is zero at the
        world's origin.

        Args:
            gravity: acceleration of free fall, world axes, m/s²; (0, 0, -9.81) by default.
        """
    @overload
    def energies(
        self,
        q: _Batch,
        qd: ArrayLike,
        *,
        gravity: ArrayLike | None = None,
    ) -> Energies[_Vector]: ...
    @overload
    def energies(
        self,
        q: _State,
        qd: _Batch,
        *,
        gravity: ArrayLike | None = None,
    ) -> Energies[_Vector]: ...
    @overload
    def impact(
        self,
        q: _State,
        qd: _State,
        frame: str,
        normal: _State,
        law: _AnyLaw,
        *,
        point: _State | None = None,
        restitution: float | None = None,
        friction: float | None = None,
        joints: _Joints | None = None,
        derivatives: bool = False,
        saltation: bool = False,
        gravity: ArrayLike | None = None,
        band: _Band | None = None,
    ) -> Impact:
        """The impact of one point of the robot.

        Args:
            q, qd: state before the impact, shapes (nq,) and (nv,), or a batch (B, nq) and (B, nv).
            frame: name of the link that is hit.
            point: contact point in the axes of the frame, from its origin, m; the origin by default. Shape (3,), or (B, 3) with a
                point for each state.
            normal: contact normal in world axes, from the environment to the robot, of any length but zero. Shape (3,), or (B, 3)
                with a normal for each state.
            law: an impact law like carom.Energetic(0.5, 0.2), a function of H and u, or a list of them.
            restitution, friction: instead of the coefficients of the law, numbers or shape (B,); not for a function.
            joints: "free", "locked", a list of names of locked joints, or a dict of stiffness, damping (one number for all joints but a
                floating base, or shape (nv,)) and contact_time (s) of drives that act during the impact.
            derivatives: also computes the derivatives of qd_plus by q, qd, restitution and friction; with free joints only.
            saltation: also computes the saltation matrix for an impact with a plane at rest; with free joints only.
            gravity: acceleration of free fall for the saltation matrix, world axes, m/s²; (0, 0, -9.81) by default.
            band: ((e_low, e_high), (mu_low, mu_high)): also computes bounds over these ranges of the coefficients.

        Returns:
            An Impact for one state, Impacts if q, qd, point, normal or a coefficient is a batch; a list of them for a list of laws. saltation and band need one state.

        Raises:
            StateError: a wrong shape, or numbers that are not finite.
            ImpactError: a fixed point, a singular direction, a law without a solution; derivatives of a law in Python.
        """
    @overload
    def impact(
        self,
        q: _Batch,
        qd: ArrayLike,
        frame: str,
        normal: ArrayLike,
        law: _AnyLaw,
        *,
        point: ArrayLike | None = None,
        restitution: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        joints: _Joints | None = None,
        derivatives: bool = False,
    ) -> Impacts: ...
    @overload
    def impact(
        self,
        q: _State,
        qd: _Batch,
        frame: str,
        normal: ArrayLike,
        law: _AnyLaw,
        *,
        point: ArrayLike | None = None,
        restitution: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        joints: _Joints | None = None,
        derivatives: bool = False,
    ) -> Impacts: ...
    @overload
    def impact(
        self,
        q: _State,
        qd: _State,
        frame: str,
        normal: _Batch,
        law: _AnyLaw,
        *,
        point: ArrayLike | None = None,
        restitution: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        joints: _Joints | None = None,
        derivatives: bool = False,
    ) -> Impacts: ...
    @overload
    def impact(
        self,
        q: _State,
        qd: _State,
        frame: str,
        normal: _State,
        law: Sequence[_AnyLaw],
        *,
        point: _State | None = None,
        restitution: float | None = None,
        friction: float | None = None,
        joints: _Joints | None = None,
        derivatives: bool = False,
        saltation: bool = False,
        gravity: ArrayLike | None = None,
        band: _Band | None = None,
    ) -> list[Impact]: ...
    @overload
    def impact(
        self,
        q: _Batch,
        qd: ArrayLike,
        frame: str,
        normal: ArrayLike,
        law: Sequence[_AnyLaw],
        *,
        point: ArrayLike | None = None,
        restitution: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        joints: _Joints | None = None,
        derivatives: bool = False,
    ) -> list[Impacts]: ...
    @overload
    def impact(
        self,
        q: _State,
        qd: _Batch,
        frame: str,
        normal: ArrayLike,
        law: Sequence[_AnyLaw],
        *,
        point: ArrayLike | None = None,
        restitution: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        joints: _Joints | None = None,
        derivatives: bool = False,
    ) -> list[Impacts]: ...
    @overload
    def impact(
        self,
        q: _State,
        qd: _State,
        frame: str,
        normal: _Batch,
        law: Sequence[_AnyLaw],
        *,
        point: ArrayLike | None = None,
        restitution: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        joints: _Joints | None = None,
        derivatives: bool = False,
    ) -> list[Impacts]: ...
    def impact_at_points(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        points: Sequence[tuple[str, Sequence[float]]],
        normal: ArrayLike,
        *,
        restitution: float | None = None,
        friction: float | None = None,
        law: Literal["moreau", "poisson", "sequential", "energetic"] = "moreau",
        sticks: bool = False,
        joints: _Joints | None = None,
        relative_stiffness: Sequence[float] | None = None,
        exponent: float | None = None,
    ) -> SeveralImpact:
        """The impact of several points of the robot at the same moment, as one problem: a toe line, a face, two feet.

        Args:
            q, qd: state before the impact, shapes (nq,) and (nv,).
            points: a list of (frame, point): name of the link, and the point in its axes from its origin, m.
            normal: contact normal in world axes, from the environment to the robot, of any length but zero; one for all points, or
                shape (K, 3).
            restitution, friction: coefficients of every point.
            law: "moreau" (restitution of velocities, at all points at once), "poisson" (restitution of impulses), "sequential"
                (one point after another, always the fastest) or "energetic" (impulses in the ratios that stiffnesses and stored
                energies give, without friction).
            sticks: every point stops and neither slips nor leaves, whatever impulse that takes; restitution and friction are not
                used.
            joints: as for impact.
            relative_stiffness: under "energetic" the stiffnesses of the points relative to one another, shape (K,); None: all equal.
            exponent: under "energetic" that of the normal force over the penetration: 1 for flat contacts, 1.5 for round bodies, which is
                the default.

        Returns:
            A SeveralImpact.

        Raises:
            StateError: a wrong shape, or numbers that are not finite.
            ImpactError: no points, a fixed point, a singular direction, a coefficient out of its range; or no impulses were found that
                satisfy the law, not even without restitution.
        """

class SeveralImpact:
    """The result of an impact at several points."""
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def qd_plus(self) -> _Vector:
        """Joint velocities after the impact, shape (nv,); rad/s, m/s."""
    @property
    def impulses(self) -> _Matrix:
        """Impulses on the robot, shape (K, 3) for K points, world axes, N s. Where points are redundant (three on one body), other
        impulses with the same effect on the motion are possible.
        """
    @property
    def u_minus(self) -> _Matrix:
        """Velocities of the points before the impact, shape (K, 3), world axes, m/s."""
    @property
    def u_plus(self) -> _Matrix:
        """Velocities of the points after the impact, shape (K, 3), world axes, m/s."""
    @property
    def energy_before(self) -> float:
        """Kinetic energy of the robot before the impact, J."""
    @property
    def energy_after(self) -> float:
        """Kinetic energy of the robot after the impact, J."""
    @property
    def residual(self) -> float:
        """Violation of the law, relative to the largest velocity of a point, at most 1e-9."""
    @property
    def flags(self) -> list[str]:
        """Notes about the result, as for Impact; and "without-restitution": no impulses satisfy the law with the coefficients of
        restitution given, and the result is that with all of them zero, as in scenes.
        """

class ContactProblem:
    """A contact problem: impulses p and velocities u = u_free + H p that obey the laws of the constraints.

    The rows of a contact are its two tangents and its normal, which points from the environment to the robot; a contact in the plane
    has zeros in the row and column of its second tangent. Every other constraint has one row. `carom.fclib` reads and writes
    problems of contacts in the format of the field's collections. Immutable.

    Args:
        delassus: H = J M⁻¹ Jᵀ, shape (n, n), 1/kg: symmetric, positive semidefinite, singular where constraints are redundant.
        u_free: velocities without impulses, shape (n,), m/s.
        friction: Coulomb's coefficient, a number or shape (K,) for K constraints; of contacts alone. Default 0.
        restitution: Newton's coefficient (Poisson's, the energetic one under these laws), a number or shape (K,). Default 0.
        u_minus: velocities before, to which restitution refers, shape (n,); None: u_free, an impact without forces.
        kinds: of each constraint "contact", "stop" (a contact or joint limit without friction), "dry" (dry friction of a joint) or
            "held" (the row's velocity is 0); None: contacts only.
        bounds: the largest impulse of dry friction, N s, shape (K,); used for "dry" alone.

    Raises:
        StateError: a wrong shape.
        ImpactError: a matrix that is not symmetric and positive semidefinite, a coefficient out of its range.
    """
    @property
    def bounds(self) -> _Vector:
        """The largest impulse of dry friction, N s, shape (K,); inf for the other constraints."""
    @property
    def restitution(self) -> _Vector:
        """Coefficient of restitution of each constraint, shape (K,); 0 for those without one."""
    @property
    def friction(self) -> _Vector:
        """Coulomb's coefficient of each constraint, shape (K,); 0 for those without one."""
    @property
    def kinds(self) -> list[str]:
        """The kind of each constraint: "contact", "stop", "dry" or "held"."""
    @property
    def u_minus(self) -> _Vector:
        """Velocities before, shape (n,), m/s."""
    @property
    def u_free(self) -> _Vector:
        """Velocities without impulses, shape (n,), m/s."""
    @property
    def delassus(self) -> _Matrix:
        """H, shape (n, n), 1/kg."""
    def __new__(
        cls,
        delassus: ArrayLike,
        u_free: ArrayLike,
        *,
        friction: ArrayLike | None = None,
        restitution: ArrayLike | None = None,
        u_minus: ArrayLike | None = None,
        kinds: Sequence[str] | None = None,
        bounds: ArrayLike | None = None,
    ) -> Self: ...
    def solve(
        self,
        *,
        law: str = "moreau",
        tolerance: float = 1e-12,
        max_iterations: int = 2000,
        start: ArrayLike | None = None,
        relative_stiffness: ArrayLike | None = None,
        exponent: float | None = None,
    ) -> ContactSolution:
        """Solves the problem.

        Args:
            law: "moreau" (restitution of velocities, all constraints at once; with restitution 0 Coulomb's law and Signorini's condition),
                "poisson", "sequential" or "energetic", as for `Chain.impact_at_points`.
            tolerance: residual, relative to the largest velocity, at which the iteration ends.
            max_iterations: the largest number of sweeps and Newton steps; of "sequential" of impacts.
            start: under "moreau" impulses to begin with, shape (n,), N s.
            relative_stiffness, exponent: as for `Chain.impact_at_points`; the stiffnesses have shape (K,).

        Returns:
            A ContactSolution. A problem without a solution, or whose solution is not found, is no error: its residual is above the
            tolerance, and `solved` is False.

        Raises:
            StateError: a wrong shape.
            ImpactError: an unknown law; friction under "energetic"; arguments that the law does not use.
        """

class ContactSolution:
    """The impulses and velocities of a contact problem. Immutable."""
    @property
    def flags(self) -> list[str]:
        """Notes about the solution: "energy-gain", "no-approach" (no impulses are needed), "non-unique" (other impulses give other
        velocities).
        """
    @property
    def solved(self) -> bool:
        """Whether the residual is within the tolerance."""
    @property
    def energy_change(self) -> float:
        """Work of the impulses at the mean of the velocities before and after, J."""
    @property
    def iterations(self) -> int:
        """Number of sweeps and Newton steps; of "sequential" of impacts."""
    @property
    def residual(self) -> float:
        """Violation of the law, relative to the largest velocity."""
    @property
    def u_plus(self) -> _Vector:
        """Velocities after, shape (n,), m/s."""
    @property
    def impulse(self) -> _Vector:
        """Impulses on the robot along the rows, shape (n,), N s."""
    def __new__(cls, _: Never, /) -> Self: ...

class Impact:
    """An impact of a chain at one state."""
    def __new__(cls, _: Never, /) -> Self: ...
    def plot(self, axes: Any = None) -> Any:
        """Draws the velocities of the contact point before and after, and the impulse, by world axes, with matplotlib.

        Args:
            axes: two Axes to draw into; new ones by default.

        Returns:
            The Axes.

        Raises:
            ImportError: matplotlib is not installed.
        """
    @property
    def qd_plus(self) -> _Vector:
        """Joint velocities after the impact, shape (nv,); rad/s, m/s."""
    @property
    def impulse(self) -> _Vector:
        """Impulse on the robot, shape (3,), world axes, N s."""
    @property
    def u_minus(self) -> _Vector:
        """Velocity of the contact point before the impact, shape (3,), world axes, m/s."""
    @property
    def u_plus(self) -> _Vector:
        """Velocity of the contact point after the impact, shape (3,), world axes, m/s."""
    @property
    def energy_before(self) -> float:
        """Kinetic energy of the robot before the impact, J."""
    @property
    def energy_after(self) -> float:
        """Kinetic energy of the robot after the impact, J."""
    @property
    def energy_ratio(self) -> float:
        """T⁺/T⁻ of the robot; 1 at rest."""
    @property
    def mode(self) -> _Mode:
        """Contact mode at the end of the impact: "open", "stick", "slip" or "reverse-slip"."""
    @property
    def law(self) -> str:
        """Name of the law."""
    @property
    def flags(self) -> list[str]:
        """Names of the flags that are set, of "energy-gain", "jam", "singular", "grazing", "non-unique", "no-approach"."""
    @property
    def normal_work(self) -> float:
        """Work of the normal impulse, J."""
    @property
    def friction_work(self) -> float:
        """Work of the tangential impulse, J."""
    @property
    def drive_impulse(self) -> _Vector:
        """Impulse of the drives on each joint, shape (nv,), N m s or N s; zeros with free joints."""
    @property
    def drive_work(self) -> float:
        """Work of the drives, J."""
    @property
    def derivatives(self) -> dict[str, _Floats] | None:
        """With derivatives=True a dict of the derivatives of qd_plus: "q" and "qd" of shape (nv, nv), "restitution" and "friction"
        of shape (nv,). Column k of "q" is the derivative along the motion with unit qd[k]. Else None.
        """
    @property
    def band(self) -> dict[str, Any] | None:
        """With band=… a dict of bounds over the ranges of the coefficients: "qd_plus" of shape (nv, 2), "u_plus" and "impulse" of
        shape (3, 2), "exact" (False: sampled, possibly too narrow) and "evaluations". Else None.
        """
    @property
    def saltation(self) -> dict[str, Any] | None:
        """With saltation=True a dict: "matrix" of shape (2nv, 2nv), which maps small changes of (q, qd) before the impact to those
        after it; "closing", the rate of the gap before, m/s; "time", the derivative of the time of the impact, shape (2nv,).
        Else None.
        """

class Impacts:
    """Impacts of a batch of B states.

    `impacts[k]` is the Impact of state k; a slice, an array of numbers or one of B booleans gives the Impacts of these states. Its arrays
    are read-only: copy one to change it.
    """
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def law(self) -> str:
        """Name of the law."""
    @property
    def flag_bits(self) -> NDArray[np.uint8]:
        """The flags as an array of uint8 of shape (B,), with bits as in carom.Flags; 0 for an ordinary impact."""
    @property
    def energy_ratio(self) -> _Vector:
        """T⁺/T⁻ of the robot, shape (B,); 1 at rest."""
    def __len__(self) -> int: ...
    @overload
    def __getitem__(self, index: int | np.integer[Any]) -> Impact: ...
    @overload
    def __getitem__(
        self, index: slice | Sequence[int] | Sequence[bool] | NDArray[np.integer[Any]] | NDArray[np.bool_]
    ) -> Impacts: ...
    def __iter__(self) -> Iterator[Impact]: ...
    @property
    def qd_plus(self) -> _Matrix:
        """Joint velocities after the impacts, shape (B, nv); rad/s, m/s."""
    @property
    def impulse(self) -> _Matrix:
        """Impulses on the robot, shape (B, 3), world axes, N s."""
    @property
    def u_minus(self) -> _Matrix:
        """Velocities of the contact point before, shape (B, 3), world axes, m/s."""
    @property
    def u_plus(self) -> _Matrix:
        """Velocities of the contact point after, shape (B, 3), world axes, m/s."""
    @property
    def energy_before(self) -> _Vector:
        """Kinetic energies of the robot before, shape (B,), J."""
    @property
    def energy_after(self) -> _Vector:
        """Kinetic energies of the robot after, shape (B,), J."""
    @property
    def normal_work(self) -> _Vector:
        """Works of the normal impulses, shape (B,), J."""
    @property
    def friction_work(self) -> _Vector:
        """Works of the tangential impulses, shape (B,), J."""
    @property
    def drive_work(self) -> _Vector:
        """Works of the drives, shape (B,), J."""
    @property
    def drive_impulse(self) -> _Matrix:
        """Impulses of the drives on each joint, shape (B, nv), N m s or N s."""
    @property
    def mode(self) -> NDArray[np.str_]:
        """Contact modes at the end of the impacts, an array of texts of shape (B,): "open", "stick", "slip", "reverse-slip"."""
    @property
    def flags(self) -> list[list[str]]:
        """The names of the flags that are set at each state, a list of B lists of texts, as `Impact.flags`."""
    def flagged(
        self, name: Literal["energy-gain", "jam", "singular", "grazing", "non-unique", "no-approach"]
    ) -> NDArray[np.bool_]:
        """The states at which a flag is set, an array of booleans of shape (B,).

        Args:
            name: "energy-gain", "jam", "singular", "grazing", "non-unique" or "no-approach".

        Raises:
            ImpactError: an unknown name.
        """
    @property
    def derivatives(self) -> dict[str, _Floats] | None:
        """With derivatives=True a dict of the derivatives of qd_plus: "q" and "qd" of shape (B, nv, nv), "restitution" and
        "friction" of shape (B, nv). Else None.
        """

class Outcome:
    """The outcome of a law on plain numbers, in contact axes: tangents first, normal last."""
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def law(self) -> str:
        """Name of the law."""
    @property
    def impulse(self) -> _Floats:
        """Impulse on the robot, shape of u, N s."""
    @property
    def u_minus(self) -> _Floats:
        """Contact velocity before, m/s."""
    @property
    def u_plus(self) -> _Floats:
        """Contact velocity after, m/s."""
    @property
    def mode(self) -> _Mode:
        """Contact mode at the end: "open", "stick", "slip" or "reverse-slip"."""
    @property
    def flags(self) -> list[str]:
        """Names of the flags that are set."""
    @property
    def energy_before(self) -> float:
        """Kinetic energy in contact space before, ½ uᵀ H⁻¹ u, J."""
    @property
    def energy_after(self) -> float:
        """Kinetic energy in contact space after, J."""
    @property
    def energy_ratio(self) -> float:
        """T⁺/T⁻ in contact space; 1 at rest."""
    @property
    def normal_work(self) -> float:
        """Work of the normal impulse, J."""
    @property
    def friction_work(self) -> float:
        """Work of the tangential impulse, J."""
    @property
    def coefficients(self) -> dict[str, float | None]:
        """The realised coefficients of restitution: a dict of "newton", "poisson", "energetic"; None where not defined."""

class Diagram(dict[str, Any]):
    """A diagram of one impact, the dict of ``carom.diagram``, with its picture in notebooks."""
    def plot(self, axes: Any = None) -> Any:
        """Draws the diagram with matplotlib.

        Args:
            axes: the Axes to draw into; new ones by default.

        Returns:
            The Axes.

        Raises:
            ImportError: matplotlib is not installed.
        """

class Table:
    """A table of named columns.

    `table["name"]` is a column as an array; `numpy`, `to_pandas` and `to_polars` convert the whole table, as does any library that
    reads `__arrow_c_stream__` (pyarrow.table(table), duckdb, …).
    """
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
    def __len__(self) -> int: ...
    def __contains__(self, name: str) -> bool: ...
    def __getitem__(self, name: str) -> NDArray[Any]: ...
    def numpy(self) -> dict[str, NDArray[Any]]:
        """All columns: a dict from names to arrays."""
    def to_pandas(self) -> Any:
        """A pandas.DataFrame; needs pandas."""
    def to_polars(self) -> Any:
        """A polars.DataFrame; needs polars."""
    def plot(self, y: str, x: str | None = None, axes: Any = None) -> Any:
        """Draws a column over another one with matplotlib.

        Args:
            y: name of the column.
            x: name of the other one; the first column by default.
            axes: the Axes to draw into; new ones by default.

        Returns:
            The Axes.

        Raises:
            KeyError: no column has the name.
            ImportError: matplotlib is not installed.
        """
    def write(self, path: _Path) -> None:
        """Writes the table as CSV or Parquet, by the ending of the name. A Parquet file has units, carom's version and the text of the
        scene or study in its metadata.

        Raises:
            StudyError: the file cannot be written, or its name has another ending.
        """
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> CapsuleType: ...

class Scene:
    """A scene: a robot, the surfaces around it, contact laws and run settings. Immutable.

    Make one with `Scene.from_file`, `Scene.from_toml` or `Scene.from_dict`; the page "Scene keys" of the manual lists the keys.
    """
    @property
    def folder(self) -> str:
        """The folder to which names of files in the keys are relative."""
    """A scene: a robot, the surfaces around it, contact laws and run settings. Immutable.

    Make one with `Scene.from_file`, `Scene.from_toml` or `Scene.from_dict`; the page "Scene keys" of the manual lists the keys.
    """
    def __new__(cls, _: Never, /) -> Self: ...
    @staticmethod
    def from_file(path: _Path) -> Scene:
        """Reads a scene file (TOML), its robot and its meshes.

        Raises:
            SimulationError: a key or a value that breaks a rule; the message names file, key, value and rule.
            UrdfError, StateError: an invalid robot or start.
        """
    @staticmethod
    def from_toml(text: str, folder: _Path = ".") -> Scene:
        """Reads a scene from the text of a scene file; file names in it are relative to `folder`, by default
        the working folder. Errors as `from_file`.
        """
    @staticmethod
    def from_dict(keys: Mapping[str, Any], folder: _Path = ".") -> Scene:
        """Reads a scene from a dict with the keys of a scene file; file names in it are relative to `folder`, by default
        the working folder. Errors as `from_file`.
        """
    @property
    def chain(self) -> Chain:
        """The robot."""
    @property
    def q(self) -> _Vector:
        """Configuration at the start, shape (nq,)."""
    @property
    def qd(self) -> _Vector:
        """Joint velocities at the start, shape (nv,)."""
    @property
    def duration(self) -> float:
        """Duration of a run, s."""
    @property
    def surfaces(self) -> list[str]:
        """Names of the surfaces."""
    @property
    def contacts(self) -> list[str]:
        """Names of the possible contacts."""
    @property
    def warnings(self) -> list[str]:
        """Warnings, one sentence each."""
    def to_dict(self) -> dict[str, Any]:
        """The keys of the scene, for `from_dict`; names of files in them are relative to `folder`, so that
        `Scene.from_dict(scene.to_dict(), folder=scene.folder)` is this scene.

        Raises:
            ValueError: a law or a controller was given after reading, or another start to a scene of several robots or with segments:
                no keys say it.
        """
    def with_start(self, q: ArrayLike | None = None, qd: ArrayLike | None = None) -> Scene:
        """The same scene from another start.

        Args:
            q, qd: shapes (nq,) and (nv,); what is not given is kept.
        """
    def with_keys(self, changes: Mapping[str, Any]) -> Scene:
        """The same scene with other keys: gains, gravity, coefficients, masses, whatever a scene file says.

        Args:
            changes: values by the path of their key, such as {"run.gravity": [0, 0, -1.62], "contact.restitution": 0.8,
                "surface[0].contact.friction": 0.1, "robot.mass": {"hand": 0.9}}. A dict as value changes the keys that it has, and keeps the
                others; None takes a key out; any other value replaces what is there.

        Laws and the controller in Python, start and duration of this scene are kept; where a key is changed, it counts, and one that would not
        is an error.

        Raises:
            SimulationError, UrdfError, StateError: as `from_dict`, with the path of the key.
            ValueError: a path that leads nowhere; a start of several robots that is in no key; keys of a law or a controller that was given in
                their place.
        """
    def with_duration(self, duration: float) -> Scene:
        """The same scene with another duration, s.

        Raises:
            SimulationError: a duration that is not positive and finite.
        """
    def with_law(self, law: _AnyLaw, *, link: str | None = None, surface: str | None = None) -> Scene:
        """The same scene with another impact law at its contacts with surfaces and between links.

        Args:
            law: a law like carom.Energetic(0.5, 0.2), or carom.PythonLaw(function, restitution, friction).
            link: only at contacts of this link.
            surface: only at contacts with this surface or second link.

        Raises:
            ValueError: no contact of the scene is meant.
        """
    def with_controller(
        self, function: Callable[[float, _Floats, _Floats], ArrayLike], *, rate: float | None = None
    ) -> Scene:
        """The same scene with motors that a function in Python drives, instead of the controllers of the scene.

        Args:
            function: called as `function(time, q, qd)` with the time in s and arrays of shapes (nq,) and (nv,) of the whole chain
                (`scene.chain`); returns the joint forces, shape (nv,), N m and N. The entries of floating and planar joints are
                not used: no motor drives them.
            rate: calls per second, from the start on; the forces are constant between the calls. None: the forces are a
                continuous function of time and state. The integrator then calls the function some hundred to some thousand times
                for each simulated second, also at states that it tries and rejects, so the function must not remember earlier
                calls. A call costs some microseconds and holds the GIL.

        Raises:
            TypeError: function cannot be called.
            ValueError: a rate that is not positive.
        """
    def feedback(
        self,
        *,
        position: float = 0.01,
        velocity: float = 0.1,
        torque: float = 1.0,
        end: float = 1.0,
        joints: Sequence[str] | None = None,
        rows: int = 200,
        table: str = "feedback.csv",
    ) -> dict[str, Any]:
        """Feedback along the motion of this scene, through its impacts: the gains of the linear-quadratic regulator.

        Args:
            position, velocity, torque: deviations that cost the same: of each displacement (rad, m), each velocity (rad/s, m/s) and the
                force of each motor (N m, N).
            end: for how long a deviation lasts that costs what it costs at the end of the motion, s.
            joints: names of those that have feedback; by default those with forces in the motion, or all.
            rows: least number of rows of the table.
            table: the name that the scene file gives its table.

        Returns:
            A dict with the JSON keys of ``carom feedback --help``: rows, motors, impacts, growth; and scene, the text of a scene file with
            the feedback, for the folder of this scene; and table, the text of its table (CSV).

        Raises:
            SimulationError: a controller with feedback; a motion without derivatives; a deviation that is not positive.
            ValueError: a law or a controller was given after reading.
        """
    def plan(self) -> dict[str, Any]:
        """What a run models and what it leaves out: a dict of "joints", "kept" and "left_out" (dicts of what, choice, why) and
        "bounded" (dicts of what, choice, bound, of).

        Raises:
            SimulationError, ChainError: an invalid mesh, a singular mass matrix at the start.
        """
    def runs(self, count: int, *, shard: tuple[int, int] | None = None) -> Table:
        """Runs the scene `count` times with the disturbances of `[run] perturb` of the scene, on all cores.

        Args:
            count: number of runs.
            shard: (part, parts), counted from 1: computes this part of the runs only. A row depends on its number only, so that the parts in
                order are the whole table, wherever they are computed.

        Returns:
            A Table with a row for each run: run (0 has no disturbance), outcome ("duration", "events", "refused"), impacts,
            first_impact (s), events, same_events (1 if they are those of run 0); the disturbed numbers of the scene; start.q.<joint>,
            start.qd.<joint>; end.time, end.q.<joint>, end.qd.<joint>; energy_start, energy_end, lost_in_impacts, energy_error (J).

        Raises:
            SimulationError: the scene has no disturbance, or one of a key that it does not have.
            ValueError: the scene has a controller with a rate; no such part.
        """
    def simulate(self, *, sample: float | None = None, loads: bool = False, error: bool = False) -> Run:
        """Simulates the scene from event to event. The GIL is released, except while a function in Python is called.

        Args:
            sample: time between samples, s; by default that of the scene, or 0.004 s.
            loads: computes the forces of the motors at each sample (`Run.motors`), and the loads on the joints at each impact
                (`Run.loads`, `Event.loads`).
            error: estimates the errors of the samples, of the end and of the times of events, by one or two more runs with tighter tolerances
                (`Run.error`, `Run.q_error`, `Run.qd_error`, `Event.time_error`).

        Raises:
            SimulationError: an overlap at the start, a motion that cannot be continued, an `accuracy` that no tolerance meets. Exceptions of a
                law or a controller in Python are passed on as they are.
            ValueError: `error` or an `accuracy` with a controller with a rate.
        """
    def sensitivity(self, wrt: Sequence[str] | None = None) -> Sensitivity:
        """The derivatives of the whole run: of the final state and of the times of events, by the start and by parameters.
        The GIL is released, except while a law in Python is called.

        Args:
            wrt: by what, in the order of the columns. "q" and "qd" are the whole start, "q elbow" a part of it; parameters are "restitution"
                and "friction" of all contacts together, "kp elbow", "kd elbow", "target elbow" or "torque elbow" of each joint under PD
                control or constant forces, and any number of the scene by the path of its key, as in `with_keys`: "contact.friction",
                "run.gravity[2]", "surface[0].contact.restitution". Rows of tables have numbers: "torque elbow 3", "reference elbow 3". A name stands
                for all that begin with it: "kp", "torque elbow". By default all but the keys.

        Raises:
            ValueError: a name that the scene does not have; a key that is no number, or that changes the start or the duration; a controller
                with a rate.
            SimulationError: as `simulate`; a key that changes the joints or the possible contacts. A run that is not differentiable is no
                error: see `Sensitivity.broken`.
        """
    def linear_run(self, wrt: Sequence[str] | None = None) -> LinearRun:
        """The whole run as a linear map, whose transpose gives the gradient of a number by the start and by parameters.
        The GIL is released, except while a law in Python is called.

        Args:
            wrt: as of `sensitivity`.

        Raises:
            ValueError: as `sensitivity`.
            SimulationError: as `sensitivity`; a run that is not differentiable, with time and reason.
        """
    def session(self) -> Session:
        """Starts a Session: a simulation that a loop of one's own advances.

        Raises:
            SimulationError: an overlap at the start.
            ValueError: the scene has a controller with a rate.
        """

class Session:
    """A simulation that a loop advances: read state and contacts, set joint forces, advance. Made by `Scene.session`.

    q and qd have the coordinates of `session.chain`, the reduced chain of the scene's plan. One thread at a time may use a session.
    """
    @property
    def motors(self) -> _Vector:
        """Forces of the motors now, after their limits, under the present joint forces, shape (nv,); N m, N."""
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def chain(self) -> Chain:
        """The simulated robot."""
    @property
    def time(self) -> float:
        """Time, s."""
    @property
    def q(self) -> _Vector:
        """Configuration, shape (nq,); rad, m, quaternion."""
    @property
    def qd(self) -> _Vector:
        """Joint velocities, shape (nv,); rad/s, m/s."""
    @property
    def mode(self) -> str:
        """The contact mode: "free", "sliding", "sticking", "latched", "pressing" or "stepping"."""
    @property
    def contacts(self) -> Table:
        """The lasting contacts, with their forces under the present joint forces; a Table with the columns of `Run.contacts`."""
    @property
    def energy(self) -> dict[str, float]:
        """Energy balance since the start; the dict of `Run.energy`."""
    def set_forces(self, forces: ArrayLike) -> None:
        """Sets constant joint forces instead of the controller, from now on.

        Args:
            forces: shape (nv,), N m and N. The entries of a floating or planar joint are forces and torques on it.

        Raises:
            StateError: a wrong shape, numbers that are not finite.
        """
    def advance(self, duration: float, *, loads: bool = False) -> list[Event]:
        """Advances by a duration (s); returns the events in it, with loads=True with `Event.loads`. Ctrl-C ends it.

        Raises:
            SimulationError: a motion that cannot be continued, more events than max_events. The session then stays where it was.
                Exceptions of a law or a controller in Python are passed on as they are.
        """
    def advance_to_event(self, longest: float, *, loads: bool = False) -> list[Event]:
        """Advances to the next event, by `longest` seconds at most; returns the events of its time, an empty list if there is none.
        Loads and errors as `advance`.
        """
    def contact_problem(self, step: float) -> ContactProblem:
        """The contact problem of a time step of this length (s) from the present state, as time steps of the scene pose it (Moreau–Jean,
        θ = ½): contacts that are closed after half a step with the present velocities, joint limits and joints with dry friction.

        Raises:
            SimulationError: a step that is not > 0, and errors of the computation of forces.
        """
    def save(self) -> SessionState:
        """The whole state, for `restore`: time, q, qd, the contacts and what they remember. The joint forces are not part of it."""
    def restore(self, state: SessionState) -> None:
        """Returns to a saved state of this session or of another one of the same scene.

        Raises:
            SimulationError: a state of a scene with other joints or contacts.
        """
    def restart(self, q: ArrayLike, qd: ArrayLike) -> None:
        """Starts again from another state at the present time; contacts, energies and the count of events begin anew.

        Args:
            q, qd: shapes (nq,) and (nv,).

        Raises:
            StateError: a wrong shape, numbers that are not finite, a quaternion that is not a unit quaternion.
            SimulationError: an overlap.
        """

class SessionState:
    """A saved state of a Session, for `Session.restore`."""
    def __new__(cls, _: Never, /) -> Self: ...

class Run:
    """A run of a scene.

    q and qd have the coordinates of `run.chain`, all joints of the scene.
    """
    @property
    def qd_error(self) -> _Matrix:
        """The estimated errors of qd at the samples, shape (S, nv); rad/s, m/s. Needs `simulate(error=True)`; NaN where there is no estimate."""
    @property
    def q_error(self) -> _Matrix:
        """The estimated errors of q at the samples, as displacements, shape (S, nv); rad, m. Needs `simulate(error=True)`; NaN where there
        is no estimate.
        """
    @property
    def error(self) -> dict[str, Any] | None:
        """The estimated errors of the end, a dict: tighter (the tolerances of the runs that tell them), final (a dict of q, as a
        displacement of nv numbers, and qd), or unknown (a dict of time and reason) instead of it. None without `simulate(error=True)`.
        """
    @property
    def motors(self) -> _Matrix:
        """Forces of the motors at the samples, after their limits, shape (S, nv); N m, N. Needs `simulate(loads=True)`."""
    def __new__(cls, _: Never, /) -> Self: ...
    def plot(self, axes: Any = None) -> Any:
        """Draws q and qd over time, with a line at each impact, with matplotlib.

        Args:
            axes: two Axes to draw into; new ones by default.

        Returns:
            The Axes.

        Raises:
            ImportError: matplotlib is not installed.
        """
    @property
    def chain(self) -> Chain:
        """The simulated robot."""
    @property
    def time(self) -> _Vector:
        """Times of the samples, shape (S,), s. At the time of an event the sample is the state before it."""
    @property
    def q(self) -> _Matrix:
        """Configurations at the samples, shape (S, nq); rad, m, quaternions."""
    @property
    def qd(self) -> _Matrix:
        """Joint velocities at the samples, shape (S, nv); rad/s, m/s."""
    @property
    def events(self) -> list[Event]:
        """The events in the order of time, a list of Event."""
    @property
    def states(self) -> Table:
        """The samples as a Table: time, then q.<joint>, qd.<joint>, with loads motor.<joint>, and with errors error.q.<joint> and
        error.qd.<joint>; joints with several coordinates have numbered columns.
        """
    @property
    def loads(self) -> Table:
        """The loads of the impacts as a Table, a row for each joint at each impact: time (s), kind of the event, joint; the impulse of its
        parent link on its child link fx, fy, fz (N s) and its moment mx, my, mz (N m s) about the origin of the child link, in the axes
        of the child link; of joints with one coordinate joint_impulse (Jᵀp; N m s, N s), motor_minus and motor_plus (force of the motor
        before and after; N m, N). Needs `simulate(loads=True)`.
        """
    @property
    def event_table(self) -> Table:
        """The events as a Table: time (s), kind, contact, mode of an impact, the impulse of all contacts px, py, pz (N s, world
        axes), then q.<joint>, qd_minus.<joint>, qd_plus.<joint>, and with errors time_error (s).
        """
    @property
    def contacts(self) -> Table:
        """The lasting contacts at the samples as a Table: time (s), contact, mode, point x, y, z (m), unit normal nx, ny, nz from the
        environment to the robot, gap (m; rad), force on the robot fx, fy, fz (N, world axes), normal_force (N; N m at a limit),
        flags ("non-unique" where the motion depends on how forces are distributed, else "").
        """
    @property
    def stop_reason(self) -> Literal["duration", "events"]:
        """Why the run has ended: "duration" or "events"."""
    @property
    def mode(self) -> str:
        """Contact mode at the end."""
    @property
    def last(self) -> tuple[float, _Vector, _Vector]:
        """The end: a tuple of the time (s), q (nq,) and qd (nv,)."""
    @property
    def warnings(self) -> list[str]:
        """What to know of the results: an energy balance that does not close, impulses that do not satisfy their law, missing loads. They are raised as
        Python warnings, too.
        """
    @property
    def energy(self) -> dict[str, float]:
        """Energy balance, a dict in J: end = start + drive + resistance - lost_in_impacts + error."""
    @property
    def statistics(self) -> dict[str, float]:
        """Work of the solvers, a dict of numbers. `carom simulate --help` says what each means."""

class Sensitivity:
    """The derivatives of a whole run: of its final state and of the times of its events. `Scene.sensitivity` makes one.

    The columns are numbers of the start (a displacement of q, qd) and parameters, in the order of `names`.
    """
    @property
    def rows(self) -> list[str]:
        """Names of the rows of `last_by`: "q shoulder", "qd shoulder"."""
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def names(self) -> list[str]:
        """Names of the columns: "q shoulder", "qd shoulder", "restitution", "kp elbow"; of a joint with several coordinates with a
        number, "q base 3".
        """
    @property
    def last(self) -> tuple[float, _Vector, _Vector]:
        """Time (s), q and qd at the end, of the joints that the plan keeps."""
    @property
    def rate(self) -> _Vector:
        """The rate of the final displacement and velocity, (qd, acceleration), shape (2 nv,); of a run that ends with an event that after it."""
    @property
    def last_by(self) -> _Floats | None:
        """Derivatives of the final displacement and velocity, shape (2 nv, columns); of a floating joint the displacement is along
        and about the axes of its link. None if the derivatives end before.
        """
    @property
    def events(self) -> list[Event]:
        """The events of the run in the order of time, a list of Event, with the derivatives of their times: `Event.time_by`."""
    @property
    def broken(self) -> dict[str, Any] | None:
        """Where and why the derivatives end: a dict of time (s) and reason; None if they reach the end."""

class LinearRun:
    """A run as a linear map, from changes of its start and parameters to those of its end and of the times of its events, and its transpose:
    `jvp` and `vjp`. `Scene.linear_run` makes one.
    """
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def names(self) -> list[str]:
        """Names of the numbers by which the run is differentiated, as `Sensitivity.names`."""
    @property
    def last(self) -> tuple[float, _Vector, _Vector]:
        """Time (s), q and qd at the end, of the joints that the plan keeps."""
    @property
    def events(self) -> list[tuple[float, list[str]]]:
        """The times of the events (s), each with the names of what happens."""
    def jvp(self, change: ArrayLike) -> tuple[_Floats, _Floats]:
        """The changes of the final displacement and velocity, shape (2 nv,), and of the times of the events, by a change of the numbers of
        `names`, shape (columns,), or of a batch of B of them, shape (B, columns): then (B, 2 nv) and (B, events). Changes of times whose digits
        do not count are nan.

        Raises:
            StateError: a wrong number of changes.
        """
    def vjp(self, last: ArrayLike, times: ArrayLike | None = None) -> _Floats:
        """The gradient of a number by the numbers of `names`, shape (columns,), from its derivatives by the final displacement and
        velocity, shape (2 nv,), and by the times of the events, shape (events,); of B numbers at once from (B, 2 nv) and (B, events), shape (B,
        columns).

        Raises:
            StateError: a wrong number of derivatives.
            SimulationError: a derivative by a time whose digits do not count.
        """

class Event:
    """An event of a run."""
    @property
    def time_error(self) -> float | None:
        """The estimated error of the time, s, of a run with `simulate(error=True)`; else None, and for an event that runs with tighter
        tolerances do not have.
        """
    @property
    def time_by(self) -> _Vector | None:
        """Derivatives of the time by the columns `Sensitivity.names`, shape (columns,), for the events of a Sensitivity; None for events of
        runs and where the derivatives have ended.
        """
    @property
    def loads(self) -> _EventLoads | None:
        """The loads on the joints, for the kinds "impact", "several", "latch" and "limit" of `simulate(loads=True)`; else None. A dict as of
        `Chain.impact_loads`, with motors_minus and motors_plus, the forces of the motors before and after (nv,), N m and N.
        """
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def time(self) -> float:
        """Time, s."""
    @property
    def kind(self) -> str:
        """"impact", "several", "latch", "limit", "zeno", "lift-off", "joint-stops", "joint-moves", "stepping", "non-unique", "rest",
        or the new contact mode.
        """
    @property
    def contact(self) -> str | None:
        """Name of the contact or the joint, None if the event belongs to none or to several."""
    @property
    def contacts(self) -> list[str]:
        """Names of the contacts of an event of the kind "several" or "non-unique"; else empty."""
    @property
    def reason(self) -> str | None:
        """Why, for the kinds "stepping" and "non-unique"; else None."""
    @property
    def flags(self) -> list[str]:
        """Names of the flags of an event of the kind "several": "energy-gain", "non-unique"; else empty."""
    @property
    def q(self) -> _Vector:
        """Configuration, shape (nq,)."""
    @property
    def qd_minus(self) -> _Vector:
        """Joint velocities before, shape (nv,)."""
    @property
    def qd_plus(self) -> _Vector:
        """Joint velocities after, shape (nv,)."""
    @property
    def impact(self) -> Impact | None:
        """The Impact, for an event of the kind "impact"; else None."""
    @property
    def impulses(self) -> list[tuple[str, _Floats, _Floats]]:
        """The impulses on the robot: a list of tuples of the contact, the point (3,) in m and the impulse (3,) in N s, world axes."""

class Study:
    """A study: an impact map over poses, approach angles, speeds, coefficients and laws. Immutable.

    Make one with `Study.from_file`, `Study.from_toml` or `Study.from_dict`; the page "Study keys" of the manual lists the keys, the
    columns and the classes.
    """
    def __new__(cls, _: Never, /) -> Self: ...
    @staticmethod
    def from_file(path: _Path) -> Study:
        """Reads a study file (TOML) and its robot.

        Raises:
            StudyError: a key or a value that breaks a rule; the message names file, key, value and rule.
            UrdfError: an invalid robot.
        """
    @staticmethod
    def from_toml(text: str, folder: _Path = ".") -> Study:
        """Reads a study from the text of a study file; file names in it are relative to `folder`. Errors as `from_file`."""
    @staticmethod
    def from_dict(keys: Mapping[str, Any], folder: _Path = ".") -> Study:
        """Reads a study from a dict with the keys of a study file; file names in it are relative to `folder`. Errors as `from_file`."""
    def __len__(self) -> int: ...
    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
    @property
    def units(self) -> dict[str, str]:
        """Units of the columns: a dict; empty texts for words and dimensionless numbers."""
    @property
    def axes(self) -> list[tuple[str, int]]:
        """The axes that vary, in the order of the rows: a list of pairs of a name and the number of its values. The last axis varies
        fastest.
        """
    @property
    def chain(self) -> Chain:
        """The robot."""
    @property
    def warnings(self) -> list[str]:
        """Warnings, one sentence each."""
    def table(self, start: int = 0, stop: int | None = None) -> Table:
        """Computes the whole map, or the rows from `start` up to `stop`, as a Table in memory. Ctrl-C ends it."""
    def write(self, path: _Path, *, resume: bool = False) -> None:
        """Computes the map into a file in constant memory, as CSV or Parquet by the ending of the name. Ctrl-C or a full disk leaves
        a partial file, from which resume=True continues.

        Raises:
            StudyError: the file cannot be written, another process writes it, or the partial file cannot be continued.
        """
    def svg(self, column: str, *, log: bool = ...) -> str:
        """One column of the map as a picture, the text of an SVG; log=True: its numbers on a logarithmic scale."""
    def advise(self) -> dict[str, Any]:
        """The best rows under the conditions in [advise] of the study: a dict of "column", "goal", "fulfil" (number of rows that
        fulfil them), "best_median_worst" (or None) and "best", a list of dicts of "row", "q" (nq,), "values" and, for a redundant
        arm, "self_motion" (q and values at the best pose along its self-motion, or None). The rows of "best" are local optima of the
        map: those without a better neighbour on an axis of numbers.

        Raises:
            StudyError: a study without [advise].
        """

class Fit:
    """The result of a fit."""
    def __new__(cls, _: Never, /) -> Self: ...
    @property
    def fitted_to(self) -> Literal["velocities", "trajectories"]:
        """What was fitted to: "velocities" or "trajectories"."""
    @property
    def law(self) -> str:
        """Name of the law."""
    @property
    def coefficients(self) -> dict[str, dict[str, Any]]:
        """The coefficients: a dict from "restitution", "friction" and, if asked for, "inertia scale" to dicts of "value", "low" and
        "high" (confidence interval) and "interval" (its method).
        """
    @property
    def train(self) -> dict[str, float | None]:
        """Errors of the part that was fitted: a dict of "count", "mean", "median" (m/s for velocities), "below_half", "least" and
        "least_in_cone".
        """
    @property
    def test(self) -> dict[str, float | None] | None:
        """Errors of the rest, as `train`; None if nothing is left."""
    @property
    def errors(self) -> _Vector:
        """Error of each measurement, shape (N,)."""
    @property
    def trained(self) -> list[bool]:
        """Whether each measurement was fitted, a list of booleans."""
    @property
    def notes(self) -> list[str]:
        """Notes for the reader, one sentence each."""
    @property
    def trials(self) -> int:
        """Number of sets of coefficients that were evaluated."""

@overload
def law(H: ArrayLike, u: ArrayLike, law: _AnyLaw, *, branches: Literal[False] = False) -> Outcome:
    """The outcome of an impact law on plain numbers.

    Args:
        H: Delassus matrix (inverse inertia at the contact), shape (3, 3) or in the plane (2, 2), 1/kg.
        u: contact velocity before the impact, shape (3,) or (2,), m/s. The axes are the contact axes: tangents first, normal last;
            the normal points from the environment to the robot, so an approaching contact has u[-1] < 0.
        law: an impact law, a function of H and u, or a list of them.
        branches: returns a list of all outcomes that satisfy the law, the chosen one first.

    Raises:
        StateError: a wrong shape.
        ImpactError: a matrix that is not symmetric or not positive semidefinite, or a law without a solution.
    """
@overload
def law(H: ArrayLike, u: ArrayLike, law: _AnyLaw, *, branches: Literal[True]) -> list[Outcome]: ...
@overload
def law(H: ArrayLike, u: ArrayLike, law: Sequence[_AnyLaw], *, branches: Literal[False] = False) -> list[Outcome]: ...
@overload
def law(H: ArrayLike, u: ArrayLike, law: Sequence[_AnyLaw], *, branches: Literal[True]) -> list[list[Outcome]]: ...
def diagram(H: ArrayLike, u: ArrayLike, friction: float, outcomes: Sequence[Outcome]) -> Diagram:
    """The diagram of one impact with the outcomes of laws, as data to draw.

    In the plane the Routh diagram: the plane of impulses with friction cone, lines of compression and sticking, energy ellipse and
    every law's impulse. In space the hodograph: the plane of slip velocities with the path of the slip and every law's u⁺.

    Args:
        H, u: the problem, as for carom.law.
        friction: Coulomb's coefficient of the lines.
        outcomes: a list of results of carom.law.

    Returns:
        A Diagram: a dict of "title", "axes" (two labels), "window" (shape (2, 2)), "equal_scales", "shapes" (dicts of "name", "colour" (three
        numbers from 0 to 1), "stroke" ("area", "thin", "thick") and "pieces", arrays (n, 2)), "marks" (dicts of "name", "colour",
        "symbol" ("law", "start", "turn", "stop") and "at", shape (2,)) and "svg", the picture.

    Raises:
        ImpactError: the contact does not approach, H is singular, or friction is negative.
    """
@overload
def map(study: Study | _Path | Mapping[str, Any], out: None = None, *, folder: _Path = ".") -> Table:
    """The impact map of a study.

    Args:
        study: a Study, the path of a study file, or a dict with its keys.
        out: a file (X.csv or X.parquet) that is written in constant memory; None gives a Table in memory.
        folder: the folder to which file names in a dict are relative.

    Returns:
        A Table, or None with `out`.

    Raises:
        StudyError, UrdfError: as Study.from_file and Study.write.
    """
@overload
def map(study: Study | _Path | Mapping[str, Any], out: _Path, *, folder: _Path = ".") -> None: ...
def compare(
    *,
    delassus: ArrayLike | None = None,
    u_minus: ArrayLike | None = None,
    u_plus: ArrayLike | None = None,
    chain: Chain | None = None,
    q: ArrayLike | None = None,
    qd_minus: ArrayLike | None = None,
    qd_plus: ArrayLike | None = None,
    frame: str | None = None,
    point: ArrayLike | None = None,
    normal: ArrayLike | None = None,
    data: _Path | Sequence[_Path] | None = None,
    name: str = "impacts",
    folds: int = 5,
    seed: int = 0,
    max_friction: float = 1.0,
    trials: int = 60,
    fitted: int = 60,
    horizon: Literal["whole", "early"] = "early",
    judge: Literal["whole", "early"] = "whole",
    tolerance: float = 1e-5,
    contact_step: float = 1e-3,
    length: float = 0.0524,
) -> dict[str, Any]:
    """Compares all impact laws on measured impacts: each law is fitted to the measurements outside a fold, and judged by those in it.

    The measurements are those of ``fit``: velocities at the contact, or velocities of the joints of a chain; or published ones.

    Args:
        data: path of published measurements, or a list of paths, as for ``carom compare``.
        name: of one's own measurements in the result.
        folds: number of folds, 2 or more.
        seed: of the folds, of the tosses that are fitted, and of the perturbed starts.
        max_friction: largest friction of the search.
        trials, fitted: sets of parameters that each model may try, and tosses to which it is fitted; of tosses and landings.
        horizon, judge: part of the tosses whose error is fitted, and that is judged: "whole", or "early", to 0.1 s after the impact.
        tolerance, contact_step, length: of the simulations of tosses and landings, and of the pose error (m).

    Returns:
        A dict of seed, folds, comparisons (a list of dicts with the JSON keys of ``carom compare --help``), markdown (the tables as a
        text) and svg (pictures by set).

    Raises:
        FitError: too few measurements, an option out of its range, data that cannot be read.
        TypeError: data of no or of several kinds.
    """
def aim(
    problem: _Path | Mapping[str, Any], *, starts: int | None = None, seed: int | None = None, folder: _Path | None = None
) -> dict[str, Any]:
    """Chooses numbers of a scene such that its motion meets conditions, at least cost.

    Args:
        problem: path of a problem file, or its keys as a dict; the page "Reach an aim" of the manual lists them.
        starts: search so many times, each from the nearest to the aim of 20 random draws between the bounds, and keep the least cost; without
            a cost the first that meets the conditions.
        seed: of the random values of starts; by default 0.
        folder: to which the file names in a dict are relative; by default the working folder.

    Returns:
        A dict with the JSON keys of ``carom aim --help``: unknowns, conditions, cost, events, steps, runs, differentiated, end, with ``starts`` also starts; and
        scene, the text of a scene file with what was found, for the folder of the scene of the problem; and torques, the text of its table of
        torques ``torques.csv``, or None.

    Raises:
        StudyError: a problem that cannot be read; a condition that is not met; a motion without an impact of a condition.
        SimulationError: an invalid scene, or a first run that fails or has no derivative.
    """
def orbit(
    problem: _Path | Mapping[str, Any], *, branch: bool = False, doubled: int = 0, folder: _Path | None = None
) -> dict[str, Any]:
    """Finds a periodic orbit of a scene, and follows it over a parameter.

    Args:
        problem: path of a problem file, or its keys as a dict; the page "Find periodic orbits" of the manual lists them.
        branch: follow the orbit over the parameter of ``vary``.
        doubled: with ``branch``: follow also the orbits of twice the period that begin at the first flip, so many times in turn.
        folder: to which the file names in a dict are relative; by default the working folder.

    Returns:
        A dict with the JSON keys of ``carom orbit --help``: start (q and qd, on the section), start_time and period (s), events, multipliers (complex
        numbers as pairs), stability, residual, iterations. With ``branch`` of parameter, points (a list of such dicts, each with its
        parameter), passages (of the section in one period), special (folds, flips, Neimark-Sacker points, changes of the events, moves of the section), ended and
        end (why the branch ends, in a word and in a sentence), and with ``doubled`` doubled (a list of such dicts).

    Raises:
        StudyError: a problem that cannot be read; a motion that does not return to the section; no orbit near the start. A branch without
            a flip, at which doubled ones begin, is a warning.
        SimulationError: an invalid scene, or a run that fails.
    """
def cycles(
    problem: _Path | Mapping[str, Any],
    cycles: int,
    *,
    skip: int = 0,
    value: float | None = None,
    start: tuple[Sequence[float], Sequence[float]] | None = None,
    folder: _Path | None = None,
) -> dict[str, _Matrix]:
    """The states on the section that follow one another, by runs alone: a second route to an orbit, and bifurcation diagrams.

    Args:
        problem: as for ``carom.orbit``.
        cycles: number of states.
        skip: number of cycles before the first of them.
        value: of the parameter of ``vary``; by default its first value.
        start: (q, qd), at the time at which the scene starts; by default that of the scene.
        folder: to which the file names in a dict are relative; by default the working folder.

    Returns:
        A dict of q and qd, arrays of shape (cycles, nq) and (cycles, nv).

    Raises:
        StudyError: as ``carom.orbit``.
        SimulationError: as ``carom.orbit``.
    """
def basin(
    problem: _Path | Mapping[str, Any],
    out: _Path,
    *,
    resume: bool = False,
    svg: _Path | None = None,
    folder: _Path | None = None,
) -> dict[str, Any]:
    """Tells the attractor of each start of the grid of ``basin``, into a file, in constant memory and on all cores. Ctrl-C or a full disk leaves a
    partial file, from which resume=True continues.

    Args:
        problem: as for ``carom.orbit``.
        out: the table, X.csv or X.parquet: a row for each start.
        resume: continue from the partial file of an interrupted run, if there is one.
        svg: a file for a picture, or None.
        folder: to which the file names in a dict are relative; by default the working folder.

    Returns:
        A dict of rows, computed (rows that this run has computed), outcomes (a dict of words and numbers of cells) and attractors, a list of
        dicts of period (cycles), state (q and qd, rounded) and cells.

    Raises:
        StudyError: as ``carom.orbit``; a file that cannot be written; a partial file that cannot be continued.
        SimulationError: as ``carom.orbit``.
    """
def tosses(
    folder: _Path,
    law: _AnyLaw,
    *,
    robot: str | None = None,
    start: Literal["fitted", "given"] = "fitted",
    length: float = 0.0524,
    tolerance: float = 1e-9,
    contact_step: float = 5e-4,
) -> dict[str, Any]:
    """Simulates measured tosses, and compares the poses.

    Args:
        folder: with tosses.csv and a URDF, as for `carom tosses`.
        law: the impact law of all contacts, such as carom.Whittaker(0.0, 0.3).
        robot: name of the URDF; by default the only one.
        start: "fitted" to the flight before the first impact, or "given" by the first free sample.
        length: L of the pose error, m: mean |Δp|²/L + mean Δθ² over the samples.
        tolerance: of the integration, relative.
        contact_step: length of a time step, where time steps are computed, s.

    Returns:
        A dict of tosses, failures, start, fitted_starts, at_rest, deepest_overlap (m), last and mean (errors of position (m), rotation and
        joint (rad): mean and median over the tosses), whole and early (pose error: count, mean, median, below_half), each (a list of dicts).

    Raises:
        FitError: a folder that cannot be read, or none of whose tosses can be simulated; an option out of its range.
    """
def chart(
    scene: Scene, *, budget: float = 10.0, stiffness: bool = False, title: str | None = None
) -> dict[str, Any]:
    """The error of every method that can run a scene, against its run time: event-driven integrators over their tolerance, time steps over
    their length, compliant contacts over their stiffness.

    Args:
        scene: a Scene.
        budget: longest run time of a single run, s.
        stiffness: instead, the errors of the scene's compliant contacts against rigid ones, over a factor of all stiffnesses.
        title: of the picture; by default the name of the robot.

    Returns:
        A dict of law, runs (method, law, knob, value, wall_time (s), after_impact, at_end, estimated_at_end), absent (method, reason),
        doubt_after_impact and doubt_at_end (errors of the reference solution), csv and svg (texts); with stiffness of runs (factor,
        after_impact, at_end), order_after_impact, order_at_end, theory, csv, svg.

    Raises:
        SimulationError: of the reference solution.
        ValueError: a budget that is not positive, a scene with laws or a controller in Python; `stiffness` of a scene without compliant
            contacts.
    """
def fit(
    *,
    delassus: ArrayLike | None = None,
    u_minus: ArrayLike | None = None,
    u_plus: ArrayLike | None = None,
    chain: Chain | None = None,
    q: ArrayLike | None = None,
    qd_minus: ArrayLike | None = None,
    qd_plus: ArrayLike | None = None,
    frame: str | None = None,
    point: ArrayLike | None = None,
    normal: ArrayLike | None = None,
    tosses: _Path | None = None,
    robot: str | None = None,
    tolerance: float = 1e-6,
    contact_step: float = 1e-3,
    length: float = 0.0524,
    start: Literal["fitted", "given"] = "fitted",
    horizon: Literal["whole", "early"] = "whole",
    law: str = "energetic",
    loss: Literal["huber", "squares"] = "huber",
    inertia: bool = False,
    max_friction: float = 1.0,
    train: float = 1.0,
    seed: int = 0,
    confidence: float = 0.95,
) -> Fit:
    """Fits restitution and friction to measured impacts. One of three kinds of data is given:

    - velocities at the contact: ``delassus`` (N, D, D), 1/kg, ``u_minus`` and ``u_plus`` (N, D), m/s, in contact axes, tangents
      first, normal last; D is 2 or 3;
    - velocities of the joints of a ``chain``: ``q`` (N, nq), ``qd_minus`` and ``qd_plus`` (N, nv), with ``frame``, ``point`` and
      ``normal`` of the contact as in ``Chain.impact``;
    - tosses: ``tosses``, a folder with tosses.csv and a URDF (``robot`` names it if there are several), with the
      ``tolerance`` and ``contact_step`` (s) of the simulations and the ``length`` (m) of the pose error. The ``start`` is
      "fitted" to the flight before the first impact, or "given" by the first free sample; the ``horizon`` of the fitted error is
      the "whole" toss or "early", to 0.1 s after the first impact.

    Args:
        law: name of the law.
        loss: "huber" or "squares".
        inertia: fits the scale of rotational inertia too; needs a robot.
        max_friction: largest friction of the search.
        train: share of the measurements that is fitted; the rest, if any, is the test.
        seed: of the split into both, and of the bootstrap.
        confidence: level of the intervals.

    Returns:
        A Fit.

    Raises:
        FitError: too few measurements, an option out of its range, a contact that does not approach.
        TypeError: data of no or of several kinds.
    """
def record(run: Run, to: _Path | _Stream) -> None:
    """Records a run for the Rerun viewer: in a file, or in a recording stream of the package rerun-sdk.

    A stream gets the entities and timelines of the file and keeps its own application, recording and layout, so that a program
    logs its own data beside them.

    Args:
        run: a Run.
        to: the file, X.rrd, which is complete or not there; or a stream, such as ``rerun.RecordingStream("strike")`` or
            ``rerun.get_global_data_recording()``, of rerun-sdk 0.36.3.

    Raises:
        RecordError: the file cannot be written, or this package is built without recordings (``can_record()``).
        TypeError: `to` is neither a path nor a stream.
    """
def can_record() -> bool:
    """Whether this package can write recordings."""

__all__: list[str]
