//! The constants of the visible descriptor, and what else could have been chosen: one table with the numbers
//! for all choices, from which each choice's own table is made without any picture.

use crate::describe::{Alone, in_picture};
use crate::table::{Table, Zone};
use noisefloor::{
    Tile,
    descriptor::{Described, Descriptor, DescriptorError, DescriptorKind, DescriptorSpec, TileDescriptor},
    evidence::TilePlanes,
};
use std::collections::BTreeMap;

/// Edges of the windows in which people look for noise, in degrees: 28, 20 and 36 pixels on a monitor. The first stays
/// where no other is shown to be better.
const WINDOWS: [f64; 3] = [0.75, 0.5, 1.0];
/// Quantiles of noise over the tiles that are the noise of the picture: what an eighth or a quarter of the picture
/// exceeds, or the noise of the typical tile. All folds chose the first while noise was a mean over tiles.
const PICTURE_QUANTILES: [f64; 3] = [0.875, 0.75, 0.5];
/// No choice: of people's zones hardly any has noise in so few pixels.
const CREST: f64 = 1.35;
/// No choice: it was taken for what the worst places of a picture lose by the vision model, which people's thresholds
/// do not ask for. Offered beside 1.5, it would be turned down without eight of ten groups, and the
/// error would be that of another model.
const BESIDE_PICTURE: f64 = 0.8;

/// Numbers for every choice of constants in the visible descriptor: a descriptor for tables, not for models.
pub const VISIBLE_CHOICES: DescriptorKind = DescriptorKind {
    name: "visible-choices",
    make: |_| VisibleChoices::new().map(Descriptor::new).map_err(|e| e.to_string()),
};

#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    pub name: String,
    /// The zones, described so.
    pub table: Table,
}

#[derive(Debug)]
struct VisibleChoices {
    descriptors: Vec<Descriptor>,
}

fn visible(window: f64, picture_quantile: f64) -> Result<Descriptor, DescriptorError> {
    let numbers = [
        ("window", window),
        ("picture_quantile", picture_quantile),
        ("crest", CREST),
        ("beside_picture", BESIDE_PICTURE),
    ];
    let parameters = numbers.map(|(name, number)| (name.to_owned(), number)).into();
    Descriptor::from_spec(&DescriptorSpec { name: "visible".to_owned(), parameters }, &[])
}

impl VisibleChoices {
    fn new() -> Result<Self, DescriptorError> {
        let descriptors = WINDOWS.map(|window| visible(window, PICTURE_QUANTILES[0]));
        Ok(Self { descriptors: descriptors.into_iter().collect::<Result<_, _>>()? })
    }
}

impl TileDescriptor for VisibleChoices {
    fn name(&self) -> &'static str {
        VISIBLE_CHOICES.name
    }

    fn version(&self) -> u16 {
        self.descriptors[0].version()
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        BTreeMap::new()
    }

    fn number_names(&self) -> Vec<String> {
        let noise = WINDOWS.iter().map(|window| format!("noise_{window}"));
        noise.chain(["texture".to_owned(), "light".to_owned()]).collect()
    }

    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError> {
        let mut own = Vec::new();
        let mut rest = Vec::new();
        for descriptor in &self.descriptors {
            rest = descriptor.describe(planes)?;
            own.push(rest.remove(0));
        }
        own.extend(rest);
        Ok(own)
    }

    fn knows_viewing(&self) -> bool {
        true
    }
}

/// A table for each choice, from one of [`VISIBLE_CHOICES`]. What is weighed is no choice: weights are shrunk instead.
pub fn choices(table: &Table) -> Result<Vec<Choice>, DescriptorError> {
    if table.descriptor.name() != VISIBLE_CHOICES.name {
        let name = table.descriptor.name().to_owned();
        return Err(DescriptorError::Unknown { name, known: VISIBLE_CHOICES.name.to_owned() });
    }
    let mut choices = Vec::new();
    for (column, window) in WINDOWS.into_iter().enumerate() {
        for quantile in PICTURE_QUANTILES {
            let name = format!("window {window}°, picture quantile {quantile}");
            let table = chosen(table, column, &visible(window, quantile)?);
            choices.push(Choice { name, table });
        }
    }
    Ok(choices)
}

/// The table with the noise of one column.
fn chosen(table: &Table, column: usize, descriptor: &Descriptor) -> Table {
    let mut scenes: BTreeMap<&str, Vec<(Zone, Vec<Alone>)>> = BTreeMap::new();
    for zone in &table.zones {
        let alone = zone.levels.iter().map(|level| {
            let rest = &level.descriptor[level.descriptor.len() - 2..];
            let own = vec![level.descriptor[column], rest[0], rest[1]];
            // Zones of a scene are of one size
            let place = Tile { index: 0, x: 0, y: 0, width: 1, height: 1 };
            let described = Described { own, spp: level.spp, place, window: 1, blocks: Vec::new() };
            Alone { spp: level.spp, origin: level.origin, noise: level.noise, described }
        });
        let empty = Zone { levels: Vec::new(), ..zone.clone() };
        scenes.entry(&zone.scene).or_default().push((empty, alone.collect()));
    }
    let zones = scenes.into_values().flat_map(|zones| in_picture(zones, descriptor)).collect();
    Table { descriptor: descriptor.clone(), numbers: descriptor.number_names(), zones, ..table.clone() }
}
