use noisefloor::{
    Model, TileGrid, ToneMapping, Viewing,
    descriptor::{Described, Descriptor, DescriptorError, DescriptorKind, TileDescriptor},
    evidence::{Evidence, TilePlanes},
    model::ModelError,
};
use noisefloor_learn::{
    Level, Origin, SvmParams, Table, TrainParams, Zone, read_table_with, train, write_table,
};
use std::collections::BTreeMap;

/// The logarithm of the standard deviation of the residual: one number, and all of it noise.
#[derive(Debug)]
struct PlainNoise {
    floor: f64,
}

const KIND: DescriptorKind = DescriptorKind {
    name: "plain-noise",
    make: |parameters| match parameters.get("floor") {
        Some(&floor) if floor > 0.0 => Ok(Descriptor::new(PlainNoise { floor })),
        _ => Err("its floor must be a positive number".into()),
    },
};

impl TileDescriptor for PlainNoise {
    fn name(&self) -> &'static str {
        KIND.name
    }

    fn version(&self) -> u16 {
        1
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        BTreeMap::from([("floor".to_owned(), self.floor)])
    }

    fn number_names(&self) -> Vec<String> {
        vec!["log_noise".into()]
    }

    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError> {
        let variance = planes.residual.values().iter().map(|&v| f64::from(v).powi(2)).sum::<f64>();
        Ok(vec![(0.5 * (variance / planes.residual.values().len() as f64 + self.floor).ln()) as f32])
    }

    fn project(&self, raw: &mut [f32], factor: f32) -> bool {
        let variance = ((2.0 * f64::from(raw[0])).exp() - self.floor).max(0.0) / f64::from(factor);
        raw[0] = (0.5 * (variance + self.floor).ln()) as f32;
        true
    }
}

/// A checkerboard of noise of this amplitude, whose standard deviation it is.
fn planes(amplitude: f32) -> TilePlanes {
    let tile = TileGrid::new(32, 32, 32).unwrap().tile(0);
    let sign = |x: usize, y: usize| if (x + y).is_multiple_of(2) { amplitude } else { -amplitude };
    TilePlanes::gather((32, 32), tile, |x, y| ([0.5; 3], [sign(x, y); 3]))
}

/// Zones whose observers stop at a noise of 0.01.
fn table(descriptor: &Descriptor) -> Table {
    let level = |noise_at_one: f64, spp: f64| Level {
        spp,
        origin: Origin::Synthesised,
        noise: (noise_at_one / spp.sqrt()) as f32,
        descriptor: descriptor.describe(&planes((noise_at_one / spp.sqrt()) as f32)).unwrap(),
    };
    let zone = |number: u32| {
        let noise_at_one = 0.1 + 0.02 * f64::from(number);
        let (scene, human_spp) = (format!("scene{}", number % 4), (noise_at_one / 0.01).powi(2));
        Zone {
            group: scene.clone(),
            scene,
            zone: number,
            human_spp,
            censored: false,
            first_spp: 10.0,
            last_spp: 10_000.0,
            reference_spp: f64::INFINITY,
            levels: (0..24).map(|i| level(noise_at_one, 10.0 * 1.35f64.powi(i))).collect(),
        }
    };
    let (evidence, tone_mapping) = (Evidence::Halves, ToneMapping::Srgb { exposure: 1.0 });
    let zones = (0..16).map(zone).collect();
    Table {
        descriptor: descriptor.clone(),
        evidence,
        tone_mapping,
        viewing: Viewing::default(),
        numbers: descriptor.number_names(),
        zones,
        answers: vec![],
    }
}

/// CONTRIBUTING's recipe "One more descriptor", followed outside the library: describe, keep as a table,
/// train, judge, and keep as a model, which only those can read who know the kind.
#[test]
fn one_more_descriptor_is_added_in_one_place() {
    let descriptor = Descriptor::new(PlainNoise { floor: 1e-8 });
    let table = table(&descriptor);
    let mut file = Vec::new();
    write_table(&table, &mut file).unwrap();
    assert_eq!(read_table_with(&file[..], &[KIND]).unwrap(), table);

    let params = TrainParams { candidates: vec![SvmParams { c: 1.0, gamma: 0.1 }], ..TrainParams::svm() };
    let model = train(&table, &params, "made for a test".into(), None).unwrap();
    let p = |amplitude: f32| {
        let Described { own, .. } = descriptor.describe_tile(&planes(amplitude), 100.0).unwrap();
        model.judge(&own).probability
    };
    assert!(p(0.003) > 0.95 && p(0.03) < 0.2, "{} {}", p(0.003), p(0.03));

    let mut file = Vec::new();
    model.write(&mut file).unwrap();
    assert_eq!(Model::read_with(&file[..], &[KIND]).unwrap(), model);
    let error = Model::read(&file[..]).unwrap_err();
    assert!(
        matches!(error, ModelError::UnknownDescriptor(_)) && error.to_string().contains("plain-noise"),
        "{error}"
    );
}
