//! Mechanisms with closed loops that are struck, pushed and held.

use carom_chain::Chain;
use carom_impact::{Coefficients, ImpactProblem, Newton};
use carom_sim::{
    Compliance, ContactLaw, ContactRule, Drive, Event, EventKind, Holding, Loop, SeveralLaw, Simulation, Spring,
    Surface, Touch, Yielding,
};
use carom_testing::mechanisms::{
    Cut, FourBar, PARALLELOGRAM_INERTIA as INERTIA, Rod, ball, chain_and, closure, parallelogram, pin, turned,
};
use carom_testing::scenes::{G, half_space, surface};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

const BAR: FourBar = FourBar { crank: 0.3, coupler: 0.9, rocker: 0.8, ground: 0.7 };

fn coefficients(restitution: f64, friction: f64) -> Coefficients {
    Coefficients { restitution, friction, ..Coefficients::default() }
}

fn wall(point: Vector3<f64>, normal: Vector3<f64>, law: ContactLaw) -> Surface {
    surface("wall", half_space(point, normal), ContactRule::new(law))
}

/// Without gravity, with the contacts of the links; joint limits with this restitution.
fn simulation(chain: Chain, loops: Vec<Loop>, surfaces: &[Surface], restitution: f64) -> Simulation {
    let touches = Touch::all(&chain, surfaces, restitution).unwrap().touches;
    Simulation { loops, tolerance: 1e-11, ..Simulation::new(chain, touches) }
}

/// An independent solution of an impact in the plane: the tree's M, the rows L of the point that the loop closes and J of the
/// contact point, as dense matrices.
struct Dense {
    m: DMatrix<f64>,
    l: DMatrix<f64>,
    j: DMatrix<f64>,
}

impl Dense {
    /// Of a four-bar linkage cut at the rocker's end, for the contact at `place` of the coupler.
    fn new(chain: &Chain, q: &[f64], place: Vector3<f64>) -> Self {
        let mut workspace = chain.workspace();
        let mut kin = workspace.update(chain, q).unwrap();
        let mut m = kin.mass_matrix();
        m.fill_upper_triangle_with_lower_triangle();
        let frame = |link: &str| chain.frame(link).unwrap();
        let end = |link: &str, length: f64| chain.point(frame(link), Vector3::new(length, 0.0, 0.0));
        let l = kin.point_jacobian(end("coupler", BAR.coupler)) - kin.point_jacobian(end("rocker", BAR.rocker));
        let offset = kin.pose(frame("coupler")).inverse().point(place);
        let j = kin.point_jacobian(chain.point(frame("coupler"), offset));
        Self { m, l: l.rows(0, 2).into_owned(), j }
    }

    /// q̇⁺ from the whole system [M −Lᵀ; L 0] (q̇⁺, λ) = (M q̇⁻ + Jᵀp, 0).
    fn after(&self, qd: &DVector<f64>, impulse: &Vector3<f64>) -> DVector<f64> {
        let n = qd.len();
        let mut system = DMatrix::zeros(n + 2, n + 2);
        system.view_mut((0, 0), (n, n)).copy_from(&self.m);
        system.view_mut((0, n), (n, 2)).copy_from(&(-self.l.transpose()));
        system.view_mut((n, 0), (2, n)).copy_from(&self.l);
        let mut right = DVector::zeros(n + 2);
        right.rows_mut(0, n).copy_from(&(&self.m * qd + self.j.transpose() * impulse));
        system.lu().solve(&right).unwrap().rows(0, n).into_owned()
    }

    /// J (M⁻¹ − M⁻¹Lᵀ (L M⁻¹Lᵀ)⁻¹ L M⁻¹) Jᵀ.
    fn delassus(&self) -> Matrix3<f64> {
        let inverse = self.m.clone().try_inverse().unwrap();
        let bound = &inverse * self.l.transpose();
        let gram = (&self.l * &bound).try_inverse().unwrap();
        let reduced = &inverse - &bound * gram * bound.transpose();
        (&self.j * reduced * self.j.transpose()).fixed_view::<3, 3>(0, 0).into_owned()
    }
}

fn close(a: &[f64], b: &[f64], within: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= within * b.abs().max(1.0))
}

/// The ball on the coupler.
const ALONG: f64 = 0.6;
const RADIUS: f64 = 0.05;

/// Point and normal of a wall that the ball touches at a state, against its motion and tilted.
fn in_the_way(chain: &Chain, q: &[f64], qd: &[f64], tilt: f64) -> (Vector3<f64>, Vector3<f64>) {
    let mut workspace = chain.workspace();
    let kin = workspace.update(chain, q).unwrap();
    let centre = chain.point(chain.frame("coupler").unwrap(), Vector3::new(ALONG, 0.0, 0.0));
    let velocity = kin.point_velocity(centre, qd).unwrap();
    let normal = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), tilt) * -velocity.normalize();
    (kin.position(centre) - normal * RADIUS, normal)
}

/// A coupler strikes a wall, in the plane and in space, under three laws with friction, with and without slip: the velocities
/// after the impact are those of the dense system of the open chain with the constraint impulse of its loop, the impulse is
/// that of the law on the dense reduced matrix, and the kinetic energy changes by the work p·(u⁺ + u⁻)/2.
#[test]
fn a_struck_four_bar_is_the_open_chain_with_the_impulse_of_its_joint() {
    for (name, friction, tilt) in
        [("energetic", 0.3, 0.5), ("energetic", 0.9, -0.4), ("newton", 0.2, 0.6), ("poisson", 0.4, 0.6)]
    {
        for planar in [true, false] {
            let chain = BAR.chain(Cut::Joint, [String::new(), ball(ALONG, RADIUS), String::new()], [""; 3]);
            let [q, qd] = BAR.state(Cut::Joint, 1.2, 3.0);
            let (place, normal) = in_the_way(&chain, &q, &qd, tilt);
            let law = ContactLaw::named(name, coefficients(0.6, friction)).unwrap();
            let sim = Simulation {
                planar,
                ..simulation(chain, vec![BAR.closure(Cut::Joint, pin())], &[wall(place, normal, law.clone())], 0.0)
            };
            let [start, rates] = BAR.state(Cut::Joint, 0.9, 3.0);
            let run = sim.run(&start, &rates, 0.3).unwrap();
            let event: &Event = &run.events[0];
            let EventKind::Impact { hit, .. } = &event.kind else { panic!("{event:?}") };
            assert!(turned(event.q[0], 1.2).abs() < 1e-10, "it strikes where the wall was put: {event:?}");

            let dense = Dense::new(&sim.chain, &event.q, place);
            let minus = DVector::from_column_slice(&event.qd_minus);
            // Contact axes: along the wall, across the plane, the normal.
            let axes = Matrix3::from_columns(&[normal.cross(&Vector3::z()), Vector3::z(), normal]);
            let u = axes.transpose() * Vector3::from_column_slice((&dense.j * &minus).as_slice());
            let problem = ImpactProblem::new(axes.transpose() * dense.delassus() * axes, u).unwrap();
            let impulse = axes * law.resolve(&problem).unwrap().impulse;
            assert!(close(hit.impulse.as_slice(), impulse.as_slice(), 1e-12), "{name}: {} {impulse}", hit.impulse);
            assert!(hit.impulse.cross(&normal).norm() > 0.01 * hit.impulse.norm(), "friction acts");
            let plus = dense.after(&minus, &hit.impulse);
            assert!(close(&event.qd_plus, plus.as_slice(), 1e-12), "{name}: {event:?} {plus}");
            // The loop stays closed.
            let gone = &dense.l * DVector::from_column_slice(&event.qd_plus);
            assert!(gone.amax() < 1e-13, "{gone}");
            let kinetic = |qd: &DVector<f64>| 0.5 * qd.dot(&(&dense.m * qd));
            let work = 0.5 * hit.impulse.dot(&Vector3::from_column_slice((&dense.j * (&plus + &minus)).as_slice()));
            let change = kinetic(&plus) - kinetic(&minus);
            assert!((change - work).abs() < 1e-12 && change < 0.0, "{change} {work}");
            assert!((hit.energy_after - hit.energy_before - change).abs() < 1e-12, "{hit:?}");
            // The balance of the run has the loss.
            let books = run.summary.energy;
            assert!(books.error().abs() < 1e-9, "{books:?}");
        }
    }
}

/// A stop in any joint of a mechanism with one degree of freedom reverses all of its velocities by e.
#[test]
fn a_stop_of_one_joint_reverses_a_whole_linkage() {
    let e = 0.7;
    for joint in [0, 1, 2] {
        let [at, _] = BAR.state(Cut::Joint, 1.4, 1.0);
        let [start, rates] = BAR.state(Cut::Joint, 1.2, 2.0);
        // A stop on the side to which the joint moves.
        let (lower, upper) = if rates[joint] > 0.0 { (-20.0, at[joint]) } else { (at[joint], 20.0) };
        let limit = format!(r#"<limit lower="{lower}" upper="{upper}" effort="0" velocity="0"/>"#);
        let mut joints = [""; 3];
        joints[joint] = &limit;
        let chain = BAR.chain(Cut::Joint, Default::default(), joints);
        let sim = simulation(chain, vec![BAR.closure(Cut::Joint, pin())], &[], e);
        let run = sim.run(&start, &rates, 0.15).unwrap();
        let [event] = &run.events[..] else { panic!("{:?}", run.events) };
        assert!(matches!(event.kind, EventKind::Limit { .. }), "{event:?}");
        assert!((event.q[0] - 1.4).abs() < 1e-11);
        let wanted: Vec<f64> = event.qd_minus.iter().map(|v| -e * v).collect();
        assert!(close(&event.qd_plus, &wanted, 1e-12), "{event:?}");
    }
}

/// Both ends of a level coupler strike a floor at once. The mechanism has one degree of freedom: Newton's law reverses it by e
/// whatever the shares of the two contacts are.
#[test]
fn a_level_coupler_lands_on_two_points() {
    let e = 0.4;
    let (chain, loops) = parallelogram(ball(0.1, 0.05) + &ball(0.7, 0.05), "");
    let floor = wall(Vector3::new(0.0, 0.5, 0.0), Vector3::y(), Newton { restitution: e, friction: 0.0 }.into());
    let sim = simulation(chain, loops, &[floor], 0.0);
    let (start, rate) = (1.3_f64, -2.0);
    let run = sim.run(&[start, -start, start], &[rate, -rate, rate], 0.6).unwrap();
    let event = &run.events[0];
    assert!(matches!(&event.kind, EventKind::Several { touches, .. } if touches.len() == 2), "{event:?}");
    // sin θ = 0.55, at a constant rate.
    assert!((event.time - (start - 0.55_f64.asin()) / -rate).abs() < 1e-10, "{event:?}");
    let wanted: Vec<f64> = event.qd_minus.iter().map(|v| -e * v).collect();
    assert!(close(&event.qd_plus, &wanted, 1e-11), "{event:?}");
    // The sum of the impulses, by the inertia about the ground: Σp cos θ = I Δθ̇.
    let sum: f64 = event.impulses.iter().map(|one| one.impulse.y).sum();
    assert!((sum * 0.55_f64.asin().cos() - INERTIA * (event.qd_plus[0] - event.qd_minus[0])).abs() < 1e-10);
}

/// A coupler rests on a floor, through bounces that accumulate: by virtual work the floor carries the coupler and half of each
/// rod, 2 m g, wherever it touches.
#[test]
fn a_coupler_that_rests_loads_the_floor_with_its_share() {
    for at in [0.1, 0.8] {
        let (chain, loops) = parallelogram(ball(at, 0.05), "");
        let floor = wall(Vector3::new(0.0, 0.5, 0.0), Vector3::y(), Newton { restitution: 0.3, friction: 0.0 }.into());
        let gravity = Vector3::new(0.0, -G, 0.0);
        let sim = Simulation { gravity, ..simulation(chain, loops, &[floor], 0.0) };
        let run = sim.run(&[0.7, -0.7, 0.7], &[0.0; 3], 2.0).unwrap();
        let last = &run.summary;
        assert_eq!(run.events.last().map(|event| event.kind.name()), Some("rest"));
        let [contact] = &last.contacts[..] else { panic!("{last:?}") };
        assert!((contact.normal_force - 2.0 * G).abs() < 1e-9, "{contact:?}");
        assert!((last.last.q[0] - 0.55_f64.asin()).abs() < 1e-12, "{last:?}");
        assert_eq!(last.statistics.contact_steps, 0);
    }
}

/// A slider-crank whose slider rests on a stop: by virtual work the stop carries |dV/dx|.
#[test]
fn the_slider_of_a_slider_crank_rests_on_a_stop() {
    let (a, b, angle) = (0.4, 1.0, 0.8_f64);
    let place = |angle: f64| a * angle.cos() + (b * b - (a * angle.sin()).powi(2)).sqrt();
    let slider = r#"<link name="slider"><inertial><mass value="0.7"/>
        <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
        <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
        <joint name="rail" type="prismatic"><parent link="ground"/><child link="slider"/><axis xyz="1 0 0"/>
        <limit lower="-9" upper="9" effort="0" velocity="0"/></joint>"#;
    let rods = [Rod::new("crank", "ground", 0.0, a), Rod::new("rod", "crank", a, b)];
    let rod_angle = -(a * angle.sin() / b).asin();
    for planar in [true, false] {
        let chain = chain_and(&rods, slider);
        let stop = wall(
            Vector3::new(place(angle) + 0.1, 0.0, 0.0),
            -Vector3::x(),
            Newton { restitution: 0.0, friction: 0.4 }.into(),
        );
        let loops = vec![closure(pin(), ("rod", b), (Some("slider"), 0.0))];
        let gravity = Vector3::new(0.0, -G, 0.0);
        let sim = Simulation { gravity, planar, ..simulation(chain, loops, &[stop], 0.0) };
        let run = sim.run(&[angle, rod_angle - angle, place(angle)], &[0.0; 3], 0.2).unwrap();
        // The crank's weight at a/2, the rod's at its middle, which is a/2 sin θ high as well.
        let weight = (0.5 * a + 0.5 * a) * G * angle.cos();
        let step = 1e-6;
        let slope = (place(angle + step) - place(angle - step)) / (2.0 * step);
        let [contact] = &run.summary.contacts[..] else { panic!("{:?}", run.summary) };
        // The difference quotient has an error of 1e-10.
        assert!((contact.normal_force + weight / slope).abs() < 1e-8, "{contact:?} {}", weight / slope);
        assert!(contact.force.y.abs() < 1e-9, "the rail carries the slider");
    }
}

/// Dry friction in one joint of a parallelogram: θ̈ = −τ/I, it stops at θ̇² I/(2τ), and it holds what is below τ.
#[test]
fn dry_friction_of_one_joint_stops_a_linkage() {
    let (torque, rate) = (0.8, 0.9_f64);
    let (chain, loops) = parallelogram(String::new(), r#"<dynamics friction="0.8"/>"#);
    let mut sim = simulation(chain, loops, &[], 0.0);
    let run = sim.run(&[0.5, -0.5, 0.5], &[rate, -rate, rate], 2.5).unwrap();
    let [stop] = &run.events[..] else { panic!("{:?}", run.events) };
    assert!(matches!(&stop.kind, EventKind::Joint { joint, holds: true } if joint == "j_left"), "{stop:?}");
    assert!((stop.time - rate * INERTIA / torque).abs() < 1e-9, "{stop:?}");
    assert!((stop.q[0] - 0.5 - rate * rate * INERTIA / (2.0 * torque)).abs() < 1e-9, "{stop:?}");
    assert!(run.summary.last.qd.iter().all(|v| v.abs() < 1e-12), "{:?}", run.summary.last);
    assert!(run.summary.energy.error().abs() < 1e-9);
    // The torque of the weight 2 g cos θ, by a torque of the motor of the other rod: held up to τ, beyond with (T − τ)/I.
    for (push, moves) in [(0.75, false), (0.95, true)] {
        sim.drive = Drive::Constant(vec![0.0, 0.0, push]);
        let last = sim.run(&[0.5, -0.5, 0.5], &[0.0; 3], 1.0).unwrap().summary.last;
        let wanted = if moves { 0.5 + (push - torque) / INERTIA / 2.0 } else { 0.5 };
        assert!((last.q[0] - wanted).abs() < 1e-10, "{last:?} {wanted}");
    }
}

/// Springs, dampers and PD control in a parallelogram without gravity: damped oscillation with I = 5/3.
#[test]
fn springs_and_controllers_of_a_parallelogram_make_an_oscillator() {
    let (k, d, rest) = (30.0, 1.7, 1.2);
    let (chain, loops) = parallelogram(String::new(), "");
    let free = simulation(chain, loops, &[], 0.0);
    let spring =
        |joint: &str, share: f64, rest| Spring { joint: joint.into(), rest, stiffness: share * k, damping: share * d };
    let springs = vec![spring("j_left", 0.3, rest), spring("j_coupler", 0.5, -rest), spring("j_right", 0.2, rest)];
    let with_springs = Simulation { springs, ..free.clone() };
    let gains = |g: f64| vec![0.3 * g, 0.5 * g, 0.2 * g].into();
    let pd = Drive::Pd(carom_sim::Pd { kp: gains(k), kd: gains(d), target: vec![rest, -rest, rest] });
    let with_motors = Simulation { drive: pd, ..free };
    let (decay, start, time) = (d / (2.0 * INERTIA), 0.9, 1.5);
    let w = (k / INERTIA - decay * decay).sqrt();
    let x = (start - rest) * (-decay * time).exp() * ((w * time).cos() + decay / w * (w * time).sin());
    for sim in [with_springs, with_motors] {
        let run = sim.run(&[start, -start, start], &[0.0; 3], time).unwrap();
        assert!((run.summary.last.q[0] - rest - x).abs() < 1e-9, "{:?} {x}", run.summary.last);
        assert!(run.summary.energy.error().abs() < 1e-8);
    }
}

/// Time steps converge to the event-driven answer with first order, also after an impact that the whole linkage feels.
#[test]
fn time_steps_of_a_linkage_converge_with_first_order() {
    let (chain, loops) = parallelogram(ball(0.5, 0.05), "");
    let floor = wall(Vector3::new(0.0, 0.5, 0.0), Vector3::y(), Newton { restitution: 0.5, friction: 0.3 }.into());
    let gravity = Vector3::new(0.0, -G, 0.0);
    let exact = Simulation { gravity, ..simulation(chain, loops, &[floor], 0.0) };
    let (q, qd) = ([1.3, -1.3, 1.3], [-0.5, 0.5, -0.5]);
    for (time, impacts) in [(0.3, 0), (0.6, 1)] {
        let wanted = exact.run(&q, &qd, time).unwrap();
        assert_eq!(wanted.events.len(), impacts, "{:?}", wanted.events);
        let errors: Vec<f64> = [4e-3, 2e-3, 1e-3, 5e-4]
            .iter()
            .map(|&contact_step| {
                let sim = Simulation { stepping: true, contact_step, ..exact.clone() };
                let last = sim.run(&q, &qd, time).unwrap().summary.last;
                // The loop is closed after every step.
                assert!(turned(last.q[0], last.q[2]).abs() < 1e-11, "{last:?}");
                (last.q[0] - wanted.summary.last.q[0]).abs()
            })
            .collect();
        if impacts == 0 {
            let orders: Vec<f64> = errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect();
            assert!(orders.iter().all(|order| *order > 0.9), "{errors:?}");
        }
        // The time of the impact is that of a step, at some rad/s: up to 5 rad/s times the step.
        assert!(errors.iter().zip([4e-3, 2e-3, 1e-3, 5e-4]).all(|(error, step)| *error < 6.0 * step), "{errors:?}");
    }
}

/// A compliant stop feels the mass of the whole linkage: with I about θ and the contact point at l cos θ, m = I/(l cos θ)². A
/// spring k with the damping that gives the restitution e for this mass is an oscillator with ζ = −ln e/√(π² + ln² e): it
/// separates after half a period, with e times the speed, as long as θ hardly changes.
#[test]
fn a_compliant_stop_feels_the_mass_of_the_linkage() {
    let (chain, loops) = parallelogram(ball(0.3, 0.05), "");
    let (stiffness, angle, e) = (1e7, 0.55_f64.asin(), 0.6_f64);
    let mut floor = wall(Vector3::new(0.0, 0.5, 0.0), Vector3::y(), Newton { restitution: e, friction: 0.0 }.into());
    let normal = Yielding::KelvinVoigt { pulls: true };
    floor.contact.compliance =
        Some(Compliance { stiffness, normal, tangential: Holding::Smoothed { slip_speed: 1e-3 } });
    let sim = simulation(chain, loops, &[floor], 0.0);
    let rate = -1.0;
    let run = sim.run(&[angle + 0.1, -angle - 0.1, angle + 0.1], &[rate, -rate, rate], 0.15).unwrap();
    let [begins, ends] = &run.events[..] else { panic!("{:?}", run.events) };
    assert!((begins.time - 0.1).abs() < 1e-10);
    let share = e.ln() / std::f64::consts::PI.hypot(e.ln());
    let mass = INERTIA / angle.cos().powi(2);
    let half = std::f64::consts::PI * (mass / stiffness / (1.0 - share * share)).sqrt();
    // The penetration turns θ by 4e-4, and that changes cos θ by as much.
    assert!(((ends.time - begins.time) / half - 1.0).abs() < 1e-3, "{} {half}", ends.time - begins.time);
    assert!((ends.qd_plus[0] + e * rate).abs() < 1e-3, "{ends:?}");
}

/// The law of several contacts does not matter where only one contact strikes beside a loop.
#[test]
fn loops_are_not_contacts() {
    let chain = BAR.chain(Cut::Joint, [String::new(), ball(ALONG, RADIUS), String::new()], [""; 3]);
    let [q, qd] = BAR.state(Cut::Joint, 1.2, 3.0);
    let (place, normal) = in_the_way(&chain, &q, &qd, 0.3);
    let [start, rates] = BAR.state(Cut::Joint, 0.9, 3.0);
    let law: ContactLaw = Newton { restitution: 0.5, friction: 0.2 }.into();
    let ends: Vec<_> = [SeveralLaw::Moreau, SeveralLaw::Poisson]
        .into_iter()
        .map(|several| {
            let wall = wall(place, normal, law.clone());
            let sim = simulation(chain.clone(), vec![BAR.closure(Cut::Joint, pin())], &[wall], 0.0);
            let run = Simulation { several, ..sim }.run(&start, &rates, 0.6).unwrap();
            assert!(run.events.iter().any(|event| event.kind.name() == "impact"), "{:?}", run.events.len());
            run.summary.last
        })
        .collect();
    assert_eq!(ends[0], ends[1]);
}
