//! The contact rules of a scene: `[contact]`, and the values that a surface or a `[[contact.pair]]` replaces.

use super::file::{self, All, Contact, ContactKeys, Links, Pair, Restitution, Softness};
use super::keys::Table;
use crate::contact::{
    ClosesWhile, Compliance, ContactLaw, ContactRule, Holding, SeveralLaw, Surface, Touch, Touches, Yielding,
    are_disabled, robot_of,
};
use crate::error::SimError;
use carom_chain::Chain;
use carom_impact::{Coefficients, Damping, LAW_NAMES, LawInfo, NormalForce};
use std::collections::BTreeSet;
use std::sync::Arc;

/// The law of several contacts of `[contact]`.
pub(crate) fn several(contact: &Contact) -> Result<SeveralLaw, String> {
    match (contact.several, contact.several_exponent) {
        (SeveralLaw::Energetic { .. }, Some(exponent)) => Ok(SeveralLaw::Energetic { exponent }),
        (law, None) => Ok(law),
        (law, Some(_)) => Err(format!(
            "several_exponent is read with several = \"energetic\" only, and it is \"{}\": remove it or choose this law",
            law.name()
        )),
    }
}

fn softness(given: &Softness) -> Result<Option<Compliance>, String> {
    match given {
        Softness::Rigid => Ok(None),
        Softness::Compliant(given) => compliance(given).map(Some).map_err(|why| format!("compliance {why}")),
    }
}

/// A rule with the values that `own` gives instead.
pub(crate) fn overridden(rule: &ContactRule, own: &ContactKeys) -> Result<ContactRule, String> {
    let Coefficients { restitution, tangential_restitution, friction } = rule.law.coefficients;
    let (restitution, by_speed) = match &own.restitution {
        None => (restitution, rule.law.by_speed.clone()),
        Some(Restitution::Constant(number)) => (*number, None),
        Some(Restitution::BySpeed(by)) => (restitution, Some(Arc::new(by.clone()))),
    };
    let coefficients = Coefficients {
        restitution,
        tangential_restitution: own.tangential_restitution.unwrap_or(tangential_restitution),
        friction: own.friction.unwrap_or(friction),
    };
    let name = own.law.as_deref().unwrap_or(rule.law.name());
    let known = || format!("law = \"{name}\": the laws are {}", LAW_NAMES.join(", "));
    let law = ContactLaw::of(name, coefficients, by_speed).ok_or_else(known)?;
    let compliance = own.compliance.as_ref().map_or(Ok(rule.compliance), softness)?;
    let relative_stiffness = own.relative_stiffness.unwrap_or(rule.relative_stiffness);
    Ok(ContactRule { law, latch: own.latch.unwrap_or(rule.latch), compliance, relative_stiffness })
}

/// The warnings about keys of contacts that act on fewer impacts than one would think.
pub(crate) fn warnings(
    Table((whole, contact)): &Table<(ContactKeys, Contact)>,
    surfaces: &[file::Surface],
    touches: &[Touch],
) -> impl Iterator<Item = String> {
    let own = surfaces.iter().map(|surface| &surface.contact);
    let all: Vec<&ContactKeys> = own.chain(contact.pair.iter().map(|Table((_, pair))| pair)).chain([whole]).collect();
    let frictionless = frictionless_by_default(&all, touches);
    unused(&all, contact, touches).chain(frictionless)
}

/// Warnings about values that no contact of the scene uses.
fn unused(all: &[&ContactKeys], contact: &Contact, touches: &[Touch]) -> impl Iterator<Item = String> + use<> {
    let uses = |rule: &ContactRule| {
        rule.compliance.is_none()
            && LawInfo::named(rule.law.name()).is_some_and(|law| law.has("tangential_restitution"))
    };
    let tangential = all.iter().filter_map(|keys| keys.tangential_restitution).any(|value| value != 0.0)
        && !touches.iter().any(|touch| uses(&touch.contact));
    let stiffness = all.iter().any(|keys| keys.relative_stiffness.is_some())
        && !matches!(contact.several, SeveralLaw::Energetic { .. });
    let limits = contact.limit_restitution != 0.0 && !touches.iter().any(|touch| touch.limit_of().is_some());
    let tangential_force = |keys: &&ContactKeys| match &keys.compliance {
        Some(Softness::Compliant(given)) => given.slip_speed.is_some() || given.bristle.is_some(),
        _ => false,
    };
    let rubs = |touch: &Touch| touch.contact.compliance.is_some() && touch.contact.law.friction() > 0.0;
    let compliant = all.iter().any(tangential_force) && !touches.iter().any(rubs);
    let found = [
        (
            tangential,
            "tangential_restitution: only the law \"chatterjee-ruina\" of rigid contacts uses it, and no contact of this scene has it",
        ),
        (stiffness, "relative_stiffness: only the law of several contacts \"energetic\" uses it ([contact] several)"),
        (limits, "limit_restitution: no joint of this scene has limits that act"),
        (compliant, "compliance slip_speed and bristle: no compliant contact of this scene has friction"),
    ];
    found.into_iter().filter(|(unused, _)| *unused).map(|(_, why)| why.to_owned())
}

/// A warning if rigid contacts have friction and the frictionless law, and the scene chooses no law.
fn frictionless_by_default(all: &[&ContactKeys], touches: &[Touch]) -> Option<String> {
    let chosen = all.iter().any(|keys| keys.law.is_some());
    let slips = |touch: &&Touch| {
        let rule = &touch.contact;
        rule.compliance.is_none() && rule.law.name() == LAW_NAMES[0] && rule.law.friction() > 0.0
    };
    let touch = touches.iter().find(slips).filter(|_| !chosen)?;
    Some(format!(
        "law is \"{}\" by default: {} has friction {} while it lasts and in impacts of several contacts, but not when it is hit \
         alone; choose a law, also this one",
        LAW_NAMES[0],
        touch.name,
        touch.contact.law.friction()
    ))
}

fn compliance(given: &file::Compliance) -> Result<Compliance, String> {
    let file::Compliance { stiffness, force, exponent, damping, pulls, slip_speed, bristle, .. } = given;
    let names = NormalForce::NAMES;
    let force = force.as_deref().unwrap_or(names[0]);
    let normal = match names.iter().position(|&name| name == force) {
        Some(0) => {
            let named = |name: &String| {
                let known = || Damping::ALL.map(Damping::name).join(", ");
                Damping::by_name(name).ok_or_else(|| format!("damping = \"{name}\": the formulas are {}", known()))
            };
            let damping = damping.as_ref().map_or(Ok(Damping::Exact), named)?;
            Yielding::HuntCrossley { exponent: exponent.unwrap_or(1.5), damping }
        }
        Some(1) => Yielding::KelvinVoigt { pulls: pulls.unwrap_or(false) },
        Some(_) => Yielding::WaltonBraun,
        None => return Err(format!("force = \"{force}\": the forces are {}", names.join(", "))),
    };
    let owned = [("exponent", exponent.is_some(), 0), ("damping", damping.is_some(), 0), ("pulls", pulls.is_some(), 1)];
    if let Some((key, _, owner)) = owned.into_iter().find(|&(_, given, owner)| given && names[owner] != force) {
        return Err(format!("{key} is read with force = \"{}\" only: remove it or choose this force", names[owner]));
    }
    let tangential = match (slip_speed, bristle) {
        (Some(_), Some(_)) => {
            return Err("has both slip_speed (smoothed friction) and bristle: give one of them".into());
        }
        (_, Some(bristle)) => Holding::Bristle { stiffness: bristle.stiffness, damping: bristle.damping },
        (speed, None) => Holding::Smoothed { slip_speed: speed.unwrap_or(1e-3) },
    };
    Ok(Compliance { stiffness: *stiffness, normal, tangential })
}

/// The touches between links: those of `links` and of `between_robots`.
pub(crate) fn between_links(contact: &Contact, chain: &Chain, rule: &ContactRule) -> Result<Touches, SimError> {
    let refuse = |why: String| SimError::Scene { file: String::new(), rule: format!("[contact] {why}") };
    let several = !chain.members().is_empty();
    if contact.between_robots.is_some() && !several {
        return Err(refuse("between_robots is for scenes with several robots ([[robot]]): remove it".into()));
    }
    let between = several && contact.between_robots.unwrap_or(true);
    let mut found = Touches::default();
    let add = |found: &mut Touches, more: Touches| {
        found.touches.extend(more.touches);
        found.left_out.extend(more.left_out);
    };
    match &contact.links {
        Links::All(All::All) => add(&mut found, Touch::within_robots(chain, rule)?),
        Links::Pairs(pairs) => {
            for (k, [link, other]) in pairs.iter().enumerate() {
                let said = |why: String| refuse(format!("links = [\"{link}\", \"{other}\"]: {why}"));
                let twin = |pair: &[String; 2]| pair.contains(link) && pair.contains(other);
                if link != other && pairs[..k].iter().any(twin) {
                    return Err(said("the pair is listed twice, remove one".into()));
                }
                let touches = Touch::between(chain, link, other, rule).map_err(|e| said(e.to_string()))?;
                if are_disabled(chain, link, other) {
                    return Err(said("the SRDF disables this pair: remove it here or there".into()));
                }
                if between && robot_of(chain, link) != robot_of(chain, other) {
                    let why = "links of different robots may touch without being listed: remove the pair, or set \
                               between_robots = false";
                    return Err(said(why.into()));
                }
                found.touches.extend(touches);
            }
        }
    }
    if between {
        add(&mut found, Touch::between_robots(chain, rule)?);
    }
    Ok(found)
}

/// Whether a name of a `[[contact.pair]]` means a link: it is the link's, or that of its robot.
fn means(name: &str, link: Option<&str>) -> bool {
    link.is_some_and(|link| link == name || link.split_once('/').is_some_and(|(robot, _)| robot == name))
}

/// Applies one `[[contact.pair]]`; returns whether it applies to any touch.
pub(crate) fn apply(
    (pair, own): (&Pair, &ContactKeys),
    chain: &Chain,
    surfaces: &[Surface],
    touches: &mut Vec<Touch>,
) -> Result<bool, String> {
    let Pair { link, surface, joint, disabled, closes_while, .. } = pair;
    if joint.is_some() == (link.is_some() || surface.is_some()) {
        return Err("needs link, surface or both, or else joint (for its limits)".into());
    }
    let robot = |name: &str| chain.members().iter().any(|member| member.name == name);
    if let Some(link) = link.as_deref().filter(|name| !robot(name)) {
        chain.frame(link).map_err(|e| e.to_string())?;
    }
    let partners = touches.iter().filter(|touch| touch.other_link().is_some());
    let partners = partners.flat_map(|touch| touch.other_link().into_iter().chain(touch.link()));
    let known: BTreeSet<&str> = partners.collect();
    if let Some(name) = surface.as_deref() {
        let one = surfaces.iter().any(|it| it.name == name) || known.contains(name) || robot(name);
        if !one {
            let known: Vec<&str> = surfaces.iter().map(|it| it.name.as_str()).chain(known).collect();
            return Err(format!("surface = \"{name}\": the surfaces are {}", known.join(", ")));
        }
    }
    if let Some(joint) = joint {
        chain.joint(joint).map_err(|e| e.to_string())?;
    }
    let of_limits = |key: &&str| ["restitution", "latch", "relative_stiffness"].contains(key);
    if joint.is_some() && !own.given.iter().all(of_limits) {
        let rule = "has joint: joint limits have restitution, latch and relative_stiffness only, remove law, \
                    tangential_restitution, friction and compliance";
        return Err(rule.into());
    }
    let meant = |touch: &Touch| match joint {
        Some(joint) => touch.limit_of() == Some(joint),
        None => {
            let is = |wanted: &Option<String>, link| wanted.as_deref().is_none_or(|name| means(name, link));
            let (own, other) = (touch.link(), touch.other_link());
            let named = match other {
                // A pair of links has no order.
                Some(_) => (is(link, own) && is(surface, other)) || (is(link, other) && is(surface, own)),
                None => is(link, own) && surface.as_deref().is_none_or(|surface| touch.surface() == Some(surface)),
            };
            touch.limit_of().is_none() && named
        }
    };
    let met = touches.iter().any(meant);
    if *disabled {
        if !own.given.is_empty() || closes_while.is_some() {
            return Err("has disabled = true, and values of a contact that does not act: remove one of them".into());
        }
        touches.retain(|touch| !meant(touch));
    }
    if joint.is_some() && closes_while.is_some() {
        return Err("has joint and closes_while: joint limits always act, remove one of them".into());
    }
    let condition = closes_while.as_ref().map(|formula| ClosesWhile::of(formula, chain));
    let condition = condition.transpose().map_err(|why| format!("closes_while = {why}"))?;
    for touch in touches.iter_mut().filter(|touch| meant(touch)) {
        touch.contact = overridden(&touch.contact, own)?;
        touch.contact.check(&touch.name).map_err(|e| e.to_string())?;
        if condition.is_some() {
            touch.closes_while.clone_from(&condition);
        }
    }
    Ok(met)
}
