//! Objects that pickle restores by their class method `_restore`: those that nobody makes from arguments.
//! Others say the arguments of their constructor in `__getnewargs__`.

use pyo3::prelude::*;
use pyo3::{IntoPyObjectExt, PyTypeInfo};

/// What `__reduce__` returns: `_restore` of the class, and its arguments as a tuple.
pub(crate) fn reduced<'py, Class: PyTypeInfo>(
    py: Python<'py>,
    arguments: impl IntoPyObject<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let restore = Class::type_object(py).getattr("_restore")?;
    (restore, arguments.into_bound_py_any(py)?).into_bound_py_any(py)
}
