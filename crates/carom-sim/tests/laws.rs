//! Laws as values: a user's own law in a scene, and the tangential restitution in scene files.

use carom_impact::{
    ChatterjeeRuina, Coefficients, Energetic, Frictionless, ImpactError, ImpactOutcome, ImpactProblem, LAW_NAMES, Law,
    Newton,
};
use carom_sim::{
    ChainImpact, ContactLaw, ContactRule, Event, EventKind, Impacts, Moment, Scene, SimError, Simulation, States,
};
use carom_testing::scenes::{guided_box, shipped, users_law, with_robots};
use nalgebra::Vector3;

/// Newton's law with a restitution that decreases with the approach speed.
fn slowing() -> impl Law<f64, 3> + Send + Sync + 'static {
    users_law("slowing", |problem| {
        let restitution = 1.0 / (1.0 + 5.0 * problem.approach_speed());
        let hit = Newton { restitution, friction: 0.2 }.resolve(problem)?;
        Ok(ImpactOutcome { law: "slowing", ..hit })
    })
}

/// The impacts of single contacts of a run while no other lasts, each beside that of the law alone at the same state.
fn beside(sim: &Simulation, events: &[Event], law: &dyn Law<f64, 3>) -> Vec<(ChainImpact, ChainImpact)> {
    let mut lasting = std::collections::BTreeSet::new();
    let alone = |event: &Event| {
        match &event.kind {
            EventKind::Mode { mode } => lasting.extend(mode.touch()),
            EventKind::LiftOff { touch } => {
                lasting.remove(touch);
            }
            _ => {}
        }
        // Others that last have impulses too.
        if !lasting.is_empty() {
            return None;
        }
        let EventKind::Impact { touch, hit } = &event.kind else { return None };
        let moment = Moment { time: event.time, q: event.q.clone(), qd: event.qd_minus.clone() };
        let [point, normal] = sim.touching_point(*touch, &moment).unwrap().unwrap();
        let frame = sim.chain.frame(sim.touches[*touch].link().unwrap()).unwrap();
        let offset = sim.chain.workspace().update(&sim.chain, &event.q).unwrap().pose(frame).inverse().point(point);
        let strike = sim.chain.impact(&event.q, &event.qd_minus).at(frame).offset(offset).normal(normal);
        Some(((**hit).clone(), strike.resolve(law).unwrap()))
    };
    events.iter().filter_map(alone).collect()
}

fn far(a: &ChainImpact, b: &ChainImpact) -> f64 {
    let apart = a.qd_plus.iter().zip(b.qd_plus.iter()).map(|(a, b)| (a - b).abs());
    apart.fold((a.impulse - b.impulse).norm(), f64::max)
}

/// The scene with one law at all contacts with surfaces.
fn under(mut scene: Scene, law: ContactLaw) -> Scene {
    for touch in scene.simulation.touches.iter_mut().filter(|touch| touch.link().is_some()) {
        touch.contact = ContactRule::new(law.clone());
    }
    scene
}

#[test]
fn impacts_of_a_scene_with_a_users_law_are_those_of_the_law() {
    for (file, least) in [("planar2", 1), ("planar3", 3), ("strike7", 1), ("ball", 1)] {
        let plan = under(shipped(file), ContactLaw::new(slowing(), 0.5, 0.2)).plan().unwrap();
        let run = plan.simulation.run(&plan.q, &plan.qd, 0.8).unwrap();
        let pairs = beside(&plan.simulation, &run.events, &slowing());
        assert!(pairs.len() >= least, "{file}: {} impacts", pairs.len());
        for (hit, alone) in &pairs {
            assert_eq!(hit.contact.law, "slowing");
            assert!(far(hit, alone) < 1e-9, "{file}: {:?} {:?}", hit.qd_plus, alone.qd_plus);
            let approach = -alone.contact.u_minus[2];
            let rebound = hit.contact.u_plus[2];
            assert!((rebound - approach / (1.0 + 5.0 * approach)).abs() < 1e-12, "{file}: {approach} {rebound}");
        }
    }
}

/// A law with an impulse that is too small, as its author computes the outcome: by the impulse alone, or number by number.
struct Weak {
    share: f64,
    by_hand: bool,
}

impl Law<f64, 3> for Weak {
    fn name(&self) -> &'static str {
        "weak"
    }

    fn resolve(&self, problem: &ImpactProblem<f64, 3>) -> Result<ImpactOutcome<f64, 3>, ImpactError> {
        let hit = Frictionless { restitution: 0.0 }.resolve(problem)?;
        let impulse = hit.impulse * self.share;
        if self.by_hand {
            let u_plus = problem.u_minus() + problem.delassus() * impulse;
            return Ok(ImpactOutcome { law: self.name(), impulse, u_plus, ..hit });
        }
        ImpactOutcome::of_impulse(self.name(), problem, impulse)
    }
}

/// A contact that goes on approaching has not been resolved: it is the law's error, in a scene, in a strike and in a batch, and not a
/// motion through the surface.
#[test]
fn a_users_law_that_leaves_the_contact_approaching_is_refused() {
    let leaves = |error: &SimError| matches!(error, SimError::Impact(ImpactError::Outcome { law: "weak", check, .. }) if check.contains("approaching"));
    for (share, by_hand) in [(0.0, false), (0.5, false), (0.0, true), (0.9, true)] {
        let law = || Weak { share, by_hand };
        for file in ["planar2", "ball"] {
            let plan = under(shipped(file), ContactLaw::new(law(), 0.0, 0.0)).plan().unwrap();
            let error = plan.simulation.run(&plan.q, &plan.qd, 0.8).unwrap_err();
            assert!(leaves(&error), "{file}: {error:?}");
        }
        for normal in [Vector3::y(), Vector3::new(0.1, 1.0, 0.2)] {
            let arm = carom_chain::uniform_chain(2, 1.0, 1.0).unwrap();
            let (q, qd) = ([0.3, 0.7], [-0.5, -1.0]);
            let strike = arm.impact(&q, &qd).at(arm.frame("tip").unwrap()).normal(normal);
            assert!(leaves(&strike.clone().resolve(&law()).unwrap_err()));
            assert!(leaves(&strike.clone().contact().unwrap().resolve(&law()).unwrap_err()));
            assert!(leaves(&strike.clone().contact().unwrap().branches(&law()).unwrap_err()));
            let columns = [[0.3; 5], [0.7; 5], [-0.5; 5], [-1.0; 5]];
            let states = States { q: &[&columns[0], &columns[1]], qd: &[&columns[2], &columns[3]] };
            let mut refused = 0;
            strike
                .prepare()
                .unwrap()
                .many(states, &law(), |_, hit| refused += usize::from(leaves(&hit.unwrap_err())))
                .unwrap();
            assert_eq!(refused, 5);
        }
    }
}

#[test]
fn the_plan_names_a_users_law_and_its_friction_is_not_left_out() {
    let made = |law: ContactLaw| {
        let mut scene = under(shipped("planar2"), law);
        scene.simulation.neglect = Some(0.99);
        let plan = scene.plan().unwrap();
        let run = plan.simulation.run(&plan.q, &plan.qd, 0.5).unwrap();
        (plan, run)
    };
    let (plan, run) = made(ContactLaw::new(slowing(), 0.5, 0.02));
    let said: Vec<&str> = plan.kept.iter().filter(|it| it.what == "law").map(|it| it.choice.as_str()).collect();
    assert_eq!(
        said,
        ["slowing, restitution 0.5, friction 0.02", "slowing: impacts of one contact, without any approximation"]
    );
    assert!(plan.bounded.iter().all(|it| it.what != "friction"), "{:?}", plan.bounded);
    assert_eq!(run.summary.statistics.neglected_frictions, 0);
    let (plan, run) = made(Newton { restitution: 0.5, friction: 0.02 }.into());
    assert_eq!(plan.kept.iter().filter(|it| it.what == "law").count(), 1);
    assert!(plan.bounded.iter().any(|it| it.what == "friction"));
    assert!(run.summary.statistics.neglected_frictions > 0);
    // Without friction only laws of carom-impact are known to agree.
    assert!(made(ContactLaw::new(slowing(), 0.5, 0.0)).0.left_out.iter().all(|it| it.what != "friction"));
    assert!(made(Frictionless { restitution: 0.5 }.into()).0.left_out.iter().any(|it| it.what == "friction"));
}

#[test]
fn several_contacts_have_the_restitution_that_is_given_with_a_users_law() {
    let run = |law: ContactLaw| guided_box(ContactRule::new(law)).run(&[0.5], &[0.0], 0.4).unwrap();
    let (own, named) =
        (run(ContactLaw::new(slowing(), 0.3, 0.2)), run(Newton { restitution: 0.3, friction: 0.2 }.into()));
    assert_eq!(format!("{:?}", own.events), format!("{:?}", named.events));
    let hit = &own.events[0];
    assert!(matches!(hit.kind, EventKind::Several { .. }), "{:?}", hit.kind);
    assert!((hit.qd_plus[0] + 0.3 * hit.qd_minus[0]).abs() < 1e-10, "{hit:?}");
}

#[test]
fn rules_are_compared_shown_and_checked_by_value() {
    let law = |e| ContactLaw::from(Newton { restitution: e, friction: 0.2 });
    let coefficients = Coefficients { restitution: 0.5, friction: 0.2, ..Coefficients::default() };
    assert_eq!(law(0.5), law(0.5));
    assert_eq!(law(0.5), ContactLaw::named("newton", coefficients).unwrap());
    assert_ne!(law(0.5), law(0.6));
    assert_ne!(law(0.5), ContactLaw::named("energetic", coefficients).unwrap());
    let frictionless = ContactLaw::named("frictionless", coefficients).unwrap();
    assert_ne!(frictionless, Frictionless { restitution: 0.5 }.into(), "the friction of lasting contacts differs");
    let own = ContactLaw::new(slowing(), 0.5, 0.2);
    assert_eq!(own, own.clone());
    assert_ne!(own, ContactLaw::new(slowing(), 0.5, 0.2));
    assert_ne!(own, law(0.5));
    let rule = ContactRule::new(own);
    assert_eq!(rule, rule.clone());
    assert_eq!(
        format!("{rule:?}"),
        r#"ContactRule { law: ContactLaw { law: "slowing", restitution: 0.5, friction: 0.2 }, latch: false, compliance: None, relative_stiffness: 1.0 }"#
    );
    assert!(format!("{:?}", law(0.5)).contains("Newton"), "{:?}", law(0.5));
    for (name, law) in LAW_NAMES.into_iter().map(|name| (name, ContactLaw::named(name, coefficients).unwrap())) {
        assert_eq!((law.name(), law.restitution(), law.friction()), (name, 0.5, 0.2));
    }

    let refused = |law: ContactLaw| {
        let sim = guided_box(ContactRule::new(law));
        sim.run(&[0.5], &[0.0], 0.4).unwrap_err().to_string()
    };
    let lies = "box on floor, corner 1: restitution is 1.5: a coefficient of restitution lies between 0 and 1";
    assert_eq!(refused(ContactLaw::new(slowing(), 1.5, 0.2)), lies);
    assert_eq!(refused(law(1.5)), lies);
    let negative = "box on floor, corner 1: friction is -0.1: a coefficient of friction is finite and not negative";
    assert_eq!(refused(ContactLaw::new(slowing(), 0.5, -0.1)), negative);
    let tangential = ChatterjeeRuina { restitution: 0.5, tangential_restitution: -1.5, friction: 0.2 };
    assert_eq!(
        refused(tangential.into()),
        "box on floor, corner 1: tangential_restitution is -1.5: a coefficient of tangential restitution lies between -1 and 1"
    );
    // Two values of one coefficient.
    let another = "the impact law has another one: give both the same value";
    let stronge = Energetic { restitution: 0.5, friction: 0.2 };
    assert_eq!(
        refused(ContactLaw::new(stronge, 0.6, 0.2)),
        format!("box on floor, corner 1: restitution is 0.6: {another}")
    );
    assert_eq!(
        refused(ContactLaw::new(stronge, 0.5, 0.3)),
        format!("box on floor, corner 1: friction is 0.3: {another}")
    );
}

/// The scene of a two-link arm that strikes a wall obliquely, with other text in `[[surface]]` and after it.
fn written(surface: &str, rest: &str) -> Result<Scene, String> {
    let text = format!(
        "[robot]\nurdf = \"planar2.urdf\"\nq = [0.7854, -1.5708]\n\
         tip_velocity = {{ speed = 0.2, angle_deg = 45, along = [0, -1, 0] }}\n\
         [[surface]]\nname = \"wall\"\nshape = {{ halfspace = {{ point = [0.6364, 0, 0], normal = [-1, 0, 0] }} }}\n\
         {surface}\n{rest}\n[run]\nduration = 0.1\n"
    );
    with_robots(&text).map_err(|why| why.to_string())
}

#[test]
fn the_tangential_restitution_of_a_scene_is_that_of_the_law_alone() {
    let law = |tangential_restitution| ChatterjeeRuina { restitution: 0.4, tangential_restitution, friction: 5.0 };
    let all = "law = \"chatterjee-ruina\"\nrestitution = 0.4\nfriction = 5\n";
    let keyed = |value: f64| format!("tangential_restitution = {value}\n");
    let [base, own, pair] = [format!("[contact]\n{all}"), "contact = ".to_owned(), "[[contact.pair]]\n".to_owned()];
    let cases = [
        ("contact", String::new(), format!("{base}{}", keyed(0.6)), 0.6),
        ("default", String::new(), base.clone(), 0.0),
        ("surface", format!("{own}{{ tangential_restitution = 0.3 }}"), format!("{base}{}", keyed(0.6)), 0.3),
        (
            "pair",
            format!("{own}{{ tangential_restitution = 0.3 }}"),
            format!("{base}{pair}link = \"tip\"\n{}", keyed(-0.5)),
            -0.5,
        ),
        // The value is kept for a surface whose law uses it.
        (
            "kept",
            format!("{own}{{ law = \"chatterjee-ruina\" }}"),
            format!("[contact]\nlaw = \"energetic\"\nrestitution = 0.4\nfriction = 5\n{}", keyed(0.6)),
            0.6,
        ),
    ];
    let mut impulses = Vec::new();
    for (name, surface, rest, expected) in cases {
        let scene = written(&surface, &rest).unwrap();
        assert!(scene.warnings.is_empty(), "{name}: {:?}", scene.warnings);
        let plan = scene.plan().unwrap();
        if name == "contact" {
            let said = plan.kept.iter().find(|it| it.what == "law").unwrap();
            assert_eq!(said.choice, "chatterjee-ruina, restitution 0.4, tangential restitution 0.6, friction 5");
        }
        let run = plan.simulation.run(&plan.q, &plan.qd, 0.1).unwrap();
        let pairs = beside(&plan.simulation, &run.events, &law(expected));
        assert!(!pairs.is_empty(), "{name}");
        for (hit, alone) in &pairs {
            assert!(far(hit, alone) < 1e-10, "{name}: {:?} {:?}", hit.qd_plus, alone.qd_plus);
        }
        impulses.push(pairs[0].0.impulse);
    }
    for (k, other) in [(0, 1), (0, 2), (1, 3), (1, 4)] {
        let apart = (impulses[k] - impulses[other]).norm();
        assert!(apart > 1e-3, "the cone must not limit the impulses: {impulses:?}");
    }
}

#[test]
fn invalid_laws_and_coefficients_of_scene_files_are_refused_with_key_value_and_rule() {
    let rule = "a coefficient of tangential restitution lies between -1 and 1";
    let friction = "a coefficient of friction is finite and not negative";
    let laws = format!("law = \"hertz\": the laws are {}", LAW_NAMES.join(", "));
    for (surface, rest, expected) in [
        ("", "[contact]\ntangential_restitution = 1.5", format!("[contact]: tangential_restitution is 1.5: {rule}")),
        (
            "contact = { tangential_restitution = -2 }",
            "",
            format!("[[surface]] 'wall': tangential_restitution is -2: {rule}"),
        ),
        (
            "",
            "[[contact.pair]]\nlink = \"tip\"\ntangential_restitution = nan",
            format!("[[contact.pair]] tip on wall: tangential_restitution is NaN: {rule}"),
        ),
        (
            "",
            "[[contact.pair]]\njoint = \"elbow\"\ntangential_restitution = 0.1",
            "[[contact.pair]] has joint: joint limits have restitution, latch and relative_stiffness only, remove law, \
             tangential_restitution, friction and compliance"
                .to_owned(),
        ),
        ("", "[contact]\nfriction = -0.1", format!("[contact]: friction is -0.1: {friction}")),
        ("", "[contact]\nfriction = inf", format!("[contact]: friction is inf: {friction}")),
        ("", "[contact]\nfriction = nan", format!("[contact]: friction is NaN: {friction}")),
        ("", "[contact]\nlaw = \"hertz\"", format!("[contact] {laws}")),
        ("contact = { law = \"hertz\" }", "", format!("[[surface]] 'wall': contact {laws}")),
        ("", "[[contact.pair]]\nlink = \"tip\"\nlaw = \"hertz\"", format!("[[contact.pair]] {laws}")),
    ] {
        assert_eq!(written(surface, rest).unwrap_err(), format!("<scene>: {expected}"));
    }
    let misspelt = written("", "[contact]\ntangental_restitution = 0.1").unwrap_err();
    assert!(misspelt.ends_with("did you mean `tangential_restitution`?"), "{misspelt}");
}

#[test]
fn a_tangential_restitution_that_no_law_uses_is_a_warning() {
    let warns = |surface: &str, rest: &str| written(surface, rest).unwrap().warnings;
    let text = "tangential_restitution: only the law \"chatterjee-ruina\" of rigid contacts uses it, and no contact of this scene has it";
    assert_eq!(warns("", "[contact]\nlaw = \"newton\"\ntangential_restitution = 0.1"), [text]);
    assert_eq!(warns("contact = { tangential_restitution = 0.1 }", ""), [text]);
    assert_eq!(warns("", "[[contact.pair]]\nlink = \"tip\"\ntangential_restitution = 0.1"), [text]);
    let soft = "law = \"chatterjee-ruina\"\nrestitution = 0.5\ncompliance = { stiffness = 1e6 }";
    assert_eq!(warns("", &format!("[contact]\n{soft}\ntangential_restitution = 0.1")), [text]);
    let zero = "contact = { law = \"chatterjee-ruina\", tangential_restitution = 0 }";
    assert!(warns(zero, "[contact]\ntangential_restitution = 0.1").is_empty());
    assert!(warns("", "[contact]\nlaw = \"newton\"\ntangential_restitution = 0").is_empty());
}
