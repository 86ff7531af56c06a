//! Bodies of the tests of several contacts.

use carom::Chain;
use carom_chain::urdf::LoadOptions;

/// A body that moves in the x–z plane: q = (x, z, angle about y).
pub fn in_plane(mass: f64, inertia: f64, shapes: &str) -> Chain {
    let text = format!(
        r#"<robot name="body"><link name="world"/><link name="a"/><link name="b"/>
        <link name="body"><inertial><mass value="{mass}"/>
          <inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0" izz="{inertia}"/></inertial>{shapes}</link>
        <joint name="x" type="prismatic"><parent link="world"/><child link="a"/><axis xyz="1 0 0"/>
          <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>
        <joint name="z" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
          <limit lower="-100" upper="100" effort="0" velocity="0"/></joint>
        <joint name="turn" type="continuous"><parent link="b"/><child link="body"/><axis xyz="0 1 0"/></joint></robot>"#
    );
    Chain::from_urdf_str(&text, &LoadOptions::default()).unwrap()
}

/// A uniform box with a floating joint.
pub fn floating_box(size: [f64; 3], mass: f64) -> Chain {
    let [x, y, z] = size;
    let inertia = |a: f64, b: f64| mass * (a * a + b * b) / 12.0;
    let text = format!(
        r#"<robot name="box"><link name="box"><inertial><mass value="{mass}"/>
        <inertia ixx="{}" ixy="0" ixz="0" iyy="{}" iyz="0" izz="{}"/></inertial>
        <collision><geometry><box size="{x} {y} {z}"/></geometry></collision></link></robot>"#,
        inertia(y, z),
        inertia(x, z),
        inertia(x, y)
    );
    Chain::from_urdf_str(&text, &LoadOptions { floating_base: true, ..LoadOptions::default() }).unwrap()
}
