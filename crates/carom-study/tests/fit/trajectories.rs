//! Fits to robots in motion: scale of inertia, flights around an impact, whole tosses.

use super::*;

#[test]
fn a_fit_recovers_the_scale_of_inertia() {
    let nominal = load("box");
    let truth = nominal.with_inertia_scaled(1.3).unwrap();
    let (frame, mut rng) = (nominal.frame("box").unwrap(), Rng::with_seed(9));
    let law = law_by_name::<3>("chatterjee-ruina", rough(0.4, 0.2)).unwrap();
    let (mut impacts, mut receding) = (Vec::new(), 0);
    while impacts.len() < 12 {
        let (q, qd_minus) = tossed(&mut rng);
        let point = lowest_point(&nominal, &q, Vector3::z()).unwrap();
        assert_eq!(point.frame, frame);
        let strike = truth.impact(&q, &qd_minus).at(point).normal(Vector3::z());
        let hit = strike.resolve(law.as_ref()).unwrap();
        let (qd_plus, normal) = (hit.qd_plus, Vector3::z());
        let jump = ChainJump { q, qd_minus, qd_plus, point, normal };
        match MeasuredImpact::of_chain(&nominal, &jump) {
            Ok(impact) => impacts.push(impact),
            // a bound on the contact points that recede, about half of all
            Err(FitError::NoApproach { .. }) if receding < 30 => receding += 1,
            Err(error) => panic!("{error}"),
        }
    }
    let options = FitOptions { law: "chatterjee-ruina", inertia: true, ..ALL };
    let fit = fit_velocities(&impacts, Some(&nominal), &options, QUIET).unwrap();
    assert_eq!(fit.coefficients.len(), 3);
    for (c, truth) in fit.coefficients.iter().zip([0.4, 0.2, 1.3]) {
        close(c.name, c.value, truth, 1e-6);
    }
    let rigid = fit_velocities(&impacts, Some(&nominal), &FitOptions { inertia: false, ..options }, QUIET).unwrap();
    assert!(rigid.train.mean > 1e-3, "the nominal inertia must leave a residual: {}", rigid.train.mean);
    assert_eq!(fit_velocities(&impacts, None, &options, QUIET).unwrap_err(), FitError::NoInertia);
}

/// Samples of both flights around an impact at time 0, with noise in position and rotation.
fn flights(chain: &Chain, q: &[f64], qd: [&[f64]; 2], sigma: f64, rng: &mut Rng) -> (Flight, Flight) {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let mut fly = |qd: &[f64], sign: f64| {
        let times: Vec<f64> = (0..8).map(|k| sign * (0.003 + 0.0068 * f64::from(k))).collect();
        let flown = free_motion_at(chain, q, qd, gravity, &times).unwrap();
        let mut shake = |pose: &[f64]| {
            let step: Vec<f64> = (0..chain.nv()).map(|_| sigma * normal(rng)).collect();
            chain.integrate(pose, &step, 1.0).unwrap()
        };
        let mut samples: Vec<(f64, Vec<f64>)> = flown.iter().map(|m| (m.time, shake(&m.q))).collect();
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (times, poses) = samples.into_iter().unzip();
        Flight { times, poses }
    };
    (fly(qd[0], -1.0), fly(qd[1], 1.0))
}

#[test]
fn exact_flights_give_time_pose_and_velocities_of_the_impact() {
    let mut rng = Rng::with_seed(10);
    let arm = uniform_chain(3, 0.6, 1.0).unwrap();
    let (arm_q, arm_qd) = (vec![3.1, -0.4, 0.9], [vec![3.0, -2.0, 4.0], vec![-1.0, 2.5, -6.0]]);
    let free = load("box");
    let (q, before) = tossed(&mut rng);
    let (_, later) = tossed(&mut rng);
    for (chain, q, qd) in [(&arm, arm_q, arm_qd), (&free, q, [before, later])] {
        let (before, after) = flights(chain, &q, [&qd[0], &qd[1]], 0.0, &mut rng);
        let joined = join_flights(chain, GRAVITY, &before, &after).unwrap();
        // errors of 1e-10 s and 1e-10 m are rounding errors of the integration (1e-12) over flights of 0.05 s
        close("time", joined.time, 0.0, 1e-9);
        assert_eq!([&joined.q, &joined.qd_minus, &joined.qd_plus].map(Vec::len), [chain.nq(), chain.nv(), chain.nv()]);
        for (a, b) in joined.q.iter().zip(&q) {
            close("pose", *a, *b, 1e-8);
        }
        for (found, truth) in [(&joined.qd_minus, &qd[0]), (&joined.qd_plus, &qd[1])] {
            for (a, b) in found.iter().zip(truth) {
                close("velocity", *a, *b, 1e-7);
            }
        }
        assert!(joined.rest < 1e-10, "{}", joined.rest);
    }
}

/// A mistracked sample, of whatever size and wherever it is, is found and left out: the estimate is that of the other samples.
#[test]
fn a_mistracked_sample_is_left_out_and_reported() {
    let mut rng = Rng::with_seed(12);
    let arm = uniform_chain(3, 0.6, 1.0).unwrap();
    let (arm_q, arm_qd) = (vec![0.3, -0.4, 0.9], [vec![3.0, -2.0, 4.0], vec![-1.0, 2.5, -6.0]]);
    let free = load("box");
    let (q, before) = tossed(&mut rng);
    let (_, later) = tossed(&mut rng);
    for (chain, q, qd) in [(&arm, arm_q, arm_qd), (&free, q, [before, later])] {
        let clean = flights(chain, &q, [&qd[0], &qd[1]], 2e-4, &mut rng);
        let truth = join_flights(chain, GRAVITY, &clean.0, &clean.1).unwrap();
        assert!(truth.outliers.is_empty(), "{:?}", truth.outliers);
        for size in [0.05, 1.0, 10.0, 1e4] {
            for place in [0, 3, 7, 8, 15] {
                let (mut before, mut after) = clean.clone();
                let (flight, k) = if place < 8 { (&mut before, place) } else { (&mut after, place - 8) };
                let mut step = vec![0.0; chain.nv()];
                (step[0], step[1]) = (size, -size);
                flight.poses[k] = chain.integrate(&flight.poses[k], &step, 1.0).unwrap();
                let time = flight.times[k];
                let found = join_flights(chain, GRAVITY, &before, &after).unwrap();
                assert_eq!(found.outliers, [time], "{} m or rad at {time} s", size);
                // One sample of sixteen less moves the estimate by less than its own deviation.
                for (a, b) in [(&found.qd_minus, &truth.qd_minus), (&found.qd_plus, &truth.qd_plus)] {
                    for (a, b) in a.iter().zip(b) {
                        assert!((a - b).abs() < 0.15, "{size} at {time}: {a} instead of {b}");
                    }
                }
                assert!(found.rest < 2.0 * truth.rest, "{} {}", found.rest, truth.rest);
            }
        }
    }
}

#[test]
fn noisy_flights_give_unbiased_velocities_and_their_standard_deviation() {
    let mut rng = Rng::with_seed(11);
    let free = load("box");
    let toward = |(q, qd): &(Vec<f64>, Vec<f64>)| {
        let point = lowest_point(&free, q, Vector3::z()).unwrap();
        let contact = free.impact(q, qd).at(point).normal([0.0, 0.0, 1.0]).contact().unwrap();
        contact.problem().approach_speed() > 0.5
    };
    let (q, qd) = std::iter::repeat_with(|| tossed(&mut rng)).find(toward).unwrap();
    let hit = {
        let point = lowest_point(&free, &q, Vector3::z()).unwrap();
        let law = law_by_name::<3>("energetic", rough(0.4, 0.2)).unwrap();
        free.impact(&q, &qd).at(point).normal([0.0, 0.0, 1.0]).resolve(law.as_ref()).unwrap()
    };
    assert!(hit.impulse.norm() > 0.0);
    let (runs, nv) = (16, free.nv());
    let mut misses = Vec::new();
    let mut doubt = 0.0;
    let mass_matrix = free.workspace().update(&free, &q).unwrap().mass_matrix() / free.total_mass();
    let mut scatter = 0.0;
    for _ in 0..runs {
        let (before, after) = flights(&free, &q, [&qd, &hit.qd_plus], 5e-4, &mut rng);
        let joined = join_flights(&free, GRAVITY, &before, &after).unwrap();
        let miss = DVector::from_iterator(
            nv,
            (0..nv).map(|k| joined.qd_plus[k] - joined.qd_minus[k] - (hit.qd_plus[k] - qd[k])),
        );
        doubt += joined.deviation.powi(2) / f64::from(runs);
        scatter += miss.dot(&(&mass_matrix * &miss)) / f64::from(runs);
        misses.push(miss);
    }
    for k in 0..nv {
        let of: Vec<f64> = misses.iter().map(|miss| miss[k]).collect();
        let mean = of.iter().sum::<f64>() / f64::from(runs);
        let deviation = (of.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(runs - 1)).sqrt();
        // five standard errors of 16 samples, for six numbers
        assert!(mean.abs() < 5.0 * deviation / f64::from(runs).sqrt(), "qd[{k}]: {mean} ± {deviation}");
        assert!(deviation > 0.0);
    }
    // the standard error of a variance from 16 samples of six numbers is about 15 %
    assert!((0.5..2.0).contains(&(scatter / doubt)), "{scatter} against {doubt}");
}

#[test]
fn invalid_flights_are_refused() {
    let arm = uniform_chain(2, 0.6, 1.0).unwrap();
    let flight = |times: &[f64]| Flight { times: times.to_vec(), poses: times.iter().map(|t| vec![*t, 0.0]).collect() };
    let join = |before: &Flight, after: &Flight| join_flights(&arm, GRAVITY, before, after).unwrap_err().to_string();
    let good = flight(&[0.1, 0.2, 0.3]);
    assert_eq!(join(&flight(&[0.0]), &good), "samples of a flight (two or more): 1, but 2 are needed");
    assert_eq!(
        join(&flight(&[0.0, 0.2]), &good),
        "the flight before the impact ends at 0.2 s and the flight after it begins at 0.1 s: it must begin later"
    );
    assert_eq!(
        join(&flight(&[0.0, -0.1]), &good),
        "the times of the flight before the impact must ascend: -0.1 s follows 0 s"
    );
    let mut short = good.clone();
    short.poses.pop();
    assert_eq!(join(&flight(&[0.0, 0.05]), &short), "poses of a flight, one for each time: 2, but 3 are needed");
    short.times = vec![0.1, f64::NAN];
    assert_eq!(
        join(&flight(&[0.0, 0.05]), &short),
        "the list of a flight's times contains NaN: every number must be finite"
    );
    let mut long = good.clone();
    long.poses[0].push(0.0);
    assert!(join(&flight(&[0.0, 0.05]), &long).starts_with("q has 3 numbers, 2 are needed"));
}

/// A box in free flight: the start follows from the poses of all samples, and a mistracked one does not move it.
#[test]
fn the_start_of_a_flight_follows_from_its_poses() {
    let mut rng = Rng::with_seed(14);
    let free = load("box");
    let (q, qd) = tossed(&mut rng);
    let times: Vec<f64> = (0..16).map(|k| 0.3 + 0.0068 * f64::from(k)).collect();
    let since: Vec<f64> = times.iter().map(|t| t - 0.3).collect();
    let flown = free_motion_at(&free, &q, &qd, GRAVITY, &since).unwrap();
    let mut flight = Flight { times, poses: flown.into_iter().map(|moment| moment.q).collect() };
    for mistracked in [false, true] {
        if mistracked {
            flight.poses[0] = free.integrate(&flight.poses[0], &[0.05, 0.0, 0.0, 0.0, 0.3, 0.0], 1.0).unwrap();
        }
        let found = launch(&free, GRAVITY, &flight).unwrap();
        // rounding errors of the integration (1e-12) over a flight of 0.1 s
        for (a, b) in found.qd.iter().zip(&qd) {
            close("velocity", *a, *b, 1e-7);
        }
        close("distance of the poses", free.difference(&found.q, &q).unwrap().iter().map(|x| x.abs()).sum(), 0.0, 1e-8);
        assert_eq!(found.outliers, if mistracked { vec![0.3] } else { vec![] });
    }
}

/// The scatter of starts that are fitted to noisy poses is that of the starts drawn from the estimate.
#[test]
fn the_covariance_of_a_fitted_start_is_its_scatter() {
    let mut rng = Rng::with_seed(15);
    let free = load("box");
    let (q, qd) = tossed(&mut rng);
    let times: Vec<f64> = (0..12).map(|k| 0.0068 * f64::from(k)).collect();
    let flown = free_motion_at(&free, &q, &qd, GRAVITY, &times).unwrap();
    let (mut scatter, mut drawn, runs) = (0.0, 0.0, 40);
    for _ in 0..runs {
        let poses = flown.iter().map(|moment| {
            let step: Vec<f64> = (0..6).map(|_| 5e-4 * normal(&mut rng)).collect();
            free.integrate(&moment.q, &step, 1.0).unwrap()
        });
        let found = launch(&free, GRAVITY, &Flight { times: times.clone(), poses: poses.collect() }).unwrap();
        let again = found.drawn(&free, &mut || normal(&mut rng)).unwrap();
        let away = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        scatter += away(&found.qd, &qd);
        drawn += away(&again.1, &found.qd);
    }
    // sums of 40 squares of six numbers, dominated by three rates: the ratio has a standard error of about 20 %
    assert!((0.4..2.5).contains(&(drawn / scatter)), "{drawn} against {scatter}");
    assert!(scatter > 0.0);
}

/// A toss of a ball whose table has velocities with an error: its roll-out from the fitted start is the toss, that from the
/// table is not. The error of the early part belongs to the samples to 0.1 s after the first impact.
#[test]
fn a_fitted_start_does_not_need_the_velocities_of_the_table() {
    let ball = load("ball");
    let law = carom_impact::Energetic { restitution: 0.62, friction: 0.13 };
    let truth = thrown(&ball, law, &mut Rng::with_seed(16), 3);
    let mut wrong = truth.clone();
    for sample in wrong.iter_mut().flat_map(|toss| &mut toss.samples) {
        sample.qd[0] += 0.1;
    }
    let tosses = Tosses { chain: ball, urdf: "ball.urdf".into(), tosses: wrong };
    let rule = carom_sim::ContactRule::new(law);
    let errors = |start| {
        let options = RollOutOptions { start, tolerance: 1e-9, ..RollOutOptions::default() };
        let rolled = tosses.roll_out(&rule, &options);
        rolled.into_iter().map(|one| one.unwrap()).collect::<Vec<_>>()
    };
    for (fitted, given) in errors(Start::Fitted).iter().zip(&errors(Start::Given)) {
        assert!(fitted.fitted && !given.fitted);
        // the error of the velocities is 1e-7 m/s, that of the integration 1e-9; an impact multiplies neither
        assert!(fitted.pose_error(0.0524) < 1e-9, "{}", fitted.pose_error(0.0524));
        let early = given.early_error(0.0524).unwrap();
        assert!(given.pose_error(0.0524) > early && early > 1e-4, "{} {early}", given.pose_error(0.0524));
        // after t seconds the position is off by at most 0.1 t, and by that in flight: the early part ends before 0.4 s
        assert!(early < 0.1_f64.powi(2) * 0.4_f64.powi(2) / 0.0524);
    }
}

/// A ball with spin is thrown at the floor: the bounces identify restitution, the change of spin identifies friction.
#[test]
fn a_fit_to_tosses_of_a_ball_recovers_the_coefficients() {
    let ball = load("ball");
    let law = carom_impact::Energetic { restitution: 0.62, friction: 0.13 };
    let tosses = thrown(&ball, law, &mut Rng::with_seed(12), 8);
    let tosses = Tosses { chain: ball, urdf: "ball.urdf".into(), tosses };
    let options = FitOptions { train: 0.5, ..ALL };
    let fit = fit_trajectories(&tosses, &options, &RollOutOptions::default(), QUIET).unwrap();
    // resolution of the search: 1/50 of its range, halved a few times
    close("restitution", fit.coefficients[0].value, 0.62, 5e-3);
    close("friction", fit.coefficients[1].value, 0.13, 5e-3);
    assert_eq!((fit.train.count, fit.test.unwrap().count), (4, 4));
    let test = fit.test.unwrap();
    assert!(test.mean < 0.05 && test.below_half == Some(1.0), "{test:?}");
    assert!(fit.notes[0].starts_with("fitted to trajectories"));
}
