//! The start of a roll-out: the state at the first free sample, and the sample of the first impact.

use super::roll_out::sampled;
use super::{GRAVITY, Toss, TossError, Tosses, on_floor};
use crate::fit::{Flight, Launched, launch};
use carom_chain::Chain;
use carom_sim::{ContactRule, SimError, Simulation};
use rayon::prelude::*;

/// How the state at the start of a roll-out is determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Start {
    /// By [`launch()`]: fitted to the poses of all samples from the first free one to the first impact.
    #[default]
    Fitted,
    /// The pose and the velocities of the first free sample, as the table gives them.
    Given,
}

crate::words! { Start { Fitted "fitted", Given "given" } }

/// The start of the roll-out of a toss.
#[derive(Debug, Clone, PartialEq)]
pub struct Launch {
    /// Index of the first sample that does not touch the floor.
    pub sample: usize,
    /// Configuration at this sample, rad or m.
    pub q: Vec<f64>,
    /// Joint velocities at this sample, rad/s or m/s.
    pub qd: Vec<f64>,
    /// Index of the sample of the first impact: the first local minimum of the gap to the floor that is below 2 cm; `None`
    /// without one.
    pub impact: Option<usize>,
    /// The fit that gave the state; `None` for the state of the table.
    pub fitted: Option<Fitted>,
}

/// A start fitted to a flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The estimate.
    pub state: Launched,
    /// Number of samples of the flight.
    pub samples: usize,
}

/// Greatest gap to the floor at the sample of the first impact, m. At 148 Hz and 3 m/s the body moves 2 cm between samples.
const NEAR: f64 = 0.02;
/// Fewest samples of a flight to which a start is fitted.
const FEWEST: usize = 4;

impl Tosses {
    /// The start of the roll-out of each toss, in the order of the tosses. A start is that of the table if the flight has
    /// fewer than four samples, if its fit does not converge, and if the fitted pose overlaps the floor.
    #[doc(hidden)] // for carom-evidence
    pub fn launches(&self, start: Start) -> Vec<Result<Launch, TossError>> {
        self.tosses.par_iter().map(|toss| self.launch(toss, start)).collect()
    }

    fn launch(&self, toss: &Toss, start: Start) -> Result<Launch, TossError> {
        let refuse = |reason: SimError| TossError::Simulation { number: toss.number, reason };
        let gaps = self.gaps(toss)?;
        let Some(sample) = gaps.iter().position(|gap| *gap > 0.0) else {
            let (what, rule) =
                ("number of free samples", "a toss needs at least one sample without contact with the floor");
            return Err(refuse(SimError::Setting { what, value: 0.0, rule }));
        };
        let low = |k: &usize| gaps[*k] < gaps[k - 1] && gaps[*k] <= gaps[k + 1] && gaps[*k] < NEAR;
        let impact = (sample + 1..gaps.len().saturating_sub(1)).find(low);
        let given = &toss.samples[sample];
        let table = Launch { sample, q: given.q.clone(), qd: given.qd.clone(), impact, fitted: None };
        let flight = table.flight(toss);
        if start == Start::Given || flight.times.len() < FEWEST {
            return Ok(table);
        }
        let Ok(state) = launch(&self.chain, GRAVITY, &flight) else { return Ok(table) };
        let simulation = on_floor(&self.scene(), &ContactRule::default()).map_err(refuse)?;
        if simulation.smallest_gap(&state.q).map_err(refuse)? <= 0.0 {
            return Ok(table);
        }
        let (q, qd) = (state.q.clone(), state.qd.clone());
        Ok(Launch { q, qd, fitted: Some(Fitted { state, samples: flight.times.len() }), ..table })
    }
}

impl Launch {
    /// The samples of the flight before the first impact; empty without one.
    fn flight(&self, toss: &Toss) -> Flight {
        Flight::of(&toss.samples[self.sample..self.impact.unwrap_or(self.sample)])
    }

    /// The start for other inertias, places and friction of the joints: a fitted state is fitted again, to the same samples. A
    /// state of the table, and one whose fit does not converge, is kept.
    #[doc(hidden)] // for carom-evidence
    pub fn refitted(&self, chain: &Chain, toss: &Toss) -> Self {
        let Some(old) = &self.fitted else { return self.clone() };
        let flight = self.flight(toss);
        let count = flight.times.len();
        let end = flight.times[count - 1] - flight.times[0];
        let simulation =
            Simulation { gravity: GRAVITY, tolerance: REFIT, ..Simulation::new(chain.clone(), Vec::new()) };
        let flown = |q: &[f64], qd: &[f64]| {
            let (moments, _) = sampled(&simulation, (q, qd), end, count).ok()?;
            Some(moments.into_iter().map(|moment| moment.q).collect())
        };
        let Some(state) = old.state.refined(chain, &flight, &flown) else { return self.clone() };
        Self { q: state.q.clone(), qd: state.qd.clone(), fitted: Some(Fitted { state, ..old.clone() }), ..self.clone() }
    }
}

/// Relative tolerance of the flights to which a start is fitted again.
const REFIT: f64 = 1e-7;
