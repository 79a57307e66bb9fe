//! What a session judges by: the oracle, or the picture that a function of Python denoises.

use crate::arrays::{Pixels, picture};
use crate::errors::{Error, ParameterError, SizeError};
use crate::oracle::PyOracle;
use noisefloor::{Oracle, Rgb, StoppingCriterion, source::FirstHits};
use noisefloor_denoise::{
    AuxiliaryPictures, DenoiseError, DenoisePasses, DenoisedQuality, Denoiser, Guides, MirrorMean,
    NoisyPicture,
};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::cell::Cell;
use std::sync::{Arc, Mutex, PoisonError};

pub(crate) type Criterion = Box<dyn StoppingCriterion + Send>;

/// What a criterion is made from, again and again: a session that is resumed gets a new one.
pub(crate) enum Judging {
    Noise(Box<Oracle>),
    Denoised {
        /// Called with arrays, returns an array.
        denoiser: Py<PyAny>,
        lost: f64,
        guides: Option<Arc<Guides>>,
        /// Of the finished picture.
        passes: DenoisePasses,
        /// What it has raised.
        raised: Arc<Mutex<Option<PyErr>>>,
    },
}

/// Albedo and normals, for each half.
pub(crate) type Hits<'py> = [[Pixels<'py>; 2]; 2];

impl Judging {
    pub(crate) fn denoised(
        denoiser: &Bound<'_, PyAny>,
        (lost, passes): (f64, usize),
        first_hits: Option<Hits<'_>>,
        size: (usize, usize),
    ) -> PyResult<Self> {
        must_be_callable(denoiser)?;
        if !(lost > 0.0 && lost.is_finite()) {
            return Err(ParameterError::new_err(format!(
                "lost must be a positive number of JOD, not {lost}"
            )));
        }
        Ok(Self::Denoised {
            denoiser: denoiser.clone().unbind(),
            lost,
            guides: first_hits.map(|hits| guides(hits, size).map(Arc::new)).transpose()?,
            passes: passes_of(passes)?,
            raised: Arc::default(),
        })
    }

    pub(crate) fn make(&self, py: Python<'_>) -> PyResult<Criterion> {
        match self {
            Self::Noise(oracle) => Ok(oracle.clone()),
            Self::Denoised { denoiser, lost, guides, passes, raised } => {
                let function = Function {
                    denoiser: denoiser.clone_ref(py),
                    name: name_of(denoiser.bind(py)),
                    guided: guides.is_some(),
                    raised: Arc::clone(raised),
                };
                let mut criterion = DenoisedQuality::new(function, *lost).shown_as_mean_of(*passes);
                if let Some(guides) = guides {
                    criterion = criterion.guided_by(Arc::clone(guides));
                }
                Ok(Box::new(criterion))
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
            Self::Denoised { denoiser, lost, guides, passes, .. } => {
                let half = |hits: &FirstHits| -> PyResult<_> {
                    Ok((picture(py, size, hits.albedo.clone())?, picture(py, size, hits.normal.clone())?))
                };
                let hits = guides.as_ref().map(|guides| guides.halves());
                let hits = hits.map(|hits| PyResult::Ok((half(&hits[0])?, half(&hits[1])?))).transpose()?;
                (denoiser.clone_ref(py), (*lost, passes.count()), hits).into_bound_py_any(py)
            }
        }
    }

    pub(crate) fn from_python(kept: &Bound<'_, PyAny>, size: (usize, usize)) -> PyResult<Self> {
        if let Ok(oracle) = kept.extract::<PyRef<'_, PyOracle>>() {
            return Ok(Self::Noise(Box::new(oracle.0.clone())));
        }
        let (denoiser, limits, first_hits) =
            kept.extract::<(Bound<'_, PyAny>, (f64, usize), Option<Hits<'_>>)>()?;
        Self::denoised(&denoiser, limits, first_hits, size)
    }
}

/// Whether a denoiser may take albedo and normals at their word (`cleanAux` of Open Image Denoise): whether the noise by
/// which both halves differ is too little to be seen in a denoised picture.
///
/// first_hits: ((albedo, normal), (albedo, normal)), a pair for each half, independent of each other: arrays of shape
///     (height, width, 3).
///
/// Raises SizeError if the shapes differ, ParameterError if a value is not finite.
#[pyfunction]
pub(crate) fn first_hits_are_clean(first_hits: Hits<'_>) -> PyResult<bool> {
    let (width, height, _) = first_hits[0][0].get();
    Ok(guides(first_hits, (width, height))?.is_clean())
}

/// The mean of what a denoiser makes of a picture and of its mirror images: it has less of what denoisers get wrong by
/// chance. Albedo and normals are mirrored with it.
///
/// denoiser: as of a Session. radiance, albedo, normal: arrays of shape (height, width, 3), the last two both or
///     neither. passes: 1 or 4.
///
/// A Session whose finished picture is such a mean is told so by its `passes`.
#[pyfunction]
#[pyo3(signature = (denoiser, radiance, albedo = None, normal = None, *, passes = 4))]
pub(crate) fn mirror_mean<'py>(
    py: Python<'py>,
    denoiser: Bound<'py, PyAny>,
    radiance: Pixels<'py>,
    albedo: Option<Pixels<'py>>,
    normal: Option<Pixels<'py>>,
    passes: usize,
) -> PyResult<Bound<'py, PyAny>> {
    must_be_callable(&denoiser)?;
    if albedo.is_some() != normal.is_some() {
        return Err(ParameterError::new_err("give both albedo and normal, or neither"));
    }
    let (width, height, _) = radiance.get();
    let size = (width, height);
    let radiance = pixels_of(&radiance, size, "radiance")?;
    let plane = |pixels: Option<Pixels<'_>>, what| pixels.map(|p| pixels_of(&p, size, what)).transpose();
    let (albedo, normal) = (plane(albedo, "albedo")?, plane(normal, "normal")?);
    let raised = Arc::default();
    let function = Function {
        name: name_of(&denoiser),
        denoiser: denoiser.unbind(),
        guided: albedo.is_some(),
        raised: Arc::clone(&raised),
    };
    let noisy = NoisyPicture {
        albedo: albedo.as_deref(),
        normal: normal.as_deref(),
        ..NoisyPicture::new(size, &radiance)
    };
    let made = MirrorMean::new(function, passes_of(passes)?).denoise(&noisy).map_err(|error| {
        let raised: Option<PyErr> = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
        raised.unwrap_or_else(|| Error::new_err(error.to_string()))
    })?;
    picture(py, size, made)?.into_bound_py_any(py)
}

fn must_be_callable(denoiser: &Bound<'_, PyAny>) -> PyResult<()> {
    if denoiser.is_callable() {
        Ok(())
    } else {
        Err(ParameterError::new_err("denoiser must be a function of a picture"))
    }
}

fn passes_of(count: usize) -> PyResult<DenoisePasses> {
    DenoisePasses::new(count)
        .ok_or_else(|| ParameterError::new_err(format!("passes must be 1 or 4, not {count}")))
}

fn guides([a, b]: Hits<'_>, size: (usize, usize)) -> PyResult<Guides> {
    let half = |[albedo, normal]: [Pixels<'_>; 2]| -> PyResult<FirstHits> {
        let copy = |pixels| pixels_of(&pixels, size, "first_hits");
        Ok(FirstHits::new(size, copy(albedo)?, copy(normal)?))
    };
    Ok(Guides::new([half(a)?, half(b)?]))
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
        let failed = |cause: String| DenoiseError::Failed { name: self.name.clone(), cause: cause.into() };
        // The script may have ended, and with it the interpreter, before the session has
        let made = Python::try_attach(|py| {
            DENOISING.set(true);
            let answer = self.call(py, picture);
            DENOISING.set(false);
            answer.map_err(|error| {
                let cause = error.to_string();
                *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                failed(cause)
            })
        });
        made.unwrap_or_else(|| Err(failed("the interpreter has ended".into())))
    }
}
