//! Several compliant contacts at once, each with its own force, beside rigid contacts and stops: statics, natural frequencies,
//! decay and the rigid limit against closed forms.

use carom_impact::{Damping, Energetic, HuntCrossley, KelvinVoigt};
use carom_sim::{Compliance, ContactMode, ContactRule, Holding, Scene, Simulation, Touch, Trajectory, Yielding};
use carom_testing::build::{Part, X, Z, ball, chain};
use carom_testing::scenes::{G, floor, kinds, on_floor, with_robots};
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

/// `robots/feet.urdf`: mass, inertias, half distances of the feet, height of the centre of mass over the balls, their radius.
const M: f64 = 8.0;
const IX: f64 = 0.123733333333333;
const IY: f64 = 0.183733333333333;
const A: f64 = 0.2;
const B: f64 = 0.15;
const H: f64 = 0.1;
const R: f64 = 0.02;

const LINEAR: &str = "restitution = 1\ncompliance = { stiffness = 1e5, exponent = 1 }";
const HALF_SPACE: &str = "shape = { halfspace = { point = [0, 0, 0], normal = [0, 0, 1] } }";

fn scene(text: &str) -> Scene {
    with_robots(text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The block on its feet over a floor, with these keys of `[contact]` and these pairs.
fn feet(contact: &str, pairs: &str) -> Simulation {
    let text = format!(
        "[robot]\nurdf = \"feet.urdf\"\nfloating = true\nq = [0, 0, 1, 0, 0, 0, 1]\ntip = \"block\"\n[[surface]]\nname = \"floor\"\n{HALF_SPACE}\n\
         [contact]\n{contact}\n{pairs}\n[run]\nduration = 1\ngravity = [0, 0, -{G}]\ntolerance = 1e-11\n"
    );
    scene(&text).simulation
}

fn pair(link: &str, keys: &str) -> String {
    format!("[[contact.pair]]\nlink = \"{link}\"\n{keys}\n")
}

/// q of the block at a height over the position in which unloaded feet touch, with small roll and pitch.
fn lifted(height: f64, roll: f64, pitch: f64) -> Vec<f64> {
    let (x, y) = (0.5 * roll, 0.5 * pitch);
    vec![0.0, 0.0, H + R + height, x, y, 0.0, (1.0 - x * x - y * y).sqrt()]
}

/// Height, roll and pitch of a small displacement.
fn seen(run: &Trajectory, sim: &Simulation, time: f64) -> [f64; 3] {
    let q = run.at(&sim.chain, time).q;
    [q[2] - H - R, 2.0 * q[3], 2.0 * q[4]]
}

/// On four equal springs the block sinks by m g/(4 k), and each carries a quarter of its weight; with two stiffer feet on a
/// diagonal it sinks by m g/Σk, and the feet carry shares in the ratio of their stiffness.
#[test]
fn a_block_on_four_feet_sinks_by_its_weight_over_the_sum_of_stiffnesses() {
    let stiffer = "compliance = { stiffness = 3e5, exponent = 1 }";
    let diagonal = pair("front_left", stiffer) + &pair("rear_right", stiffer);
    for (pairs, stiffness) in [("", [1e5; 4]), (&diagonal, [3e5, 1e5, 1e5, 3e5])] {
        let sim = feet(LINEAR, pairs);
        let depth = M * G / stiffness.iter().sum::<f64>();
        let run = sim.run(&lifted(-depth, 0.0, 0.0), &[0.0; 6], 1.0).unwrap();
        assert!(run.events.is_empty(), "{:?}", kinds(&run));
        let at = seen(&run, &sim, 1.0);
        assert!((at[0] + depth).abs() < 1e-11 && at[1].abs() < 1e-11 && at[2].abs() < 1e-11, "{at:?} {depth}");
        assert_eq!(run.summary.mode, ContactMode::Several);
        assert_eq!(run.summary.contacts.len(), 4);
        for own in &run.summary.contacts {
            let share = stiffness[own.touch] * depth;
            assert!((own.normal_force / share - 1.0).abs() < 1e-7, "foot {}: {}", own.touch, own.normal_force);
        }
    }
}

/// Heave ω² = 4k/m; pitch and roll ω² = (4k a² − m g h)/I, where gravity on the raised centre of mass takes m g h. The motion is
/// ε cos ωt, up to terms of relative size ε.
#[test]
fn heave_roll_and_pitch_on_four_feet_have_the_natural_frequencies_of_their_springs() {
    let (k, sim) = (1e5, feet(LINEAR, ""));
    let depth = M * G / (4.0 * k);
    let rates = [4.0 * k / M, (4.0 * k * B * B - M * G * H) / IX, (4.0 * k * A * A - M * G * H) / IY];
    for (mode, rate) in rates.into_iter().enumerate() {
        let (omega, size) = (rate.sqrt(), 2e-5);
        let mut start = [-depth, 0.0, 0.0];
        start[mode] += size;
        let run = sim.run(&lifted(start[0], start[1], start[2]), &[0.0; 6], 3.0 * TAU / omega).unwrap();
        assert!(run.events.is_empty(), "{:?}", kinds(&run));
        for k in 0..=36 {
            let time = f64::from(k) * TAU / omega / 12.0;
            let mut expected = [-depth, 0.0, 0.0];
            expected[mode] += size * (omega * time).cos();
            for (found, expected) in seen(&run, &sim, time).into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-4 * size, "mode {mode} at {time}: {found} {expected}");
            }
        }
    }
}

/// Two stiffer feet on a diagonal couple roll and pitch: a roll excites both modes of [Iᵪφ̈; Iᵧθ̈] = −K [φ; θ], K with the
/// off-diagonal entry −Σ k x y.
#[test]
fn stiffer_feet_on_a_diagonal_couple_roll_and_pitch() {
    let (soft, stiff) = (1e5, 1.6e5);
    let keys = format!("compliance = {{ stiffness = {stiff:e}, exponent = 1 }}");
    let sim = feet(LINEAR, &(pair("front_left", &keys) + &pair("rear_right", &keys)));
    let sum = 2.0 * (soft + stiff);
    let depth = M * G / sum;
    let raised = M * G * H;
    let own = [(sum * B * B - raised) / IX, (sum * A * A - raised) / IY];
    let coupled = -2.0 * (stiff - soft) * A * B / (IX * IY).sqrt();
    let (mean, half) = (0.5 * (own[0] + own[1]), 0.5 * (own[0] - own[1]));
    let spread = half.hypot(coupled);
    let omega = [(mean + spread).sqrt(), (mean - spread).sqrt()];
    let (s, c) = (0.5 * coupled.atan2(half)).sin_cos();
    let size = 2e-5;
    let run = sim.run(&lifted(-depth, size, 0.0), &[0.0; 6], 0.5).unwrap();
    let mut most = 0.0_f64;
    for k in 0..=200 {
        let time = 0.0025 * f64::from(k);
        let [one, two] = omega.map(|omega| (omega * time).cos());
        let roll = size * (c * c * one + s * s * two);
        let pitch = size * (IX / IY).sqrt() * c * s * (one - two);
        most = most.max(pitch.abs());
        let found = seen(&run, &sim, time);
        let off = (found[0] + depth).abs().max((found[1] - roll).abs()).max((found[2] - pitch).abs());
        assert!(off < 1e-3 * size, "at {time}: {found:?} instead of {roll} {pitch}");
    }
    assert!(most > 0.2 * size, "the modes are coupled: {most}");
}

/// The ratio of two maxima a period apart is exp(−2πζ/√(1 − ζ²)): for dashpots c = 2ζₑ√(k mₑ), where ζₑ gives the restitution to
/// the effective mass mₑ of one foot, and for Hunt & Crossley's force in the limit of small oscillations, where c = k d a, with the damping d
/// of the slowest approach that has one of its own, L/(1000 T), T = 2√(L/g).
#[test]
fn oscillations_on_four_feet_decay_by_the_logarithmic_decrement() {
    let (k, e) = (1e5, 0.9_f64);
    let depth = M * G / (4.0 * k);
    let own_mass = 1.0 / (1.0 / M + B * B / IX + A * A / IY);
    let dashpot = 2.0 * (-e.ln() / PI.hypot(e.ln())) * (k * own_mass).sqrt();
    let length = A.hypot(B).hypot(H) + R;
    let slowest = 1e-3 * 0.5 * (G * length).sqrt();
    let hunt = HuntCrossley::new(k, 1.0, 0.99).unwrap().damping(slowest) * k * depth;
    let pulling =
        format!("restitution = {e}\ncompliance = {{ stiffness = {k:e}, force = \"kelvin-voigt\", pulls = true }}");
    let crossley = format!("restitution = 0.99\ncompliance = {{ stiffness = {k:e}, exponent = 1 }}");
    for (contact, c, size) in [(pulling, dashpot, 1e-5), (crossley, hunt, 1e-8)] {
        let sim = feet(&contact, "");
        let modes = [(M, 4.0 * k, 4.0 * c), (IY, 4.0 * k * A * A - M * G * H, 4.0 * c * A * A)];
        for (which, (inertia, stiffness, damping)) in [0, 2].into_iter().zip(modes) {
            let omega = (stiffness / inertia).sqrt();
            let ratio = damping / (2.0 * (stiffness * inertia).sqrt());
            assert!(ratio > 0.01 && ratio < 0.9, "{ratio}");
            let root = (1.0 - ratio * ratio).sqrt();
            let (period, decrement) = (TAU / (omega * root), TAU * ratio / root);
            let mut start = [-depth, 0.0, 0.0];
            start[which] += size;
            let run = sim.run(&lifted(start[0], start[1], start[2]), &[0.0; 6], 2.0 * period).unwrap();
            for k in [1.0, 2.0] {
                let left = seen(&run, &sim, k * period)[which] - [-depth, 0.0, 0.0][which];
                let expected = size * (-k * decrement).exp();
                assert!((left / expected - 1.0).abs() < 2e-3, "{contact}: mode {which}, {left:e} {expected:e}");
            }
        }
    }
}

/// With rigid rear feet the block turns about them: ω² = V″/(I + m z′²) of V(θ) = m g z + ½ 2k (2a sin θ)² with
/// z = h cos θ − a sin θ; the rigid feet carry the rest of the weight.
#[test]
fn a_block_with_rigid_rear_feet_rocks_on_its_compliant_front_feet() {
    let rigid = "compliance = \"rigid\"\nrestitution = 0";
    let sim = feet(LINEAR, &(pair("rear_left", rigid) + &pair("rear_right", rigid)));
    let k = 1e5;
    let mut rest = 0.0_f64;
    for _ in 0..50 {
        rest = (M * G * (A + H * rest.tan()) / (8.0 * k * A * A)).asin();
    }
    let at = |pitch: f64| lifted(H * (pitch.cos() - 1.0) - A * pitch.sin(), 0.0, 0.0);
    let posed = |pitch: f64| {
        let (s, c) = (0.5 * pitch).sin_cos();
        let mut q = at(pitch);
        (q[4], q[6]) = (s, c);
        q
    };
    let still = sim.run(&posed(rest), &[0.0; 6], 0.2).unwrap();
    let pitch_of = |run: &Trajectory, time| 2.0 * run.at(&sim.chain, time).q[4].asin();
    assert!((pitch_of(&still, 0.2) - rest).abs() < 1e-10, "{} {rest}", pitch_of(&still, 0.2));
    let carried: f64 = still.summary.contacts.iter().map(|own| own.normal_force).sum();
    assert!((carried / (M * G) - 1.0).abs() < 1e-7 && still.summary.contacts.len() == 4, "{carried}");
    let height = -H * rest.sin() - A * rest.cos();
    let stiffness = 8.0 * k * A * A * (2.0 * rest).cos() - M * G * (H * rest.cos() - A * rest.sin());
    let omega = (stiffness / (IY + M * height * height)).sqrt();
    let size = 1e-5;
    let run = sim.run(&posed(rest + size), &[0.0; 6], 2.0 * TAU / omega).unwrap();
    assert!(kinds(&run).iter().all(|kind| *kind != "lift-off"), "{:?}", kinds(&run));
    for k in 0..=24 {
        let time = f64::from(k) * TAU / omega / 12.0;
        let (found, expected) = (pitch_of(&run, time) - rest, size * (omega * time).cos());
        assert!((found - expected).abs() < 1e-3 * size, "at {time}: {found:e} {expected:e}");
    }
}

fn soft(stiffness: f64, restitution: f64, friction: f64, tangential: Holding) -> ContactRule {
    let normal = Yielding::HuntCrossley { exponent: 1.0, damping: Damping::Exact };
    let compliance = Some(Compliance { stiffness, normal, tangential });
    ContactRule { compliance, ..ContactRule::new(Energetic { restitution, friction }) }
}

const SMOOTH: Holding = Holding::Smoothed { slip_speed: 1e-3 };

/// A ball on a slider presses on a spring until the stop of the slider reverses it with the restitution e: times and velocities
/// are those of arcs of one oscillator, before the stop and after it.
#[test]
fn a_rigid_stop_reverses_a_ball_that_presses_on_a_spring() {
    let (m, k, v, stop, e) = (2.0, 1e5, 1.0, 3e-3, 0.6);
    let ball = Part::slider("ball", "base", Z).limits(0.1 - stop, 9.0, 0.0).weighing(m, [0.01; 3]).shaped(&ball(0.1));
    let chain = chain(&[ball]);
    let touches = Touch::all(&chain, &[floor(soft(k, 1.0, 0.0, SMOOTH))], e).unwrap().touches;
    let sim = Simulation { tolerance: 1e-12, ..Simulation::new(chain, touches) };
    let run = sim.run(&[0.2], &[-v], 0.3).unwrap();
    assert_eq!(kinds(&run), ["pressing", "limit", "lift-off"]);
    let omega = (k / m).sqrt();
    let reached = (stop * omega / v).asin() / omega;
    let up = e * v * (omega * reached).cos();
    let back = (stop * omega).atan2(up) / omega;
    let [presses, hits, leaves] = run.events.as_slice() else { panic!() };
    assert!((hits.time - presses.time - reached).abs() < 1e-10, "{} {reached}", hits.time - presses.time);
    assert!((hits.qd_plus[0] - up).abs() < 1e-9, "{} {up}", hits.qd_plus[0]);
    assert!((leaves.time - hits.time - back).abs() < 1e-10, "{} {back}", leaves.time - hits.time);
    assert!((leaves.qd_plus[0] - up.hypot(stop * omega)).abs() < 1e-9, "{}", leaves.qd_plus[0]);
}

/// On a slope three compliant feet and a rigid one carry a block, each with its own force, friction and bristle: the feet with
/// bristles share the load along the slope in the ratio of their stiffness, and it comes to rest at m g sin θ/Σkₜ. The smoothed
/// and the frictionless foot bear none of it.
#[test]
fn feet_with_their_own_bristles_share_the_load_along_a_slope() {
    let (m, tangent, depth) = (8.0, 0.1_f64, 1e-4);
    let foot =
        |name: &str, x: f64, z: f64| Part::new(name, "block", "fixed", Z, [x, 0.0, z]).massless().shaped(&ball(0.02));
    let parts = [
        Part::slider("carriage", "base", X).massless(),
        Part::slider("block", "carriage", Z).weighing(m, [0.1; 3]),
        foot("a", 0.0, 0.0),
        foot("b", 0.1, 0.0),
        foot("c", 0.2, 0.0),
        foot("d", 0.3, depth),
    ];
    let bristle = |stiffness: f64| Holding::Bristle { stiffness, damping: stiffness / 80.0 };
    let voigt = |rule: ContactRule| {
        let normal = Yielding::KelvinVoigt { pulls: false };
        ContactRule { compliance: rule.compliance.map(|own| Compliance { normal, ..own }), ..rule }
    };
    let mut sim = on_floor(chain(&parts), ContactRule::default());
    for touch in &mut sim.touches {
        touch.contact = match touch.link() {
            Some("a") => soft(2e5, 0.5, 0.6, bristle(4e4)),
            Some("b") => voigt(soft(1e5, 0.3, 0.5, bristle(1e4))),
            Some("c") => soft(5e4, 0.5, 0.9, SMOOTH),
            _ => ContactRule::default(),
        };
    }
    let along = G * tangent / tangent.hypot(1.0);
    let gravity = Vector3::new(along, 0.0, -along / tangent);
    let sim = Simulation { gravity, tolerance: 1e-10, ..sim };
    let run = sim.run(&[0.0, 0.02 - depth], &[0.0, 0.0], 3.0).unwrap();
    let end = &run.summary.last;
    let expected = m * along / 5e4;
    assert!((end.q[0] / expected - 1.0).abs() < 1e-6, "{:?} {expected}, {:?}", end, kinds(&run));
    let of = |link: &str| {
        let own = run.summary.contacts.iter().find(|own| sim.touches[own.touch].link() == Some(link)).unwrap();
        (own.force.x, own.normal_force)
    };
    assert!((of("a").0 / of("b").0 - 4.0).abs() < 1e-5, "{:?} {:?}", of("a"), of("b"));
    assert!(of("c").0.abs() < 1e-4 && of("d").0 == 0.0, "{:?} {:?}", of("c"), of("d"));
    for (link, force) in [("a", 20.0), ("b", 10.0), ("c", 5.0), ("d", m * along / tangent - 35.0)] {
        assert!((of(link).1 / force - 1.0).abs() < 1e-5, "{link}: {:?} {force}", of(link));
    }
}

/// Four feet of 1e9 N/m with strong damping: the block comes to rest at the static depth. The fastest rate of the damping is
/// 4c/m; the run takes fewer steps than the explicit method needs for its stability (rate · duration / 6).
#[test]
fn stiff_feet_come_to_rest_by_the_implicit_integrator() {
    let (k, duration) = (1e9, 10.0);
    for force in ["force = \"kelvin-voigt\"", "exponent = 1"] {
        let sim = feet(&format!("restitution = 0.2\ncompliance = {{ stiffness = {k:e}, {force} }}"), "");
        let sim = Simulation { tolerance: 1e-9, ..sim };
        let run = sim.run(&lifted(0.001, 0.0, 0.0), &[0.0; 6], duration).unwrap();
        let depth = M * G / (4.0 * k);
        let at = seen(&run, &sim, duration)[0];
        assert!((at + depth).abs() < 1e-3 * depth, "{force}: {at:e} {depth:e}");
        let rate = (4.0 * k / M).sqrt();
        let steps = run.summary.statistics.steps;
        assert!((steps as f64) < 0.3 * rate * duration / 6.0, "{force}: {steps} steps");
        assert!(run.summary.energy.error().abs() < 1e-6, "{force}: {:?}", run.summary.energy);
    }
}

/// A flat fall on four elastic feet. They touch for (2/ω)(π − atan(vω/g)), ω² = 4k/m. As k grows the state after it goes to that
/// of rigid feet, which symmetry makes unique: the motion is late by the duration, so the position differs by
/// |ẋ| π/ω ∝ k^(−1/2).
#[test]
fn a_flat_fall_on_elastic_feet_goes_to_the_rigid_rebound_as_the_root_of_the_stiffness() {
    let (drop, end) = (0.05, 0.15);
    let rigid = feet("restitution = 1", "");
    let rigid = rigid.run(&lifted(drop, 0.0, 0.0), &[0.0; 6], end).unwrap().summary.last;
    let speed = (2.0 * G * drop).sqrt();
    let mut errors = Vec::new();
    for k in [1e7, 1e8, 1e9, 1e10] {
        let sim = feet(&format!("restitution = 1\ncompliance = {{ stiffness = {k:e}, exponent = 1 }}"), "");
        let run = sim.run(&lifted(drop, 0.0, 0.0), &[0.0; 6], end).unwrap();
        let when = |kind: &str| run.events.iter().find(|event| event.kind.name() == kind).unwrap().time;
        let omega = (4.0 * k / M).sqrt();
        let lasts = 2.0 / omega * (PI - (speed * omega / G).atan());
        assert!(((when("lift-off") - when("pressing")) / lasts - 1.0).abs() < 1e-7, "{k:e}");
        errors.push((omega, (run.summary.last.q[2] - rigid.q[2]).abs()));
    }
    for pair in errors.windows(2) {
        let order = (pair[0].1 / pair[1].1).log10();
        assert!((order - 0.5).abs() < 0.01, "order {order}: {errors:?}");
    }
    let (omega, error) = errors[3];
    assert!((error * omega / (PI * rigid.qd[2].abs()) - 1.0).abs() < 1e-2, "{error:e}");
}

/// A pair replaces what its surface gives, and a surface what `[contact]` gives: the whole table, not single keys of it.
#[test]
fn compliance_of_a_pair_replaces_that_of_its_surface_and_of_the_scene() {
    let text = |contact: &str, surface: &str, pairs: &str| {
        format!(
            "[robot]\nurdf = \"feet.urdf\"\nfloating = true\nq = [0, 0, 1, 0, 0, 0, 1]\ntip = \"block\"\n[[surface]]\nname = \"floor\"\n{HALF_SPACE}\n\
             {surface}\n[contact]\nrestitution = 0.5\n{contact}\n{pairs}\n[run]\nduration = 1\n"
        )
    };
    let stiffness = |contact, surface, pairs| {
        let touches = scene(&text(contact, surface, pairs)).simulation.touches;
        touches.iter().map(|touch| touch.contact.compliance.map(|own| own.stiffness)).collect::<Vec<_>>()
    };
    let soft = "compliance = { stiffness = 1, slip_speed = 0.5 }";
    assert_eq!(stiffness(soft, "", ""), [Some(1.0); 4]);
    let on = "contact = { compliance = { stiffness = 2 } }";
    assert_eq!(stiffness("", on, ""), [Some(2.0); 4]);
    assert_eq!(stiffness(soft, "contact = { compliance = \"rigid\" }", ""), [None; 4]);
    let one = pair("front_right", "surface = \"floor\"\ncompliance = { stiffness = 3 }");
    let none = pair("rear_left", "compliance = \"rigid\"");
    let mixed = [Some(2.0), Some(3.0), None, Some(2.0)];
    assert_eq!(stiffness(soft, on, &(one.clone() + &none)), mixed);
    let touches = scene(&text(soft, "", &one)).simulation.touches;
    assert_eq!(touches[0].contact.compliance.unwrap().tangential, Holding::Smoothed { slip_speed: 0.5 });
    assert_eq!(touches[1].contact.compliance.unwrap(), Compliance::new(3.0));
    let plan = scene(&text(soft, on, &(one + &none))).plan().unwrap();
    let said: Vec<&str> = plan.kept.iter().filter(|it| it.what == "compliance").map(|it| it.choice.as_str()).collect();
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].starts_with("front_left on floor; rear_right on floor: hunt-crossley 2e0 N/m^1.5"), "{said:?}");
    assert!(said[1].starts_with("front_right on floor: hunt-crossley 3e0"), "{said:?}");
    let refused = |text: String| with_robots(&text).unwrap_err().to_string();
    for (keys, why) in [
        ("compliance = \"soft\"", "expected a table such as { stiffness = 1e7 }, or \"rigid\""),
        ("compliance = { stifness = 1 }", "did you mean `stiffness`?"),
        ("compliance = { stiffness = 1 }\nrestitution = 0", "restitution"),
    ] {
        let said = refused(text("", "", &pair("front_left", keys)));
        assert!(said.contains(why), "{said}\n{why}");
    }
}

/// A pair that is made compliant touches at its nearest points; one that is made rigid is divided into corners and faces.
#[test]
fn pairs_are_divided_into_parts_where_they_are_rigid_after_all_rules() {
    let text = |contact: &str, keys: &str| {
        format!(
            "[robot]\nurdf = \"box.urdf\"\nfloating = true\nq = [0, 0, 1, 0, 0, 0, 1]\ntip = \"box\"\n[[surface]]\nname = \"table\"\nshape = {{ box = {{ \
             centre = [0, 0, -0.5], size = [1, 1, 1] }} }}\n[contact]\nrestitution = 0.5\n{contact}\n{}\n[run]\nduration = 1\n",
            pair("box", keys)
        )
    };
    let soft = "compliance = { stiffness = 1e6 }";
    let names = |contact, keys| {
        let touches = scene(&text(contact, keys)).simulation.touches;
        touches.into_iter().map(|touch| (touch.name, touch.contact)).collect::<Vec<_>>()
    };
    let (rigid, compliant) = (names("", "friction = 0"), names(soft, "friction = 0"));
    assert!(rigid.len() > 8 && compliant.len() == 1, "{} {}", rigid.len(), compliant.len());
    assert_eq!(names("", soft), compliant);
    assert_eq!(names(soft, "compliance = \"rigid\""), rigid);
}

/// Four feet with Walton & Braun's force turn from loading to unloading at one time, and all of them unload along the steeper
/// line: the block rebounds with v⁺ = e v⁻, for any stiffness.
#[test]
fn feet_that_turn_at_one_time_all_lose_their_share_of_energy() {
    let (speed, e) = (0.7, 0.3);
    for k in [1e4, 1e5, 3e5, 1e7, 1e9] {
        let law = format!("restitution = {e}\ncompliance = {{ stiffness = {k:e}, force = \"walton-braun\" }}");
        let sim = Simulation { gravity: Vector3::zeros(), ..feet(&law, "") };
        let run = sim.run(&lifted(0.01, 0.0, 0.0), &[0.0, 0.0, -speed, 0.0, 0.0, 0.0], 0.2).unwrap();
        let up = run.summary.last.qd[2];
        assert!((up / (e * speed) - 1.0).abs() < 1e-6, "{k:e}: {up}");
    }
}

/// A fast oscillation without damping is not stiff: it needs the steps of the explicit integrator for its periods, some 10 each,
/// and not those of the implicit one, some 30. Its amplitude stays.
#[test]
fn a_fast_oscillation_on_stiff_feet_is_integrated_explicitly() {
    let (k, duration) = (1e9, 0.3);
    let sim = feet(&format!("restitution = 1\ncompliance = {{ stiffness = {k:e}, exponent = 1 }}"), "");
    let sim = Simulation { tolerance: 1e-9, ..sim };
    let depth = M * G / (4.0 * k);
    let run = sim.run(&lifted(-0.9 * depth, 0.0, 0.0), &[0.0; 6], duration).unwrap();
    let periods = (4.0 * k / M).sqrt() * duration / TAU;
    let steps = run.summary.statistics.steps as f64;
    assert!(steps < 20.0 * periods, "{steps} steps for {periods} periods");
}

/// The force of a dashpot has no jump within rounding of the first touch: very stiff feet are integrated at tight tolerance too.
/// Four equal dashpots that close at one time act on a quarter of the block each.
#[test]
fn stiff_dashpots_are_integrated_at_tight_tolerance() {
    let (e, speed) = (0.3, 0.7);
    let own_mass = 1.0 / (1.0 / M + B * B / IX + A * A / IY);
    for k in [2e9, 2e10, 2e11] {
        let law = format!("restitution = {e}\ncompliance = {{ stiffness = {k:e}, force = \"kelvin-voigt\" }}");
        let one = KelvinVoigt::new(k, e).unwrap();
        let expected = one.rebound(one.damping(own_mass), M / 4.0) * speed;
        let sim = Simulation { gravity: Vector3::zeros(), tolerance: 1e-12, ..feet(&law, "") };
        for drop in [0.0123, 0.0231, 0.0377, 0.0419] {
            let run = sim.run(&lifted(drop, 0.0, 0.0), &[0.0, 0.0, -speed, 0.0, 0.0, 0.0], 0.2).unwrap();
            let up = run.summary.last.qd[2];
            assert!((up / expected - 1.0).abs() < 1e-5, "{k:e}: {up} {expected}");
        }
        // A tilted fall: two feet at a time.
        let sim = Simulation { tolerance: 1e-12, max_step: 0.14, ..feet(&law, "") };
        for size in [1.0, 1.1, 1.3, 1.7, 2.1] {
            let mut q = lifted(0.06 * size, 0.0, 0.0);
            (q[4], q[6]) = (0.05 * size).sin_cos();
            let energy = sim.run(&q, &[0.0; 6], 0.14).unwrap().summary.energy;
            assert!(energy.error().abs() < 1e-9 * energy.start && energy.resistance < 0.0, "{k:e}: {energy:?}");
        }
    }
}
