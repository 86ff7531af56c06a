//! Whole motions with impacts while other contacts last, against quadratures, closed forms and time steps that get finer.

use carom_chain::Chain;
use carom_sim::{Drive, EventKind, Scene, Simulation, Touch};
use carom_testing::build::{Part, X, brick, chain, floating_box, in_plane};
use carom_testing::files::Folder;
use carom_testing::numeric::simpson;
use carom_testing::scenes::{G, among_planes, newton};
use nalgebra::{DVector, Vector3};

/// Zeno time of the simulations, s, that of their tolerance of 1e-11. Accumulations of two contacts in turn end by the time that one of them still needs, a fraction of
/// that of both: within ten Zeno times.
const ZENO: f64 = 1e-6; // √(0.1 · tolerance)

/// A simulation among half-spaces, each with a point and a normal, under Newton's law.
fn among(chain: Chain, planes: &[[Vector3<f64>; 2]], restitution: f64, friction: f64) -> Simulation {
    Simulation { zeno_time: ZENO, ..among_planes(chain, planes, &newton(restitution, friction)) }
}

/// Housner's rocking block from its release to rest, without any approximation of small angles. It turns about one corner with
/// I_O = 4/3 m R², so that a swing from rest at the angle θ to θ = 0 takes, with k = m g R/I_O = 3 g/(4 R),
///
/// ```text
/// T(θ) = ∫₀^θ dϑ/√(2 k (cos(α − θ) − cos(α − ϑ)))
/// ```
///
/// and ends with ω² = 2 k (cos(α − θ) − cos α). The impact on the other corner leaves r ω, r = 1 − 1.5 sin²α (G. W. Housner, Bull.
/// Seismol. Soc. Am. 53, 1963), from which the next angle follows. With ϑ = θ (1 − x²) the integrand is regular. The impacts are
/// infinitely many, and the swings take less and less time, in the end by the factor r. Tolerance of the times: 1e-12 at each step,
/// over some hundred steps, and growing with the time of a swing by that of the angle.
#[test]
fn a_rocking_block_rocks_to_rest_as_its_quadratures_say() {
    const DURATION: f64 = 6.0;
    let (radius, mut rested) = (0.5, 0);
    for alpha in [0.1_f64, 0.2, 0.3] {
        let (b, h) = (radius * alpha.sin(), radius * alpha.cos());
        let shape = format!(r#"<collision><geometry><box size="{} 0.4 {}"/></geometry></collision>"#, 2.0 * b, 2.0 * h);
        let mass = 2.0;
        let mut sim =
            among(in_plane(mass, mass * radius * radius / 3.0, &shape), &[[Vector3::zeros(), Vector3::z()]], 0.0, 5.0);
        // The corners with y > 0 move as those with y < 0.
        sim.touches = sim.touches.drain(..).enumerate().filter(|(k, _)| k & 2 == 0).map(|(_, touch)| touch).collect();
        sim.tolerance = 1e-12;
        let start = 0.7 * alpha;
        let (s, c) = start.sin_cos();
        let run = sim.run(&[s * h - c * b, c * h + s * b, start], &[0.0; 3], DURATION).unwrap();
        assert_eq!(run.summary.statistics.contact_steps, 0);

        let k = 0.75 * G / radius;
        let ratio = 1.0 - 1.5 * alpha.sin().powi(2);
        let swing = |angle: f64| {
            // cos(α − θ) − cos(α − ϑ) = 2 sin(α − θ + θx²/2) sin(θx²/2)
            let of = |x: f64| {
                let half = 0.5 * angle * x * x;
                let sine = if x == 0.0 { 0.5 * angle } else { half.sin() / (x * x) };
                2.0 * angle / (4.0 * k * (alpha - angle + half).sin() * sine).sqrt()
            };
            simpson(of, [0.0, 1.0])
        };
        let times: Vec<f64> =
            run.events.iter().filter(|it| matches!(it.kind, EventKind::Several { .. })).map(|it| it.time).collect();
        let rise = |angle: f64| 2.0 * (alpha - 0.5 * angle).sin() * (0.5 * angle).sin();
        let (mut angle, mut time) = (start, swing(start));
        let mut found = times.iter().enumerate();
        loop {
            if let Some((n, found)) = found.next() {
                // The last heights are some thousands of the rounding of positions.
                let rounding = 4.0 * f64::EPSILON / (2.0 * b * (2.0 * k * rise(angle)).sqrt());
                assert!((found - time).abs() < 1e-9 + rounding, "impact {n}: {found} for {time}, swing from {angle}");
            }
            // (r ω)²/(2 k) = r² (cos(α − θ) − cos α), by the product, so that small angles keep their digits; the next angle by Newton's
            // method on the same product.
            let next = ratio * ratio * rise(angle);
            angle = next / alpha.sin();
            for _ in 0..20 {
                angle -= (rise(angle) - next) / (alpha - angle).sin();
            }
            let last = swing(angle);
            time += 2.0 * last;
            if last < 1e-12 || time > DURATION {
                break;
            }
        }
        assert_eq!(found.next(), None, "impacts of a slenderness of {alpha}");
        if time > DURATION {
            assert!(times.len() > 5, "{} impacts", times.len());
            continue;
        }
        rested += 1;
        assert!(times.len() > 20, "{} impacts", times.len());
        let rest = run.events.iter().find(|it| it.kind.name() == "rest").map(|it| it.time);
        let rest = rest.unwrap_or_else(|| panic!("{:?}", run.events.last()));
        assert!((rest - time).abs() < 10.0 * ZENO, "at rest at {rest} for {time}");
        let end = &run.summary.last.q;
        assert!((end[1] - h).abs() < 1e-9 && end[2].abs() < 1e-9, "{end:?}");
    }
    assert!(rested > 0);
}

/// A slider of mass m₁ with a slider of mass m₂ on it along the same axis, both with stops.
fn coupled(m1: f64, m2: f64) -> Chain {
    let part =
        |name: &str, parent: &str, mass| Part::slider(name, parent, X).limits(-1.0, 0.0, 0.0).weighing(mass, [1.0; 3]);
    chain(&[part("a", "base", m1), part("b", "a", m2)])
}

/// Two sliders with M = [[m₁ + m₂, m₂], [m₂, m₂]]. The outer one is pressed against its upper stop, and the inner one runs from its
/// upper to its lower stop at −1 m with q̈ = F₂/m₂, F₂ < 0. There its stop (e = 0) gives p = −m₁ m₂/(m₁ + m₂) v, by which the outer slider
/// leaves its own stop with the common velocity −p/m₁. Both go on as one under F₁, and are back at the outer stop after
/// 2 (p/m₁)(m₁ + m₂)/F₁, with the velocity p/m₁: the outer slider stops, the inner one goes on with p/m₁ and leaves its lower stop for
/// 2 (p/m₁) m₂/|F₂|, until it strikes it again, with m₂/(m₁ + m₂) times its velocity: the impacts accumulate as a geometric
/// series. All of it is exact but for rounding.
#[test]
fn coupled_sliders_strike_their_stops_at_the_times_of_their_closed_forms() {
    let (m1, m2, f1, f2) = (3.0, 2.0, 40.0, -5.0);
    let chain = coupled(m1, m2);
    let touches = Touch::every(&chain, &[], 0.0).unwrap();
    let mut sim = Simulation { tolerance: 1e-11, zeno_time: ZENO, ..Simulation::new(chain, touches) };
    sim.drive = Drive::Constant(vec![f1, f2]);
    let run = sim.run(&[0.0, 0.0], &[0.0, 0.0], 2.5).unwrap();
    assert_eq!(run.summary.statistics.contact_steps, 0);
    let kinds: Vec<(f64, &str)> = run.events.iter().map(|it| (it.time, it.kind.name())).collect();

    let first = (2.0 * m2 / -f2).sqrt();
    let speed = -f2 / m2 * first; // of the inner slider at its stop
    let common = m2 / (m1 + m2) * speed; // p/m₁
    let back = first + 2.0 * common * (m1 + m2) / f1;
    let again = back + 2.0 * common * m2 / -f2;
    let hit = |k: usize| {
        &run.events[kinds
            .iter()
            .enumerate()
            .filter(|(_, it)| it.1 == "several")
            .nth(k)
            .unwrap_or_else(|| panic!("{kinds:?}"))
            .0]
    };
    for (k, time, after) in
        [(0, first, [-common, 0.0]), (1, back, [0.0, common]), (2, again, [-common * m2 / (m1 + m2), 0.0])]
    {
        let event = hit(k);
        assert!((event.time - time).abs() < 1e-10, "{time}: {kinds:?}");
        for (found, exact) in event.qd_plus.iter().zip(after) {
            assert!((found - exact).abs() < 1e-9, "{k}: {:?} for {after:?}", event.qd_plus);
        }
    }
    let limit = first + (again - first) / (1.0 - m2 / (m1 + m2));
    let zeno = kinds.iter().find(|it| it.1 == "zeno").unwrap_or_else(|| panic!("{kinds:?}"));
    assert!((zeno.0 - limit).abs() < 10.0 * ZENO, "{} for {limit}", zeno.0);
    assert!(
        run.summary.last.q.iter().zip([0.0, -1.0]).all(|(q, stop)| (q - stop).abs() < 1e-12),
        "{:?}",
        run.summary.last
    );
}

/// A slider-crank whose slider has a clearance between two guides (P. Flores, R. Leine, C. Glocker, Multibody Syst. Dyn. 23, 2010,
/// sizes and masses of its example): an open chain, the four corners of the slider, e = 0.4 and μ = 0.01. No closed form is known. The
/// motion does not depend on the tolerance until the time at which it is compared, and time steps approach it with their
/// order 1 as they get finer.
#[test]
fn time_steps_approach_the_motion_of_a_slider_crank_with_clearance() {
    let (l1, l2, a, b, clearance) = (0.153, 0.306, 0.05, 0.025, 0.001);
    let link = |name: &str, parent: &str, mass: f64, inertia: f64, x: f64| {
        Part::hinge(name, parent, [0.0, -1.0, 0.0]).weighing(mass, [inertia; 3]).com([x, 0.0, 0.0])
    };
    let parts = [
        link("crank", "base", 0.038, 7.4e-5, 0.5 * l1),
        link("rod", "crank", 0.038, 5.9e-4, 0.5 * l2).at([l1, 0.0, 0.0]),
        link("slider", "rod", 0.076, 2.7e-6, 0.0).at([l2, 0.0, 0.0]).shaped(&brick([2.0 * a, 1e-3, 2.0 * b])),
    ];
    let chain = chain(&parts);
    let guide = |side: f64| [Vector3::z() * side * (b + clearance), Vector3::z() * -side];
    let mut sim = among(chain, &[guide(1.0), guide(-1.0)], 0.4, 0.01);
    // Of each two corners that differ in y one is enough.
    sim.touches = sim.touches.drain(..).enumerate().filter(|(k, _)| k & 2 == 0).map(|(_, touch)| touch).collect();
    assert_eq!(sim.touches.len(), 8);
    // Absolute rates 150, −75 and 0 rad/s.
    let (q, qd, end) = ([0.0; 3], [150.0, -225.0, 75.0], 0.02);
    let at = |sim: &Simulation| DVector::from_vec(sim.run(&q, &qd, end).unwrap().summary.last.q);
    let run = sim.run(&q, &qd, end).unwrap();
    assert_eq!(run.summary.statistics.contact_steps, 0);
    let impacts = run.events.iter().filter(|it| !it.impulses.is_empty()).count();
    assert!(impacts > 5, "{impacts} impacts");
    let exact = DVector::from_vec(run.summary.last.q.clone());
    let coarse = at(&Simulation { tolerance: 1e-9, ..sim.clone() });
    assert!((&coarse - &exact).amax() < 1e-6, "{coarse} for {exact}");
    let error = |step: f64| {
        let steps = Simulation { stepping: true, contact_step: step, ..sim.clone() };
        (at(&steps) - &exact).amax()
    };
    let errors = [1e-5, 1e-6, 1e-7].map(error);
    assert!(errors[0] > 2.0 * errors[1] && errors[1] > 2.0 * errors[2] && errors[2] < 1e-3, "{errors:?}");
}

/// A box that tumbles for 10 s: the loss of each impact is that of its impulses, Σ ½ p·(u⁻ + u⁺) at the struck points, and that of the
/// kinetic energies before and after; all of them together with friction are the difference of the energies.
#[test]
fn the_losses_of_a_tumbling_box_are_the_difference_of_its_energies() {
    let chain = floating_box([0.3, 0.2, 0.15], 1.5);
    let sim = among(chain, &[[Vector3::zeros(), Vector3::z()]], 0.85, 0.25);
    let run = sim.run(&[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], &[1.0, 0.4, 2.0, 3.0, -5.0, 4.0], 10.0).unwrap();
    let energy = run.summary.energy;
    let scale = energy.start;
    let mut workspace = sim.chain.workspace();
    let (mut booked, mut impacts) = (0.0, 0);
    for event in run.events.iter().filter(|it| !it.impulses.is_empty()) {
        let mut kin = workspace.update(&sim.chain, &event.q).unwrap();
        let mass = kin.mass_matrix();
        let kinetic = |qd: &[f64]| {
            let qd = DVector::from_column_slice(qd);
            0.5 * qd.dot(&(&mass * &qd))
        };
        let lost = kinetic(&event.qd_minus) - kinetic(&event.qd_plus);
        let mut work = 0.0;
        for one in &event.impulses {
            // The velocity of a point of the box in the world: v + ω × r, both in the axes of the box.
            let velocity = |qd: &[f64]| {
                let rotation = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
                    event.q[6], event.q[3], event.q[4], event.q[5],
                ));
                let arm = rotation.inverse() * (one.point - Vector3::new(event.q[0], event.q[1], event.q[2]));
                rotation * (Vector3::new(qd[0], qd[1], qd[2]) + Vector3::new(qd[3], qd[4], qd[5]).cross(&arm))
            };
            work += 0.5 * one.impulse.dot(&(velocity(&event.qd_minus) + velocity(&event.qd_plus)));
        }
        // The impulses of Newton's law are constant in direction; both sides are products of rounded numbers of size T.
        assert!((lost + work).abs() < 1e-10 * scale, "{}: {lost} lost, work {work}", event.time);
        booked += lost;
        impacts += 1;
    }
    assert!(impacts > 20, "{impacts} impacts");
    assert!((booked - energy.impacts).abs() < 1e-9 * scale, "{booked} for {}", energy.impacts);
    let balance = energy.start - booked + energy.resistance - energy.end;
    assert!(balance.abs() < 1e-8 * scale, "{balance} J of {scale}: {energy:?}");
}

/// A rod whose foot sticks to a floor falls as one on a hinge: the motion is the same, and the integrator takes as many steps for it. Its coordinates
/// are those of its head, so that the foot moves at the velocities at which a step is evaluated.
#[test]
fn a_rod_whose_foot_sticks_takes_as_many_steps_as_one_on_a_hinge() {
    // The heights of the centre of mass and of the foot above the origin of the link.
    let link = |centre: f64, foot: f64| {
        format!(
            r#"<link name="rod"><inertial><origin xyz="0 0 {centre}"/><mass value="2"/>
               <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
               <collision><origin xyz="0 0 {foot}"/><geometry><sphere radius="1e-9"/></geometry></collision></link>"#
        )
    };
    let joint = |name: &str, kind: &str, [parent, child]: [&str; 2], axis: &str| {
        format!(
            r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>
               <limit lower="-9" upper="9" effort="0" velocity="9"/></joint>"#
        )
    };
    let robot = |parts: String| format!(r#"<robot name="r"><link name="base"/>{parts}</robot>"#);
    let hinge = |parent: &str| joint("turn", "revolute", [parent, "rod"], "0 1 0");
    let head = joint("x", "prismatic", ["base", "a"], "1 0 0") + &joint("z", "prismatic", ["a", "b"], "0 0 1");
    let foot = robot(format!(r#"<link name="a"/><link name="b"/>{}{head}{}"#, link(-0.5, -1.0), hinge("b")));
    let pinned = robot(format!("{}{}", link(0.5, 0.0), hinge("base")));
    let folder = Folder::new();
    let run = |urdf: &str, start: String, floor: &str| {
        folder.write("rod.urdf", urdf);
        let scene = format!(
            "[robot]\nurdf = \"rod.urdf\"\n{start}\n{floor}\n[run]\nduration = 0.3\ngravity = [0, 0, -9.81]\ntolerance = 1e-11\n"
        );
        Scene::from_file(folder.write("scene.toml", scene)).unwrap().plan().unwrap().run(0.3).unwrap().summary
    };
    let floor = "[[surface]]\nname = \"floor\"\nshape = { halfspace = { point = [0, 0, -1e-9], normal = [0, 0, 1] } }\n[contact]\nfriction = 5\n";
    let (angle, speed) = (0.2_f64, 0.5);
    let (s, c) = angle.sin_cos();
    let start = format!("q = [{s}, {c}, {angle}]\nqd = [{}, {}, {speed}]", speed * c, -speed * s);
    let sticks = run(&foot, start, floor);
    let hangs = run(&pinned, format!("q = [{angle}]\nqd = [{speed}]"), "");
    assert!((sticks.last.q[2] - hangs.last.q[0]).abs() < 1e-8, "{:?} {:?}", sticks.last, hangs.last);
    assert_eq!(sticks.contacts.len(), 1);
    let [sticks, hangs] = [sticks, hangs].map(|it| it.statistics.steps);
    assert!(2 * sticks <= 3 * hangs, "{sticks} steps instead of {hangs}");
}
