//! Events and the summary of a run as text.

use carom_chain::Chain;
use carom_sim::{EnergyBooks, Event, EventKind, Statistics, Summary};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// An event as one line; `touches` are the names of all possible contacts, by index.
pub(crate) fn words(event: &Event, touches: &[String]) -> String {
    let name = |touch: &usize| touches.get(*touch).map_or("", String::as_str);
    let what = format!("{} s  {}", short(event.time), event.kind.name());
    match &event.kind {
        EventKind::Impact { touch, hit } => format!(
            "{what}: {}, {} N s, {}, u⁻ {} u⁺ {} m/s",
            name(touch),
            short(hit.impulse.norm()),
            hit.mode,
            vector(hit.u_minus),
            vector(hit.u_plus)
        ),
        EventKind::Several { touches: several, .. } => {
            format!("{what}: {}", several.iter().map(name).collect::<Vec<_>>().join(", "))
        }
        EventKind::NonUnique { reason, touches: several } => {
            format!("{what}: {}: {}", several.iter().map(name).collect::<Vec<_>>().join(", "), reason.name())
        }
        EventKind::Limit { joint, impulse, .. } => format!("{what} of {joint}: impulse {}", short(*impulse)),
        EventKind::Zeno { touch, impacts } => format!("{what}: {}, after {impacts} impacts at rest", name(touch)),
        EventKind::Joint { joint, .. } => format!("{what}: {joint}"),
        kind => kind.touch().map_or_else(|| what.clone(), |touch| format!("{what}: {}", name(&touch))),
    }
}

/// The summary of a run as Markdown; `arrows`: lengths of the arrows of 1 N s and of 1 N, m.
pub(crate) fn markdown(
    chain: &Chain,
    summary: &Summary,
    counts: &BTreeMap<&'static str, usize>,
    arrows: [Option<f64>; 2],
) -> String {
    let EnergyBooks { start, end, drive, resistance, impacts } = summary.energy;
    let Statistics { steps, rejections, evaluations, contact_steps, .. } = summary.statistics;
    let mut page = format!(
        "**{}**, {} degrees of freedom, {} kg; {} s simulated; contact at the end: {}; end of the run: {}\n\n",
        chain.name(),
        chain.nv(),
        short(chain.total_mass()),
        short(summary.last.time),
        summary.mode.name(),
        summary.stop.name(),
    );
    let events: Vec<String> = counts.iter().map(|(name, times)| format!("{name} × {times}")).collect();
    page += &if events.is_empty() { "No events".into() } else { events.join(", ") };
    page += "\n\n| energy | J |\n| --- | --- |\n";
    for (what, joules) in [
        ("at the start", start),
        ("work of the motors", drive),
        ("work of damping, friction and lasting contacts", resistance),
        ("change in impacts", 0.0 - impacts),
        ("at the end", end),
    ] {
        page += &format!("| {what} | {} |\n", short(joules));
    }
    for (arrow, what) in
        arrows.iter().zip(["impulses on the robot, {} m for 1 N s", "forces of lasting contacts, {} m for 1 N"])
    {
        if let Some(arrow) = arrow {
            page += &format!("\nArrows: {}\n", what.replace("{}", &short(*arrow)));
        }
    }
    page += &format!("\n{steps} steps, {rejections} rejected, {evaluations} evaluations");
    if contact_steps > 0 {
        page += &format!(", {contact_steps} time steps with several contacts");
    }
    page
}

fn vector(v: Vector3<f64>) -> String {
    let rounding = 1e-9 * v.norm();
    let v = v.map(|x| if x.abs() < rounding { 0.0 } else { x });
    format!("({}, {}, {})", short(v.x), short(v.y), short(v.z))
}

/// A number with four significant digits.
pub(crate) fn short(x: f64) -> String {
    if x == 0.0 || (1e-3..1e5).contains(&x.abs()) {
        // Decimals of four significant digits.
        let places = if x == 0.0 { 0.0 } else { (3.0 - x.abs().log10().floor()).clamp(0.0, 6.0) };
        let text = format!("{x:.*}", places as usize);
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        format!("{x:.2e}")
    }
}
