//! Harmonic motion of surfaces.

use carom_sim::Oscillation;
use nalgebra::Vector3;

/// s + ω⁻² s̈ = 0, and ṡ² + ω² s² = (amplitude · ω)² in each direction.
#[test]
fn an_oscillation_solves_the_equation_of_a_harmonic_oscillator() {
    let amplitude = Vector3::new(0.3, -0.2, 0.05);
    for (frequency, phase) in [(3.0, 0.4), (0.5, -2.0), (-3.0, 0.4)] {
        for time in [-0.7, 0.0, 0.3, 2.0] {
            let [place, velocity, acceleration] = Oscillation { amplitude, frequency, phase }.at(time);
            let wanted = place * (-frequency * frequency);
            assert!(place.norm() > 0.01, "the displacement is too small to see the sign of the acceleration");
            assert!((acceleration - wanted).amax() < 1e-15 * wanted.amax().max(1.0), "{acceleration} {wanted}");
            let energy = velocity.component_mul(&velocity) + place.component_mul(&place) * frequency * frequency;
            let exact = amplitude.component_mul(&amplitude) * frequency * frequency;
            assert!((energy - exact).amax() < 1e-15, "{energy} {exact}");
            // The velocity is the derivative of the displacement: a central difference has the error ω³ h²/6.
            let h = 1e-5;
            let [after, before] = [h, -h].map(|h| Oscillation { amplitude, frequency, phase }.at(time + h)[0]);
            assert!(((after - before) / (2.0 * h) - velocity).amax() < 1e-9, "{velocity}");
        }
    }
}
