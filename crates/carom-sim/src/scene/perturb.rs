//! Random disturbances of the start and of other numbers of a scene.

use crate::error::SimError;
use carom_chain::Chain;
use serde::Deserialize;

/// Random disturbances, for many runs of one scene. Run `k` of a seed has always the same ones.
#[derive(Debug, Clone, PartialEq)]
pub struct Perturbation {
    /// Size of the displacement along each number of qd: rad, m. A floating joint is displaced along and turned about the
    /// axes of its body.
    pub q: Vec<f64>,
    /// Size of the change of each number of qd, rad/s, m/s.
    pub qd: Vec<f64>,
    /// Other numbers of the scene.
    pub numbers: Vec<Disturbed>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// What the sizes of `q` and `qd` mean.
    pub distribution: Distribution,
}

/// A disturbed number of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Disturbed {
    /// The path of its key.
    pub path: String,
    /// Size of its changes, in its unit.
    pub size: f64,
    /// What size means.
    pub distribution: Distribution,
}

/// The distribution of a disturbance of size s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Distribution {
    /// Normal, with the standard deviation s.
    #[default]
    Normal,
    /// Uniform between −s and s.
    Uniform,
}

#[doc(hidden)]
impl Perturbation {
    /// The disturbed start of a run: q and qd. Run 0 is the start itself.
    ///
    /// # Errors
    /// [`SimError::Chain`] if the sizes or the state do not fit the chain.
    pub fn start(&self, chain: &Chain, (q, qd): (&[f64], &[f64]), run: u64) -> Result<(Vec<f64>, Vec<f64>), SimError> {
        chain.check_state(q, qd)?;
        chain.check_v("perturb.q", &self.q)?;
        chain.check_v("perturb.qd", &self.qd)?;
        if run == 0 {
            return Ok((q.to_vec(), qd.to_vec()));
        }
        let (mut draw, own) = (self.draws(run), self.distribution);
        let displaced: Vec<f64> = self.q.iter().map(|size| size * draw(own)).collect();
        let moved = chain.integrate(q, &displaced, 1.0)?;
        Ok((moved, qd.iter().zip(&self.qd).map(|(v, size)| v + size * draw(own)).collect()))
    }

    /// The changes of [`numbers`](Self::numbers) in a run; none in run 0.
    pub fn changes(&self, run: u64) -> Vec<f64> {
        if run == 0 || self.numbers.is_empty() {
            return vec![0.0; self.numbers.len()];
        }
        let mut draw = self.draws(run);
        // After those of the start, which do not depend on them.
        (0..self.q.len() + self.qd.len()).for_each(|_| _ = draw(self.distribution));
        self.numbers.iter().map(|own| own.size * draw(own.distribution)).collect()
    }

    /// Random numbers of size 1, which depend on seed and run only, so that runs are independent of their order.
    fn draws(&self, run: u64) -> impl FnMut(Distribution) -> f64 {
        let mut random = fastrand::Rng::with_seed(self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ run);
        random.u64(..);
        move |distribution| match distribution {
            Distribution::Uniform => 2.0 * random.f64() - 1.0,
            // Box and Muller's transformation; 1 − x is not zero.
            Distribution::Normal => {
                let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
                radius * (std::f64::consts::TAU * random.f64()).cos()
            }
        }
    }
}

#[doc(hidden)]
impl Distribution {
    /// The standard deviation of a disturbance of this size.
    pub fn deviation(self, size: f64) -> f64 {
        match self {
            Self::Normal => size,
            Self::Uniform => size / 3.0_f64.sqrt(),
        }
    }
}
