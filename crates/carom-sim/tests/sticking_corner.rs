//! A cube whose lowest corner sticks to the floor: the energy and the angular momentum about the vertical through the corner
//! are conserved. The Delassus matrix at the corner of a cube has a double eigenvalue, for which some solvers fail.

use carom_chain::Chain;
use carom_contact::Obstacle;
use carom_impact::Energetic;
use carom_sim::{ContactMode, ContactRule, Moment, Sampling, Seen, Simulation, Surface, Touch};
use carom_testing::build::{O, brick, free, shape};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

const MASS: f64 = 0.4;
/// Half a side, m.
const HALF: f64 = 0.05;
/// Of a solid cube about its centre, m (2 h)²/6, kg m².
const INERTIA: f64 = MASS * 4.0 * HALF * HALF / 6.0;

fn cube() -> Chain {
    free(MASS, [INERTIA; 3], &shape(&brick([2.0 * HALF; 3]), O, O))
}

/// Energy, and angular momentum about the vertical through `corner`.
fn conserved(moment: &Moment, corner: &Vector3<f64>) -> [f64; 2] {
    let (q, qd) = (&moment.q, &moment.qd);
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[6], q[3], q[4], q[5]));
    let centre = Vector3::new(q[0], q[1], q[2]);
    let velocity = turn * Vector3::new(qd[0], qd[1], qd[2]);
    let rotation = turn * Vector3::new(qd[3], qd[4], qd[5]);
    let energy = MASS * (9.81 * centre.z + velocity.norm_squared() / 2.0) + INERTIA * rotation.norm_squared() / 2.0;
    let momentum = MASS * (centre - corner).cross(&velocity) + INERTIA * rotation;
    [energy, momentum.z]
}

#[test]
fn a_cube_on_a_sticking_corner_conserves_energy_and_momentum_in_few_steps() {
    let chain = cube();
    let floor = Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap();
    let contact = ContactRule::new(Energetic { restitution: 0.0, friction: 5.0 });
    let floor = Surface { name: "floor".into(), obstacle: floor, contact, motion: None };
    let touches = Touch::all(&chain, &[floor], 0.0).unwrap().touches;
    let tolerance = 1e-9;
    let simulation =
        Simulation { gravity: Vector3::new(0.0, 0.0, -9.81), tolerance, ..Simulation::new(chain.clone(), touches) };
    let mut rng = fastrand::Rng::with_seed(1);
    let (mut stuck, mut longest) = (0, 0);
    for _ in 0..30 {
        let mut wide = |size: f64| size * (2.0 * rng.f64() - 1.0);
        let turn = UnitQuaternion::from_euler_angles(wide(3.0), wide(1.5), wide(3.0));
        let mut q = vec![0.0, 0.0, 0.0, turn.i, turn.j, turn.k, turn.w];
        q[2] = 1e-4 - simulation.smallest_gap(&q).unwrap();
        let qd = [0.0, 0.0, 0.0, wide(3.0), wide(3.0), wide(3.0)];
        let (mut moments, mut latest) = (Vec::new(), 0.0);
        let sampling = Sampling { every: Some(0.01), ..Sampling::default() };
        let summary = simulation
            .stream(&q, &qd, 0.06, sampling, &mut |seen| match seen {
                Seen::Moment(moment) => moments.push(moment.clone()),
                Seen::Event(event) => latest = event.time,
                Seen::Contacts(..) | Seen::Motors(..) | Seen::Segment(_) => {}
            })
            .unwrap();
        // The cube falls from 0.1 mm and sticks to the end. Starts after which it slips or a second corner touches are not
        // used; `stuck` counts the others.
        let (true, ContactMode::Sticking { .. }) = (latest < 0.02, summary.mode) else { continue };
        stuck += 1;
        longest = longest.max(summary.statistics.steps);
        // The corner that is lowest at the end has been in contact since the impact.
        let last = &summary.last;
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(last.q[6], last.q[3], last.q[4], last.q[5]));
        let signs = |k: usize| Vector3::from_fn(|i, _| if k >> i & 1 == 0 { HALF } else { -HALF });
        let corners = (0..8).map(|k| turn * signs(k)).min_by(|a, b| a.z.total_cmp(&b.z));
        let corner = Vector3::new(last.q[0], last.q[1], last.q[2]) + corners.unwrap();
        assert!(corner.z.abs() < 1e-12, "{corner}");
        let truth = conserved(last, &corner);
        assert_eq!(moments.len(), 7);
        for moment in &moments[2..] {
            let now = conserved(moment, &corner);
            let size = [MASS * 9.81 * HALF, INERTIA * 3.0];
            for k in 0..2 {
                // The sum of some tens of steps, each with an error of the tolerance.
                assert!((now[k] - truth[k]).abs() < 100.0 * tolerance * size[k], "{k}: {} {}", now[k], truth[k]);
            }
        }
        let counts = &summary.statistics;
        assert!(counts.steps <= 60 && counts.rejections <= 6, "{counts:?}");
    }
    assert!(stuck >= 15, "{stuck} of 30 starts stick, in up to {longest} steps");
}
