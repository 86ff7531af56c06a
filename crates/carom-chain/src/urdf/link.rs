//! Inertia of links: whether the mathematics is sound with it, and the nearest one that a body can have.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | a ≤ b ≤ c | principal moments about the centre of mass, kg m² |
//!
//! Principal moments are integrals of y² + z², z² + x² and x² + y²: none is negative, and none exceeds the sum of the other
//! two. Without the first property the mass matrix can be indefinite: such an inertia is refused, unless the link and those
//! on fixed joints to it form a rigid body that has the property. Without the second property the mass matrix stays
//! positive semidefinite, because ω·Iω ≥ 0 for every ω: such an inertia is used as it is, with a warning.

use super::joint::pose;
use super::names::suggestion;
use super::options::LoadOptions;
use super::robot::{Inertial, JointType, Link, Repair, short};
use super::source::{Source, own_child};
use super::tree::Tree;
use super::warnings::Warnings;
use crate::error::ChainError;
use crate::rounding::ROUNDING;
use nalgebra::{Isometry3, Matrix3, Point3, SymmetricEigen, Vector3};

/// Relative violation of the triangle inequality that is rounding of the numbers in the file.
const ROUNDED: f64 = 1e-3;

/// Relative violation of the triangle inequality below which there is no warning, and greatest negative moment relative to
/// the greatest one that is rounding of the numbers in the file.
const EXACT: f64 = 1e-9;

/// Moments smaller than this fraction of the greatest are rounding of the eigenvalue iteration, which the file does not have.
const ITERATED: f64 = 1e-12;

/// Radius of gyration below which a negative moment is rounding, whatever the other moments are, m.
const TINY: f64 = 1e-9;

/// An `<inertial>` that can be used.
#[derive(Default)]
struct Sound {
    inertial: Option<Inertial>,
    warning: Option<String>,
    /// Principal moments before and after a repair.
    raised: Option<[[f64; 3]; 2]>,
    /// The principal moments, if one is negative.
    negative: Option<String>,
}

/// The inertia of each link. `repair` raises principal moments to the nearest ones that a body can have. On a link that never
/// moves only the mass counts: an impossible inertia is then a warning. `moves`: which links move. `reach`: that of the robot, m.
///
/// # Errors
/// A negative mass or principal moment of a link that moves.
pub(super) fn inertials(
    source: &Source,
    urdf: &urdf_rs::Robot,
    tree: &Tree,
    kinds: &[JointType],
    (moves, reach): (&[bool], f64),
    repair: bool,
    warnings: &mut Warnings,
) -> Result<Vec<Option<Inertial>>, ChainError> {
    let mut inertials = Vec::new();
    let mut negative = Vec::new();
    for (k, ((link, node), moves)) in urdf.links.iter().zip(source.links()).zip(moves).enumerate() {
        // urdf-rs reads zeros where there is no <inertial>
        let inertial_node = own_child(node, "inertial");
        if inertial_node == node {
            inertials.push(None);
            continue;
        }
        inertials.push(match inertial(&link.inertial, reach, repair && *moves) {
            Ok(Sound { inertial: Some(Inertial { mass, com, .. }), negative: Some(moments), .. }) if !*moves => {
                let text = format!("{moments}: none may be negative; not used, since the link never moves");
                warnings.odd(source, own_child(inertial_node, "inertia"), &text);
                Some(Inertial { mass, com, inertia_at_com: Matrix3::zeros() })
            }
            Ok(Sound { inertial, warning, raised, negative: moments }) => {
                negative.extend(moments.map(|moments| (k, own_child(inertial_node, "inertia"), moments)));
                if let Some(warning) = warning {
                    warnings.odd(source, inertial_node, &warning);
                }
                if let Some([before, after]) = raised {
                    warnings.repairs.push(Repair::Raised { link: link.name.clone(), before, after });
                }
                inertial
            }
            Err(rule) if *moves => return Err(source.error(own_child(inertial_node, "mass"), Some("value"), rule)),
            Err(rule) => {
                let text = format!("{rule}; not used, since the link never moves");
                warnings.odd(source, own_child(inertial_node, "mass"), &text);
                None
            }
        });
    }
    let places = rigid_bodies(urdf, tree, kinds);
    for (link, element, moments) in negative {
        if has_negative_moment(&places, &inertials, places[link].0, reach) {
            let rule = format!(
                "{moments}: none may be negative; check signs and the terms ixy, ixz, iyz, or raise them to the nearest \
                 possible ones: --repair (LoadOptions::repair)"
            );
            return Err(source.error(element, None, rule));
        }
        let text = format!(
            "{moments}: none may be negative; used as they are, since the rigid body of this link and the links fixed to it \
             has none"
        );
        warnings.odd(source, element, &text);
    }
    Ok(inertials)
}

/// For each link the first link of its rigid body, and its pose in the frame of that link.
fn rigid_bodies(urdf: &urdf_rs::Robot, tree: &Tree, kinds: &[JointType]) -> Vec<(usize, Isometry3<f64>)> {
    let mut places: Vec<_> = (0..urdf.links.len()).map(|link| (link, Isometry3::identity())).collect();
    for j in tree.outwards.iter().filter(|j| kinds[**j] == JointType::Fixed) {
        let (parent, child) = tree.ends[*j];
        let (body, place) = places[parent];
        places[child] = (body, place * pose(&urdf.joints[*j].origin));
    }
    places
}

/// Whether the rigid body whose first link is `body` has a negative principal moment about its centre of mass.
fn has_negative_moment(
    places: &[(usize, Isometry3<f64>)],
    inertials: &[Option<Inertial>],
    body: usize,
    reach: f64,
) -> bool {
    let parts = places.iter().zip(inertials).filter(|((of, _), _)| *of == body);
    let parts: Vec<_> = parts.filter_map(|((_, place), inertial)| Some((place, (*inertial)?))).collect();
    let at = |place: &Isometry3<f64>, com| place.transform_point(&Point3::from(com)).coords;
    let mass: f64 = parts.iter().map(|(_, part)| part.mass).sum();
    let moment: Vector3<f64> = parts.iter().map(|(place, part)| at(place, part.com) * part.mass).sum();
    let com = if mass > 0.0 { moment / mass } else { Vector3::zeros() };
    let mut sum = Matrix3::zeros();
    for (place, part) in &parts {
        let (turn, d) = (place.rotation.to_rotation_matrix(), at(place, part.com) - com);
        sum += turn * part.inertia_at_com * turn.transpose();
        sum += (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * part.mass;
    }
    let moments = sum.symmetric_eigenvalues();
    moments.min() < -rounding(moments.max(), mass, reach)
}

/// Greatest negative moment that is rounding, for the greatest moment `c` and the mass of a body, kg m².
fn rounding(c: f64, mass: f64, reach: f64) -> f64 {
    // a moment about the centre of mass is the difference of moments about other points of the robot
    EXACT * c.max(0.0) + mass * (TINY * TINY + ROUNDING * reach * reach)
}

/// The inertia in link axes.
///
/// # Errors
/// A negative mass, with the rule for the message.
fn inertial(urdf: &urdf_rs::Inertial, reach: f64, repair: bool) -> Result<Sound, String> {
    let mass = urdf.mass.value;
    let i = &urdf.inertia;
    let matrix = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    if mass < 0.0 {
        return Err(format!("{mass} kg is negative: the mass of a body must be positive"));
    }
    if mass == 0.0 && matrix == Matrix3::zeros() {
        let warning = Some("mass and inertia are zero; read as without <inertial>".into());
        return Ok(Sound { warning, ..Sound::default() });
    }
    let Moments { matrix, warning, raised, negative } = check_moments(&matrix, mass, reach, repair);
    let massless =
        (mass == 0.0).then(|| "the mass is 0 and <inertia> is not; read as rotational inertia without mass".into());
    let warning = match (massless, warning) {
        (Some(massless), Some(warning)) => Some(format!("{massless}; {warning}")),
        (massless, warning) => massless.or(warning),
    };
    let placement = pose(&urdf.origin);
    let rotation = placement.rotation.to_rotation_matrix();
    let turned = rotation * matrix * rotation.transpose();
    // the mean of both halves: the products above differ in the last digit
    let inertia_at_com = (turned + turned.transpose()) / 2.0;
    let inertial = Some(Inertial { mass, com: placement.translation.vector, inertia_at_com });
    Ok(Sound { inertial, warning, raised, negative })
}

/// Result of [`check_moments`]: the matrix to use, and the rest as in [`Sound`].
struct Moments {
    matrix: Matrix3<f64>,
    warning: Option<String>,
    raised: Option<[[f64; 3]; 2]>,
    negative: Option<String>,
}

fn check_moments(matrix: &Matrix3<f64>, mass: f64, reach: f64, repair: bool) -> Moments {
    let eigen = SymmetricEigen::new(*matrix);
    let mut order = [0, 1, 2];
    order.sort_by(|i, j| eigen.eigenvalues[*i].total_cmp(&eigen.eigenvalues[*j]));
    let greatest = eigen.eigenvalues.amax();
    let before = order.map(|i| eigen.eigenvalues[i]);
    let before = before.map(|moment| if moment.abs() <= ITERATED * greatest { 0.0 } else { moment });
    let with = |moments: [f64; 3]| {
        let mut values = Vector3::zeros();
        order.iter().zip(moments).for_each(|(i, moment)| values[*i] = moment);
        eigen.eigenvectors * Matrix3::from_diagonal(&values) * eigen.eigenvectors.transpose()
    };
    let [a, b, c] = before;
    let [sa, sb, sc, sum] = [a, b, c, a + b].map(short);
    let moments = format!("principal moments {sa}, {sb} and {sc} kg m²");
    let excess = if c > 0.0 { (c - (a + b)) / c } else { 0.0 };
    let rounding = rounding(c, mass, reach);
    let mut checked = Moments { matrix: *matrix, warning: None, raised: None, negative: None };
    if repair && (a < -rounding || excess > EXACT) {
        let after = possible(before);
        return Moments { matrix: with(after), raised: Some([before, after]), ..checked };
    }
    if a < -rounding {
        return Moments { negative: Some(moments), ..checked };
    }
    checked.warning = if excess > ROUNDED && c - (a + b) > rounding {
        Some(format!(
            "{moments}: {sa} + {sb} = {sum} is less than {sc}, but no principal moment of a body exceeds the sum of the other \
             two; used as they are, since the mass matrix stays positive"
        ))
    } else if a < 0.0 {
        Some(format!("{moments}: a negative one is accepted as rounding and read as 0"))
    } else if excess > EXACT {
        Some(format!(
            "{moments}: the greatest exceeds the sum of the other two by the fraction {excess:.1e} of itself, accepted as \
             rounding"
        ))
    } else {
        None
    };
    if a < 0.0 {
        checked.matrix = with(before.map(|moment| moment.max(0.0)));
    }
    checked
}

/// The nearest principal moments (ascending) that a body can have: negative ones are raised to 0, then the least one to the
/// difference of the other two.
fn possible(moments: [f64; 3]) -> [f64; 3] {
    let [a, b, c] = moments.map(|moment| moment.max(0.0));
    [a.max(c - b), b, c]
}

/// Sets the masses of [`LoadOptions::mass`](super::LoadOptions::mass) and the inertias of
/// [`LoadOptions::inertia`](super::LoadOptions::inertia).
pub(super) fn set_inertials(links: &mut [Link], options: &LoadOptions) -> Result<(), ChainError> {
    for (name, &mass) in &options.mass {
        let rule = "only a link with a mass in the file can get another one, because its inertia changes in proportion";
        let refuse = |rule| ChainError::OutOfRange { what: format!("mass of {name}"), value: mass, rule };
        let own = named(links, name)?.inertial.as_mut().filter(|own| own.mass > 0.0).ok_or_else(|| refuse(rule))?;
        if !(mass > 0.0 && mass.is_finite()) {
            return Err(refuse("it must be positive and finite"));
        }
        own.inertia_at_com *= mass / own.mass;
        own.mass = mass;
    }
    for (name, &[xx, xy, xz, yy, yz, zz]) in &options.inertia {
        let matrix = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let mut moments = matrix.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        let refuse = |value, rule| ChainError::OutOfRange { what: format!("inertia of {name}"), value, rule };
        let rule = "only a link with an <inertial> in the file, which has the centre of mass, can get another inertia";
        let own = named(links, name)?.inertial.as_mut().ok_or_else(|| refuse(xx, rule))?;
        if !(moments.iter().all(|moment| moment.is_finite()) && moments[0] > 0.0) {
            return Err(refuse(moments[0], "its principal moments must be positive and finite"));
        }
        if moments[2] > (moments[0] + moments[1]) * (1.0 + ROUNDED) {
            return Err(refuse(moments[2], "no body has a principal moment above the sum of the other two"));
        }
        own.inertia_at_com = matrix;
    }
    Ok(())
}

/// # Errors
/// A link that the robot does not have.
fn named<'l>(links: &'l mut [Link], name: &str) -> Result<&'l mut Link, ChainError> {
    let names: Vec<&str> = links.iter().map(|link| link.name.as_str()).collect();
    let unknown = || ChainError::UnknownFrame { name: name.to_owned(), hint: suggestion(name, &names) };
    let k = names.iter().position(|own| *own == name).ok_or_else(unknown)?;
    Ok(&mut links[k])
}
