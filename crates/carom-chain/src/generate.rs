//! Generated chains: uniform rows of rods of any number of links.

use crate::chain::Chain;
use crate::error::ChainError;
use crate::urdf::LoadOptions;
use std::fmt::Write;

/// URDF text of a chain of `links` equal thin rods, connected end to end by hinges about z and lying along x at q = 0.
/// `length` (m) and `mass` (kg) are those of the whole chain. The fixed base is `link0`, the rods are `link1` …, the joints
/// `joint1` …, and the link `tip` is at the end of the last rod.
pub fn uniform_chain_urdf(links: usize, length: f64, mass: f64) -> String {
    let (l, m) = (length / links as f64, mass / links as f64);
    let (half, inertia) = (l / 2.0, m * l * l / 12.0);
    let mut urdf = format!("<?xml version=\"1.0\"?>\n<robot name=\"uniform{links}\">\n  <link name=\"link0\"/>\n");
    for i in 1..=links {
        let (parent, at) = (i - 1, if i == 1 { 0.0 } else { l });
        let _ = write!(
            urdf,
            r#"  <link name="link{i}">
    <inertial>
      <origin xyz="{half} 0 0"/>
      <mass value="{m}"/>
      <inertia ixx="0" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/>
    </inertial>
  </link>
  <joint name="joint{i}" type="continuous">
    <parent link="link{parent}"/>
    <child link="link{i}"/>
    <origin xyz="{at} 0 0"/>
    <axis xyz="0 0 1"/>
  </joint>
"#
        ); // writing to a String can't fail
    }
    let _ = write!(
        urdf,
        r#"  <link name="tip"/>
  <joint name="tip_joint" type="fixed">
    <parent link="link{links}"/>
    <child link="tip"/>
    <origin xyz="{l} 0 0"/>
  </joint>
</robot>
"#
    );
    urdf
}

/// Most links of [`uniform_chain`]: their mass matrix has 800 MB.
const MOST_LINKS: usize = 10_000;

/// The chain of [`uniform_chain_urdf`].
///
/// # Errors
/// [`ChainError::OutOfRange`] unless `links` is from 1 to 10 000, and `length` and `mass` are positive and finite.
pub fn uniform_chain(links: usize, length: f64, mass: f64) -> Result<Chain, ChainError> {
    for (what, value) in [("number of links", links as f64), ("length", length), ("mass", mass)] {
        let sound = value > 0.0 && value.is_finite();
        if !sound {
            return Err(ChainError::OutOfRange { what: what.into(), value, rule: "it must be positive and finite" });
        }
    }
    if links > MOST_LINKS {
        let rule = "at most 10000 are allowed, whose mass matrix has 800 MB: give fewer";
        return Err(ChainError::OutOfRange { what: "number of links".into(), value: links as f64, rule });
    }
    Chain::from_urdf_str(&uniform_chain_urdf(links, length, mass), &LoadOptions::default())
}
