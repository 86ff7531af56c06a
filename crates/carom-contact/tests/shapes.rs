//! Sizes of shapes and the corners on which they rest.

use crate::common::*;
use carom_chain::urdf::Shape;
use carom_contact::{Mesh, Solid};
use nalgebra::Vector3;

/// URDF has full lengths and sides, [`Solid`] half of them.
#[test]
fn solid_has_half_the_lengths_of_the_urdf_shape() {
    let solid = |shape| link_shape(shape).solid().clone();
    assert_eq!(solid(Shape::Sphere { radius: 0.3 }), Solid::Sphere { radius: 0.3 });
    for (length, half_length) in [(0.5, 0.25), (3.0, 1.5)] {
        let capsule = solid(Shape::Capsule { radius: 0.3, length });
        assert_eq!(capsule, Solid::Capsule { radius: 0.3, half_length });
        let cylinder = solid(Shape::Cylinder { radius: 0.3, length });
        assert_eq!(cylinder, Solid::Cylinder { radius: 0.3, half_length });
    }
    let half = Vector3::new(0.25, 1.0, 1.5);
    assert_eq!(solid(Shape::Box { size: Vector3::new(0.5, 2.0, 3.0) }), Solid::Box { half });
}

#[test]
fn lowest_point_of_a_body_without_rim_is_at_the_height_of_its_lowest_corner() {
    let mut rng = fastrand::Rng::with_seed(12);
    for kind in ["sphere", "capsule", "box", "hull"] {
        for _ in 0..100 {
            let (body, n) = (body(kind, &mut rng), unit(&mut rng));
            let heights = body.corners().into_iter().map(|corner| n.dot(&corner.position) - corner.radius);
            let (lowest, _) = body.solid().lowest(n);
            assert!((heights.fold(f64::INFINITY, f64::min) - lowest).abs() < 1e-15, "{kind}: {lowest}");
        }
    }
}

/// Each rim has eight of them, so that neighbours are 2 r sin(π/8) apart.
#[test]
fn corners_of_a_cylinder_divide_both_rims_into_equal_parts() {
    let corners = link_shape(Shape::Cylinder { radius: 0.3, length: 0.5 }).corners();
    let (bottom, top) = corners.split_at(8);
    let chord = 0.6 * std::f64::consts::FRAC_PI_8.sin();
    for (rim, z) in [(bottom, -0.25), (top, 0.25)] {
        assert_eq!(rim.len(), 8);
        assert!((rim[0].position - Vector3::new(0.3, 0.0, z)).norm() < 1e-15);
        for (k, corner) in rim.iter().enumerate() {
            let p = corner.position;
            assert!((p.x.hypot(p.y) - 0.3).abs() < 1e-15 && p.z == z && corner.radius == 0.0, "{corner:?}");
            assert!(((rim[(k + 1) % 8].position - p).norm() - chord).abs() < 1e-15, "{corner:?}");
            assert!((rim[(k + 4) % 8].position + p - Vector3::new(0.0, 0.0, 2.0 * z)).norm() < 1e-15, "{corner:?}");
        }
    }
}

/// 100 levels of nodes are read, 101 are refused.
#[test]
fn dae_file_may_have_as_many_nested_nodes_as_its_error_states() {
    let read = |levels: usize| {
        let (open, close) = ("<node>".repeat(levels), "</node>".repeat(levels));
        let text = format!(
            r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
            <asset><up_axis>Z_UP</up_axis></asset>
            <library_geometries><geometry id="g"><mesh>
              <source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
                <accessor source="#a" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
                <param name="Z" type="float"/></accessor></technique_common></source>
              <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
              <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
            </mesh></geometry></library_geometries>
            <library_visual_scenes><visual_scene id="s">{open}<instance_geometry url="#g"/>{close}</visual_scene>
            </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
        );
        let file = temp(&format!("nested-{levels}.dae"));
        std::fs::write(&file, text).unwrap();
        Mesh::read(&file, Vector3::repeat(1.0), "obstacle")
    };
    assert_eq!(read(100).unwrap().triangles().len(), 1);
    let refused = read(101).unwrap_err().to_string();
    assert!(refused.contains("more than 100 deep"), "{refused}");
}

/// A scene of `levels` nodes, each of which instantiates the next one twice, the last one a geometry of a triangle.
#[test]
fn dae_file_whose_nodes_double_its_size_is_refused_at_the_limit() {
    let read = |levels: usize, geometry: &str| {
        let nodes: String = (0..levels)
            .map(|k| {
                let next =
                    if k + 1 == levels { geometry.into() } else { format!("<instance_node url='#n{}'/>", k + 1) };
                format!("<node id='n{k}'>{next}{next}</node>")
            })
            .collect();
        let text = format!(
            r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
            <library_geometries><geometry id="g"><mesh>
              <source id="p"><float_array>0 0 0 1 0 0 0 1 0</float_array></source>
              <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
              <triangles><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
            </mesh></geometry></library_geometries><library_nodes>{nodes}</library_nodes>
            <library_visual_scenes><visual_scene id="s"><instance_node url="#n0"/></visual_scene>
            </library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
        );
        let file = temp(&format!("doubled-{levels}.dae"));
        std::fs::write(&file, text).unwrap();
        Mesh::read(&file, Vector3::repeat(1.0), "obstacle")
    };
    let geometry = "<instance_geometry url='#g'/>";
    assert_eq!(read(3, geometry).unwrap().triangles().len(), 8, "each instance counts");
    for geometry in [geometry, ""] {
        let refused = read(40, geometry).unwrap_err().to_string();
        assert!(refused.contains("its nodes are instantiated too often: more than 1000000 elements"), "{refused}");
    }
}

#[test]
fn messages_about_long_lines_of_meshes_are_short() {
    let file = temp("long.obj");
    std::fs::write(&file, format!("v 0 0 0\nf {}\n", "x ".repeat(100_000))).unwrap();
    let refused = Mesh::read(&file, Vector3::repeat(1.0), "obstacle").unwrap_err().to_string();
    assert!(refused.contains("a face needs indices of vertices above it") && refused.len() < 1000, "{}", refused.len());
}
