#![doc = include_str!("../../../README.md")]

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
    #[doc = include_str!("../../../book/src/law-several.md")]
    mod law_several {}
}
