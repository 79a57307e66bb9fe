//! Pictures to learn from how wrong denoised pictures are: benchmarks/larger.py runs it.
//!
//! `denoised_corpus levels FOLDER SCENE WIDTHxHEIGHT SEED MOST`: renders a scene with the built-in path tracer, as `render --denoise
//! oidn` does, and writes it at many numbers of samples, up to MOST: both halves, what Open Image Denoise makes of each half and of all
//! samples with clean first hits, as the mean of four mirror images. All files hold linear radiance, `f32`, little-endian, row-major.
//! `samples.csv` says that all is there.
//! After 256 samples, a tile goes on only to four times what it, or one beside it, is estimated to need for 0.2 JOD. Also how
//! many samples each tile has, what they took, and what a tile that lacks light would lose by it.
//!
//! `denoised_corpus reference FOLDER SCENE WIDTHxHEIGHT SEED SPP…`: FOLDER/reference-SEED.f32, with so many samples in each tile.
//!
//! `denoised_corpus rivals FOLDER`: by which level rules of the crate noisefloor-rivals stop each tile, for constants around those that
//! agree with people.
//!
//! `denoised_corpus estimate FOLDER`: JODs that each tile of 32 pixels, and the square of 64 around it, is estimated to have lost
//! at each number of samples, has truly lost, and its noise has, as lines of CSV.
#![allow(clippy::print_stdout, reason = "it is what this example is for")]

use noisefloor::{
    Film, ProgressiveSource, Rgb, StoppingCriterion as _, Tile, TileGrid, ToneMapping, Viewing,
    criterion::View, display::Display, evidence::TilePlanes, source::FirstHits, unmet::Unmet,
};
use noisefloor_denoise::{
    DenoisePasses, DenoisedError, DenoisedHalves, Denoiser, Guides, MirrorMean, NoisyPicture, Oidn,
};
use noisefloor_ptwne::{Ptwne, RenderOptions, Scene, scenes};
use noisefloor_sidecar::FilterPlan;
use noisefloor_vision::{VisionModel, VisionWorkspace};
use std::error::Error;
use std::fmt::Write as _;
use std::io::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

const TILE: usize = 32;
const SQUARE: usize = 64;
/// Samples per pixel of both halves together.
const LEVELS: [u64; 18] =
    [16, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048, 3072, 4096, 6144, 8192];
/// What all tiles get, a loss that is hardly noticed, and how many times more tiles get that have lost it.
const FOR_ALL: u64 = 256;
const LITTLE: f64 = 0.2;
const MORE: u64 = 4;
/// Rays a pixel for first hits, at most, as `render` has it.
const RAYS: u64 = 128;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["levels", folder, scene, size, seed, most] => {
            let folder = Path::new(folder);
            std::fs::create_dir_all(folder)?;
            levels(folder, &Opened::new(scene, size_of(size)?)?, seed.parse()?, most.parse()?)
        }
        ["reference", folder, scene, size, seed, ref spp @ ..] => {
            let spp: Vec<u64> = spp.iter().map(|spp| spp.parse()).collect::<Result<_, _>>()?;
            let path = Path::new(folder).join(format!("reference-{seed}.f32"));
            reference(path, &Opened::new(scene, size_of(size)?)?, seed.parse()?, &spp)
        }
        ["rivals", folder] => rivals(Path::new(folder)),
        ["estimate", folder] => estimate(Path::new(folder)),
        _ => Err("see the first lines of denoised_corpus.rs".into()),
    }
}

fn load(path: &Path) -> Outcome<Vec<Rgb>> {
    let bytes = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let values: Vec<f32> =
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    Ok(values.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
}

fn keep(path: PathBuf, pixels: &[Rgb]) -> Outcome<()> {
    let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    Ok(std::fs::write(path, bytes)?)
}

fn mean(a: &[Rgb], b: &[Rgb]) -> Vec<Rgb> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
}

fn halves(film: &Film) -> [Vec<Rgb>; 2] {
    let grid = film.grid();
    let mut halves = [0, 1].map(|_| vec![[0.0; 3]; grid.width() * grid.height()]);
    for tile in grid.tiles() {
        for pixel in tile.rows(grid.width()).flatten() {
            let [(a, _), (b, _)] = film.pixel_halves(tile.index, pixel);
            (halves[0][pixel], halves[1][pixel]) = (a, b);
        }
    }
    halves
}

/// Nanoseconds of a processor that the threads of this process have had. Linux; 0 elsewhere.
fn processor() -> u64 {
    let read = |task: std::fs::DirEntry| std::fs::read_to_string(task.path().join("schedstat")).ok();
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten().filter_map(read);
    tasks.filter_map(|text| text.split(' ').next()?.parse::<u64>().ok()).sum()
}

/// Takes samples until each of these tiles has so many, 8 at a time; and the seconds that each took.
fn sample(source: &mut Ptwne, film: &mut Film, wanted: &[(usize, u64)], seconds: &mut [f64]) -> Outcome<()> {
    for &(tile, spp) in wanted {
        let before = processor();
        while film.spp(tile) < spp {
            for batch in source.sample(&[film.request(tile, 8)])? {
                film.add(batch.tile.index, batch.spp, &batch.mean)?;
            }
        }
        seconds[tile] += (processor() - before) as f64 * 1e-9;
    }
    Ok(())
}

fn size_of(text: &str) -> Outcome<(usize, usize)> {
    let (width, height) = text.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    Ok((width.parse()?, height.parse()?))
}

/// A scene, as `render` takes it.
struct Opened {
    scene: Arc<Scene>,
    depth: Option<u32>,
    clamp: Option<f32>,
    size: (usize, usize),
}

impl Opened {
    fn new(scene: &str, size: (usize, usize)) -> Outcome<Self> {
        Ok(match scenes::by_name(scene) {
            Some(scene) => Self { scene: scene.into(), depth: None, clamp: None, size },
            None => {
                let loaded = noisefloor_scenefile::load(Path::new(scene))?;
                Self { scene: loaded.scene.into(), depth: loaded.max_depth, clamp: loaded.clamp, size }
            }
        })
    }

    fn source(&self, seed: u64) -> Outcome<Ptwne> {
        let defaults = RenderOptions { seed, threads: NonZeroUsize::new(1), ..RenderOptions::default() };
        let options = RenderOptions {
            max_depth: self.depth.unwrap_or(defaults.max_depth),
            clamp: self.clamp,
            ..defaults
        };
        Ok(Ptwne::new(Arc::clone(&self.scene), self.size.0, self.size.1, options)?)
    }

    fn grid(&self) -> Outcome<TileGrid> {
        Ok(TileGrid::new(self.size.0, self.size.1, TILE)?)
    }
}

/// So many samples in each tile, in all of them if it is one number.
fn reference(path: PathBuf, scene: &Opened, seed: u64, spp: &[u64]) -> Outcome<()> {
    let grid = scene.grid()?;
    let (mut source, mut film) = (scene.source(seed)?, Film::without_halves(grid));
    let wanted: Vec<(usize, u64)> = (0..grid.len()).zip(spp.iter().copied().cycle()).collect();
    sample(&mut source, &mut film, &wanted, &mut vec![0.0; grid.len()])?;
    keep(path, &film.image())
}

/// Writes all levels, and then which there are.
fn levels(folder: &Path, scene: &Opened, seed: u64, most: u64) -> Outcome<()> {
    if folder.join("samples.csv").exists() {
        return Ok(());
    }
    let (size, grid) = (scene.size, scene.grid()?);
    let mut oidn = Arc::new(Mutex::new(Oidn::start(FilterPlan::default())?));
    let wants = oidn.wants();
    let mut source = scene.source(seed)?;
    let guides = Guides::render(&mut source, &mut oidn, RAYS)?.ok_or("no first hits")?;
    let [ga, gb] = guides.halves().clone();
    let (both, clean) = (guides.together(), guides.is_clean());
    let mut four = MirrorMean::new(Arc::clone(&oidn), DenoisePasses::Four);
    keep(folder.join("albedo.f32"), &both.albedo)?;
    keep(folder.join("normal.f32"), &both.normal)?;

    let mut film = Film::new(grid);
    let mut seconds = vec![0.0; grid.len()];
    // Samples after which each tile had lost little
    let mut needs = vec![u64::MAX; grid.len()];
    let mut counts = String::from("level,tile,spp,seconds,unmet\n");
    for level in LEVELS.into_iter().take_while(|&level| level <= most) {
        let wanted: Vec<(usize, u64)> = grid
            .tiles()
            .filter(|tile| level <= FOR_ALL || level <= beside(grid, &needs, *tile).saturating_mul(MORE))
            .map(|tile| (tile.index, level))
            .collect();
        if wanted.is_empty() {
            break;
        }
        sample(&mut source, &mut film, &wanted, &mut seconds)?;
        let [a, b] = halves(&film);
        let all = mean(&a, &b);
        let [pa, pb, pall] = [(&a, &ga), (&b, &gb), (&all, &both)]
            .map(|(noisy, guide)| NoisyPicture::new(size, noisy).guided(guide, clean, wants));
        let [da, db] = oidn.denoise_both([&pa, &pb])?;
        let shown = four.denoise(&pall)?;
        for (name, picture) in [("a", &a), ("b", &b), ("da", &da), ("db", &db), ("shown", &shown)] {
            keep(folder.join(format!("{name}-{level:05}.f32")), picture)?;
        }
        let display = ToneMapping::default().settle(&all);
        let eyes = &mut Eyes::default();
        let halves = DenoisedHalves { size, noisy: [&a, &b], denoised: [&da, &db] };
        let error = DenoisedError::new(&halves, &display)?;
        let unmet = Unmet::of(&film, &display, Viewing::default());
        for tile in grid.tiles() {
            let [own, square] = [tile, around(tile, size)].map(|part| eyes.lost(&error, part));
            if own?.min(square?) <= LITTLE {
                needs[tile.index] = needs[tile.index].min(level);
            }
            let dark = match unmet.shown(&film, &display, tile) {
                Some(light) => {
                    let field = display.luma(average(tile.rows(size.0).flatten().map(|p| all[p])));
                    let light: Vec<f32> = light.residual.inside(light.inner).collect();
                    eyes.seen(&vec![field; light.len()], &light, (tile.width, tile.height))?
                }
                None => 0.0,
            };
            let (tile, spp) = (tile.index, film.spp(tile.index));
            writeln!(counts, "{level},{tile},{spp},{:.4},{dark:.4}", seconds[tile])?;
        }
        std::fs::write(folder.join("counts.csv"), &counts)?;
    }
    let (width, height) = size;
    Ok(std::fs::write(folder.join("samples.csv"), format!("width,height,clean\n{width},{height},{clean}\n"))?)
}

fn average(pixels: impl Iterator<Item = Rgb>) -> Rgb {
    let (sum, count) = pixels.fold(([0.0; 3], 0.0), |(sum, count), pixel| {
        (std::array::from_fn(|c| sum[c] + f64::from(pixel[c])), count + 1.0)
    });
    sum.map(|c| (c / count) as f32)
}

/// The most of what a tile and the eight around it need.
fn beside(grid: TileGrid, needs: &[u64], tile: Tile) -> u64 {
    let (column, row) = (tile.index % grid.columns(), tile.index / grid.columns());
    let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
    let tiles = near(row, grid.rows()).flat_map(|y| near(column, grid.columns()).map(move |x| (x, y)));
    tiles.map(|(x, y)| needs[y * grid.columns() + x]).max().unwrap_or(u64::MAX)
}

/// The vision model, and room for it.
struct Eyes {
    model: VisionModel,
    room: VisionWorkspace,
}

impl Default for Eyes {
    fn default() -> Self {
        Self { model: VisionModel::new(&Viewing::default()), room: VisionWorkspace::default() }
    }
}

impl Eyes {
    fn lost(&mut self, error: &DenoisedError, part: Tile) -> Outcome<f64> {
        Ok(error.jods_lost(part, &self.model, &mut self.room)?)
    }

    /// JODs lost by an error of luminance on a grey picture.
    fn seen(&mut self, on: &[f32], error: &[f32], size: (usize, usize)) -> Outcome<f64> {
        let test: Vec<Rgb> = on.iter().zip(error).map(|(on, error)| [on + error; 3]).collect();
        let reference: Vec<Rgb> = on.iter().map(|&on| [on; 3]).collect();
        Ok(10.0 - self.model.compare(&test, &reference, size, &mut self.room)?.jod())
    }
}

/// The tile, grown to a square within the picture, as a verdict sees it.
fn around(tile: Tile, (width, height): (usize, usize)) -> Tile {
    let at = |place: usize, edge: usize, side: usize| {
        (place + edge / 2).saturating_sub(SQUARE / 2).min(side - SQUARE)
    };
    let (x, y) = (at(tile.x, tile.width, width), at(tile.y, tile.height, height));
    Tile { index: tile.index, x, y, width: SQUARE, height: SQUARE }
}

/// What `levels` has written of a folder.
struct Kept {
    grid: TileGrid,
    clean: bool,
    /// Samples of each tile, by level.
    spp: Vec<(u64, Vec<u64>)>,
}

impl Kept {
    fn of(folder: &Path) -> Outcome<Self> {
        let all = std::fs::read_to_string(folder.join("samples.csv"))?;
        let line: Vec<&str> = all.lines().nth(1).ok_or("samples.csv has no line")?.split(',').collect();
        let [width, height, clean, ..] = line[..] else {
            return Err("samples.csv has too few columns".into());
        };
        let grid = TileGrid::new(width.parse()?, height.parse()?, TILE)?;
        let mut spp: Vec<(u64, Vec<u64>)> = Vec::new();
        for line in std::fs::read_to_string(folder.join("counts.csv"))?.lines().skip(1) {
            let mut numbers = line.split(',').map(str::parse);
            let mut next = || numbers.next().ok_or("counts.csv has too few columns");
            let (level, _tile, count) = (next()??, next()??, next()??);
            match spp.last_mut() {
                Some((last, counts)) if *last == level => counts.push(count),
                _ => spp.push((level, vec![count])),
            }
        }
        Ok(Self { grid, clean: clean.parse()?, spp })
    }

    fn film(&self, [a, b]: [&[Rgb]; 2], spp: &[u64]) -> Outcome<Film> {
        let mut film = Film::new(self.grid);
        for tile in self.grid.tiles() {
            for half in [a, b] {
                let own: Vec<Rgb> = tile.rows(self.grid.width()).flatten().map(|pixel| half[pixel]).collect();
                film.add(tile.index, spp[tile.index] / 2, &own)?;
            }
        }
        Ok(film)
    }
}

fn estimate(folder: &Path) -> Outcome<()> {
    let scene = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let picture = |name: &str| load(&folder.join(format!("{name}.f32")));
    let (one, other) = (picture("reference-a")?, picture("reference-b")?);
    let truth = mean(&one, &other);
    let kept = Kept::of(folder)?;
    let (grid, size) = (kept.grid, kept.grid.size());
    let display = ToneMapping::default().settle(&truth);
    let eyes = &mut Eyes::default();
    let mut out = String::new();
    let print =
        |out: &mut String, spp: u64, kind: &str, error: &DenoisedError, eyes: &mut Eyes| -> Outcome<()> {
            for tile in grid.tiles() {
                let [own, square] = [tile, around(tile, size)].map(|part| eyes.lost(error, part));
                writeln!(out, "{scene},{spp},{},{kind},{:.5},{:.5}", tile.index, own?, square?)?;
            }
            Ok(())
        };
    // As strong as the noise of their mean
    let half_of: Vec<Rgb> =
        truth.iter().zip(&one).map(|(&t, a)| std::array::from_fn(|c| (a[c] - t[c]) + t[c])).collect();
    print(&mut out, 0, "reference", &DenoisedError::known(size, &half_of, &truth, &display)?, eyes)?;
    let clean = denoised(folder, &truth, &kept)?;
    print(&mut out, 0, "reference-denoised", &DenoisedError::known(size, &clean, &truth, &display)?, eyes)?;
    for (level, spp) in &kept.spp {
        let level = *level;
        let picture = |name: &str| picture(&format!("{name}-{level:05}"));
        let (a, b, da, db) = (picture("a")?, picture("b")?, picture("da")?, picture("db")?);
        let error =
            DenoisedError::new(&DenoisedHalves { size, noisy: [&a, &b], denoised: [&da, &db] }, &display)?;
        print(&mut out, level, "estimate", &error, eyes)?;
        let (shown, all) = (picture("shown")?, mean(&a, &b));
        print(&mut out, level, "true", &DenoisedError::known(size, &shown, &truth, &display)?, eyes)?;
        print(
            &mut out,
            level,
            "true-denoised",
            &DenoisedError::known(size, &shown, &clean, &display)?,
            eyes,
        )?;
        print(&mut out, level, "noisy", &DenoisedError::known(size, &all, &truth, &display)?, eyes)?;
        print(&mut out, level, "noisy-denoised", &DenoisedError::known(size, &all, &clean, &display)?, eyes)?;
        // The noise as a verdict knows it: half the difference of the halves, on what the denoiser made
        let film = kept.film([&a, &b], spp)?;
        for tile in grid.tiles() {
            let planes = TilePlanes::from_halves(&film, &display, tile);
            let values: Vec<f32> = planes.residual.inside(planes.inner).collect();
            let made: Vec<f32> = tile.rows(size.0).flatten().map(|pixel| error.shown()[pixel]).collect();
            let rendered: Vec<f32> = planes.image.inside(planes.inner).collect();
            let [made, rendered] =
                [made, rendered].map(|on| eyes.seen(&on, &values, (tile.width, tile.height)));
            let lost = made?.max(rendered?);
            writeln!(out, "{scene},{level},{},noise,{lost:.5},{lost:.5}", tile.index)?;
        }
    }
    Ok(std::io::stdout().write_all(out.as_bytes())?)
}

/// What is made of the reference, once.
fn denoised(folder: &Path, truth: &[Rgb], kept: &Kept) -> Outcome<Vec<Rgb>> {
    let path = folder.join("reference-denoised.f32");
    if !path.exists() {
        let [albedo, normal] = ["albedo", "normal"].map(|name| load(&folder.join(format!("{name}.f32"))));
        let guides = FirstHits::new(kept.grid.size(), albedo?, normal?);
        let oidn = Arc::new(Mutex::new(Oidn::start(FilterPlan::default())?));
        let picture = NoisyPicture::new(kept.grid.size(), truth).guided(&guides, kept.clean, oidn.wants());
        keep(path.clone(), &MirrorMean::new(oidn, DenoisePasses::Four).denoise(&picture)?)?;
    }
    load(&path)
}

/// For each rule and constant a letter for each tile: by which level it is done, `a` for the first; `-` if by none.
fn rivals(folder: &Path) -> Outcome<()> {
    let kept = Kept::of(folder)?;
    let mut films = Vec::new();
    for (level, spp) in &kept.spp {
        let [mut a, mut b] = [
            load(&folder.join(format!("a-{level:05}.f32")))?,
            load(&folder.join(format!("b-{level:05}.f32")))?,
        ];
        // Where a tile was not sampled any more, its noise is made as weak as it would be
        for tile in kept.grid.tiles() {
            let weaker = (spp[tile.index] as f32 / *level as f32).sqrt();
            for pixel in tile.rows(kept.grid.width()).flatten() {
                for channel in 0..3 {
                    let (x, y) = (a[pixel][channel], b[pixel][channel]);
                    let (middle, apart) = (0.5 * (x + y), 0.5 * (x - y) * weaker);
                    (a[pixel][channel], b[pixel][channel]) = (middle + apart, middle - apart);
                }
            }
        }
        films.push(kept.film([&a, &b], &vec![*level; kept.grid.len()])?);
    }
    let display: Display = ToneMapping::default().settle(&films.last().ok_or("no levels")?.image());
    let mut out = String::new();
    for (rule, constant) in [("dammertz", 0.0046), ("relative-error", 0.17), ("cycles", 0.081)] {
        for constant in (-30..=40).map(|step| constant * f64::exp(0.1 * f64::from(step))) {
            let mut criterion = noisefloor_rivals::parse(&format!("{rule}:{constant:.6}"))?;
            criterion.begin(kept.grid);
            let mut stops = vec!['-'; kept.grid.len()];
            for (film, letter) in films.iter().zip('a'..) {
                let open: Vec<Tile> = kept.grid.tiles().filter(|tile| stops[tile.index] == '-').collect();
                let verdicts = criterion.judge(&View::new(film, &display), &open)?;
                for (tile, verdict) in open.iter().zip(verdicts) {
                    if verdict.converged {
                        stops[tile.index] = letter;
                    }
                }
            }
            writeln!(out, "{rule},{constant:.6},{}", stops.iter().collect::<String>())?;
        }
    }
    Ok(std::io::stdout().write_all(out.as_bytes())?)
}
