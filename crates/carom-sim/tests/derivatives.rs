//! Derivatives of impacts of chains, and saltation matrices.

use carom_chain::Chain;
use carom_impact::{AnyLaw, CoefficientRanges, Coefficients, Energetic, Frictionless, Law, Newton};
use carom_sim::{
    ContactRows, Impacts, Moment, Oscillation, PlaneContact, RowContact, SimError, free_motion, saltation,
};
use carom_testing::build::{Part, X, Z, of_urdf, rooted};
use carom_testing::files::{robot, robot_with};
use carom_testing::scenes::G;
use nalgebra::{DMatrix, DVector, Matrix2, Vector3};
use std::f64::consts::{PI, TAU};

fn floating(name: &str) -> Chain {
    robot_with(name, true)
}

fn close(what: &str, x: f64, expected: f64, within: f64) {
    assert!((x - expected).abs() <= within, "{what}: {x:e} instead of {expected:e}");
}

/// A random configuration with unit quaternions.
fn any_q(chain: &Chain, rng: &mut fastrand::Rng) -> Vec<f64> {
    let step: Vec<f64> = (0..chain.nv()).map(|_| 3.0 * (rng.f64() - 0.5)).collect();
    chain.integrate(&chain.zero_configuration(), &step, 1.0).unwrap()
}

fn any_v(chain: &Chain, rng: &mut fastrand::Rng) -> Vec<f64> {
    (0..chain.nv()).map(|_| rng.f64() - 0.5).collect()
}

struct Case<'a> {
    chain: &'a Chain,
    tip: &'a str,
    offset: [f64; 3],
    normal: [f64; 3],
    law: AnyLaw,
}

impl Case<'_> {
    fn hit(&self, q: &[f64], qd: &[f64], law: &dyn Law<f64, 3>) -> Option<DVector<f64>> {
        let tip = self.chain.frame(self.tip).unwrap();
        let hit = self.chain.impact(q, qd).at(tip).offset(self.offset).normal(self.normal).resolve(law).ok()?;
        Some(DVector::from_vec(hit.qd_plus))
    }

    fn approach(&self, q: &[f64], qd: &[f64]) -> f64 {
        let tip = self.chain.frame(self.tip).unwrap();
        let contact = self.chain.impact(q, qd).at(tip).offset(self.offset).normal(self.normal).contact();
        contact.map_or(0.0, |contact| contact.problem().approach_speed())
    }

    /// Compares every column with its central difference, provided that the two one-sided differences agree. Returns the
    /// number of columns compared.
    fn check(&self, q: &[f64], qd: &[f64]) -> usize {
        let tip = self.chain.frame(self.tip).unwrap();
        let strike = self.chain.impact(q, qd).at(tip).offset(self.offset).normal(self.normal);
        let found = strike.derivative(&self.law).unwrap();
        let here = DVector::from_vec(found.hit.qd_plus.clone());
        let (mut compared, nv, step) = (0, self.chain.nv(), 1e-5);
        let c = self.law.coefficients();
        let unit = |k: usize, by: f64| -> Vec<f64> { (0..nv).map(|i| if i == k { by } else { 0.0 }).collect() };
        let mut column = |what: &str, k: usize, column: DVector<f64>, at: &dyn Fn(f64) -> Option<DVector<f64>>| {
            let (Some(ahead), Some(behind)) = (at(step), at(-step)) else { return };
            let (forward, backward) = ((&ahead - &here) / step, (&here - &behind) / step);
            let size = 1.0 + forward.norm() + here.norm();
            if (&forward - &backward).norm() > 2e-3 * size {
                return; // a kink within the step
            }
            let off = (column - (forward + backward) * 0.5).norm() / size;
            assert!(
                off < 1e-5,
                "{} {:?} {what} {k}: off by {off:e} at {q:?} {qd:?} {:?}",
                self.chain.name(),
                self.law,
                self.normal
            );
            compared += 1;
        };
        for k in 0..nv {
            column("q", k, found.q.column(k).into_owned(), &|x| {
                self.hit(&self.chain.integrate(q, &unit(k, x), 1.0).unwrap(), qd, &self.law)
            });
            column("qd", k, found.qd.column(k).into_owned(), &|x| {
                let moved: Vec<f64> = qd.iter().zip(unit(k, x)).map(|(v, d)| v + d).collect();
                self.hit(q, &moved, &self.law)
            });
        }
        column("e", 0, found.restitution.clone(), &|x| {
            self.hit(q, qd, &self.law.with(Coefficients { restitution: c.restitution + x, ..c }))
        });
        column("μ", 0, found.friction.clone(), &|x| {
            self.hit(q, qd, &self.law.with(Coefficients { friction: c.friction + x, ..c }))
        });
        compared
    }
}

#[test]
fn derivatives_of_chains_equal_central_differences() {
    let box_in_flight = floating("box");
    let link = box_in_flight.frames().last().unwrap().name.clone();
    let (planar2, planar3, arm7) = (robot("planar2"), robot("planar3"), robot("arm7"));
    let mut rng = fastrand::Rng::with_seed(81);
    let cases: [(&Chain, &str, [f64; 3]); 4] = [
        (&planar2, "tip", [0.0; 3]),
        (&planar3, "tip", [0.0; 3]),
        (&arm7, "tip", [0.01, 0.02, 0.03]),
        (&box_in_flight, &link, [0.1, 0.07, -0.05]),
    ];
    let laws = ["frictionless", "energetic", "poisson", "newton", "chatterjee-ruina", "whittaker", "brach"];
    for (chain, tip, offset) in cases {
        let (mut compared, mut tried) = (0, 0);
        for k in 0..28 {
            let (q, mut qd) = (any_q(chain, &mut rng), any_v(chain, &mut rng));
            let turn = TAU * rng.f64();
            // Planar arms do not move along z.
            let normal = [turn.cos(), turn.sin(), if chain.nv() > 3 { 0.7 } else { 0.0 }];
            let restitution = 0.1 + 0.8 * rng.f64();
            let friction = 0.05 + 0.7 * rng.f64();
            let coefficients = Coefficients { restitution, friction, tangential_restitution: 0.2 };
            let law = AnyLaw::named(laws[k % laws.len()], coefficients).unwrap();
            let case = Case { chain, tip, offset, normal, law };
            if case.approach(&q, &qd) < 0.0 {
                qd.iter_mut().for_each(|v| *v = -*v);
            }
            if case.approach(&q, &qd) > 0.05 {
                compared += case.check(&q, &qd);
                tried += 2 * chain.nv() + 2;
            }
        }
        assert!(tried > 60 && compared * 4 > tried * 3, "{}: {compared} of {tried}", chain.name());
    }
}

/// Without friction in closed form: ∂qd⁺/∂e = −u_n X/(nᵀHn) and ∂qd⁺/∂qd⁻ = 1 − (1+e) X Jₙ/(nᵀHn) with X = M⁻¹Jₙᵀ. As qd⁺ is
/// linear in qd⁻, the derivative times qd⁻ is qd⁺.
#[test]
fn frictionless_derivatives_equal_their_closed_form() {
    let chain = robot("arm7");
    let tip = chain.frame("tip").unwrap();
    let (q, e) = ([0.3, -0.5, 0.7, 1.1, -0.2, 0.4, 0.9], 0.4);
    let normal = [0.36, 0.48, 0.8];
    let n = Vector3::from(normal);
    let row = chain.impact(&q, &[0.0; 7]).at(tip).normal(normal).contact().unwrap().jacobian().transpose() * n;
    let qd: Vec<f64> = row.iter().enumerate().map(|(k, j)| -j + 0.05 * k as f64).collect();
    let contact = chain.impact(&q, &qd).at(tip).normal(normal).contact().unwrap();
    let found = contact.derivative(&Frictionless { restitution: e }).unwrap();
    let x = &contact.inertia().response * n;
    let (c, approach) = (row.dot(&x), row.dot(&DVector::from_column_slice(&qd)));
    assert!(approach < 0.0);
    let map = DMatrix::identity(7, 7) - &x * row.transpose() * ((1.0 + e) / c);
    close("map", (&found.qd - &map).amax(), 0.0, 1e-12 * map.amax());
    close("e", (found.restitution - &x * (-approach / c)).amax(), 0.0, 1e-12 * x.amax() * approach.abs() / c);
    assert_eq!(found.friction.amax(), 0.0);
    let after = DVector::from_vec(found.hit.qd_plus);
    close("linear", (&found.qd * DVector::from_column_slice(&qd) - &after).amax(), 0.0, 1e-12 * after.amax());
}

/// For one frictionless contact det Ξ = e², for every chain.
#[test]
fn the_determinant_of_the_saltation_matrix_is_the_square_of_the_restitution() {
    let mut rng = fastrand::Rng::with_seed(82);
    let ball = floating("ball");
    let link = ball.frames().last().unwrap().name.clone();
    let chains = [(robot("planar2"), "tip"), (robot("planar3"), "tip"), (robot("arm7"), "tip"), (ball, &*link)];
    for (chain, tip) in chains {
        let tip = chain.frame(tip).unwrap();
        let (mut checked, mut separating, mut slow) = (0, 0, 0);
        for _ in 0..40 {
            let (q, qd) = (any_q(&chain, &mut rng), any_v(&chain, &mut rng));
            let normal = if chain.nv() <= 3 { [-0.6, 0.8, 0.0] } else { [0.6, 0.0, 0.8] };
            let e = 0.2 + 0.7 * rng.f64();
            let strike = chain.impact(&q, &qd).at(tip).normal(normal);
            let approach = strike.clone().contact().unwrap().problem().approach_speed();
            let found = strike.saltation(&Frictionless { restitution: e }, [0.0, 0.0, -G]);
            if approach <= 0.0 {
                assert!(
                    matches!(&found, Err(SimError::Setting { what: "rate of the gap", value, .. }) if *value >= 0.0),
                    "{}: {found:?}",
                    chain.name()
                );
                separating += 1;
                continue;
            }
            let found = found.unwrap();
            close("closing", found.closing, -approach, 1e-14 * approach.max(1.0));
            if approach > 0.05 {
                // The rounding error is proportional to the entries that cancel in the determinant.
                let size = found.matrix.norm().powi(2).max(1.0);
                close(chain.name(), found.matrix.determinant(), e * e, 1e-12 * size);
                checked += 1;
            } else {
                slow += 1;
            }
        }
        assert!(
            checked >= 10 && separating >= 10 && slow <= 8,
            "{}: {checked} checked, {separating} separating, {slow} slow",
            chain.name()
        );
    }
}

/// Masses of 1 kg, each on its own prismatic joint.
fn sliders(axis: [f64; 3], names: &[&str]) -> Chain {
    let part = |name: &&str| Part::slider(name, "world", axis).weighing(1.0, [0.004; 3]);
    of_urdf(&rooted("<link name='world'/>", &names.iter().map(part).collect::<Vec<_>>()))
}

/// Case B7: a ball that starts at 0.2 m with −2 m/s, e = 0.8: the derivative of the flow over 0.3 s is Φ₁ Ξ Φ₀.
#[test]
fn the_bouncing_ball_has_its_published_derivative() {
    let chain = sliders(Z, &["ball"]);
    let (y, v): (f64, f64) = (0.2, -2.0);
    let before = -(v * v + 2.0 * G * y).sqrt();
    let fall = (v - before) / G;
    let law = Newton { restitution: 0.8, friction: 0.0 };
    let qd = [before];
    let strike = chain.impact(&[0.0], &qd).at(chain.frame("ball").unwrap()).normal([0.0, 0.0, 1.0]);
    let found = strike.saltation(&law, [0.0, 0.0, -G]).unwrap();
    let by_hand = DMatrix::from_row_slice(2, 2, &[-0.8, 0.0, -1.8 * G / before, -0.8]);
    close("Ξ", (&found.matrix - by_hand).amax(), 0.0, 1e-14);
    close("closing", found.closing, before, 1e-15);
    close("later", found.time[0], -1.0 / before, 1e-15);
    let flight = |time: f64| DMatrix::from_row_slice(2, 2, &[1.0, time, 0.0, 1.0]);
    let flow = flight(0.3 - fall) * found.matrix * flight(fall);
    for (found, published) in flow.iter().zip([0.56075535, 6.27291321, -0.12695604, -0.27888139]) {
        close("flow", *found, published, 6e-9); // published to 8 digits
    }
}

/// Case B13: the orbit of one bounce per period on a vibrating table. Its monodromy matrix ΦΞ has determinant e², and the
/// eigenvalue −1 at Γ² = (2(1+e²)/(1+e)²)² + (π(1−e)/(1+e))².
#[test]
fn the_monodromy_matrix_has_the_closed_form_period_doubling() {
    let chain = sliders(Z, &["ball"]);
    let frame = chain.frame("ball").unwrap();
    let omega = TAU * 10.0;
    let period = TAU / omega;
    let monodromy = |e: f64, gamma: f64| {
        let amplitude = gamma * G / (omega * omega);
        let v = G * period / 2.0;
        let phase = (v * (1.0 - e) / (1.0 + e) / (amplitude * omega)).acos();
        let motion = Oscillation { amplitude: Vector3::z() * amplitude, frequency: omega, phase };
        let table = PlaneContact::new(frame, [0.0, 0.0, 1.0]).unwrap().shaken(motion);
        let moment = Moment { time: 0.0, q: vec![amplitude * phase.sin()], qd: vec![-v] };
        let fall = |_: &Moment| Ok(DVector::from_element(1, -G));
        let found = saltation(&chain, &moment, &table, &Frictionless { restitution: e }, fall).unwrap();
        Matrix2::new(1.0, period, 0.0, 1.0) * found.matrix.fixed_view::<2, 2>(0, 0)
    };
    for (e, published) in [(0.5_f64, 1.526823701), (0.8, 1.070836468), (0.9, 1.016310712)] {
        // With a determinant of e², the eigenvalue is −1 where the trace is −(1 + e²).
        let excess = |gamma: f64| {
            let monodromy = monodromy(e, gamma);
            close("det", monodromy.determinant(), e * e, 1e-12);
            monodromy.trace() + 1.0 + e * e
        };
        let (mut stable, mut doubled) = (published - 0.01, published + 0.01);
        assert!(excess(stable) > 0.0 && excess(doubled) < 0.0);
        for _ in 0..50 {
            let middle = 0.5 * (stable + doubled);
            if excess(middle) > 0.0 { stable = middle } else { doubled = middle }
        }
        let exact = ((2.0 * (1.0 + e * e) / (1.0 + e).powi(2)).powi(2) + (PI * (1.0 - e) / (1.0 + e)).powi(2)).sqrt();
        close("Γ", stable, exact, 1e-11);
        close("published", stable, published, 6e-10);
    }
}

/// Case B14 (a differentiable simulator's issue tracker): two balls of 0.1 m and 1 kg on a line, the first at 0 with 1 m/s, the
/// second at 0.52 m at rest, elastic. After 1 s the second is at x₁ + v₁ T + 2r: gradient (1, 0, 1, 0) by (x₁, x₂, v₁, v₂).
/// Without the derivative of the time of impact the result is (0.75, 0.25, 0.91, 0.08).
#[test]
fn the_gradient_of_an_elastic_pair_is_exact() {
    let chain = sliders(X, &["first", "second"]);
    let meets = 0.52 - 0.2; // at 1 m/s
    let moment = Moment { time: meets, q: vec![meets, 0.52], qd: vec![1.0, 0.0] };
    let gap = RowContact(vec![-1.0, 1.0]);
    let free = |_: &Moment| Ok(DVector::zeros(2));
    let found = saltation(&chain, &moment, &gap, &Frictionless { restitution: 1.0 }, free).unwrap();
    let flight = |time: f64| {
        let mut flight = DMatrix::identity(4, 4);
        (flight[(0, 2)], flight[(1, 3)]) = (time, time);
        flight
    };
    let flow = flight(1.0 - meets) * found.matrix * flight(meets);
    for (found, exact) in flow.row(1).iter().zip([1.0, 0.0, 1.0, 0.0]) {
        close("gradient", *found, exact, 1e-12);
    }
}

/// The flow of a two-link arm under gravity through one impact with friction: its derivative by the saltation matrix
/// compared with the central difference, which includes the change of the time of the impact.
#[test]
fn the_flow_of_an_arm_through_an_impact_has_the_derivative_of_the_saltation_matrix() {
    let chain = robot("planar2");
    let tip = chain.frame("tip").unwrap();
    let law = Energetic { restitution: 0.6, friction: 0.15 };
    let (q, qd) = (vec![0.8, -1.5], vec![-0.6, 1.3]);
    let gravity = Vector3::new(0.0, -G, 0.0);
    let normal = [-1.0, 0.0, 0.0];
    let span = 0.02;
    let place = |q: &[f64]| {
        let mut workspace = chain.workspace();
        workspace.update(&chain, q).unwrap().position(chain.point(tip, Vector3::zeros())).x
    };
    let wall = place(&q);
    let to = |x: &[f64], time: f64| {
        let moment = free_motion(&chain, &x[..2], &x[2..], gravity, time, 2).unwrap().pop().unwrap();
        [moment.q, moment.qd].concat()
    };
    // From a state before the impact, through the impact at whatever time it happens, to the end of the span.
    let flow = |x: &[f64]| {
        let (mut open, mut closed) = (1e-6, 1.9 * span);
        for _ in 0..50 {
            let middle = 0.5 * (open + closed);
            if place(&to(x, middle)[..2]) < wall { open = middle } else { closed = middle }
        }
        let hit = to(x, closed);
        let strike = chain.impact(&hit[..2], &hit[2..]).at(tip).normal(normal).resolve(&law).unwrap();
        DVector::from_vec(to(&[hit[..2].to_vec(), strike.qd_plus].concat(), 2.0 * span - closed))
    };
    let jacobian = |f: &dyn Fn(&[f64]) -> DVector<f64>, x: &[f64]| {
        let mut by = DMatrix::zeros(4, 4);
        for k in 0..4 {
            let moved = |s: f64| f(&(0..4).map(|i| if i == k { x[i] + s } else { x[i] }).collect::<Vec<_>>());
            by.set_column(k, &((moved(1e-5) - moved(-1e-5)) / 2e-5));
        }
        by
    };
    let smooth = |x: &[f64]| DVector::from_vec(to(x, span));
    let strike = chain.impact(&q, &qd).at(tip).normal(normal);
    let found = strike.clone().saltation(&law, gravity).unwrap();
    let after = [q.clone(), strike.resolve(&law).unwrap().qd_plus].concat();
    let start = to(&[q.clone(), qd.clone()].concat(), -span);
    let product = jacobian(&smooth, &after) * &found.matrix * jacobian(&smooth, &start);
    let whole = jacobian(&flow, &start);
    close("flow", (&product - &whole).amax(), 0.0, 2e-6 * whole.amax());
    assert!((&found.matrix - DMatrix::identity(4, 4)).amax() > 1.0);
}

#[test]
fn grazing_and_invalid_input_are_refused() {
    let chain = sliders(Z, &["ball"]);
    let plane = PlaneContact::new(chain.frame("ball").unwrap(), [0.0, 0.0, 1.0]).unwrap();
    let fall = |_: &Moment| Ok(DVector::from_element(1, -G));
    let at = |qd: f64, q: f64| Moment { time: 0.0, q: vec![q], qd: vec![qd] };
    let law = Frictionless { restitution: 0.5 };
    let message = saltation(&chain, &at(0.0, 0.0), &plane, &law, fall).unwrap_err().to_string();
    assert!(message.contains("rate of the gap is 0") && message.contains("grazing"), "{message}");
    assert!(matches!(saltation(&chain, &at(-1.0, f64::NAN), &plane, &law, fall), Err(SimError::Chain(_))));
    let short = |_: &Moment| Ok(DVector::zeros(3));
    assert!(saltation(&chain, &at(-1.0, 0.0), &plane, &law, short).unwrap_err().to_string().contains("acceleration"));
    let wrong = RowContact(vec![1.0, 0.0]);
    assert!(saltation(&chain, &at(-1.0, 0.0), &wrong, &law, fall).unwrap_err().to_string().contains("the gap's row"));
    assert!(PlaneContact::new(chain.frame("ball").unwrap(), [0.0; 3]).is_err());
}

/// The contact point of a ball is its lowest point in every orientation; its velocity is v + ω × (−r n).
#[test]
fn the_contact_point_of_a_ball_is_its_lowest_point() {
    let chain = floating("ball");
    let frame = chain.frame(&chain.frames().last().unwrap().name.clone()).unwrap();
    let turned = chain.integrate(&chain.zero_configuration(), &[0.0, 0.0, 0.0, 0.4, -0.8, 0.3], 1.0).unwrap();
    let mut workspace = chain.workspace();
    let kin = workspace.update(&chain, &turned).unwrap();
    let rows = PlaneContact::new(frame, [0.0, 0.0, 1.0]).unwrap().radius(0.1).rows(&kin, 0.0).unwrap();
    let spin = Vector3::new(0.3, -0.2, 0.5);
    let own = kin.pose(frame).rotation.transpose() * spin;
    let u = rows * DVector::from_vec(vec![0.0, 0.0, 0.0, own.x, own.y, own.z]);
    close("u", (u - spin.cross(&Vector3::new(0.0, 0.0, -0.1))).norm(), 0.0, 1e-15);
}

/// The bands of joint velocities contain the results of a scan over the coefficients and are hardly wider. They are exact
/// where the tip keeps its direction of slip and sampled where it reverses.
#[test]
fn bands_of_joint_velocities_contain_a_scan_of_the_coefficients() {
    let chain = robot("planar2");
    let tip = chain.frame("tip").unwrap();
    let ranges = CoefficientRanges { restitution: [0.3, 0.4], friction: [0.1, 0.3] };
    for (qd, exact) in [([-0.15, 0.6], false), ([-1.0, 0.6], true)] {
        let q = [0.78, -1.57];
        let strike = chain.impact(&q, &qd).at(tip).normal([-1.0, 0.0, 0.0]);
        let band =
            strike.clone().contact().unwrap().band(&Energetic { restitution: 0.35, friction: 0.2 }, &ranges).unwrap();
        let mode = strike.clone().resolve(&Energetic { restitution: 0.35, friction: 0.2 }).unwrap().mode;
        assert_eq!(band.exact, exact, "{mode}");
        let mut widest = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for i in 0..=20 {
            for j in 0..=20 {
                let (restitution, friction) = (0.3 + 0.1 * f64::from(i) / 20.0, 0.1 + 0.2 * f64::from(j) / 20.0);
                let hit = strike.clone().resolve(&Energetic { restitution, friction }).unwrap();
                for (k, v) in hit.qd_plus.iter().enumerate() {
                    widest[k] = [widest[k][0].min(*v), widest[k][1].max(*v)];
                }
                for (bounds, u) in band.u_plus.iter().zip(hit.u_plus.iter()) {
                    assert!(*u > bounds[0] - 1e-13 && *u < bounds[1] + 1e-13);
                }
            }
        }
        for (bounds, widest) in band.qd_plus.iter().zip(widest) {
            // An extreme between two points of the scan is of second order in their distance.
            let within = if exact { 1e-13 } else { 1e-3 * (widest[1] - widest[0]) };
            assert!(bounds[0] < widest[0] + 1e-13 && bounds[0] > widest[0] - within, "{bounds:?} {widest:?}");
            assert!(bounds[1] > widest[1] - 1e-13 && bounds[1] < widest[1] + within, "{bounds:?} {widest:?}");
        }
    }
}
