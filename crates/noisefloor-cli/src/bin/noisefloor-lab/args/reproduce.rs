//! `noisefloor-lab reproduce`.

use clap::Args;
use noisefloor::tile::DEFAULT_TILE;
use noisefloor_cli::options::values;
use std::path::PathBuf;

/// Repeat the paper's own experiment on human corpora, at its scale.
///
/// The paper (Takouachet et al. 2017, §4.3 to §5) trains on pairs: a noisy tile and its reference, 128×128
/// pixels each, with C = 2 and γ = 2. Luminances failed there (P ≈ 23 %), while noise masks classified
/// 97.98 % correctly. This command trains on both, with values as displayed and standardised. It tests each
/// machine on the pairs it learned, on a held-out fifth of the pairs, on the other half of the scenes, and
/// on each scene left out.
///
/// The eight scenes of the human data make 128 zones × 75 levels = 9,600 pairs of 32,768 numbers: 5 GB of
/// memory, some twenty minutes on two cores. Every result is written as soon as it is known. After Ctrl-C
/// (exit code 130), the same command continues. The summary is in reproduce.json and reproduce.md.
///
/// Levels between the given images are synthesised (noise ∝ 1/√n); real images are scored separately.
/// Pictures are compared with SCENE/reference.exr. If there is none, the most converged image stands in for
/// the paper's ray-traced reference.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor-lab reproduce --corpus study/lisic9 study/staircase")]
pub struct ReproduceArgs {
    /// Corpus folders, as for `train`.
    #[arg(long, value_name = "DIR", num_args = 1.., required = true)]
    pub corpus: Vec<PathBuf>,
    /// Output folder.
    #[arg(long, value_name = "DIR", default_value = "out/reproduce")]
    pub out: PathBuf,
    /// Edge of the tiles in pixels; each tile is the centre of its zone.
    #[arg(long, value_name = "PIXELS", default_value_t = DEFAULT_TILE, value_parser = values::edge)]
    pub edge: usize,
    /// Levels a zone, in equal steps up to its most converged image, 10…1000. The paper has 100.
    #[arg(long, value_name = "N", default_value_t = 75, value_parser = levels)]
    pub levels: usize,
}

fn levels(text: &str) -> Result<usize, String> {
    values::within(text, 10..=1000)
}
