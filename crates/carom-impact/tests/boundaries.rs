//! Boundaries between the modes of an impact, against closed forms: which edges a problem has, the margin of each, the
//! mode beyond, and that both sides of a boundary resolve to the two modes.
//!
//! Most cases use a uniform rod at 45° (m = L = 1) that strikes obliquely, H = (2.5, -1.5; -1.5, 2.5), u⁻ = (1, -1):
//! while it slips, `dv_t/dp = -(1.5 + 2.5 μ)` and `dv_n/dp = 2.5 + 1.5 μ`; after slip has stopped it sticks from
//! `μ_stick = 0.6` on.

use crate::common::{FOLLOWING, Foreign, TURNING, close, pendulum, rough};
use carom_impact::{
    AnyLaw, Boundary, Brach, ChatterjeeRuina, Edge, ImpactError, ImpactOutcome, ImpactProblem, LAW_NAMES, Law, Mode,
    Newton, Phase, Smith, Whittaker,
};
use nalgebra::{Matrix3, SVector, matrix, vector};

const E: f64 = 0.5;

/// `|a - b|/(|a| + |b|)`.
fn apart(a: f64, b: f64) -> f64 {
    (a - b).abs() / (a.abs() + b.abs())
}

fn rod() -> ImpactProblem<f64, 2> {
    ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![1.0, -1.0]).unwrap()
}

/// The boundaries: sorted by margin, each edge at most once, margins from 0 to 1.
fn boundaries<const D: usize>(problem: &ImpactProblem<f64, D>, law: &dyn Law<f64, D>) -> Vec<Boundary> {
    let found = problem.boundaries(law).unwrap();
    assert!(found.is_sorted_by(|a, b| a.margin <= b.margin), "{found:?}");
    assert!(found.iter().all(|b| (0.0..=1.0).contains(&b.margin)), "{found:?}");
    for (k, boundary) in found.iter().enumerate() {
        assert!(found[..k].iter().all(|other| other.edge != boundary.edge), "{found:?}");
    }
    found
}

fn edges(found: &[Boundary]) -> Vec<&'static str> {
    let mut names: Vec<_> = found.iter().map(|b| b.edge.name()).collect();
    names.sort_unstable();
    names
}

#[track_caller]
fn expect(found: &[Boundary], edge: Edge, beyond: Mode, margin: f64) {
    let boundary = found.iter().find(|b| b.edge == edge).unwrap_or_else(|| panic!("{edge} is missing: {found:?}"));
    assert_eq!(boundary.beyond, beyond, "{edge}: {found:?}");
    close(edge.name(), boundary.margin, margin, 1e-12);
}

fn following(friction: f64) -> [(AnyLaw, &'static str); 3] {
    FOLLOWING.map(|name| (AnyLaw::named(name, rough(E, friction)).unwrap(), name))
}

#[test]
fn names_of_the_edges() {
    let names = [
        (Edge::NoApproach, "no-approach"),
        (Edge::NoSlip, "no-slip"),
        (Edge::StopsAtTurn, "stops-at-turn"),
        (Edge::StopsAtEnd, "stops-at-end"),
        (Edge::JustHolds, "just-holds"),
        (Edge::Jams, "jams"),
        (Edge::OnCone, "on-cone"),
        (Edge::Clipped, "clipped"),
    ];
    for (edge, name) in names {
        assert_eq!((edge.name(), edge.to_string()), (name, name.to_owned()));
        assert_eq!(format!("{edge:>14}|{edge:<14}"), format!("{name:>14}|{name:<14}"));
    }
}

/// Without friction, or without tangents, the approach is the only boundary; it is 1 for a normal impact, and a contact
/// that does not approach has none.
#[test]
fn without_friction_the_only_boundary_is_no_approach() {
    let inclined = apart(1.0, 0.0) / 2.0_f64.sqrt();
    for name in LAW_NAMES {
        let found = boundaries(&rod(), &AnyLaw::named(name, rough(E, 0.0)).unwrap());
        assert_eq!(edges(&found), ["no-approach"], "{name}");
        expect(&found, Edge::NoApproach, Mode::Open, inclined);
        let line = ImpactProblem::new(matrix![2.0], vector![-3.0]).unwrap();
        let found = boundaries(&line, &AnyLaw::named(name, rough(E, 0.4)).unwrap());
        assert_eq!(edges(&found), ["no-approach"], "{name}");
        expect(&found, Edge::NoApproach, Mode::Open, 1.0);
        for u in [vector![1.0, 0.0], vector![1.0, 0.3]] {
            let parting = ImpactProblem::new(*rod().delassus(), u).unwrap();
            assert!(boundaries(&parting, &AnyLaw::named(name, rough(E, 0.4)).unwrap()).is_empty(), "{name}");
        }
    }
    // Friction, but no law with a boundary of its own: Smith's.
    let found = boundaries(&rod(), &Smith { restitution: E, friction: 0.4 });
    assert_eq!(edges(&found), ["no-approach", "no-slip"]);
}

/// Slip stops at `p₁ = 1/(1.5 + 2.5 μ)`; while it lasts the impact would end at `P_n = 1.5 p_c`,
/// `p_c = 1/(2.5 + 1.5 μ)`. They are equal at μ = 1/9 < μ_stick: less friction lets the rod slip to the end, more makes
/// it slip back.
#[test]
fn stop_at_the_end_separates_slip_and_reverse_slip() {
    let p1 = |mu: f64| 1.0 / (1.5 + 2.5 * mu);
    let pc = |mu: f64| 1.0 / (2.5 + 1.5 * mu);
    let (mut last, threshold) = (f64::INFINITY, 1.0 / 9.0);
    for k in 1..=10 {
        let mu = threshold * f64::from(k) / 10.0 * (1.0 - 1e-9);
        for (law, name) in following(mu) {
            let hit = law.resolve(&rod()).unwrap();
            assert_eq!((hit.mode, hit.slip_end), (Mode::Slip, None), "{name} {mu}");
            let found = boundaries(&rod(), &law);
            assert_eq!(edges(&found), ["no-approach", "no-slip", "stops-at-end"], "{name} {mu}");
            expect(&found, Edge::NoApproach, Mode::Open, 0.5_f64.sqrt());
            expect(&found, Edge::NoSlip, Mode::ReverseSlip, 0.5_f64.sqrt());
            expect(&found, Edge::StopsAtEnd, Mode::ReverseSlip, apart(p1(mu), 1.5 * pc(mu)));
        }
        let margin = apart(p1(mu), 1.5 * pc(mu));
        assert!(margin < last, "falls towards the boundary: {margin} {last}");
        last = margin;
    }
    assert!(last < 1e-9);
    last = -1.0;
    for k in 0..10 {
        let mu = threshold * (1.0 + 1e-9) + 0.04 * f64::from(k);
        for (law, name) in following(mu) {
            let hit = law.resolve(&rod()).unwrap();
            assert_eq!((hit.mode, hit.slip_end), (Mode::ReverseSlip, Some(Phase::Restitution)), "{name} {mu}");
            let found = boundaries(&rod(), &law);
            let expected = ["just-holds", "no-approach", "no-slip", "stops-at-end", "stops-at-turn"];
            assert_eq!(edges(&found), expected, "{name} {mu}");
            expect(&found, Edge::NoSlip, Mode::Slip, 0.5_f64.sqrt());
            expect(&found, Edge::JustHolds, Mode::Stick, apart(mu, 0.6));
            expect(&found, Edge::StopsAtTurn, Mode::ReverseSlip, apart(p1(mu), pc(mu)));
            // The end depends on the law; Poisson's is 1.5 p_c in all modes.
            expect(&found, Edge::StopsAtEnd, Mode::Slip, apart(p1(mu), hit.impulse[1]));
            if name == "poisson" {
                expect(&found, Edge::StopsAtEnd, Mode::Slip, apart(p1(mu), 1.5 * pc(mu)));
            }
        }
        let margin = apart(p1(mu), 1.5 * pc(mu));
        assert!(margin > last, "grows behind the boundary: {margin} {last}");
        last = margin;
    }
}

/// H = (2, -0.2; -0.2, 1), μ_stick = 0.1: `p₁ = 1/(0.2 + 2 μ)` meets `1.5 p_c = 1.5/(1 + 0.2 μ)` at μ = 1/4 > μ_stick,
/// so that the contact sticks after slip has stopped: slip on one side, stick on the other.
#[test]
fn stop_at_the_end_separates_slip_and_stick() {
    let problem = ImpactProblem::new(matrix![2.0, -0.2; -0.2, 1.0], vector![1.0, -1.0]).unwrap();
    for (mu, mode, beyond) in [(0.25 - 1e-7, Mode::Slip, Mode::Stick), (0.25 + 1e-7, Mode::Stick, Mode::Slip)] {
        for (law, name) in following(mu) {
            assert_eq!(law.resolve(&problem).unwrap().mode, mode, "{name}");
            let nearest = boundaries(&problem, &law)[0];
            assert_eq!((nearest.edge, nearest.beyond), (Edge::StopsAtEnd, beyond), "{name}");
            assert!(nearest.margin > 0.0 && nearest.margin < 1e-6, "{name} {nearest:?}");
        }
    }
}

/// Slip stops exactly at the end of compression at μ = 1: in restitution below, in compression above, where the rest of
/// the compression is stick, with `dv_n/dp = det H/A = 1.6`. The mode is stick on both sides.
#[test]
fn stop_at_the_end_of_compression_separates_the_phases() {
    for mu in [0.7, 0.9, 1.0 - 1e-9, 1.0 + 1e-9, 1.1, 1.6] {
        let p1 = 1.0 / (1.5 + 2.5 * mu);
        let (phase, pc) = if mu < 1.0 {
            (Phase::Restitution, 1.0 / (2.5 + 1.5 * mu))
        } else {
            (Phase::Compression, p1 + (1.0 - (2.5 + 1.5 * mu) * p1) / 1.6)
        };
        for (law, name) in following(mu) {
            let hit = law.resolve(&rod()).unwrap();
            assert_eq!((hit.mode, hit.slip_end), (Mode::Stick, Some(phase)), "{name} {mu}");
            let found = boundaries(&rod(), &law);
            expect(&found, Edge::StopsAtTurn, Mode::Stick, apart(p1, pc));
            expect(&found, Edge::NoSlip, Mode::Stick, 0.5_f64.sqrt());
            expect(&found, Edge::JustHolds, Mode::ReverseSlip, apart(mu, 0.6));
            // A stop in compression has no boundary at the end of restitution.
            assert_eq!(found.iter().any(|b| b.edge == Edge::StopsAtEnd), mu < 1.0, "{name} {mu}");
            let on_boundary = (mu - 1.0_f64).abs() < 1e-8;
            assert_eq!(found[0].margin < 1e-8, on_boundary, "{name} {mu} {found:?}");
            assert!(!on_boundary || found[0].edge == Edge::StopsAtTurn, "{name} {mu} {found:?}");
        }
    }
}

/// Dropped vertically, the rod has no slip before: below `μ_stick = 0.6` it slips, above it sticks.
#[test]
fn without_slip_mu_stick_separates_slip_and_stick() {
    let drop = ImpactProblem::new(*rod().delassus(), vector![0.0, -1.0]).unwrap();
    for (mu, mode, beyond) in
        [(0.2, Mode::Slip, Mode::Stick), (0.59, Mode::Slip, Mode::Stick), (0.61, Mode::Stick, Mode::Slip)]
    {
        for (law, name) in following(mu) {
            assert_eq!(law.resolve(&drop).unwrap().mode, mode, "{name}");
            let found = boundaries(&drop, &law);
            assert_eq!(edges(&found), ["just-holds", "no-approach", "no-slip"], "{name}");
            expect(&found, Edge::JustHolds, beyond, apart(mu, 0.6));
            expect(&found, Edge::NoApproach, Mode::Open, 1.0);
            assert_eq!(found[0].edge, Edge::NoSlip);
            assert_eq!(found[0].margin, 0.0);
        }
    }
}

/// Slip towards `sign B` jams from `μ = C/|B|` on; slip the other way never does.
#[test]
fn jam_is_a_boundary_of_slip_towards_the_coupling_only() {
    let h = *pendulum().delassus();
    let jam = h[(1, 1)] / h[(0, 1)];
    for mu in [0.3, jam * (1.0 - 1e-9), jam * (1.0 + 1e-9), 0.9] {
        for (law, name) in following(mu) {
            let towards = ImpactProblem::new(h, vector![0.3, -0.134201]).unwrap();
            let hit = law.resolve(&towards).unwrap();
            assert_eq!(hit.flags.contains(carom_impact::Flags::JAM), mu > jam, "{name}");
            expect(&boundaries(&towards, &law), Edge::Jams, hit.mode, apart(mu, jam));
            for v_t in [0.0, -0.3] {
                let away = ImpactProblem::new(h, vector![v_t, -0.134201]).unwrap();
                assert!(!edges(&boundaries(&away, &law)).contains(&"jams"), "{name} {v_t}");
            }
        }
    }
}

/// Whittaker's law sticks from `|P_t|/P_n = 1/9` on, `P = H⁻¹ (-v_t, -(1 + e) v_n) = (-1, 9)/16`; below, the
/// margin is that of the slip after the impact relative to |u⁻|.
#[test]
fn whittaker_s_cone_separates_slip_and_stick() {
    for mu in [0.02, 0.1, 1.0 / 9.0 - 1e-9, 1.0 / 9.0 + 1e-9, 0.3, 2.0] {
        let law = Whittaker { restitution: E, friction: mu };
        let hit = law.resolve(&rod()).unwrap();
        let found = boundaries(&rod(), &law);
        assert_eq!(edges(&found), ["no-approach", "no-slip", "on-cone"]);
        if mu > 1.0 / 9.0 {
            assert_eq!(hit.mode, Mode::Stick);
            expect(&found, Edge::OnCone, Mode::Slip, apart(1.0, 9.0 * mu));
        } else {
            assert_eq!(hit.mode, Mode::Slip);
            let slip = 1.0 - (1.5 + 2.5 * mu) * 1.5 / (2.5 + 1.5 * mu);
            expect(&found, Edge::OnCone, Mode::Stick, slip / (slip + 2.0_f64.sqrt()));
        }
    }
    // Stick in space: a sphere with P_t = -u_t/3.5 and μ P_n = μ (1 + e).
    let sphere = ImpactProblem::new(Matrix3::from_diagonal(&vector![3.5, 3.5, 1.0]), vector![0.6, 0.8, -1.0]).unwrap();
    let found = boundaries(&sphere, &Whittaker { restitution: E, friction: 0.4 });
    expect(&found, Edge::OnCone, Mode::Slip, apart(1.0 / 3.5, 0.4 * 1.5));
    expect(&found, Edge::NoSlip, Mode::Stick, 0.5_f64.sqrt());
}

/// Chatterjee & Ruina's impulse with e_t = 0.2: `|P_t| = 0.25 (1 + e_t)` and `P_n = 0.4 (1 + e) - 0.15 (1 + e_t)` in
/// the cone, from μ = 5/7 on; on the cone the tangential impulse is `0.25 κ` with `κ = 0.6 μ/(0.25 + 0.15 μ)`.
#[test]
fn chatterjee_and_ruina_s_cone_limits_the_tangential_restitution() {
    for mu in [0.1, 0.5, 5.0 / 7.0 - 1e-9, 5.0 / 7.0 + 1e-9, 0.8, 3.0] {
        let law = ChatterjeeRuina { restitution: E, tangential_restitution: 0.2, friction: mu };
        let hit = law.resolve(&rod()).unwrap();
        let found = boundaries(&rod(), &law);
        assert_eq!(edges(&found), ["no-approach", "no-slip", "on-cone"]);
        let (asked, kappa) = (0.25 * 1.2, 0.6 * mu / (0.25 + 0.15 * mu));
        let margin = if mu > 5.0 / 7.0 { apart(asked, mu * 0.42) } else { apart(asked, 0.25 * kappa) };
        expect(&found, Edge::OnCone, hit.mode, margin);
    }
}

/// Brach's critical ratio of the rod is -1/9. By name the ratio has the size of the friction.
#[test]
fn brach_s_ratio_is_clipped_at_the_critical_one() {
    for ratio in [0.01, 0.1, 1.0 / 9.0 - 1e-9, 1.0 / 9.0 + 1e-9, 0.5, 4.0] {
        let named = AnyLaw::named("brach", rough(E, ratio)).unwrap();
        let given = Brach { restitution: E, impulse_ratio: -ratio };
        for law in [&named as &dyn Law<f64, 2>, &given] {
            let hit = law.resolve(&rod()).unwrap();
            assert_eq!(hit.mode, if ratio < 1.0 / 9.0 { Mode::Slip } else { Mode::Stick });
            let found = boundaries(&rod(), law);
            assert_eq!(edges(&found), ["clipped", "no-approach", "no-slip"]);
            expect(&found, Edge::Clipped, hit.mode, apart(ratio, 1.0 / 9.0));
            // Beyond it nothing changes.
            let by = rod().differentiate(law).unwrap().friction;
            assert_eq!(by.norm() > 0.1, ratio < 1.0 / 9.0, "{ratio}: {by}");
        }
    }
}

/// A solid sphere, H = diag(7/2, 7/2, 1): slip keeps its direction in space, `p₁ = |u_t|/(3.5 μ)`, `p_c = 1`,
/// `P_n = 1.5`. Slip stops at the end at μ = 2/10.5, as compression ends at μ = 2/7; `μ_stick = 0`.
#[test]
fn sphere_in_space_has_the_closed_forms_of_the_plane() {
    let sphere = ImpactProblem::new(Matrix3::from_diagonal(&vector![3.5, 3.5, 1.0]), vector![0.6, -0.8, -1.0]).unwrap();
    for mu in [0.05, 2.0 / 10.5 - 1e-9, 2.0 / 10.5 + 1e-9, 0.25, 2.0 / 7.0 + 1e-9, 0.7] {
        for name in FOLLOWING {
            let law = AnyLaw::named(name, rough(E, mu)).unwrap();
            let hit: ImpactOutcome<f64, 3> = law.resolve(&sphere).unwrap();
            let (found, p1) = (boundaries(&sphere, &law), 1.0 / (3.5 * mu));
            expect(&found, Edge::NoSlip, if p1 > 1.5 { Mode::ReverseSlip } else { Mode::Stick }, 0.5_f64.sqrt());
            if p1 > 1.5 {
                assert_eq!((hit.mode, hit.slip_end), (Mode::Slip, None), "{name} {mu}");
                assert_eq!(edges(&found), ["no-approach", "no-slip", "stops-at-end"], "{name} {mu}");
                expect(&found, Edge::StopsAtEnd, Mode::Stick, apart(p1, 1.5));
            } else {
                let early = p1 < 1.0;
                let phase = if early { Phase::Compression } else { Phase::Restitution };
                assert_eq!((hit.mode, hit.slip_end), (Mode::Stick, Some(phase)), "{name} {mu}");
                expect(&found, Edge::StopsAtTurn, Mode::Stick, apart(p1, 1.0));
                expect(&found, Edge::JustHolds, Mode::ReverseSlip, 1.0);
                assert_eq!(edges(&found).contains(&"stops-at-end"), !early, "{name} {mu}");
                if !early {
                    expect(&found, Edge::StopsAtEnd, Mode::Slip, apart(p1, 1.5));
                }
            }
        }
    }
}

/// H = 1, u⁻ = (0.75, -1), e = μ = 0.5, without rounding: slip stops exactly at the end, `p₁ = P_n = 1.5`, in the plane
/// and in space.
#[test]
fn exact_stop_at_the_end_has_margin_zero() {
    let plane = ImpactProblem::new(matrix![1.0, 0.0; 0.0, 1.0], vector![0.75, -1.0]).unwrap();
    let space = ImpactProblem::new(Matrix3::identity(), vector![0.0, 0.75, -1.0]).unwrap();
    for name in FOLLOWING {
        let law = AnyLaw::named(name, rough(E, 0.5)).unwrap();
        let hit: ImpactOutcome<f64, 3> = law.resolve(&space).unwrap();
        assert_eq!((hit.u_plus, hit.slip_end), (vector![0.0, 0.0, 0.5], None), "{name}");
        for found in [boundaries(&plane, &law), boundaries(&space, &law)] {
            assert_eq!(
                (found[0].edge, found[0].beyond, found[0].margin),
                (Edge::StopsAtEnd, Mode::Stick, 0.0),
                "{name}"
            );
        }
    }
}

/// Slip that keeps its speed (`B = μ A`) or grows has no stop to extrapolate.
#[test]
fn slip_that_does_not_decrease_has_no_boundary_at_the_end() {
    let problem = ImpactProblem::new(matrix![2.0, 1.0; 1.0, 2.0], vector![1.0, -1.0]).unwrap();
    for mu in [0.2, 0.5] {
        for (law, name) in following(mu) {
            let found = boundaries(&problem, &law);
            assert_eq!(edges(&found), ["jams", "no-approach", "no-slip"], "{name} {mu}");
            expect(&found, Edge::Jams, Mode::Slip, apart(mu, 2.0));
        }
    }
}

/// Slip that turns and does not stop: the stop is extrapolated with the rate `u·(h - μ A u)` of the slip at the end,
/// whose direction u is not the initial one.
#[test]
fn stop_of_turning_slip_is_extrapolated_from_its_end() {
    let start: SVector<f64, 3> = vector![-0.9, 0.6, -0.4];
    let problem = ImpactProblem::new(TURNING, start).unwrap();
    for friction in [0.1, 0.3] {
        for name in FOLLOWING {
            let law = AnyLaw::named(name, rough(0.6, friction)).unwrap();
            let hit: ImpactOutcome<f64, 3> = law.resolve(&problem).unwrap();
            let u = hit.u_plus.xy().normalize();
            assert!(hit.slip_end.is_none() && u.perp(&start.xy().normalize()).abs() > 1e-3, "{name} {hit:?}");
            let rate = (TURNING * vector![-friction * u.x, -friction * u.y, 1.0]).xy().dot(&u);
            assert!(rate < 0.0, "{name} {rate}");
            let stop = hit.impulse.z - hit.u_plus.xy().norm() / rate;
            expect(&boundaries(&problem, &law), Edge::StopsAtEnd, Mode::ReverseSlip, apart(stop, hit.impulse.z));
        }
    }
}

/// Slip that turns: along a line in μ the class (mode, phase of the stop) changes; at each change, found by bisection,
/// the nearest boundary has the margin 0 from both sides, names the same edge, and the modes of each other's side.
#[test]
fn turning_slip_reaches_its_boundaries_with_margin_zero() {
    let u: SVector<f64, 3> = vector![0.1, 0.15, -1.0];
    let problem = ImpactProblem::new(TURNING, u).unwrap();
    for name in FOLLOWING {
        let law = |mu: f64| AnyLaw::named(name, rough(0.6, mu)).unwrap();
        let class = |mu: f64| {
            let hit: ImpactOutcome<f64, 3> = law(mu).resolve(&problem).unwrap();
            // In space a slip that has turned by a right angle is called reverse: no boundary of the flow.
            (hit.mode == Mode::Stick, hit.slip_end)
        };
        let mut changes = Vec::new();
        for k in 1..200 {
            let (mut low, mut high) = (0.005 * f64::from(k), 0.005 * f64::from(k + 1));
            if class(low) == class(high) {
                continue;
            }
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if class(middle) == class(low) { low = middle } else { high = middle }
            }
            let [below, above] = [low, high].map(|mu| boundaries(&problem, &law(mu))[0]);
            assert_eq!(below.edge, above.edge, "{name} {low}");
            assert!(below.margin < 1e-6 && above.margin < 1e-6, "{name} {below:?} {above:?}");
            changes.push(below.edge.name());
            if below.edge == Edge::JustHolds {
                close("mu_stick", low, problem.mu_stick(), 1e-12);
                assert_eq!((below.beyond, above.beyond), (Mode::Stick, Mode::ReverseSlip));
            }
        }
        assert!(changes.len() >= 2, "{name} {changes:?}");
    }
}

#[test]
fn refusals_of_the_law_and_user_defined_laws_are_errors() {
    let refused = rod().boundaries(&Newton { restitution: 1.5, friction: 0.1 });
    assert!(matches!(refused, Err(ImpactError::Coefficient { what: "restitution", value: 1.5, .. })), "{refused:?}");
    let refused = rod().boundaries(&Foreign);
    assert!(matches!(refused, Err(ImpactError::NotDifferentiable { law: "foreign", .. })), "{refused:?}");
}
