//! Mechanisms of the tests of loops: uniform rods with hinges about z, in the x–y plane.

use crate::build::of_urdf;
use carom_chain::Chain;
use carom_sim::{Loop, LoopFrame, LoopJoint};
use nalgebra::Vector3;

/// A rod along its x axis, with its hinge in its origin.
#[derive(Debug)]
pub struct Rod<'a> {
    /// Of its link; the joint has this name with `j_` before it.
    pub name: &'a str,
    /// The link on which its hinge is.
    pub parent: &'a str,
    /// Distance of the hinge along the x axis of the parent, m.
    pub at: f64,
    /// m
    pub length: f64,
    /// kg
    pub mass: f64,
    /// More elements of the link.
    pub shapes: String,
    /// More elements of the joint.
    pub joint: &'a str,
}

impl<'a> Rod<'a> {
    /// A rod of 1 kg.
    pub fn new(name: &'a str, parent: &'a str, at: f64, length: f64) -> Self {
        Self { name, parent, at, length, mass: 1.0, shapes: String::new(), joint: "" }
    }
}

/// A ball on a rod at this distance from its hinge.
pub fn ball(x: f64, radius: f64) -> String {
    format!(r#"<collision><origin xyz="{x} 0 0"/><geometry><sphere radius="{radius}"/></geometry></collision>"#)
}

/// Rods on the link `ground`.
pub fn chain(rods: &[Rod]) -> Chain {
    chain_and(rods, "")
}

/// Rods, and more links and joints.
pub fn chain_and(rods: &[Rod], more: &str) -> Chain {
    let mut text = String::from(r#"<robot name="mechanism"><link name="ground"/>"#);
    for Rod { name, parent, at, length, mass, shapes, joint } in rods {
        let (half, inertia) = (length / 2.0, mass * length * length / 12.0);
        let kind = if joint.contains("<limit") { "revolute" } else { "continuous" };
        text += &format!(
            r#"<link name="{name}"><inertial><origin xyz="{half} 0 0"/><mass value="{mass}"/>
            <inertia ixx="{}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>{shapes}</link>
            <joint name="j_{name}" type="{kind}"><parent link="{parent}"/><child link="{name}"/>
            <origin xyz="{at} 0 0"/><axis xyz="0 0 1"/>{joint}</joint>"#,
            0.01 * inertia
        );
    }
    text += more;
    text += "</robot>";
    of_urdf(&text)
}

/// A parallelogram: two upright rods 1 m apart, at the angle q₁ to the ground, with a coupler that stays level; q = (θ, −θ, θ).
/// Its inertia about θ is 2 m l²/3 + m l² = 5/3, and the torque of its weight 2 m g l cos θ.
pub fn parallelogram(shapes: String, joint: &str) -> (Chain, Vec<Loop>) {
    let rods = [
        Rod { joint, ..Rod::new("left", "ground", 0.0, 1.0) },
        Rod { shapes, ..Rod::new("coupler", "left", 1.0, 1.0) },
        Rod::new("right", "ground", 1.0, 1.0),
    ];
    (chain(&rods), vec![closure(pin(), ("coupler", 1.0), (Some("right"), 1.0))])
}

/// Of [`parallelogram`] about θ, kg m².
pub const PARALLELOGRAM_INERTIA: f64 = 5.0 / 3.0;

/// A pin about z.
pub fn pin() -> LoopJoint {
    LoopJoint::Pin { axis: Vector3::z() }
}

/// A loop at these places on the x axes of two links.
pub fn closure(joint: LoopJoint, one: (&str, f64), other: (Option<&str>, f64)) -> Loop {
    let frame = |link, x: f64| LoopFrame::new(link, [x, 0.0, 0.0], [0.0; 3]);
    Loop { name: "closure".into(), joint, frames: [frame(Some(one.0), one.1), frame(other.0, other.1)] }
}

/// Where a four-bar linkage is cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cut {
    /// Between coupler and rocker.
    Joint,
    /// Between rocker and ground: the rocker hangs on the coupler.
    Foot,
}

/// A four-bar linkage: the lengths of crank, coupler and rocker, and the distance of the feet on the ground, m.
#[derive(Debug, Clone, Copy)]
pub struct FourBar {
    /// m
    pub crank: f64,
    /// m
    pub coupler: f64,
    /// m
    pub rocker: f64,
    /// m
    pub ground: f64,
}

impl FourBar {
    /// A crank-rocker whose crank turns around (Grashof) and whose coupler and rocker are never near one line.
    pub fn random(rng: &mut fastrand::Rng) -> Self {
        loop {
            let mut length = |least: f64, most: f64| least + (most - least) * rng.f64();
            let own = Self {
                crank: length(0.15, 0.35),
                coupler: length(0.6, 1.1),
                rocker: length(0.5, 1.0),
                ground: length(0.6, 1.1),
            };
            // The transmission angle at the ends of the stroke.
            let cosine =
                |side: f64| (own.coupler.powi(2) + own.rocker.powi(2) - side * side) / (2.0 * own.coupler * own.rocker);
            let ends = [own.ground - own.crank, own.ground + own.crank];
            if ends.iter().all(|side| cosine(*side).abs() < 0.85) {
                return own;
            }
        }
    }

    /// World angles of coupler and rocker at a crank angle by Freudenstein's equation (1955), the open branch.
    pub fn angles(&self, crank: f64) -> [f64; 2] {
        let Self { crank: a, coupler: b, rocker: c, ground: d } = *self;
        let (sine, cosine) = crank.sin_cos();
        let root = |k1: f64, k2: f64, k3: f64| {
            let (p, q, r) = (cosine - k1 + k2 * cosine + k3, -2.0 * sine, k1 + (k2 - 1.0) * cosine + k3);
            2.0 * (-q - (q * q - 4.0 * p * r).sqrt()).atan2(2.0 * p)
        };
        let rocker = root(d / a, -d / c, (a * a - b * b + c * c + d * d) / (2.0 * a * c));
        [root(d / a, d / b, (c * c - d * d - a * a - b * b) / (2.0 * a * b)), rocker]
    }

    /// World angular velocities of coupler and rocker.
    pub fn rates(&self, crank: f64, rate: f64) -> [f64; 2] {
        let [coupler, rocker] = self.angles(crank);
        [
            self.crank * rate / self.coupler * (rocker - crank).sin() / (coupler - rocker).sin(),
            self.crank * rate / self.rocker * (crank - coupler).sin() / (rocker - coupler).sin(),
        ]
    }

    /// Crank, coupler, rocker; the shapes and the joint elements of each.
    pub fn chain(&self, cut: Cut, shapes: [String; 3], joints: [&str; 3]) -> Chain {
        let [on_crank, on_coupler, on_rocker] = shapes;
        let third = match cut {
            Cut::Joint => Rod::new("rocker", "ground", self.ground, self.rocker),
            Cut::Foot => Rod::new("rocker", "coupler", self.coupler, self.rocker),
        };
        chain(&[
            Rod { shapes: on_crank, joint: joints[0], ..Rod::new("crank", "ground", 0.0, self.crank) },
            Rod { shapes: on_coupler, joint: joints[1], ..Rod::new("coupler", "crank", self.crank, self.coupler) },
            Rod { shapes: on_rocker, joint: joints[2], ..third },
        ])
    }

    /// The loop at the place of the cut.
    pub fn closure(&self, cut: Cut, joint: LoopJoint) -> Loop {
        match cut {
            Cut::Joint => closure(joint, ("coupler", self.coupler), (Some("rocker"), self.rocker)),
            Cut::Foot => closure(joint, ("rocker", self.rocker), (None, self.ground)),
        }
    }

    /// Coordinates and velocities at a crank angle and its rate.
    pub fn state(&self, cut: Cut, crank: f64, rate: f64) -> [[f64; 3]; 2] {
        let [coupler, rocker] = self.angles(crank);
        let [coupler_rate, rocker_rate] = self.rates(crank, rate);
        match cut {
            Cut::Joint => [[crank, coupler - crank, rocker], [rate, coupler_rate - rate, rocker_rate]],
            Cut::Foot => [
                [crank, coupler - crank, rocker + std::f64::consts::PI - coupler],
                [rate, coupler_rate - rate, rocker_rate - coupler_rate],
            ],
        }
    }
}

/// The difference of two angles, −π to π.
pub fn turned(a: f64, b: f64) -> f64 {
    (a - b).sin().atan2((a - b).cos())
}

/// N upright rods on the ground, 1 m apart, whose tops are joined by couplers (the N-four-bar of the IFToMM library of
/// computational benchmark problems: 1 kg, 1 m, 1 m/s). The loops are cut at the tops, or at the feet.
pub fn n_four_bar(n: usize, cut: Cut) -> (Chain, Vec<Loop>, Vec<f64>, Vec<f64>) {
    let names = |stem: &str| (0..=n).map(|k| format!("{stem}{k}")).collect::<Vec<_>>();
    let (rod, coupler, quarter) = (names("rod"), names("coupler"), std::f64::consts::FRAC_PI_2);
    let (mut rods, mut loops) = (Vec::new(), Vec::new());
    let (mut q, mut qd) = (Vec::new(), Vec::new());
    let mut add = |own: Rod<'static>, angle: f64, rate: f64| {
        rods.push(own);
        q.push(angle);
        qd.push(rate);
    };
    let own = |name: &str| -> &'static str { name.to_owned().leak() };
    for k in 0..=n {
        match cut {
            Cut::Joint => {
                add(Rod::new(own(&rod[k]), "ground", k as f64, 1.0), quarter, -1.0);
                if k < n {
                    add(Rod::new(own(&coupler[k + 1]), own(&rod[k]), 1.0, 1.0), -quarter, 1.0);
                    loops.push(closure(pin(), (&coupler[k + 1], 1.0), (Some(&rod[k + 1]), 1.0)));
                }
            }
            Cut::Foot if k == 0 => add(Rod::new(own(&rod[0]), "ground", 0.0, 1.0), quarter, -1.0),
            Cut::Foot => {
                // The first coupler is on the top of a rod that stands, the others at the hinge of one that hangs.
                let (at, angle) = if k == 1 { (1.0, -quarter) } else { (0.0, quarter) };
                add(Rod::new(own(&coupler[k]), own(&rod[k - 1]), at, 1.0), angle, 1.0);
                add(Rod::new(own(&rod[k]), own(&coupler[k]), 1.0, 1.0), -quarter, -1.0);
                loops.push(closure(pin(), (&rod[k], 1.0), (None, k as f64)));
            }
        }
    }
    (chain(&rods), loops, q, qd)
}
