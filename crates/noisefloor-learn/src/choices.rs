//! The constants of the visible descriptor, and what else could have been chosen: one table with the numbers
//! for all choices, from which each choice's own table is made without any picture.

use crate::describe::{Alone, in_picture};
use crate::table::{Table, Zone};
use noisefloor::{
    Described, Descriptor, DescriptorError, DescriptorKind, DescriptorSpec, TileDescriptor, TilePlanes,
};
use std::collections::BTreeMap;

/// Orders of the mean over a tile: 4 is that of most vision models, 8 looks for the worst spot.
const ORDERS: [u32; 2] = [4, 8];
/// Pooled differences at which noise is just too strong: near what people just see, and twice as much.
const DIFFERENCES: [u32; 2] = [20, 40];
/// Quantiles of noise over the tiles that are the noise of the picture: the typical tile, and the noisier ones.
const PICTURE_QUANTILES: [f64; 2] = [0.5, 0.75];
/// Numbers that are left out, simplest first: the noise of the tile decides; then also that of its picture; then
/// also the picture's light.
const LEFT_OUT: [&[&str]; 3] = [
    &["texture", "light", "picture_noise", "picture_light"],
    &["texture", "light", "picture_light"],
    &["texture", "light"],
];

/// Numbers for every choice of constants in the visible descriptor: a descriptor for tables, not for models.
pub const VISIBLE_CHOICES: DescriptorKind = DescriptorKind {
    name: "visible-choices",
    make: |_| VisibleChoices::new().map(Descriptor::new).map_err(|e| e.to_string()),
};

/// One of the choices.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The constants, and the numbers that are used.
    pub name: String,
    /// How many numbers are weighed: how much there is to learn.
    pub learned: usize,
    /// The zones, described so.
    pub table: Table,
}

/// Numbers of the visible descriptor.
const LEARNED: usize = 5;

#[derive(Debug)]
struct VisibleChoices {
    descriptors: Vec<Descriptor>,
}

fn visible(order: u32, difference: u32, picture_quantile: f64) -> Result<Descriptor, DescriptorError> {
    let numbers = [
        ("order", f64::from(order)),
        ("difference", f64::from(difference)),
        ("picture_quantile", picture_quantile),
    ];
    let parameters = numbers.map(|(name, number)| (name.to_owned(), number)).into();
    Descriptor::from_spec(&DescriptorSpec { name: "visible".to_owned(), parameters }, &[])
}

/// Every order with every difference.
fn constants() -> impl Iterator<Item = (u32, u32)> {
    ORDERS.into_iter().flat_map(|order| DIFFERENCES.map(|difference| (order, difference)))
}

impl VisibleChoices {
    fn new() -> Result<Self, DescriptorError> {
        let descriptors =
            constants().map(|(order, difference)| visible(order, difference, PICTURE_QUANTILES[0]));
        Ok(Self { descriptors: descriptors.collect::<Result<_, _>>()? })
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
        let noise = constants().map(|(order, difference)| format!("noise_{order}_{difference}"));
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

/// A table for each choice, from one of [`VISIBLE_CHOICES`], the simplest first.
///
/// # Errors
/// [`DescriptorError`] if the table is of another descriptor.
pub fn choices(table: &Table) -> Result<Vec<Choice>, DescriptorError> {
    if table.descriptor.name() != VISIBLE_CHOICES.name {
        let name = table.descriptor.name().to_owned();
        return Err(DescriptorError::Unknown { name, known: VISIBLE_CHOICES.name.to_owned() });
    }
    let mut choices = Vec::new();
    for names in LEFT_OUT {
        let whole_picture = !names.contains(&"picture_noise");
        for (column, (order, difference)) in constants().enumerate() {
            for quantile in PICTURE_QUANTILES.into_iter().take(if whole_picture { usize::MAX } else { 1 }) {
                let all = chosen(table, column, &visible(order, difference, quantile)?);
                let picture =
                    if whole_picture { format!(", picture quantile {quantile}") } else { String::new() };
                let name =
                    format!("order {order}, difference {difference}{picture}, without {}", names.join(", "));
                let names: Vec<String> = names.iter().map(|&name| name.to_owned()).collect();
                let learned = LEARNED - names.len();
                let without = all.without(&names);
                choices.extend(without.map(|table| Choice { name, learned, table }));
            }
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
            let described = Described { own, spp: level.spp, area: 1.0 };
            Alone { spp: level.spp, origin: level.origin, noise: level.noise, described }
        });
        let empty = Zone { levels: Vec::new(), ..zone.clone() };
        scenes.entry(&zone.scene).or_default().push((empty, alone.collect()));
    }
    let zones = scenes.into_values().flat_map(|zones| in_picture(zones, descriptor)).collect();
    Table { descriptor: descriptor.clone(), zones, ..table.clone() }
}
