//! Comparison of the paper's claims with the model. Each verdict is computed.

use super::report::{Paper, Row};
use super::simulated::{FRICTION, Forces, forces};
use super::{ANGLES_DEG, Elbow, Run, Tangential, strike};
use crate::EvidenceError;
use carom_chain::Chain;
use carom_sim::SimError;
use serde::Serialize;

/// A claim of the paper, and whether the model confirms it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Claim {
    /// Section, figure or equation of the paper.
    pub(crate) place: &'static str,
    /// The claim, paraphrased.
    pub statement: String,
    /// Whether the model confirms the claim.
    #[serde(rename = "confirmed")]
    pub holds: bool,
    /// The numbers that the verdict is computed from.
    pub evidence: String,
}

/// Compares the paper's claims about single impacts with the model. `runs` are the impacts of [`super::experiment`].
///
/// # Errors
/// As [`strike`].
pub fn claims(chain: &Chain, runs: &[Run]) -> Result<Vec<Claim>, SimError> {
    let oblique = |r: &&Run| r.angle_deg < 90.0;
    let of = |elbow: Elbow| runs.iter().filter(move |r| r.elbow == elbow);
    let mut claims = Vec::new();

    let up: Vec<f64> = of(Elbow::Up).filter(oblique).map(|r| r.tangential().1 / r.tangential().0).collect();
    let (least, most) = bounds(&up);
    claims.push(Claim {
        place: "Sec. IV (Figs. 7, 9), V",
        statement: "up-elbow: the tangential velocity grows without changing direction".into(),
        holds: of(Elbow::Up).filter(oblique).all(|r| r.tangential_change() == Tangential::Grows),
        evidence: format!("v_t+/v_t- from {least:.2} to {most:.2} at 30, 45, 60 deg"),
    });

    let down: Vec<&Run> = of(Elbow::Down).filter(oblique).collect();
    let each: Vec<String> = down
        .iter()
        .filter(|r| r.speed == 0.2)
        .map(|r| format!("{} at {:.0} deg", r.tangential_change().name(), r.angle_deg))
        .collect();
    claims.push(Claim {
        place: "Sec. IV (Figs. 7, 9), V",
        statement: "down-elbow: the tangential velocity shrinks or reverses, and reverses at the higher angles".into(),
        holds: down.iter().all(|r| r.tangential_change() != Tangential::Grows)
            && down.iter().any(|r| r.tangential_change() == Tangential::Reverses)
            && down.iter().filter(|r| r.angle_deg == 30.0).all(|r| r.tangential_change() == Tangential::Shrinks),
        evidence: each.join(", "),
    });

    // does the direction after the impact depend on e?
    let mut signs = Vec::new();
    for angle in [45.0, 60.0] {
        let mut after = Vec::new();
        for e in [0.2, 0.35, 0.5, 0.76, 0.93] {
            after.push(strike(chain, Elbow::Down, angle, 0.2, e)?.tangential().1);
        }
        signs.push(bounds(&after));
    }
    claims.push(Claim {
        place: "Sec. IV (Fig. 9), V",
        statement: "the reversal does not depend on the value of the coefficient (e from 0.2 to 0.93)".into(),
        holds: signs.iter().all(|(_, most)| *most < 0.0),
        evidence: format!(
            "down-elbow v_t+ from {:.3} to {:.3} m/s at 45 deg, {:.3} to {:.3} at 60 deg",
            signs[0].0, signs[0].1, signs[1].0, signs[1].1
        ),
    });

    let off: f64 = runs
        .iter()
        .map(|r| (r.normal().1 + r.restitution * r.normal().0).abs() / r.normal().0.abs())
        .fold(0.0, f64::max);
    claims.push(Claim {
        place: "Sec. IV, eq. (11)",
        statement:
            "the normal velocity after the impact depends on e alone, not on the configuration (eq. 11; true by construction)"
                .into(),
        holds: off < 1e-12,
        evidence: format!("v_n+ = -e v_n- within {off:.0e} of v_n-"),
    });

    let per_square = |elbow: Elbow, angle: f64| -> Vec<f64> {
        let same = of(elbow).filter(|r| r.angle_deg == angle);
        same.map(|r| r.hit.energy_loss() / (r.speed * r.speed)).collect()
    };
    let uneven = Elbow::ALL.into_iter().flat_map(|e| ANGLES_DEG.map(|a| bounds(&per_square(e, a))));
    let uneven = uneven.map(|(least, most)| (most - least) / most).fold(0.0, f64::max);
    claims.push(Claim {
        place: "Sec. IV (Fig. 8)",
        statement:
            "the kinetic energy loss is proportional to the square of the speed (true by construction: the law is linear)"
                .into(),
        holds: uneven < 1e-10,
        evidence: format!("loss/speed^2 is equal at all speeds within {uneven:.0e}"),
    });

    let mut worst: (f64, String) = (0.0, String::new());
    for elbow in Elbow::ALL {
        for (k, measured) in elbow.measured_energy_root().into_iter().enumerate() {
            let same = |r: &&Run| r.speed == 0.2 && r.angle_deg == ANGLES_DEG[k];
            if let Some(run) = of(elbow).find(same) {
                let model = run.hit.energy_ratio().sqrt();
                if (model - measured).abs() > worst.0 {
                    let text = format!(
                        "{}-elbow {:.0} deg: {measured} measured, {model:.4} computed",
                        elbow.name(),
                        run.angle_deg
                    );
                    worst = ((model - measured).abs(), text);
                }
            }
        }
    }
    claims.push(Claim {
        place: "Table I, eq. (16)",
        statement: "Table I: the measured sqrt(T+/T-) are reproduced within 0.05 (with this stand-in arm)".into(),
        holds: worst.0 <= 0.05,
        evidence: format!("largest difference: {}", worst.1),
    });
    Ok(claims)
}

fn bounds(numbers: &[f64]) -> (f64, f64) {
    numbers.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)))
}

/// Compares the claims about the figures and Table I with the model.
///
/// # Errors
/// As [`Paper::of`].
pub(super) fn claims_of_figures(chain: &Chain, paper: &Paper) -> Result<Vec<Claim>, EvidenceError> {
    let percent = |x: f64| format!("{:.1} %", 100.0 * x);
    let apart = |a: f64, b: f64| (a - b).abs() / a.abs().max(b.abs());
    let mut claims = Vec::new();

    let oblique = || paper.rows.iter().filter(|row| row.newton.angle_deg < 90.0);
    let other: Vec<String> = oblique()
        .filter(|row| row.newton.tangential_change() != row.energy.tangential_change())
        .map(|row| format!("{}-elbow {:.0} deg", row.newton.elbow.name(), row.newton.angle_deg))
        .collect();
    claims.push(Claim {
        place: "Sec. IV (Fig. 9)",
        statement: "eq. (15) gives the same change of tangential velocity with either of Table I's coefficients".into(),
        holds: other.is_empty(),
        evidence: if other.is_empty() {
            format!("the same change (grows, shrinks or reverses) in {} of {}", oblique().count(), oblique().count())
        } else {
            format!("different at {}", other.join(", "))
        },
    });

    let mut against = 0;
    let jumps = paper.runs.iter().map(|run| (run.tangential().1 - run.tangential().0, run.coupling));
    for (jump, coupling) in jumps {
        against += usize::from(jump * coupling >= 0.0);
    }
    claims.push(Claim {
        place: "Sec. II, eq. (15)",
        statement: "the sign of tᵀHn determines that of the tangential jump (opposite, with the paper's normal; true by construction)".into(),
        holds: against == 0,
        evidence: format!("in {} of {} impacts", paper.runs.len() - against, paper.runs.len()),
    });

    let mut uneven: f64 = 0.0;
    for angle in ANGLES_DEG {
        let loss = |elbow| Ok::<_, SimError>(strike(chain, elbow, angle, 0.2, 0.35)?.hit.energy_loss());
        uneven = uneven.max(apart(loss(Elbow::Up)?, loss(Elbow::Down)?));
    }
    let with_table = ANGLES_DEG.iter().map(|angle| {
        let loss = |elbow| paper.row(elbow, *angle).map_or(0.0, |row| row.newton.hit.energy_loss());
        apart(loss(Elbow::Up), loss(Elbow::Down))
    });
    let with_table = with_table.fold(0.0, f64::max);
    claims.push(Claim {
        place: "Sec. IV (Fig. 8)",
        statement: "the kinetic energy loss depends on the configuration (by more than 1 % at the same e)".into(),
        holds: uneven > 0.01,
        evidence: format!(
            "the elbows differ by {} at the same e = 0.35 and by up to {} with Table I's e{}",
            percent(uneven),
            percent(with_table),
            if uneven < 1e-9 { "; the two poses of this arm are mirror images, with the same nᵀHn" } else { "" }
        ),
    });

    let [up, down] = [&paper.forces[0], &paper.forces[1]].map(Forces::peak);
    let difference = apart(up, down);
    let without = apart(forces(chain, Elbow::Up, 0.0)?.peak(), forces(chain, Elbow::Down, 0.0)?.peak());
    claims.push(Claim {
        place: "Sec. IV (Fig. 5)",
        statement: format!(
            "the impact force depends on the configuration (peaks more than 5 % apart, with a friction of {FRICTION})"
        ),
        holds: difference > 0.05,
        evidence: format!(
            "peak normal force {up:.1} N (up), {down:.1} N (down), a difference of {}; without friction {}",
            percent(difference),
            percent(without)
        ),
    });

    let share = paper.forces.iter().map(|forces| (forces.impulse()[1] / forces.impulse()[0]).abs()).fold(0.0, f64::max);
    claims.push(Claim {
        place: "Sec. II",
        statement:
            "the tangential impulse is small compared with the normal one (at most a fifth; friction bounds the ratio)"
                .into(),
        holds: share <= 0.2,
        evidence: format!("at most {} with a friction of {FRICTION}", percent(share)),
    });

    let most = ANGLES_DEG.iter().zip(Elbow::Up.newton().into_iter().zip(Elbow::Down.newton()));
    let most = most
        .map(|(angle, (up, down))| ((up - down).abs(), *angle))
        .fold((0.0, 0.0), |a, b| if b.0 > a.0 { b } else { a });
    claims.push(Claim {
        place: "Sec. IV, eq. (11)",
        statement: "the measured normal velocity after the impact does not depend on the configuration (Table I's e of both elbows equal within rounding)".into(),
        holds: most.0 <= 0.01,
        evidence: format!("they differ by up to {:.2}, at {:.0} deg", most.0, most.1),
    });

    for elbow in Elbow::ALL {
        let rows = paper.rows.iter().filter(|row| row.newton.elbow == elbow);
        let (least, most) = bounds(&rows.map(Row::overshoot).collect::<Vec<_>>());
        claims.push(Claim {
            place: "Sec. IV (Figs. 9, 10)",
            statement: format!("{}-elbow: eq. (11) with the energetic coefficient is proportional to the measured normal velocity (within 10 %)", elbow.name()),
            holds: most <= 1.1 * least,
            evidence: format!("the ratio of Table I's coefficients lies between {least:.2} and {most:.2}"),
        });
    }

    for found in &paper.table {
        let together = found.directions.is_none_or(|seen| seen.agree);
        let directions = match found.directions.and_then(|seen| seen.factor) {
            Some(factor) => format!("{factor:.3} times with the observed directions"),
            None => "no multiple suffices with the observed directions".into(),
        };
        claims.push(Claim {
            place: "Sec. IV (Table I)",
            statement: format!(
                "Table I is not consistent, {}: no H gives its coefficients together with the observed directions",
                found.row
            ),
            holds: !(found.consistent && together),
            evidence: format!(
                "the coefficients alone need {:.3} times their rounding errors, {directions} (consistent up to 1)",
                found.fit.factor
            ),
        });
    }
    Ok(claims)
}
