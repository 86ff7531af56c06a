//! Time of one gap for several shapes and obstacles: `cargo bench -p carom-contact`.

use carom_chain::algebra::Pose;
use carom_chain::{Chain, Spatial};
use carom_contact::{LinkShape, Obstacle, gap, link_shapes};
use divan::{Bencher, black_box};
use nalgebra::{Isometry3, Vector3};

fn main() {
    divan::main();
}

const SHAPES: [&str; 4] = [
    r#"<sphere radius="0.1"/>"#,
    r#"<capsule radius="0.05" length="0.3"/>"#,
    r#"<cylinder radius="0.05" length="0.3"/>"#,
    r#"<box size="0.1 0.2 0.3"/>"#,
];

fn shape(geometry: &str) -> LinkShape {
    let text = format!(
        r#"<robot name="r"><link name="a"><collision><geometry>{geometry}</geometry></collision></link></robot>"#
    );
    let chain = Chain::from_urdf_str(&text, &Default::default()).unwrap();
    link_shapes(&chain).unwrap().remove(0)
}

fn pose() -> Pose<Spatial<f64>> {
    let turned = nalgebra::UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1).to_rotation_matrix().into_inner();
    Pose { rotation: turned, translation: Vector3::new(0.1, -0.2, 0.6) }
}

#[divan::bench(args = SHAPES)]
fn against_half_space(bencher: Bencher, geometry: &str) {
    let (shape, floor) = (shape(geometry), Obstacle::half_space(Vector3::zeros(), Vector3::z()).unwrap());
    bencher.bench_local(|| gap(&shape, black_box(&pose()), &floor));
}

#[divan::bench(args = SHAPES)]
fn against_sphere(bencher: Bencher, geometry: &str) {
    let (shape, ball) = (shape(geometry), Obstacle::sphere(Vector3::zeros(), 0.2).unwrap());
    bencher.bench_local(|| gap(&shape, black_box(&pose()), &ball));
}

#[divan::bench(args = SHAPES)]
fn against_box(bencher: Bencher, geometry: &str) {
    let cuboid = Obstacle::cuboid(Isometry3::identity(), Vector3::new(0.4, 0.3, 0.2)).unwrap();
    let shape = shape(geometry);
    bencher.bench_local(|| gap(&shape, black_box(&pose()), &cuboid));
}
