//! Arrays that lie in Rust's memory: no copies.

use numpy::ndarray::{ArrayView1, ArrayView2};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::PyClass;
use pyo3::prelude::*;

use crate::errors;

/// `values` of `owner` as a read-only array that keeps `owner` alive.
///
/// `owner` must be a frozen class that holds `values`, or something behind an `Arc` it holds, and never changes or moves them.
#[allow(
    unsafe_code,
    reason = "numpy has no safe way to lend it memory; the owner is frozen and outlives the array"
)]
pub fn lend<'py, T: PyClass>(
    owner: &Bound<'py, T>,
    values: &[f64],
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let view = ArrayView1::from(values);
    // SAFETY: `owner` becomes the array's base, so it lives as long; being frozen it leaves the memory where and as it is;
    // and nobody writes through the array, which is made read-only before it is handed out.
    let array = unsafe { PyArray1::borrow_from_array(&view, owner.clone().into_any()) };
    array.readwrite().make_nonwriteable();
    Ok(array)
}

/// The same for rows of `columns` numbers.
#[allow(unsafe_code, reason = "as `lend`")]
pub fn lend_rows<'py, T: PyClass>(
    owner: &Bound<'py, T>,
    values: &[f64],
    columns: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows = values.len() / columns;
    let view = ArrayView2::from_shape((rows, columns), values)
        .map_err(|error| errors::bikebot(owner.py(), &error.to_string()))?;
    // SAFETY: as in `lend`.
    let array = unsafe { PyArray2::borrow_from_array(&view, owner.clone().into_any()) };
    array.readwrite().make_nonwriteable();
    Ok(array)
}
