//! Impact laws as pure numbers: what a rigid body knows of an impact is its **Delassus matrix**
//! (inverse inertia at the contact) and its contact velocity; what it gets is an impulse.
//!
//! ```
//! use carom_impact::{Energetic, ImpactProblem, Law, Mode};
//! use nalgebra::{matrix, vector};
//!
//! // The tip of a double pendulum strikes the floor (Kane & Levinson 1985).
//! let problem = ImpactProblem::new(
//!     matrix![2.440338045696, 1.521308658011; 1.521308658011, 1.009560290504],
//!     vector![-0.267174342835_f64, -0.134202014333],
//! )?;
//! let hit = Energetic { restitution: 0.5, friction: 0.5 }.resolve(&problem)?;
//!
//! assert_eq!(hit.mode, Mode::ReverseSlip);
//! assert!((hit.u_plus[1] - 0.043529526627).abs() < 1e-11);
//! assert!(hit.energy_change < 0.0);
//! # Ok::<(), carom_impact::ImpactError>(())
//! ```
//!
//! # Conventions
//!
//! SI units. Contact axes hold the tangents first and the normal last; the normal `n` is a unit
//! vector **from the environment to the robot**, so an approach has `u_n < 0`, and impulses act
//! on the robot. `D` is 2 in the plane and 3 in space. The scalar `T` is any `nalgebra` real
//! field that is `Copy`: `f64`, `f32`, dual numbers.
//!
//! | Symbol | Size | Meaning | Our name |
//! |---|---|---|---|
//! | H | D × D | inverse inertia at the contact, `J M⁻¹ Jᵀ` (1/kg) | `delassus` |
//! | u⁻, u⁺ | D | contact velocity before and after (m/s) | `u_minus`, `u_plus` |
//! | P | D | impulse on the robot (N s); `u⁺ = u⁻ + H P` | `impulse` |
//! | A, B, C | 1 | `H_tt`, `H_tn`, `H_nn` of a planar contact (1/kg) | locals `a`, `b`, `c` |
//! | A, h, C | 2 × 2, 2, 1 | the same of a contact in space (1/kg) | `tangents`, `coupling`, `normal` |
//! | v_t, v_n | 1 | slip and normal velocity of a planar contact (m/s) | locals `v_t`, `v_n` |
//! | p | 1 | normal impulse as the clock of the impact (N s) | local `p` |
//! | s | 1 | direction of slip, `sign v_t` | local `s` |
//! | e | 1 | coefficient of restitution; each law says which | `restitution` |
//! | μ | 1 | coefficient of friction | `friction`, local `mu` |
//! | W_n, W_t | 1 | `∫ v_n dp_n` and `∫ v_t dp_t` (J) | `normal_work`, `friction_work` |
//!
//! # Which law
//!
//! | law | restitution is | friction acts | energy | exists |
//! |---|---|---|---|---|
//! | [`Frictionless`] | all three in one | – | never gains | whenever `C > 0` |
//! | [`Whittaker`] | a ratio of velocities | against the last slip | **can gain** | for regular H; in space not always alone |
//! | [`Newton`] | a ratio of velocities | against the slip at each instant | **can gain** | for regular H, one |
//! | [`Poisson`] | a ratio of impulses | against the slip at each instant | never gains in the plane, nor was seen to in space | for regular H, one |
//! | [`Energetic`] | a ratio of works (root) | against the slip at each instant | never gains | for regular H, one |
//! | [`ChatterjeeRuina`] | a ratio of velocities, and a tangential one | towards sticking, within the cone | never gains | whenever `C > 0`, one |
//! | [`Brach`] | a ratio of velocities | along the first slip, by a ratio clipped | never gains | for regular H, one |
//! | [`Smith`] | a ratio of velocities | against a mean of the first and last slip | never gains | for regular H; in the plane one |
//!
//! Start with [`Energetic`]. [`ChatterjeeRuina`] is the cheap law in space: a formula, where the three that follow the
//! slip integrate its turning (to rounding, and a hundred times slower).
//!
//! A contact may also give way. Then it has a force instead of an impulse, for those who integrate through the impact;
//! [`compliant_impact`] does it in a fixed configuration, for one contact or several, and
//! [`ImpactProblem::compliant`] for one problem:
//!
//! | normal force | restitution is | energy | fails |
//! |---|---|---|---|
//! | [`HuntCrossley`], damped exactly; with e = 1 Hertz's | a ratio of velocities | never gains | at e = 0; its damping is set by the speed of first touch |
//! | the same, by a published [`Damping`] | none: see [`restitution_obtained`] | never gains | asked for 0.2 it may give 0.7 |
//! | [`KelvinVoigt`] | a ratio of velocities | never gains | the force jumps; its damping is set by the mass at first touch |
//! | [`WaltonBraun`] | a ratio of works (root): the compliant [`Energetic`] | never gains | doesn't damp a contact at rest |
//!
//! | tangential force | holds | energy |
//! |---|---|---|
//! | [`SmoothedCoulomb`] | creeps where it should stick | never gains |
//! | [`Bristle`] | sticks, after it has yielded a little | never gains |
//!
//! These answer one contact. Several at once, with joint limits, dry joints and held directions among them, are a
//! [`SeveralProblem`]:
//!
//! | law | restitution is | energy | exists |
//! |---|---|---|---|
//! | [`SeveralProblem::simultaneous`] (Moreau) | a ratio of velocities, per contact | **can gain** if e > 0 | always for regular H; in the tests' census also for singular H with e = 0 |
//! | [`SeveralProblem::poisson`] (Glocker & Pfeiffer) | a ratio of impulses, per contact | never gains without friction or with one common e; else **can gain** | as the one above with e = 0 |
//! | [`SeveralProblem::sequential`] | a ratio of velocities, per blow | never gains without friction; else **can gain** if e > 0 | says whether it came to an end |
//!
//! The last has one answer per order: [`SeveralProblem::all_orders`] is the set of them.
//!
//! Why a crate of its own: a law that knows no robot can be tested against a table of numbers,
//! swept over a million problems, and differentiated, without building a chain first.

mod band;
mod boundary;
mod branches;
mod compliant;
mod cone;
mod contact;
mod derivative;
mod error;
mod flags;
mod flow;
mod laws;
mod least_norm;
mod outcome;
mod plane;
mod problem;
mod routh;
mod several;

pub use band::{Band, CoefficientRanges};
pub use boundary::{Boundary, Edge};
pub use compliant::{
    Bristle, CompliantOutcome, Damping, HuntCrossley, KelvinVoigt, NormalForce, Pressed, RoundBody, SmoothedCoulomb,
    TangentialForce, WaltonBraun, compliant_impact, damping_root, hertz_stiffness, restitution_obtained,
};
pub use derivative::{Direction, LawDerivative, OneSided, Side};
pub use error::ImpactError;
pub use flags::Flags;
pub use flow::{ImpulsePath, InvariantDirection, PathPoint};
pub use laws::{
    AnyLaw, Brach, ChatterjeeRuina, Coefficients, Energetic, Frictionless, LAW_NAMES, Law, Newton, Poisson, Smith,
    Whittaker, law_by_name,
};
pub use least_norm::least_norm;
pub use outcome::{ImpactOutcome, Mode, Phase};
pub use problem::ImpactProblem;
pub use several::{
    Accuracy, Constraint, Order, OrderError, OrderOutcome, OrderSet, PoissonOutcome, SequentialOutcome, SeveralOutcome,
    SeveralProblem,
};
