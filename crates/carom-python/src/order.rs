//! The order and the coordinates of Pinocchio: where each joint of a chain is in its q and v.
//!
//! `pinocchio.buildModelFromUrdf` visits the links depth first, the children of a link in the order of the names of their joints.
//! A continuous joint has (cos, sin); a mimic joint has coordinates of its own, unless the model is built with `mimic=True`. A
//! floating joint has the coordinates of carom. Planar joints are refused.

use crate::array::{Given, Maybe, Numbers, Rows, rows, together};
use crate::chain::Chain;
use crate::error::raise;
use carom_chain::urdf::JointType;
use carom_chain::{ChainError, Coordinates, JointInfo};
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// A joint of Pinocchio's model. Position = ratio · q + shift; ratio 1 and shift 0 unless the joint mimics another.
struct Place {
    kind: Kind,
    ratio: f64,
    shift: f64,
    follows: bool,
    /// First entries: of carom's q and v, and of Pinocchio's.
    own: (usize, usize),
    pinocchio: (usize, usize),
}

enum Kind {
    One,
    Continuous,
    Floating,
}

/// The joints that move, in Pinocchio's order, and the lengths of its q and v.
fn places(chain: &carom_chain::Chain) -> Result<(Vec<Place>, usize, usize), ChainError> {
    // The parent of an added floating joint is called `world`, which may be the name of the root link too.
    let (base, joints) = match chain.joints() {
        [base, rest @ ..] if base.parent == base.child => (Some(base), rest),
        all => (None, all),
    };
    let mut children: BTreeMap<&str, BTreeMap<&str, &JointInfo>> = BTreeMap::new();
    for joint in joints {
        children.entry(&joint.parent).or_default().insert(&joint.name, joint);
    }
    let below: Vec<&str> = joints.iter().map(|joint| joint.child.as_str()).collect();
    let mut waiting: Vec<&JointInfo> = Vec::new();
    match base {
        Some(base) => waiting.push(base),
        None => {
            let roots = children.iter().filter(|(link, _)| !below.contains(link));
            roots.for_each(|(_, first)| waiting.extend(first.values().rev()));
        }
    }
    let (mut places, mut nq, mut nv) = (Vec::new(), 0, 0);
    while let Some(joint) = waiting.pop() {
        if let Some(next) = children.get(joint.child.as_str()) {
            waiting.extend(next.values().rev());
        }
        let Some(place) = place(chain, joint, (nq, nv))? else { continue };
        let (q, v) = match place.kind {
            Kind::One => (1, 1),
            Kind::Continuous => (2, 1),
            Kind::Floating => (7, 6),
        };
        places.push(place);
        (nq, nv) = (nq + q, nv + v);
    }
    Ok((places, nq, nv))
}

/// What a joint is, whose first entries of Pinocchio's q and v are `pinocchio`; `None` if it does not move.
fn place(
    chain: &carom_chain::Chain,
    joint: &JointInfo,
    pinocchio: (usize, usize),
) -> Result<Option<Place>, ChainError> {
    let (ratio, shift, follows, coordinates) = match &joint.coordinates {
        Coordinates::None => return Ok(None),
        own @ Coordinates::Own { .. } => (1.0, 0.0, false, own),
        Coordinates::Follows { joint, multiplier, offset } => {
            (*multiplier, *offset, true, &chain.joint(joint)?.coordinates)
        }
    };
    let Coordinates::Own { q, v } = coordinates else { return Ok(None) };
    let kind = match joint.kind {
        JointType::Continuous => Kind::Continuous,
        JointType::Planar => {
            return Err(ChainError::NotReducible(format!(
                "joint '{}' is planar: Pinocchio reads no axis of planar joints, so that its coordinates are not those of the \
                 file; convert q and v of such a robot by hand",
                joint.name
            )));
        }
        JointType::Floating => Kind::Floating,
        _ => Kind::One,
    };
    Ok(Some(Place { kind, ratio, shift, follows, own: (q.start, v.start), pinocchio }))
}

/// q, or (q, v), of carom in Pinocchio's order.
pub fn to_pinocchio(chain: &Chain, q: Given, v: Maybe) -> PyResult<Py<PyAny>> {
    let (places, nq, nv) = places(&chain.chain).map_err(raise)?;
    converted(
        (q.py(), chain.q(q)?, v.map(|v| chain.v("v", v)).transpose()?),
        (nq, nv),
        |q, out| {
            for Place { kind, ratio, shift, own: (own, _), pinocchio: (at, _), .. } in &places {
                match kind {
                    Kind::One => out[*at] = ratio * q[*own] + shift,
                    Kind::Continuous => {
                        let (sin, cos) = (ratio * q[*own] + shift).sin_cos();
                        out[*at..at + 2].copy_from_slice(&[cos, sin]);
                    }
                    Kind::Floating => out[*at..at + 7].copy_from_slice(&q[*own..own + 7]),
                }
            }
        },
        |v, out| {
            for Place { kind, ratio, own: (_, own), pinocchio: (_, at), .. } in &places {
                match kind {
                    Kind::One | Kind::Continuous => out[*at] = ratio * v[*own],
                    Kind::Floating => out[*at..at + 6].copy_from_slice(&v[*own..own + 6]),
                }
            }
        },
    )
}

/// q, or (q, v), of Pinocchio in the order of carom.
pub fn from_pinocchio(chain: &Chain, q: Given, v: Maybe) -> PyResult<Py<PyAny>> {
    let (places, nq, nv) = places(&chain.chain).map_err(raise)?;
    let layout = || "in Pinocchio's order, mimic joints included".to_owned();
    let read = |what, given, width| Numbers::read(what, given)?.rows(what, width, layout);
    let own = || places.iter().filter(|place| !place.follows);
    converted(
        (q.py(), read("q", q, nq)?, v.map(|v| read("v", v, nv)).transpose()?),
        (chain.chain.nq(), chain.chain.nv()),
        |q, out| {
            for Place { kind, own: (own, _), pinocchio: (at, _), .. } in own() {
                match kind {
                    Kind::One => out[*own] = q[*at],
                    Kind::Continuous => out[*own] = q[at + 1].atan2(q[*at]),
                    Kind::Floating => out[*own..own + 7].copy_from_slice(&q[*at..at + 7]),
                }
            }
        },
        |v, out| {
            for Place { kind, own: (_, own), pinocchio: (_, at), .. } in own() {
                match kind {
                    Kind::One | Kind::Continuous => out[*own] = v[*at],
                    Kind::Floating => out[*own..own + 6].copy_from_slice(&v[*at..at + 6]),
                }
            }
        },
    )
}

fn converted(
    (py, q, v): (Python<'_>, Rows, Option<Rows>),
    (nq, nv): (usize, usize),
    write_q: impl Fn(&[f64], &mut [f64]),
    write_v: impl Fn(&[f64], &mut [f64]),
) -> PyResult<Py<PyAny>> {
    let all = |given: &Rows, width: usize, write: &dyn Fn(&[f64], &mut [f64])| {
        let mut out = vec![0.0; given.count().unwrap_or(1) * width];
        let plain = given.plain();
        out.chunks_exact_mut(width.max(1)).enumerate().for_each(|(k, out)| write(plain.row(k), out));
        rows(py, out, given.count(), width)
    };
    let changed = all(&q, nq, &write_q)?;
    let Some(v) = v else { return Ok(changed.unbind()) };
    together([("q", &q), ("v", &v)])?;
    Ok((changed, all(&v, nv, &write_v)?).into_pyobject(py)?.into_any().unbind())
}
