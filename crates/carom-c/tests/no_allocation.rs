//! What is prepared allocates nothing afterwards. A program of its own, because the counter is its allocator.

#[path = "own.rs"]
#[allow(dead_code)]
mod own;

use carom_c::*;
use own::*;

fn allocations(work: impl FnOnce()) -> u64 {
    allocation_counter::measure(work).count_total
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1.0; 5]))), 1);
}

const NORMAL: [f64; 3] = [-1.0, 0.2, 0.1];

#[test]
fn a_prepared_strike_and_batch_allocate_nothing_not_even_the_first_in_a_thread() {
    for robot_name in ["planar2", "arm7", "humanoid29"] {
        for law_name in ["frictionless", "newton", "energetic", "chatterjee-ruina", "smith"] {
            for locks in [false, true] {
                let arm = robot(robot_name);
                // SAFETY: valid arguments.
                let nv = unsafe { carom_chain_nv(arm.at) };
                if locks && nv == 2 {
                    continue; // the contact of a single joint wedges
                }
                let law = law(law_name, 0.5, if law_name == "frictionless" { 0.0 } else { 0.3 });
                let first = {
                    let mut joint = std::mem::MaybeUninit::<Joint>::uninit();
                    // SAFETY: valid arguments.
                    unsafe {
                        carom_chain_joint(arm.at, 0, joint.as_mut_ptr());
                        text(joint.assume_init().name)
                    }
                };
                let strike = strike(&arm, "tip", NORMAL, locks.then_some(first.as_str()));
                let (q, qd) = states(nv, 20);
                let (q, qd) = (q.concat(), qd.concat());
                let (mut out, mut hits) = (vec![0.0; qd.len()], vec![blank(); 20]);
                let (strike, law) = (strike.at as usize, law.at as usize);
                // A new thread, in which no call has been.
                let counted = std::thread::scope(|scope| {
                    let work = || {
                        allocations(|| {
                            // SAFETY: valid arguments.
                            let single = unsafe {
                                let (q, qd, out) = (q.as_ptr(), qd.as_ptr(), out.as_mut_ptr());
                                let (strike, law) = (strike as *mut Strike, law as *const Law);
                                carom_strike_resolve(strike, law, q, nv, qd, nv, out, nv, &mut hits[0])
                            };
                            assert_eq!(single, Status::CAROM_OK, "{}", error());
                            // SAFETY: valid arguments.
                            let many = unsafe {
                                let (n, q, qd, out) = (q.len(), q.as_ptr(), qd.as_ptr(), out.as_mut_ptr());
                                let (strike, law) = (strike as *mut Strike, law as *const Law);
                                carom_strike_many(strike, law, 20, q, n, qd, n, out, n, hits.as_mut_ptr())
                            };
                            assert_eq!(many, Status::CAROM_OK, "{}", error());
                        })
                    };
                    scope.spawn(work).join().unwrap()
                });
                assert_eq!(counted, 0, "{robot_name} {law_name} {locks}");
            }
        }
    }
}

#[test]
fn dynamics_allocate_nothing_after_they_are_created() {
    for name in ["planar2", "arm7", "humanoid29"] {
        let chain = robot(name);
        // SAFETY: valid arguments.
        unsafe {
            let own = Own::new(carom_dynamics_free, |at| carom_dynamics_create(chain.at, at));
            let (nv, frame) = (carom_chain_nv(chain.at), frame(&chain, "tip"));
            let (q, qd) = states(nv, 1);
            let (q, qd, point, g) = (q[0].as_ptr(), qd[0].as_ptr(), [0.01, 0.0, 0.02], [0.0, 0.0, -9.81]);
            let (mut m, mut j, mut h, mut pose) = (vec![0.0; nv * nv], vec![0.0; 3 * nv], [0.0; 9], [0.0; 16]);
            let (mut x, mut t, mut v) = (vec![0.0; nv], 0.0, 0.0);
            let counted = allocations(|| {
                let ok = |status| assert_eq!(status, Status::CAROM_OK);
                ok(carom_mass_matrix(own.at, q, nv, m.as_mut_ptr(), nv * nv));
                ok(carom_jacobian(own.at, q, nv, frame, point.as_ptr(), j.as_mut_ptr(), 3 * nv));
                ok(carom_delassus(own.at, q, nv, frame, point.as_ptr(), h.as_mut_ptr()));
                ok(carom_pose(own.at, q, nv, frame, pose.as_mut_ptr()));
                ok(carom_inverse_dynamics(own.at, q, nv, qd, nv, qd, nv, g.as_ptr(), x.as_mut_ptr(), nv));
                ok(carom_forward_dynamics(own.at, q, nv, qd, nv, qd, nv, g.as_ptr(), x.as_mut_ptr(), nv));
                ok(carom_energies(own.at, q, nv, qd, nv, g.as_ptr(), &mut t, &mut v));
            });
            assert_eq!(counted, 0, "{name}");
        }
    }
}

#[test]
fn a_law_on_plain_numbers_allocates_nothing() {
    let h = [2.0, 0.3, -0.5, 0.3, 1.7, 0.4, -0.5, 0.4, 1.1];
    for name in ["newton", "poisson", "energetic", "whittaker", "chatterjee-ruina", "brach", "smith"] {
        let (law, mut hit) = (law(name, 0.5, 0.3), blank());
        for u in [[0.4, -0.2, -1.0], [3.0, 1.0, -0.3], [0.0, 0.0, -1.0]] {
            let counted = allocations(|| {
                // SAFETY: valid arguments.
                let status = unsafe { carom_law_resolve(law.at, h.as_ptr(), 9, u.as_ptr(), 3, &mut hit) };
                assert_eq!(status, Status::CAROM_OK);
            });
            assert_eq!(counted, 0, "{name} {u:?}");
        }
    }
}
