//! The quantities of a map, with their names, units and columns.

use super::boundary::EDGES;
use crate::Column;
use carom_impact::{Edge, Flags, Mode};

/// Result of a row: why it has no numbers, or how the tangential velocity of the contact point changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Class {
    Unreachable,
    OutsideLimits,
    Singular,
    Refused,
    NoImpact,
    Stick,
    Starts,
    Shrinks,
    Keeps,
    Grows,
    Reverses,
}

/// The words of the column `class`, the result of a row. [`crate::map_study`] defines them.
pub const CLASSES: [&str; 11] = [
    "unreachable",
    "outside-limits",
    "singular",
    "refused",
    "no-impact",
    "stick",
    "starts",
    "shrinks",
    "keeps",
    "grows",
    "reverses",
];

impl Class {
    pub(super) fn code(self) -> f64 {
        f64::from(self as u8)
    }
}

/// One of [`QUANTITIES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    Mode,
    Flags,
    TangentialJump,
    TangentialRatio,
    TangentialAfter,
    NormalAfter,
    Impulse,
    NormalImpulse,
    TangentialImpulse,
    EffectiveMass,
    LockedMass,
    Coupling,
    EnergyLoss,
    EnergyRatio,
    JointJump,
    JointLoad,
    JointImpulse,
    LimitShare,
    LimitJoint,
    ImpactEllipse,
    ModeMargin,
    ModeEdge,
    ModeBeyond,
    BoundaryFriction,
    BoundaryRestitution,
    BoundaryApproach,
    Position,
    QdMinus,
    QdPlus,
}

/// The parts of a row that only some quantities need.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wants {
    /// q̇⁻.
    pub qd_minus: bool,
    /// q̇⁺ − q̇⁻.
    pub jump: bool,
    /// The joint with the greatest jump relative to its limit.
    pub worst: bool,
}

impl Wants {
    pub(super) fn of(quantities: &[Quantity]) -> Self {
        let any = |some: &[Quantity]| quantities.iter().any(|quantity| some.contains(quantity));
        Self {
            qd_minus: any(&[Q::QdMinus, Q::QdPlus]),
            jump: any(&[Q::JointJump, Q::LimitShare, Q::LimitJoint, Q::QdPlus]),
            worst: any(&[Q::LimitShare, Q::LimitJoint]),
        }
    }
}

use Quantity as Q;

/// Name of each quantity in a study file, and its unit.
const KNOWN: [(&str, &str, Quantity); 29] = [
    ("mode", "", Q::Mode),
    ("flags", "", Q::Flags),
    ("tangential_jump", "m/s", Q::TangentialJump),
    ("tangential_ratio", "", Q::TangentialRatio),
    ("tangential_after", "m/s", Q::TangentialAfter),
    ("normal_after", "m/s", Q::NormalAfter),
    ("impulse", "N s", Q::Impulse),
    ("normal_impulse", "N s", Q::NormalImpulse),
    ("tangential_impulse", "N s", Q::TangentialImpulse),
    ("effective_mass", "kg", Q::EffectiveMass),
    ("locked_mass", "kg", Q::LockedMass),
    ("coupling", "", Q::Coupling),
    ("energy_loss", "J", Q::EnergyLoss),
    ("energy_ratio", "", Q::EnergyRatio),
    ("joint_jump", "rad/s or m/s", Q::JointJump),
    ("joint_load", "N m s or N s", Q::JointLoad),
    ("joint_impulse", "", Q::JointImpulse),
    ("limit_share", "", Q::LimitShare),
    ("limit_joint", "", Q::LimitJoint),
    ("impact_ellipse", "N s", Q::ImpactEllipse),
    ("mode_margin", "", Q::ModeMargin),
    ("mode_edge", "", Q::ModeEdge),
    ("mode_beyond", "", Q::ModeBeyond),
    ("boundary_friction", "", Q::BoundaryFriction),
    ("boundary_restitution", "", Q::BoundaryRestitution),
    ("boundary_approach_deg", "°", Q::BoundaryApproach),
    ("position", "m", Q::Position),
    ("qd_minus", "", Q::QdMinus),
    ("qd_plus", "", Q::QdPlus),
];

/// The names that `[map] quantities` accepts.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    KNOWN.iter().map(|(name, ..)| *name)
}

pub(super) fn by_name(name: &str) -> Option<Quantity> {
    KNOWN.iter().find(|(known, ..)| *known == name).map(|(.., quantity)| *quantity)
}

/// Words for every set of flags of a single impact, in the order of their bits.
fn flag_sets() -> impl Iterator<Item = String> {
    (0..Flags::WITHOUT_RESTITUTION.bits()).map(|bits| Flags::from_bits(bits).names().collect::<Vec<_>>().join("+"))
}

impl Quantity {
    /// The columns of this quantity. `joints` are the chain's joints with coordinates of their own and the units of their
    /// velocities, `limited` the joints with a velocity limit.
    pub(super) fn columns(
        self,
        dimension: usize,
        joints: &[(String, &'static str)],
        limited: &[String],
    ) -> Vec<Column> {
        let (name, unit, _) = KNOWN.iter().find(|(.., quantity)| *quantity == self).copied().unwrap_or(("", "", self));
        let one = |part: &str| {
            let unit = if part == "angle_deg" { "°" } else { unit };
            Column::number(format!("{name}.{part}")).in_unit(unit)
        };
        let each = |parts: &[&str]| parts.iter().map(|part| one(part)).collect();
        let velocity = |(joint, unit): &(String, &'static str)| Column::number(format!("{name}.{joint}")).in_unit(unit);
        let impulse = |joint: &str, unit: &str| {
            Column::number(format!("{name}.{joint}")).in_unit(if unit == "m/s" { "N s" } else { "N m s" })
        };
        match self {
            Q::Mode | Q::ModeBeyond => vec![Column::word(name, Mode::ALL.map(Mode::name))],
            Q::ModeEdge => vec![Column::word(name, EDGES.map(Edge::name))],
            Q::Flags => vec![Column::word(name, flag_sets())],
            Q::LimitJoint => vec![Column::word(name, limited)],
            Q::ImpactEllipse if dimension == 2 => each(&["long", "short", "angle_deg"]),
            Q::ImpactEllipse => each(&["long", "middle", "short"]),
            Q::Position => each(&["x", "y", "z"]),
            Q::QdMinus | Q::QdPlus => joints.iter().map(velocity).collect(),
            Q::JointImpulse => joints.iter().map(|(joint, unit)| impulse(joint, unit)).collect(),
            _ => vec![Column::number(name).in_unit(unit)],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_is_found_by_name_and_has_unique_columns() {
        let joints = [("a".to_owned(), "rad/s"), ("b".to_owned(), "m/s")];
        let limited = ["a".to_owned(), "b".to_owned()];
        let mut seen = std::collections::HashSet::new();
        for name in names() {
            let columns = by_name(name).unwrap().columns(2, &joints, &limited);
            assert!(!columns.is_empty());
            assert!(columns.iter().all(|c| c.name.split('.').next() == Some(name) && seen.insert(c.name.clone())));
        }
    }

    #[test]
    fn a_set_of_flags_has_the_names_of_its_flags() {
        let column = &Q::Flags.columns(2, &[], &[])[0];
        for flags in [Flags::NONE, Flags::JAM, Flags::ENERGY_GAIN | Flags::GRAZING | Flags::NO_APPROACH] {
            assert_eq!(column.spell(f64::from(flags.bits())), flags.to_string().replace(", ", "+"));
        }
    }

    #[test]
    fn class_codes_are_indices_of_their_words() {
        assert_eq!(CLASSES[Class::Reverses.code() as usize], "reverses");
        assert_eq!(CLASSES[Class::Unreachable.code() as usize], "unreachable");
        assert_eq!(CLASSES[Class::Stick.code() as usize], "stick");
        assert_eq!(Class::Reverses as usize + 1, CLASSES.len());
    }
}
