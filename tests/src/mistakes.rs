//! What renderers push by mistake in place of means of new samples: for the test `watch`, and for the table
//! in the guide to embedding, which the example `fed_wrongly` makes.

use noisefloor::{
    Oracle, Params, ProgressiveSource, Request, Rgb, Session, SessionError, Tile, TileGrid,
    display::srgb_encode,
    watch::{Fault, Warning},
};

/// Samples per pixel of which every batch is a multiple.
const UNIT: u64 = 4;

/// A picture's samples, rendered once for many mistakes.
pub struct Samples {
    size: (usize, usize),
    /// Means of [`UNIT`] samples each.
    units: Vec<Vec<Rgb>>,
}

impl Samples {
    /// Renders so many samples per pixel.
    ///
    /// # Panics
    /// If the source fails.
    pub fn of(mut source: impl ProgressiveSource, spp: u64) -> Self {
        let (width, height) = (source.info().width, source.info().height);
        let tile = Tile { index: 0, x: 0, y: 0, width, height };
        let unit = |k| source.sample(&[Request::new(tile, k * UNIT, UNIT)]).expect("samples").remove(0).mean;
        Self { size: (width, height), units: (0..spp / UNIT).map(unit).collect() }
    }

    /// The mean of samples `first` to `first + spp`.
    fn mean(&self, first: u64, spp: u64) -> Vec<Rgb> {
        let units = &self.units[(first / UNIT) as usize..((first + spp) / UNIT) as usize];
        let mut mean = vec![[0.0; 3]; self.size.0 * self.size.1];
        for unit in units {
            for (sum, new) in mean.iter_mut().flatten().zip(unit.iter().flatten()) {
                *sum += new / units.len() as f32;
            }
        }
        mean
    }

    /// Each pixel with its neighbours, weighted by the kernel in both directions.
    fn filtered(&self, image: &[Rgb], kernel: [f32; 3]) -> Vec<Rgb> {
        let (width, height) = self.size;
        let all: f32 = kernel.iter().sum::<f32>().powi(2);
        let mut filtered = vec![[0.0; 3]; image.len()];
        for (i, pixel) in filtered.iter_mut().enumerate() {
            for (dy, dx) in (0..9).map(|k| (k / 3, k % 3)) {
                let near = |at: usize, d: usize, edge: usize| (at + d).saturating_sub(1).min(edge - 1);
                let from = image[near(i / width, dy, height) * width + near(i % width, dx, width)];
                pixel.iter_mut().zip(from).for_each(|(c, from)| *c += kernel[dy] * kernel[dx] / all * from);
            }
        }
        filtered
    }
}

/// What is pushed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// Means of new samples, as it should be.
    None,
    /// The mean of all samples so far.
    RunningMeans,
    /// The same, with all samples so far as its number.
    RunningTotals,
    /// The same random numbers for every batch.
    OneSeed,
    /// The default pixel filter of Mitsuba, a Gaussian of half a pixel: neighbours are correlated by e⁻¹.
    GaussianFilter,
    /// The mean of 3×3 pixels.
    Blur,
    /// All samples so far as the number of a batch.
    Totals,
    /// Values as a screen gets them.
    Srgb,
    /// Sums instead of means.
    Sums,
    /// Rows of a tile from the bottom.
    RowsFlipped,
    /// Rows and columns of a tile exchanged.
    Transposed,
    /// Each tile under its neighbour's number.
    Neighbour,
}

impl Mistake {
    /// All, in the order of the table.
    pub const ALL: [Self; 12] = [
        Self::None,
        Self::RunningMeans,
        Self::RunningTotals,
        Self::OneSeed,
        Self::GaussianFilter,
        Self::Blur,
        Self::Totals,
        Self::Srgb,
        Self::Sums,
        Self::RowsFlipped,
        Self::Transposed,
        Self::Neighbour,
    ];

    /// The picture of a batch, and what is said to be its number of samples.
    fn batch(self, samples: &Samples, first: u64, spp: u64) -> (u64, Vec<Rgb>) {
        let new = || samples.mean(first, spp);
        let each = |change: &dyn Fn(f32) -> f32| new().into_iter().map(|pixel| pixel.map(change)).collect();
        match self {
            Self::RunningMeans => (spp, samples.mean(0, first + spp)),
            Self::RunningTotals => (first + spp, samples.mean(0, first + spp)),
            Self::OneSeed => (spp, samples.mean(0, spp)),
            Self::GaussianFilter => (spp, samples.filtered(&new(), [0.2, 1.0, 0.2])),
            Self::Blur => (spp, samples.filtered(&new(), [1.0; 3])),
            Self::Totals => (first + spp, new()),
            Self::Srgb => (spp, each(&|c| srgb_encode(c.clamp(0.0, 1.0)))),
            Self::Sums => (spp, each(&|c| c * spp as f32)),
            _ => (spp, new()),
        }
    }

    /// The pixels that are pushed for a tile.
    fn tile(self, image: &[Rgb], grid: TileGrid, tile: Tile) -> Vec<Rgb> {
        let cut = |tile: Tile| -> Vec<Rgb> {
            tile.rows(grid.width()).flat_map(|row| image[row].to_vec()).collect()
        };
        match self {
            Self::RowsFlipped => cut(tile).chunks(tile.width).rev().flatten().copied().collect(),
            Self::Transposed => {
                let pixels = cut(tile);
                (0..pixels.len()).map(|i| pixels[i % tile.width * tile.width + i / tile.width]).collect()
            }
            Self::Neighbour => cut(grid.tile((tile.index + 1) % grid.len())),
            _ => cut(tile),
        }
    }
}

/// How a session ends that is fed so.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Samples per pixel, really taken, when a tile stopped first; `None` if none did.
    pub first_stop: Option<u64>,
    /// Warnings, each with the samples per pixel really taken.
    pub warnings: Vec<(u64, Warning)>,
    /// The fault, likewise.
    pub fault: Option<(u64, Fault)>,
}

/// Feeds a session of the bundled oracle, in passes of so many samples, or in the batches that it asks for,
/// until samples are used up, all tiles have stopped or there is a fault. Tiles have to be square.
///
/// # Panics
/// If the session fails otherwise.
pub fn feed(samples: &Samples, edge: usize, mistake: Mistake, passes: Option<u64>) -> Outcome {
    let params = Params::default().with_tile(edge).with_max_spp(1 << 30);
    let (width, height) = samples.size;
    let mut session = Session::new(width, height, Oracle::bundled(), params).expect("a session");
    // Nobody says so of what is encoded
    if mistake != Mistake::Srgb {
        session.set_linear();
    }
    let grid = session.film().grid();
    let (mut had, most) = (0, samples.units.len() as u64 * UNIT);
    let mut outcome = Outcome::default();
    while had < most && !session.is_done() {
        let asked = session.requests()[0].spp / UNIT * UNIT;
        let spp = passes.unwrap_or(asked).clamp(UNIT, most - had);
        let (claimed, image) = mistake.batch(samples, had, spp);
        had += spp;
        for tile in grid.tiles() {
            if session.is_open(tile.index) {
                let mean = mistake.tile(&image, grid, tile);
                session.push(tile.index, claimed, &mean).expect("a batch");
            }
        }
        let judged = session.judge();
        outcome.warnings.extend(session.new_warnings().into_iter().map(|warning| (had, warning)));
        match judged {
            Ok(stops) if stops.is_empty() => {}
            Ok(_) => outcome.first_stop = outcome.first_stop.or(Some(had)),
            Err(SessionError::Fault(fault)) => {
                outcome.fault = Some((had, fault));
                break;
            }
            Err(error) => panic!("{error}"),
        }
    }
    outcome
}
