//! The set of outcomes over the orders of sub-impacts.

use nalgebra::DVector;

use super::sequential::Reduced;
use super::{Accuracy, Constraint, Order, SeveralOutcome, SeveralProblem};

/// Outcomes nearer to one another than this multiple of the tolerance count as equal.
const SAME: f64 = 1000.0;

/// One outcome of the set, with the first order that led to it.
#[derive(Debug, Clone, PartialEq)]
pub struct OrderOutcome {
    /// The cycle: indices of the constraints, without those that are `Held`.
    pub order: Vec<usize>,
    /// The outcome of this order.
    pub outcome: SeveralOutcome,
}

/// Result of [`SeveralProblem::all_orders`].
#[derive(Debug, Clone, PartialEq)]
pub struct OrderSet {
    /// Outcomes whose `u_plus` differ by more than 1000 times the tolerance, relative to the largest velocity.
    pub outcomes: Vec<OrderOutcome>,
    /// Number of orders tried.
    pub tried: usize,
    /// Whether these are all orders.
    pub complete: bool,
    /// Number of orders whose sequence did not end.
    pub unfinished: usize,
    /// Largest distance between two `u_plus` of `outcomes`, `|u⁺ - u⁺'|` (m/s).
    pub spread: f64,
    /// Least value of each entry of `u_plus` (m/s).
    pub lower: DVector<f64>,
    /// Largest value of each entry of `u_plus` (m/s).
    pub upper: DVector<f64>,
}

impl SeveralProblem {
    /// The set of outcomes of [`sequential`](Self::sequential) over the cyclic orders of the constraints.
    ///
    /// Two cycles with different starts count as two orders. With m constraints that are not `Held`, all m! orders are
    /// tried if m! ≤ `limit`; otherwise `limit` orders (at least one) are drawn with a fixed seed, possibly with
    /// repetitions.
    ///
    /// **Guarantee.** The same call returns the same set.
    ///
    /// **Fails** to contain all outcomes of sequences if `complete` is false; and rules other than cycles
    /// ([`Order::MostApproaching`] among them) may lead to further outcomes. The time grows with the square of the
    /// number of outcomes.
    ///
    /// ```
    /// use carom_impact::{Accuracy, Constraint, SeveralProblem};
    /// use nalgebra::{dmatrix, dvector};
    ///
    /// // A rod of 1 kg falls flat on both its ends: the outcome depends on which strikes first.
    /// let ends = vec![Constraint::Stop { restitution: 0.5 }; 2];
    /// let rod = SeveralProblem::new(dmatrix![4.0, -2.0; -2.0, 4.0], dvector![-1.0, -1.0], ends)?;
    /// let set = rod.all_orders(100, &Accuracy::default());
    /// assert_eq!((set.tried, set.complete), (2, true));
    /// assert_eq!(set.outcomes[0].outcome.u_plus, dvector![0.40625, 0.265625]); // left first
    /// assert_eq!(set.outcomes[1].outcome.u_plus, dvector![0.265625, 0.40625]);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    pub fn all_orders(&self, limit: usize, accuracy: &Accuracy) -> OrderSet {
        let free = |k: &usize| self.constraints[*k] != Constraint::Held;
        let mut order: Vec<usize> = (0..self.constraints.len()).filter(free).collect();
        let all = (1..=order.len()).try_fold(1_usize, |product, k| product.checked_mul(k));
        let complete = all.is_some_and(|all| all <= limit.max(1));
        let tried = if complete { all.unwrap_or(1) } else { limit.max(1) };
        let reduced = Reduced::new(self);
        let near = SAME * accuracy.tolerance * self.u_minus.amax().max(self.u_free.amax());
        let mut draw = fastrand::Rng::with_seed(0);
        let mut outcomes: Vec<OrderOutcome> = Vec::new();
        let mut unfinished = 0;
        for _ in 0..tried {
            if !complete {
                draw.shuffle(&mut order);
            }
            let cycle = Order::Cycle(order.clone());
            let outcome = self.sequence(&reduced, &cycle, accuracy);
            unfinished += usize::from(!outcome.is_solved(accuracy));
            if outcomes.iter().all(|known| (&known.outcome.u_plus - &outcome.u_plus).amax() > near) {
                outcomes.push(OrderOutcome { order: order.clone(), outcome });
            }
            if complete {
                advance(&mut order);
            }
        }
        let velocities = || outcomes.iter().map(|known| &known.outcome.u_plus);
        let start = velocities().next().cloned().unwrap_or_else(|| self.u_free.clone());
        let pairs = velocities().enumerate().flat_map(|(i, a)| velocities().take(i).map(move |b| (a - b).norm()));
        OrderSet {
            spread: pairs.fold(0.0, f64::max),
            lower: velocities().fold(start.clone(), |lower, u| lower.inf(u)),
            upper: velocities().fold(start, |upper, u| upper.sup(u)),
            outcomes,
            tried,
            complete,
            unfinished,
        }
    }
}

/// The next permutation in lexicographic order; the first after the last.
fn advance(order: &mut [usize]) {
    let Some(i) = (1..order.len()).rev().find(|&i| order[i - 1] < order[i]) else {
        order.reverse();
        return;
    };
    // One exists: order[i] itself.
    let j = (i..order.len()).rev().find(|&j| order[j] > order[i - 1]).unwrap_or(i);
    order.swap(i - 1, j);
    order[i..].reverse();
}
