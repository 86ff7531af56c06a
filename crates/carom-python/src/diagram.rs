//! Diagrams that compare laws, as data and as pictures.

use crate::array::{Given, Numbers, array, list, shown};
use crate::error::exceptions::{ImpactError, StateError};
use crate::laws::problem;
use crate::outcome::Outcome;
use carom_study::{Diagram, LawPoint, Stroke, Symbol, hodograph, routh_diagram};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The diagram of one impact with the outcomes of laws, as data to draw.
///
/// In the plane the Routh diagram: the plane of impulses with friction cone, lines of compression and sticking, energy ellipse and
/// every law's impulse. In space the hodograph: the plane of slip velocities with the path of the slip and every law's u⁺.
///
/// Args:
///     H, u: the problem, as for carom.law.
///     friction: Coulomb's coefficient of the lines.
///     outcomes: a list of results of carom.law.
///
/// Returns:
///     A Diagram: a dict of "title", "axes" (two labels), "window" (shape (2, 2)), "equal_scales", "shapes" (dicts of "name", "colour" (three
///     numbers from 0 to 1), "stroke" ("area", "thin", "thick") and "pieces", arrays (n, 2)), "marks" (dicts of "name", "colour",
///     "symbol" ("law", "start", "turn", "stop") and "at", shape (2,)) and "svg", the picture.
///
/// Raises:
///     ImpactError: the contact does not approach, H is singular, or friction is negative.
#[pyfunction]
#[pyo3(signature = (H, u, friction, outcomes))]
#[allow(non_snake_case)] // the name of the matrix in the literature
pub fn diagram(H: Given, u: Given, friction: f64, outcomes: Vec<Bound<Outcome>>) -> PyResult<Py<PyAny>> {
    let py = H.py();
    let (h, u) = (Numbers::read("H", H)?, Numbers::read("u", u)?);
    // Written so that NaN fails.
    if !(friction >= 0.0 && friction.is_finite()) {
        return Err(ImpactError::new_err(format!("friction is {friction}: it must be finite and 0 or more")));
    }
    let drawn = match u.shape() {
        [2] => routh_diagram(&problem(&h, &u)?, friction, &points::<2>(&outcomes)?),
        [3] => hodograph(&problem(&h, &u)?, friction, &points::<3>(&outcomes)?),
        shape => {
            let message = format!("u has the shape {}: (2,) or (3,) is needed", shown(shape));
            return Err(StateError::new_err(message));
        }
    };
    let missing = || {
        ImpactError::new_err("no diagram can be drawn: the contact must approach (u_n < 0) and H must not be singular")
    };
    Ok(crate::notebook::call(py, "Diagram", (data(py, &drawn.ok_or_else(missing)?)?,))?.unbind())
}

fn points<const D: usize>(outcomes: &[Bound<'_, Outcome>]) -> PyResult<Vec<LawPoint<D>>> {
    let point = |outcome: &Bound<'_, Outcome>| {
        let (law, impulse) = outcome.get().point();
        let impulse = <[f64; D]>::try_from(impulse)
            .map_err(|_| StateError::new_err(format!("an outcome is not of a problem of {D} numbers")))?;
        Ok(LawPoint { law, impulse })
    };
    outcomes.iter().map(point).collect()
}

fn data<'py>(py: Python<'py>, drawn: &Diagram<2>) -> PyResult<Bound<'py, PyDict>> {
    let colour = |rgb: [u8; 3]| rgb.map(|part| f64::from(part) / 255.0);
    let pairs = |pairs: &[[f64; 2]]| array(py, pairs.concat(), &[pairs.len(), 2]);
    let mut shapes = Vec::new();
    for shape in &drawn.shapes {
        let stroke = match shape.stroke {
            Stroke::Area => "area",
            Stroke::Thin => "thin",
            Stroke::Thick => "thick",
        };
        let pieces = shape.pieces.iter().map(|piece| pairs(piece)).collect::<PyResult<Vec<_>>>()?;
        let colour = colour(shape.colour);
        shapes.push(dict! { py, "name": &shape.name, "colour": colour, "stroke": stroke, "pieces": pieces });
    }
    let mut marks = Vec::new();
    for mark in &drawn.marks {
        let symbol = match mark.symbol {
            Symbol::Law => "law",
            Symbol::Start => "start",
            Symbol::Turn => "turn",
            Symbol::Stop => "stop",
        };
        let (colour, at) = (colour(mark.colour), list(py, &mark.at)?);
        marks.push(dict! { py, "name": &mark.name, "colour": colour, "symbol": symbol, "at": at });
    }
    Ok(dict! { py,
        "title": &drawn.title,
        "axes": drawn.axes.clone(),
        "window": pairs(&drawn.window)?,
        "equal_scales": drawn.equal_scales,
        "shapes": shapes,
        "marks": marks,
        "svg": drawn.svg(),
    })
}
