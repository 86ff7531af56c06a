//! Gaps of robots: gap rates, reachable pairs, meshes from files.

use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, uniform_chain};
use carom_contact::{ContactError, LeftOut, Obstacle, gap, gap_rate, link_shapes, out_of_reach};
use carom_testing::files::robot;
use nalgebra::{Isometry3, Vector3};

fn surroundings() -> [Obstacle; 3] {
    [
        Obstacle::half_space(Vector3::new(0.9, 0.1, 0.0), Vector3::new(-1.0, 0.2, 0.1)).unwrap(),
        Obstacle::sphere(Vector3::new(0.7, 0.6, 0.5), 0.15).unwrap(),
        Obstacle::cuboid(Isometry3::translation(0.6, -0.8, 0.4), Vector3::new(0.2, 0.3, 0.4)).unwrap(),
    ]
}

/// d(gap)/dt = n · J qd, compared with central differences along the motion. Where the nearest feature changes within the
/// step, the derivative has a kink; at most 1 % of the samples may be such.
#[test]
fn gap_rate_is_the_derivative_of_the_gap() {
    let mut rng = fastrand::Rng::with_seed(11);
    for name in ["planar2", "planar3", "arm7"] {
        let chain = robot(name);
        let shapes = link_shapes(&chain).unwrap();
        let mut ws = chain.workspace();
        let (mut kinks, mut all) = (0, 0);
        for _ in 0..60 {
            let mut random =
                |size: f64| -> Vec<f64> { (0..chain.nv()).map(|_| (rng.f64() * 2.0 - 1.0) * size).collect() };
            let (q, qd) = (random(1.5), random(1.0));
            for shape in &shapes {
                for obstacle in &surroundings() {
                    let h = 1e-6;
                    let mut at = |t: f64| {
                        let moved = chain.integrate(&q, &qd, t).unwrap();
                        gap(shape, &ws.update(&chain, &moved).unwrap().pose(shape.frame()), obstacle).distance
                    };
                    let difference = (at(h) - at(-h)) / (2.0 * h);
                    let kin = ws.update(&chain, &q).unwrap();
                    let now = gap(shape, &kin.pose(shape.frame()), obstacle);
                    let rate = gap_rate(&kin, shape, &now, &qd).unwrap();
                    all += 1;
                    kinks += usize::from((rate - difference).abs() > 1e-6);
                }
            }
        }
        assert!(kinks * 100 < all, "{name}: {kinks} of {all}");
    }
}

#[test]
fn reachable_pairs_include_all_touching_pairs_and_exclude_a_far_wall() {
    let chain = robot("planar2");
    let shapes = link_shapes(&chain).unwrap();
    let walls = [
        Obstacle::half_space(Vector3::new(0.6, 0.0, 0.0), -Vector3::x()).unwrap(),
        Obstacle::half_space(Vector3::new(2.0, 0.0, 0.0), -Vector3::x()).unwrap(),
    ];
    let in_reach = |s: usize, o: usize| out_of_reach(&chain, &shapes[s], &walls[o]).is_none();
    let mut rng = fastrand::Rng::with_seed(5);
    let mut ws = chain.workspace();
    let mut touched = 0;
    for _ in 0..10_000 {
        let q = [rng.f64() * 6.2 - 3.1, rng.f64() * 6.2 - 3.1];
        let kin = ws.update(&chain, &q).unwrap();
        for (s, shape) in shapes.iter().enumerate() {
            for (o, wall) in walls.iter().enumerate() {
                if gap(shape, &kin.pose(shape.frame()), wall).distance <= 0.0 {
                    touched += 1;
                    assert!(in_reach(s, o), "{} touches wall {o}", shape.link());
                }
            }
        }
    }
    assert!(touched > 100);
    assert!((0..shapes.len()).all(|s| !in_reach(s, 1)), "no link of the arm reaches 2 m");
}

/// An arm that turns about the vertical through `base`, with a ball of radius 0.1 m on a vertical slider 1 m from that axis.
/// The slider moves from −0.4 m to 0.1 m; `None`: it is fixed.
fn turning_arm(base: Vector3<f64>, slider: Option<&str>) -> Chain {
    let inertial = r#"<inertial><mass value="1"/>
        <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#;
    let [x, y, z] = base.into();
    let kind = if slider.is_some() { "prismatic" } else { "fixed" };
    let limit = slider.unwrap_or_default();
    Chain::from_urdf_str(
        &format!(
            r#"<robot name="arm"><link name="base"/><link name="beam">{inertial}</link>
            <link name="tool">{inertial}
              <collision><origin xyz="0.5 0 0"/><geometry><sphere radius="0.1"/></geometry></collision></link>
            <joint name="hinge" type="continuous"><parent link="base"/><child link="beam"/>
              <origin xyz="{x} {y} {z}"/><axis xyz="0 0 1"/></joint>
            <joint name="slider" type="{kind}"><parent link="beam"/><child link="tool"/>
              <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>{limit}</joint></robot>"#
        ),
        &LoadOptions::default(),
    )
    .unwrap()
}

/// The reason why the only shape of a chain cannot touch each obstacle; `None` if it can.
fn reasons(chain: &Chain, obstacles: &[Obstacle]) -> Vec<Option<LeftOut>> {
    let shape = &link_shapes(chain).unwrap()[0];
    obstacles.iter().map(|obstacle| out_of_reach(chain, shape, obstacle)).collect()
}

fn room(reason: Option<LeftOut>) -> Option<f64> {
    match reason {
        Some(LeftOut::BesidePlane { room }) => Some(room),
        None => None,
        other => panic!("{other:?}"),
    }
}

/// The ball's centre is at a height of 1 m for q = 0, and its slider's greatest distance from zero is 0.4 m. The heights
/// from 1 − 0.4 − 0.1 = 0.5 m to 1.5 m are therefore within reach.
#[test]
fn slider_along_the_hinge_axis_widens_the_reachable_heights_by_its_stroke() {
    let limit = r#"<limit lower="-0.4" upper="0.1" effort="1" velocity="1"/>"#;
    let chain = turning_arm(Vector3::new(0.0, 0.0, 1.0), Some(limit));
    let floor = |z: f64| Obstacle::half_space(Vector3::new(0.0, 0.0, z), Vector3::z()).unwrap();
    let ceiling = |z: f64| Obstacle::half_space(Vector3::new(0.0, 0.0, z), -Vector3::z()).unwrap();
    let ball = |z: f64| Obstacle::sphere(Vector3::new(0.9, 0.0, z), 0.1).unwrap();
    let obstacles =
        [floor(0.45), floor(0.55), ceiling(1.55), ceiling(1.45), ball(0.3), ball(0.45), ball(1.7), ball(1.55)];
    let expected = [Some(0.05), None, Some(0.05), None, Some(0.1), None, Some(0.1), None];
    for (k, reason) in reasons(&chain, &obstacles).into_iter().enumerate() {
        let found = room(reason);
        assert_eq!(found.is_some(), expected[k].is_some(), "obstacle {k}: {reason:?}");
        assert!((found.unwrap_or(0.0) - expected[k].unwrap_or(0.0)).abs() < 1e-12, "obstacle {k}: {reason:?}");
    }
}

/// The reachable region of the ball at the base c is the part of the ball (c, R = 1.1 m) with heights within r = 0.1 m of c.
/// A half-space whose normal is tilted by α, with its boundary D below c, is D − r cos α − R sin α away from its bound. The
/// position of the base does not occur in this, and the gap is never smaller.
#[test]
fn room_to_a_tilted_half_space_does_not_depend_on_the_position_of_the_base() {
    let (sine, cosine) = std::f64::consts::FRAC_PI_6.sin_cos();
    let normal = Vector3::new(sine, 0.0, cosine);
    let expected = |depth: f64| depth - 0.1 * cosine - 1.1 * sine;
    for base in [Vector3::zeros(), Vector3::new(0.3, 0.2, 1.5), Vector3::new(-2.0, 0.7, -1.2)] {
        let chain = turning_arm(base, None);
        let below = |depth: f64| Obstacle::half_space(base - normal * depth, normal).unwrap();
        let found = reasons(&chain, &[below(0.8), below(0.6)]);
        let Some(room) = room(found[0]) else { panic!("{base:?}: {found:?}") };
        assert!((room - expected(0.8)).abs() < 1e-11, "{base:?}: {room}");
        assert_eq!(found[1], None);
        let shape = &link_shapes(&chain).unwrap()[0];
        let mut workspace = chain.workspace();
        for k in 0..64 {
            let at_q = workspace.update(&chain, &[k as f64 * 0.1]).unwrap();
            assert!(gap(shape, &at_q.pose(shape.frame()), &below(0.8)).distance >= room);
        }
    }
}

#[test]
fn chain_without_collision_elements_has_no_link_shapes() {
    let chain = uniform_chain(3, 1.0, 1.0).unwrap();
    assert!(link_shapes(&chain).unwrap().is_empty());
}

/// A tetrahedron with corners at 1, 2 and 3 m on the axes, written in mm, in three formats.
#[test]
fn meshes_of_all_formats_are_read_with_scale_unit_and_upward_axis() {
    let folder = std::env::temp_dir().join(format!("carom-meshes-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let corners = [[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0], [0.0, 2000.0, 0.0], [0.0, 0.0, 3000.0_f32]];
    let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3_usize]];
    let mut stl = String::from("solid t\n");
    for face in faces {
        stl += "facet normal 0 0 0\nouter loop\n";
        for k in face {
            let [x, y, z] = corners[k];
            stl += &format!("vertex {x} {y} {z}\n");
        }
        stl += "endloop\nendfacet\n";
    }
    stl += "endsolid t\n";
    std::fs::write(folder.join("t.stl"), stl).unwrap();
    let mut obj = String::new();
    for [x, y, z] in corners {
        obj += &format!("v {x} {y} {z}\n");
    }
    for [a, b, c] in faces {
        obj += &format!("f {} {} {}\n", a + 1, b + 1, c + 1);
    }
    std::fs::write(folder.join("t.obj"), obj).unwrap();
    std::fs::write(folder.join("empty.stl"), "solid e\nendsolid e\n").unwrap();

    let read = |file: &str| {
        let urdf = format!(
            r#"<robot name="r"><link name="a"><collision><geometry>
            <mesh filename="{file}" scale="0.001 0.001 0.001"/></geometry></collision></link></robot>"#
        );
        let path = folder.join("r.urdf");
        std::fs::write(&path, urdf).unwrap();
        let chain = Chain::from_urdf_file_with(&path, &LoadOptions::default()).unwrap();
        link_shapes(&chain)
    };
    let floor = Obstacle::half_space(Vector3::new(0.0, 0.0, 4.0), -Vector3::z()).unwrap();
    for file in ["t.stl", "t.obj"] {
        let shapes = read(file).unwrap();
        let found = gap(&shapes[0], &carom_chain::algebra::Pose::identity(), &floor);
        assert!((found.distance - 1.0).abs() < 1e-6, "{file}: {found:?}");
    }
    // COLLADA: z up and y up, two units, one geometry moved by its node.
    let dae = |up: &str, unit: &str, tip: &str, node: &str| {
        format!(
            r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
            <asset><unit name="u" meter="{unit}"/><up_axis>{up}</up_axis></asset>
            <library_geometries><geometry id="g"><mesh>
              <source id="p"><float_array id="a" count="12">0 0 0 1000 0 0 {tip}</float_array><technique_common>
                <accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
                <param name="Z" type="float"/></accessor></technique_common></source>
              <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
              <triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
                <p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
            <library_visual_scenes><visual_scene id="s"><node>{node}<instance_geometry url="#g"/></node></visual_scene>
            </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
        )
    };
    std::fs::write(folder.join("z.dae"), dae("Z_UP", "1", "0 2000 0 0 0 3000", "")).unwrap();
    std::fs::write(folder.join("y.dae"), dae("Y_UP", "1", "0 0 2000 0 3000 0", "")).unwrap();
    let moved = "<translate>0 0 -1000</translate>";
    std::fs::write(folder.join("moved.dae"), dae("Z_UP", "1", "0 2000 0 0 0 3000", moved)).unwrap();
    let halved = "<scale>1 1 0.5</scale>";
    std::fs::write(folder.join("unit.dae"), dae("Z_UP", "2", "0 2000 0 0 0 3000", halved)).unwrap();
    for (file, distance) in [("z.dae", 1.0), ("y.dae", 1.0), ("moved.dae", 2.0), ("unit.dae", 1.0)] {
        let shapes = read(file).unwrap();
        let found = gap(&shapes[0], &carom_chain::algebra::Pose::identity(), &floor);
        assert!((found.distance - distance).abs() < 1e-6, "{file}: {found:?}");
    }

    let empty = read("empty.stl").unwrap_err();
    assert!(matches!(empty, ContactError::Mesh { .. }));
    let said = empty.to_string();
    assert!(said.contains("empty.stl") && said.contains('a'), "{said}");
    std::fs::remove_dir_all(&folder).unwrap();
}
