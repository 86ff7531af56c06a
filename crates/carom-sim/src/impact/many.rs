//! Impacts of a prepared strike at columns of states, with any law.
//!
//! The response of the chain is computed in SIMD lanes (`lanes.rs`), the impact of each state from its own lane by the code
//! for single impacts (`prepared.rs`). So the results are bitwise equal to those of single impacts. Chains that the fused pass
//! does not serve are computed one state at a time.

use super::hit::ChainImpact;
use super::lanes::{Lanes, Receive, States, Sweep};
use super::prepared::{Aim, OneImpact, Pass, Place, PreparedStrike, Route};
use crate::error::SimError;
use carom_chain::PointResponse;
use carom_chain::algebra::Algebra;
use carom_impact::Law;
use nalgebra::{SVector, SimdRealField};

/// Takes the number of a state and its impact.
type Each<'e> = &'e mut dyn FnMut(usize, Result<&ChainImpact, SimError>);

impl PreparedStrike<'_> {
    /// Computes the impacts at many states with one law. `each` is called once for every state, in their order, with its number
    /// and its impact, or with the error for which it has none: as [`PreparedStrike::resolve_into`], with the same digits. The
    /// impact is overwritten by the next one. Allocates its memory once for each call, and the text of an error.
    ///
    /// ```
    /// # use carom_chain::uniform_chain;
    /// # use carom_impact::Energetic;
    /// # use carom_sim::{Impacts, States};
    /// let arm = uniform_chain(2, 1.0, 1.0)?;
    /// let mut strike = arm.impact(&[], &[]).at(arm.frame("tip")?).normal([0.0, 1.0, 0.0]).prepare()?;
    /// // Three states: a column for each joint. The second arm is stretched along the normal, which no joint can move.
    /// let right = std::f64::consts::FRAC_PI_2;
    /// let (q, qd) = ([[0.3, right, 0.5], [0.7, 0.0, 0.9]], [[-0.5; 3], [-1.0; 3]]);
    /// let states = States { q: &[&q[0], &q[1]], qd: &[&qd[0], &qd[1]] };
    /// let mut impulses = [f64::NAN; 3]; // N s
    /// strike.many(states, &Energetic { restitution: 0.5, friction: 0.3 }, |k, hit| {
    ///     if let Ok(hit) = hit {
    ///         impulses[k] = hit.impulse.y;
    ///     }
    /// })?;
    /// assert!(impulses[0] > 0.0 && impulses[1].is_nan() && impulses[2] > 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`SimError::Chain`]: a wrong number of columns, or columns of different lengths.
    pub fn many(
        &mut self,
        states: States,
        law: &dyn Law<f64, 3>,
        mut each: impl FnMut(usize, Result<&ChainImpact, SimError>),
    ) -> Result<(), SimError> {
        let count = states.count(self.aim.chain)?;
        let mut hit = self.outcome();
        let asked = (states, count, law);
        match &mut self.pass {
            Route::Plane(pass) => pass.many(&self.aim, asked, &mut hit, &mut each),
            Route::Space(pass) => pass.many(&self.aim, asked, &mut hit, &mut each),
        }
    }
}

/// States, their number and their law.
type Asked<'s> = (States<'s>, usize, &'s dyn Law<f64, 3>);

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, P: Place<D>, const D: usize> Pass<'_, A, P, D> {
    fn many(&mut self, aim: &Aim, asked: Asked, hit: &mut ChainImpact, each: Each) -> Result<(), SimError> {
        let (states, count, law) = asked;
        let (mut q, mut qd) = (vec![0.0; states.q.len()], vec![0.0; states.qd.len()]);
        if self.workspace.is_some() {
            for k in 0..count {
                read((states.q, &mut q), k);
                read((states.qd, &mut qd), k);
                let done = self.resolve_into(aim, &q, &qd, law, hit);
                each(k, done.map(|()| &*hit));
            }
            return Ok(());
        }
        let nv = qd.len();
        let receive = OneByOne {
            aim,
            pass: &*self,
            asked,
            hit,
            each,
            state: (q, qd),
            vectors: vec![SVector::zeros(); 3 * nv],
            numbers: vec![0.0; nv * (nv + 2)],
        };
        let (chain, point) = (self.chain, self.point);
        Ok(Sweep { chain, point, normal: self.normal(), added: &aim.added, q: states.q, count, receive }.run()?)
    }
}

/// Entry `k` of all columns.
fn read((columns, into): (&[&[f64]], &mut [f64]), k: usize) {
    into.iter_mut().zip(columns).for_each(|(entry, column)| *entry = column[k]);
}

/// Resolves the impacts of lanes one after another.
struct OneByOne<'s, 'e, A: Algebra, P, const D: usize> {
    aim: &'s Aim<'s>,
    pass: &'s Pass<'s, A, P, D>,
    asked: Asked<'s>,
    hit: &'s mut ChainImpact,
    each: Each<'e>,
    /// q and q̇ of one state.
    state: (Vec<f64>, Vec<f64>),
    /// J, X and Y of one state.
    vectors: Vec<SVector<f64, D>>,
    /// 1/D, levers and M of one state.
    numbers: Vec<f64>,
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, P: Place<D>, const D: usize> Receive
    for OneByOne<'_, '_, A, P, D>
{
    #[inline(always)]
    fn receive<const L: usize, B: Algebra<Scalar = Lanes<L>>>(
        &mut self,
        at: usize,
        _: B::Vector,
        found: PointResponse<B>,
    ) where
        Lanes<L>: SimdRealField + Copy,
    {
        for lane in 0..L.min(self.asked.1 - at) {
            self.resolve(at + lane, lane, &found);
        }
    }
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, P: Place<D>, const D: usize> OneByOne<'_, '_, A, P, D> {
    fn resolve<const L: usize, B: Algebra<Scalar = Lanes<L>>>(
        &mut self,
        k: usize,
        lane: usize,
        found: &PointResponse<B>,
    ) where
        Lanes<L>: SimdRealField + Copy,
    {
        let Self { aim, pass, asked: (states, _, law), hit, each, state: (q, qd), vectors, numbers } = self;
        read((states.q, q), k);
        read((states.qd, qd), k);
        let n = qd.len();
        let vector = |of: B::Vector| SVector::from_fn(|i, _| B::linear_part(of, i).0[lane]);
        let (jacobian, rest) = vectors.split_at_mut(n);
        let (response, reduced_jacobian) = rest.split_at_mut(n);
        for (into, of) in
            [(&mut *jacobian, found.jacobian), (response, found.response), (reduced_jacobian, found.reduced_jacobian)]
        {
            into.iter_mut().zip(of).for_each(|(into, of)| *into = vector(*of));
        }
        let (inverse_d, rest) = numbers.split_at_mut(n);
        let (levers, mass_matrix) = rest.split_at_mut(n);
        for (into, of) in [(&mut *inverse_d, found.inverse_d), (levers, found.levers), (mass_matrix, found.mass_matrix)]
        {
            into.iter_mut().zip(of).for_each(|(into, of)| *into = of.0[lane]);
        }
        let response = PointResponse::<A> {
            position: vector(found.position),
            jacobian,
            mass_matrix,
            delassus: found.delassus.map(vector),
            response,
            mobility: found.mobility.0[lane],
            reduced_jacobian,
            inverse_d,
            levers,
        };
        let Pass { chain, axes, place, .. } = pass;
        let mut one = OneImpact { aim, chain, axes, place, q, qd, law: *law, hit, done: Ok(()) };
        let done = one.resolve(&response);
        each(k, done.map(|()| &**hit));
    }
}
