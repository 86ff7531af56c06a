//! Random disturbances of the start and of other numbers of a scene.

use crate::error::SimError;
use carom_chain::Chain;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution as _, StandardNormal, StandardUniform};
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

    /// Random numbers of size 1: stream `run` of a generator, so that they do not depend on the order of the runs, and those of different runs
    /// are independent.
    fn draws(&self, run: u64) -> impl FnMut(Distribution) -> f64 {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(run);
        move |distribution| match distribution {
            Distribution::Uniform => {
                let share: f64 = StandardUniform.sample(&mut random);
                2.0 * share - 1.0
            }
            Distribution::Normal => StandardNormal.sample(&mut random),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of neighbouring runs, and of one run, are not correlated: for n pairs of independent numbers the correlation has the standard
    /// deviation 1/√n. The mean of all has that of 1/√n, too.
    #[test]
    fn numbers_of_runs_are_independent() {
        let (runs, each) = (4000, 8);
        for (seed, of) in (0..12).flat_map(|seed| [(seed, Distribution::Normal), (seed, Distribution::Uniform)]) {
            let own = Perturbation { q: vec![], qd: vec![], numbers: vec![], seed, distribution: of };
            let of_run = |run| {
                let mut draw = own.draws(run);
                (0..each).map(|_| draw(of) / of.deviation(1.0)).collect::<Vec<f64>>()
            };
            let drawn: Vec<Vec<f64>> = (1..=runs).map(of_run).collect();
            let mean = |products: &mut dyn Iterator<Item = f64>| {
                let (sum, count) = products.fold((0.0, 0.0), |(sum, count), x| (sum + x, count + 1.0));
                sum / count * f64::sqrt(count)
            };
            let mut deviations = vec![mean(&mut drawn.iter().flatten().copied())];
            for lag in [1, 2, 3, 4, 8, 16, 32, 64, 192] {
                deviations.push(mean(&mut drawn.iter().zip(&drawn[lag..]).map(|(a, b)| a[0] * b[0])));
            }
            for k in 1..each {
                deviations.push(mean(&mut drawn.iter().map(|own| own[0] * own[k])));
                deviations.push(mean(&mut drawn.iter().zip(&drawn[1..]).map(|(a, b)| a[k] * b[0])));
            }
            assert!(deviations.iter().all(|x| x.abs() < 4.5), "seed {seed}, {of:?}: {deviations:?}");
            assert!(deviations.iter().any(|x| x.abs() > 0.5));
        }
    }
}
