//! The touches between links that a rule chooses instead of a list: those of different robots, and those within a robot.

use super::rule::ContactRule;
use super::touch::{Touch, Touches};
use crate::error::SimError;
use carom_chain::{Chain, Member};
use carom_contact::{LinkShape, apart, link_shapes};

impl Touch {
    /// The pairs of every collision shape of a robot with every one of another robot ([`Chain::join`]), without those that are
    /// out of reach at every configuration, which [`Touches::left_out`] lists.
    ///
    /// # Errors
    /// [`SimError::Shape`] for an invalid mesh.
    pub fn between_robots(chain: &Chain, contact: &ContactRule) -> Result<Touches, SimError> {
        Self::among(chain, contact, |a, b| robot_of(chain, a) != robot_of(chain, b))
    }

    /// The pairs of every collision shape of a link with every one of another link of the same robot, without the links of one
    /// body and of neighbouring bodies (connected by one joint), which mostly overlap there, and without the pairs that an
    /// SRDF disables ([`Chain::disabled_pairs`]).
    ///
    /// # Errors
    /// [`SimError::Shape`] for an invalid mesh.
    pub fn within_robots(chain: &Chain, contact: &ContactRule) -> Result<Touches, SimError> {
        Self::among(chain, contact, |a, b| {
            robot_of(chain, a) == robot_of(chain, b) && !are_neighbours(chain, a, b) && !are_disabled(chain, a, b)
        })
    }

    /// The robots of a joined chain that it touches.
    pub(crate) fn robots<'c>(&self, chain: &'c Chain) -> impl Iterator<Item = &'c Member> {
        let named =
            [self.link(), self.other_link(), self.limit_of()].map(|name| name.and_then(|it| robot_of(chain, it)));
        named.into_iter().flatten().map(|robot| &chain.members()[robot])
    }

    fn among(chain: &Chain, contact: &ContactRule, meant: impl Fn(&str, &str) -> bool) -> Result<Touches, SimError> {
        let shapes = link_shapes(chain)?;
        let mut found = Touches::default();
        for (k, shape) in shapes.iter().enumerate() {
            let others = shapes[k + 1..].iter().filter(|other| other.link() != shape.link());
            for other in others.filter(|other| meant(shape.link(), other.link())) {
                match apart(chain, shape, other) {
                    Some(why) => found.left_out.push((name(shape, other), why)),
                    None => Self::add_links(&mut found.touches, shape, other, contact),
                }
            }
        }
        Ok(found)
    }
}

fn name(shape: &LinkShape, other: &LinkShape) -> String {
    format!("{} on {}", shape.link(), other.link())
}

/// Index of the robot of a link or joint in a joined chain.
pub(crate) fn robot_of(chain: &Chain, name: &str) -> Option<usize> {
    let (robot, _) = name.split_once('/')?;
    chain.members().iter().position(|member| member.name == robot)
}

/// Whether an SRDF disables the contact of two links.
pub(crate) fn are_disabled(chain: &Chain, link: &str, other: &str) -> bool {
    chain.disabled_pairs().iter().any(|[a, b]| (a == link && b == other) || (a == other && b == link))
}

/// Whether two links belong to one body, or to bodies that one joint connects.
fn are_neighbours(chain: &Chain, link: &str, other: &str) -> bool {
    let body = |link: &str| chain.frames().iter().find(|frame| frame.name == link).and_then(|frame| frame.body);
    // The body that carries the joint of a body: a joint with several coordinates is several bodies.
    let carrier = |body: Option<usize>| {
        let mut at = body?;
        loop {
            let parent = chain.bodies()[at].parent?;
            if chain.bodies()[parent].joint_index != chain.bodies()[at].joint_index {
                return Some(parent);
            }
            at = parent;
        }
    };
    let (a, b) = (body(link), body(other));
    a == b || (a.is_some() && carrier(a) == b) || (b.is_some() && carrier(b) == a)
}
