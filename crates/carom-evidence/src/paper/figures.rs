//! The paper's figures: the data of each figure and its curves.

use super::report::{FIGURES, Paper, Row};
use super::simulated::TipState;
use super::{ANGLES_DEG, Elbow, Run, SPEEDS};
use crate::EvidenceError;
use crate::consistency::v_plot;
use crate::line_chart::{COLOURS, Curve, GREY, PALE, svg};

/// The columns of a table, and its rows.
type Columns = (Vec<&'static str>, Vec<Vec<f64>>);

impl Paper {
    /// The data of a figure, SI units.
    pub(super) fn numbers(&self, figure: &str) -> Columns {
        let [up, down] = &self.motions;
        let pairs = || up.states.iter().zip(&down.states);
        let elbows = |angle: &f64| Elbow::ALL.map(|elbow| self.row(elbow, *angle));
        let by_angle = |of: &dyn Fn(&Row) -> Vec<f64>| -> Vec<Vec<f64>> {
            let row = |angle: &f64| -> Vec<f64> {
                std::iter::once(*angle).chain(elbows(angle).into_iter().flatten().flat_map(of)).collect()
            };
            ANGLES_DEG.iter().map(row).collect()
        };
        match figure {
            "fig4" => (
                vec!["time", "up_normal", "up_tangential", "down_normal", "down_tangential"],
                pairs().map(|(u, d)| vec![u.time, u.normal, u.tangential, d.normal, d.tangential]).collect(),
            ),
            "fig5" => (
                vec!["up_time", "up_normal", "up_tangential", "down_time", "down_normal", "down_tangential"],
                self.forces[0].states.iter().zip(&self.forces[1].states).map(|(u, d)| [*u, *d].concat()).collect(),
            ),
            "fig6" => (
                vec!["time", "up_along", "up_towards", "down_along", "down_towards"],
                pairs().map(|(u, d)| vec![u.time, u.along, u.towards, d.along, d.towards]).collect(),
            ),
            "fig7" => (
                vec!["time", "up_tangential", "up_normal", "down_tangential", "down_normal"],
                (up.samples.iter().zip(&down.samples))
                    .map(|(u, d)| vec![u.time, u.tangential, u.normal, d.tangential, d.normal])
                    .collect(),
            ),
            "fig8" => (vec!["angle_deg", "speed", "up_newton", "up_loss", "down_newton", "down_loss"], self.losses()),
            "fig9" => (
                vec![
                    "angle_deg",
                    "up_before",
                    "up_after_newton",
                    "up_after_energy_root",
                    "down_before",
                    "down_after_newton",
                    "down_after_energy_root",
                ],
                by_angle(&|row| {
                    let (before, after) = row.newton.tangential();
                    vec![before, after, row.energy.tangential().1]
                }),
            ),
            "fig10" => (
                vec![
                    "angle_deg",
                    "up_before",
                    "up_measured",
                    "up_after_energy_root",
                    "down_before",
                    "down_measured",
                    "down_after_energy_root",
                ],
                by_angle(&|row| {
                    let (before, after) = row.newton.normal();
                    vec![before, after, row.energy.normal().1]
                }),
            ),
            _ => (
                vec![
                    "angle_deg",
                    "up_newton",
                    "up_energy_root",
                    "up_energy_root_model",
                    "down_newton",
                    "down_energy_root",
                    "down_energy_root_model",
                ],
                by_angle(&|row| vec![row.newton.restitution, row.measured, row.model()]),
            ),
        }
    }

    /// Rows of angle (degrees), speed (m/s), and e and energy loss (J) of both elbows.
    fn losses(&self) -> Vec<Vec<f64>> {
        let mut rows = Vec::new();
        for speed in SPEEDS {
            for angle in ANGLES_DEG {
                let of = |run: &&Run| run.speed == speed && run.angle_deg == angle;
                let both = self.runs.iter().filter(of).flat_map(|run| [run.restitution, run.hit.energy_loss()]);
                rows.push([angle, speed].into_iter().chain(both).collect());
            }
        }
        rows
    }

    /// A figure as SVG.
    pub(super) fn figure(&self, name: &str) -> Result<String, EvidenceError> {
        let label = |k: usize, what: &str| format!("{}-elbow: {what}", Elbow::ALL[k].name());
        let (_, numbers) = self.numbers(name);
        // a curve of two columns, each scaled to the unit of its axis
        let curve = |name: String, colour, x: (usize, f64), y: (usize, f64)| Curve {
            line: numbers.iter().map(|row| (row[x.0] * x.1, row[y.0] * y.1)).collect(),
            ..Curve::new(name, colour)
        };
        let marked = |mut curve: Curve| {
            curve.dots.clone_from(&curve.line);
            curve
        };
        let dashed = |curve: Curve| Curve { dashed: true, ..curve };
        let sampled = |k: usize, of: fn(&TipState) -> (f64, f64)| self.motions[k].samples.iter().map(of).collect();
        let Some((_, title, axes)) = FIGURES.into_iter().find(|(own, ..)| *own == name) else {
            return v_plot(&self.table);
        };
        let mut curves = Vec::new();
        match name {
            "fig4" => {
                for k in [0, 1] {
                    let dots = sampled(k, |s| (s.time * 1e3, s.normal));
                    let normal = curve(label(k, "into the wall"), COLOURS[k], (0, 1e3), (1 + 2 * k, 1.0));
                    curves.push(Curve { dots, ..normal });
                    let dots = sampled(k, |s| (s.time * 1e3, s.tangential));
                    let tangential = curve(label(k, "along the wall"), PALE[k], (0, 1e3), (2 + 2 * k, 1.0));
                    curves.push(Curve { dots, ..tangential });
                }
            }
            "fig5" => {
                for k in [0, 1] {
                    curves.push(curve(label(k, "normal"), COLOURS[k], (3 * k, 1e3), (1 + 3 * k, 1.0)));
                    curves.push(curve(label(k, "tangential"), PALE[k], (3 * k, 1e3), (2 + 3 * k, 1.0)));
                }
            }
            "fig6" => {
                for k in [0, 1] {
                    let dots = sampled(k, |s| (s.along * 1e3, s.towards * 1e3));
                    let path = curve(label(k, "tip"), COLOURS[k], (1 + 2 * k, 1e3), (2 + 2 * k, 1e3));
                    curves.push(Curve { dots, ..path });
                }
            }
            "fig7" => {
                for k in [0, 1] {
                    let line = self.motions[k].states.iter().map(|s| (s.tangential, s.normal)).collect();
                    let dots = sampled(k, |s| (s.tangential, s.normal));
                    curves.push(Curve { line, dots, ..Curve::new(label(k, "tip"), COLOURS[k]) });
                }
            }
            "fig8" => {
                for k in [0, 1] {
                    for (j, rows) in numbers.chunks(ANGLES_DEG.len()).enumerate() {
                        let line = rows.iter().map(|row| (row[0], row[3 + 2 * k] * 1e3)).collect();
                        let speeds = SPEEDS.map(|speed| speed.to_string()).join(", ");
                        let name = if j == 0 { label(k, &format!("{speeds} m/s")) } else { String::new() };
                        let one = Curve { line, ..Curve::new(name, COLOURS[k]) };
                        // dashed, as the curves of both elbows coincide where e is equal
                        curves.push(marked(if k == 0 { one } else { dashed(one) }));
                    }
                }
            }
            _ => {
                curves.push(marked(curve("before, both elbows".into(), GREY, (0, 1.0), (1, 1.0))));
                let first = if name == "fig9" { "after, with e" } else { "after, measured" };
                for k in [0, 1] {
                    curves.push(marked(curve(label(k, first), COLOURS[k], (0, 1.0), (2 + 3 * k, 1.0))));
                    let with_root = curve(label(k, "after, with E"), PALE[k], (0, 1.0), (3 + 3 * k, 1.0));
                    curves.push(marked(dashed(with_root)));
                }
            }
        }
        svg(title, axes, &curves).map_err(EvidenceError::new)
    }
}
