//! Impact laws for rigid contacts, without a robot model: given the **Delassus matrix** H (inverse inertia at the
//! contact, `J M⁻¹ Jᵀ`) and the contact velocity u⁻, a law returns the impulse P and the velocity after,
//! `u⁺ = u⁻ + H P`.
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
//! SI units. Contact axes hold the tangents first and the normal last; the normal `n` is a unit vector **from the
//! environment to the robot**, so an approaching contact has `u_n < 0`. Impulses act on the robot. `D`, the number of
//! contact axes, is 2 in the plane, 3 in space, and 1 without tangents. The scalar `T` is any `nalgebra` real field
//! that is `Copy`: `f64`, `f32`, dual numbers.
//!
//! | Symbol | Size | Meaning | Our name |
//! |---|---|---|---|
//! | H | D × D | Delassus matrix: inverse inertia at the contact, `J M⁻¹ Jᵀ` (1/kg) | `delassus` |
//! | u⁻, u⁺ | D | contact velocity before and after (m/s) | `u_minus`, `u_plus` |
//! | P | D | impulse on the robot (N s); `u⁺ = u⁻ + H P` | `impulse` |
//! | A, B, C | 1 | `H_tt`, `H_tn`, `H_nn` of a planar contact (1/kg) | locals `a`, `b`, `c` |
//! | A, h, C | 2 × 2, 2, 1 | the same blocks for a contact in space (1/kg) | `tangents`, `coupling`, `normal` |
//! | v_t, v_n | 1 | slip velocity and normal velocity of a planar contact (m/s) | locals `v_t`, `v_n` |
//! | p | 1 | accumulated normal impulse, the independent variable of an impact (N s) | local `p` |
//! | s | 1 | direction of slip, `sign v_t` | local `s` |
//! | e | 1 | coefficient of restitution; each law defines which | `restitution` |
//! | μ | 1 | coefficient of friction | `friction`, local `mu` |
//! | W_n, W_t | 1 | `∫ v_n dp_n` and `∫ v_t dp_t` (J) | `normal_work`, `friction_work` |
//!
//! # Which law
//!
//! | law | restitution is | friction acts | energy | solution |
//! |---|---|---|---|---|
//! | [`Frictionless`] | kinematic, kinetic and energetic at once | – | never gains | exists whenever `C > 0`; unique |
//! | [`Whittaker`] | a ratio of velocities | against the slip after the impact | **can gain** | exists for regular H; in space not always unique |
//! | [`Newton`] | a ratio of velocities | against the slip at each instant | **can gain** | exists for regular H; unique |
//! | [`Poisson`] | a ratio of impulses | against the slip at each instant | never gains in the plane, nor in any test in space | exists for regular H; unique |
//! | [`Energetic`] | square root of a ratio of works | against the slip at each instant | never gains | exists for regular H; unique |
//! | [`ChatterjeeRuina`] | a ratio of velocities, and a tangential coefficient | towards sticking, within the cone | never gains | exists whenever `C > 0`; unique |
//! | [`Brach`] | a ratio of velocities | along the initial slip, with a clipped impulse ratio | never gains | exists for regular H; unique |
//! | [`Smith`] | a ratio of velocities | against a mean of the slips before and after | never gains | exists for regular H; unique in the plane |
//!
//! Start with [`Energetic`]. In space [`ChatterjeeRuina`] is the cheapest law with friction: a closed formula.
//! [`Newton`], [`Poisson`] and [`Energetic`] integrate the turning of the slip to rounding, which takes some fifty to a hundred
//! times as long.
//!
//! # Compliant contacts
//!
//! A compliant contact has a force, a duration and a penetration instead of an impulse. The forces can be used in a
//! time integration through the impact; [`compliant_impact`] does this in a fixed configuration for one or several
//! contacts, and [`ImpactProblem::compliant`] for one [`ImpactProblem`].
//!
//! | normal force | restitution is | energy | fails |
//! |---|---|---|---|
//! | [`HuntCrossley`] with exact damping; with e = 1 Hertz's contact | a ratio of velocities | never gains | at e = 0; the damping is set by the approach speed at first touch |
//! | [`HuntCrossley`] with a published [`Damping`] | approximate: see [`restitution_obtained`] | never gains | for e = 0.2 some formulas give 0.7 |
//! | [`KelvinVoigt`] | a ratio of velocities | never gains | the force jumps; the damping is set by the effective mass at first touch |
//! | [`WaltonBraun`] | square root of a ratio of works: the compliant counterpart of [`Energetic`] | never gains | does not damp a resting contact |
//!
//! | tangential force | sticks | energy |
//! |---|---|---|
//! | [`SmoothedCoulomb`] | no: it creeps | never gains |
//! | [`Bristle`] | yes, after a small elastic displacement | never gains |
//!
//! # Several contacts
//!
//! The laws above resolve one contact. An impact at several contacts at once, with joint limits, dry joint friction and
//! locked directions, is a [`SeveralProblem`]:
//!
//! | law | restitution is | energy | solution |
//! |---|---|---|---|
//! | [`SeveralProblem::simultaneous`] (Moreau) | a ratio of velocities, per contact | **can gain** if e > 0 | exists for regular H; found for every singular H with e = 0 in the tests |
//! | [`SeveralProblem::poisson`] (Glocker & Pfeiffer) | a ratio of impulses, per contact | never gains without friction or with one common e; otherwise **can gain** | as the row above with e = 0 |
//! | [`SeveralProblem::sequential`] | a ratio of velocities, per sub-impact | never gains without friction; otherwise **can gain** if e > 0 | [`SeveralOutcome::is_solved`] reports whether the sequence ended |
//! | [`SeveralProblem::energetic`] (Liu, Zhao & Brogliato), without friction | square root of a ratio of works, per contact | never gains | exists and is unique; depends on the ratios of stiffnesses |
//!
//! [`SeveralProblem::sequential`] has one outcome per order of the contacts; [`SeveralProblem::all_orders`] returns the
//! set.
//!
//! This crate does not depend on a robot model, so that a law can be tested against tables of numbers, evaluated over
//! millions of problems, and differentiated, without building a chain.

mod band;
mod boundary;
mod branches;
mod check;
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
// Hidden: what only other crates of carom use.
#[doc(hidden)]
pub mod roots;
mod rounding;
mod routh;
mod scalar;
mod several;

pub use band::{Band, CoefficientRanges};
pub use boundary::{Boundary, Edge};
pub use compliant::{
    Bristle, CompliantOutcome, Damping, HuntCrossley, KelvinVoigt, NormalForce, Pressed, RoundBody, SmoothedCoulomb,
    TangentialForce, WaltonBraun, compliant_impact, hertz_stiffness, restitution_obtained,
};
pub use derivative::{Direction, LawDerivative, OneSided, Side};
pub use error::ImpactError;
pub use flags::Flags;
pub use flow::{ImpulsePath, InvariantDirection, PathPoint};
pub use laws::*;
#[doc(hidden)]
pub use least_norm::least_norm;
pub use outcome::{Account, ImpactOutcome, Mode, Phase};
pub use problem::ImpactProblem;
#[doc(hidden)]
pub use several::undetermined;
pub use several::{
    Accuracy, Constraint, EnergeticOutcome, Order, OrderOutcome, OrderSet, PoissonOutcome, SeveralOutcome,
    SeveralProblem, Stiffnesses,
};
