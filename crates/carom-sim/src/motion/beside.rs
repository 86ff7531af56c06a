//! The response of a chain at a touch in an impact while other contacts last: these are constraints that carry impulses.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | c, l | 3, m | rows of the touch that is struck, in contact axes; rows of the lasting contacts | – |
//! | T | m×3 | impulses of the lasting contacts, with the sign changed, for unit impulses of the touch | `passed` |
//! | H' | 3×3 | H_cc − H_cl T with H_ll T = H_lc | `delassus` |
//!
//! Dry friction of joints carries no impulse: its force is bounded.

use super::active_set::{Hold, Lasting};
use super::assembled::Assembled;
use super::held::Detail;
use super::rows::Contact;
use super::smooth::Motion;
use crate::error::SimError;
use crate::state::{Basis, ContactImpulse, EXACT, Space};
use nalgebra::{DMatrix, Matrix3, Matrix3xX, MatrixXx3, Vector3};

/// See the head of this module.
pub(crate) struct Beside {
    /// H', contact axes: tangents first, normal last, 1/kg.
    pub delassus: Matrix3<f64>,
    /// Velocity jumps of the joints for unit impulses of the touch along the world axes, nv×3.
    pub response: MatrixXx3<f64>,
    passed: DMatrix<f64>,
    contacts: Vec<Contact>,
    pub position: Vector3<f64>,
    pub normal: Vector3<f64>,
}

impl<A: Space> Motion<'_, A> {
    /// The inertia at a touch beside the lasting contacts; `None` if one of them slides with friction, so that its impulse is
    /// not along a fixed direction, or if the touch is a joint limit.
    pub fn beside(&mut self, touch: usize, time: f64, y: &[f64]) -> Result<Option<Beside>, SimError> {
        let rigid = self.active.lasting.iter().filter(|own| own.is_rigid()).copied();
        let entries: Vec<Lasting> = rigid.chain(std::iter::once(Lasting { touch, hold: Hold::Sticks })).collect();
        let mut found = Assembled::new(self.sim.chain.nv());
        let dry = std::mem::take(&mut self.active.dry);
        let done = self.assemble((time, y), &entries, Detail::ROWS, &mut found);
        self.active.dry = dry;
        done?;
        let Assembled { constraints, responses, .. } = found;
        let mut contacts = constraints.contacts;
        let Some(Contact { directions: Some(axes), normal, position, rows, .. }) = contacts.pop() else {
            return Ok(None);
        };
        if !constraints.skewed.is_empty() {
            return Ok(None);
        }
        let m = rows.start;
        let all = constraints.rows.times(&responses);
        let gram = all.view((0, 0), (m, m)).into_owned();
        let across = all.view((0, m), (m, 3)).into_owned();
        let Some(passed) = Basis::of(&gram).spread(&gram, &[]).and_then(|equations| equations.solve(&across)) else {
            return Ok(None);
        };
        let whole: Matrix3<f64> = all.fixed_view::<3, 3>(m, m).into_owned();
        let taken = across.transpose() * &passed;
        let delassus = whole - taken.fixed_view::<3, 3>(0, 0);
        let delassus = (delassus + delassus.transpose()) * 0.5;
        let nv = self.sim.chain.nv();
        let mut own = Matrix3xX::zeros(nv);
        for k in 0..3 {
            for v in 0..nv {
                let through: f64 = (0..m).map(|l| responses.row(l)[v] * passed[(l, k)]).sum();
                own[(k, v)] = responses.row(m + k)[v] - through;
            }
        }
        let response = own.transpose() * axes.transpose();
        Ok(Some(Beside { delassus, response, passed, contacts, position, normal }))
    }

    /// The impulses of the lasting contacts for an impulse of the touch (contact axes, N s); `None` if one of these pulls or leaves its
    /// friction cone.
    pub fn carried(&self, beside: &Beside, impulse: &Vector3<f64>) -> Option<Vec<ContactImpulse>> {
        let passed = -(&beside.passed * impulse);
        let rounding = EXACT * impulse.norm();
        let mut impulses = Vec::new();
        for contact in &beside.contacts {
            let own = &passed.as_slice()[contact.rows.clone()];
            let rule = &self.sim.touches[contact.own.touch].contact;
            let normal = own[own.len() - 1];
            let slides = own.len() == 3 && own[0].hypot(own[1]) > rule.law.friction() * normal + rounding;
            if !rule.latch && (normal < -rounding || slides) {
                return None;
            }
            if contact.directions.is_some() {
                let impulse = contact.force(passed.as_slice());
                impulses.push(ContactImpulse { touch: contact.own.touch, point: contact.position, impulse });
            }
        }
        Some(impulses)
    }
}
