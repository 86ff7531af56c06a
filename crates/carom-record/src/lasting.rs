//! The lasting contacts of a recording: one lane of modes for each pair of bodies, and arrows of the forces.

use crate::RecordError;
use crate::bounds::xyz;
use crate::geometry::plain;
use crate::rerun;
use crate::rerun::{EntityPath, EntityPathPart};
use crate::target::Sink;
use carom_sim::{ContactMode, ContactState, EventKind, Touch};
use nalgebra::Vector3;
use std::collections::BTreeMap;

const FORCE: u32 = 0x59c1_7aff;
const OPEN: &str = "open";
/// Modes of contacts whose motion is not unique.
const SLIDES_OPENLY: &str = "sliding, non-unique";
const STICKS_OPENLY: &str = "sticking, non-unique";
const STEPS_OPENLY: &str = "stepping, non-unique";
/// Modes with their colours. Of the contacts of one pair of bodies, the mode that stands first here is shown.
const MODES: [(&str, u32); 11] = [
    (STEPS_OPENLY, 0xc8a2_c8ff),
    ("stepping", 0x9c75_5fff),
    (SLIDES_OPENLY, 0xff9d_a7ff),
    ("sliding", 0xf28e_2bff),
    (STICKS_OPENLY, 0x9c2f_4aff),
    ("sticking", 0xe157_59ff),
    ("latched", 0xb07a_a1ff),
    ("pressing", 0xedc9_48ff),
    ("several", 0x59a1_4fff),
    ("free", 0x4e79_a7ff),
    (OPEN, 0x3a40_4cff),
];

/// The modes of all contacts that have lasted so far.
pub(crate) struct Lanes {
    /// The names of the lanes, by touch: a pair of bodies has one lane for all its contacts.
    names: Vec<String>,
    /// The modes, by touch.
    modes: BTreeMap<usize, &'static str>,
    /// The modes that the lanes show, by name.
    shown: BTreeMap<String, &'static str>,
    /// The mode of all of them in one word.
    whole: Option<&'static str>,
    /// Whether arrows are drawn.
    drawn: bool,
    /// Length of the arrow of 1 N, m, once it is known.
    pub arrow: Option<f64>,
}

impl Lanes {
    /// For these possible contacts.
    pub fn of(touches: &[Touch]) -> Self {
        let name = |touch: &Touch| match (touch.link(), touch.surface()) {
            (Some(link), Some(surface)) => format!("{link} on {surface}"),
            _ => touch.name.clone(),
        };
        Self::named(touches.iter().map(|touch| plain(&name(touch))).collect())
    }

    fn named(names: Vec<String>) -> Self {
        Self { names, modes: BTreeMap::new(), shown: BTreeMap::new(), whole: None, drawn: false, arrow: None }
    }

    /// Logs the mode of all contacts at the start.
    pub fn begin(&mut self, sink: &Sink) -> Result<(), RecordError> {
        sink.fixed("contact", &modes())?;
        self.show(sink)
    }

    /// The lasting contacts at the present time of `sink`.
    pub fn set(&mut self, sink: &Sink, states: &[ContactState]) -> Result<(), RecordError> {
        self.modes.values_mut().for_each(|mode| *mode = OPEN);
        self.modes.extend(states.iter().map(|state| (state.touch, shown(state))));
        self.show(sink)
    }

    /// The change of a mode by an event, at the present time of `sink`.
    pub fn event(&mut self, sink: &Sink, kind: &EventKind) -> Result<(), RecordError> {
        match kind {
            EventKind::LiftOff { touch } => drop(self.modes.insert(*touch, OPEN)),
            EventKind::Mode { mode: ContactMode::Free } => self.modes.values_mut().for_each(|mode| *mode = OPEN),
            EventKind::Mode { mode } => self.modes.extend(mode.touch().map(|touch| (touch, mode.name()))),
            _ => {}
        }
        self.show(sink)
    }

    /// Logs what has changed in the lanes, and the mode of all contacts if it has changed.
    fn show(&mut self, sink: &Sink) -> Result<(), RecordError> {
        let mut now = BTreeMap::new();
        for (touch, mode) in &self.modes {
            let lane = now.entry(&self.names[*touch]).or_insert(OPEN);
            *lane = MODES.iter().map(|(name, _)| *name).find(|name| name == lane || name == mode).unwrap_or(OPEN);
        }
        let log = |path: EntityPath, mode| sink.now(path, &rerun::StateChange::single(mode));
        for (lane, mode) in &now {
            let path = EntityPath::new(["contact", lane].map(EntityPathPart::new).to_vec());
            match self.shown.insert((*lane).clone(), mode) {
                Some(before) if before == *mode => continue,
                Some(_) => {}
                None => sink.fixed(path.clone(), &modes())?,
            }
            log(path, *mode)?;
        }
        let mut closed = now.values().copied().filter(|mode| *mode != OPEN);
        let whole = match (closed.next(), closed.next()) {
            (None, _) => "free",
            (Some(only), None) => only,
            (Some("stepping" | STEPS_OPENLY), Some(_)) => "stepping",
            _ => "several",
        };
        if self.whole.replace(whole) == Some(whole) { Ok(()) } else { log("contact".into(), whole) }
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
        let drawn = std::mem::replace(&mut self.drawn, !forces.is_empty());
        if forces.is_empty() && !drawn {
            return Ok(());
        }
        let scale = self.arrow.unwrap_or_default();
        let arrow = |state: &&ContactState| xyz((state.force * scale).cap_magnitude(longest) * (1.0 - share));
        let arrows = rerun::Arrows3D::from_vectors(forces.iter().map(arrow))
            .with_origins(forces.iter().map(|state| xyz(before(state.point))))
            .with_colors([FORCE])
            .with_radii([0.005 * size as f32]);
        sink.now("world/forces", &arrows)
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

    /// Sampled contacts alone, without the events between them, give each lane its mode; a contact that is not told is open; the contacts
    /// of a pair share a lane, which slides where one of them does.
    #[test]
    fn every_sampled_contact_has_its_mode_and_one_that_is_not_told_is_open() {
        let path = std::env::temp_dir().join(format!("carom-lanes-{}.rrd", std::process::id()));
        let sink = Sink::open(&Target::File(path), "lanes").unwrap();
        let mut lanes = Lanes::named(["a", "b", "c", "c"].map(str::to_owned).to_vec());
        lanes.begin(&sink).unwrap();
        let all = |lanes: &Lanes| {
            (lanes.shown.iter().map(|(k, mode)| (k.clone(), *mode)).collect::<Vec<_>>(), lanes.whole.unwrap())
        };
        let is =
            |lanes: [(&str, &'static str); 2], whole| (lanes.map(|(k, mode)| (k.to_owned(), mode)).to_vec(), whole);
        let two = [state(ContactMode::Sliding { touch: 0 }), state(ContactMode::Sticking { touch: 2 })];
        lanes.set(&sink, &two).unwrap();
        assert_eq!(all(&lanes), is([("a", "sliding"), ("c", "sticking")], "several"));
        lanes.set(&sink, &two[1..]).unwrap();
        assert_eq!(all(&lanes), is([("a", OPEN), ("c", "sticking")], "sticking"));
        lanes.event(&sink, &EventKind::Mode { mode: ContactMode::Sliding { touch: 3 } }).unwrap();
        assert_eq!(all(&lanes), is([("a", OPEN), ("c", "sliding")], "sliding"));
        lanes.event(&sink, &EventKind::LiftOff { touch: 3 }).unwrap();
        assert_eq!(all(&lanes), is([("a", OPEN), ("c", "sticking")], "sticking"));
        let open = ContactState { flags: Flags::NON_UNIQUE, ..two[0] };
        lanes.set(&sink, &[open, two[1]]).unwrap();
        assert_eq!(all(&lanes), is([("a", SLIDES_OPENLY), ("c", "sticking")], "several"));
        lanes.set(&sink, &two[1..]).unwrap();
        lanes.event(&sink, &EventKind::LiftOff { touch: 2 }).unwrap();
        assert_eq!(all(&lanes), is([("a", OPEN), ("c", OPEN)], "free"));
    }
}
