//! An impact through compliant contacts in a fixed configuration: Newton's equations in contact axes, integrated from
//! first touch until the contacts have separated.
//!
//! | Symbol | Size | Meaning | Our name |
//! |---|---|---|---|
//! | H | n D × n D | inverse inertia between all rows (1/kg) | `delassus` |
//! | P | n D | accumulated impulse (N s); u = u⁻ + H P | `impulse` |
//! | d, w | n | penetrations (m) and their rates −u_n (m/s) | |
//! | z | 2 n | deflections of the bristles (m) | |
//!
//! ```text
//! ḋ = -u_n,   Ṗ_n = F_n(d, -u_n),   Ṗ_t = F_t(z, u_t, F_n),   ż by the law,   u = u⁻ + H P
//! ```
//!
//! The state vector is (d, P, z, works), with three works per contact: absorbed by the normal force, returned by it,
//! and done by friction.
//!
//! Where a contact closes, or the sign of its closing velocity changes, the integration is restarted at the root on the
//! step's interpolation polynomial, because the force has a jump, a kink or its memory there. All other kinks (the
//! friction cone is reached, a force ends) are left to the step control.

use std::cell::Cell;

use ivp::dense::StepInterpolant;
use ivp::ivp::FirstOrderSystem;
use ivp::methods::DOP853;
use ivp::solout::{ControlFlag, SolOut};
use nalgebra::{DMatrix, DVector, Vector2};

use super::{NormalForce, TangentialForce};
use crate::outcome::finite;
use crate::problem::{check_delassus, check_square, check_velocity};
use crate::roots::{MOST_STEPS, bisect};
use crate::{ImpactError, ImpactProblem};

/// Result of a compliant impact at one contact.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pressed {
    /// Largest penetration (m).
    pub deepest: f64,
    /// Largest normal force (N).
    pub peak_force: f64,
    /// Work absorbed by the normal force while the penetration grew (J), ≥ 0.
    pub absorbed: f64,
    /// Work returned by the normal force while the penetration fell (J); negative if the force pulled more than it
    /// pushed.
    pub returned: f64,
    /// `∫ F_t·u_t dt` (J); at most the energy that bristles had stored.
    pub friction_work: f64,
}

impl Pressed {
    /// Realised energetic coefficient, √(returned/absorbed); `None` if no work was absorbed.
    pub fn energetic(&self) -> Option<f64> {
        (self.absorbed > 0.0).then(|| (self.returned / self.absorbed).max(0.0).sqrt())
    }
}

/// Outcome of [`compliant_impact`]. Contact axes, SI units, impulses on the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct CompliantOutcome {
    /// Impulses (N s).
    pub impulse: DVector<f64>,
    /// Velocities after (m/s): u⁻ + H P.
    pub u_plus: DVector<f64>,
    /// Time from first touch to the end of the last force (s).
    pub duration: f64,
    /// Work of the impulses, `½ P·(u⁻ + u⁺)` (J); negative is a loss.
    pub energy_change: f64,
    /// Results per contact, in the order of their rows.
    pub contacts: Vec<Pressed>,
    /// Steps of the integration.
    pub steps: usize,
}

impl CompliantOutcome {
    /// Work of all forces at all contacts (J). It equals [`energy_change`](Self::energy_change), computed in another
    /// way; their difference is the error of the integration.
    pub fn work(&self) -> f64 {
        self.contacts.iter().map(|contact| contact.returned - contact.absorbed + contact.friction_work).sum()
    }
}

/// Integrates an impact through compliant contacts from first touch until no force acts and no contact approaches.
///
/// All contacts have the same number of rows in `delassus` (1/kg) and `u_minus` (m/s), contact after contact: one (its
/// normal), two in the plane or three in space; tangents first, normal last. All contacts touch at the start, with zero
/// force. A contact that separates may close again later. The damping of a contact that does not approach at the start
/// is set by the largest approach velocity of all.
///
/// H is constant: the configuration does not change, and no other force acts. This is also the assumption of rigid
/// impacts; its error is of the order of the duration. The outcome of a single contact depends on stiffness and mass in
/// duration, penetration and force only. Several contacts share the impulse according to the **ratio** of their
/// stiffnesses, which rigid laws do not have.
///
/// **Guarantee.** Never gains energy, because the forces are passive, within the error of the integration: about 1e-10
/// of the impulse, occasionally 1e-8 where a force ends within a step.
///
/// # Errors
/// - [`ImpactError::Sizes`]: sizes that do not agree.
/// - The errors of [`ImpactProblem::new`].
/// - [`ImpactError::SingularNormal`]: a singular normal direction.
/// - [`ImpactError::Unfinished`]: the impact does not end within ten million steps, for instance because friction
///   wedges a singular H or the slip speed of the smoothed friction is so small that the equations are too stiff.
///
/// ```
/// # use carom_impact::{NormalForce, HuntCrossley, TangentialForce, compliant_impact};
/// # use nalgebra::{dmatrix, dvector};
/// // Newton's cradle: three balls of 1 kg, the first strikes at 1 m/s, the others touch at rest.
/// let hertz = NormalForce::HuntCrossley(HuntCrossley::new(1e9, 1.5, 1.0)?);
/// let contacts = [(hertz, TangentialForce::Frictionless); 2];
/// let hit = compliant_impact(&dmatrix![2.0, -1.0; -1.0, 2.0], &dvector![-1.0, 0.0], &contacts)?;
/// assert!((hit.impulse[1] - 0.994549).abs() < 1e-6); // speed of the last ball
/// # Ok::<(), carom_impact::ImpactError>(())
/// ```
pub fn compliant_impact(
    delassus: &DMatrix<f64>,
    u_minus: &DVector<f64>,
    contacts: &[(NormalForce, TangentialForce)],
) -> Result<CompliantOutcome, ImpactError> {
    check_square(delassus)?;
    let (rows, count) = (delassus.nrows(), contacts.len());
    for (what, found) in [("delassus", rows), ("u_minus", u_minus.len())] {
        if found != rows || !(1..=3).any(|each| each * count == found) {
            return Err(ImpactError::Sizes(format!(
                "{what} has {found} rows for {count} compliant contacts: each has one (its normal), two (in the plane) or three (in \
                 space), tangents first, normal last"
            )));
        }
    }
    let mut delassus = delassus.clone();
    check_delassus(&mut delassus)?;
    check_velocity("u_minus", u_minus.as_slice())?;
    let each = rows.checked_div(count).unwrap_or(1);
    let speed = |k: usize| -u_minus[k * each + each - 1];
    let inverse_mass = |k: usize| delassus[(k * each + each - 1, k * each + each - 1)];
    let fastest = (0..count).map(speed).fold(0.0, f64::max);
    let nothing = |contacts: usize| CompliantOutcome {
        impulse: DVector::zeros(rows),
        u_plus: u_minus.clone(),
        duration: 0.0,
        energy_change: 0.0,
        contacts: vec![Pressed::default(); contacts],
        steps: 0,
    };
    if fastest <= 0.0 {
        return Ok(nothing(count));
    }
    for k in 0..count {
        let block = delassus.view((k * each, k * each), (each, each)).into_owned();
        let tiny = 64.0 * f64::EPSILON;
        if inverse_mass(k) <= block.trace() * tiny * tiny {
            return Err(ImpactError::SingularNormal { inverse_mass: inverse_mass(k), trace: block.trace() });
        }
    }

    let touches = contacts.iter().enumerate().map(|(k, &(normal, friction))| {
        let approach = if speed(k) > 0.0 { speed(k) } else { fastest };
        let damping = normal.damping(approach, inverse_mass(k).recip());
        Touch { normal, friction, damping, deepest: 0.0, open: Cell::new(speed(k) < 0.0) }
    });
    let touches: Vec<Touch> = touches.collect();
    let mass = (0..count).map(|k| inverse_mass(k).recip()).fold(0.0, f64::max);
    let depth = touches.iter().map(|touch| touch.normal.greatest_penetration(fastest, mass)).fold(0.0, f64::max);
    let mut run = Run {
        system: System { delassus: &delassus, u_minus, each, touches },
        pressed: vec![Pressed::default(); count],
        steps: 0,
    };
    let (momentum, energy) = (mass * fastest, mass * fastest * fastest);
    let scales = [(count, depth), (rows, momentum), (2 * count, depth), (3 * count, energy)];
    let scales: Vec<f64> = scales.iter().flat_map(|&(size, scale)| vec![scale * ABSOLUTE; size]).collect();
    let (duration, y) = run.integrate(depth / fastest, &scales)?;

    let impulse = DVector::from_column_slice(&y[count..count + rows]);
    let u_plus = u_minus + &delassus * &impulse;
    finite("the impulse", &u_plus)?;
    for (k, pressed) in run.pressed.iter_mut().enumerate() {
        let works = &y[3 * count + rows + 3 * k..][..3];
        (pressed.absorbed, pressed.returned, pressed.friction_work) = (works[0], works[1], works[2]);
    }
    let energy_change = 0.5 * impulse.dot(&(u_minus + &u_plus));
    Ok(CompliantOutcome { impulse, u_plus, duration, energy_change, contacts: run.pressed, steps: run.steps })
}

impl<const D: usize> ImpactProblem<f64, D> {
    /// The impact through one compliant contact: [`compliant_impact`] of this problem.
    ///
    /// # Errors
    /// As [`compliant_impact`].
    ///
    /// ```
    /// # use carom_impact::{Energetic, ImpactProblem, Law, NormalForce, SmoothedCoulomb, TangentialForce, WaltonBraun};
    /// # use nalgebra::{matrix, vector};
    /// // A rod at 45° strikes obliquely: Stronge's impact, integrated in time.
    /// let problem = ImpactProblem::new(matrix![2.5, -1.5; -1.5, 2.5], vector![1.0, -1.0])?;
    /// let normal = NormalForce::WaltonBraun(WaltonBraun::new(1e9, 0.5)?);
    /// let friction = TangentialForce::Smoothed(SmoothedCoulomb::new(0.7, 1e-5)?);
    /// let hit = problem.compliant(normal, friction)?;
    /// let rigid = Energetic { restitution: 0.5, friction: 0.7 }.resolve(&problem)?;
    /// assert!((hit.u_plus[1] - rigid.u_plus[1]).abs() < 1e-4);
    /// # Ok::<(), carom_impact::ImpactError>(())
    /// ```
    pub fn compliant(&self, normal: NormalForce, friction: TangentialForce) -> Result<CompliantOutcome, ImpactError> {
        let delassus = DMatrix::from_fn(D, D, |i, j| self.delassus()[(i, j)]);
        let u_minus = DVector::from_column_slice(self.u_minus().as_slice());
        compliant_impact(&delassus, &u_minus, &[(normal, friction)])
    }
}

/// Relative tolerance of a step.
const TOLERANCE: f64 = 1e-12;
/// Absolute tolerance, relative to the penetration, momentum and energy of the impact.
const ABSOLUTE: f64 = 1e-14;
/// Largest number of steps.
const MAX_STEPS: usize = 10_000_000;
/// Largest duration, in units of penetration over approach velocity: weak rebounds last long.
const HORIZON: f64 = 1e12;
/// Number of intervals of a step in which the largest force is searched.
const PLACES: usize = 8;

/// The state of a contact that is not integrated.
struct Touch {
    normal: NormalForce,
    friction: TangentialForce,
    damping: f64,
    deepest: f64,
    /// Whether it has separated; it may close again.
    open: Cell<bool>,
}

struct System<'a> {
    delassus: &'a DMatrix<f64>,
    u_minus: &'a DVector<f64>,
    /// Rows of a contact.
    each: usize,
    touches: Vec<Touch>,
}

impl System<'_> {
    /// One row of u⁻ + H P.
    fn velocity(&self, y: &[f64], row: usize) -> f64 {
        let impulse = &y[self.touches.len()..][..self.u_minus.len()];
        let gained: f64 = self.delassus.column(row).iter().zip(impulse).map(|(h, p)| h * p).sum();
        self.u_minus[row] + gained
    }

    /// ḋ of a contact.
    fn closing(&self, y: &[f64], k: usize) -> f64 {
        -self.velocity(y, k * self.each + self.each - 1)
    }

    fn normal_force(&self, y: &[f64], k: usize) -> f64 {
        let Touch { normal, damping, deepest, ref open, .. } = self.touches[k];
        if open.get() { 0.0 } else { normal.force(y[k], self.closing(y, k), damping, deepest) }
    }

    /// Whether no force acts and no contact approaches.
    fn is_over(&self, y: &[f64]) -> bool {
        (0..self.touches.len()).all(|k| self.normal_force(y, k) == 0.0 && self.closing(y, k) <= 0.0)
    }

    /// Whether a contact has closed, or its closing velocity has changed sign, by the end of a step.
    fn event(&self, k: usize, before: &[f64], after: &[f64]) -> bool {
        if self.touches[k].open.get() {
            return before[k] <= 0.0 && after[k] > 0.0;
        }
        let (from, to) = (self.closing(before, k), self.closing(after, k));
        (from > 0.0 && to <= 0.0) || (from < 0.0 && to > 0.0 && after[k] > 0.0)
    }
}

impl FirstOrderSystem for System<'_> {
    fn derivative(&self, _: f64, y: &[f64], rate: &mut [f64]) {
        let (count, rows, each) = (self.touches.len(), self.u_minus.len(), self.each);
        for (k, touch) in self.touches.iter().enumerate() {
            let w = self.closing(y, k);
            let force = self.normal_force(y, k);
            let (first, tangents) = (k * each, each - 1);
            let z = count + rows + 2 * k;
            let deflection = Vector2::new(y[z], y[z + 1]);
            let slip = Vector2::from_fn(|i, _| if i < tangents { self.velocity(y, first + i) } else { 0.0 });
            let (friction, bends) = if touch.open.get() {
                (Vector2::zeros(), Vector2::zeros())
            } else {
                (touch.friction.force(&deflection, &slip, force), touch.friction.rate(&deflection, &slip, force))
            };
            rate[k] = w;
            for i in 0..tangents {
                rate[count + first + i] = friction[i];
            }
            rate[count + first + tangents] = force;
            rate[z] = bends.x;
            rate[z + 1] = bends.y;
            let works = 3 * count + rows + 3 * k;
            rate[works] = force * w.max(0.0);
            rate[works + 1] = force * (-w).max(0.0);
            rate[works + 2] = friction.dot(&slip);
        }
    }
}

struct Run<'a> {
    system: System<'a>,
    pressed: Vec<Pressed>,
    steps: usize,
}

impl Run<'_> {
    /// From first touch to the end; `scale` is a typical time (s).
    fn integrate(&mut self, scale: f64, tolerances: &[f64]) -> Result<(f64, Vec<f64>), ImpactError> {
        let (mut time, mut y) = (0.0, vec![0.0; tolerances.len()]);
        loop {
            let mut observer = Observer {
                system: &self.system,
                pressed: &mut self.pressed,
                before: y.clone(),
                end: None,
                reached: time,
                steps: 0,
            };
            let method = DOP853::builder().max_steps(MAX_STEPS).stiff_test(usize::MAX).build();
            let (relative, absolute) = (TOLERANCE.into(), tolerances.to_vec().into());
            let (from, until) = (time, scale * HORIZON);
            let solved = method.solve(&self.system, from, &y, until, relative, absolute, Some(&mut observer));
            let Observer { end: found, steps, reached, .. } = observer;
            self.steps += steps;
            let unfinished = |time| ImpactError::Unfinished { time, steps: self.steps };
            solved.map_err(|_| unfinished(from))?;
            let Some((at, state, event)) = found else { return Err(unfinished(reached)) };
            (time, y) = (at, state);
            match event {
                None => return Ok((time, y)),
                Some(k) => self.restart(k, &mut y),
            }
            if self.steps > MAX_STEPS {
                return Err(ImpactError::Unfinished { time, steps: self.steps });
            }
        }
    }

    /// Updates the memory of a contact that has closed or whose closing velocity has changed sign.
    fn restart(&mut self, k: usize, y: &mut [f64]) {
        let (count, rows) = (self.system.touches.len(), self.system.u_minus.len());
        let speed = self.system.closing(y, k);
        let row = k * self.system.each + self.system.each - 1;
        let mass = self.system.delassus[(row, row)].recip();
        let touch = &mut self.system.touches[k];
        if touch.open.replace(false) {
            touch.deepest = 0.0;
            touch.damping = touch.normal.damping(speed, mass);
            y[k] = 0.0;
            y[count + rows + 2 * k..][..2].fill(0.0);
        } else {
            touch.deepest = touch.deepest.max(y[k]);
            self.pressed[k].deepest = self.pressed[k].deepest.max(y[k]);
        }
    }
}

/// Examines every accepted step for events.
struct Observer<'a, 'b> {
    system: &'a System<'b>,
    pressed: &'a mut [Pressed],
    before: Vec<f64>,
    /// Time, state, and the contact that has an event; without one it is the end of the impact.
    end: Option<(f64, Vec<f64>, Option<usize>)>,
    /// End of the last step.
    reached: f64,
    steps: usize,
}

impl SolOut for Observer<'_, '_> {
    fn solout(&mut self, start: f64, end: &mut f64, y: &mut [f64], dense: Option<&StepInterpolant<'_>>) -> ControlFlag {
        let (end, system) = (*end, self.system);
        let (Some(dense), true) = (dense, end > start) else { return ControlFlag::Continue };
        self.steps += 1;
        self.reached = end;
        let happens = |k: &usize| system.event(*k, &self.before, y);
        let first = (0..system.touches.len()).filter(happens).map(|k| {
            let open = system.touches[k].open.get();
            let falls = system.closing(&self.before, k) > 0.0;
            let over = |y: &[f64]| if open { y[k] > 0.0 } else { (system.closing(y, k) <= 0.0) == falls };
            (k, first_time(start, end, y, dense, over))
        });
        let first = first.min_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b));
        let until = first.as_ref().map_or(end, |(_, (time, _))| *time);
        for k in 0..system.touches.len() {
            self.look_for_peak(k, start, until, dense);
        }
        if let Some((k, (time, state))) = first {
            self.end = Some((time, state, Some(k)));
            return ControlFlag::Interrupt;
        }
        if system.is_over(y) {
            let (time, _) = first_time(start, end, y, dense, |y| system.is_over(y));
            self.end = Some((time, y.to_vec(), None));
            return ControlFlag::Interrupt;
        }
        for (k, touch) in system.touches.iter().enumerate() {
            touch.open.set(touch.open.get() || y[k] < 0.0);
        }
        self.before.copy_from_slice(y);
        ControlFlag::Continue
    }
}

impl Observer<'_, '_> {
    /// The largest force of a contact within an interval.
    fn look_for_peak(&mut self, k: usize, start: f64, end: f64, dense: &StepInterpolant) {
        let mut y = self.before.clone();
        let mut force = |time: f64| {
            dense.interpolate(time, &mut y);
            self.system.normal_force(&y, k)
        };
        let place = |i: usize| start + (end - start) * i as f64 / PLACES as f64;
        let best = (0..=PLACES).map(|i| (force(place(i)), i)).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((found, i)) = best.filter(|(found, _)| *found > self.pressed[k].peak_force) else { return };
        let mut peak = found;
        // ternary search; 40 steps leave 1e-7 of the bracket, and the force is flat at its maximum
        let (mut low, mut high) = (place(i.saturating_sub(1)), place((i + 1).min(PLACES)));
        for _ in 0..40 {
            let third = (high - low) / 3.0;
            let (a, b) = (force(low + third), force(high - third));
            peak = peak.max(a).max(b);
            if a < b { low += third } else { high -= third }
        }
        self.pressed[k].peak_force = peak;
    }
}

/// The time from which `holds` is true within a step, as it is at its end, and the state at that time.
fn first_time(
    start: f64,
    end: f64,
    y: &[f64],
    dense: &StepInterpolant,
    holds: impl Fn(&[f64]) -> bool,
) -> (f64, Vec<f64>) {
    let (mut state, mut probe) = (y.to_vec(), y.to_vec());
    let time = bisect(start, end, MOST_STEPS, |middle| {
        dense.interpolate(middle, &mut probe);
        let held = holds(&probe);
        if held {
            state.copy_from_slice(&probe);
        }
        held
    });
    (time, state)
}
