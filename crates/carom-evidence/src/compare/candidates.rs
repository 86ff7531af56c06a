//! The models that are compared: a law, the effects beyond constant coefficients, and the parameters that are fitted.

use carom_impact::{Coefficients, LAWS, LawInfo};
use carom_sim::SeveralLaw;
use carom_study::fit::Region;

/// A law with effects, whose parameters are fitted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    /// Name of one of [`LAWS`].
    pub law: &'static str,
    /// The law of impacts of several contacts; irrelevant for single impacts.
    pub several: SeveralLaw,
    /// What the model has beyond the law.
    pub effects: Vec<Effect>,
    /// The parameters that are fitted: the coefficients of the law, then those of the effects.
    pub parameters: Vec<Parameter>,
}

/// An effect that a law with constant coefficients on the contact of the data set does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Effect {
    /// Restitution that depends on the approach speed v: e = e₁ (v/v₁)^−ν with v₁ = 1 m/s, at most 1. ν = 1/4 for plastic
    /// indentation (K. L. Johnson, Contact Mechanics, 1985, section 11.4).
    Speed,
    /// The tangential lever arm of the contact as a multiple of that of the table.
    Arm,
    /// Other corners of the body strike before the last sample from which the velocity after the impact is measured.
    Strikes,
    /// Boxes with other edges than in the URDF, and with rounded corners: spheres at the corners, inset by their radius.
    Corners,
    /// Viscous damping and dry friction of the joints.
    Hinge,
    /// Second moments of mass ∫xᵢ² dm of every link along its own axes, as multiples of those in the URDF. Every positive multiple
    /// belongs to some distribution of the mass, which multiples of the moments of inertia do not.
    Inertia,
    /// The same, and the mass of the links after the first one as a multiple of that in the URDF.
    Masses,
    /// Offsets of the origins of the joints from those in the URDF, along the axes of the parent link.
    Placement,
    /// Another height of the floor than z = 0.
    Floor,
    /// Errors of the measured angles: the mean over them is predicted. A model of the measurement.
    Errors,
    /// Reflected inertias of the motors' rotors.
    Rotors,
    /// Rods that close loops.
    Rods,
    /// Springs of joints, and the measured torques of the motors, which balance the preload of the springs.
    Springs,
    /// An inertia of the toe's drive beyond that of its rotor.
    Toe,
}

/// A quantity that is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Parameter {
    /// Coefficient of restitution; with [`Effect::Speed`] at an approach speed of 1 m/s.
    Restitution,
    /// Coefficient of friction.
    Friction,
    /// Coefficient of tangential restitution.
    Tangential,
    /// ν of [`Effect::Speed`].
    Exponent,
    /// The multiple of [`Effect::Arm`].
    Arm,
    /// Radius of the corners of boxes, m.
    Radius,
    /// Length added to every edge of boxes, m.
    Growth,
    /// Viscous damping, N m s/rad.
    Damping,
    /// Dry friction, N m.
    DryFriction,
    /// Multiple of the second moment of mass along an axis of the link: 0 for x, 1 for y, 2 for z.
    SecondMoment(usize),
    /// Multiple of [`Effect::Masses`].
    Mass,
    /// Offset of [`Effect::Placement`] along an axis, m: 0 for x, 1 for y, 2 for z.
    Offset(usize),
    /// Height of the floor, m.
    Height,
    /// Standard deviation of [`Effect::Errors`], rad.
    AngleError,
    /// Inertia of [`Effect::Toe`], kg m².
    ToeInertia,
}

impl Effect {
    /// Its name, and the parameters that it has.
    fn facts(self) -> (&'static str, &'static [Parameter]) {
        use Parameter::{
            AngleError, Damping, DryFriction, Exponent, Growth, Height, Mass, Offset, Radius, SecondMoment,
        };
        match self {
            Self::Speed => ("speed", &[Exponent]),
            Self::Arm => ("arm", &[Parameter::Arm]),
            Self::Strikes => ("strikes", &[]),
            Self::Corners => ("corners", &[Radius, Growth]),
            Self::Hinge => ("hinge", &[Damping, DryFriction]),
            Self::Inertia => ("inertia", &[SecondMoment(0), SecondMoment(1), SecondMoment(2)]),
            Self::Masses => ("masses", &[SecondMoment(0), SecondMoment(1), SecondMoment(2), Mass]),
            Self::Placement => ("placement", &[Offset(0), Offset(1), Offset(2)]),
            Self::Floor => ("floor", &[Height]),
            Self::Errors => ("errors", &[AngleError]),
            Self::Rotors => ("rotors", &[]),
            Self::Rods => ("rods", &[]),
            Self::Springs => ("springs", &[]),
            Self::Toe => ("toe", &[Parameter::ToeInertia]),
        }
    }

    /// Name of the effect.
    pub fn name(self) -> &'static str {
        self.facts().0
    }
}

impl Parameter {
    /// Its name, its symbol in tables, and the ends of the search; of friction the upper one is an option.
    fn facts(self) -> (&'static str, &'static str, (f64, f64)) {
        match self {
            Self::Restitution => ("restitution", "e", (0.0, 1.0)),
            Self::Friction => ("friction", "μ", (0.0, f64::INFINITY)),
            Self::Tangential => ("tangential_restitution", "e_t", (-1.0, 1.0)),
            Self::Exponent => ("speed_exponent", "ν", (-0.5, 0.5)),
            Self::Arm => ("arm", "arm", (-1.5, 1.5)),
            Self::Radius => ("corner_radius", "radius", (0.0, 0.015)),
            Self::Growth => ("edge_growth", "growth", (-0.01, 0.01)),
            Self::Damping => ("damping", "damping", (0.0, 0.01)),
            Self::DryFriction => ("dry_friction", "dry friction", (0.0, 0.05)),
            Self::SecondMoment(0) => ("second_moment_x", "Σ_x", (0.05, 3.0)),
            Self::SecondMoment(1) => ("second_moment_y", "Σ_y", (0.05, 3.0)),
            Self::SecondMoment(_) => ("second_moment_z", "Σ_z", (0.05, 3.0)),
            Self::Mass => ("mass", "mass", (0.2, 2.0)),
            Self::Offset(0) => ("offset_x", "offset x", (-0.015, 0.015)),
            Self::Offset(1) => ("offset_y", "y", (-0.015, 0.015)),
            Self::Offset(_) => ("offset_z", "z", (-0.015, 0.015)),
            Self::Height => ("floor_height", "floor", (-0.01, 0.01)),
            Self::AngleError => ("angle_error", "angle error", (0.0, 0.12)),
            Self::ToeInertia => ("toe_inertia", "toe", (0.0, 0.5)),
        }
    }

    pub fn name(self) -> &'static str {
        self.facts().0
    }

    /// Symbol in tables, with the unit of the number.
    pub fn symbol(self) -> &'static str {
        self.facts().1
    }

    fn bounds(self, max_friction: f64) -> (f64, f64) {
        let (low, high) = self.facts().2;
        (low, if self == Self::Friction { max_friction } else { high })
    }

    fn grid(self, max_friction: f64) -> Vec<f64> {
        match self {
            Self::Restitution => vec![0.0, 0.2, 0.4, 0.6, 0.8],
            Self::Friction => [0.05, 0.15, 0.3, 0.6].map(|share| share * max_friction).to_vec(),
            Self::Tangential | Self::Exponent => vec![0.0],
            Self::Arm => vec![-1.0, 1.0],
            _ => vec![self.nominal()],
        }
    }

    /// The value at which an effect is absent.
    pub fn nominal(self) -> f64 {
        match self {
            Self::Arm | Self::SecondMoment(_) | Self::Mass => 1.0,
            _ => 0.0,
        }
    }

    /// Whether the start of a roll-out, which is fitted to the free flight, depends on the parameter.
    pub fn moves_flight(self) -> bool {
        use Parameter::{Damping, DryFriction, Mass, Offset, SecondMoment};
        matches!(self, SecondMoment(_) | Mass | Offset(_) | Damping | DryFriction)
    }
}

/// Approach speed at which [`Effect::Speed`] has the restitution that is fitted, and the speed below which e is constant, m/s.
const SPEEDS: (f64, f64) = (1.0, 0.1);

/// The standard deviations of [`Effect::Errors`] that are tried, rad.
const ANGLE_ERRORS: [f64; 9] = [0.0, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.1];

/// The inertias of [`Effect::Toe`] from which the search starts, kg m².
const TOE_INERTIAS: [f64; 5] = [0.0, 0.02, 0.05, 0.1, 0.2];

impl Candidate {
    /// Every law of [`LAWS`] with the coefficients that it has, and no effect.
    pub fn all() -> Vec<Self> {
        use Parameter::{Friction, Restitution, Tangential};
        let own = [(Restitution, "restitution"), (Friction, "friction"), (Tangential, "tangential_restitution")];
        let parameters =
            |law: &LawInfo| own.into_iter().filter(|(_, name)| law.has(name)).map(|(own, _)| own).collect();
        let several = SeveralLaw::default();
        let one = |law: &LawInfo| Self { law: law.name, several, effects: Vec::new(), parameters: parameters(law) };
        LAWS.iter().map(one).collect()
    }

    /// Every law with the default law of several contacts, and Stronge's law with the others.
    pub fn all_for_tosses() -> Vec<Self> {
        let mut all = Self::all();
        let Some(stronge) = all.iter().find(|one| one.law == "energetic").cloned() else { return all };
        let others = SeveralLaw::ALL.into_iter().filter(|several| *several != SeveralLaw::default());
        all.extend(others.map(|several| Self { several, ..stronge.clone() }));
        all
    }

    /// The model with one more effect.
    pub fn with(&self, effect: Effect) -> Self {
        let mut more = self.clone();
        more.effects.push(effect);
        more.parameters.extend(effect.facts().1);
        more
    }

    /// The values of the parameters at which the model is `simpler` with the values `x`.
    pub fn nominal(&self, simpler: &Self, x: &[f64]) -> Vec<f64> {
        let value = |own: &Parameter| simpler.value(*own, x).unwrap_or(own.nominal());
        self.parameters.iter().map(value).collect()
    }

    /// The points from which the search of a model with effects starts, for the values `x` of the model without its last one.
    pub fn starts(&self, x: Vec<f64>) -> Vec<Vec<f64>> {
        let values: &[f64] = match self.effects.last() {
            Some(Effect::Errors) => &ANGLE_ERRORS,
            Some(Effect::Toe) => &TOE_INERTIAS,
            _ => return vec![x],
        };
        values.iter().map(|value| [&x[..x.len() - 1], &[*value]].concat()).collect()
    }

    /// Whether the model is another one with further effects.
    pub fn extends(&self, other: &Self) -> bool {
        self.law == other.law && self.several == other.several && self.effects.starts_with(&other.effects)
    }

    /// The box of the parameters and a grid of starting values.
    pub fn region(&self, max_friction: f64) -> Region {
        Region {
            bounds: self.parameters.iter().map(|parameter| parameter.bounds(max_friction)).collect(),
            grid: self.parameters.iter().map(|parameter| parameter.grid(max_friction)).collect(),
        }
    }

    /// The value of a parameter; `None` if the model does not have it.
    pub fn value(&self, parameter: Parameter, x: &[f64]) -> Option<f64> {
        self.parameters.iter().zip(x).find(|(own, _)| **own == parameter).map(|(_, x)| *x)
    }

    /// The coefficients of the law at an approach speed, m/s.
    pub fn coefficients(&self, x: &[f64], speed: f64) -> Coefficients {
        let of = |parameter| self.value(parameter, x);
        let slower = of(Parameter::Exponent).map_or(1.0, |nu| (speed.max(SPEEDS.1) / SPEEDS.0).powf(-nu));
        Coefficients {
            restitution: (of(Parameter::Restitution).unwrap_or_default() * slower).min(1.0),
            friction: of(Parameter::Friction).unwrap_or_default(),
            tangential_restitution: of(Parameter::Tangential).unwrap_or_default(),
        }
    }
}

/// The name of a model.
pub(super) fn title(model: &Candidate) -> String {
    let effects: Vec<&str> = model.effects.iter().map(|effect| effect.name()).collect();
    full(model.law, Some(model.several.name()), &effects)
}

pub(super) fn full(law: &str, several: Option<&str>, effects: &[&str]) -> String {
    let several = several.filter(|several| *several != carom_sim::SeveralLaw::default().name());
    let several = several.map_or(String::new(), |several| format!(", {several}"));
    effects.iter().fold(format!("{law}{several}"), |name, effect| format!("{name} + {effect}"))
}
