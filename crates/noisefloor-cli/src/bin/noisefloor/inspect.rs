//! `noisefloor inspect` and `noisefloor scenes`.

use crate::args::InspectArgs;
use noisefloor::oracle::Spread;
use noisefloor::svm::Machine;
use noisefloor::{
    Audience, Model, ToneMapping,
    descriptor::DescriptorSpec,
    evidence::Evidence,
    model::{Scores, TrainingRecord},
};
use noisefloor_cli::options::oracle::load_model;
use noisefloor_cli::say::{NotSaid, say, say_json};
use noisefloor_ptwne::scenes;
use serde::Serialize;

/// What there is to say of a model, without its numbers.
#[derive(Serialize)]
struct Summary<'a> {
    digest: String,
    descriptor: DescriptorSpec,
    descriptor_version: u16,
    numbers: usize,
    evidence: Evidence,
    tone_mapping: ToneMapping,
    /// `line` or `svm`.
    machine: &'static str,
    support_vectors: Option<usize>,
    /// How thresholds scatter around what the model expects, as standard deviations of ln(samples).
    spread: Option<Spread>,
    /// Zones whose texture is familiar, and how far around them it still is, in standard deviations; null
    /// if all is.
    familiar_zones: Option<usize>,
    familiar_reach: Option<f32>,
    audience: Audience,
    record: &'a TrainingRecord,
}

impl<'a> Summary<'a> {
    fn of(model: &'a Model) -> Self {
        let (descriptor, machine, record) = (model.descriptor(), &model.classifier().machine, model.record());
        Self {
            digest: model.digest(),
            descriptor: descriptor.spec(),
            descriptor_version: descriptor.version(),
            numbers: descriptor.dimensions(),
            evidence: model.evidence(),
            tone_mapping: model.tone_mapping(),
            machine: machine.name(),
            support_vectors: match machine {
                Machine::Line(_) => None,
                Machine::Svm(svm) => Some(svm.coefficients.len()),
            },
            spread: model.spread(),
            familiar_zones: model.familiarity().map(|f| f.zones.len()),
            familiar_reach: model.familiarity().map(|f| f.reach),
            audience: model.audience(),
            record,
        }
    }
}

pub fn run(args: &InspectArgs) -> anyhow::Result<()> {
    let model = load_model(args.model.as_deref())?;
    let summary = Summary::of(&model);
    if args.json {
        say_json(&summary)?;
    } else {
        say_all(&summary)?;
    }
    Ok(())
}

fn say_all(summary: &Summary<'_>) -> Result<(), NotSaid> {
    let Summary { descriptor, record, audience, .. } = summary;
    say!("digest           {}", summary.digest)?;
    say!(
        "descriptor       {} (version {}), {} numbers",
        descriptor.name,
        summary.descriptor_version,
        summary.numbers
    )?;
    say!(
        "evidence         {}",
        match summary.evidence {
            Evidence::Halves => "the other half buffer",
            Evidence::Reference => "a ray-traced reference",
        }
    )?;
    say!(
        "trained through  {}",
        match &summary.tone_mapping {
            ToneMapping::Srgb { exposure } => format!("plain sRGB, exposure {exposure}"),
            ToneMapping::Custom { exposure, curve } =>
                format!("a curve of its own ({}), exposure {exposure}", curve.digest()),
            ToneMapping::Reinhard { key, white: None } => format!("Reinhard, key {key}"),
            ToneMapping::Reinhard { key, white: Some(white) } =>
                format!("Reinhard, key {key}, white {white}"),
            ToneMapping::ReinhardAt { exposure, .. } => format!("Reinhard, exposure {exposure}"),
            other => format!("{other:?}"),
        }
    )?;
    let machine = match summary.support_vectors {
        None => "straight line".to_owned(),
        Some(count) => format!("RBF kernel with {count} support vectors, γ = {}", record.gamma),
    };
    say!("machine          {machine}, C = {}, of {} examples", record.c, record.examples)?;
    if let Some(Spread { scenes, people }) = summary.spread {
        say!(
            "thresholds       scatter by {scenes:.2} between scenes and {people:.2} between people, in ln(samples)"
        )?;
    }
    if let (Some(zones), Some(reach)) = (summary.familiar_zones, summary.familiar_reach) {
        say!("familiar         {zones} zones, and textures within {reach:.3} standard deviations of them")?;
    }
    say!("audience         T' = {} T + {}", audience.slope, audience.offset)?;
    say!("trained on       {}", record.corpus)?;
    say!("scenes           {}", record.scenes.join(", "))?;
    say!("table            {}", record.table_digest)?;
    match record.leave_one_scene_out {
        Some(Scores { zones, error_factor, bias_factor, early_share }) => say!(
            "left-out scenes  {zones} zones: error factor {error_factor:.3}, bias factor {bias_factor:.3}, {:.1} % stopped below half",
            100.0 * early_share
        ),
        None => say!("left-out scenes  not scored"),
    }
}

pub fn scenes() -> Result<(), NotSaid> {
    let show = |heading, scenes: &mut dyn Iterator<Item = scenes::BuiltInScene>| {
        say!("{heading}")?;
        for scene in scenes {
            say!("  {:16} {}", scene.name, scene.description)?;
        }
        Ok::<_, NotSaid>(())
    };
    show("Scenes to render:", &mut scenes::list())?;
    show("Stiff scenes, each hard on a renderer:", &mut scenes::stiff())
}
