//! A batch of impacts.

use crate::array::{Array, Given, Numbers, Plain, array, bytes, list};
use crate::batch::{CHUNK, first_error};
use crate::error::InBatch;
use crate::error::exceptions::ImpactError;
use crate::impact::{Derivatives, Impact, Wanted};
use crate::laws::{GivenLaw, texts};
use crate::notebook;
use crate::pickle::fields;
use crate::threads::on_all_cores;
use carom_impact::{Account, Flags, ImpactOutcome, Mode};
use carom_sim::{ChainImpact, PreparedStrike, SimError, States, Strike};
use nalgebra::{DMatrix, Vector3};
use pyo3::exceptions::{PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyRange, PyTuple};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// The blocks of numbers: qd⁺, impulse, u⁻, u⁺, energies before and after with the works of the normal and the tangential impulse and
/// of the drives, the impulse of the drives, and the derivatives by rows (∂qd⁺/∂q, ∂qd⁺/∂qd, ∂qd⁺/∂e and ∂qd⁺/∂μ).
const BLOCKS: usize = 7;

/// The results, one row for each state.
pub struct Columns {
    count: usize,
    /// Length of a row of each block; 0 for derivatives that are not wanted.
    widths: [usize; BLOCKS],
    blocks: [Vec<f64>; BLOCKS],
    /// Mode and flags.
    codes: Vec<u8>,
}

impl Columns {
    fn new(count: usize, nv: usize, derivatives: bool) -> Self {
        let widths = [nv, 3, 3, 3, 5, nv, if derivatives { 2 * nv * (nv + 1) } else { 0 }];
        Self { count, widths, blocks: widths.map(|width| vec![0.0; count * width]), codes: vec![0; 2 * count] }
    }

    /// Pieces of `length` states, to be written at the same time.
    fn pieces(&mut self, length: usize) -> Vec<Piece<'_>> {
        let widths = self.widths;
        let mut blocks = self.blocks.iter_mut().zip(widths).map(|(all, width)| all.chunks_mut((length * width).max(1)));
        let mut blocks: [_; BLOCKS] = std::array::from_fn(|_| blocks.next());
        let piece = |codes| {
            let next = std::array::from_fn(|k| blocks[k].as_mut().and_then(Iterator::next).unwrap_or_default());
            Piece { widths, blocks: next, codes }
        };
        self.codes.chunks_mut(2 * length).map(piece).collect()
    }
}

/// Consecutive rows of the results.
struct Piece<'a> {
    widths: [usize; BLOCKS],
    blocks: [&'a mut [f64]; BLOCKS],
    codes: &'a mut [u8],
}

impl Piece<'_> {
    fn write(&mut self, k: usize, hit: &ChainImpact) {
        let works = [hit.contact.normal_work, hit.contact.friction_work, hit.drive_work];
        let energies = [hit.energy_before, hit.energy_after, works[0], works[1], works[2]];
        let vectors = [&hit.impulse, &hit.u_minus, &hit.u_plus].map(|vector| vector.as_slice());
        let rows = [&hit.qd_plus[..], vectors[0], vectors[1], vectors[2], &energies, &hit.drive_impulse];
        for ((block, width), row) in self.blocks.iter_mut().zip(self.widths).zip(rows) {
            block[k * width..][..width].copy_from_slice(row);
        }
        self.codes[2 * k..][..2].copy_from_slice(&[hit.mode as u8, hit.flags.bits()]);
    }

    fn write_derivatives(&mut self, k: usize, impact: &Impact) {
        let (Some(by), width) = (impact.by(), self.widths[BLOCKS - 1]) else { return };
        let nv = by.restitution.len();
        let row = &mut self.blocks[BLOCKS - 1][k * width..][..width];
        for (out, m) in row.chunks_exact_mut(nv * nv).zip([&by.q, &by.qd]) {
            out.iter_mut().enumerate().for_each(|(i, x)| *x = m[(i / nv, i % nv)]);
        }
        row[2 * nv * nv..][..nv].copy_from_slice(&by.restitution);
        row[2 * nv * nv + nv..].copy_from_slice(&by.friction);
    }
}

/// What is to be computed for each state of a batch.
pub struct Each {
    /// Derivatives too.
    pub derivatives: bool,
    /// Whether point, normal or law are not the same at all states.
    pub varies: bool,
}

/// Computes a batch: without the GIL and on all cores, or one after another for a law in Python.
///
/// # Errors
/// The exception of the error of the first state that has one.
pub fn compute<'a, F: Fn(usize) -> Strike<'a> + Sync>(
    py: Python<'_>,
    chain: &carom_chain::Chain,
    ((q, qd), count): ((Plain, Plain), usize),
    strike: &F,
    law_of: &(dyn Fn(usize) -> GivenLaw + Sync),
    Each { derivatives, varies }: Each,
) -> PyResult<Columns> {
    let nv = chain.nv();
    let mut all = Columns::new(count, nv, derivatives);
    if count == 0 || nv == 0 {
        return Ok(all);
    }
    let own = |state: usize| move |error: SimError| InBatch { error, state: Some(state) };
    let (law, one_by_one) = (law_of(0), derivatives || varies);
    let prepared = (!one_by_one).then(|| strike(0).prepare()).transpose();
    let prepared = prepared.map_err(|error| InBatch { error, state: None })?;
    let wanted = Wanted { derivatives, band: None, saltation: None };
    let piece = |(prepared, columns): &mut (Option<PreparedStrike<'a>>, Vec<f64>),
                 first: usize,
                 piece: &mut Piece,
                 stop: &AtomicBool| {
        let states = piece.codes.len() / 2;
        let Some(prepared) = prepared else {
            for k in 0..states {
                if stop.load(Ordering::Relaxed) {
                    break;
                }
                let found = Impact::compute(strike(first + k), &law_of(first + k), &wanted).map_err(own(first + k))?;
                piece.write(k, &found.hit);
                piece.write_derivatives(k, &found);
            }
            return Ok(());
        };
        columns.resize((chain.nq() + nv) * states, 0.0);
        let (mut valid, mut invalid) = (states, None);
        for k in 0..states {
            let (q, qd) = (q.row(first + k), qd.row(first + k));
            if let Err(error) = chain.check_state(q, qd) {
                (valid, invalid) = (k, Some(own(first + k)(error.into())));
                break;
            }
            q.iter().chain(qd).enumerate().for_each(|(i, x)| columns[i * states + k] = *x);
        }
        let columns: Vec<&[f64]> = columns.chunks_exact(states).map(|column| &column[..valid]).collect();
        let (q, qd) = columns.split_at(chain.nq());
        let mut refused = None;
        let done = prepared.many(States { q, qd }, law.in_space(), |k, hit| match hit {
            Ok(hit) => piece.write(k, hit),
            Err(error) => _ = refused.get_or_insert_with(|| own(first + k)(error)),
        });
        done.map_err(|error| InBatch { error, state: None })?;
        refused.or(invalid).map_or(Ok(()), Err)
    };
    let (memory, go_on) = (|| (prepared.clone(), Vec::new()), AtomicBool::new(false));
    if law.is_python() {
        // The law needs the GIL; a signal stops the batch through the exception that the law then raises.
        let mut memory = memory();
        all.pieces(1).iter_mut().enumerate().try_for_each(|(k, rows)| piece(&mut memory, k, rows, &go_on))?;
        return Ok(all);
    }
    let mut pieces = all.pieces(CHUNK);
    if let [only] = pieces.as_mut_slice() {
        py.detach(|| piece(&mut memory(), 0, only, &go_on))?;
    } else {
        on_all_cores(py, |stop| {
            let pieces = pieces.par_iter_mut().enumerate();
            first_error(pieces.map_init(memory, |memory, (c, rows)| {
                if stop.load(Ordering::Relaxed) { Ok(()) } else { piece(memory, c * CHUNK, rows, stop) }
            }))
        })??;
    }
    drop(pieces);
    Ok(all)
}

/// Impacts of a batch of B states.
///
/// `impacts[k]` is the Impact of state k; a slice, an array of numbers or one of B booleans gives the Impacts of these states. Its arrays
/// are read-only: copy one to change it.
#[pyclass(frozen, module = "carom")]
pub struct Impacts {
    count: usize,
    law: &'static str,
    /// The blocks of [`Columns`], of shape (B, width), without the derivatives.
    blocks: [Py<PyAny>; BLOCKS - 1],
    codes: Py<PyAny>,
    derivatives: Option<Py<PyDict>>,
}

fields! { Impacts { count, law, blocks, codes, derivatives } }

impl Impacts {
    pub fn new(py: Python<'_>, all: Columns, nv: usize, law: &'static str) -> PyResult<Self> {
        let Columns { count, widths, blocks: [qd_plus, impulse, u_minus, u_plus, energies, drive_impulse, by], codes } =
            all;
        let derivatives = if by.is_empty() { None } else { Some(derivatives(py, by, count, nv)?) };
        let array = |numbers, k: usize| Ok::<_, PyErr>(array(py, numbers, &[count, widths[k]])?.unbind());
        let blocks = [
            array(qd_plus, 0)?,
            array(impulse, 1)?,
            array(u_minus, 2)?,
            array(u_plus, 3)?,
            array(energies, 4)?,
            array(drive_impulse, 5)?,
        ];
        let codes = bytes(py, codes).call_method1("reshape", (count, 2))?.unbind();
        Ok(Self { count, law, blocks, codes, derivatives })
    }

    /// The impact of state k.
    fn one(&self, py: Python<'_>, k: usize) -> PyResult<Impact> {
        let row = |block: usize| self.blocks[block].bind(py).get_item(k)?.extract::<Vec<f64>>();
        let vector = |block: usize| row(block).map(|v| Vector3::from_row_slice(&v));
        let (energies, codes) = (row(4)?, self.codes.bind(py).get_item(k)?.extract::<[u8; 2]>()?);
        let (mode, flags) = (Mode::ALL[usize::from(codes[0])], Flags::from_bits(codes[1]));
        let account =
            Account { mode, normal_work: energies[2], friction_work: energies[3], flags, ..Account::default() };
        let hit = ChainImpact {
            qd_plus: row(0)?,
            impulse: vector(1)?,
            u_minus: vector(2)?,
            u_plus: vector(3)?,
            energy_before: energies[0],
            energy_after: energies[1],
            drive_impulse: row(5)?,
            drive_work: energies[4],
            mode,
            contact: ImpactOutcome { law: self.law, account, ..ImpactOutcome::default() },
            flags,
        };
        let by = self.derivatives.as_ref().map(|all| -> PyResult<_> {
            let part = |name: &str| Numbers::read(name, &all.bind(py).as_any().get_item(name)?.get_item(k)?);
            let nv = hit.qd_plus.len();
            let matrix = |name| Ok::<_, PyErr>(DMatrix::from_row_slice(nv, nv, part(name)?.slice()));
            let vector = |name| Ok::<_, PyErr>(part(name)?.slice().to_vec());
            let (restitution, friction) = (vector("restitution")?, vector("friction")?);
            Ok(Derivatives { q: matrix("q")?, qd: matrix("qd")?, restitution, friction })
        });
        Ok(Impact::of(hit, by.transpose()?))
    }

    fn ratio<'py>(&self, py: Python<'py>) -> PyResult<Array<'py>> {
        let energies = Numbers::read("energies", self.blocks[4].bind(py))?;
        let ratio = |row: &[f64]| if row[0] > 0.0 { row[1] / row[0] } else { 1.0 };
        list(py, &energies.slice().chunks_exact(5).map(ratio).collect::<Vec<_>>())
    }

    /// The derivatives in a dict of its own.
    fn by<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(all) = &self.derivatives else { return Ok(None) };
        let own = PyDict::new(py);
        for (name, of) in all.bind(py) {
            own.set_item(name, read_only(&of)?)?;
        }
        Ok(Some(own))
    }

    fn names(&self, py: Python<'_>) -> PyResult<Vec<Vec<&'static str>>> {
        let bits: Vec<u8> = Self::column(py, &self.codes, 1)?.call_method0("tolist")?.extract()?;
        Ok(bits.into_iter().map(|bits| Flags::from_bits(bits).names().collect()).collect())
    }

    /// Column k of an array.
    fn column<'py>(py: Python<'py>, of: &Py<PyAny>, k: usize) -> PyResult<Array<'py>> {
        read_only(of.bind(py))?.get_item((pyo3::types::PySlice::full(py), k))
    }
}

/// A view through which an array of the results, of which all calls share the memory, is not written.
fn read_only<'py>(of: &Array<'py>) -> PyResult<Array<'py>> {
    let view = of.call_method0("view")?;
    view.call_method1("setflags", (false,))?;
    Ok(view)
}

fn derivatives(py: Python<'_>, by: Vec<f64>, b: usize, nv: usize) -> PyResult<Py<PyDict>> {
    let all = array(py, by, &[b, 2 * nv * (nv + 1)])?;
    let part = |from: usize, to: usize| {
        let columns = pyo3::types::PySlice::new(py, from as isize, to as isize, 1);
        all.get_item((pyo3::types::PySlice::full(py), columns))
    };
    let n = nv * nv;
    let derivatives = dict! { py,
        "q": part(0, n)?.call_method1("reshape", (b, nv, nv))?,
        "qd": part(n, 2 * n)?.call_method1("reshape", (b, nv, nv))?,
        "restitution": part(2 * n, 2 * n + nv)?,
        "friction": part(2 * n + nv, 2 * n + 2 * nv)?,
    };
    Ok(derivatives.unbind())
}

getters! { Impacts, self, py {
    /// Joint velocities after the impacts, shape (B, nv); rad/s, m/s.
    qd_plus: Array<'py> = read_only(self.blocks[0].bind(py))?;
    /// Impulses on the robot, shape (B, 3), world axes, N s.
    impulse: Array<'py> = read_only(self.blocks[1].bind(py))?;
    /// Velocities of the contact point before, shape (B, 3), world axes, m/s.
    u_minus: Array<'py> = read_only(self.blocks[2].bind(py))?;
    /// Velocities of the contact point after, shape (B, 3), world axes, m/s.
    u_plus: Array<'py> = read_only(self.blocks[3].bind(py))?;
    /// T⁺/T⁻ of the robot, shape (B,); 1 at rest.
    energy_ratio: Array<'py> = self.ratio(py)?;
    /// Kinetic energies of the robot before, shape (B,), J.
    energy_before: Array<'py> = Self::column(py, &self.blocks[4], 0)?;
    /// Kinetic energies of the robot after, shape (B,), J.
    energy_after: Array<'py> = Self::column(py, &self.blocks[4], 1)?;
    /// Works of the normal impulses, shape (B,), J.
    normal_work: Array<'py> = Self::column(py, &self.blocks[4], 2)?;
    /// Works of the tangential impulses, shape (B,), J.
    friction_work: Array<'py> = Self::column(py, &self.blocks[4], 3)?;
    /// Works of the drives, shape (B,), J.
    drive_work: Array<'py> = Self::column(py, &self.blocks[4], 4)?;
    /// Impulses of the drives on each joint, shape (B, nv), N m s or N s.
    drive_impulse: Array<'py> = read_only(self.blocks[5].bind(py))?;
    /// Contact modes at the end of the impacts, an array of texts of shape (B,): "open", "stick", "slip", "reverse-slip".
    mode: Array<'py>, "NDArray[np.str_]" = texts(py, &Mode::ALL.map(Mode::name))?.get_item(Self::column(py, &self.codes, 0)?)?;
    /// The names of the flags that are set at each state, a list of B lists of texts, as `Impact.flags`.
    flags: Vec<Vec<&'static str>> = self.names(py)?;
    /// The flags as an array of uint8 of shape (B,), with bits as in carom.Flags; 0 for an ordinary impact.
    flag_bits: Array<'py>, "NDArray[np.uint8]" = Self::column(py, &self.codes, 1)?;
    /// Name of the law.
    law: &'static str = self.law;
    /// With derivatives=True a dict of the derivatives of qd_plus: "q" and "qd" of shape (B, nv, nv), "restitution" and
    /// "friction" of shape (B, nv). Else None.
    derivatives: Option<Bound<'py, PyDict>>, "dict[str, _Floats] | None" = self.by(py)?;
} }

#[pymethods]
impl Impacts {
    fn __len__(&self) -> usize {
        self.count
    }

    /// The Impact of a state, counted from the end if negative; the Impacts of a slice or an array of states.
    fn __getitem__<'py>(&self, py: Python<'py>, index: Given<'_, 'py>) -> PyResult<Array<'py>> {
        if let Ok(number) = index.extract::<isize>() {
            let from_start = if number < 0 { number + self.count as isize } else { number };
            return match usize::try_from(from_start) {
                Ok(k) if k < self.count => Ok(Bound::new(py, self.one(py, k)?)?.into_any()),
                _ => Err(PyIndexError::new_err(format!("there is no state {number}: the batch has {}", self.count))),
            };
        }
        if index.is_instance_of::<PyTuple>() {
            return Err(PyTypeError::new_err("a batch has one axis: index its arrays, like impacts.qd_plus[k, i]"));
        }
        let part = |of: &Py<PyAny>| of.bind(py).get_item(index).map(Bound::unbind);
        let codes = part(&self.codes)?;
        let mut blocks = self.blocks.each_ref().map(|block| block.clone_ref(py));
        blocks.iter_mut().try_for_each(|block| part(block).map(|own| *block = own))?;
        let derivatives = self.derivatives.as_ref().map(|all| -> PyResult<_> {
            let own = PyDict::new(py);
            for (name, of) in all.bind(py) {
                own.set_item(name, of.get_item(index)?)?;
            }
            Ok(own.unbind())
        });
        let (count, derivatives) = (codes.bind(py).len()?, derivatives.transpose()?);
        Ok(Bound::new(py, Self { count, law: self.law, blocks, codes, derivatives })?.into_any())
    }

    fn __iter__<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyIterator>> {
        let states = PyRange::new(this.py(), 0, this.get().count as isize)?;
        this.py().import("builtins")?.call_method1("map", (this.getattr("__getitem__")?, states))?.try_iter()
    }

    /// The states at which a flag is set, an array of booleans of shape (B,).
    ///
    /// Args:
    ///     name: "energy-gain", "jam", "singular", "grazing", "non-unique" or "no-approach".
    ///
    /// Raises:
    ///     ImpactError: an unknown name.
    fn flagged<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Array<'py>> {
        let known: Vec<&str> = Flags::from_bits(Flags::WITHOUT_RESTITUTION.bits() - 1).names().collect();
        let Some(bit) = known.iter().position(|flag| *flag == name) else {
            let names = known.join(", ");
            return Err(ImpactError::new_err(format!(
                "name is '{name}', and no flag is named so: the flags are {names}"
            )));
        };
        Self::column(py, &self.codes, 1)?.bitand(1u8 << bit)?.call_method1("astype", ("bool",))
    }

    fn _repr_html_<'py>(this: &Bound<'py, Self>) -> PyResult<Array<'py>> {
        notebook::call(this.py(), "impacts_html", (this,))
    }

    fn __repr__(&self) -> String {
        format!("<carom.Impacts of {} states>", self.count)
    }
}
