//! Distances along a chain.

use carom_chain::Chain;

/// Reach of a chain: the longest path along its links, m.
pub(crate) fn reach(chain: &Chain) -> f64 {
    beyond(chain, |_| 0.0).into_iter().fold(0.0, f64::max)
}

/// For every body the greatest distance of a point of a link beyond its joint, m. `extent`: the greatest distance of a point of a link
/// from its frame.
pub(crate) fn beyond(chain: &Chain, extent: impl Fn(&str) -> f64) -> Vec<f64> {
    let bodies = chain.bodies();
    let mut beyond = vec![0.0_f64; bodies.len()];
    for frame in chain.frames() {
        if let Some(body) = frame.body {
            beyond[body] = beyond[body].max(frame.pose.translation.norm() + extent(&frame.name));
        }
    }
    for i in (0..bodies.len()).rev() {
        if let Some(parent) = bodies[i].parent {
            beyond[parent] = beyond[parent].max(bodies[i].placement.translation.norm() + beyond[i]);
        }
    }
    beyond
}
