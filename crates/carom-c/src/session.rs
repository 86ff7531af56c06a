//! Sessions: a scene that a loop advances.

use crate::border::c_text;
use crate::chain::Chain;
use crate::dynamics::has_length;
use crate::error::{Fault, Status};
use crate::scene::Scene;
use carom_sim::{Drive, Moment, Pd, StopReason};
use std::ffi::{CString, c_char};
use std::sync::Arc;

/// A run of a scene that a loop advances: read the state, set the joint forces, advance. One thread at a time may use it. Sessions
/// allocate.
#[derive(Clone)]
pub struct Session {
    session: carom_sim::Session,
    /// Of the last advance, with their kinds and contacts.
    events: Vec<(carom_sim::Event, [CString; 2])>,
}

/// An event of a session.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Event {
    /// Time, s.
    pub time: f64,
    /// Its kind: "impact", "several" (contacts at once), "limit" (of a joint), "latch", "zeno", "sliding", "sticking", "free", "lift-off",
    /// "joint-stops", "joint-moves", "stepping", "non-unique", "rest" …: the page "Simulate a scene" of the book. Valid until the session
    /// is advanced, set to a state or freed.
    pub kind: *const c_char,
    /// The contact or the joint, UTF-8; several are separated by "; ", and the text is empty if there is none. Valid as `kind`.
    pub contact: *const c_char,
    /// Whether the joint velocities jump.
    pub is_impact: bool,
    /// Sum of the impulses on the robot, N s, world axes; of a limit, which acts on a joint, zero.
    pub impulse: [f64; 3],
}

impl Session {
    fn nq_nv(&self) -> (usize, usize) {
        (self.session.chain().nq(), self.session.chain().nv())
    }

    fn advance(
        &mut self,
        duration: f64,
        go: fn(&mut carom_sim::Session, f64) -> Result<carom_sim::Advance, carom_sim::SimError>,
    ) -> Result<usize, Fault> {
        let done = go(&mut self.session, duration)?;
        let sim = self.session.simulation();
        if done.stop == StopReason::Events && done.events.is_empty() {
            let (most, time) = (sim.max_events, self.session.time());
            let rule = "raise max_events in [run] of the scene";
            return Err(Fault::physics(format!("the session has had {most} events by {time} s: {rule}")));
        }
        let named = |event: carom_sim::Event| {
            let told = event.named(&sim.touches);
            let contacts: Vec<&str> = told.contact.into_iter().chain(told.contacts).collect();
            let texts = [c_text(told.kind), c_text(&contacts.join("; "))];
            (event, texts)
        };
        self.events = done.events.into_iter().map(named).collect();
        Ok(self.events.len())
    }

    fn event(&self, index: usize) -> Result<&(carom_sim::Event, [CString; 2]), Fault> {
        let count = self.events.len();
        let rule = format!("the last advance has had {count} events, counted from 0");
        self.events.get(index).ok_or_else(|| Fault::invalid(format!("index is {index}: {rule}")))
    }
}

/// Starts a session of a scene at its start; freed by carom_session_free. An impact at the start is among the events of the first
/// advance. Refused physics: an overlap at the start.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_start(scene: *const Scene, session: *mut *mut Session) -> Status {
    call!(carom_session_start, |shared scene, created session| {
        session.give(Session { session: scene.scene.plan()?.start()?, events: Vec::new() });
        Ok(())
    })
}

/// Another session in the same state, which goes on independently: to try a motion, or to return to this state; freed by
/// carom_session_free.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_copy(session: *const Session, copy: *mut *mut Session) -> Status {
    call!(carom_session_copy, |shared session, created copy| {
        copy.give(session.clone());
        Ok(())
    })
}

/// Frees a session; nothing for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_free(session: *mut Session) {
    free!(carom_session_free, free session);
}

/// The robot of the session, freed by carom_chain_free. Its joints are those of q and qd of the session: a scene is reduced to what
/// moves, so that they can be fewer than those of the file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_chain(session: *const Session, chain: *mut *mut Chain) -> Status {
    call!(carom_session_chain, |shared session, created chain| {
        chain.give(Chain::new(Arc::new(session.session.chain().clone())));
        Ok(())
    })
}

/// The time (s), the configuration `q` (length nq) and the joint velocities `qd` (length nv) now.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_state(
    session: *const Session,
    time: *mut f64,
    q: *mut f64,
    q_length: usize,
    qd: *mut f64,
    qd_length: usize,
) -> Status {
    call!(carom_session_state, |shared session, place time, output q [q_length], output qd [qd_length]| {
        let (nq, nv) = session.nq_nv();
        has_length("q", q, nq, "nq of carom_session_chain")?;
        has_length("qd", qd, nv, "nv of carom_session_chain")?;
        let Moment { time: now, q: at, qd: rates } = session.session.moment();
        time.put(now);
        q.copy_from_slice(&at);
        qd.copy_from_slice(&rates);
        Ok(())
    })
}

/// Starts again from another state at the present time: `q` (length nq), `qd` (length nv). Contacts, counts and energies begin anew.
/// Refused physics: an overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_set_state(
    session: *mut Session,
    q: *const f64,
    q_length: usize,
    qd: *const f64,
    qd_length: usize,
) -> Status {
    call!(carom_session_set_state, |exclusive session, input q [q_length], input qd [qd_length]| {
        session.session.restart(q, qd)?;
        session.events.clear();
        Ok(())
    })
}

/// Sets constant joint forces in place of the controller, from now on: `forces` (length nv), N m and N.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_set_forces(
    session: *mut Session,
    forces: *const f64,
    forces_length: usize,
) -> Status {
    call!(carom_session_set_forces, |exclusive session, input forces [forces_length]| {
        Ok(session.session.set_forces(forces)?)
    })
}

/// Sets the controller kp (target − q) − kd qd in place of another one, from now on. `kp` (N m/rad, N/m) and `kd` (N m s/rad, N s/m) have the
/// length nv, `target` (rad, m) the length nq; numbers of floating and planar joints are not used.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_set_targets(
    session: *mut Session,
    kp: *const f64,
    kp_length: usize,
    kd: *const f64,
    kd_length: usize,
    target: *const f64,
    target_length: usize,
) -> Status {
    call!(
        carom_session_set_targets,
        |exclusive session, input kp [kp_length], input kd [kd_length], input target [target_length]| {
            has_length("target", target, session.session.chain().nq(), "nq of carom_session_chain")?;
            let (kp, kd) = (kp.to_vec().into(), kd.to_vec().into());
            Ok(session.session.set_drive(Drive::Pd(Pd { kp, kd, target: target.to_vec() }))?)
        }
    )
}

/// Advances by `duration` (s); `count` becomes the number of events in it, which carom_session_event reads. Refused physics: a motion
/// that cannot be continued, more events than max_events of the scene; the session then stays where it was.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_advance(session: *mut Session, duration: f64, count: *mut usize) -> Status {
    call!(carom_session_advance, |exclusive session, place count| {
        count.put(session.advance(duration, carom_sim::Session::advance)?);
        Ok(())
    })
}

/// Advances to the next event, by `longest` (s) at most. `count` becomes the number of events at its time: an impact and the mode that
/// follows it are two; 0 if there is none. As carom_session_advance otherwise.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_advance_to_event(
    session: *mut Session,
    longest: f64,
    count: *mut usize,
) -> Status {
    call!(carom_session_advance_to_event, |exclusive session, place count| {
        count.put(session.advance(longest, carom_sim::Session::advance_to_event)?);
        Ok(())
    })
}

/// Event number `index`, from 0, of the last advance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_event(session: *const Session, index: usize, event: *mut Event) -> Status {
    call!(carom_session_event, |shared session, place event| {
        let (found, [kind, contact]) = session.event(index)?;
        let impulse = found.impulses.iter().map(|it| it.impulse).sum::<nalgebra::Vector3<f64>>();
        event.put(Event {
            time: found.time,
            kind: kind.as_ptr(),
            contact: contact.as_ptr(),
            is_impact: found.kind.is_impact(),
            impulse: impulse.into(),
        });
        Ok(())
    })
}

/// The joint velocities before and after event number `index` of the last advance, `qd_minus` and `qd_plus` (length nv; rad/s, m/s).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn carom_session_event_velocities(
    session: *const Session,
    index: usize,
    qd_minus: *mut f64,
    qd_minus_length: usize,
    qd_plus: *mut f64,
    qd_plus_length: usize,
) -> Status {
    call!(
        carom_session_event_velocities,
        |shared session, output qd_minus [qd_minus_length], output qd_plus [qd_plus_length]| {
            let (found, _) = session.event(index)?;
            has_length("qd_minus", qd_minus, found.qd_minus.len(), "nv of carom_session_chain")?;
            has_length("qd_plus", qd_plus, found.qd_plus.len(), "nv of carom_session_chain")?;
            qd_minus.copy_from_slice(&found.qd_minus);
            qd_plus.copy_from_slice(&found.qd_plus);
            Ok(())
        }
    )
}
