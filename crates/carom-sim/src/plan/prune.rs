//! Leaves out branches without contacts.

use super::Plan;
use crate::contact::Touch;
use crate::model::{Drive, Simulation};
use crate::scene::Scene;
use carom_chain::{Coordinates, JointInfo, Member};
use nalgebra::Vector3;

impl Plan {
    /// Removes branches without contacts.
    pub(super) fn prune(&mut self, scene: &Scene) {
        let whole = &scene.simulation;
        let both = |touch: &'_ Touch| [touch.link().map(str::to_owned), touch.other_link().map(str::to_owned)];
        let pushed = whole.wrenches.iter().map(|wrench| wrench.link.clone());
        let joined = whole.loops.iter().flat_map(|own| own.frames.iter().filter_map(|frame| frame.link.clone()));
        let links = whole.touches.iter().flat_map(both).flatten().chain(scene.tip.clone()).chain(pushed).chain(joined);
        let point = |link: &str| Some(whole.chain.point(whole.chain.frame(link).ok()?, Vector3::zeros()));
        let mut points: Vec<_> = links.filter_map(|link| point(&link)).collect();
        let touched = whole.touches.iter().any(|touch| touch.link().is_some());
        // Of several robots, those without contacts are kept whole: their motion is a result.
        let contacts = whole.touches.iter().filter(|it| it.link().is_some());
        let met: Vec<&Member> = contacts.flat_map(|it| it.robots(&whole.chain)).collect();
        let idle = whole.chain.members().iter().filter(|member| !met.contains(member));
        let of = |member: &Member, link: &str| link.strip_prefix(&member.name).is_some_and(|own| own.starts_with('/'));
        let links = || whole.chain.links().iter().map(|link| link.name.as_str());
        points.extend(idle.flat_map(|member| links().filter(|link| of(member, link))).filter_map(point));
        let less = whole.chain.prune(&points);
        let drives = [Some(&whole.drive), whole.after_impact.as_ref()].into_iter().flatten();
        let mut each = drives.flat_map(Drive::each_robot);
        let users = each.any(|(_, drive)| matches!(drive, Drive::User(_))); // it may read and drive any joint
        if !touched || users || less.v.is_empty() || less.v.len() == whole.chain.nv() {
            return;
        }
        let moves = |joint: &&JointInfo| !matches!(joint.coordinates, Coordinates::None);
        let kept: Vec<&str> = less.chain.joints().iter().filter(moves).map(|joint| joint.name.as_str()).collect();
        let gone = whole.chain.joints().iter().filter(moves).map(|joint| joint.name.as_str());
        let gone: Vec<&str> = gone.filter(|name| !kept.contains(name)).collect();
        self.leave_out(
            "joints",
            gone.join(", "),
            "their branches on the fixed base have no contacts: they neither affect the others nor are affected by them",
        );
        let pick = |numbers: &[f64], indices: &[usize]| indices.iter().map(|&k| numbers[k]).collect::<Vec<_>>();
        (self.q, self.qd) = (pick(&self.q, &less.q), pick(&self.qd, &less.v));
        self.simulation = Simulation {
            drive: whole.drive.reduced(&whole.chain, &less),
            after_impact: whole.after_impact.as_ref().map(|drive| drive.reduced(&whole.chain, &less)),
            springs: whole.springs.iter().filter(|spring| spring.on(&less.chain).is_ok()).cloned().collect(),
            chain: less.chain.clone(),
            touches: Touch::reduced(&whole.touches, &less),
            ..whole.clone()
        };
    }
}
