//! The contact rules of a scene: `[contact]`, and the values that a surface or a `[[contact.pair]]` replaces.

use super::file::{self, Contact, Override};
use crate::contact::{Compliance, ContactLaw, ContactRule, Holding, Surface, Touch, Yielding};
use carom_chain::Chain;
use carom_impact::{Coefficients, Damping, LAW_NAMES, NormalForce};

/// The rule of `[contact]`.
pub(crate) fn rule(contact: &Contact) -> Result<ContactRule, String> {
    let Contact { restitution, tangential_restitution, friction, latch, .. } = *contact;
    let law = law(&contact.law, Coefficients { restitution, tangential_restitution, friction })?;
    let compliance = contact.compliance.as_ref().map(compliance).transpose();
    Ok(ContactRule { law, latch, compliance: compliance.map_err(|why| format!("compliance {why}"))? })
}

fn law(name: &str, coefficients: Coefficients) -> Result<ContactLaw, String> {
    let known = || format!("law = \"{name}\": the laws are {}", LAW_NAMES.join(", "));
    ContactLaw::named(name, coefficients).ok_or_else(known)
}

/// A rule with the values that `own` gives instead.
pub(crate) fn overridden(rule: &ContactRule, own: &Override) -> Result<ContactRule, String> {
    let Coefficients { restitution, tangential_restitution, friction } = rule.law.coefficients;
    let coefficients = Coefficients {
        restitution: own.restitution.unwrap_or(restitution),
        tangential_restitution: own.tangential_restitution.unwrap_or(tangential_restitution),
        friction: own.friction.unwrap_or(friction),
    };
    let law = law(own.law.as_deref().unwrap_or(rule.law.name()), coefficients)?;
    Ok(ContactRule { law, latch: own.latch.unwrap_or(rule.latch), compliance: rule.compliance })
}

/// A warning if the scene gives `tangential_restitution` and no contact has a law that uses it.
pub(crate) fn unused(contact: &Contact, surfaces: &[file::Surface], touches: &[Touch]) -> Option<String> {
    let own = surfaces.iter().map(|surface| surface.contact.tangential_restitution);
    let given = own.chain(contact.pair.iter().map(|pair| pair.tangential_restitution)).flatten();
    let given = given.chain([contact.tangential_restitution]).any(|value| value != 0.0);
    let used = touches.iter().any(|touch| touch.contact.law.name() == "chatterjee-ruina");
    (given && !used).then(|| {
        "tangential_restitution: only the law \"chatterjee-ruina\" uses it, and no contact of this scene has it".into()
    })
}

fn compliance(given: &file::Compliance) -> Result<Compliance, String> {
    let file::Compliance { stiffness, force, exponent, damping, pulls, slip_speed, bristle } = given;
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

/// Applies one `[[contact.pair]]`; returns whether it applies to any touch.
pub(crate) fn apply(
    pair: &file::Pair,
    chain: &Chain,
    surfaces: &[Surface],
    touches: &mut [Touch],
) -> Result<bool, String> {
    let file::Pair { link, surface, joint, .. } = pair;
    let own = pair.values();
    if joint.is_some() == (link.is_some() || surface.is_some()) {
        return Err("needs link, surface or both, or else joint (for its limits)".into());
    }
    if let Some(link) = link {
        chain.frame(link).map_err(|e| e.to_string())?;
    }
    let partners = touches.iter().filter_map(Touch::other_link);
    let mut known: Vec<&str> = surfaces.iter().map(|it| it.name.as_str()).chain(partners).collect();
    known.dedup();
    if let Some(name) = surface.as_ref().filter(|name| !known.contains(&name.as_str())) {
        return Err(format!("surface = \"{name}\": the surfaces are {}", known.join(", ")));
    }
    if let Some(joint) = joint {
        chain.joint(joint).map_err(|e| e.to_string())?;
    }
    let beside = own.law.is_some() || own.tangential_restitution.is_some() || own.friction.is_some();
    if joint.is_some() && beside {
        let rule =
            "has joint: joint limits have restitution and latch only, remove law, tangential_restitution and friction";
        return Err(rule.into());
    }
    let mut met = false;
    for touch in touches {
        let meant = match joint {
            Some(joint) => touch.limit_of() == Some(joint),
            None => {
                touch.limit_of().is_none()
                    && link.as_deref().is_none_or(|link| touch.link() == Some(link))
                    && surface.as_deref().is_none_or(|surface| touch.surface() == Some(surface))
            }
        };
        if meant {
            met = true;
            touch.contact = overridden(&touch.contact, &own)?;
            touch.contact.check(&touch.name).map_err(|e| e.to_string())?;
        }
    }
    Ok(met)
}
