//! Whole chains that are hard on numbers.

use super::single::worse;
use super::{Found, Judged, law, said};
use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, uniform_chain};
use carom_sim::{ChainImpact, Impacts, SimError};
use nalgebra::{DVector, Vector2};
use std::fmt::Write;

/// M = [[p₁ + 2p₃c, p₂ + p₃c], [p₂ + p₃c, p₂]] with c = cos q₂: the arm of the paper's preset, with links of 0.45 m.
const ARM: [f64; 3] = [3.473, 0.196, 0.242];

fn arm() -> Result<Chain, String> {
    let [p1, p2, p3] = ARM;
    // The second link's mass centre at 0.2 m; the first carries what is left of p₁.
    let (l1, r2) = (0.45, 0.2);
    let m2 = p3 / (l1 * r2);
    let (own1, own2) = (p1 - p2 - m2 * l1 * l1, p2 - m2 * r2 * r2);
    let link = |name: &str, mass: f64, at: f64, inertia: f64| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="{at} 0 0"/><mass value="{mass}"/>
            <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial></link>"#
        )
    };
    let hinge = |name: &str, parent: &str, child: &str, at: f64| {
        format!(
            r#"<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
            <origin xyz="{at} 0 0"/><axis xyz="0 0 1"/></joint>"#
        )
    };
    let text = format!(
        r#"<robot name="arm"><link name="base"/>{}{}<link name="tip"/>{}{}
        <joint name="end" type="fixed"><parent link="b"/><child link="tip"/><origin xyz="0.45 0 0"/></joint></robot>"#,
        link("a", 1.0, 0.0, own1),
        link("b", m2, r2, own2),
        hinge("q1", "base", "a", 0.0),
        hinge("q2", "a", "b", l1),
    );
    Chain::from_urdf_str(&text, &LoadOptions::default()).map_err(said)
}

/// At q = (0, θ) the tip moves along the stretched arm by −l₂ sin θ (q̇₁ + q̇₂): j is a multiple of (1, 1), and q̇⁺ does not
/// depend on which: q̇ − (1+e)(q̇₁+q̇₂) M⁻¹(1,1)ᵀ / ((1,1)M⁻¹(1,1)ᵀ), M⁻¹(1,1)ᵀ ∝ (−p₃c, p₁ − p₂ + p₃c).
pub fn singular_pose(name: &str) -> Judged {
    let (chain, law, e) = (arm()?, law(name, 0.5, 0.0), 0.5);
    let tip = chain.frame("tip").map_err(said)?;
    let [p1, p2, p3] = ARM;
    let qd = [0.3, -1.0];
    let strike = |angle: f64| chain.impact(&[0.0, angle], &qd).at(tip).normal([-1.0, 0.0, 0.0]).resolve(law.as_ref());
    let (mut error, mut last) = (0.0, 1.0);
    for k in 1..=12 {
        let angle = 10_f64.powi(-k);
        let hit = match strike(angle) {
            Ok(hit) => hit,
            Err(SimError::SingularNormal { .. }) => break,
            Err(other) => return Err(said(other)),
        };
        let c = angle.cos();
        let jump = Vector2::new(-p3 * c, p1 - p2 + p3 * c) * (-(1.0 + e) * (qd[0] + qd[1]) / (p1 - p2));
        let found = Vector2::new(hit.qd_plus[0] - qd[0], hit.qd_plus[1] - qd[1]);
        error = worse(error, (found - jump).norm() / jump.norm());
        last = angle;
    }
    Ok(Found::figure(error).noting(format!("answered down to {last:e} rad")))
}

/// Stretched exactly: the impulse of any rigid law would be infinite.
pub fn stretched(name: &str) -> Judged {
    let (chain, law) = (arm()?, law(name, 0.5, 0.0));
    let tip = chain.frame("tip").map_err(said)?;
    let hit = chain.impact(&[0.0, 0.0], &[0.3, -1.0]).at(tip).normal([-1.0, 0.0, 0.0]).resolve(law.as_ref());
    hit.map_err(said)?;
    Ok(Found::figure(f64::INFINITY).noting("an impulse where there is none;"))
}

/// The last of a row of sliders is hit: only it changes its velocity, so only the last joint does.
pub fn mass_ratio(name: &str) -> Judged {
    let law = law(name, 0.5, 0.0);
    let mut error = 0.0;
    for masses in [[1e-6, 1.0, 1e-6, 1.0, 1e-6, 1.0], [1.0, 1e-6, 1.0, 1e-6, 1.0, 1e-6]] {
        let mut text = r#"<robot name="row"><link name="link0"/>"#.to_owned();
        for (k, mass) in masses.iter().enumerate() {
            let _ = write!(
                text,
                r#"<link name="link{n}"><inertial><mass value="{mass}"/>
                <inertia ixx="{mass}" ixy="0" ixz="0" iyy="{mass}" iyz="0" izz="{mass}"/></inertial></link>
                <joint name="x{n}" type="prismatic"><parent link="link{k}"/><child link="link{n}"/><axis xyz="1 0 0"/>
                <limit lower="-9" upper="9" effort="0" velocity="0"/></joint>"#,
                n = k + 1
            );
        }
        text.push_str("</robot>");
        let chain = Chain::from_urdf_str(&text, &LoadOptions::default()).map_err(said)?;
        let tip = chain.frame("link6").map_err(said)?;
        let qd = [0.1, -0.2, 0.3, -0.4, 0.5, 1.0];
        let hit = chain.impact(&[0.0; 6], &qd).at(tip).normal([-1.0, 0.0, 0.0]).resolve(law.as_ref()).map_err(said)?;
        let speed: f64 = qd.iter().sum();
        for (k, (after, before)) in hit.qd_plus.iter().zip(qd).enumerate() {
            let expected = if k == 5 { before - 1.5 * speed } else { before };
            error = worse(error, (after - expected).abs() / speed);
        }
    }
    Ok(Found::figure(error))
}

/// A bent chain; the velocity of its tip comes from all links.
pub fn long(name: &str, links: usize) -> Judged {
    let chain = uniform_chain(links, 1.0, 1.0).map_err(said)?;
    let law = law(name, 0.5, 0.3);
    let tip = chain.frame("tip").map_err(said)?;
    let q: Vec<f64> = (0..links).map(|k| 0.3 * (0.7 * k as f64).sin() / (links as f64).sqrt()).collect();
    let qd: Vec<f64> = (0..links).map(|k| -0.2 + (1.3 * k as f64).cos()).collect();
    let mut workspace = chain.workspace();
    let point = chain.point(tip, nalgebra::Vector3::zeros());
    let jacobian = workspace.update(&chain, &q).map_err(said)?.point_jacobian(point);
    let toward = &jacobian * DVector::from_column_slice(&qd);
    // A wall across the tip's path, a little askew.
    let normal = [-toward[0] + 0.4 * toward[1], -toward[1] - 0.4 * toward[0], 0.0];
    let hit: ChainImpact = chain.impact(&q, &qd).at(tip).normal(normal).resolve(law.as_ref()).map_err(said)?;
    let change = hit.energy_after - hit.energy_before;
    let books = (change - hit.contact.energy_change).abs() / hit.energy_before.max(hit.energy_after);
    let found = &jacobian * DVector::from_column_slice(&hit.qd_plus);
    let along = (0..3).map(|k| (found[k] - hit.u_plus[k]).powi(2)).sum::<f64>().sqrt() / hit.u_minus.norm();
    Ok(Found::figure(worse(books, along)))
}
