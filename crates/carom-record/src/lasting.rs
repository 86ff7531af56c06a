//! The lasting contacts of a recording: one lane of modes for each contact, and arrows of the forces.

use crate::RecordError;
use crate::bounds::xyz;
use crate::geometry::fixed;
use crate::target::Sink;
use carom_sim::{ContactMode, ContactState, EventKind};
use nalgebra::Vector3;
use rerun::{EntityPath, EntityPathPart};
use std::collections::BTreeMap;

const FORCE: u32 = 0x59c1_7aff;
const OPEN: &str = "open";
/// Modes of contacts whose motion is not unique.
const SLIDES_OPENLY: &str = "sliding, non-unique";
const STICKS_OPENLY: &str = "sticking, non-unique";
const STEPS_OPENLY: &str = "stepping, non-unique";
/// Modes with their colours.
const MODES: [(&str, u32); 11] = [
    ("free", 0x4e79_a7ff),
    ("sliding", 0xf28e_2bff),
    ("sticking", 0xe157_59ff),
    ("latched", 0xb07a_a1ff),
    ("pressing", 0xedc9_48ff),
    ("several", 0x59a1_4fff),
    ("stepping", 0x9c75_5fff),
    (SLIDES_OPENLY, 0xff9d_a7ff),
    (STICKS_OPENLY, 0x9c2f_4aff),
    (STEPS_OPENLY, 0xc8a2_c8ff),
    (OPEN, 0x3a40_4cff),
];

/// The modes of all contacts that have lasted so far.
#[derive(Default)]
pub(crate) struct Lanes {
    /// By touch.
    modes: BTreeMap<usize, &'static str>,
    /// The mode of all of them in one word.
    whole: Option<&'static str>,
    /// Whether arrows are shown.
    shown: bool,
    /// Length of the arrow of 1 N, m, once it is known.
    pub arrow: Option<f64>,
}

impl Lanes {
    /// Logs the mode of all contacts at the start.
    pub fn begin(&mut self, sink: &Sink) -> Result<(), RecordError> {
        fixed(sink, &"contact".into(), &modes())?;
        self.enter(sink)
    }

    /// The lasting contacts at the present time of `sink`.
    pub fn set(&mut self, sink: &Sink, touches: &[String], states: &[ContactState]) -> Result<(), RecordError> {
        let closed: Vec<usize> =
            self.modes.keys().copied().filter(|k| !states.iter().any(|it| it.touch == *k)).collect();
        for touch in closed {
            self.lane(sink, touches, touch, OPEN)?;
        }
        for state in states {
            self.lane(sink, touches, state.touch, shown(state))?;
        }
        self.enter(sink)
    }

    /// The change of a mode by an event, at the present time of `sink`.
    pub fn event(&mut self, sink: &Sink, touches: &[String], kind: &EventKind) -> Result<(), RecordError> {
        match kind {
            EventKind::LiftOff { touch } => self.lane(sink, touches, *touch, OPEN)?,
            EventKind::Mode { mode: ContactMode::Free } => self.set(sink, touches, &[])?,
            EventKind::Mode { mode } => {
                if let Some(touch) = mode.touch() {
                    self.lane(sink, touches, touch, mode.name())?;
                }
            }
            _ => {}
        }
        self.enter(sink)
    }

    fn lane(&mut self, sink: &Sink, touches: &[String], touch: usize, mode: &'static str) -> Result<(), RecordError> {
        let path = EntityPath::new(["contact", &touches[touch]].map(EntityPathPart::new).to_vec());
        match self.modes.insert(touch, mode) {
            Some(before) if before == mode => return Ok(()),
            Some(_) => {}
            None => fixed(sink, &path, &modes())?,
        }
        sink.rec.log(path, &rerun::StateChange::single(mode)).map_err(|e| sink.error(e.to_string()))
    }

    fn enter(&mut self, sink: &Sink) -> Result<(), RecordError> {
        let mut closed = self.modes.values().copied().filter(|mode| *mode != OPEN);
        let whole = match (closed.next(), closed.next()) {
            (None, _) => "free",
            (Some(only), None) => only,
            (Some("stepping" | STEPS_OPENLY), Some(_)) => "stepping",
            _ => "several",
        };
        if self.whole.replace(whole) == Some(whole) {
            return Ok(());
        }
        sink.rec.log("contact", &rerun::StateChange::single(whole)).map_err(|e| sink.error(e.to_string()))
    }

    /// Draws the forces of these contacts at the present time of `sink`: `before` moves a point towards the eye and shortens by
    /// `share`; `size` is that of the scene, `longest` the length at which arrows are cut, m.
    pub fn draw(
        &mut self,
        sink: &Sink,
        states: &[ContactState],
        (before, share): (impl Fn(Vector3<f64>) -> Vector3<f64>, f64),
        (size, longest): (f64, f64),
    ) -> Result<(), RecordError> {
        let forces: Vec<&ContactState> = states.iter().filter(|state| state.force.norm() > 0.0).collect();
        let shown = std::mem::replace(&mut self.shown, !forces.is_empty());
        if forces.is_empty() && !shown {
            return Ok(());
        }
        let scale = self.arrow.unwrap_or_default();
        let arrow = |state: &&ContactState| xyz((state.force * scale).cap_magnitude(longest) * (1.0 - share));
        let arrows = rerun::Arrows3D::from_vectors(forces.iter().map(arrow))
            .with_origins(forces.iter().map(|state| xyz(before(state.point))))
            .with_colors([FORCE])
            .with_radii([0.005 * size as f32]);
        sink.rec.log("world/forces", &arrows).map_err(|e| sink.error(e.to_string()))
    }
}

/// The mode of a contact, and whether the motion with it is unique.
fn shown(state: &ContactState) -> &'static str {
    match state.mode.name() {
        name if state.flags.is_empty() => name,
        "sticking" => STICKS_OPENLY,
        "stepping" => STEPS_OPENLY,
        _ => SLIDES_OPENLY,
    }
}

fn modes() -> rerun::StateConfiguration {
    let modes = rerun::StateConfiguration::new().with_values(MODES.map(|(name, _)| name));
    modes.with_colors(MODES.map(|(_, colour)| colour))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::Target;
    use carom_impact::Flags;

    fn state(mode: ContactMode) -> ContactState {
        let zero = Vector3::zeros();
        let touch = mode.touch().unwrap();
        let flags = Flags::NONE;
        ContactState { touch, mode, point: zero, normal: zero, gap: 0.0, force: zero, normal_force: 0.0, flags }
    }

    /// Sampled contacts alone, without the events between them, give each lane its mode; a contact that is not told is open.
    #[test]
    fn every_sampled_contact_has_its_mode_and_one_that_is_not_told_is_open() {
        let path = std::env::temp_dir().join(format!("carom-lanes-{}.rrd", std::process::id()));
        let sink = Sink::open(&Target::File(path), "lanes").unwrap();
        let touches = ["a", "b", "c"].map(str::to_owned);
        let mut lanes = Lanes::default();
        lanes.begin(&sink).unwrap();
        let all = |lanes: &Lanes| (lanes.modes.iter().map(|(k, mode)| (*k, *mode)).collect::<Vec<_>>(), lanes.whole);
        let two = [state(ContactMode::Sliding { touch: 0 }), state(ContactMode::Sticking { touch: 2 })];
        lanes.set(&sink, &touches, &two).unwrap();
        assert_eq!(all(&lanes), (vec![(0, "sliding"), (2, "sticking")], Some("several")));
        lanes.set(&sink, &touches, &two[1..]).unwrap();
        assert_eq!(all(&lanes), (vec![(0, OPEN), (2, "sticking")], Some("sticking")));
        let open = ContactState { flags: Flags::NON_UNIQUE, ..two[0] };
        lanes.set(&sink, &touches, &[open, two[1]]).unwrap();
        assert_eq!(all(&lanes).0[0], (0, SLIDES_OPENLY));
        lanes.set(&sink, &touches, &two[1..]).unwrap();
        lanes.event(&sink, &touches, &EventKind::LiftOff { touch: 2 }).unwrap();
        assert_eq!(all(&lanes), (vec![(0, OPEN), (2, OPEN)], Some("free")));
    }
}
