//! Whole chains that are hard on numbers.

use super::bodies::{chain, joint, link};
use super::definition::{Reported, violation_of};
use super::method::{Found, Judged, law, said};
use super::single::{SPATIAL, worse};
use super::tree::{Body, Posed, urdf};
use carom_chain::algebra::z_onto;
use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, Coordinates, Rows, uniform_chain};
use carom_sim::{ChainImpact, Impacts, SimError};
use nalgebra::{DMatrix, DVector, Matrix2, Matrix2xX, Matrix3, Rotation3, SMatrix, Vector2, Vector3};
use std::sync::OnceLock;

/// M = [[p₁ + 2p₃c, p₂ + p₃c], [p₂ + p₃c, p₂]] with c = cos q₂: the arm of the paper's preset, with links of 0.45 m.
const ARM: [f64; 3] = [3.473, 0.196, 0.242];

fn arm() -> Result<Chain, String> {
    let [p1, p2, p3] = ARM;
    // The second link's mass centre at 0.2 m; the first carries what is left of p₁.
    let (l1, r2) = (0.45, 0.2);
    let m2 = p3 / (l1 * r2);
    let (own1, own2) = (p1 - p2 - m2 * l1 * l1, p2 - m2 * r2 * r2);
    chain(
        &[
            r#"<link name="tip"/>"#.to_owned(),
            link("a", 1.0, [own1; 3], [0.0; 3], ""),
            link("b", m2, [own2; 3], [r2, 0.0, 0.0], ""),
            joint("continuous", ["world", "a"], 0.0, [0.0, 0.0, 1.0]),
            joint("continuous", ["a", "b"], l1, [0.0, 0.0, 1.0]),
            joint("fixed", ["b", "tip"], l1, [1.0, 0.0, 0.0]),
        ]
        .concat(),
    )
}

/// At q = (0, θ) the tip moves along the stretched arm by −l₂ sin θ (q̇₁ + q̇₂): j is a multiple of (1, 1), and q̇⁺ does not
/// depend on which: q̇ − (1+e)(q̇₁+q̇₂) M⁻¹(1,1)ᵀ / ((1,1)M⁻¹(1,1)ᵀ), M⁻¹(1,1)ᵀ ∝ (−p₃c, p₁ − p₂ + p₃c).
pub fn singular_pose(name: &str) -> Judged {
    let (chain, law, e) = (arm()?, law(name, 0.5, 0.0), 0.5);
    let tip = chain.frame("tip").map_err(said)?;
    let [p1, p2, p3] = ARM;
    let qd = [0.3, -1.0];
    let strike = |angle: f64| chain.impact(&[0.0, angle], &qd).at(tip).normal([-1.0, 0.0, 0.0]).resolve(law.as_ref());
    let (mut error, mut answered) = (0.0, 0);
    for k in 1..=12 {
        let angle = 10_f64.powi(-k);
        let hit = match strike(angle) {
            Ok(hit) => hit,
            Err(SimError::SingularNormal { .. }) => break,
            Err(other) => return Err(said(other)),
        };
        let c = angle.cos();
        let jump = Vector2::new(-p3 * c, p1 - p2 + p3 * c) * (-(1.0 + e) * (qd[0] + qd[1]) / (p1 - p2));
        let found = Vector2::new(hit.qd_plus[0] - qd[0], hit.qd_plus[1] - qd[1]);
        error = worse(error, (found - jump).norm() / jump.norm());
        answered += 1;
    }
    Ok(Found::figure(error).must_be("answered at all twelve angles, down to 1e-12 rad", answered == 12))
}

/// Stretched exactly: the impulse of any rigid law would be infinite.
pub fn stretched(name: &str) -> Judged {
    let (chain, law) = (arm()?, law(name, 0.5, 0.0));
    let tip = chain.frame("tip").map_err(said)?;
    let hit = chain.impact(&[0.0, 0.0], &[0.3, -1.0]).at(tip).normal([-1.0, 0.0, 0.0]).resolve(law.as_ref());
    match hit {
        Err(SimError::SingularNormal { .. }) => Err("singular direction".to_owned()),
        Err(other) => Ok(Found::figure(f64::NAN).must_be(&format!("refused as a singular direction ({other})"), false)),
        Ok(_) => Ok(Found::figure(f64::NAN)),
    }
}

/// The last of a row of sliders is hit: only it changes its velocity, so only the last joint does.
pub fn mass_ratio(name: &str) -> Judged {
    let law = law(name, 0.5, 0.0);
    let mut error = 0.0;
    for masses in [[1e-6, 1.0, 1e-6, 1.0, 1e-6, 1.0], [1.0, 1e-6, 1.0, 1e-6, 1.0, 1e-6]] {
        let names: Vec<String> = (0..=6).map(|k| if k == 0 { "world".into() } else { format!("link{k}") }).collect();
        let element = |(pair, mass): (&[String], &f64)| {
            let slide = joint("prismatic", [&pair[0], &pair[1]], 0.0, [1.0, 0.0, 0.0]);
            link(&pair[1], *mass, [*mass; 3], [0.0; 3], "") + &slide
        };
        let chain = chain(&names.windows(2).zip(&masses).map(element).collect::<String>())?;
        let tip = chain.frame("link6").map_err(said)?;
        let qd = [0.1, -0.2, 0.3, -0.4, 0.5, 1.0];
        let hit = chain.impact(&[0.0; 6], &qd).at(tip).normal([-1.0, 0.0, 0.0]).resolve(law.as_ref()).map_err(said)?;
        let speed: f64 = qd.iter().sum();
        for (k, (after, before)) in hit.qd_plus.iter().zip(qd).enumerate() {
            let expected = if k == 5 { before - 1.5 * speed } else { before };
            error = worse(error, (after - expected).abs() / speed);
        }
    }
    Ok(Found::figure(error))
}

/// A uniform chain of rods in the plane, from closed forms. With absolute angles θ and rates ω
///
/// ```text
/// M̃_ij = K_ij cos(θ_i − θ_j),   K_ii = m l² (1/3 + n − i),   K_ij = m l² (1/2 + n − j) for i < j,   i = 1 … n
/// C̃_i  = Σ_j K_ij sin(θ_i − θ_j) ω_j²,   J̃_i = l (−sin θ_i, cos θ_i)
/// ```
struct Rods {
    q: Vec<f64>,
    qd: Vec<f64>,
    /// K cos, K sin.
    mass: DMatrix<f64>,
    bias: DMatrix<f64>,
    jacobian: Matrix2xX<f64>,
    /// J M⁻¹ Jᵀ by Cholesky's method.
    delassus: Matrix2<f64>,
}

impl Rods {
    fn new(links: usize) -> Result<Self, String> {
        let (l, n) = (1.0 / links as f64, links as f64);
        let q: Vec<f64> = (0..links).map(|k| 0.3 * (0.7 * k as f64).sin() / n.sqrt()).collect();
        let qd: Vec<f64> = (0..links).map(|k| -0.2 + (1.3 * k as f64).cos()).collect();
        let angle = Self::absolute(&q);
        let k = |i: usize, j: usize| {
            let after = n - 1.0 - i.max(j) as f64;
            l * l * l * if i == j { 1.0 / 3.0 + after } else { 0.5 + after }
        };
        let mass = DMatrix::from_fn(links, links, |i, j| k(i, j) * (angle[i] - angle[j]).cos());
        let bias = DMatrix::from_fn(links, links, |i, j| k(i, j) * (angle[i] - angle[j]).sin());
        let jacobian = Matrix2xX::from_fn(links, |k, i| l * if k == 0 { -angle[i].sin() } else { angle[i].cos() });
        let factor = mass.clone().cholesky().ok_or("the mass matrix is not positive definite")?;
        let delassus = &jacobian * factor.solve(&jacobian.transpose());
        Ok(Self { q, qd, mass, bias, jacobian, delassus })
    }

    /// The three lengths of the scenes are computed once.
    fn of(links: usize) -> Result<&'static Self, String> {
        static RODS: [OnceLock<Result<Rods, String>>; 3] = [const { OnceLock::new() }; 3];
        let place = LENGTHS.iter().position(|length| *length == links).ok_or("no such length")?;
        RODS[place].get_or_init(|| Self::new(links)).as_ref().map_err(Clone::clone)
    }

    /// Sums from the base: absolute angles of relative ones.
    fn absolute(relative: &[f64]) -> DVector<f64> {
        let mut sum = 0.0;
        DVector::from_iterator(
            relative.len(),
            relative.iter().map(|x| {
                sum += x;
                sum
            }),
        )
    }

    /// Sums from the tip: forces on relative angles of those on absolute ones.
    fn relative(forces: &DVector<f64>) -> DVector<f64> {
        let mut all = forces.clone();
        (0..all.len() - 1).rev().for_each(|i| all[i] += all[i + 1]);
        all
    }

    /// M of the relative angles.
    fn relative_mass(&self) -> DMatrix<f64> {
        let mut mass = self.mass.clone();
        for i in (0..mass.nrows() - 1).rev() {
            let next = mass.row(i + 1).into_owned();
            let mut row = mass.row_mut(i);
            row += next;
        }
        for j in (0..mass.ncols() - 1).rev() {
            let next = mass.column(j + 1).into_owned();
            let mut column = mass.column_mut(j);
            column += next;
        }
        mass
    }
}

const LENGTHS: [usize; 3] = [2, 30, 1000];

/// Largest |A x − b| of an entry, relative to the terms that cancel in it.
fn backward_error(a: &DMatrix<f64>, x: &DVector<f64>, b: &DVector<f64>) -> f64 {
    let (error, size) = (a * x - b, a.abs() * x.abs() + b.abs());
    error
        .iter()
        .zip(size.iter())
        .fold(0.0, |most, (error, size)| worse(most, error.abs() / size.max(f64::MIN_POSITIVE)))
}

/// Largest error of an entry relative to the largest entry.
fn relative_error(found: &DMatrix<f64>, expected: &DMatrix<f64>) -> f64 {
    (found - expected).amax() / expected.amax()
}

/// What a chain must satisfy on impact, given its M, the rows of the Jacobian in the axes of contact and H: the law's definition,
/// M (q̇⁺ − q̇⁻) = Jᵀ P, u⁺ = J q̇⁺, and T = ½ q̇ᵀ M q̇.
fn chain_violation<const D: usize>(
    hit: &ChainImpact,
    axes: &SMatrix<f64, 3, D>,
    (mass, rows): (&DMatrix<f64>, &DMatrix<f64>),
    (qd, qd_plus): (&DVector<f64>, &DVector<f64>),
    (e, mu): (f64, f64),
    h: &SMatrix<f64, D, D>,
) -> [f64; 2] {
    let along = |v: &Vector3<f64>| axes.transpose() * v;
    let vectors = [along(&hit.u_minus), along(&hit.u_plus), along(&hit.impulse)];
    let defined = violation_of(hit.contact.law, h, &vectors, &Reported::of(&hit.contact), e, mu);
    let dense = |v: &nalgebra::SVector<f64, D>| DVector::from_column_slice(v.as_slice());
    let energy = |qd: &DVector<f64>| 0.5 * qd.dot(&(mass * qd));
    let (before, after) = (energy(qd), energy(qd_plus));
    let balance = [
        backward_error(mass, &(qd_plus - qd), &(rows.transpose() * dense(&vectors[2]))),
        backward_error(rows, qd, &dense(&vectors[0])),
        backward_error(rows, qd_plus, &dense(&vectors[1])),
        (hit.energy_before / before - 1.0).abs(),
        (hit.energy_after / after - 1.0).abs(),
    ];
    [defined, balance.into_iter().fold(0.0, worse)]
}

/// A bent chain; the velocity of its tip comes from all links.
pub fn long(name: &str, links: usize) -> Judged {
    let rods = Rods::of(links)?;
    let chain = uniform_chain(links, 1.0, 1.0).map_err(said)?;
    let (e, mu) = (0.5, 0.3);
    let tip = chain.frame("tip").map_err(said)?;
    let rates = Rods::absolute(&rods.qd);
    let toward = &rods.jacobian * &rates;
    // A wall across the tip's path, a little askew.
    let normal = Vector3::new(-toward[0] + 0.4 * toward[1], -toward[1] - 0.4 * toward[0], 0.0).normalize();
    let strike = chain.impact(&rods.q, &rods.qd).at(tip).normal(normal);
    let hit = strike.resolve(law(name, e, mu).as_ref()).map_err(said)?;

    let axes = SMatrix::<f64, 3, 2>::from_columns(&[Vector3::z().cross(&normal), normal]);
    let plane: Matrix2<f64> = axes.fixed_view::<2, 2>(0, 0).into();
    let rows = DMatrix::from_iterator(2, links, (plane.transpose() * &rods.jacobian).iter().copied());
    let h = plane.transpose() * rods.delassus * plane;
    let rates_plus = Rods::absolute(&hit.qd_plus);
    let [defined, balance] = chain_violation(&hit, &axes, (&rods.mass, &rows), (&rates, &rates_plus), (e, mu), &h);

    let mut workspace = chain.workspace();
    let mut pose = workspace.update(&chain, &rods.q).map_err(said)?;
    let mass = relative_error(&pose.mass_matrix(), &rods.relative_mass());
    let bias = Rods::relative(&(&rods.bias * rates.component_mul(&rates)));
    let found = pose.bias(&rods.qd, Vector3::zeros()).map_err(said)?;
    let size = (rods.bias.abs() * rates.component_mul(&rates)).sum();
    let found = Found::figure(worse(defined, balance)).must("error of M", mass, CHAIN).must(
        "error of C q̇",
        (found - bias).amax() / size,
        CHAIN,
    );
    Ok(found)
}

/// Error of M and C q̇ relative to their largest terms: rounding of sums of up to 1000 terms.
const CHAIN: f64 = 1e-12;

/// Bodies below each body of the trees; the tip is body 4.
const PARENTS: [Option<usize>; 8] = [None, Some(0), Some(1), Some(1), Some(3), Some(0), Some(5), Some(3)];
const TIP: usize = 4;

fn random_tree(rng: &mut fastrand::Rng, planar: bool) -> Vec<Body> {
    let mut number = || 2.0 * rng.f64() - 1.0;
    let mut vector = |flat: bool| Vector3::new(number(), number(), if flat { 0.0 } else { number() });
    let one = |(k, parent): (usize, &Option<usize>)| {
        let kind = vector(false);
        let turned = vector(false);
        let turned = if planar { Vector3::new(0.0, 0.0, turned.z) } else { turned };
        let axis = if planar { Vector3::z() } else { vector(false).normalize() };
        // Principal moments that some body has.
        let masses = vector(false).abs() * 0.02 + Vector3::repeat(0.005);
        let moments = Vector3::repeat(masses.sum()) - masses;
        let frame = Rotation3::new(if planar { Vector3::zeros() } else { vector(false) }).into_inner();
        Body {
            parent: *parent,
            at: vector(planar) * 0.5,
            turned,
            axis,
            // One slider on the way to the tip, one beside it.
            slides: !planar && matches!(k, 3 | 5) && kind.x > 0.0,
            mass: 0.2 + kind.y.abs(),
            centre: vector(planar) * 0.2,
            inertia: frame * Matrix3::from_diagonal(&moments) * frame.transpose(),
        }
    };
    PARENTS.iter().enumerate().map(one).collect()
}

/// A body of a tree with branches on all levels is hit: twenty trees in the plane and twenty in space.
pub fn branches(name: &str) -> Judged {
    let mut rng = fastrand::Rng::with_seed(6);
    let (mut error, mut mass_error, mut solve_error) = (0.0, 0.0, 0.0);
    for k in 0..40 {
        let planar = k < 20;
        let bodies = random_tree(&mut rng, planar);
        let chain = Chain::from_urdf_str(&urdf(&bodies), &LoadOptions::default()).map_err(said)?;
        let place = |k: usize| match chain.joint(&format!("joint{k}")).map(|joint| &joint.coordinates) {
            Ok(Coordinates::Own { v, .. }) => Ok(v.start),
            _ => Err("a joint has no coordinate".to_owned()),
        };
        let places: Vec<usize> = (0..bodies.len()).map(place).collect::<Result<_, _>>()?;
        let mut number = || 2.0 * rng.f64() - 1.0;
        let q: Vec<f64> = bodies.iter().map(|_| number()).collect();
        let qd = DVector::from_fn(bodies.len(), |_, _| number());
        let offset = Vector3::new(0.3 + 0.1 * number(), 0.1 * number(), if planar { 0.0 } else { 0.1 * number() });
        let (e, mu) = (number().abs(), number().abs());
        let askew = Vector3::new(number(), number(), if planar { 0.0 } else { number() }) * 0.4;

        let posed = Posed::new(&bodies, &q);
        let mass = posed.mass_matrix();
        let [jacobian, _] = posed.jacobians(TIP, &offset);
        let toward: Vector3<f64> = (&jacobian * &qd).fixed_rows::<3>(0).into();
        let normal = (-toward.normalize() + askew).normalize();

        let mut ordered = [vec![0.0; bodies.len()], vec![0.0; bodies.len()]];
        for (k, &place) in places.iter().enumerate() {
            (ordered[0][place], ordered[1][place]) = (q[k], qd[k]);
        }
        let [chain_q, chain_qd] = &ordered;
        let tip = chain.frame(&format!("link{TIP}")).map_err(said)?;
        let strike = chain.impact(chain_q, chain_qd).at(tip).offset(offset).normal(normal);
        let hit = strike.resolve(law(name, e, mu).as_ref()).map_err(said)?;
        let qd_plus = DVector::from_iterator(bodies.len(), places.iter().map(|&place| hit.qd_plus[place]));

        let factor = mass.clone().cholesky().ok_or("the mass matrix is not positive definite")?;
        let delassus: Matrix3<f64> = (&jacobian * factor.solve(&jacobian.transpose())).fixed_view::<3, 3>(0, 0).into();
        let both = if planar {
            let axes = SMatrix::<f64, 3, 2>::from_columns(&[Vector3::z().cross(&normal), normal]);
            let rows = axes.transpose() * &jacobian;
            let rows = DMatrix::from_iterator(2, bodies.len(), rows.iter().copied());
            let h = axes.transpose() * delassus * axes;
            chain_violation(&hit, &axes, (&mass, &rows), (&qd, &qd_plus), (e, mu), &h)
        } else {
            let axes = z_onto(normal);
            let rows = axes.transpose() * &jacobian;
            let rows = DMatrix::from_iterator(3, bodies.len(), rows.iter().copied());
            let h = axes.transpose() * delassus * axes;
            chain_violation(&hit, &axes, (&mass, &rows), (&qd, &qd_plus), (e, mu), &h)
        };
        error = both.into_iter().fold(error, worse);

        let mut workspace = chain.workspace();
        let mut pose = workspace.update(&chain, chain_q).map_err(said)?;
        let ordered = DMatrix::from_fn(bodies.len(), bodies.len(), |i, j| {
            let at = |place: usize| places.iter().position(|&other| other == place).unwrap_or(0);
            mass[(at(i), at(j))]
        });
        mass_error = worse(mass_error, relative_error(&pose.mass_matrix(), &ordered));
        let forces = DVector::from_column_slice(chain_qd);
        let (mut rows, mut rates) = (Rows::new(bodies.len()), Rows::default());
        rows.add().copy_from_slice(chain_qd);
        pose.respond(&rows, &mut rates).map_err(said)?;
        let rates = DVector::from_column_slice(rates.row(0));
        solve_error = worse(solve_error, backward_error(&ordered, &rates, &forces));
    }
    let found = Found::figure(error).must("error of M", mass_error, CHAIN);
    Ok(found.must("error of M⁻¹ by the articulated-body algorithm", solve_error, SPATIAL))
}
