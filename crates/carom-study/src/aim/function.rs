//! Functions of states, impacts and unknowns, from formulas.
//!
//! Their derivatives are central differences of fourth order: a function needs the kinematics of one state only, so that they cost little
//! beside a run, and their error is that of rounding, about 1e-11.

use crate::problem_file::{STEP, difference};
use carom_chain::{FrameId, Spatial, Workspace};
use carom_sim::{Formula, SimError, Simulation, state_variables};

/// A function from a formula.
#[derive(Clone)]
pub(super) struct Function {
    formula: Formula,
    variables: Vec<Variable>,
}

#[derive(Clone, Copy)]
enum Variable {
    /// A number of (q, qd).
    State(usize),
    /// A coordinate of the origin of a link.
    Place(FrameId, usize),
    /// A component of its velocity.
    Speed(FrameId, usize),
    Time,
    /// The normal impulses of the named contacts, N s.
    Impulse,
    /// The kinetic energy that the impact takes, J.
    Lost,
    Unknown(usize),
}

/// Where a function is evaluated: a state, or an impact with the states before and after it.
#[derive(Clone, Copy)]
pub(super) struct Point<'a> {
    pub sim: &'a Simulation,
    /// The time of the simulation, and since the start, s.
    pub clock: f64,
    pub time: f64,
    pub q: &'a [f64],
    /// The velocities before and after; the same without an impact.
    pub qd: [&'a [f64]; 2],
    /// Which of them counts: 0 or 1.
    pub side: usize,
    /// The touches of the impact, and those among them that count.
    pub struck: &'a [usize],
    pub counts: &'a [usize],
    pub unknowns: &'a [f64],
}

/// The derivatives of a function: by a displacement of q and by the velocities before and after; by time and by the unknowns.
pub(super) struct Slope {
    pub q: Vec<f64>,
    pub qd: [Vec<f64>; 2],
    pub time: f64,
    pub unknowns: Vec<f64>,
}

impl Function {
    /// Reads a formula of the state of a scene and of these unknowns; with `impact` it may have `impulse` and `lost`.
    pub fn of(formula: &str, sim: &Simulation, unknowns: &[String], impact: bool) -> Result<Self, String> {
        let refuse = |why: String| format!("\"{formula}\" {why}");
        let states = state_variables(&sim.chain);
        let state_names = states.iter().map(|(name, _)| name.as_str());
        let known: Vec<&str> = state_names.chain(unknowns.iter().map(String::as_str)).collect();
        let read = Formula::of(formula, &known)?;
        let find = |name: &String| {
            if let Some((_, k)) = states.iter().find(|(known, _)| known == name) {
                return Ok(Variable::State(*k));
            }
            if let Some(k) = unknowns.iter().position(|own| own == name) {
                return Ok(Variable::Unknown(k));
            }
            match name.as_str() {
                "time" => return Ok(Variable::Time),
                "impulse" if impact => return Ok(Variable::Impulse),
                "lost" if impact => return Ok(Variable::Lost),
                "impulse" | "lost" => return Err(refuse(format!("has {name}, which an impact has: name its contact"))),
                _ => {}
            }
            if let Some(found) = of_link(name, sim) {
                return Ok(found);
            }
            let known: Vec<&str> = states.iter().map(|(name, _)| name.as_str()).collect();
            let own: Vec<&str> = unknowns.iter().map(String::as_str).collect();
            Err(refuse(format!(
                "has no variable '{name}': there are the state, {}; places and velocities of links, as {{LINK.x}} and {{LINK.vx}}; \
                 time; of an impact impulse and lost; and the unknowns, {}",
                known.join(", "),
                own.join(", ")
            )))
        };
        let variables = read.names().iter().map(find).collect::<Result<_, _>>()?;
        Ok(Self { formula: read, variables })
    }

    /// Whether this name is that of a coordinate or a velocity of a link.
    pub fn is_of_link(name: &str, sim: &Simulation) -> bool {
        of_link(name, sim).is_some()
    }

    pub fn is_constant(&self) -> bool {
        self.variables.is_empty()
    }

    /// Whether it depends on the simulation beside the motion: on the law of an impact, or on masses.
    pub fn is_of_impact(&self) -> bool {
        self.variables.iter().any(|it| matches!(it, Variable::Impulse | Variable::Lost))
    }

    pub fn has_impulse(&self) -> bool {
        self.variables.iter().any(|it| matches!(it, Variable::Impulse))
    }

    /// Its value.
    pub fn at(&self, point: &Point, workspace: &mut Workspace<Spatial<f64>>) -> Result<f64, SimError> {
        let values = self.variables.iter().map(|variable| variable.at(point, workspace));
        let values = values.collect::<Result<Vec<_>, SimError>>()?;
        Ok(self.formula.at(&values))
    }

    /// Its derivatives.
    pub fn slope(&self, point: &Point, workspace: &mut Workspace<Spatial<f64>>) -> Result<Slope, SimError> {
        let chain = &point.sim.chain;
        let nv = chain.nv();
        let has = |of: fn(&Variable) -> bool| self.variables.iter().any(of);
        let of_state = has(|it| !matches!(it, Variable::Time | Variable::Unknown(_)));
        let of_both = self.is_of_impact();
        let mut slope = Slope {
            q: vec![0.0; nv],
            qd: [vec![0.0; nv], vec![0.0; nv]],
            time: 0.0,
            unknowns: vec![0.0; point.unknowns.len()],
        };
        for v in (0..nv).filter(|_| of_state) {
            let mut unit = vec![0.0; nv];
            unit[v] = 1.0;
            slope.q[v] = difference(1.0, |by| {
                let q = chain.integrate(point.q, &unit, by)?;
                self.at(&Point { q: &q, ..*point }, workspace)
            })?;
            for side in [0, 1].into_iter().filter(|side| of_both || *side == point.side) {
                slope.qd[side][v] = difference(1.0 + point.qd[side][v].abs(), |by| {
                    let mut moved = point.qd[side].to_vec();
                    moved[v] += by;
                    let mut qd = point.qd;
                    qd[side] = &moved;
                    self.at(&Point { qd, ..*point }, workspace)
                })?;
            }
        }
        if has(|it| matches!(it, Variable::Time | Variable::Impulse)) {
            let at = |by| Point { time: point.time + by, clock: point.clock + by, ..*point };
            slope.time = difference(1.0, |by| self.at(&at(by), workspace))?;
        }
        for variable in &self.variables {
            if let Variable::Unknown(k) = variable {
                slope.unknowns[*k] = difference(1.0 + point.unknowns[*k].abs(), |by| {
                    let mut unknowns = point.unknowns.to_vec();
                    unknowns[*k] += by;
                    self.at(&Point { unknowns: &unknowns, ..*point }, workspace)
                })?;
            }
        }
        Ok(slope)
    }
}

/// `LINK.x` and `LINK.vx`.
fn of_link(name: &str, sim: &Simulation) -> Option<Variable> {
    let (link, part) = name.rsplit_once('.')?;
    let frame = sim.chain.frame(link).ok()?;
    let (is_speed, axis) = part.strip_prefix('v').map_or((false, part), |axis| (true, axis));
    let axis = ["x", "y", "z"].iter().position(|own| *own == axis)?;
    Some(if is_speed { Variable::Speed(frame, axis) } else { Variable::Place(frame, axis) })
}

impl Variable {
    fn at(self, point: &Point, workspace: &mut Workspace<Spatial<f64>>) -> Result<f64, SimError> {
        let (sim, qd) = (point.sim, point.qd[point.side]);
        let chain = &sim.chain;
        let origin = |frame| chain.point(frame, nalgebra::Vector3::zeros());
        Ok(match self {
            Self::State(k) => point.q.get(k).copied().unwrap_or_else(|| qd[k - point.q.len()]),
            Self::Place(frame, axis) => workspace.update(chain, point.q)?.position(origin(frame))[axis],
            Self::Speed(frame, axis) => workspace.update(chain, point.q)?.point_velocity(origin(frame), qd)?[axis],
            Self::Time => point.time,
            Self::Impulse => {
                let impulses = sim.normal_impulses(point.struck, point.q, point.qd, point.clock)?;
                point
                    .struck
                    .iter()
                    .zip(impulses)
                    .filter(|(touch, _)| point.counts.contains(touch))
                    .map(|(_, p)| p)
                    .sum()
            }
            Self::Lost => {
                let mut at = workspace.update(chain, point.q)?;
                at.kinetic_energy(point.qd[0])? - at.kinetic_energy(point.qd[1])?
            }
            Self::Unknown(k) => point.unknowns[k],
        })
    }
}

/// [`difference`], or that of one side where the function has no value on the other.
pub(super) fn difference_within(size: f64, mut at: impl FnMut(f64) -> Result<f64, SimError>) -> Result<f64, SimError> {
    difference(size, &mut at).or_else(|why| {
        let mut beside = |h: f64| -> Result<f64, SimError> {
            let weights = [-25.0, 48.0, -36.0, 16.0, -3.0];
            let parts = weights.iter().enumerate().map(|(k, weight)| Ok(at(k as f64 * h)? * weight / (12.0 * h)));
            parts.sum()
        };
        let h = STEP * size;
        beside(h).or_else(|_| beside(-h)).map_err(|_| why)
    })
}
