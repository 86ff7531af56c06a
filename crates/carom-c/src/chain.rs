//! Robots: loading, joints and frames.

use crate::border::c_text;
use crate::error::{Fault, Status};
use carom_chain::urdf::{LoadOptions, Meshes};
use carom_chain::{Coordinates, FrameId, JointInfo};
use std::ffi::{CString, c_char};
use std::ptr;
use std::sync::Arc;

/// A kinematic chain (a tree of links and joints) read from a URDF; it does not change. Any number of threads may use one at the
/// same time. What is made from it keeps what it needs, so that it may be freed at any time.
pub struct Chain {
    pub(crate) chain: Arc<carom_chain::Chain>,
    name: CString,
    warnings: CString,
    /// The joints with entries in q: their names, and their indices in the chain's list.
    joints: Vec<(CString, usize)>,
    frames: Vec<CString>,
}

/// A joint that has entries in q and qd. A floating joint has q = x y z qx qy qz qw (m, unit quaternion), and its qd is the linear
/// (m/s), then the angular velocity (rad/s) of the child link in its axes; a planar joint has q = x y angle.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Joint {
    /// Its name, UTF-8; valid until the chain is freed.
    pub name: *const c_char,
    /// Index of its first entry in q.
    pub q_index: usize,
    /// Number of its entries in q.
    pub q_count: usize,
    /// Index of its first entry in qd.
    pub v_index: usize,
    /// Number of its entries in qd.
    pub v_count: usize,
    /// Lower limit of the position, rad or m; -INFINITY without a limit.
    pub lower: f64,
    /// Upper limit of the position, rad or m; INFINITY without a limit.
    pub upper: f64,
    /// Limit of the speed, rad/s or m/s; INFINITY without a limit.
    pub velocity: f64,
    /// Limit of the effort, N m or N; INFINITY without a limit.
    pub effort: f64,
}

/// For carom_chain_load: connects the root link to the world by a floating joint.
pub const CAROM_FLOATING_BASE: u32 = 1;
/// For carom_chain_load: changes a robot without sound dynamics as little as these need; the changes are among the warnings.
pub const CAROM_REPAIR: u32 = 2;
/// For carom_chain_load: refuses what is otherwise a warning.
pub const CAROM_STRICT: u32 = 4;
/// For carom_chain_load: leaves out collision meshes, which single impacts do not use.
pub const CAROM_WITHOUT_MESHES: u32 = 8;

impl Chain {
    pub(crate) fn new(chain: Arc<carom_chain::Chain>) -> Self {
        let report = chain.report();
        let told = report.warnings.iter().cloned().chain(report.repairs.iter().map(ToString::to_string));
        let warnings = c_text(&told.collect::<Vec<_>>().join("\n"));
        let moving = |(_, joint): &(usize, &JointInfo)| matches!(joint.coordinates, Coordinates::Own { .. });
        let joints = chain.joints().iter().enumerate().filter(moving);
        let joints = joints.map(|(index, joint)| (c_text(&joint.name), index)).collect();
        let frames = chain.frames().iter().map(|frame| c_text(&frame.name)).collect();
        Self { name: c_text(chain.name()), warnings, joints, frames, chain }
    }

    fn joint(&self, index: usize) -> Option<Joint> {
        let (name, at) = self.joints.get(index)?;
        let JointInfo { coordinates: Coordinates::Own { q, v }, limits, .. } = &self.chain.joints()[*at] else {
            return None;
        };
        // Joints with several coordinates have no limits.
        let limit = |of: Option<f64>, none: f64| of.filter(|_| v.len() == 1).unwrap_or(none);
        Some(Joint {
            name: name.as_ptr(),
            q_index: q.start,
            q_count: q.len(),
            v_index: v.start,
            v_count: v.len(),
            lower: limit(limits.lower, f64::NEG_INFINITY),
            upper: limit(limits.upper, f64::INFINITY),
            velocity: limit(limits.velocity, f64::INFINITY),
            effort: limit(limits.effort, f64::INFINITY),
        })
    }
}

/// The frame of an index.
pub(crate) fn frame(chain: &carom_chain::Chain, index: usize) -> Result<FrameId, Fault> {
    let count = chain.frames().len();
    let frame = chain.frames().get(index).ok_or_else(|| {
        Fault::invalid(format!("frame is {index}: the chain has {count} frames, counted from 0 (carom_chain_frame)"))
    })?;
    Ok(chain.frame(&frame.name)?)
}

fn options(bits: u32) -> Result<LoadOptions, Fault> {
    let known = CAROM_FLOATING_BASE | CAROM_REPAIR | CAROM_STRICT | CAROM_WITHOUT_MESHES;
    if bits & !known != 0 {
        return Err(Fault::invalid(format!("options has the unknown bits {:#x}", bits & !known)));
    }
    let has = |bit: u32| bits & bit != 0;
    Ok(LoadOptions {
        floating_base: has(CAROM_FLOATING_BASE),
        repair: has(CAROM_REPAIR),
        strict: has(CAROM_STRICT),
        meshes: if has(CAROM_WITHOUT_MESHES) { Meshes::Ignored } else { Meshes::WhenUsed },
        ..LoadOptions::default()
    })
}

/// Reads a URDF file. `options`: 0, or a sum of CAROM_FLOATING_BASE, CAROM_REPAIR, CAROM_STRICT and CAROM_WITHOUT_MESHES. The
/// chain is freed by carom_chain_free. Refused input: a file that cannot be read or breaks a rule; the message names line,
/// element, value and rule.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_load(path: *const c_char, options: u32, chain: *mut *mut Chain) -> Status {
    call!(carom_chain_load, |text path, created chain| {
        let loaded = carom_chain::Chain::from_urdf_file_with(path, &self::options(options)?)?;
        chain.give(Chain::new(Arc::new(loaded)));
        Ok(())
    })
}

/// Reads the text of a URDF, as carom_chain_load reads a file. Meshes with relative names are not found.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_parse(urdf: *const c_char, options: u32, chain: *mut *mut Chain) -> Status {
    call!(carom_chain_parse, |text urdf, created chain| {
        let loaded = carom_chain::Chain::from_urdf_str(urdf, &self::options(options)?)?;
        chain.give(Chain::new(Arc::new(loaded)));
        Ok(())
    })
}

/// Frees a chain; nothing for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_free(chain: *mut Chain) {
    free!(carom_chain_free, free chain);
}

/// Name of the robot, UTF-8; valid until the chain is freed. NULL for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_name(chain: *const Chain) -> *const c_char {
    call!(carom_chain_name or ptr::null(), |shared chain| Ok(chain.name.as_ptr()))
}

/// What loading has found odd in the file, and the changes of CAROM_REPAIR: one sentence a line, UTF-8; an empty text if there is
/// nothing. Valid until the chain is freed. NULL for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_warnings(chain: *const Chain) -> *const c_char {
    call!(carom_chain_warnings or ptr::null(), |shared chain| Ok(chain.warnings.as_ptr()))
}

/// Length of q, the configuration: positions of the joints in the order of the file, an added floating base first; rad, m, unit
/// quaternion. 0 for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_nq(chain: *const Chain) -> usize {
    call!(carom_chain_nq or 0, |shared chain| Ok(chain.chain.nq()))
}

/// Length of qd, the joint velocities: the degrees of freedom; rad/s, m/s. 0 for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_nv(chain: *const Chain) -> usize {
    call!(carom_chain_nv or 0, |shared chain| Ok(chain.chain.nv()))
}

/// Number of joints that have entries in q and qd. 0 for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_joint_count(chain: *const Chain) -> usize {
    call!(carom_chain_joint_count or 0, |shared chain| Ok(chain.joints.len()))
}

/// Joint number `index`, from 0, of those that have entries in q and qd, in their order.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_joint(chain: *const Chain, index: usize, joint: *mut Joint) -> Status {
    call!(carom_chain_joint, |shared chain, place joint| {
        let count = chain.joints.len();
        let told = chain.joint(index).ok_or_else(|| {
            Fault::invalid(format!("index is {index}: the chain has {count} joints with entries in q, counted from 0"))
        })?;
        joint.put(told);
        Ok(())
    })
}

/// Number of frames: one for each link. 0 for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_frame_count(chain: *const Chain) -> usize {
    call!(carom_chain_frame_count or 0, |shared chain| Ok(chain.frames.len()))
}

/// Name of frame number `frame`, from 0, in the order of the file, UTF-8; valid until the chain is freed. NULL after a fault.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_frame_name(chain: *const Chain, frame: usize) -> *const c_char {
    call!(carom_chain_frame_name or ptr::null(), |shared chain| {
        self::frame(&chain.chain, frame)?;
        Ok(chain.frames[frame].as_ptr())
    })
}

/// The number of the frame of the link `name`, for the functions that take a frame. Refused input: no such link; the message has
/// the nearest names.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_chain_frame(chain: *const Chain, name: *const c_char, frame: *mut usize) -> Status {
    call!(carom_chain_frame, |shared chain, text name, place frame| {
        let found = chain.chain.frame(name)?;
        let name = chain.chain.frame_name(found);
        let index = chain.chain.frames().iter().position(|it| it.name == name);
        frame.put(index.unwrap_or_default());
        Ok(())
    })
}
