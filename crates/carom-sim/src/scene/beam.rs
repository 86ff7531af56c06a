//! Slender links of a robot that bend, `[[robot.beam]]`.

use super::file::Beam;
use crate::model::Spring;
use carom_chain::ChainError;
use carom_chain::urdf::{self, Robot};

/// The robot with its beams divided into segments, and the springs of the bends; `name` gives the name of a joint in the chain.
pub(crate) fn divided(
    mut robot: Robot,
    beams: &[Beam],
    name: &impl Fn(&str) -> String,
) -> Result<(Robot, Vec<Spring>), ChainError> {
    let mut springs = Vec::new();
    for it in beams {
        let stiffness = it.bending.iter().map(|bending| (bending.axis.into(), bending.stiffness)).collect();
        let beam = urdf::Beam { ends: [it.from.into(), it.to.into()], bends: it.bends, stiffness };
        let bends: Vec<urdf::Bend>;
        (robot, bends) = robot.with_segments(&it.link, &beam)?;
        springs.extend(bends.into_iter().map(|bend| Spring {
            joint: name(&bend.joint),
            rest: 0.0,
            stiffness: bend.stiffness,
            damping: it.damping * bend.stiffness,
        }));
    }
    Ok((robot, springs))
}

/// `numbers`, with zeros for the bends at its end if it is shorter by them than one of `lengths`.
pub(crate) fn straight(mut numbers: Vec<f64>, beams: &[Beam], lengths: &[usize]) -> Vec<f64> {
    let bends: usize = beams.iter().map(|it| it.bends * it.bending.len()).sum();
    let whole = numbers.len() + bends;
    if !lengths.contains(&numbers.len()) && lengths.contains(&whole) {
        numbers.resize(whole, 0.0);
    }
    numbers
}
