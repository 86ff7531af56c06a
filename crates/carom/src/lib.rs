//! carom computes the impacts of robots: the joint velocities qd⁺ = qd⁻ + M⁻¹ Jᵀ p, the impulse p, the contact mode and the energy balance,
//! from a URDF file, a configuration, a velocity and a contact surface, under any of eight impact laws.
//!
//! ```
//! use carom::prelude::*;
//!
//! let arm = uniform_chain(2, 0.5, 2.0)?;
//! let tip = arm.frame("tip")?;
//! let law = Energetic { restitution: 0.35, friction: 0.2 };
//! let hit = arm.impact(&[0.8, -1.6], &[-0.2, 0.6]).at(tip).normal([-1.0, 0.0, 0.0]).resolve(&law)?;
//! println!("{:?} {:?} {}", hit.qd_plus, hit.mode, hit.energy_ratio());
//! # Ok::<(), SimError>(())
//! ```
//!
//! | to do | begin at |
//! | --- | --- |
//! | read a robot, compute M, J, bias and energies | [`Chain`](chain::Chain), [`Kinematics`](chain::Kinematics) |
//! | one impact of a robot; the same many times | [`Strike`](sim::Strike), [`PreparedStrike`](sim::PreparedStrike) |
//! | an impact law on plain numbers | [`ImpactProblem`](impact::ImpactProblem), [`Law`](impact::Law) |
//! | motion through impacts | [`Scene`](sim::Scene), [`Simulation`](sim::Simulation), [`Session`](sim::Session) |
//! | gradients of runs | [`Plan::linear_run`](sim::Plan::linear_run), [`Parameter`](sim::Parameter) |
//! | impact maps, fits, tosses | [`study`] |
//! | recordings | `record`, with the feature `rerun` |
//!
//! SI units and radians. Normals are unit vectors from the environment to the robot. The manual is the folder `book` of the repository.

pub use carom_chain as chain;
pub use carom_contact as contact;
pub use carom_impact as impact;
#[cfg(feature = "rerun")]
pub use carom_record as record;
pub use carom_sim as sim;
pub use carom_study as study;
/// The crate of the vectors and matrices in the public interface.
pub use nalgebra;

/// The names that most programs need: `use carom::prelude::*;`
pub mod prelude {
    pub use carom_chain::{
        Chain, ChainError, ContactInertia, FrameId, FramePoint, Kinematics, PlanarChain, Point, Workspace,
        uniform_chain,
    };
    pub use carom_contact::Obstacle;
    pub use carom_impact::{
        Brach, ChatterjeeRuina, Energetic, Flags, Frictionless, ImpactError, ImpactOutcome, ImpactProblem, Law, Mode,
        Newton, Poisson, Smith, Whittaker,
    };
    pub use carom_sim::{
        ChainImpact, ContactLaw, ContactRule, Drive, EventKind, Impacts, JointModel, Plan, Scene, SimError, Simulation,
        Surface, Touch, Trajectory,
    };
}

/// The README, which `cargo test --doc` compiles and runs.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
mod readme {}

/// The pages of the book with Rust code, which `cargo test --doc` compiles and runs.
#[cfg(doctest)]
mod book {
    #[doc = include_str!("../../../book/src/tutorial-first-impact.md")]
    mod tutorial_first_impact {}
    #[doc = include_str!("../../../book/src/task-derivatives.md")]
    mod task_derivatives {}
    #[doc = include_str!("../../../book/src/task-gradients.md")]
    mod task_gradients {}
    #[doc = include_str!("../../../book/src/task-rust.md")]
    mod task_rust {}
    #[doc = include_str!("../../../book/src/task-loop.md")]
    mod task_loop {}
    #[doc = include_str!("../../../book/src/task-own-simulator.md")]
    mod task_own_simulator {}
    #[doc = include_str!("../../../book/src/law-several.md")]
    mod law_several {}
}
