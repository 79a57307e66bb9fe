//! What a session judges by: the oracle, or the picture that a function of Python denoises.

use crate::arrays::{Pixels, picture};
use crate::errors::{Error, ParameterError, SizeError};
use crate::oracle::PyOracle;
use noisefloor::{Oracle, Rgb, Session, StoppingCriterion, source::FirstHits};
use noisefloor_denoise::{
    AuxiliaryPictures, DenoiseError, DenoisedQuality, DenoisedRecord, Denoiser, NoisyPicture,
};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::cell::Cell;
use std::sync::{Arc, Mutex, PoisonError};

/// Any criterion.
pub(crate) type Criterion = Box<dyn StoppingCriterion + Send>;

/// A session, and what became of its denoised pictures.
pub(crate) struct Judged {
    /// Elsewhere while it judges in the background.
    pub(crate) session: Option<Session<Criterion>>,
    pub(crate) record: Option<Arc<Mutex<DenoisedRecord>>>,
}

/// What a criterion is made from, again and again: a session that is resumed gets a new one.
pub(crate) enum Judging {
    Noise(Box<Oracle>),
    Denoised {
        /// Called with arrays, returns an array.
        denoiser: Py<PyAny>,
        lost: f64,
        first_hits: Option<Arc<[FirstHits; 2]>>,
        /// What it has raised.
        raised: Arc<Mutex<Option<PyErr>>>,
    },
}

/// Albedo and normals, for each half.
pub(crate) type Hits<'py> = [[Pixels<'py>; 2]; 2];

impl Judging {
    pub(crate) fn denoised(
        denoiser: &Bound<'_, PyAny>,
        lost: f64,
        first_hits: Option<Hits<'_>>,
        size: (usize, usize),
    ) -> PyResult<Self> {
        if !denoiser.is_callable() {
            return Err(ParameterError::new_err("denoiser must be a function of a picture"));
        }
        if !(lost > 0.0 && lost.is_finite()) {
            return Err(ParameterError::new_err(format!(
                "lost must be a positive number of JOD, not {lost}"
            )));
        }
        let copy = |pixels: &Pixels<'_>| pixels_of(pixels, size, "first_hits");
        let half = |[albedo, normal]: [Pixels<'_>; 2]| -> PyResult<FirstHits> {
            let (width, height) = size;
            Ok(FirstHits { width, height, albedo: copy(&albedo)?, normal: copy(&normal)? })
        };
        let pair = |[a, b]: Hits<'_>| -> PyResult<_> { Ok(Arc::new([half(a)?, half(b)?])) };
        Ok(Self::Denoised {
            denoiser: denoiser.clone().unbind(),
            lost,
            first_hits: first_hits.map(pair).transpose()?,
            raised: Arc::default(),
        })
    }

    pub(crate) fn make(&self, py: Python<'_>) -> PyResult<(Criterion, Option<Arc<Mutex<DenoisedRecord>>>)> {
        match self {
            Self::Noise(oracle) => Ok((oracle.clone(), None)),
            Self::Denoised { denoiser, lost, first_hits, raised } => {
                let function = Function {
                    denoiser: denoiser.clone_ref(py),
                    name: name_of(denoiser.bind(py)),
                    guided: first_hits.is_some(),
                    raised: Arc::clone(raised),
                };
                let mut criterion = DenoisedQuality::new(function, *lost);
                if let Some(first_hits) = first_hits {
                    criterion = criterion.guided_by(Arc::clone(first_hits));
                }
                let record = criterion.record();
                Ok((Box::new(criterion), Some(record)))
            }
        }
    }

    /// The exception that the denoiser has raised, which says more than that it failed.
    pub(crate) fn raised(&self) -> Option<PyErr> {
        let Self::Denoised { raised, .. } = self else { return None };
        raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// For pickle, and back.
    pub(crate) fn to_python<'py>(
        &self,
        py: Python<'py>,
        size: (usize, usize),
    ) -> PyResult<Bound<'py, PyAny>> {
        match self {
            Self::Noise(oracle) => PyOracle((**oracle).clone()).into_bound_py_any(py),
            Self::Denoised { denoiser, lost, first_hits, .. } => {
                let half = |hits: &FirstHits| -> PyResult<_> {
                    Ok((picture(py, size, hits.albedo.clone())?, picture(py, size, hits.normal.clone())?))
                };
                let hits = first_hits.as_ref();
                let hits = hits.map(|hits| PyResult::Ok((half(&hits[0])?, half(&hits[1])?))).transpose()?;
                (denoiser.clone_ref(py), *lost, hits).into_bound_py_any(py)
            }
        }
    }

    pub(crate) fn from_python(kept: &Bound<'_, PyAny>, size: (usize, usize)) -> PyResult<Self> {
        if let Ok(oracle) = kept.extract::<PyRef<'_, PyOracle>>() {
            return Ok(Self::Noise(Box::new(oracle.0.clone())));
        }
        let (denoiser, lost, first_hits) = kept.extract::<(Bound<'_, PyAny>, f64, Option<Hits<'_>>)>()?;
        Self::denoised(&denoiser, lost, first_hits, size)
    }
}

fn name_of(function: &Bound<'_, PyAny>) -> String {
    let name = function.getattr("__qualname__").and_then(|name| name.extract());
    name.unwrap_or_else(|_| function.get_type().to_string())
}

fn pixels_of(pixels: &Pixels<'_>, size: (usize, usize), what: &str) -> PyResult<Vec<Rgb>> {
    let (width, height, pixels) = pixels.get();
    if (width, height) != size {
        let (w, h) = size;
        let message =
            format!("{what}: an array has shape ({height}, {width}, 3), and the session ({h}, {w}, 3)");
        return Err(SizeError::new_err(message));
    }
    match pixels.iter().flatten().all(|value| value.is_finite()) {
        true => Ok(pixels.into_owned()),
        false => Err(ParameterError::new_err(format!("{what}: a value is not finite"))),
    }
}

thread_local! {
    /// Whether this thread is inside a denoiser, and holds the session that has called it.
    static DENOISING: Cell<bool> = const { Cell::new(false) };
}

/// A denoiser that used a session would wait for itself.
pub(crate) fn not_while_denoising() -> PyResult<()> {
    match DENOISING.get() {
        true => Err(Error::new_err("a denoiser cannot use sessions: one of them waits for it")),
        false => Ok(()),
    }
}

/// A function of Python: (height, width, 3) in, and out.
struct Function {
    denoiser: Py<PyAny>,
    name: String,
    guided: bool,
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Function {
    fn call(&self, py: Python<'_>, noisy: &NoisyPicture<'_>) -> PyResult<Vec<Rgb>> {
        let hits = [noisy.albedo, noisy.normal];
        let arrays = std::iter::once(noisy.radiance).chain(hits.into_iter().flatten());
        let arrays: Vec<_> =
            arrays.map(|pixels| picture(py, noisy.size, pixels.to_vec())).collect::<PyResult<_>>()?;
        let answer = self.denoiser.bind(py).call1(PyTuple::new(py, arrays)?)?;
        pixels_of(&answer.extract::<Pixels<'_>>()?, noisy.size, "denoiser")
    }
}

impl Denoiser for Function {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn wants(&self) -> AuxiliaryPictures {
        AuxiliaryPictures { albedo: self.guided, normal: self.guided }
    }

    fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
        Python::attach(|py| {
            DENOISING.set(true);
            let answer = self.call(py, picture);
            DENOISING.set(false);
            answer.map_err(|error| {
                let cause = error.to_string().into();
                *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                DenoiseError::Failed { name: self.name.clone(), cause }
            })
        })
    }
}
