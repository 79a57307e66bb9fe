//! Where pictures are seen.

use crate::refuse;
use clap::{Args, ValueHint};
use noisefloor::{Oracle, Viewing};

/// On which display, and from how far.
#[derive(Debug, Args)]
pub struct ViewingArgs {
    /// What pictures are seen on: `desk` (24 inches, Full HD, 60 cm), `laptop`, `tv`, `phone`, `cinema`; a
    /// display of ColorVideoVDP such as `standard_4k`; numbers, `ppd=60,peak=300,black=0.3,ambient=100`
    /// (pixels per degree, cd/m², lux); or a preset with changes, `desk,distance=1.2` (metres),
    /// `desk,primaries=p3`, `desk,white=d50` (or `white=5500K`, or x:y) [default: what the model was trained
    /// for; `desk` for the bundled one, and without a model].
    #[arg(long, value_name = "WHERE", value_hint = ValueHint::Other)]
    viewing: Option<Viewing>,
}

impl ViewingArgs {
    /// What was typed, or the default conditions.
    pub fn or_default(&self) -> Viewing {
        self.viewing.unwrap_or_default()
    }

    /// What was typed, or what the model was trained for.
    pub fn of(&self, oracle: &Oracle) -> Viewing {
        self.viewing.unwrap_or_else(|| oracle.model().viewing())
    }

    /// [`ViewingArgs::of`], checked.
    pub fn judged_by(&self, oracle: &Oracle) -> anyhow::Result<Viewing> {
        judged_by(self.viewing, oracle)
    }

    /// What was typed.
    pub fn typed(&self) -> Option<Viewing> {
        self.viewing
    }
}

/// Where pictures are seen, by default where the model was trained for: not every model knows what other
/// conditions change.
pub fn judged_by(viewing: Option<Viewing>, oracle: &Oracle) -> anyhow::Result<Viewing> {
    let model = oracle.model();
    let asked = viewing.unwrap_or_else(|| model.viewing());
    if asked != model.viewing() && !model.descriptor().knows_viewing() {
        refuse!(
            "--viewing {asked}: this model was trained for {}, \
             and its descriptor does not know what other conditions change",
            model.viewing()
        );
    }
    Ok(asked)
}
