//! The forces of the last solution of the complementarity problem: its modes are often those of the next one.

use super::rows::{Constraints, Contact};
use nalgebra::DVector;

/// The forces of the last solution, from which the next one starts.
#[derive(Debug, Clone, Default)]
pub(crate) struct Loads {
    /// Touches with the forces of their rows.
    contacts: Vec<(usize, DVector<f64>)>,
    /// Index into the list of dry joints, and force.
    joints: Vec<(usize, f64)>,
}

impl Loads {
    /// The forces of the rows of these constraints; zero where they are not known.
    pub fn start(&self, constraints: &Constraints) -> DVector<f64> {
        let mut start = DVector::zeros(constraints.rows.len());
        for contact in &constraints.contacts {
            let known =
                self.contacts.iter().find(|(touch, own)| *touch == contact.touch && own.len() == contact.rows.len());
            if let Some((_, own)) = known {
                start.rows_mut(contact.rows.start, own.len()).copy_from(own);
            }
        }
        let first = start.len() - constraints.joints.len();
        for (i, k) in constraints.joints.iter().enumerate() {
            start[first + i] = self.joints.iter().find(|(joint, _)| joint == k).map_or(0.0, |(_, force)| *force);
        }
        start
    }

    /// Keeps the forces of these constraints.
    pub fn keep(&mut self, constraints: &Constraints, force: &DVector<f64>) {
        let own = |contact: &Contact| (contact.touch, force.rows_range(contact.rows.clone()).into_owned());
        self.contacts = constraints.contacts.iter().map(own).collect();
        let first = force.len() - constraints.joints.len();
        self.joints = constraints.joints.iter().enumerate().map(|(i, k)| (*k, force[first + i])).collect();
    }
}
