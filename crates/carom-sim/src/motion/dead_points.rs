//! Contacts and joints with dry friction whose velocity passes through zero at a dead point.
//!
//! At a dead point the other constraints leave no motion in which a row moves: the foot of a slider-crank at the end of its stroke. No force
//! along the row stops the mechanism there. Its velocity passes through zero whatever its friction, and the new direction is that of its
//! acceleration. Near a dead point, setting the velocity of the row to zero would set others to zero that are far from it.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | R | rows of the constraints |
//! | B | those of them that hold: all but the rows that have just come to rest |
//! | G | R M⁻¹Rᵀ |
//! | x − G_B G_BB⁻¹ x_B | what is left of x, accelerations or velocities along the rows, when the rows B are zero |

use super::active_set::{Dry, DryJoint, Hold, Lasting};
use super::assembled::Assembled;
use super::held::Detail;
use super::smooth::Motion;
use super::zero::LEVER;
use crate::error::SimError;
use crate::state::{Basis, EQUAL, EXACT, Space};
use carom_chain::Rows;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

impl<A: Space> Motion<'_, A> {
    /// Lets contacts that stick and joints that dry friction holds slide on where they have just come to rest at a dead point. `before`:
    /// the joints before.
    pub fn pass_dead_points(
        &mut self,
        entries: &mut [Lasting],
        before: &[DryJoint],
        (time, y): (f64, &[f64]),
    ) -> Result<(), SimError> {
        // A velocity counts as zero if setting it to zero changes others by little. At the start no joint was at rest before.
        let held = |old: &DryJoint| old.state == Dry::Holds && time > self.sim.start_time;
        let joints = self.active.dry.iter().zip(before).map(|(joint, old)| joint.state == Dry::Holds && !held(old));
        let joints: Vec<bool> = joints.collect();
        let stops = |own: &Lasting| own.hold == Hold::Sticks && !self.active.lasting.contains(own);
        let contacts: Vec<bool> = entries.iter().filter(|own| own.is_rigid()).map(stops).collect();
        let moves = self.scale.fastest(self.split(y).1) > LEVER * self.rest();
        if !moves || !contacts.iter().chain(&joints).any(|stops| *stops) {
            return Ok(());
        }
        let mut found = Assembled::new(self.sim.chain.nv());
        self.assemble((time, y), entries, Detail::ROWS, &mut found)?;
        // The rows of each, and those of them that have come to rest.
        let of_contact = |rows: &Range<usize>| [rows.clone(), rows.start..rows.end - 1];
        let of_contacts = found.constraints.contacts.iter().zip(&contacts);
        let of_contacts: Vec<_> =
            of_contacts.map(|(contact, stops)| stops.then(|| of_contact(&contact.rows))).collect();
        let first = found.constraints.rows.len() - found.constraints.joints.len();
        let of_joints = (first..).zip(&found.constraints.joints).filter(|(_, k)| joints[**k]);
        let of_joints: Vec<_> = of_joints.map(|(row, k)| (*k, [row..row + 1, row..row + 1])).collect();
        let tested = of_contacts.iter().flatten().chain(of_joints.iter().map(|(_, rows)| rows));
        let tested: Vec<Range<usize>> = tested.map(|[_, tested]| tested.clone()).collect();
        let Some(left) = Left::of(&found, self.split(y).1, &tested) else { return Ok(()) };
        for (i, own) in entries.iter_mut().filter(|own| own.is_rigid()).enumerate() {
            if let Some(rows) = &of_contacts[i]
                && let Some(toward) = self.passing_dead_point(&found, &left, rows, y)?
            {
                own.hold = Hold::Slides { toward: found.constraints.contacts[i].tangential(toward.as_slice()) };
            }
        }
        for (k, rows) in of_joints {
            if let Some(toward) = self.passing_dead_point(&found, &left, &rows, y)? {
                self.active.dry[k].state = Dry::Brakes(toward[0]);
            }
        }
        Ok(())
    }

    /// The direction, along the rows that are `tested`, in which they begin to move at a dead point; `None` elsewhere. `all`: the rows of
    /// the same contact, too.
    fn passing_dead_point(
        &mut self,
        found: &Assembled,
        left: &Left,
        [all, tested]: &[Range<usize>; 2],
        y: &[f64],
    ) -> Result<Option<DVector<f64>>, SimError> {
        let own = |of: &DMatrix<f64>| of.rows(tested.start, tested.len()).into_owned();
        let acceleration = own(&left.accelerations).column(0).into_owned();
        if acceleration.norm() <= EQUAL * left.largest {
            return Ok(None); // the other constraints keep it at rest
        }
        let toward = acceleration.normalize();
        // The inverse inertia of the contact without constraints: its largest one, as that along a row may vanish, too.
        let (mut rows, mut alone) = (Rows::new(found.free.len()), Rows::default());
        all.clone().for_each(|i| rows.add().copy_from_slice(found.constraints.rows.row(i)));
        let (q, most) = (self.split(y).0, LEVER * self.rest());
        self.view(q)?.kin.respond(&rows, &mut alone)?;
        let alone = rows.times(&alone).diagonal().amax();
        let velocity = own(&left.velocities).column(0).dot(&toward).abs();
        let response = own(&left.responses).tr_mul(&toward);
        let yields: f64 = tested
            .clone()
            .zip(toward.iter())
            .map(|(i, x)| x * found.constraints.rows.dot(i, response.as_slice()))
            .sum();
        // The change of other velocities, and of the energy: velocities may have other units than that of the row.
        let more = self.scale.fastest(response.iter()) * velocity > most * yields
            && velocity.powi(2) * alone > most.powi(2) * yields;
        Ok((yields <= EXACT * alone || more).then_some(toward))
    }
}

/// What is left of all rows when those that hold are zero.
struct Left {
    accelerations: DMatrix<f64>,
    velocities: DMatrix<f64>,
    /// M⁻¹Rᵀ, transposed.
    responses: DMatrix<f64>,
    /// Size of the terms of the accelerations.
    largest: f64,
}

impl Left {
    /// All rows hold but these.
    fn of(found: &Assembled, qd: &[f64], but: &[Range<usize>]) -> Option<Self> {
        let basis = Basis::without(&found.gram(), but);
        let excess = found.constraints.excess(qd);
        let own = found.own();
        Some(Self {
            accelerations: basis.rest(&DMatrix::from_columns(&[found.offset()]))?,
            velocities: basis.rest(&DMatrix::from_columns(&[excess]))?,
            responses: basis.rest(&DMatrix::from_fn(own.len(), found.free.len(), |i, k| own.row(i)[k]))?,
            largest: found.largest(),
        })
    }
}
